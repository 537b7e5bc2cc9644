//! Areas of the recorded cycles, sample by sample: what averaging and truncated series leave out of W_D.

use super::{Channel, Grid, Points};

/// Mean area of the recorded cycles at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedArea {
    /// `name.axis`.
    pub at: String,
    /// Mean over the cycles of the polygon through every sample, loop integral of F dx [J]; closed cycle by cycle.
    pub area: f64,
    /// Samples per cycle.
    pub samples: f64,
}

/// Every cycle of the grid over all its samples, of which the grid itself may skip some. A cycle is closed from its last sample to its
/// first: the first of the next cycle would bring its own noise into the closing line.
pub(super) fn recorded(time: &[f64], x: &Channel, force: &Channel, grid: &Grid) -> RecordedArea {
    let (mut sum, mut samples) = (0.0, 0);
    for c in 0..grid.cycles {
        let cycle = match grid.points {
            Points::Samples { first, per_cycle, .. } => first + c * per_cycle..(first + (c + 1) * per_cycle).min(time.len()),
            Points::Times { start } => {
                let from = |c: usize| time.partition_point(|t| *t < start + c as f64 / grid.frequency);
                from(c)..from(c + 1)
            }
        };
        samples += cycle.len();
        let (x, f) = (&x.values[cycle.clone()], &force.values[cycle]);
        let next = |v: &[f64], k: usize| v[(k + 1) % v.len()];
        sum += (0..x.len()).map(|k| 0.5 * (f[k] + next(f, k)) * (next(x, k) - x[k])).sum::<f64>();
    }
    let cycles = grid.cycles.max(1) as f64;
    RecordedArea { at: x.at.clone(), area: sum / cycles, samples: samples as f64 / cycles }
}
