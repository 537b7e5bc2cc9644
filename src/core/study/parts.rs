//! Tolerances of parts in `[tolerance]`: their distributions and correlations, the bands to keep, the way to the conditions, the synthesis.

use schemars::JsonSchema;

use crate::data::schema::Quantity;
use crate::data::toml_strict::{TableView, TomlError, ValueView};
use crate::tolerance::{PartTolerance, Shape, deviation, sequence};
use crate::units::{Dimension, Quantity as Value};

use super::settings::unknown;

/// A quantity that a band may bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Banded {
    /// Dissipated energy per cycle [J].
    Dissipated,
    /// Equivalent elastic energy [J].
    Stored,
    /// Stiffness of the cycle, range of force over range of displacement along the branch-mean force: range^2 / (2 W_s) under force control, 2 W_s / range^2
    /// under displacement control [N/m, N m/rad].
    Stiffness,
    /// Natural frequency of a mode, from 1, of small motion at the conditions of the assembly [Hz].
    Frequency(u32),
}

impl Banded {
    /// The words of study.toml and of the results; the mode of a frequency stands beside its word.
    const WORDS: [(&'static str, Banded); 4] = [
        ("W_D", Banded::Dissipated),
        ("W_s", Banded::Stored),
        ("stiffness", Banded::Stiffness),
        ("natural_frequency", Banded::Frequency(1)),
    ];

    /// The word.
    pub fn word(self) -> &'static str {
        let same = |other: Banded| std::mem::discriminant(&other) == std::mem::discriminant(&self);
        Self::WORDS.iter().find(|w| same(w.1)).map_or("", |w| w.0)
    }

    /// The mode of a frequency.
    pub fn mode(self) -> Option<u32> {
        if let Banded::Frequency(mode) = self { Some(mode) } else { None }
    }

    /// The word with the mode, for people.
    pub fn name(self) -> String {
        self.mode().map_or_else(|| self.word().to_string(), |mode| format!("natural frequency {mode}"))
    }
}

/// A band: least and greatest value [SI], infinite where there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// What is bounded.
    pub quantity: Banded,
    /// Its limits [SI].
    pub limits: (f64, f64),
    /// Unit for printing.
    pub unit: crate::units::Unit,
    /// Line in study.toml.
    pub line: usize,
}

/// Columns of the contact area, and the condition that follows from it by eq. 6.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembly {
    /// Least and greatest area of a case.
    pub area: [String; 2],
    /// Condition that is the constant over the area.
    pub interference: Option<String>,
    /// The constant i A [m3]; by least squares over the cases where it is not stated.
    pub constant: Option<f64>,
}

/// What the synthesis is to keep.
#[derive(Clone, Debug, PartialEq)]
pub struct SynthesisSpec {
    /// Case whose tolerances and other conditions it begins with.
    pub case: String,
    /// Yield over all bands.
    pub asked: f64,
}

/// Tolerances of parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// One a column of the cases.
    pub parts: Vec<PartTolerance>,
    /// Correlations of deviations, by index.
    pub correlations: Vec<(usize, usize, f64)>,
    /// Bands.
    pub bands: Vec<Band>,
    /// Modes whose natural frequencies are computed, from 1, rising: those asked for and those that a band bounds.
    pub modes: Vec<u32>,
    /// Contact area, where deviations act through it.
    pub assembly: Option<Assembly>,
    /// Synthesis, where asked for.
    pub synthesis: Option<SynthesisSpec>,
}

/// Keys of `[tolerance]` read here.
pub(super) const KEYS: [&str; 6] = ["parts", "correlations", "bands", "modes", "assembly", "synthesis"];

/// Highest mode that may be asked for.
const HIGHEST: i64 = 1000;

/// Most parts: two independent draws of all of them and of the rest fill the dimensions of the sequence.
const MOST: usize = sequence::DIMENSIONS / 2 - 1;

