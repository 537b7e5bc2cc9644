//! The way to the measurements from a distant start, and how far along a record a model keeps in step with them.

use crate::data::TestKind;
use crate::identify::{self, FitOptions, LeastSquares, Monitor, Prior};
use crate::model::{FreeParam, System};
use crate::parallel;
use crate::residual::{Approach, Problem, test_error};
use crate::response::Plan;

use super::case::Case;
use crate::diagnose::DiagnoseError;
use crate::diagnose::results::SplitName;

/// The model nearer to the fitted tests, where it computes an FRF or a record of theirs so far off that the difference does not lead there;
/// `None` where none is. An FRF is approached by its logarithm ([`Approach`]), a record from its first cycles on: where late ones are out of
/// phase these are not yet, and what they teach brings the next ones into phase.
///
/// Strengths with a start above zero are moved by factors. What the tests say little of from afar stays near its start, and what starts at
/// zero stays there: an effect that the approach had switched off would be lost to the fit, and an exponent far beyond reason too.
///
/// # Errors
/// [`DiagnoseError`] where the start cannot be computed, or bounds and orders contradict each other.
pub fn approached(case: &Case, monitor: &Monitor) -> Result<Option<System>, DiagnoseError> {
    let Some(far) = far(case, &[TestKind::Frf, TestKind::Transient], monitor) else { return Ok(None) };
    // Loops and energies do not lead the way: about the cycles at its start they say well enough where it must not go. FRFs of turned parts are computed about the
    // equilibrium at the start; the fit that follows computes all of them in full.
    let near = case.expanded(&case.system);
    let way = Way::new(near.as_ref().unwrap_or(case), far, monitor)?;
    let mut p = way.start.clone();
    for doublings in 0..case.search.settings.fitting.doublings {
        let Some(openings) = way.opened(doublings) else { break };
        p = way.fit(&way.over(&openings), &p)?;
    }
    p = way.fit(&way.whole, &p)?;
    let misses = |p: &[f64]| Approach::new(&way.whole).residuals(p).map_or(f64::INFINITY, |r| r.norm_squared());
    Ok((misses(&p) < misses(&way.start)).then(|| way.whole.system_at(&p)))
}

/// The case with every record of the fit and select tests cut to its first cycles, as many as a model that is out of step with a fitted one
/// can follow when it is fitted to no more than these, and the model so fitted; `None` where it is out of step with none, or can follow all.
/// What a model lacks shows in its first cycles; later ones are out of phase whatever it is.
///
/// # Errors
/// As [`approached`].
pub fn in_step(case: &Case, monitor: &Monitor) -> Result<Option<Case>, DiagnoseError> {
    let Some(far) = far(case, &[TestKind::Transient], monitor) else { return Ok(None) };
    let way = Way::new(case, far, monitor)?;
    let mut kept = (0, way.start.clone());
    for doublings in 0..case.search.settings.fitting.doublings {
        let Some(openings) = way.opened(doublings) else { return Ok(None) };
        let begun = way.over(&openings);
        let p = way.fit(&begun, &kept.1)?;
        let system = begun.system_at(&p);
        let follows = !begun
            .plans
            .iter()
            .zip(&openings)
            .any(|(plan, opening)| opening.is_some() && off(plan, &system, case.search.settings.fitting.far_off));
        if follows || doublings == 0 {
            kept = (doublings, p);
        }
        if !follows {
            break;
        }
    }
    let cut = |(plan, split): &(Plan, SplitName)| match split {
        SplitName::HeldOut => (plan.clone(), *split),
        _ => (plan.opening(kept.0).unwrap_or_else(|| plan.clone()), *split),
    };
    let plans = std::sync::Arc::new(case.plans.iter().map(cut).collect());
    Ok(Some(Case { plans, system: way.whole.system_at(&kept.1), ..case.clone() }))
}

/// Whether a model is out of step with any record of the fitted tests.
pub fn out_of_step(case: &Case, system: &System) -> bool {
    case.plans_of(SplitName::Fit)
        .iter()
        .any(|plan| plan.kind == TestKind::Transient && off(plan, system, case.search.settings.fitting.far_off))
}

/// Whether a model computes a test so far off that the difference does not lead to it.
fn off(plan: &Plan, system: &System, far_off: f64) -> bool {
    plan.evaluate(system, &[], false).is_ok_and(|c| test_error(plan, &c.values).error > far_off)
}

/// Which of the fitted tests of these kinds are far off at the start; `None` where none is, or nothing is to be fitted.
fn far(case: &Case, kinds: &[TestKind], monitor: &Monitor) -> Option<Vec<bool>> {
    if case.system.free().is_empty() || monitor.resumes() {
        return None;
    }
    let far_off = case.search.settings.fitting.far_off;
    let far = parallel::map(&case.plans_of(SplitName::Fit), |plan| kinds.contains(&plan.kind) && off(plan, &case.system, far_off));
    far.contains(&true).then_some(far)
}

/// A fit from afar.
struct Way<'a> {
    whole: Problem<'a>,
    /// Which of its tests are far off at the start.
    far: Vec<bool>,
    start: Vec<f64>,
    options: FitOptions,
    monitor: Monitor<'a>,
}

impl<'a> Way<'a> {
    fn new(case: &'a Case, far: Vec<bool>, monitor: &'a Monitor) -> Result<Self, DiagnoseError> {
        let (system, s) = (&case.system, &case.search.settings.fitting);
        let mut whole = Problem::new(case.plans_of(SplitName::Fit), system.clone());
        let ordered = |f: &FreeParam| case.orders.iter().any(|(a, b, _)| *a == f.name || *b == f.name);
        for f in &mut whole.free {
            let param = &system.instances[f.instance].params[f.param];
            f.log |= param.value > 0.0 && param.min >= 0.0 && param.prior.is_none() && !ordered(f);
        }
        let start = whole.variables();
        let mut options = case.options_in(&whole.free, system, 0)?;
        options.constraints.validate(&options.names)?;
        options.tolerances.f_tol = s.near_enough;
        options.tolerances.drop = 0.0;
        options.tolerances.max_iterations = s.approach.min(case.max_iterations);
        for (index, (f, v)) in whole.free.iter().zip(&start).enumerate() {
            let sigma = if f.log { s.near } else { s.near * v.abs() };
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
        Ok(Way { whole, far, start, options, monitor: monitor.quiet() })
    }

    /// The first cycles of the records that are far off; `None` where that is all of each.
    fn opened(&self, doublings: u32) -> Option<Vec<Option<Plan>>> {
        let openings = self.whole.plans.iter().zip(&self.far).map(|(plan, far)| plan.opening(doublings).filter(|_| *far));
        let openings: Vec<Option<Plan>> = openings.collect();
        openings.iter().any(Option::is_some).then_some(openings)
    }

    fn over<'b>(&'b self, openings: &'b [Option<Plan>]) -> Problem<'b> {
        let plans = self.whole.plans.iter().zip(openings).map(|(plan, opening)| opening.as_ref().unwrap_or(plan)).collect();
        Problem { free: self.whole.free.clone(), ..Problem::new(plans, self.whole.system.clone()) }
    }

    fn fit(&self, problem: &Problem, p: &[f64]) -> Result<Vec<f64>, DiagnoseError> {
        Ok(identify::fit(&Approach::new(problem), p, &self.options, &self.monitor)?.p)
    }
}
