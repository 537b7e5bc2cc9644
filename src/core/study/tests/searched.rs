//! Where the search looks, and over what.

use super::{CHAIN, FRF, Folder, ONE};
use crate::diagnose::Case;
use crate::diagnose::testing::{Name, Scene, candidates, drifting, given, phased, unclipped};
use crate::evidence::Evidence;
use crate::identify::Monitor;
use crate::response::Plan;

/// A guide that brakes the third body, FRFs under two preloads: a relaxing spring is looked for in the guide, not at bodies that slide on nothing, and
/// the preload is a load by its unit, whatever its name.
#[test]
fn guides_are_places_and_any_force_is_a_load() {
    let study = format!("{CHAIN}[[effect]]\neffect = \"viscous\"\nat = \"m3.x\"\nc = {{ start = \"0.1 N s/mm\", min = \"0 N s/mm\" }}\n");
    let preload = |id: &str, value: &str| FRF.replace("frf-a", id).replace("load = \"80 N\"", &format!("preload = \"{value}\""));
    let study = Folder::new(&study, &format!("{}{}", preload("a", "80 N"), preload("b", "120 N"))).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let plans: Vec<&Plan> = case.plans.iter().map(|(p, _)| p).collect();
    let (names, trials) = candidates(&case, &study.system, &plans, &Scene::new(&plans, &study.system));
    let at = |effect: &str| -> Vec<&str> { names.iter().filter(|n| n.effect == effect).map(|n| n.at.as_str()).collect() };
    let relaxing = at("maxwell");
    assert!(relaxing.contains(&"m3.x") && !relaxing.contains(&"m4.x") && relaxing.contains(&"c3.x"), "{relaxing:?}");
    // A cable to the ground is looked for wherever no connector is.
    let links = at("linear_stiffness");
    assert!(links.contains(&"m4.x") && !links.contains(&"m1.x"), "{links:?}");
    assert_eq!(at("load_stiffness"), ["base.x", "c1-7.x", "m3.x"]);
    let over = |k: usize| trials.iter().find(|t| t.candidate == k).and_then(|t| t.instance.target.as_ref()).map(|t| t.condition.as_str());
    let load = names.iter().position(|n| n.effect == "load_stiffness").unwrap();
    assert_eq!(over(load), Some("preload"));
}

/// What deviates is no guide of its body, and no coefficient that follows a condition: beside slack the same is looked for as without it.
#[test]
fn slack_offers_nothing_to_look_for() {
    let study = Folder::new(CHAIN, &format!("{FRF}{}", FRF.replace("frf-a", "frf-b").replace("80 N", "120 N"))).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let plans: Vec<&Plan> = case.plans.iter().map(|(p, _)| p).collect();
    let (loose, slack) = given(&case, &study.system, true, &case.search.settings);
    assert!(slack.len() > 4, "{}", slack.len());
    let [mut without, beside] = [&study.system, &loose].map(|s| candidates(&case, s, &plans, &Scene::new(&plans, s)).0);
    let named = |n: &Name| format!("{} at {} {:?}", n.effect, n.at, n.of);
    // What deviates there already is not looked for again. Without slack it is, at springs that are tied: one of them may be softer.
    let softer: Vec<String> = without.iter().filter(|n| n.effect == "stiffness_deviation").map(|n| n.at.clone()).collect();
    let springs: Vec<String> = (1..8).map(|k| format!("c{k}.x")).collect();
    assert_eq!(softer, springs);
    without.retain(|n| n.effect != "stiffness_deviation");
    assert_eq!(without.iter().map(named).collect::<Vec<_>>(), beside.iter().map(named).collect::<Vec<_>>());
}

/// Strengths scatter between tests: in one alone they are what that test says.
#[test]
fn in_one_test_alone_nothing_scatters() {
    let study = Folder::new(CHAIN, &format!("{FRF}{}", FRF.replace("frf-a", "frf-b"))).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let plans: Vec<&Plan> = case.plans.iter().map(|(p, _)| p).collect();
    let free = study.system.free();
    let scattering = |plans: &[&Plan]| {
        let evidence = Evidence::of_fitted(plans, &study.system, &Default::default());
        let computed = plans[0].evaluate(&study.system, &free, true).unwrap();
        let seen = evidence.records[0].see(plans[0], &computed, &study.system, &free);
        seen.strengths.ncols()
    };
    assert!(scattering(&plans) > 0);
    assert_eq!(scattering(&plans[..1]), 0);
}

/// A test of another unit is no load.
#[test]
fn an_interference_is_no_load() {
    let study = Folder::one(super::ONE).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let plans: Vec<&Plan> = case.plans.iter().map(|(p, _)| p).collect();
    let (names, _) = candidates(&case, &study.system, &plans, &Scene::new(&plans, &study.system));
    assert!(names.iter().any(|n| n.effect == "interference_law") && !names.iter().any(|n| n.effect == "load_stiffness"));
}

