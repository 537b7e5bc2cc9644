//! What a prediction is to be trusted for: its scatter over replicates of the fit, and whether it lies outside what was tested.

use crate::diagnose::Fitted;
use crate::identify::{Replicate, Spread};
use crate::parallel;
use crate::study::{PredictionSpec, Study};

use super::evaluate;

/// How a prediction scatters over the replicates of its fit; none of fewer than two that it can be computed of.
pub fn scattered(spec: &PredictionSpec, study: &Study, fitted: &Fitted, replicates: &[Replicate]) -> Option<Spread> {
    let at = |r: &Replicate| -> Option<f64> {
        let system = fitted.system.at_variables(&fitted.free, r.p.as_ref()?);
        evaluate(spec, study, &system, &[]).ok().map(|found| found.value).filter(|v| v.is_finite())
    };
    Spread::of(parallel::map(replicates, at).into_iter().flatten().collect())
}

/// In words, where a condition that a law of the model depends on lies outside those of the tests.
pub fn beyond(study: &Study, spec: &PredictionSpec) -> Option<String> {
    let targets = study.system.instances.iter().filter_map(|i| i.target.as_ref());
    let of_laws = |name: &String| targets.clone().any(|t| t.condition == *name);
    spec.conditions.iter().filter(|(name, _)| of_laws(name)).find_map(|(name, c)| {
        let tested = study.dataset.tests.iter().filter_map(|t| t.conditions.get(name)).map(|c| c.value);
        let (low, high) = tested.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let outside = c.value < low || c.value > high;
        outside.then(|| format!("extrapolated: {name} is {}, the tests have {} to {}", c.quantity(), c.unit.print(low), c.unit.print(high)))
    })
}
