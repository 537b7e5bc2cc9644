//! One prediction and its derivatives with respect to the fit's variables.
//!
//! Energies and FRF lines are computed by the plan of a test that asks for them, so a prediction and a measurement are one computation.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::data::{
    Channel, Conditions, Control, EnergyRow, EnergyTable, Frf, FrfQuantity, ModalTable, ModeRow, Record, Role, StoredEnergy, TableValue,
    Test, TimeRecord,
};
use crate::diagnose::Fitted;
use crate::model::{FreeParam, Site, System};
use crate::response::Plan;
use crate::study::{CycleQuantity, Predicted, PredictionSpec, Study};
use crate::units::{Dimension, Unit};

use super::{Found, PredictError, Sweep};

/// A `[[prediction]]` of a study with what its calibrated model says.
pub struct Prediction<'a> {
    /// What was asked for.
    pub spec: &'a PredictionSpec,
    /// Value [SI] and slopes.
    pub found: Found,
    /// Standard deviation by that of the parameters [SI]; none where the value depends on a parameter that the data leave open.
    pub std: Option<f64>,
    /// The history of a sweep.
    pub sweep: Option<Sweep>,
}

/// Every `[[prediction]]` of a study by its calibrated model.
///
/// # Errors
/// As [`evaluate`]; a fit whose uncertainty cannot be computed.
pub fn predictions<'a>(study: &'a Study, fitted: &Fitted) -> Result<Vec<Prediction<'a>>, PredictError> {
    if study.predictions.is_empty() {
        return Ok(vec![]);
    }
    let covariance = fitted.uncertainty()?.covariance;
    let one = |spec: &'a PredictionSpec| {
        let (sweep, found) = match sweep(spec, &fitted.system, &fitted.free)? {
            Some((sweep, range)) => (Some(sweep), range),
            None => (None, evaluate(spec, study, &fitted.system, &fitted.free)?),
        };
        let std = found.deviation(&covariance, &fitted.outcome.p);
        Ok(Prediction { spec, found, std, sweep })
    };
    study.predictions.iter().map(one).collect()
}

/// A prediction of a study by its model at the values of `system`, with slopes with respect to `free`.
///
/// # Errors
/// A cycle, a mode or a response that the model does not have.
pub fn evaluate(spec: &PredictionSpec, study: &Study, system: &System, free: &[FreeParam]) -> Result<Found, PredictError> {
    let system = structure(system);
    match &spec.quantity {
        Predicted::Cycle { quantity, at, control, limits, frequency } => {
            let of = |stored: Option<StoredEnergy>| {
                let one = || Some(TableValue { value: 1.0, unit: Unit::si(Dimension::ENERGY), sigma: Some(1.0), rounding: 0.0 });
                let row = EnergyRow {
                    case: None,
                    conditions: spec.conditions.clone(),
                    frequency: Some(*frequency),
                    dissipated: if stored.is_none() { one() } else { None },
                    stored: if stored.is_some() { one() } else { None },
                    ratio: None,
                    place: spec.case.clone(),
                };
                let table = EnergyTable { at: at.clone(), control: *control, limits: Some(*limits), stored, rows: vec![row] };
                compute(spec, Record::Energy(table), &system, free).map(|mut all| all.remove(0))
            };
            let driven = limits.1 - limits.0;
            let constant = |value: f64| Found { value, slopes: vec![0.0; free.len()] };
            // With dF and dx the ranges: W_product = dF dx / 2, W_slope = dF^2 / (2 k); one of dF and dx is driven.
            let force = control.role() == crate::data::Role::Force;
            let other = |w: &Found| Found::of(w, w, 2.0 * w.value / driven, 2.0 / driven, 0.0);
            Ok(match quantity {
                CycleQuantity::Dissipated => of(None)?,
                CycleQuantity::Stored(reading) => of(Some(*reading))?,
                CycleQuantity::LossRatio(reading) => {
                    let (d, s) = (of(None)?, of(Some(*reading))?);
                    Found::of(&d, &s, d.value / s.value, 1.0 / s.value, -d.value / s.value.powi(2))
                }
                CycleQuantity::ForceRange if force => constant(driven),
                CycleQuantity::ForceRange => other(&of(Some(StoredEnergy::Product))?),
                CycleQuantity::DisplacementRange if !force => constant(driven),
                CycleQuantity::DisplacementRange => other(&of(Some(StoredEnergy::Product))?),
                CycleQuantity::Stiffness => {
                    let w = of(Some(StoredEnergy::Slope))?;
                    let df = if force { constant(driven) } else { other(&of(Some(StoredEnergy::Product))?) };
                    let k = df.value.powi(2) / (2.0 * w.value);
                    Found::of(&df, &w, k, df.value / w.value, -k / w.value)
                }
            })
        }
        Predicted::Travel { .. } => travel(spec, &system, free),
        Predicted::Frf { quantity, excite, respond, frequency, excitation } => {
            let frf = line(spec, *quantity, excite, respond, *frequency, *excitation);
            let parts = compute(spec, Record::Frf(Box::new(frf)), &system, free)?;
            let [re, im] = parts.as_slice() else { return Err(refused(spec, "the line was not computed")) };
            let size = re.value.hypot(im.value);
            if size == 0.0 {
                return Err(refused(spec, "the response is zero, and its amount has no slope"));
            }
            Ok(Found::of(re, im, size, re.value / size, im.value / size))
        }
        Predicted::Sweep { .. } => range(spec, &march(spec, &system, free)?.1),
        Predicted::Shift { test, against, mode } => shift(spec, study, (test, against), *mode, &system, free),
        Predicted::Frequency(mode) => mode_of(spec, *mode, false, &system, free),
        Predicted::Damping(mode) => mode_of(spec, *mode, true, &system, free),
    }
}