/// Reads the tolerances of parts; none where `parts` is not there.
pub(super) fn read(table: &TableView<'_>) -> Result<Option<Parts>, TomlError> {
    let Some(value) = table.get("parts") else {
        let orphan = KEYS[1..].iter().find_map(|k| table.get(k));
        return match orphan {
            Some(v) => {
                Err(v.refuse("it belongs to tolerances of parts, and there are none", "[[tolerance.parts]] with name and distribution"))
            }
            None => Ok(None),
        };
    };
    let list = table.tables("parts")?;
    if list.is_empty() || list.len() > MOST {
        return Err(value.refuse(format!("{} tolerances", list.len()), format!("1 to {MOST}")));
    }
    let mut parts: Vec<PartTolerance> = Vec::new();
    for t in &list {
        let part = part(t)?;
        if parts.iter().any(|p| p.name == part.name) {
            return Err(t.refuse(format!("`{}` stands twice", part.name), "each tolerance once"));
        }
        parts.push(part);
    }
    let mut correlations = Vec::new();
    for t in table.tables("correlations")? {
        correlations.push(correlation(&t, &parts)?);
    }
    if let Err(e) = deviation::correlated(parts.len(), &correlations) {
        let at = table.get("correlations").unwrap_or(value);
        return Err(at.refuse(e.to_string(), crate::explain::Explain::accepted(&e)));
    }
    let bands = table.tables("bands")?.iter().map(band).collect::<Result<Vec<Band>, _>>()?;
    let mut modes = match table.get("modes") {
        Some(v) => v.list()?.iter().map(mode).collect::<Result<Vec<u32>, _>>()?,
        None => vec![],
    };
    modes.extend(bands.iter().filter_map(|b| b.quantity.mode()));
    modes.sort_unstable();
    modes.dedup();
    let assembly = table.optional("assembly", |v| assembly(&v.table()?))?;
    let synthesis = table.optional("synthesis", |v| synthesis(&v.table()?, &v))?;
    if synthesis.is_some() {
        if bands.is_empty() {
            return Err(table.refuse("a synthesis without a band", "[[tolerance.bands]] with quantity, min, max"));
        }
        if parts.iter().all(|p| p.cost.is_none()) {
            return Err(value.refuse("a synthesis without a cost", "cost = 1.0 for each tolerance that may be chosen"));
        }
    }
    Ok(Some(Parts { parts, correlations, bands, modes, assembly, synthesis }))
}

fn mode(v: &ValueView<'_>) -> Result<u32, TomlError> {
    v.integer(1, HIGHEST).map(|n| n as u32)
}

fn above(v: &ValueView<'_>, what: &str) -> Result<f64, TomlError> {
    let n = v.number()?;
    if n > 0.0 { Ok(n) } else { Err(v.refuse(format!("a {what} of {n}"), "a number above 0")) }
}

fn part(t: &TableView<'_>) -> Result<PartTolerance, TomlError> {
    t.only(&["name", "distribution", "cp", "cpk", "side", "cost", "min", "max"])?;
    let shape = t.require("distribution", "\"normal\", \"truncated\" or \"uniform\"")?.word("distribution", &Shape::WORDS)?;
    if let (Shape::Uniform, Some(v)) = (shape, t.get("cp").or(t.get("cpk"))) {
        return Err(v.refuse("a uniform distribution fills its tolerance: it has no capability of its own", "no cp and cpk"));
    }
    let cp = t.optional("cp", |v| above(&v, "cp"))?;
    let cpk = t.optional("cpk", |v| v.number())?;
    let side = t.optional("side", |v| match v.number()? {
        s if s == 1.0 || s == -1.0 => Ok(s),
        s => Err(v.refuse(format!("a side of {s}"), "1 or -1: to which side the mean is off")),
    })?;
    let cp = cp.unwrap_or(cpk.unwrap_or(1.0));
    if let (Some(k), Some(v)) = (cpk, t.get("cpk"))
        && (k > cp || k <= 0.0)
    {
        return Err(v.refuse(format!("cpk = {k} with cp = {cp}"), "cpk above 0 and at most cp"));
    }
    let width = |v: ValueView<'_>| {
        let q: Value = v.quantity(Dimension::LENGTH)?;
        if q.value > 0.0 { Ok(q.value) } else { Err(v.refuse(format!("a width of {q}"), "a width above 0")) }
    };
    let range = (t.optional("min", width)?, t.optional("max", width)?);
    if let (Some(a), Some(b)) = range
        && a > b
    {
        return Err(t.refuse("min is above max", "min below max"));
    }
    Ok(PartTolerance {
        name: t.string("name")?.to_string(),
        shape,
        cp,
        cpk: cpk.unwrap_or(cp),
        side: side.unwrap_or(1.0),
        cost: t.optional("cost", |v| above(&v, "cost"))?,
        // Where nothing is stated, the widths of the cases.
        range: (range.0.unwrap_or(f64::NAN), range.1.unwrap_or(f64::NAN)),
    })
}

