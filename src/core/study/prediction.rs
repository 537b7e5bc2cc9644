//! `[[prediction]]`: quantities the calibrated study is asked for.

use crate::data::toml_strict::{TableView, TomlError, TomlProblem, ValueView};
use crate::data::{Condition, Conditions, Control, Dataset, FrfQuantity, ModalTable, Record, StoredEnergy};
use crate::explain::Explain;
use crate::model::{ModelError, System};
use crate::units::{Dimension, Quantity, Unit, parse_unit};

use super::engineering;
use super::settings::unknown;
use super::site::along;

/// One prediction.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictionSpec {
    /// Name of the case.
    pub case: String,
    /// What is computed.
    pub quantity: Predicted,
    /// Conditions of the case.
    pub conditions: Conditions,
    /// Known value to compare with.
    pub reference: Option<Quantity>,
    /// Line in study.toml.
    pub line: usize,
}

/// A number a cycle gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CycleQuantity {
    /// W_D, energy dissipated per cycle [J].
    Dissipated,
    /// W_s, equivalent elastic energy [J], by one of its readings.
    Stored(StoredEnergy),
    /// D = W_D / W_s.
    LossRatio(StoredEnergy),
    /// Slope of the branch-mean force over the middle 60 % of travel [N/m].
    Stiffness,
    /// Greatest minus least force [N].
    ForceRange,
    /// Greatest minus least displacement [m].
    DisplacementRange,
}

/// What is computed.
#[derive(Clone, Debug, PartialEq)]
pub enum Predicted {
    /// A number of the settled cycle.
    Cycle {
        /// Which.
        quantity: CycleQuantity,
        /// The place that is driven.
        at: String,
        /// What is controlled.
        control: Control,
        /// Least and greatest force or displacement [SI].
        limits: (f64, f64),
        /// Drive frequency [Hz].
        frequency: f64,
    },
    /// Greatest minus least displacement of the settled cycle at another place than the one that is driven [m].
    Travel {
        /// The place that is driven.
        at: String,
        /// `name.axis` of the displacement.
        respond: String,
        /// What is controlled.
        control: Control,
        /// Least and greatest force or displacement [SI].
        limits: (f64, f64),
        /// Drive frequency [Hz].
        frequency: f64,
    },
    /// Natural frequency [Hz] of a mode, from 1.
    Frequency(u32),
    /// Modal damping ratio of a mode, from 1.
    Damping(u32),
    /// f / f' - 1: the natural frequency of a mode in one modal test over that in another, by the pairing of the tables.
    Shift {
        /// Id of the test.
        test: String,
        /// Id of the test it is compared with.
        against: String,
        /// Number of the mode in both tables.
        mode: u32,
    },
    /// Greatest minus least displacement in a sweep: a force `mean + amplitude sin(phase)` whose frequency rises linearly with time.
    Sweep {
        /// `name.axis` of the force.
        at: String,
        /// `name.axis` of the displacement.
        respond: String,
        /// Mean force [N]; what the loads that stay do not carry already.
        mean: f64,
        /// Amplitude of the force [N].
        amplitude: f64,
        /// Frequency at the start and at the end [Hz].
        frequencies: (f64, f64),
        /// Duration [s].
        duration: f64,
    },
    /// |H| at one frequency.
    Frf {
        /// What H is.
        quantity: FrfQuantity,
        /// `name.axis` of the force.
        excite: String,
        /// `name.axis` of the response.
        respond: String,
        /// Frequency [Hz].
        frequency: f64,
        /// Peak force [N]; none is small signal.
        excitation: Option<f64>,
    },
}

#[derive(Clone, Copy)]
enum Word {
    Dissipated,
    Stored,
    Ratio,
    Stiffness,
    ForceRange,
    DisplacementRange,
    Frequency,
    Damping,
    Shift,
    Sweep,
    Frf(FrfQuantity),
}

const WORDS: [(&str, Word); 13] = [
    ("W_D", Word::Dissipated),
    ("W_s", Word::Stored),
    ("D", Word::Ratio),
    ("stiffness", Word::Stiffness),
    ("force_range", Word::ForceRange),
    ("displacement_range", Word::DisplacementRange),
    ("natural_frequency", Word::Frequency),
    ("modal_damping", Word::Damping),
    ("frequency_shift", Word::Shift),
    ("sweep_range", Word::Sweep),
    ("accelerance", Word::Frf(FrfQuantity::Accelerance)),
    ("mobility", Word::Frf(FrfQuantity::Mobility)),
    ("receptance", Word::Frf(FrfQuantity::Receptance)),
];

