//! The steady cycle under a periodic drive, by the engine that suits it.

use crate::model::{Bound, Model};

use super::EngineError;
use super::followed;
use super::harmonic::balanced;
use super::march::{Loads, Probe};
use super::periodic::{Cycle, periodic};

/// By harmonic balance where that finds it ([`balanced`]), else by the march ([`periodic`]), very many candidates of a spatial model by receptances (`followed`). `loads` holds one cycle: its first and last sample are equal.
///
/// # Errors
/// Those of [`periodic`].
pub fn steady(model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe], sensitivities: bool) -> Result<Cycle, EngineError> {
    if let Some(cycle) = balanced(model, bound, loads, probes, sensitivities) {
        return Ok(cycle);
    }
    let followed = if sensitivities { followed::cycle(model, bound, loads, probes) } else { None };
    followed.unwrap_or_else(|| periodic(model, bound, loads, probes, sensitivities))
}
