//! The way to the measurements from a distant start.

use crate::data::TestKind;
use crate::identify::{self, Monitor, Prior};
use crate::model::{FreeParam, System};
use crate::parallel;
use crate::residual::{Approach, Problem, test_error};
use crate::response::Plan;

use super::DiagnoseError;
use super::case::Case;
use super::results::SplitName;

/// Relative error of an FRF from which its peaks do not overlap the measured ones.
const FAR_OFF: f64 = 0.5;
/// Relative change of the cost at which the approach ends, and its most iterations.
const NEAR_ENOUGH: f64 = 5e-2;
const MOST: u64 = 40;
/// What a parameter may be off from its start for one unit, as part of it or, of a logarithm, in the logarithm.
const NEAR: f64 = 1.0;

/// The model nearer to the fitted tests, where it computes an FRF of theirs so far off that the difference does not lead there
/// ([`Approach`]); `None` where none is.
///
/// Strengths with a start above zero are moved by factors. What the tests say little of from afar stays near its start, and what starts at
/// zero stays there: an effect that the approach had switched off would be lost to the fit, and an exponent far beyond reason too.
///
/// # Errors
/// [`DiagnoseError`] where the start cannot be computed, or bounds and orders contradict each other.
pub fn approached(case: &Case, monitor: &Monitor) -> Result<Option<System>, DiagnoseError> {
    let system = &case.system;
    let mut problem = Problem::new(case.plans_of(SplitName::Fit), system.clone());
    if problem.free.is_empty() || monitor.resumes() {
        return Ok(None);
    }
    let far = |plan: &&Plan| {
        let computed = (plan.kind == TestKind::Frf).then(|| plan.evaluate(system, &[], false).ok()).flatten();
        computed.is_some_and(|c| test_error(plan, &c.values).error > FAR_OFF)
    };
    if !parallel::map(&problem.plans, far).contains(&true) {
        return Ok(None);
    }
    let ordered = |f: &FreeParam| case.orders.iter().any(|(a, b, _)| *a == f.name || *b == f.name);
    for f in &mut problem.free {
        let param = &system.instances[f.instance].params[f.param];
        f.log |= param.value > 0.0 && param.min >= 0.0 && param.prior.is_none() && !ordered(f);
    }
    let start = problem.variables();
    let mut options = case.options_in(&problem.free, system, 0)?;
    options.constraints.validate(&options.names)?;
    options.tolerances.f_tol = NEAR_ENOUGH;
    options.tolerances.drop = 0.0;
    options.tolerances.max_iterations = MOST.min(case.max_iterations);
    for (index, (f, v)) in problem.free.iter().zip(&start).enumerate() {
        let sigma = if f.log { NEAR } else { NEAR * v.abs() };
        if options.priors.iter().any(|p| p.index == index) {
            continue;
        }
        if sigma > 0.0 {
            options.priors.push(Prior { index, mean: *v, sigma });
        } else {
            options.constraints.lower[index] = *v;
            options.constraints.upper[index] = *v;
        }
    }
    let outcome = identify::fit(&Approach::new(&problem), &start, &options, &monitor.quiet())?;
    Ok((outcome.cost < outcome.start_cost).then(|| problem.system_at(&outcome.p)))
}