fn compute(spec: &PredictionSpec, record: Record, system: &System, free: &[FreeParam]) -> Result<Vec<Found>, PredictError> {
    let test = Test { conditions: spec.conditions.clone(), line: spec.line, ..Test::new(&spec.case, record) };
    let all = of_test(&test, system, free)?;
    if all.is_empty() { Err(refused(spec, "nothing was computed")) } else { Ok(all) }
}

/// Every value of a test by the model.
fn of_test(test: &Test, system: &System, free: &[FreeParam]) -> Result<Vec<Found>, PredictError> {
    let plan = Plan::new(test, &system.model)?;
    let computed = plan.evaluate_plain(system, free)?;
    let n = free.len();
    let one = |(row, v): (usize, &f64)| Found { value: *v, slopes: computed.slopes[row * n..(row + 1) * n].to_vec() };
    Ok(computed.values.iter().enumerate().map(one).collect())
}

/// A table of these modes of value 1; only their numbers matter here.
fn table(modes: &[u32], damping: bool, place: &str) -> Record {
    let one = |dimension| TableValue { value: 1.0, unit: Unit::si(dimension), sigma: Some(1.0), rounding: 0.0 };
    let row = |mode: &u32| ModeRow {
        mode: *mode,
        frequency: one(Dimension::FREQUENCY),
        damping: damping.then(|| one(Dimension::DIMENSIONLESS)),
        family: None,
        description: None,
        place: place.into(),
    };
    Record::Modal(ModalTable { rows: modes.iter().map(row).collect(), notes: vec![] })
}

/// Natural frequencies [Hz] of these modes, from 1, in small motion at the given conditions.
pub(super) fn frequencies(modes: &[u32], conditions: Conditions, system: &System, free: &[FreeParam]) -> Result<Vec<Found>, PredictError> {
    if modes.is_empty() {
        return Ok(vec![]);
    }
    let test = Test { conditions, ..Test::new("natural frequencies", table(modes, false, "")) };
    of_test(&test, &structure(system), free)
}

/// Frequency or damping of one mode.
fn mode_of(spec: &PredictionSpec, mode: u32, damping: bool, system: &System, free: &[FreeParam]) -> Result<Found, PredictError> {
    let mut all = compute(spec, table(&[mode], damping, &spec.case), system, free)?;
    all.pop().ok_or_else(|| refused(spec, "the mode was not computed"))
}

/// Samples of a sweep per period of its highest frequency.
const SAMPLES: f64 = 40.0;
/// Samples at most.
const MOST: f64 = 1e6;

/// The history of a sweep and its range; none for other quantities.
fn sweep(spec: &PredictionSpec, system: &System, free: &[FreeParam]) -> Result<Option<(Sweep, Found)>, PredictError> {
    let Predicted::Sweep { at, respond, mean, amplitude, frequencies, .. } = &spec.quantity else { return Ok(None) };
    let (time, all) = march(spec, &structure(system), free)?;
    let sweep = Sweep {
        case: spec.case.clone(),
        respond: respond.clone(),
        at: at.clone(),
        force: (*mean, *amplitude),
        frequencies: *frequencies,
        time,
        displacement: all.iter().map(|f| f.value).collect(),
    };
    Ok(Some((sweep, range(spec, &all)?)))
}

/// Greatest minus least.
fn range(spec: &PredictionSpec, all: &[Found]) -> Result<Found, PredictError> {
    let by_value = |a: &&Found, b: &&Found| a.value.total_cmp(&b.value);
    let (Some(low), Some(high)) = (all.iter().min_by(by_value), all.iter().max_by(by_value)) else {
        return Err(refused(spec, "nothing was computed"));
    };
    Ok(Found::of(high, low, high.value - low.value, 1.0, -1.0))
}

/// Samples of a cycle: an extremum lies within 1 - cos(pi / 256), less than 1e-4, of one of them.
const OF_A_CYCLE: usize = 256;
/// Cycles of the drive that are written down: the steady one is computed, and a test has two at least.
const CYCLES: usize = 2;