fn correlation(t: &TableView<'_>, parts: &[PartTolerance]) -> Result<(usize, usize, f64), TomlError> {
    t.only(&["between", "coefficient"])?;
    let value = t.require("between", "[\"blade_shape\", \"blade_position\"]")?;
    let index = |name: &str| {
        parts.iter().position(|p| p.name == name).ok_or_else(|| unknown(&value, "tolerance", name, parts.iter().map(|p| p.name.as_str())))
    };
    let names = value.strings()?;
    let &[a, b] = names.as_slice() else { return Err(value.refuse(format!("{} tolerances", names.len()), "two")) };
    let (a, b) = (index(a)?, index(b)?);
    let v = t.require("coefficient", "a number between -1 and 1")?;
    let r = v.number()?;
    if a == b || r.abs() >= 1.0 {
        return Err(
            v.refuse(format!("a correlation of {r} between {}", names.join(" and ")), "two tolerances and a number between -1 and 1")
        );
    }
    Ok((a, b, r))
}

fn band(t: &TableView<'_>) -> Result<Band, TomlError> {
    t.only(&["quantity", "mode", "min", "max"])?;
    let mut quantity = t.require("quantity", "W_D, W_s, stiffness or natural_frequency")?.word("quantity", &Banded::WORDS)?;
    match (quantity, t.get("mode")) {
        (Banded::Frequency(_), Some(v)) => quantity = Banded::Frequency(mode(&v)?),
        (Banded::Frequency(_), None) => return Err(t.refuse("a natural frequency without its mode", "mode = 1")),
        (_, Some(v)) => return Err(v.refuse(format!("{} has no mode", quantity.word()), "mode with quantity = \"natural_frequency\"")),
        (_, None) => {}
    }
    let mut unit = None;
    let mut limit = |key: &str, none: f64| -> Result<f64, TomlError> {
        let read = |v: ValueView<'_>| match quantity {
            Banded::Stiffness => v.quantity_of(&[Dimension::FORCE.over(Dimension::LENGTH), Dimension::MOMENT.over(Dimension::ANGLE)]),
            Banded::Frequency(_) => v.quantity(Dimension::FREQUENCY),
            _ => v.quantity(Dimension::ENERGY),
        };
        let q = t.optional(key, read)?;
        unit = unit.take().or(q.as_ref().map(|q| q.unit.clone()));
        Ok(q.map_or(none, |q| q.value))
    };
    let limits = (limit("min", f64::NEG_INFINITY)?, limit("max", f64::INFINITY)?);
    match unit {
        Some(unit) if limits.0 < limits.1 => Ok(Band { quantity, limits, unit, line: t.line() }),
        Some(_) => Err(t.refuse("the band is empty: min is not below max", "min below max")),
        None => Err(t.refuse("the band has no limit", "min, max or both")),
    }
}

