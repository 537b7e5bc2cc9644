//! Harmonic balance against closed forms, against the march to the steady cycle, and its sensitivities against differences.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use crate::effect::find;
use crate::explain::Explain;
use crate::model::{Axis, Body, Bound, Connector, Instance, Model, ParamValue, Site, System};

use super::super::frf::{Receptance, receptance};
use super::super::march::{Loads, Probe};
use super::super::periodic::periodic;
use super::{EngineError, Settings, at_amplitude};

fn body(name: &str, mass: f64) -> Body {
    Body { name: name.into(), mass, inertia: 0.0, free: if name == "ground" { vec![] } else { vec![Axis::X] } }
}

/// ground - m1 - m2 - ... with connectors c0, c1, ...
fn chain(masses: &[f64]) -> Model {
    let mut bodies = vec![body("ground", 0.0)];
    bodies.extend(masses.iter().enumerate().map(|(k, m)| body(&format!("m{}", k + 1), *m)));
    let connectors = (0..masses.len()).map(|k| Connector { name: format!("c{k}"), from: k, to: k + 1 }).collect();
    Model::new(bodies, connectors).unwrap()
}

fn instance(model: &Model, name: &str, at: &str, values: &[f64]) -> Instance {
    let effect = find(name).unwrap();
    let values = effect.info().params.iter().enumerate().map(|(k, p)| (values.get(k).copied().unwrap_or(p.default), p.sign));
    let params = values.map(|(v, sign)| ParamValue::free(v, sign)).collect();
    Instance { effect, at: at.into(), site: Site::Places(model.places_at(at).unwrap()), params, target: None, follower: false }
}

fn system(masses: &[f64], effects: &[(&str, &str, &[f64])]) -> System {
    let model = chain(masses);
    let instances = effects.iter().map(|(name, at, values)| instance(&model, name, at, values)).collect();
    System { model, instances }
}

fn bind(system: &System) -> Bound {
    Bound::new(system, &system.free(), "t", &BTreeMap::new()).unwrap()
}

fn fine(harmonics: usize, samples: usize) -> Settings {
    Settings { harmonics, samples }
}

fn run(system: &System, omega: &[f64], input: usize, force: f64, outputs: &[usize], settings: Settings) -> Vec<Complex64> {
    at_amplitude(&system.model, &bind(system), omega, input, force, outputs, false, settings).unwrap().h
}

/// Three bodies on springs and dampers, with one more effect.
fn with(effects: &[(&str, &str, &[f64])]) -> System {
    let mut all: Vec<(&str, &str, &[f64])> = vec![
        ("linear_stiffness", "c0.x", &[3000.0]),
        ("linear_stiffness", "c1.x", &[2000.0]),
        ("linear_stiffness", "c2.x", &[2500.0]),
        ("viscous", "c0-2.x", &[4.0]),
    ];
    all.extend_from_slice(effects);
    system(&[0.4, 0.3, 0.5], &all)
}

/// First harmonic over the force from the march, extrapolated over the step (second order).
fn marched(system: &System, omega: f64, input: usize, force: f64, output: usize, steps: usize) -> Complex64 {
    let at = |steps: usize| {
        let path = (0..=steps).map(|k| force * (TAU * k as f64 / steps as f64).sin()).collect();
        let loads = Loads { dt: TAU / omega / steps as f64, prescribed: vec![], forces: vec![(input, path)] };
        let cycle = periodic(&system.model, &bind(system), &loads, &[Probe::Dof(output)], false).unwrap();
        let turn = |k: usize| Complex64::from_polar(1.0, -TAU * (k + 1) as f64 / steps as f64);
        let sum: Complex64 = cycle.values[0].iter().enumerate().map(|(k, v)| turn(k) * *v).sum();
        sum * Complex64::I * (2.0 / steps as f64 / force)
    };
    let (coarse, fine) = (at(steps), at(2 * steps));
    fine + (fine - coarse) / 3.0
}

