//! Where tests that a model is far from want its strengths, each by itself.
//!
//! A resonance or a record that is displaced by more than its width is not found from the strengths of all tests: the way there is that of a fit from a
//! distant start ([`super::approach`]), made for one test alone and within what strengths scatter at most.

use std::sync::Arc;

use crate::effect::{Kind, Role};
use crate::evidence::Deviations;
use crate::identify::Monitor;
use crate::model::{FreeParam, ParamValue, System};
use crate::parallel;
use crate::response::Plan;

use super::approach::approached;
use super::case::Case;
use super::results::SplitName;

/// Deviations of the strengths of each fitted test, as logarithms; none for a test that the model is not far from, or that cannot be fitted by itself.
/// `width`: standard deviation of the logarithm.
pub fn apart(case: &Case, system: &System, width: f64, monitor: &Monitor) -> Vec<Deviations> {
    let strengths: Vec<FreeParam> = system.free().into_iter().filter(|f| scatters(system, f)).collect();
    let mut own = system.clone();
    own.instances.iter_mut().flat_map(|i| &mut i.params).for_each(|p| p.free = false);
    for f in &strengths {
        let p = &mut own.instances[f.instance].params[f.param];
        *p = ParamValue { free: true, prior: Some((p.value, width * p.value)), ..p.clone() };
    }
    let of = |plan: &&Plan| -> Option<Deviations> {
        let plans = Arc::new(vec![((*plan).clone(), SplitName::Fit)]);
        let alone = Case { plans, system: own.clone(), orders: vec![], starts: 1, memo: None, ..case.clone() };
        let near = approached(&alone, monitor).ok()??;
        let fitted = alone.fit_system(&near, alone.plans_of(SplitName::Fit), &monitor.quiet()).ok()?;
        let value = |system: &System, f: &FreeParam| system.instances[f.instance].params[f.param].value;
        let by = |f: &FreeParam| (f.name.clone(), (value(&fitted.system, f) / value(system, f)).ln());
        Some(strengths.iter().map(by).filter(|(_, b)| b.is_finite()).collect())
    };
    parallel::map(&case.plans_of(SplitName::Fit), |plan| of(plan).unwrap_or_default())
}

fn scatters(system: &System, f: &FreeParam) -> bool {
    let (instance, value) = (&system.instances[f.instance], system.instances[f.instance].params[f.param].value);
    let info = instance.effect.info();
    info.role == Role::Force && info.params.get(f.param).is_some_and(|p| p.kind == Kind::Strength) && value > 0.0
}
