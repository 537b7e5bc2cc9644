//! The gate before a fit: does every free parameter move the residual, and can the data be reached at all?

use super::IdentifyError;
use super::ending::Termination;
use super::fit::{FitOptions, FitOutcome, fit};
use super::linalg::{QrReducer, damped_least_squares, svd};
use super::monitor::Monitor;
use super::problem::{Augmented, LeastSquares, Losses};
use crate::parallel;
use nalgebra::DVector;

/// One free parameter at the gate.
#[derive(Debug, Clone, PartialEq)]
pub struct GateParameter {
    pub name: String,
    /// a change of at most its own size moves some residual by more than rounding
    pub moves_residual: bool,
    /// ||r(p + change) - r(p)|| / relative change, in units of the noise
    pub sensitivity: f64,
    /// some value within its bounds, the others held, lowers the cost
    pub lowers_cost: bool,
}

/// A constraint that keeps the model from the data.
#[derive(Debug, Clone, PartialEq)]
pub struct Blocking {
    /// "k1 >= 0", or "prior of k1"
    pub label: String,
    /// distance, in standard deviations, between what the constraint or prior allows and what the data ask for
    pub pull: f64,
}

/// The gate's report.
#[derive(Debug, Clone, PartialEq)]
pub struct GateReport {
    pub free: Vec<GateParameter>,
    pub start_cost: f64,
    /// best cost of a short fit within the constraints
    pub best_cost: f64,
    /// rms of the data's whitened residuals there
    pub best_rms: f64,
    /// share of the best cost that lifting all constraints would remove, by the linear model
    pub blocked_share: f64,
    pub blocking: Vec<Blocking>,
    /// false when the short fit came to its end with the data out of reach (rms beyond three sigma) and constraints or priors in the way
    pub reachable: bool,
}

const SHORT_FIT: u64 = 25;
const OUT_OF_REACH: f64 = 3.0;

/// Runs the gate at `p`. Costs a few evaluations per parameter and a short fit.
pub fn gate<P: LeastSquares + ?Sized>(
    problem: &P,
    p: &[f64],
    options: &FitOptions,
    monitor: &Monitor<'_>,
) -> Result<GateReport, IdentifyError> {
    options.validate_with_start(problem, p)?;
    let plain = Augmented { problem, priors: &[] };
    let full = Augmented { problem, priors: &options.priors };
    let losses = Losses::new(&options.losses, problem.n_residuals())?;
    let r = parallel::watched(&monitor.first_watch(), || plain.residuals(p)).map_err(IdentifyError::StartFails)?;
    let watch = monitor.watch();
    let cost_at = |p: &[f64]| parallel::watched(&watch, || full.residuals(p)).ok().map(|r| losses.cost(&r));
    let start_cost =
        full.residuals(p).ok().map(|r| losses.cost(&r)).ok_or(IdentifyError::Numerical { while_doing: "evaluating the start" })?;
    // rounding of residuals of this size, with room for models that solve to a tolerance
    let rounding = 1e-9 * r.norm().max((r.len() as f64).sqrt());

    let mut free = Vec::new();
    for (j, name) in options.names.iter().enumerate().filter(|(j, _)| !options.constraints.is_fixed(*j)) {
        let (lower, upper) = (options.constraints.lower[j], options.constraints.upper[j]);
        let range = upper - lower;
        let size = if p[j] != 0.0 {
            p[j].abs()
        } else if range.is_finite() {
            range
        } else {
            1.0
        };
        let mut trial = p.to_vec();
        let (mut sensitivity, mut moves_residual, mut lowers_cost) = (0.0f64, false, false);
        for share in [0.01, -0.01, 0.1, -0.1, 1.0, -0.9, 9.0] {
            trial[j] = (p[j] + share * size).max(lower).min(upper);
            let change = (trial[j] - p[j]).abs() / size;
            if change == 0.0 || (moves_residual && lowers_cost) {
                continue;
            }
            let Ok(moved) = parallel::watched(&watch, || plain.residuals(&trial)) else { continue };
            let distance = (&moved - &r).norm();
            if share.abs() <= 1.0 && !moves_residual {
                moves_residual = distance > rounding;
                sensitivity = distance / change;
            }
            lowers_cost |= cost_at(&trial).is_some_and(|c| c < start_cost * (1.0 - 1e-12));
        }
        for end in [lower, upper].into_iter().filter(|v| v.is_finite()) {
            if lowers_cost {
                break;
            }
            trial[j] = end;
            lowers_cost |= cost_at(&trial).is_some_and(|c| c < start_cost * (1.0 - 1e-12));
        }
        free.push(GateParameter { name: name.clone(), moves_residual, sensitivity, lowers_cost });
    }

    let mut short = options.clone();
    short.tolerances.max_iterations = SHORT_FIT;
    let best = fit(problem, p, &short, &monitor.quiet())?;
    let (blocked_share, blocking) = blocking(&best, options, &losses);
    let best_rms = best.whitened_rms();
    // A fit that is still on its way says nothing of what is in it.
    let ended = matches!(best.termination, Termination::Converged(_) | Termination::Stalled);
    let reachable = !ended || best_rms <= OUT_OF_REACH || blocking.is_empty() || blocked_share < 0.5;
    Ok(GateReport { free, start_cost, best_cost: best.cost, best_rms, blocked_share, blocking, reachable })
}

