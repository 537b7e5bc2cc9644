//! Energies of tolerance cases from a calibrated model: every case sets the conditions of the model's laws, a steady cycle gives W_D and W_s.

use nalgebra::DMatrix;

use crate::data::{Condition, Conditions, EnergyRow, EnergyTable, Record, StoredEnergy, TableValue, Test};
use crate::diagnose::Fitted;
use crate::model::{FreeParam, System};
use crate::response::Plan;
use crate::study::{Predicted, Study, ToleranceSpec, ToleranceTable};
use crate::tolerance::{Cycle, ModelError, Prediction, Quantity, Rung};
use crate::units::{Dimension, Unit};

use super::{Found, PredictError};

/// Normal quantile of a 95 % interval.
const INSIDE: f64 = 1.959_964;

/// A model at its fitted values, with what the fit knows of them.
pub struct Calibrated<'a> {
    /// The study it belongs to.
    pub study: &'a Study,
    /// The system at its fitted values.
    pub system: &'a System,
    /// Its free parameters.
    pub free: &'a [FreeParam],
    /// Their covariance, in units where the residuals' variance is one.
    pub covariance: &'a DMatrix<f64>,
    /// Their values in the fit's variables.
    pub p: &'a [f64],
    /// Mean square of the whitened residuals: the covariance is multiplied by it where it is above one.
    pub variance: f64,
}