/// The words of `quantity`.
pub(in crate::study) fn words() -> Vec<&'static str> {
    WORDS.iter().map(|w| w.0).collect()
}

impl Predicted {
    /// The word of `quantity` in study.toml.
    pub fn word(&self) -> &'static str {
        match self {
            Predicted::Cycle { quantity, .. } => match quantity {
                CycleQuantity::Dissipated => "W_D",
                CycleQuantity::Stored(_) => "W_s",
                CycleQuantity::LossRatio(_) => "D",
                CycleQuantity::Stiffness => "stiffness",
                CycleQuantity::ForceRange => "force_range",
                CycleQuantity::DisplacementRange => "displacement_range",
            },
            Predicted::Travel { .. } => "displacement_range",
            Predicted::Frequency(_) => "natural_frequency",
            Predicted::Damping(_) => "modal_damping",
            Predicted::Shift { .. } => "frequency_shift",
            Predicted::Sweep { .. } => "sweep_range",
            Predicted::Frf { quantity, .. } => FrfQuantity::WORDS.iter().find(|w| w.1 == *quantity).map_or("", |w| w.0),
        }
    }

    /// The dimension of the number.
    pub fn dimension(&self) -> Dimension {
        let force = |at: &str| along(&[Dimension::FORCE, Dimension::MOMENT], at);
        let length = |at: &str| along(&[Dimension::LENGTH, Dimension::ANGLE], at);
        match self {
            Predicted::Cycle { quantity, at, .. } => match quantity {
                CycleQuantity::Dissipated | CycleQuantity::Stored(_) => Dimension::ENERGY,
                CycleQuantity::LossRatio(_) => Dimension::DIMENSIONLESS,
                CycleQuantity::Stiffness => force(at).over(length(at)),
                CycleQuantity::ForceRange => force(at),
                CycleQuantity::DisplacementRange => length(at),
            },
            Predicted::Travel { respond, .. } | Predicted::Sweep { respond, .. } => length(respond),
            Predicted::Frequency(_) => Dimension::FREQUENCY,
            Predicted::Damping(_) | Predicted::Shift { .. } => Dimension::DIMENSIONLESS,
            Predicted::Frf { quantity, excite, respond, .. } => {
                length(respond).over(Dimension::TIME.power(quantity.derivatives() as i8)).over(force(excite))
            }
        }
    }
}

/// Reads every `[[prediction]]`.
pub(super) fn read(root: &TableView<'_>, system: &System, dataset: &Dataset) -> Result<Vec<PredictionSpec>, TomlError> {
    let mut all = Vec::new();
    for table in root.tables("prediction")? {
        if table.get("quantity").and_then(|v| v.string().ok()) == Some("frequency_shift") {
            all.extend(shifts(&table, dataset)?);
        } else {
            all.push(one(&table, system, dataset)?);
        }
    }
    Ok(all)
}

/// `quantity = "frequency_shift"`: one prediction for each of `modes`, with the printed shift as reference.
fn shifts(table: &TableView<'_>, dataset: &Dataset) -> Result<Vec<PredictionSpec>, TomlError> {
    table.only(&["case", "quantity", "test", "against", "modes"])?;
    let case = table.string("case")?.to_string();
    let modal = |key: &str| {
        let value = table.require(key, "the id of a modal test")?;
        let id = value.string()?;
        match dataset.test(id).map(|t| &t.record) {
            Some(Record::Modal(modes)) => Ok((id.to_string(), modes)),
            _ => {
                let known = dataset.tests.iter().filter(|t| matches!(t.record, Record::Modal(_)));
                Err(unknown(&value, "modal test", id, known.map(|t| t.id.as_str())))
            }
        }
    };
    let ((test, here), (against, there)) = (modal("test")?, modal("against")?);
    let value = table.require("modes", "[1, 2, 3]")?;
    let one = |v: &ValueView<'_>| {
        let mode = v.integer(1, 1_000_000)? as u32;
        let of = |m: &ModalTable| m.rows.iter().find(|r| r.mode == mode).map(|r| r.frequency.value);
        let (Some(a), Some(b)) = (of(here), of(there)) else {
            return Err(v.refuse(format!("mode {mode} does not stand in both `{test}` and `{against}`"), "a mode of both tests"));
        };
        let percent = parse_unit("%", Dimension::DIMENSIONLESS).unwrap_or_else(|_| Unit::si(Dimension::DIMENSIONLESS));
        Ok(PredictionSpec {
            case: format!("{case}, mode {mode}"),
            quantity: Predicted::Shift { test: test.clone(), against: against.clone(), mode },
            conditions: Conditions::new(),
            reference: Some(Quantity { value: a / b - 1.0, unit: percent }),
            line: table.line(),
        })
    };
    let list = value.list()?;
    if list.is_empty() {
        return Err(value.refuse("no mode", "at least one"));
    }
    list.iter().map(one).collect()
}

