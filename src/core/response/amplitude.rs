//! How far the places of a model move under a test, and under what force.

use crate::effect::Scales;
use crate::engine::EngineError;
use crate::engine::march::{Loads, Probe};
use crate::engine::steady::steady;
use crate::model::{Bound, Model};

/// Amplitudes of motion and force at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Amplitude {
    /// Half the range of relative displacement.
    pub x: f64,
    /// Least and largest relative displacement, that at rest included.
    pub travel: (f64, f64),
    /// Largest relative speed.
    pub v: f64,
    /// Half the range of force.
    pub f: f64,
}

impl Amplitude {
    /// The widest of both.
    pub(super) fn or(self, other: Amplitude) -> Amplitude {
        Amplitude {
            x: self.x.max(other.x),
            travel: (self.travel.0.min(other.travel.0), self.travel.1.max(other.travel.1)),
            v: self.v.max(other.v),
            f: self.f.max(other.f),
        }
    }
}

impl From<Amplitude> for Scales {
    fn from(a: Amplitude) -> Scales {
        let least_v = if a.v > 0.0 { a.v } else { f64::INFINITY };
        Scales { x: a.x, travel: a.travel, v: a.v, least_v, f: a.f, ..Scales::NONE }
    }
}

/// Amplitudes at every place over the steady cycle of `loads`.
pub(super) fn place_amplitudes(model: &Model, bound: &Bound, loads: &Loads) -> Result<Vec<Amplitude>, EngineError> {
    let n = model.places.len();
    let probes: Vec<Probe> = (0..n).map(Probe::Relative).chain((0..n).map(Probe::Force)).collect();
    let cycle = steady(model, bound, loads, &probes, false)?;
    Ok((0..n).map(|p| amplitude(&cycle.values[p], &cycle.values[n + p], loads.dt)).collect())
}

pub(super) fn amplitude(x: &[f64], f: &[f64], dt: f64) -> Amplitude {
    let half = |u: &[f64]| {
        let (lo, hi) = u.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        0.5 * (hi - lo)
    };
    let v = x.windows(2).map(|w| ((w[1] - w[0]) / dt).abs()).fold(0.0, f64::max);
    let travel = x.iter().fold((0.0f64, 0.0f64), |(low, high), x| (low.min(*x), high.max(*x)));
    Amplitude { x: half(x), travel, v, f: half(f) }
}
