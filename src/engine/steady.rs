//! The steady cycle under a periodic drive, by the engine that suits it.

use crate::model::{Bound, Model};

use super::EngineError;
use super::harmonic::balanced;
use super::march::{Loads, Probe};
use super::periodic::{Cycle, periodic};

/// By harmonic balance where that finds it ([`balanced`]), else by the march ([`periodic`]). `loads` holds one cycle: its first and last sample are equal.
///
/// # Errors
/// Those of [`periodic`].
pub fn steady(model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe], sensitivities: bool) -> Result<Cycle, EngineError> {
    match balanced(model, bound, loads, probes, sensitivities) {
        Some(cycle) => Ok(cycle),
        None => periodic(model, bound, loads, probes, sensitivities),
    }
}