/// The laws compared with the march: name, effects, force.
#[allow(clippy::type_complexity)]
fn cases() -> Vec<(&'static str, System, f64)> {
    vec![
        ("elastic_slip", with(&[("elastic_slip", "c1.x", &[1.2, 4e-4])]), 4.0),
        ("two elastic_slip", with(&[("elastic_slip", "c1.x", &[1.2, 4e-4]), ("elastic_slip", "c0.x", &[0.8, 3e-4])]), 4.0),
        ("film", with(&[("film", "c2.x", &[0.5, 0.02, 2e-4])]), 4.0),
        ("film, rigid contact", with(&[("film", "c1.x", &[0.5, 0.02, 0.0])]), 4.0),
        ("cubic_stiffness", with(&[("cubic_stiffness", "c0.x", &[2e8])]), 4.0),
        ("backlash", with(&[("backlash", "c1.x", &[2e-4, 0.5])]), 4.0),
        ("support_compliance", with(&[("elastic_slip", "c2.x", &[1.2, 4e-4]), ("support_compliance", "c2.x", &[4e-5])]), 4.0),
        ("coulomb", with(&[("coulomb", "c1.x", &[0.3, 5e-3])]), 4.0),
        ("maxwell beside elastic_slip", with(&[("maxwell", "c1.x", &[500.0, 0.04]), ("elastic_slip", "c1.x", &[1.2, 4e-4])]), 4.0),
    ]
}

const OMEGA: f64 = 18.0;

#[test]
fn the_response_equals_the_marched_steady_cycle() {
    for (name, system, force) in cases() {
        let reference = marched(&system, OMEGA, 2, force, 2, 2048);
        let error = |settings| (run(&system, &[OMEGA], 2, force, &[2], settings)[0] - reference).norm() / reference.norm();
        let small = (receptance_of(&system, &[OMEGA]).map(|h| (h - reference).norm() / reference.norm())).unwrap_or(f64::NAN);
        let (default, more) = (error(Settings::default()), error(fine(25, 1024)));
        println!("{name:30} default {default:.1e}, 25 harmonics of 1024 samples {more:.1e}; small signal is off by {small:.1e}");
    }
}

fn receptance_of(system: &System, omega: &[f64]) -> Option<Complex64> {
    receptance(&system.model, &bind(system), omega, &[2], &[2], false).ok().map(|r| r.h[0])
}

#[test]
fn one_harmonic_of_a_jenkins_element_is_its_describing_function() {
    let (mass, k, c, f, d) = (2.0, 800.0, 6.0, 3.0, 2e-3);
    let one = system(&[mass], &[("linear_stiffness", "c0.x", &[k]), ("viscous", "c0.x", &[c]), ("elastic_slip", "c0.x", &[f, d])]);
    for (w, force) in [(14.0, 5.0), (25.0, 9.0), (30.0, 4.0), (8.0, 20.0)] {
        let h = run(&one, &[w], 0, force, &[0], fine(1, 4096))[0];
        let a = h.norm() * force;
        assert!(a > 1.3 * d, "slips: {a}");
        let theta = (1.0 - 2.0 * d / a).acos();
        let describing = Complex64::new(theta - 0.5 * (2.0 * theta).sin(), theta.sin().powi(2)) * (f / d / PI);
        let exact = (describing + Complex64::new(k - mass * w * w, c * w)).inv();
        println!("{w} {force}: {:.2e}", (h - exact).norm() / exact.norm());
        assert!((h - exact).norm() < 3e-6 * exact.norm(), "{w}: {h} {exact}");
    }
}

#[test]
#[ignore = "prints a time"]
fn time_per_line() {
    let mut effects: Vec<(&str, &str, &[f64])> = vec![("linear_stiffness", "c0-7.x", &[1e5]), ("viscous", "c0-7.x", &[8.0])];
    effects.push(("elastic_slip", "c4.x", &[0.5, 2e-6]));
    let eight = system(&[0.1; 8], &effects);
    let omega: Vec<f64> = (0..1000).map(|k| TAU * (20.0 + 0.3 * k as f64)).collect();
    let bound = bind(&eight);
    for (label, sens) in [("response", false), ("with sensitivities", true)] {
        for settings in [Settings::default(), fine(7, 128), fine(3, 64)] {
            let start = std::time::Instant::now();
            at_amplitude(&eight.model, &bound, &omega, 0, 0.5, &[7], sens, settings).unwrap();
            println!("{label}, {settings:?}: {:.1} us per line", start.elapsed().as_secs_f64() * 1e3);
        }
    }
}
