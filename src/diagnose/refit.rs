//! Full refits of the best candidates: what the score predicts is proved here.

use rayon::prelude::*;

use crate::effect::{Grid, Kind, Role};
use crate::identify::{Monitor, Termination};
use crate::model::System;
use crate::residual::test_error;
use crate::response::Plan;

use super::candidates::{Name, Trial};
use super::case::{Case, Fitted};
use super::results::SplitName;
use super::score::Score;

/// Iterations of a refit: what is far from the floor after these is no explanation.
const REFIT_ITERATIONS: u64 = 40;
/// Iterations that every picked candidate gets.
const FIRST_LOOK: u64 = 8;
/// A candidate is refitted in full when its cost is within this factor of the best after the first look, or among the best three.
const HOPEFUL: f64 = 10.0;

/// Folds of a cross-validation.
const FOLDS: usize = 4;
/// Stretches that a test is cut into where its parts are the folds.
const STRETCHES: usize = 12;
/// Factor on the sigma of rows that a fold does not see.
const UNSEEN: f64 = 1e8;

/// Residuals of one test, whitened.
pub type Whitened = Vec<Vec<f64>>;

/// A refitted candidate.
pub struct Refit {
    /// Index of the candidate.
    pub candidate: usize,
    /// Its best score.
    pub score: Score,
    /// The refitted system, or why there is none.
    pub result: Result<Proof, String>,
}

/// What a refit gave.
pub struct Proof {
    /// The fitted system.
    pub fitted: Fitted,
    /// Whitened residuals on the fit tests.
    pub fit: Whitened,
    /// Whitened residuals on the select tests.
    pub select: Whitened,
}

/// Best score of each candidate, in order.
pub fn best_per_candidate(scores: &[Score], trials: &[Trial]) -> Vec<Score> {
    let mut seen = std::collections::HashSet::new();
    scores.iter().filter(|s| s.drop > 0.0 && seen.insert(trials[s.trial].candidate)).copied().collect()
}

/// The candidate's instance with a start for its strength, everything of it free.
pub fn started(trial: &Trial, strength: f64) -> crate::model::Instance {
    let mut instance = trial.instance.clone();
    instance.follower = false;
    let info = instance.effect.info();
    for (value, p) in instance.params.iter_mut().zip(info.params) {
        // An elastic limit that was tried is fitted as well.
        let elastic = matches!(p.grid, Grid::Elastic(_)) && value.value > 0.0;
        if p.kind == Kind::Shape || elastic {
            value.free = true;
            (value.min, value.max) = (p.min, p.max);
        }
    }
    let start = info.params[0].default + strength;
    // A gain must stay positive; other strengths with a sign were scored one-sided.
    instance.params[0].value = if info.role == Role::Channel && info.params[0].default == 1.0 { start.clamp(0.5, 2.0) } else { start };
    instance
}

/// Whitened residuals of the given tests.
pub fn whitened(plans: &[&Plan], system: &System) -> Result<Whitened, String> {
    plans
        .par_iter()
        .map(|plan| {
            let c = plan.evaluate(system, &[], false).map_err(|e| e.to_string())?;
            Ok(c.values.iter().zip(&plan.measured).zip(&plan.sigma).map(|((y, m), s)| (y - m) / s).collect())
        })
        .collect()
}

/// Refits candidates, in parallel; the order of the list is kept. All get a first look of a few iterations; those that then stand far
/// behind are shown as they are, the others are refitted in full.
pub fn refit_all(
    case: &Case,
    base: &System,
    names: &[Name],
    trials: &[Trial],
    picked: &[Score],
    monitor: &Monitor,
    watch: &(dyn Fn(&str) + Sync),
) -> Vec<Refit> {
    let looks: Vec<Result<Fitted, String>> =
        picked.par_iter().map(|score| first_look(case, base, &trials[score.trial], score, monitor)).collect();
    let mut costs: Vec<f64> = looks.iter().flatten().map(|f| f.outcome.cost).collect();
    costs.sort_by(f64::total_cmp);
    let (best, third) = (costs.first().copied().unwrap_or(0.0), costs.get(2).or(costs.last()).copied().unwrap_or(0.0));
    picked
        .par_iter()
        .zip(looks)
        .map(|(score, look)| {
            let name = &names[trials[score.trial].candidate];
            let result = look.and_then(|fitted| {
                let hopeful = fitted.outcome.cost <= (HOPEFUL * best).max(third);
                if hopeful && fitted.outcome.termination == Termination::MaxIterations {
                    prove(case, &fitted.system, monitor)
                } else {
                    proof(case, fitted)
                }
            });
            match &result {
                Ok(p) => watch(&format!("  refit {} at {}: cost {:.4e}", name.effect, name.at, p.fitted.outcome.cost)),
                Err(e) => watch(&format!("  refit {} at {} failed: {e}", name.effect, name.at)),
            }
            Refit { candidate: trials[score.trial].candidate, score: *score, result }
        })
        .collect()
}

