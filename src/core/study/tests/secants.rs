//! Where refits begin, on a study of this repository.

use crate::diagnose::results::SplitName;
use crate::diagnose::testing::{Bench, Scene, Score, candidates, cost, score, whitened};
use crate::diagnose::{Case, fit};
use crate::identify::Monitor;
use crate::response::Plan;
use crate::study::Study;

/// 01 fitted without its slider: at the strength the score expects, the model costs less than without it, by about what is predicted where the spring
/// beside it gives way. (Loops are compared in Fourier coefficients with the offsets of instruments granted: the spring has little to give there, and
/// standing still costs about as much.)
#[test]
fn a_slider_takes_from_the_spring_beside_it() {
    let study = Study::load(std::path::Path::new("../../studies/01-hidden-effect"), None).unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let monitor = Monitor::default();
    let (case, fitted, _) = fit(&case, &[], &monitor).unwrap();
    let covered = |(p, s): &(Plan, SplitName)| (p.with_instruments(&p.evaluate(&fitted.system, &[], false).unwrap().values), *s);
    let case = Case { plans: std::sync::Arc::new(case.plans.iter().map(covered).collect()), ..case.clone() };
    let plans = case.plans_of(SplitName::Fit);
    let (names, trials) = candidates(&case, &fitted.system, &plans, &Scene::new(&plans, &fitted.system));
    let scores = score(&plans, &fitted.system, &trials, &fitted.inside(), &[], 1, &case.search.settings.scoring).unwrap();
    let rough = case.coarser(case.expanded(&fitted.system));
    let bench = Bench {
        near: None,
        stands: None,
        case: &case,
        rough: rough.as_ref(),
        base: &fitted.system,
        names: &names,
        trials: &trials,
        scores: &scores,
        wanted: &[],
        elsewhere: &[],
        squares: 0.0,
        tie: 0.0,
        bound: &|_, nats| nats,
        least: &|_| 0.0,
        monitor: &monitor,
    };
    let slider = |s: &&Score| names[trials[s.trial].candidate].effect == "elastic_slip" && names[trials[s.trial].candidate].at == "c5.x";
    let best = *scores.list.iter().find(slider).unwrap();
    let before = cost(&whitened(&plans, &fitted.system).unwrap());
    let at = |gives: bool| bench.secant(&[best], 1.0, gives).unwrap().cost;
    let (still, gives) = (at(false), at(true));
    let predicted = (1.0 - best.drop) * before;
    assert!(
        still < before && gives < before && (gives - predicted).abs() < 0.5 * (before - predicted),
        "{gives} {still} {before} {predicted}"
    );
    let secants = bench.secants(&best, before).unwrap();
    // Two that give way, the cheaper first, and the cheapest that stand still, which here costs less than the model without the slider.
    let costs: Vec<f64> = secants.iter().map(|s| s.cost).collect();
    assert!(
        costs.len() == 3 && costs[0] <= costs[1] && costs[0] <= gives && costs[2] <= still && costs[2] < before,
        "{costs:?} {still} {before}"
    );
    assert_eq!(bench.secants(&best, 0.0).unwrap().len(), 2);
    // From elsewhere too: the study's own spring and damper, where they stood before they were fitted.
    let elsewhere = [study.system.clone()];
    let more = Bench { elsewhere: &elsewhere, ..bench }.secants(&best, before).unwrap();
    let own = |s: &crate::model::System| s.instances[0].params[0].value;
    assert!(more.len() == 4 && own(&more[3].system) == own(&study.system) && own(&more[2].system) == own(&fitted.system));
    assert_ne!(own(&study.system), own(&fitted.system));
    let alone = bench.together(&[best]).unwrap();
    assert!(alone.cost <= gives && secants.iter().any(|s| s.cost == alone.cost));
    // What may not pay for itself stays where its look has left it.
    let cost_of = |bench: Bench| bench.refit_all(&[best], None, &|_| {})[0].result.as_ref().unwrap().fitted.outcome.cost;
    let (raced, left) = (cost_of(Bench { ..bench }), cost_of(Bench { least: &|_| f64::INFINITY, ..bench }));
    assert!(raced < 0.5 * left && left < before, "{raced} {left} {before}");
}
