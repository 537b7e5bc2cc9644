//! Errors that all points of a channel share: a gain, an offset and a delay within the tolerance of good instruments.
//!
//! With `A` the change of a channel's whitened readings by one standard deviation of each, its whitened residuals have the covariance
//! `I + A A'`. With `A = U S V'` the rows are whitened by `(I + A A')^(-1/2) = I + U diag((1 + s^2)^(-1/2) - 1) U'`: the same as fitting
//! the three errors under their priors, at no free parameter. `A` is taken from a computed signal: the noise of a measured one would stand in
//! the columns and in the residuals, and the two would agree.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixViewMut};

use crate::data::FourierInput;

use super::{Block, BlockKind, Plan};

/// Standard deviation of the gain of a loop or a record about 1, from test to test: what all have in common, the calibration of the load
/// cell, is a factor on every stiffness that the model's own parameters carry.
pub const GAIN: f64 = 1e-3;
/// The same of an FRF: calibration of its sensors, which differ from test to test and which a known mass shows.
pub const CALIBRATION: f64 = 0.005;
/// Standard deviation of an offset, in parts of half the range of the signal.
pub const OFFSET: f64 = 0.005;
/// Standard deviation of a delay, in parts of the period of a cycle or of the shortest period of an FRF: a tenth of a degree.
pub const DELAY: f64 = 3e-4;

/// Standard deviation of a point beside a jump, in parts of the jump: it may lie on either side of it, or between where it is read while
/// the force turns over.
const BESIDE: f64 = 1.0;
/// A jump counts beyond so many standard deviations of its noise.
const JUMP: f64 = 3.0;

/// Sigma of the points of a loop where those beside a jump, such as that of dry friction at a reversal, know it no better than sampling does.
///
/// The jump about a point is what its neighbours differ by less the differences on the outer side of either. A corner, where one slope goes
/// over into another, makes no more of it than the steeper slope does in two steps; a jump, with the point on either side or within, does.
pub fn sampled(signal: &[f64], sigma: &[f64]) -> Vec<f64> {
    let n = signal.len();
    let at = |i: usize, d: usize| signal[(i + n + d - 2) % n];
    let beside = |i: usize| -> f64 {
        let (before, after) = (at(i, 1) - at(i, 0), at(i, 4) - at(i, 3));
        let jump = (at(i, 3) - at(i, 1) - before - after).abs();
        let noise = JUMP * 10f64.sqrt() * sigma[i];
        if jump > 2.0 * before.abs().max(after.abs()) + noise { BESIDE * jump } else { 0.0 }
    };
    (0..n).map(|i| if n < 5 { sigma[i] } else { sigma[i].hypot(beside(i)) }).collect()
}

/// The covariance of a test beyond the noise of its points, block after block.
#[derive(Clone, Debug)]
pub struct Correlated {
    /// What the channels read, from which the columns are taken.
    pub signal: Vec<f64>,
    blocks: Vec<Shared>,
}

#[derive(Clone, Debug)]
struct Shared {
    rows: Range<usize>,
    /// Orthonormal columns U, and (1 + s^2)^(-1/2) - 1 of each.
    u: DMatrix<f64>,
    shrink: Vec<f64>,
}

impl Correlated {
    /// Of a test whose channels read `signal` with the sigma of the plan.
    pub fn new(plan: &Plan, signal: &[f64]) -> Correlated {
        Correlated {
            signal: signal.to_vec(),
            blocks: plan.blocks.iter().filter_map(|b| shared(plan, b, &signal[b.range.clone()])).collect(),
        }
    }

    /// Whitens rows that are whitened by sigma already; one column or many.
    pub fn whiten(&self, mut rows: DMatrixViewMut<f64>) {
        for b in &self.blocks {
            let mut part = rows.rows_mut(b.rows.start, b.rows.len());
            let mut along = b.u.tr_mul(&part);
            for (mut row, shrink) in along.row_iter_mut().zip(&b.shrink) {
                row *= *shrink;
            }
            part.gemm(1.0, &b.u, &along, 1.0);
        }
    }
}

