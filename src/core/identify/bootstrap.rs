//! Bootstrap: the scatter of an answer when the measurement is repeated with the residuals it left.
//!
//! Each replicate measures `y(p) - sigma e`, where `e` are the whitened residuals of the fit in moving blocks of n^(1/3) neighbours of one
//! test, centred (Kuensch, Ann. Statist. 17, 1989): a misfit or a noise that is larger than stated, or correlated, is in the scatter as it
//! is in the data. The means of priors are drawn anew. Replicate `k` follows from seed and `k` alone.

use std::ops::Range;

use crate::parallel;
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

use super::fit::{FitOptions, FitOutcome, fit};
use super::monitor::Monitor;
use super::problem::LeastSquares;
use super::{EvalError, IdentifyError};

/// One replicate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Replicate {
    pub index: usize,
    /// its answer; none where the fit failed
    pub p: Option<Vec<f64>>,
    pub cost: f64,
}

/// The same problem with another measurement: r(p) + shift.
struct Shifted<'a, P: LeastSquares + ?Sized> {
    problem: &'a P,
    shift: DVector<f64>,
}

impl<P: LeastSquares + ?Sized> LeastSquares for Shifted<'_, P> {
    fn n_params(&self) -> usize {
        self.problem.n_params()
    }
    fn n_residuals(&self) -> usize {
        self.problem.n_residuals()
    }
    fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        Ok(self.problem.residuals(p)? + &self.shift)
    }
    fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> {
        let (r, j) = self.problem.jacobian(p)?;
        Ok((r + &self.shift, j))
    }
}

/// Refits the replicates of the given indices in parallel and hands each to `each` as it ends. `tests`: the rows of each test. Stops with
/// what there is when the monitor says so.
pub fn bootstrap<P: LeastSquares + ?Sized>(
    problem: &P,
    outcome: &FitOutcome,
    options: &FitOptions,
    tests: &[Range<usize>],
    (indices, seed): (&[usize], u64),
    monitor: &Monitor<'_>,
    each: &(dyn Fn(&Replicate) + Sync),
) -> Result<Vec<Replicate>, IdentifyError> {
    options.validate_form(problem)?;
    let residuals = outcome.residuals.rows(0, outcome.n_residuals).into_owned();
    let quiet = monitor.quiet();
    let one = |index: &usize| -> Option<Replicate> {
        if quiet.stops() {
            return None;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(*index as u64);
        let drawn = resampled(&residuals, tests, &mut rng);
        let mut own = options.clone();
        if let Ok(normal) = Normal::new(0.0, 1.0) {
            for prior in &mut own.priors {
                let z = normal.inverse_cdf(rng.random_range(f64::EPSILON..1.0 - f64::EPSILON));
                prior.mean = outcome.p[prior.index] + prior.sigma * z;
            }
        }
        // At the answer the residuals become the drawn ones.
        let shifted = Shifted { problem, shift: drawn - &residuals };
        let found = fit(&shifted, &outcome.p, &own, &quiet).ok().filter(|f| f.termination.name() != "failed");
        if quiet.stops() {
            return None;
        }
        let replicate = Replicate { index: *index, cost: found.as_ref().map_or(f64::MAX, |f| f.cost), p: found.map(|f| f.p) };
        each(&replicate);
        Some(replicate)
    };
    let mut all: Vec<Replicate> = parallel::map(indices, one).into_iter().flatten().collect();
    all.sort_by_key(|r| r.index);
    Ok(all)
}

/// Residuals of every test in moving blocks, centred and at their full size: what a fit has taken out of them is given back.
fn resampled(residuals: &DVector<f64>, tests: &[Range<usize>], rng: &mut ChaCha8Rng) -> DVector<f64> {
    let mut drawn = residuals.clone();
    for rows in tests.iter().filter(|rows| !rows.is_empty()) {
        let n = rows.len();
        let mean = residuals.rows(rows.start, n).sum() / n as f64;
        // An even length keeps the real and imaginary parts of a line together.
        let block = (((n as f64).cbrt() / 2.0).ceil() as usize * 2).min(n);
        let mut at = 0;
        while at < n {
            let from = rng.random_range(0..=n - block) / 2 * 2;
            for k in 0..block.min(n - at) {
                drawn[rows.start + at + k] = residuals[rows.start + (from + k).min(n - 1)] - mean;
            }
            at += block;
        }
    }
    drawn
}

/// How a value scatters over replicates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Standard deviation about their mean.
    pub std: f64,
    /// Quantiles 2.5 % and 97.5 %.
    pub interval: (f64, f64),
}

impl Spread {
    /// Of fewer than two values there is none.
    pub fn of(mut values: Vec<f64>) -> Option<Spread> {
        let n = values.len();
        if n < 2 {
            return None;
        }
        values.sort_by(f64::total_cmp);
        let mean = values.iter().sum::<f64>() / n as f64;
        let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1) as f64).sqrt();
        Some(Spread { std, interval: (quantile(&values, 0.025), quantile(&values, 0.975)) })
    }
}

/// Quantile of sorted values, linear between them.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * sorted.len().saturating_sub(1) as f64;
    let (low, part) = (at.floor() as usize, at.fract());
    let value = |k: usize| sorted.get(k).or(sorted.last()).copied().unwrap_or(f64::NAN);
    value(low) + part * (value(low + 1) - value(low))
}
