//! Cross-validation: what a model says of parts of the fitted tests that it was not fitted to.

use crate::identify::Monitor;
use crate::model::{ParamValue, System};
use crate::parallel;
use crate::response::Plan;

use super::case::{Case, Fitted};
use super::refit::{Whitened, some, whitened};
use super::results::SplitName;

/// Iterations of a fold: it begins where the fit to all of them ended, and three quarters of the tests move that little.
const FOLD_ITERATIONS: u64 = 10;
/// Relative change of the cost at which it ends: what the rest of the tests leaves open it need not follow.
const FOLD_F_TOL: f64 = 1e-3;
/// Factor within which it keeps a positive parameter: one that only the part it does not see identifies would run until the model can
/// hardly be computed.
const NEAR: f64 = 3.0;
/// Folds of a cross-validation.
const FOLDS: usize = 4;
/// Stretches that a test is cut into where its parts are the folds.
const STRETCHES: usize = 12;
/// Factor on the sigma of rows that a fold does not see.
const UNSEEN: f64 = 1e8;

/// Whitened residuals on parts of the fit tests of a model that was fitted to the rest: what a select split would say where there is
/// none. With [`FOLDS`] tests or more each part is a group of whole tests; with fewer, a fit to one test alone says more about that
/// test than about the effect, and the parts are stretches of every test.
pub fn cross_validated(case: &Case, system: &System, monitor: &Monitor) -> Result<Whitened, String> {
    let plans = case.plans_of(SplitName::Fit);
    let single = Case { f_tol: Some(FOLD_F_TOL), ..some(case, FOLD_ITERATIONS) };
    let system = kept_near(system);
    let fit = |plans: Vec<&Plan>| single.fit_system(&system, plans, &monitor.quiet()).map_err(|e| e.to_string());
    if plans.len() >= FOLDS { over_tests(&plans, fit) } else { over_stretches(&plans, fit) }
}

/// The system with its positive parameters within a factor [`NEAR`] of where they stand.
fn kept_near(system: &System) -> System {
    let mut near = system.clone();
    near.instances.iter_mut().flat_map(|i| &mut i.params).filter(|p| p.free).for_each(|p| (p.min, p.max) = near_bounds(p));
    near
}

fn near_bounds(p: &ParamValue) -> (f64, f64) {
    if p.value > 0.0 { (p.min.max(p.value / NEAR), p.max.min(p.value * NEAR)) } else { (p.min, p.max) }
}

/// Every fourth test is left out in turn.
fn over_tests(plans: &[&Plan], fit: impl Fn(Vec<&Plan>) -> Result<Fitted, String> + Sync) -> Result<Whitened, String> {
    let of = |fold: usize, inside: bool| -> Vec<&Plan> {
        plans.iter().enumerate().filter(|(t, _)| (t % FOLDS == fold) == inside).map(|(_, p)| *p).collect()
    };
    let parts = parallel::over(FOLDS, |fold| whitened(&of(fold, true), &fit(of(fold, false))?.system));
    let parts: Vec<Whitened> = parts.into_iter().collect::<Result<_, String>>()?;
    Ok((0..plans.len()).map(|t| parts[t % FOLDS][t / FOLDS].clone()).collect())
}

/// Every fourth stretch of every test is left out in turn.
fn over_stretches(plans: &[&Plan], fit: impl Fn(Vec<&Plan>) -> Result<Fitted, String> + Sync) -> Result<Whitened, String> {
    let fold_of = |test: usize, row: usize| row * STRETCHES / plans[test].len().max(1) % FOLDS;
    let without = |fold: usize| -> Vec<Plan> {
        let masked = |(t, plan): (usize, &&Plan)| {
            let mut masked = (*plan).clone();
            masked.sigma.iter_mut().enumerate().filter(|(row, _)| fold_of(t, *row) == fold).for_each(|(_, s)| *s *= UNSEEN);
            masked.correlated.clone().map_or_else(|| masked.clone(), |c| masked.with_instruments(&c.signal))
        };
        plans.iter().enumerate().map(masked).collect()
    };
    let parts = parallel::over(FOLDS, |fold| whitened(plans, &fit(without(fold).iter().collect())?.system));
    let parts: Vec<Whitened> = parts.into_iter().collect::<Result<_, String>>()?;
    Ok((0..plans.len()).map(|t| (0..plans[t].len()).map(|row| parts[fold_of(t, row)][t][row]).collect()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fold_keeps_positive_parameters_near() {
        let bounds = |value: f64, min: f64, max: f64| near_bounds(&ParamValue { value, min, max, ..ParamValue::fixed(value) });
        assert_eq!(bounds(6.0, 0.0, f64::INFINITY), (2.0, 18.0));
        // Its own bounds are the narrower.
        assert_eq!(bounds(6.0, 5.0, 7.0), (5.0, 7.0));
        // At zero, or with a sign, it has no size of its own.
        assert_eq!(bounds(0.0, 0.0, 9.0), (0.0, 9.0));
        assert_eq!(bounds(-6.0, f64::NEG_INFINITY, 9.0), (f64::NEG_INFINITY, 9.0));
    }
}