fn one(table: &TableView<'_>, system: &System, dataset: &Dataset) -> Result<PredictionSpec, TomlError> {
    let words = WORDS.map(|w| w.0).join(", ");
    let word = table.require("quantity", &format!("one of {words}"))?.word("quantity", &WORDS)?;
    let common = ["case", "quantity", "conditions", "reference"];
    let case = table.string("case")?.to_string();
    let conditions = conditions(table, dataset)?;
    let quantity = match word {
        Word::Sweep => {
            let keys = ["at", "respond", "mean", "amplitude", "frequency_from", "frequency_to", "duration"];
            table.only(&[&common[..], &keys].concat())?;
            let dof = |key: &str| -> Result<String, TomlError> {
                let value = table.require(key, "a body or part and axis, such as \"P.x\"")?;
                let name = value.string()?;
                let e = || ModelError::no_such("degree of freedom", name, (0..system.model.dofs.len()).map(|d| system.model.dof_name(d)));
                system.model.dof(name).ok_or_else(|| value.refuse(e().to_string(), e().accepted()))?;
                Ok(name.to_string())
            };
            let (at, respond) = (dof("at")?, dof("respond")?);
            let force = along(&[Dimension::FORCE, Dimension::MOMENT], &at);
            let of = |key: &str, dimension: Dimension| positive(&table.require(key, dimension.examples().as_str())?, dimension);
            Predicted::Sweep {
                mean: table.optional("mean", |v| v.quantity(force).map(|q| q.value))?.unwrap_or(0.0),
                amplitude: of("amplitude", force)?,
                frequencies: (of("frequency_from", Dimension::FREQUENCY)?, of("frequency_to", Dimension::FREQUENCY)?),
                duration: of("duration", Dimension::TIME)?,
                at,
                respond,
            }
        }
        // Read by `shifts`.
        Word::Shift => return Err(table.refuse("a shift is read from its tables", "test, against and modes")),
        Word::Frequency | Word::Damping => {
            table.only(&[&common[..], &["mode"]].concat())?;
            let mode = table.require("mode", "1, 2, ...")?.integer(1, 1_000_000)? as u32;
            if matches!(word, Word::Frequency) { Predicted::Frequency(mode) } else { Predicted::Damping(mode) }
        }
        Word::Frf(quantity) => {
            table.only(&[&common[..], &["excite", "respond", "frequency", "excitation"]].concat())?;
            let end = |key: &str| -> Result<String, TomlError> {
                let value = table.require(key, "a place such as \"m1.x\"")?;
                place(&value, system).map(str::to_string)
            };
            let (excite, respond) = (end("excite")?, end("respond")?);
            let frequency = positive(&table.require("frequency", "a frequency such as \"120 Hz\"")?, Dimension::FREQUENCY)?;
            let force = along(&[Dimension::FORCE, Dimension::MOMENT], &excite);
            let excitation = table.optional("excitation", |v| positive(&v, force))?;
            Predicted::Frf { quantity, excite, respond, frequency, excitation }
        }
        _ => {
            let keys = ["at", "control", "force_min", "force_max", "displacement_min", "displacement_max", "amplitude", "mean"];
            let own: &[&str] = match word {
                Word::Stored | Word::Ratio => &["W_s_reading"],
                Word::DisplacementRange => &["respond"],
                _ => &[],
            };
            table.only(&[&common[..], &keys, own].concat())?;
            let readings = [("slope", StoredEnergy::Slope), ("product", StoredEnergy::Product)];
            let reading = table.optional("W_s_reading", |v| v.word("reading of W_s", &readings))?.unwrap_or(StoredEnergy::Slope);
            let quantity = match word {
                Word::Stored => CycleQuantity::Stored(reading),
                Word::Ratio => CycleQuantity::LossRatio(reading),
                Word::Stiffness => CycleQuantity::Stiffness,
                Word::ForceRange => CycleQuantity::ForceRange,
                Word::DisplacementRange => CycleQuantity::DisplacementRange,
                _ => CycleQuantity::Dissipated,
            };
            let at = place(&table.require("at", "the place that is driven, such as \"c1.x\"")?, system)?.to_string();
            let control = table.require("control", "\"force\" or \"displacement\"")?.word("control", &Control::WORDS)?;
            let limits = limits(table, control, &at)?;
            let frequency = conditions.get("frequency").map(|c| c.value).ok_or_else(|| {
                let accepted = "conditions = { frequency = \"1 Hz\" }".to_string();
                table.error(TomlProblem::MissingKey { key: "frequency".into(), accepted })
            })?;
            match table.optional("respond", |v| place(&v, system).map(str::to_string))? {
                Some(respond) => Predicted::Travel { at, respond, control, limits, frequency },
                None => Predicted::Cycle { quantity, at, control, limits, frequency },
            }
        }
    };
    let reference = table.optional("reference", |v| v.quantity(quantity.dimension()))?;
    Ok(PredictionSpec { case, quantity, conditions, reference, line: table.line() })
}