fn assembly(t: &TableView<'_>) -> Result<Assembly, TomlError> {
    t.only(&["area", "interference", "constant"])?;
    let value = t.require("area", "[\"A_min\", \"A_max\"]: columns of the cases")?;
    let names: Vec<String> = value.strings()?.into_iter().map(str::to_string).collect();
    let n = names.len();
    let area = <[String; 2]>::try_from(names).map_err(|_| value.refuse(format!("{n} columns"), "least and greatest area"))?;
    let constant = t.optional("constant", |v| {
        let q = v.quantity(Dimension::LENGTH.power(3))?;
        if q.value > 0.0 { Ok(q.value) } else { Err(v.refuse(format!("a constant of {q}"), "a volume above 0, such as \"2.8 mm3\"")) }
    })?;
    Ok(Assembly { area, interference: t.optional("interference", |v| v.string())?.map(str::to_string), constant })
}

fn synthesis(t: &TableView<'_>, value: &ValueView<'_>) -> Result<SynthesisSpec, TomlError> {
    t.only(&["case", "yield"])?;
    let asked = t.require("yield", "\"99.73 %\"")?.quantity(Dimension::DIMENSIONLESS)?.value;
    if asked <= 0.0 || asked >= 1.0 {
        return Err(t.get("yield").unwrap_or(value.clone()).refuse(format!("a yield of {asked}"), "above 0 and below 100 %"));
    }
    Ok(SynthesisSpec { case: t.string("case")?.to_string(), asked })
}

/// Forms of the keys, for the schema.
#[derive(JsonSchema)]
#[schemars(rename_all = "snake_case")]
#[allow(dead_code)]
enum Distribution {
    /// sigma = width / (6 Cp), unbounded.
    Normal,
    /// The same, cut at the ends of the tolerance.
    Truncated,
    /// Over the tolerance.
    Uniform,
}

/// One tolerance, `[[tolerance.parts]]`.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(in crate::study) struct PartTable {
    /// A column of the cases, whose value is the width of the tolerance in a case.
    name: String,
    /// Its distribution.
    distribution: Distribution,
    /// Process capability, width / (6 sigma); 1 where it is left out.
    cp: Option<f64>,
    /// (width / 2 - |mean|) / (3 sigma); cp where it is left out.
    cpk: Option<f64>,
    /// Side the mean is off to, 1 or -1.
    side: Option<f64>,
    /// Cost times width; with it the synthesis may choose the width.
    cost: Option<f64>,
    /// Least width the synthesis may choose.
    min: Option<Quantity>,
    /// Greatest width the synthesis may choose.
    max: Option<Quantity>,
}

/// Correlation of two deviations.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(in crate::study) struct CorrelationTable {
    /// Two tolerances.
    between: [String; 2],
    /// Correlation of their normal scores.
    coefficient: f64,
}

#[derive(JsonSchema)]
#[allow(dead_code)]
enum BandedWord {
    #[schemars(rename = "W_D")]
    Dissipated,
    #[schemars(rename = "W_s")]
    Stored,
    #[schemars(rename = "stiffness")]
    Stiffness,
    #[schemars(rename = "natural_frequency")]
    Frequency,
}

/// A band that a quantity is to keep.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(in crate::study) struct BandTable {
    /// What is bounded.
    quantity: BandedWord,
    /// Mode of a natural frequency, from 1.
    mode: Option<u32>,
    /// Least value.
    min: Option<Quantity>,
    /// Greatest value.
    max: Option<Quantity>,
}

/// How deviations act on the conditions.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(in crate::study) struct AssemblyTable {
    /// Columns of the least and the greatest contact area.
    area: [String; 2],
    /// Condition that is a constant over the area (eq. 6).
    interference: Option<String>,
    /// That constant.
    constant: Option<Quantity>,
}

/// The loosest tolerances that keep a yield.
#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
#[allow(dead_code)]
pub(in crate::study) struct SynthesisTable {
    /// Case it begins with.
    case: String,
    /// Yield over all bands.
    #[schemars(rename = "yield")]
    asked: Quantity,
}