/// The columns of a block, each one standard deviation of an error over sigma.
fn shared(plan: &Plan, block: &Block, signal: &[f64]) -> Option<Shared> {
    let sigma = &plan.sigma[block.range.clone()];
    let (low, high) = signal.iter().fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
    let half = 0.5 * (high - low);
    let sigma_gain = if block.kind == BlockKind::Frf { CALIBRATION } else { GAIN };
    let gain = signal.iter().map(|v| sigma_gain * v).collect();
    let constant = vec![OFFSET * half; signal.len()];
    let columns: Vec<Vec<f64>> = match block.kind {
        BlockKind::Table => return None,
        // A record's longest period is its length, of which a delay is no part.
        BlockKind::Record => vec![gain, constant],
        BlockKind::Loop => {
            let noise = sigma.iter().sum::<f64>() / sigma.len().max(1) as f64;
            // Over a period of 1, so that the derivative is per period.
            let wave = FourierInput::fit(&block.abscissa, signal, noise, std::f64::consts::TAU);
            let delay = block.abscissa.iter().map(|p| -DELAY * wave.at_phase(*p).1).collect();
            vec![gain, constant, delay]
        }
        BlockKind::Frf => {
            // H exp(-i w tau): a turn by -w tau.
            let top = block.abscissa.iter().fold(0.0f64, |m, f| m.max(*f));
            let turn = |f: f64| -std::f64::consts::TAU * DELAY * f / top;
            let delay = signal.chunks(2).zip(&block.abscissa).flat_map(|(h, f)| match h {
                [re, im] => [-turn(*f) * im, turn(*f) * re],
                _ => [0.0; 2],
            });
            vec![gain, delay.collect()]
        }
    };
    let a = DMatrix::from_fn(signal.len(), columns.len(), |i, k| columns[k][i] / sigma[i]);
    if a.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let svd = a.svd(true, false);
    let shrink = svd.singular_values.iter().map(|s| 1.0 / (1.0 + s * s).sqrt() - 1.0).collect();
    Some(Shared { rows: block.range.clone(), u: svd.u?, shrink })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    /// A smooth loop keeps its sigma; beside a jump it is that of the jump's place, elsewhere none.
    #[test]
    fn only_a_jump_is_known_no_better_than_its_samples() {
        let loop_of = |jump: f64| -> Vec<f64> {
            (0..128).map(|k| (std::f64::consts::TAU * f64::from(k) / 128.0).sin() + if k < 64 { jump } else { 0.0 }).collect()
        };
        let sigma = vec![0.002; 128];
        assert_eq!(sampled(&loop_of(0.0), &sigma), sigma);
        let wider = sampled(&loop_of(1.0), &sigma);
        for (k, s) in wider.iter().enumerate() {
            assert_eq!([0, 63, 64, 127].contains(&k), *s > 0.8, "{k}: {s}");
            assert!([0, 63, 64, 127].contains(&k) || *s == 0.002);
        }
        // A sample within the jump knows nothing; the corners of a triangle and of its clean sine are no jumps.
        let mut within = loop_of(1.0);
        within[64] = 0.5;
        assert!(sampled(&within, &sigma)[64] > 0.8);
        let triangle: Vec<f64> = (0..128).map(|k| (f64::from(k) - 64.0).abs() / 64.0).collect();
        for clean in [triangle, loop_of(0.0)] {
            assert_eq!(sampled(&clean, &[1e-7; 128]), [1e-7; 128]);
        }
    }

    /// Rows whitened by the square root of `I + A A'` have its inverse as their product.
    #[test]
    fn whitened_rows_have_the_inverse_covariance() {
        let a = DMatrix::from_fn(40, 3, |i, k| ((i * (k + 2)) as f64 * 0.37).sin() * 10f64.powi(k as i32 - 1));
        let svd = a.clone().svd(true, false);
        let shrink = svd.singular_values.iter().map(|s| 1.0 / (1.0 + s * s).sqrt() - 1.0).collect();
        let c = Correlated { signal: vec![], blocks: vec![Shared { rows: 5..45, u: svd.u.unwrap(), shrink }] };
        let r = DVector::from_fn(50, |i, _| (i as f64 * 1.7).cos());
        let mut w = DMatrix::from_columns(&[r.clone(), 2.0 * &r]);
        c.whiten(w.as_view_mut());
        let inner = r.rows(5, 40).into_owned();
        let covariance = DMatrix::identity(40, 40) + &a * a.transpose();
        let want = inner.dot(&covariance.lu().solve(&inner).unwrap()) + r.norm_squared() - inner.norm_squared();
        approx::assert_relative_eq!(w.column(0).norm_squared(), want, max_relative = 1e-10);
        approx::assert_relative_eq!(w.column(1).norm_squared(), 4.0 * want, max_relative = 1e-10);
    }
}
