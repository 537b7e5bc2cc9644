//! The measuring chain applied to computed signals.

use crate::effect::Moment;
use crate::model::{Bound, ChannelPiece};

/// Applies the channel effects that cover `test.role` to a computed signal of `n` samples at steps of `dt`, taken at `moments`. `slopes[k * columns + c]` are updated along: the free parameters first, and whatever else. A periodic signal wraps around.
pub fn apply(bound: &Bound, test: &str, role: &str, dt: f64, periodic: bool, moments: &[Moment], values: &mut [f64], slopes: &mut [f64]) {
    let pieces: Vec<&ChannelPiece> = bound.channels.iter().filter(|c| c.site.covers(test, role)).collect();
    if pieces.is_empty() {
        return;
    }
    let n = values.len();
    let columns = slopes.len() / n.max(1);
    for piece in pieces {
        let mut dp = vec![0.0; piece.p.len()];
        let shift = piece.law.shift(&piece.p, &mut dp);
        if shift != 0.0 || dp.iter().any(|d| *d != 0.0) {
            let old = values.to_vec();
            let old_slopes = slopes.to_vec();
            for k in 0..n {
                let (stencil, rates) = interpolation(k as f64 - shift / dt, n, periodic);
                values[k] = stencil.iter().map(|(j, w)| w * old[*j]).sum();
                let rate: f64 = rates.iter().map(|(j, w)| w * old[*j]).sum::<f64>() / dt;
                for c in 0..columns {
                    slopes[k * columns + c] = stencil.iter().map(|(j, w)| w * old_slopes[*j * columns + c]).sum();
                }
                for (d, chain) in dp.iter().zip(&piece.chains) {
                    for (c, slope) in chain.iter().filter(|_| columns > 0) {
                        slopes[k * columns + c] -= rate * d * slope;
                    }
                }
            }
        }
        for k in 0..n {
            let (reading, dy) = piece.law.reading(values[k], moments[k], &piece.p, &mut dp);
            values[k] = reading;
            slopes.iter_mut().skip(k * columns).take(columns).for_each(|s| *s *= dy);
            for (d, chain) in dp.iter().zip(&piece.chains) {
                for (c, slope) in chain.iter().filter(|_| columns > 0) {
                    slopes[k * columns + c] += d * slope;
                }
            }
        }
    }
}

type Weights = [(usize, f64); 4];

/// Weights of a cubic (Catmull-Rom) interpolation at the fractional index `at`, and those of its derivative per index.
fn interpolation(at: f64, n: usize, periodic: bool) -> (Weights, Weights) {
    let floor = at.floor();
    let t = at - floor;
    let index = |offset: isize| {
        let i = floor as isize + offset;
        if periodic { i.rem_euclid(n as isize) as usize } else { i.clamp(0, n as isize - 1) as usize }
    };
    let value = [
        -0.5 * t + t * t - 0.5 * t * t * t,
        1.0 - 2.5 * t * t + 1.5 * t * t * t,
        0.5 * t + 2.0 * t * t - 1.5 * t * t * t,
        -0.5 * t * t + 0.5 * t * t * t,
    ];
    let rate = [-0.5 + 2.0 * t - 1.5 * t * t, -5.0 * t + 4.5 * t * t, 0.5 + 4.0 * t - 4.5 * t * t, -t + 1.5 * t * t];
    (std::array::from_fn(|j| (index(j as isize - 1), value[j])), std::array::from_fn(|j| (index(j as isize - 1), rate[j])))
}
