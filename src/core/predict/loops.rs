//! The model's own error of energies: its cycles beside the loops that were measured at the place where the cases are driven.
//!
//! W_D and W_s of the measured loop are those of its settled cycle (`data::loops::energy`); the model's are of the steady cycle between the same limits at
//! the same frequency and conditions. The error of W_D is taken over W_s, as an error of the loss ratio D = W_D / W_s: it is of one size from slow loops
//! that lose little to fast ones that lose much. Loops that were not fitted count where there are enough of them.

use crate::data::{Control, Record, Role, StoredEnergy, Test};
use crate::study::{CycleQuantity, Predicted, ToleranceSpec};
use crate::tolerance::ModelError;

use super::cases::energies;
use super::{Calibrated, PredictError};

/// Loops that were not fitted from which on they alone count.
const ENOUGH: usize = 5;

/// The error of the model's energies over the measured loops; none where no loop was measured there.
pub fn model_error(spec: &ToleranceSpec, model: &Calibrated) -> Result<Option<ModelError>, PredictError> {
    let Some(table) = spec.tables.first() else { return Ok(None) };
    let Predicted::Cycle { at, control, .. } = &table.cycle.quantity else { return Ok(None) };
    let reading = table.stored.unwrap_or(StoredEnergy::Slope);
    let split = |t: &&Test| model.study.split.word(&t.id) != "fit";
    let tests: Vec<&Test> =
        model.study.dataset.tests.iter().filter(|t| matches!(&t.record, Record::Cycle(r) if r.control == Some(*control))).collect();
    let kept: Vec<&Test> = tests.iter().copied().filter(split).collect();
    let tests = if kept.len() >= ENOUGH { kept } else { tests };
    let (mut lost, mut stored) = (Vec::new(), Vec::new());
    for test in tests {
        let Some((measured, limits, frequency)) = measured(test, at, *control, reading) else { continue };
        let quantity = Predicted::Cycle { quantity: CycleQuantity::Dissipated, at: at.clone(), control: *control, limits, frequency };
        let computed = energies(&quantity, reading, vec![(test.id.clone(), test.conditions.clone())], model.system, &[])?;
        let Some(c) = computed.first() else { continue };
        lost.push((c.dissipated.value - measured.0) / measured.1);
        stored.push(c.stored.value / measured.1 - 1.0);
    }
    let rms = |v: &[f64]| (v.iter().map(|e| e * e).sum::<f64>() / v.len() as f64).sqrt();
    Ok((!lost.is_empty()).then(|| ModelError { loss_ratio: rms(&lost), stored: rms(&stored), tests: lost.len() }))
}

/// W_D and W_s, limits, frequency.
type Loop = ((f64, f64), (f64, f64), f64);

/// W_D and W_s of a measured loop, its limits and its frequency.
fn measured(test: &Test, at: &str, control: Control, reading: StoredEnergy) -> Option<Loop> {
    let Record::Cycle(record) = &test.record else { return None };
    let settled = record.settled().ok()?;
    let role = if control == Control::Force { Role::Force } else { Role::Displacement };
    let driven = settled.channels.get(settled.controlled).filter(|c| c.role == role && c.at == at)?;
    let energy = settled.energy(Some(at))?;
    let stored = energy.stored(reading)?.value;
    let (low, high) = driven.mean.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    (stored > 0.0 && low < high).then_some(((energy.dissipated.value.abs(), stored), (low, high), settled.frequency))
}