/// The first iterations of a refit. Where the model cannot be computed at the strength the score expects, it starts with less.
fn first_look(case: &Case, base: &System, trial: &Trial, score: &Score, monitor: &Monitor) -> Result<Fitted, String> {
    let mut failed = String::new();
    for part in [1.0, 0.3, 0.1] {
        let mut system = base.clone();
        system.instances.push(started(trial, part * score.strength));
        match fit_some(case, &system, FIRST_LOOK, monitor) {
            Ok(fitted) => return Ok(fitted),
            Err(reason) => failed = reason,
        }
    }
    Err(failed)
}

fn fit_some(case: &Case, system: &System, iterations: u64, monitor: &Monitor) -> Result<Fitted, String> {
    let mut single = case.clone();
    single.starts = 1;
    single.max_iterations = single.max_iterations.min(iterations);
    let fitted = single.fit_system(system, case.plans_of(SplitName::Fit), &monitor.quiet()).map_err(|e| e.to_string())?;
    match &fitted.outcome.termination {
        Termination::Failed(reason) => Err(reason.clone()),
        _ => Ok(fitted),
    }
}

/// Fits a system and holds it against the select tests.
pub fn prove(case: &Case, system: &System, monitor: &Monitor) -> Result<Proof, String> {
    proof(case, fit_some(case, system, REFIT_ITERATIONS, monitor)?)
}

fn proof(case: &Case, fitted: Fitted) -> Result<Proof, String> {
    let fit = whitened(&case.plans_of(SplitName::Fit), &fitted.system)?;
    let select = whitened(&case.plans_of(SplitName::Select), &fitted.system)?;
    Ok(Proof { fitted, fit, select })
}

/// Whitened residuals on parts of the fit tests of a model that was fitted to the rest: what a select split would say where there is
/// none. With [`FOLDS`] tests or more each part is a group of whole tests; with fewer, a fit to one test alone says more about that
/// test than about the effect, and the parts are stretches of every test.
pub fn cross_validated(case: &Case, system: &System, monitor: &Monitor) -> Result<Whitened, String> {
    let plans = case.plans_of(SplitName::Fit);
    let mut single = case.clone();
    single.starts = 1;
    single.max_iterations = single.max_iterations.min(REFIT_ITERATIONS);
    let by_test = plans.len() >= FOLDS;
    // Fold of a row: of its test, or of its stretch.
    let fold_of = |test: usize, row: usize| if by_test { test % FOLDS } else { row * STRETCHES / plans[test].len().max(1) % FOLDS };
    let parts: Vec<Whitened> = (0..FOLDS)
        .into_par_iter()
        .map(|fold| {
            let mut masked: Vec<Plan> = Vec::new();
            for (t, plan) in plans.iter().enumerate().filter(|(t, _)| !by_test || fold_of(*t, 0) != fold) {
                let mut plan = (*plan).clone();
                plan.sigma.iter_mut().enumerate().filter(|(row, _)| fold_of(t, *row) == fold).for_each(|(_, s)| *s *= UNSEEN);
                masked.push(plan);
            }
            let fitted = single.fit_system(system, masked.iter().collect(), &monitor.quiet()).map_err(|e| e.to_string())?;
            let tests: Vec<&Plan> = plans.iter().enumerate().filter(|(t, _)| !by_test || fold_of(*t, 0) == fold).map(|(_, p)| *p).collect();
            whitened(&tests, &fitted.system)
        })
        .collect::<Result<_, String>>()?;
    let mut taken = [0; FOLDS];
    Ok((0..plans.len())
        .map(|t| {
            let mut row_of = |row: usize| {
                let fold = fold_of(t, row);
                parts[fold][if by_test { taken[fold] } else { t }][row]
            };
            let rows = (0..plans[t].len()).map(&mut row_of).collect();
            taken[fold_of(t, 0)] += 1;
            rows
        })
        .collect())
}

/// Pooled relative error of tests with the given whitened residuals.
pub fn pooled_error(plans: &[&Plan], residuals: &Whitened) -> f64 {
    let squares = plans.iter().zip(residuals).map(|(plan, w)| {
        let computed: Vec<f64> = w.iter().zip(&plan.measured).zip(&plan.sigma).map(|((r, m), s)| m + r * s).collect();
        test_error(plan, &computed).error.powi(2)
    });
    (squares.sum::<f64>() / plans.len().max(1) as f64).sqrt()
}

/// Half the sum of squares.
pub fn cost(w: &Whitened) -> f64 {
    0.5 * w.iter().flatten().map(|r| r * r).sum::<f64>()
}