/// Range of a displacement over the settled cycle of a sinusoidal drive.
fn travel(spec: &PredictionSpec, system: &System, free: &[FreeParam]) -> Result<Found, PredictError> {
    let Predicted::Travel { at, respond, control, limits, frequency } = &spec.quantity else {
        return Err(refused(spec, "it is no travel"));
    };
    let (mean, amplitude) = (0.5 * (limits.0 + limits.1), 0.5 * (limits.1 - limits.0));
    let time: Vec<f64> = (0..=CYCLES * OF_A_CYCLE).map(|k| k as f64 / (frequency * OF_A_CYCLE as f64)).collect();
    let drive = time.iter().map(|t| mean + amplitude * (TAU * frequency * t).sin()).collect();
    let channels = vec![
        Channel::new(control.role(), at, drive).drives(),
        Channel::new(Role::Displacement, respond, vec![0.0; time.len()]).with_sigma(1.0),
    ];
    let record = TimeRecord::new(&spec.case, std::path::PathBuf::new(), *control, None, time, channels);
    range(spec, &compute(spec, Record::Cycle(record), system, free)?)
}

/// Times of a sweep [s] and the displacement at each.
fn march(spec: &PredictionSpec, system: &System, free: &[FreeParam]) -> Result<(Vec<f64>, Vec<Found>), PredictError> {
    let Predicted::Sweep { at, respond, mean, amplitude, frequencies: (from, to), duration } = &spec.quantity else {
        return Err(refused(spec, "it is no sweep"));
    };
    let n = (duration * from.max(*to) * SAMPLES).ceil();
    if n > MOST {
        return Err(refused(spec, &format!("the sweep needs {n:.0} samples")));
    }
    let time: Vec<f64> = (0..=n as usize).map(|k| duration * k as f64 / n).collect();
    // The force sets in at zero of its sine: the march starts at rest, or in the equilibrium under the loads that stay.
    let phase = |t: f64| TAU * (from * t + 0.5 * (to - from) / duration * t * t);
    let force: Vec<f64> = time.iter().map(|t| mean + amplitude * phase(*t).sin()).collect();
    let channels = vec![
        Channel::new(Role::Force, at, force).drives(),
        Channel::new(Role::Displacement, respond, vec![0.0; time.len()]).with_sigma(1.0),
    ];
    let record = TimeRecord::new(&spec.case, std::path::PathBuf::new(), Control::Force, None, time.clone(), channels);
    Ok((time, compute(spec, Record::Transient(record), system, free)?))
}

/// Relative shift of the frequency of a mode in one modal test against another. The mode is paired as the other test pairs it, and followed by its shape.
fn shift(
    spec: &PredictionSpec,
    study: &Study,
    (test, against): (&str, &str),
    mode: u32,
    system: &System,
    free: &[FreeParam],
) -> Result<Found, PredictError> {
    let missing = |test: &str| refused(spec, &format!("test `{test}` pairs no mode {mode} with the model"));
    let plan = |id: &str| -> Result<(Plan, usize), PredictError> {
        let plan = Plan::new(study.dataset.test(id).ok_or_else(|| missing(id))?, &system.model)?;
        let block = plan.blocks.iter().find(|b| b.role == "natural_frequency").ok_or_else(|| missing(id))?;
        let row = block.abscissa.iter().position(|m| *m == f64::from(mode)).ok_or_else(|| missing(id))? + block.range.start;
        Ok((plan, row))
    };
    let ((other, there), (own, here)) = (plan(against)?, plan(test)?);
    // Computed, times measured over computed of the other test; how well a shift is known does not matter here.
    let computed = own.shifted_against(&other, 1.0, |m| m == f64::from(mode)).evaluate_plain(system, free)?;
    let (n, measured) = (free.len(), other.measured[there].exp());
    let slopes = computed.slopes[here * n..(here + 1) * n].iter().map(|d| d / measured).collect();
    Ok(Found { value: computed.values[here] / measured - 1.0, slopes })
}

/// The structure without its measuring channels: a prediction is of the thing, not of the rig. The channel effects stay in the list, so
/// that the free parameters keep their places, and cover no test.
fn structure(system: &System) -> System {
    let mut system = system.clone();
    for instance in &mut system.instances {
        if let Site::Channel(site) = &mut instance.site {
            site.test.clear();
        }
    }
    system
}

/// One line of an FRF of value 1; only its frequency matters here.
fn line(spec: &PredictionSpec, quantity: FrfQuantity, excite: &str, respond: &str, frequency: f64, excitation: Option<f64>) -> Frf {
    let frf = Frf::new(&spec.case, excite, respond, quantity, vec![frequency], vec![Complex64::new(1.0, 0.0)], vec![1.0]);
    Frf { excitation, ..frf }
}

fn refused(spec: &PredictionSpec, message: &str) -> PredictError {
    PredictError::Case {
        case: spec.case.clone(),
        message: message.into(),
        accepted: "a mode the model has, a cycle that moves, or |H| of a response that moves".into(),
        place: format!("study.toml, line {}, prediction {}", spec.line, spec.case),
    }
}
