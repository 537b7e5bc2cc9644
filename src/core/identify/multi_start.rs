//! Several starts, fitted in parallel, ranked.

use super::IdentifyError;
use super::ending::Termination;
use super::fit::{FitOptions, FitOutcome, fit};
use super::monitor::Monitor;
use super::problem::LeastSquares;
use crate::parallel;
use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::{Arc, Mutex};

/// One start and what came of it. A start that failed says why and ranks last.
#[derive(Debug)]
pub struct StartResult {
    pub start: Vec<f64>,
    pub result: Result<FitOutcome, IdentifyError>,
}

impl StartResult {
    /// Order of merit: cost, with failures and fits that ended in a failure at the end.
    fn merit(&self) -> f64 {
        match &self.result {
            Ok(outcome) if !matches!(outcome.termination, Termination::Failed(_)) && outcome.cost.is_finite() => outcome.cost,
            _ => f64::INFINITY,
        }
    }

    /// One line for the log.
    pub fn describe(&self) -> String {
        match &self.result {
            Ok(o) => format!("cost {:.6e} after {} iterations, {}", o.cost, o.iterations, o.termination.name()),
            Err(why) => format!("failed: {why}"),
        }
    }
}

/// Fits from every start on rayon's threads and returns all of them, best cost first (ties keep the order given, so the result does not
/// depend on the number of threads). Every member runs under the monitor's cancel flag and deadline; the checkpoint holds the best state
/// of all, from which [`fit`] goes on with one start.
pub fn multi_start<P: LeastSquares + ?Sized>(
    problem: &P,
    starts: &[Vec<f64>],
    options: &FitOptions,
    monitor: &Monitor<'_>,
) -> Result<Vec<StartResult>, IdentifyError> {
    options.validate(problem)?; // what no start can cure is said once
    let least = Arc::new(Mutex::new(f64::INFINITY));
    let run = |start: &Vec<f64>| StartResult { start: start.clone(), result: fit(problem, start, options, &monitor.member(&least)) };
    let mut all: Vec<StartResult> = parallel::map(starts, run);
    all.sort_by(|a, b| a.merit().total_cmp(&b.merit()));
    match all.first().map(|best| &best.result) {
        Some(Err(first)) => Err(IdentifyError::AllStartsFailed { count: all.len(), first: first.to_string() }),
        None => Err(IdentifyError::Dimension { what: "starts".into(), got: 0, expected: 1 }),
        Some(Ok(_)) => Ok(all),
    }
}

/// Latin hypercube of `count` feasible starts, deterministic in `seed`; `around` itself is the first of them.
///
/// A parameter with two finite bounds is spread over them, in the logarithm when both are positive and more than a decade apart. One
/// without is spread over `around` / 10 .. `around` * 10 (clipped to the bound it has), keeping its sign; at zero it keeps its value.
/// Samples that violate orders or rows are moved to the nearest feasible point.
pub fn latin_hypercube(around: &[f64], options: &FitOptions, count: usize, seed: u64) -> Result<Vec<Vec<f64>>, IdentifyError> {
    let constraints = &options.constraints;
    constraints.validate(&options.names)?;
    constraints.check_start(around, &options.names)?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let extra = count.saturating_sub(1);
    let mut columns = Vec::with_capacity(around.len());
    for (j, &v) in around.iter().enumerate() {
        let mut strata: Vec<usize> = (0..extra).collect();
        strata.shuffle(&mut rng);
        let at = |u: f64| {
            let (lower, upper) = (constraints.lower[j], constraints.upper[j]);
            match (lower.is_finite() && upper.is_finite(), v == 0.0) {
                (true, _) if lower > 0.0 && upper > 10.0 * lower => (lower.ln() + u * (upper / lower).ln()).exp(),
                (true, _) => lower + u * (upper - lower),
                (false, true) => v,
                (false, false) => v * 10f64.powf(2.0 * u - 1.0),
            }
            .clamp(lower, upper)
        };
        columns.push(strata.into_iter().map(|s| at((s as f64 + rng.random::<f64>()) / extra as f64)).collect::<Vec<f64>>());
    }
    let scale: Vec<f64> = around.iter().enumerate().map(|(j, v)| typical(v.abs(), constraints.lower[j], constraints.upper[j])).collect();
    let mut starts = vec![around.to_vec()];
    for k in 0..extra {
        let sample: Vec<f64> = columns.iter().map(|c| c[k]).collect();
        starts.push(constraints.project(&sample, &scale)?);
    }
    starts.truncate(count);
    Ok(starts)
}

fn typical(size: f64, lower: f64, upper: f64) -> f64 {
    let range = upper - lower;
    if range.is_finite() && range > 0.0 {
        range
    } else if size > 0.0 {
        size
    } else {
        1.0
    }
}