/// A force that stands at its extreme in one test of three is the instrument's, and that test is left out; in two of three the device may do so.
#[test]
fn a_clipped_channel_is_an_instrument_at_fault() {
    let folder = Folder::one(ONE);
    let clip = |hz: f64| {
        let file = folder.path().join(format!("data/loop-{hz}.csv"));
        let clipped = |line: &str| match line.rsplit_once(',') {
            Some((rest, f)) if f.parse().is_ok_and(|f: f64| f > 4.0) => format!("{rest},4.0\n"),
            _ => format!("{line}\n"),
        };
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, text.lines().map(clipped).collect::<String>()).unwrap();
    };
    let found = |folder: &Folder| {
        let (case, found) = unclipped(&Case::from_study(&folder.load().unwrap(), 1).unwrap());
        (case.plans.iter().map(|(p, _)| p.id.clone()).collect::<Vec<_>>(), found)
    };
    assert!(found(&folder).1.is_empty());
    clip(2.0);
    let (kept, faults) = found(&folder);
    assert_eq!(kept, ["loop-1Hz", "loop-5Hz"]);
    assert_eq!((faults[0].effect.as_str(), faults[0].at.as_str(), faults.len()), ("clipping", "loop-2Hz.force", 1));
    clip(5.0);
    assert!(found(&folder).1.is_empty());
}

/// A force that goes by 0.2 N from cycle to cycle is told, and its mean is granted what it has gone by: the constant is a reading, no force of the device.
#[test]
fn a_channel_that_drifts_is_told_and_its_mean_is_granted_that() {
    let folder = Folder::one(ONE);
    let told = |folder: &Folder| {
        let case = Case::from_study(&folder.load().unwrap(), 1).unwrap();
        let found: Vec<(String, String)> = drifting(&case).into_iter().map(|i| (i.effect, i.at)).collect();
        let crept: Vec<f64> = case.plans.iter().map(|(p, _)| p.scatter[0].crept).collect();
        (found, crept)
    };
    assert_eq!(told(&folder), (vec![], vec![0.0; 3]));
    let file = folder.path().join("data/loop-2.csv");
    let text = std::fs::read_to_string(&file).unwrap();
    let cycles = |line: &str| line.split(',').next().and_then(|t| t.parse::<f64>().ok()).map(|t| 2.0 * t);
    let crept = |line: &str| match (cycles(line), line.rsplit_once(',')) {
        (Some(cycles), Some((rest, f))) => format!("{rest},{}\n", f.parse::<f64>().unwrap() + 0.2 * cycles),
        _ => format!("{line}\n"),
    };
    std::fs::write(&file, text.lines().map(crept).collect::<String>()).unwrap();
    let whole = text.lines().filter_map(cycles).fold(0.0, f64::max);
    let (found, crept) = told(&folder);
    assert_eq!(found, [("drift".to_string(), "loop-2Hz.force".to_string())]);
    assert!((crept[1] / (0.2 * whole) - 1.0).abs() < 0.1, "{crept:?} over {whole} cycles");
    // How far it goes by is told in the unit of the file.
    let dataset = folder.path().join("data/dataset.toml");
    let text = std::fs::read_to_string(&dataset).unwrap();
    std::fs::write(&dataset, text.replace("unit=\"N\"", "unit=\"kN\"")).unwrap();
    let why = drifting(&Case::from_study(&folder.load().unwrap(), 1).unwrap()).remove(0).why;
    assert!(why.contains(" kN over its record"), "{why}");
}

/// One FRF of three with its sign turned is told and turned back, where springs of the study begin a fifth off; as they are measured none is.
#[test]
fn a_response_of_opposite_phase_is_turned_round() {
    let one = |id: &str, at: &str| FRF.replace("frf-a", id).replace("respond = \"m8.x\"", &format!("respond = \"{at}\""));
    let study = Folder::new(CHAIN, &[one("frf-a", "m8.x"), one("frf-b", "m1.x"), one("frf-c", "m4.x")].concat()).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let mut there = study.system.clone();
    there.instances.iter_mut().for_each(|i| i.params[0].value *= 1.2);
    let measured = |turned: &str| {
        let plans = case.plans.iter().map(|(plan, split)| {
            let sign = if plan.id == turned { -1.0 } else { 1.0 };
            let values = plan.evaluate(&there, &[], false).unwrap().values;
            let mut plan = plan.clone();
            plan.measured = values.iter().map(|v| sign * v).collect();
            (plan, *split)
        });
        Case { plans: std::sync::Arc::new(plans.collect()), ..case.clone() }
    };
    for turned in ["", "frf-a", "frf-b", "frf-c"] {
        let (right, told) = phased(&measured(turned), &Monitor::default());
        let names: Vec<(&str, &str)> = told.iter().map(|t| (t.effect.as_str(), t.at.as_str())).collect();
        let at = format!("{turned}.response");
        assert_eq!(names, if turned.is_empty() { vec![] } else { vec![("gain", at.as_str())] });
        let plain = measured("");
        assert!(right.plans.iter().zip(plain.plans.iter()).all(|(a, b)| a.0.measured == b.0.measured));
    }
}
