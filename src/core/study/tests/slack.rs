//! What deviates of what a study ties or fixes.

use crate::diagnose::Case;
use crate::diagnose::testing::{Settings, begin, correction, given};
use crate::effect::find;
use crate::identify::Monitor;
use crate::model::{Instance, ParamValue, Site};

use super::{Folder, cycle};

/// Two bodies that move in the plane, joined by springs of one stiffness.
const PLANE: &str = r#"schema = 1
dataset = "data"
[[body]]
name = "m"
count = 2
mass = "0.1 kg"
free = ["x", "y"]
[[connector]]
name = "c1"
from = "ground"
to = "m1"
[[connector]]
name = "d1"
from = "m1"
to = "m2"
[[effect]]
effect = "linear_stiffness"
at = ["c1.x", "d1.x"]
k = { start = "20 N/mm", slack = "10 %" }
[[effect]]
effect = "linear_stiffness"
at = ["c1.y", "d1.y"]
k = "30 N/mm"
"#;

/// The deviations: effect, places, width over 1 kg or 1 N/m.
fn deviations(all: bool, settings: &Settings) -> Vec<(&'static str, String, f64)> {
    let study = Folder::new(PLANE, &cycle(1.0, "")).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let (system, slack) = given(&case, &study.system, all, settings);
    let own = study.system.instances.len();
    let follows = system.instances.iter().filter(|i| i.name() == "node_deviation").count();
    assert_eq!(system.instances.len(), own + slack.len() + follows);
    assert!((0..system.instances.len()).all(|k| slack.has(k) == (k >= own)));
    system.instances[own..].iter().map(|i| (i.name(), i.at.clone(), i.params[0].prior.map_or(0.0, |p| p.1))).collect()
}

/// Slack without mass between the nodes is the same deviations, the last effects of the system.
#[test]
fn lumped_slack_has_no_mass_between_nodes() {
    let study = Folder::new(PLANE, &cycle(1.0, "")).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let (system, slack) = given(&case, &study.system, true, &Settings::default());
    let (fewer, lumped) = slack.lumped(&system, &Settings::default()).unwrap();
    let own = study.system.instances.len();
    let names: Vec<&str> = fewer.instances[own..].iter().map(|i| i.name()).collect();
    assert_eq!(names, [["stiffness_deviation"; 4].as_slice(), &["mass_deviation"; 2]].concat());
    assert!((0..fewer.instances.len()).all(|k| lumped.has(k) == (k >= own)) && lumped.len() + 1 == slack.len());
    // The bodies of 0.1 kg, which may be a quarter off where mass lies beside them, deviate as any mass does.
    assert!(fewer.instances[own + 4..].iter().all(|i| i.params[0].prior == Some((0.0, 0.1 * 0.03))));
    assert!(lumped.lumped(&fewer, &Settings::default()).is_none());
}

#[test]
fn springs_deviate_one_by_one_a_body_along_all_its_axes_and_mass_between_nodes_everywhere() {
    let found = deviations(true, &Settings::default());
    let places: Vec<(&str, &str)> = found.iter().map(|(e, at, _)| (*e, at.as_str())).collect();
    let springs = ["c1.x", "d1.x", "c1.y", "d1.y"].map(|at| ("stiffness_deviation", at));
    assert_eq!(places[..4], springs);
    assert_eq!(places[4..6], [("mass_deviation", "m1.x,m1.y"), ("mass_deviation", "m2.x,m2.y")]);
    assert_eq!(places[6], ("inertia_deviation", "c1.x,c1.y,d1.x,d1.y"));
    // What follows that at the nodes, of which each axis is one.
    assert_eq!(places[7..], ["m1.x", "m1.y", "m2.x", "m2.y"].map(|at| ("node_deviation", at)));
    // 10 % as stated of 20 N/mm, 5 % of 30 N/mm, a quarter of 0.1 kg at the ground and at the end of the chain, a half.
    for (k, width) in [(0, 2000.0), (2, 1500.0), (4, 0.025), (5, 0.025), (6, 0.5)] {
        assert!((found[k].2 / width - 1.0).abs() < 1e-12, "{:?}", found[k]);
    }
}

#[test]
fn what_a_study_states_stands_where_nothing_else_is_given_or_too_much_would_be() {
    let few = Settings { slack_members: 3, ..Settings::default() };
    for found in [deviations(false, &Settings::default()), deviations(true, &few)] {
        let places: Vec<&str> = found.iter().map(|d| d.1.as_str()).collect();
        assert_eq!(places, ["c1.x", "d1.x"]);
    }
}

/// An added mass or spring within what slack grants corrects a nominal value; beyond it, and of any other law, it is an effect.
#[test]
fn what_slack_would_grant_is_a_correction() {
    let study = Folder::new(PLANE, &cycle(1.0, "")).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let mut fitted = begin(&case, &Monitor::default()).unwrap().fitted;
    let base = fitted.system.instances.len();
    let stiffness = fitted.system.instances[0].params[0].value;
    let mut told = |effect: &str, at: &str, value: f64| {
        fitted.system.instances.truncate(base);
        let places = fitted.system.model.places_at(at).unwrap();
        let instance = Instance::new(find(effect).unwrap(), at, Site::Places(places), vec![ParamValue::fixed(value)]);
        fitted.system.instances.push(instance);
        correction(&case, &fitted, base, base, &Settings::default()).map(|c| (c.parameter, c.at, c.relative))
    };
    // The connector from the ground to m1 is m1 for a mass.
    for at in ["m1.x", "c1.x"] {
        let (parameter, body, relative) = told("added_mass", at, -0.0014).unwrap();
        assert_eq!((parameter.as_str(), body.as_str()), ("mass", "m1"));
        assert!((relative + 0.014).abs() < 1e-12, "{relative}");
    }
    let (parameter, at, relative) = told("linear_stiffness", "d1.x", 0.1 * stiffness).unwrap();
    assert_eq!((parameter.as_str(), at.as_str()), ("linear_stiffness.k", "d1.x"));
    assert!((relative - 0.1).abs() < 1e-12, "{relative}");
    assert!(told("added_mass", "m1.x", 0.0031).is_none() && told("linear_stiffness", "d1.x", 0.95 * stiffness).is_none());
    assert!(told("cubic_stiffness", "d1.x", 1.0).is_none());
    // In series with a spring alone a compliance is a softer spring: 1 / (1 + 0.1) of it here, and one that halves it is an effect.
    let (parameter, at, relative) = told("support_compliance", "d1.x", 0.1 / stiffness).unwrap();
    assert_eq!((parameter.as_str(), at.as_str()), ("linear_stiffness.k", "d1.x"));
    assert!((relative + 0.1 / 1.1).abs() < 1e-12, "{relative}");
    assert!(told("support_compliance", "d1.x", 1.0 / stiffness).is_none());
}
