//! Parameters that have run to absurdity: a fit that ends with one has failed, whatever its cost has converged to.
//!
//! A parameter that the tests do not hold drifts off for good. One that the tests hold may run away too, where they contradict the model: a force that
//! moves a structure the wrong way is answered best by a structure that does not move, and a mass that no force could have moved is then identified.

use crate::data::TestKind;
use crate::model::{FreeParam, System};
use crate::residual::Problem;
use crate::response::Plan;

use super::case::{Case, Fitted};
use super::fit::digits;
use crate::diagnose::results::{ParameterResult, SplitName};

/// Parameters that have run away, each with what may be done.
pub fn absurd(case: &Case, fitted: &Fitted, parameters: &[ParameterResult], began: &System) -> Vec<String> {
    let mut all = ran_away(case, fitted, parameters, began);
    if all.is_empty() {
        all.extend(holds_still(case, fitted, began));
    }
    all
}

fn value(system: &System, f: &FreeParam) -> f64 {
    system.instances[f.instance].params[f.param].value
}

/// From where to where a parameter has gone, in the unit of the study.
fn way(fitted: &System, began: &System, f: &FreeParam) -> String {
    let (symbol, factor) = &fitted.instances[f.instance].params[f.param].unit;
    format!("`{}` ran away: from {} to {} {symbol}", f.name, digits(value(began, f) / factor, 3), digits(value(fitted, f) / factor, 3))
        .trim_end()
        .to_string()
}

/// Free parameters without an upper bound that the tests do not hold and that have left every scale: that of their start or, where they begin at nothing, the
/// value whose first-order effect is as large as everything that was measured.
fn ran_away(case: &Case, fitted: &Fitted, parameters: &[ParameterResult], began: &System) -> Vec<String> {
    let times = case.search.settings.fitting.ran_away;
    let scales = std::cell::OnceCell::new();
    let scale = |f: &FreeParam| match value(began, f).abs() {
        0.0 => scales.get_or_init(|| scales_at_zero(case, began)).iter().find(|s| s.0 == f.name).map(|s| s.1),
        from => Some(from),
    };
    let one = |f: &FreeParam| {
        let open = fitted.system.instances[f.instance].params[f.param].max.is_infinite();
        let held = parameters.iter().any(|p| p.name == f.name && p.identifiable);
        let far = open && !held && scale(f).is_some_and(|s| value(&fitted.system, f).abs() > times * s);
        far.then(|| {
            format!(
                "{}; the fitted tests do not hold it, or contradict the model (signs, units, places: `misfit check`); a `max` in study.toml keeps it",
                way(&fitted.system, began, f)
            )
        })
    };
    fitted.free.iter().filter_map(one).collect()
}

/// The scale of every free parameter that begins at 0; none of those that move nothing there.
fn scales_at_zero(case: &Case, began: &System) -> Vec<(String, f64)> {
    let problem = Problem::new(case.plans_of(SplitName::Fit), began.clone());
    let Ok(computed) = problem.compute(&problem.variables(), true) else { return vec![] };
    let n = problem.free.len();
    let (mut measured, mut slopes) = (0.0, vec![0.0; n]);
    for (plan, c) in problem.plans.iter().zip(&computed) {
        for (row, (m, s)) in plan.measured.iter().zip(&plan.sigma).enumerate() {
            measured += (m / s).powi(2);
            slopes.iter_mut().enumerate().for_each(|(k, sum)| *sum += (c.slopes[row * n + k] / s).powi(2));
        }
    }
    let each = problem.free.iter().zip(slopes).filter(|(f, s)| value(began, f) == 0.0 && *s > 0.0);
    each.map(|(f, s)| (f.name.clone(), (measured / s).sqrt())).collect()
}

/// How large the tests that a force drives are computed, over how large they were measured, in units of their noise; none where there are no such tests.
fn answers(driven: &[&Plan], system: &System) -> Option<f64> {
    let (mut computed, mut measured) = (0.0, 0.0);
    for plan in driven {
        let values = plan.evaluate(system, &[], false).ok()?.values;
        let size = |values: &[f64]| values.iter().zip(&plan.sigma).map(|(v, s)| (v / s).powi(2)).sum::<f64>();
        computed += size(&values);
        measured += size(&plan.measured);
    }
    Some((computed / measured).sqrt()).filter(|r| r.is_finite())
}

/// The parameters that let a model stand still under forces that moved what was measured: more mass, stiffness or damping than the drive could move. A model
/// that has stood still from its start is far from its tests, and has not run there.
fn holds_still(case: &Case, fitted: &Fitted, began: &System) -> Vec<String> {
    let s = &case.search.settings.fitting;
    let driven: Vec<&Plan> = case.plans_of(SplitName::Fit).into_iter().filter(|p| p.driven_by_force()).collect();
    let Some(part) = answers(&driven, &fitted.system).filter(|now| *now < s.stands_still) else { return vec![] };
    if answers(&driven, began).is_none_or(|before| before <= part) {
        return vec![];
    }
    // What has grown, in the logarithm; a parameter that began at nothing has grown most.
    let grown = |f: &FreeParam| (value(&fitted.system, f) / value(began, f)).abs().ln();
    let furthest = fitted.free.iter().map(grown).fold(0.0, f64::max);
    let runaways = fitted.free.iter().filter(|f| grown(f) > 0.0 && grown(f) >= s.part_of_the_way * furthest);
    let tests: Vec<String> = driven.iter().take(3).map(|p| format!("`{}`", p.id)).collect();
    let told = |f: &FreeParam| {
        format!(
            "{}; with it the model stands still in {}, where it answers {} % of what was measured: no drive of these tests could move it, so that they \
             contradict the model (signs, units, places: `misfit check`); a `max` in study.toml keeps it",
            way(&fitted.system, began, f),
            tests.join(", "),
            digits(100.0 * part, 2)
        )
    };
    runaways.map(told).collect()
}

impl Plan {
    /// Whether a force drives the test and a motion answers.
    fn driven_by_force(&self) -> bool {
        let moves = |role: &str| ["displacement", "velocity", "acceleration", "response"].contains(&role);
        match self.kind {
            TestKind::Frf => true,
            TestKind::Cycle | TestKind::Transient => {
                !self.blocks.is_empty() && self.blocks.iter().all(|b| moves(&b.role) && b.x.is_empty())
            }
            TestKind::Modal | TestKind::Energy | TestKind::Backbone => false,
        }
    }
}