fn positive(value: &ValueView<'_>, dimension: Dimension) -> Result<f64, TomlError> {
    let q = value.quantity(dimension)?;
    if q.value > 0.0 { Ok(q.value) } else { Err(value.refuse(format!("{q} is not above 0"), format!("a {} above 0", dimension.name()))) }
}

/// A connector's or a body's axis that is in the model.
pub(super) fn place<'a>(value: &ValueView<'a>, system: &System) -> Result<&'a str, TomlError> {
    let text = value.string()?;
    let model = &system.model;
    let known = || (0..model.places.len()).map(|p| model.place_name(p)).chain((0..model.dofs.len()).map(|d| model.dof_name(d)));
    if model.place(text).is_some() || model.dof(text).is_some() {
        return Ok(text);
    }
    let e = ModelError::no_such("place", text, known());
    Err(value.refuse(e.to_string(), e.accepted()))
}

pub(super) fn limits(table: &TableView<'_>, control: Control, at: &str) -> Result<(f64, f64), TomlError> {
    let (dimension, min, max) = match control {
        Control::Force => (along(&[Dimension::FORCE, Dimension::MOMENT], at), "force_min", "force_max"),
        Control::Displacement => (along(&[Dimension::LENGTH, Dimension::ANGLE], at), "displacement_min", "displacement_max"),
    };
    let wrong = if control == Control::Force { "displacement_" } else { "force_" };
    if let Some((_, v)) = table.entries().find(|(key, _)| key.starts_with(wrong) && key.ends_with(['n', 'x'])) {
        return Err(
            v.refuse(format!("not a limit under {} control", control.role().word()), format!("{min} and {max}, or amplitude and mean"))
        );
    }
    let read = |key: &str| table.optional(key, |v| v.quantity(dimension).map(|q| q.value));
    match (read(min)?, read(max)?, read("amplitude")?, read("mean")?) {
        (Some(low), Some(high), None, None) if low < high => Ok((low, high)),
        (None, None, Some(a), mean) if a > 0.0 => Ok((mean.unwrap_or(0.0) - a, mean.unwrap_or(0.0) + a)),
        _ => Err(table.refuse(
            "the limits of the cycle are not there, not complete, crossed or given twice",
            format!("{min} below {max}, or amplitude above 0 and mean"),
        )),
    }
}

/// Conditions of a case: those the dataset states keep their dimension; `frequency` is always one.
fn conditions(table: &TableView<'_>, dataset: &Dataset) -> Result<Conditions, TomlError> {
    let mut all = Conditions::new();
    let Some(value) = table.get("conditions") else { return Ok(all) };
    for (name, value) in value.table()?.entries() {
        let known = engineering::condition(dataset, name).map(|u| u.dimension);
        let expected = if name == "frequency" { Some(Dimension::FREQUENCY) } else { known };
        let spread = value.spread(expected)?;
        if name == "frequency" && spread.quantity.value <= 0.0 {
            return Err(value.refuse(format!("a frequency of {}", spread.quantity), "a frequency above 0 Hz"));
        }
        let condition = Condition { value: spread.quantity.value, unit: spread.quantity.unit, sigma: spread.sigma, line: value.line() };
        all.insert(name.to_string(), condition);
    }
    Ok(all)
}

impl PredictionSpec {
    /// The dimension of the number, by which it is printed.
    pub fn dimension(&self) -> Dimension {
        self.quantity.dimension()
    }
}