/// What the linear model at `best` would gain without constraints and priors, and which of them press.
fn blocking(best: &FitOutcome, options: &FitOptions, losses: &Losses) -> (f64, Vec<Blocking>) {
    let weights = losses.sqrt_weights(&best.residuals);
    let m = best.n_residuals;
    let (j, r) = (best.jacobian.rows(0, m).into_owned(), best.residuals.rows(0, m).into_owned());
    let mut reduced = QrReducer::default().reduce(&j, &r, weights.as_deref());
    let norms: Vec<f64> = reduced.a.column_iter().map(|c| c.norm()).collect();
    for (k, norm) in norms.iter().enumerate().filter(|(_, n)| **n > 0.0) {
        reduced.a.column_mut(k).unscale_mut(*norm);
    }
    let u = damped_least_squares(&reduced.a, &reduced.q, 1e-12);
    let left: DVector<f64> = &reduced.a * &u + &reduced.q;
    let drop = 0.5 * (reduced.q.norm_squared() - left.norm_squared());
    let share = if best.cost > 0.0 { (drop / best.cost).clamp(0.0, 1.0) } else { 0.0 };
    let mut all = Vec::new();
    for active in best.active.iter().filter(|a| a.multiplier > 0.0) {
        // multiplier = d cost / d limit; over the column's curvature it is the way to the data, in standard deviations
        let source = options.constraints.inequalities().into_iter().find(|i| i.source == active.source);
        let curvature = source.map_or(0.0, |i| i.a.iter().map(|&(k, a)| (norms[k] / a).powi(2)).sum::<f64>().sqrt());
        if curvature > 0.0 {
            all.push(Blocking { label: active.label.clone(), pull: active.multiplier / curvature });
        }
    }
    // a prior against the data alone: distance of the two estimates over their joint standard deviation
    if let Some((s, v)) = (!options.priors.is_empty()).then(|| svd(&reduced.a)).flatten() {
        for prior in options.priors.iter().filter(|prior| norms[prior.index] > 0.0) {
            let k = prior.index;
            let known = (0..s.len()).filter(|&c| s[c] > 1e-10 * s[0]);
            let variance = known.map(|c| (v[(k, c)] / (s[c] * norms[k])).powi(2)).sum::<f64>();
            let pull = (best.p[k] + u[k] / norms[k] - prior.mean).abs() / (variance + prior.sigma * prior.sigma).sqrt();
            if pull > OUT_OF_REACH {
                all.push(Blocking { label: format!("prior of {}", options.names[k]), pull });
            }
        }
    }
    all.sort_by(|a, b| b.pull.total_cmp(&a.pull));
    (share, all)
}