impl<'a> Calibrated<'a> {
    /// A fitted study with the covariance of its parameters ([`Fitted::uncertainty`]).
    pub fn of(study: &'a Study, fitted: &'a Fitted, covariance: &'a DMatrix<f64>) -> Calibrated<'a> {
        Calibrated {
            study,
            system: &fitted.system,
            free: &fitted.free,
            covariance,
            p: &fitted.outcome.p,
            variance: fitted.outcome.whitened_rms().powi(2),
        }
    }
}

/// The energies of one case.
#[derive(Clone, Debug)]
pub struct Answer {
    /// W_D [J].
    pub dissipated: Found,
    /// W_s [J].
    pub stored: Found,
}

/// A condition without a deviation.
fn plain(value: f64, unit: Unit, line: usize) -> Condition {
    Condition { value, unit, sigma: None, line }
}

/// The conditions that a case sets: of each the mean of its quantities.
pub(super) fn conditions(spec: &ToleranceSpec, table: &ToleranceTable, case: usize, frequency: f64) -> Conditions {
    let case = &table.cases.cases[case];
    let mut all = Conditions::new();
    for c in &spec.conditions {
        let values: Vec<f64> = c.of.iter().filter_map(|q| case.values.get(q)).copied().collect();
        let unit = c.of.iter().find_map(|q| table.cases.units.get(q).cloned());
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        all.insert(c.name.clone(), plain(mean, unit.unwrap_or_else(|| Unit::si(Dimension::DIMENSIONLESS)), spec.line));
    }
    all.insert("frequency".into(), plain(frequency, Unit::si(Dimension::FREQUENCY), spec.line));
    all
}

/// W_D and W_s of steady cycles at the given conditions, all between the same limits; slopes with respect to `free`.
pub(super) fn energies(
    cycle: &Predicted,
    reading: StoredEnergy,
    rows: Vec<(String, Conditions)>,
    system: &System,
    free: &[FreeParam],
) -> Result<Vec<Answer>, PredictError> {
    let Predicted::Cycle { at, control, limits, frequency, .. } = cycle else { return Ok(vec![]) };
    let one = || Some(TableValue { value: 1.0, unit: Unit::si(Dimension::ENERGY), sigma: Some(1.0), rounding: 0.0 });
    let row = |(case, conditions): (String, Conditions)| EnergyRow {
        place: format!("case {case}"),
        case: Some(case),
        frequency: Some(conditions.get("frequency").map_or(*frequency, |c| c.value)),
        conditions,
        dissipated: one(),
        stored: one(),
        ratio: None,
    };
    let n = rows.len();
    let table = EnergyTable {
        at: at.clone(),
        control: *control,
        limits: Some(*limits),
        stored: Some(reading),
        rows: rows.into_iter().map(row).collect(),
    };
    let test = Test {
        id: "cases".into(),
        description: None,
        conditions: Conditions::new(),
        supports: None,
        record: Record::Energy(table),
        line: 0,
    };
    let plan = Plan::new(&test, &system.model)?;
    let computed = plan.evaluate_plain(system, free)?;
    let k = free.len();
    let found = |row: usize| Found { value: computed.values[row], slopes: computed.slopes[row * k..(row + 1) * k].to_vec() };
    Ok((0..n).map(|row| Answer { dissipated: found(row), stored: found(n + row) }).collect())
}

/// All cases of all cycles by one model.
pub fn rung(spec: &ToleranceSpec, model: &Calibrated, title: String, added: Vec<String>) -> Result<Rung, PredictError> {
    let model_error = super::model_error(spec, model)?;
    let cycles = spec.tables.iter().map(|t| cycle(spec, t, model, model_error)).collect::<Result<Vec<Cycle>, PredictError>>()?;
    Ok(Rung { title, added, cycles, model_error })
}

fn cycle(spec: &ToleranceSpec, table: &ToleranceTable, model: &Calibrated, error: Option<ModelError>) -> Result<Cycle, PredictError> {
    let Predicted::Cycle { limits, frequency, control, .. } = &table.cycle.quantity else {
        return Ok(Cycle { test: table.test.clone(), words: String::new(), predictions: vec![] });
    };
    let rows = (0..table.cases.cases.len()).map(|k| (table.cases.cases[k].name.clone(), conditions(spec, table, k, *frequency)));
    let reading = table.stored.unwrap_or(StoredEnergy::Slope);
    let answers = energies(&table.cycle.quantity, reading, rows.collect(), model.system, model.free)?;
    let place = |k: usize| table.cases.cases[k].place.clone();
    for (k, a) in answers.iter().enumerate() {
        if !(a.dissipated.value > 0.0 && a.stored.value.is_finite()) {
            let case = table.cases.cases[k].name.clone();
            let message = format!("the model dissipates {} J in its cycle", a.dissipated.value);
            return Err(PredictError::Case {
                case,
                message,
                accepted: "a model that loses energy in the cycle of the cases".into(),
                place: place(k),
            });
        }
    }
    let reference = crate::tolerance::energies::find(&table.cases, &spec.reference)?;
    let unit = if *control == crate::data::Control::Force { "N" } else { "m" };
    let words = format!("{} to {} {unit}, {frequency} Hz", limits.0, limits.1);
    Ok(Cycle { test: table.test.clone(), words, predictions: predictions(spec, table, model, error, &answers, reference) })
}

fn predictions(
    spec: &ToleranceSpec,
    table: &ToleranceTable,
    model: &Calibrated,
    error: Option<ModelError>,
    answers: &[Answer],
    reference: usize,
) -> Vec<Prediction> {
    let cases = &table.cases.cases;
    let scale = spec.scale;
    let parameters = |f: &Found| f.deviation(model.covariance, model.p).map(|s| s * model.variance.max(1.0).sqrt());
    // The model's own error of W_D is one of the loss ratio, so it goes with the stored energy.
    let lost = |a: &Answer| error.map(|e| e.loss_ratio * a.stored.value);
    let base = &answers[reference];
    let outside: Vec<Option<String>> = (0..cases.len()).map(|k| outside(spec, table, model.study, k)).collect();
    let make = |k: usize, quantity: Quantity, value: f64, std: Option<f64>, reference: Option<f64>, left_out: Option<f64>| Prediction {
        case: cases[k].name.clone(),
        quantity,
        value,
        std,
        interval: std.map(|s| (value - INSIDE * s, value + INSIDE * s)),
        reference,
        left_out,
        outside: outside[k].clone(),
    };
    let both = |a: Option<f64>, b: Option<f64>| a.map(|a| a.hypot(b.unwrap_or(0.0)));
    let mut all = Vec::new();
    for (k, a) in answers.iter().enumerate() {
        let ratio = a.dissipated.value / base.dissipated.value;
        let r = Found::of(&a.dissipated, &base.dissipated, ratio, 1.0 / base.dissipated.value, -ratio / base.dissipated.value);
        // Both cases err by the model's own error, each for itself; the reference over itself does not.
        let own = if k == reference {
            Some(0.0)
        } else {
            lost(a).zip(lost(base)).map(|(x, y)| ratio * (x / a.dissipated.value).hypot(y / base.dissipated.value))
        };
        let printed = cases[k].energy / cases[reference].energy;
        all.push(make(k, Quantity::Ratio, ratio, both(parameters(&r), own), Some(printed), Some(ratio)));
    }
    for (k, a) in answers.iter().enumerate() {
        let std = both(parameters(&a.dissipated), lost(a)).map(|s| scale * s);
        all.push(make(k, Quantity::Dissipated, scale * a.dissipated.value, std, Some(cases[k].energy), None));
    }
    if table.stored.is_some() {
        for (k, a) in answers.iter().enumerate() {
            let std = both(parameters(&a.stored), error.map(|e| e.stored * a.stored.value)).map(|s| scale * s);
            all.push(make(k, Quantity::Stored, scale * a.stored.value, std, cases[k].stored, None));
        }
    }
    all
}

/// Where a condition of a case over which the model has a law lies outside the tests and the declared range, and how far.
fn outside(spec: &ToleranceSpec, table: &ToleranceTable, study: &Study, case: usize) -> Option<String> {
    let set = conditions(spec, table, case, 0.0);
    let far = |c: &crate::study::CaseCondition| {
        let value = set.get(&c.name)?;
        let law = study.system.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.condition == c.name));
        let of_row = |t: &Test| -> Vec<f64> {
            let rows = if let Record::Energy(e) = &t.record { e.rows.as_slice() } else { &[] };
            std::iter::once(&t.conditions)
                .chain(rows.iter().map(|r| &r.conditions))
                .filter_map(|all| all.get(&c.name))
                .map(|c| c.value)
                .collect()
        };
        let tested = study.dataset.tests.iter().flat_map(of_row).chain(c.range.into_iter().flat_map(|r| [r.0, r.1]));
        let (low, high) = tested.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let by = (low - value.value).max(value.value - high);
        let print = |v: f64| value.unit.print(v);
        (law && by > 1e-9 * value.value.abs()).then(|| {
            format!("{} is {}, {} outside {} to {}", c.name, print(value.value), value.unit.print_difference(by), print(low), print(high))
        })
    };
    let all: Vec<String> = spec.conditions.iter().filter_map(far).collect();
    (!all.is_empty()).then(|| all.join("; "))
}
