//! Where refits begin, on a study of this repository.

use crate::diagnose::results::SplitName;
use crate::diagnose::testing::{Bench, Scene, Score, candidates, cost, score, started, whitened};
use crate::diagnose::{Case, fit};
use crate::identify::Monitor;
use crate::model::System;
use crate::study::Study;

/// 01 fitted without its slider: at the strength the score expects, a spring that stands still leaves the model farther off than one
/// that gives way, whose cost is about the one predicted.
#[test]
fn a_slider_takes_from_the_spring_beside_it() {
    let study = Study::load(std::path::Path::new("studies/01-hidden-effect"), None).unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let monitor = Monitor::default();
    let (case, fitted, _) = fit(&case, &[], &monitor).unwrap();
    let case = case.with_instruments(&fitted.system);
    let plans = case.plans_of(SplitName::Fit);
    let (names, trials) = candidates(&case, &fitted.system, &plans, &Scene::new(&plans, &fitted.system));
    let scores = score(&plans, &fitted.system, &trials, &vec![false; fitted.free.len()], &[], 1).unwrap();
    let bench = Bench { case: &case, base: &fitted.system, names: &names, trials: &trials, scores: &scores, monitor: &monitor };
    let slider = |s: &&Score| names[trials[s.trial].candidate].effect == "elastic_slip" && names[trials[s.trial].candidate].at == "c5.x";
    let best = *scores.list.iter().find(slider).unwrap();
    let cost_of = |system: &System| cost(&whitened(&plans, system).unwrap());
    let before = cost_of(&fitted.system);
    let mut still = fitted.system.clone();
    still.instances.push(started(&trials[best.trial], best.strength));
    let (still, gives) = (cost_of(&still), cost_of(&bench.giving_way(&[best], 1.0).unwrap()));
    let predicted = (1.0 - best.drop) * before;
    assert!(
        gives < still && gives < before && (gives - predicted).abs() < 0.5 * (before - predicted),
        "{gives} {still} {before} {predicted}"
    );
    let secants = bench.secants(&[best]).remove(0).unwrap();
    assert!(secants.len() > 1 && secants.windows(2).all(|w| w[0].cost <= w[1].cost) && secants[0].cost <= gives);
    let alone = bench.together(&[best]).unwrap();
    assert!(alone.cost <= gives && secants.iter().any(|s| s.cost == alone.cost));
}
