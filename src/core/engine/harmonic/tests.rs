//! Harmonic balance against closed forms, against the march to the steady cycle, and its sensitivities against differences.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use crate::effect::find;
use crate::explain::Explain;
use crate::model::{Axis, Body, Bound, Connector, Instance, Model, ParamValue, Site, System};

use super::super::frf::{Receptance, receptance};
use super::super::march::{Loads, March};
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

pub(super) fn instance(model: &Model, name: &str, at: &str, values: &[f64]) -> Instance {
    let effect = find(name).unwrap();
    let values = effect.info().params.iter().enumerate().map(|(k, p)| (values.get(k).copied().unwrap_or(p.default), p.sign));
    let params = values.map(|(v, sign)| ParamValue::free(v, sign)).collect();
    Instance::new(effect, at, Site::Places(model.places_at(at).unwrap()), params)
}

pub(super) fn system(masses: &[f64], effects: &[(&str, &str, &[f64])]) -> System {
    let model = chain(masses);
    let instances = effects.iter().map(|(name, at, values)| instance(&model, name, at, values)).collect();
    System { model, instances }
}

pub(super) fn bind(system: &System) -> Bound {
    Bound::new(system, &system.free(), "t", &BTreeMap::new()).unwrap()
}

pub(super) fn fine(harmonics: usize, samples: usize) -> Settings {
    Settings { harmonics, samples, ..Settings::default() }
}

fn run(system: &System, omega: &[f64], input: usize, force: f64, outputs: &[usize], settings: Settings) -> Vec<Complex64> {
    at_amplitude(&system.model, &bind(system), omega, input, force, outputs, false, settings).unwrap().h
}

/// Three bodies on springs and dampers, with one more effect.
pub(super) fn with(effects: &[(&str, &str, &[f64])]) -> System {
    let mut all: Vec<(&str, &str, &[f64])> = vec![
        ("linear_stiffness", "c0.x", &[3000.0]),
        ("linear_stiffness", "c1.x", &[2000.0]),
        ("linear_stiffness", "c2.x", &[2500.0]),
        ("viscous", "c0-2.x", &[4.0]),
    ];
    all.extend_from_slice(effects);
    system(&[0.4, 0.3, 0.5], &all)
}

/// First harmonic over the force at the end of a long march from rest, extrapolated over the step (second order).
fn marched(system: &System, omega: f64, input: usize, force: f64, output: usize, steps: usize) -> Complex64 {
    let bound = bind(system);
    let at = |steps: usize| {
        let cycles = 100;
        let path = (0..=cycles * steps).map(|k| force * (TAU * (k % steps) as f64 / steps as f64).sin()).collect();
        let loads = Loads { dt: TAU / omega / steps as f64, prescribed: vec![], forces: vec![(input, path)] };
        let mut march = March::new(&system.model, &bound, &loads, 0.0).unwrap();
        let mut state = march.rest(0);
        let mut sums = [Complex64::ZERO; 2];
        for k in 1..=cycles * steps {
            march.step(k, &mut state, 0).unwrap();
            if (k - 1) % steps == 0 {
                sums = [sums[1], Complex64::ZERO];
            }
            sums[1] += Complex64::from_polar(state.q[output], -TAU * (k % steps) as f64 / steps as f64);
        }
        assert!((sums[0] - sums[1]).norm() < 1e-8 * sums[1].norm(), "settled");
        sums[1] * Complex64::I * (2.0 / steps as f64 / force)
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
        let reference = marched(&system, OMEGA, 2, force, 2, 512);
        let error = |settings| (run(&system, &[OMEGA], 2, force, &[2], settings)[0] - reference).norm() / reference.norm();
        let small = (receptance_of(&system, &[OMEGA]).map(|h| (h - reference).norm() / reference.norm())).unwrap_or(f64::NAN);
        let [few, default, most] = [fine(7, 256), Settings::default(), fine(25, 1024)].map(error);
        println!("{name:28} 7 of 256 {few:.1e}, 15 of 256 {default:.1e}, 25 of 1024 {most:.1e}; the small signal is off by {small:.1e}");
        assert!(few < 6e-3 && default < 1e-4 && most < 1e-5, "{name}");
    }
}

/// A line begins where the lines before lead, and its states where those of the last motion ended; alone it begins from rest.
#[test]
fn a_line_does_not_depend_on_those_before() {
    let omega: Vec<f64> = (0..8).map(|k| 12.0 + 1.7 * f64::from(k)).collect();
    let laws: [(&str, &[f64]); 6] = [
        ("film", &[0.5, 0.02, 2e-4]),
        ("bouc_wen", &[1.2, 4e-4, 1.5, 0.5]),
        ("lugre", &[1.2, 4e-4, 0.02, 0.5]),
        ("pinched_bouc_wen", &[1.2, 4e-4]),
        ("backlash", &[2e-4, 0.5]),
        ("elastic_slip", &[1.2, 4e-4]),
    ];
    for (name, values) in laws {
        let system = with(&[(name, "c1.x", values)]);
        let together = run(&system, &omega, 2, 4.0, &[2], Settings::default());
        for (w, h) in omega.iter().zip(together) {
            let alone = run(&system, &[*w], 2, 4.0, &[2], Settings::default())[0];
            assert!((h - alone).norm() < 1e-8 * alone.norm(), "{name} at {w} rad/s: {h} after others, {alone} alone");
        }
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
fn linear_structures_and_tiny_amplitudes_give_the_receptance() {
    let omega: Vec<f64> = (1..40).map(|k| 5.0 * k as f64).collect();
    let linear = with(&[("maxwell", "c0.x", &[500.0, 0.04]), ("structural_damping", "c1.x", &[150.0, 0.1, 100.0, 3.0])]);
    let slipping = with(&[
        ("elastic_slip", "c1.x", &[1.2, 4e-4]),
        ("maxwell", "c0.x", &[500.0, 0.04]),
        ("cubic_stiffness", "c2.x", &[2e8]),
        ("support_compliance", "c0.x", &[4e-5]),
    ]);
    // Inside a play the damper's velocity is a difference over samples, of second order.
    let play = with(&[("elastic_slip", "c1.x", &[1.2, 4e-4]), ("backlash", "c1.x", &[2e-4, 0.5])]);
    for (s, force, tolerance) in [(&linear, 3.0, 1e-12), (&slipping, 1e-6, 1e-9), (&play, 1e-6, 1e-4)] {
        let exact = receptance(&s.model, &bind(s), &omega, &[2], &[0, 2], true).unwrap();
        let found = at_amplitude(&s.model, &bind(s), &omega, 2, force, &[0, 2], true, Settings::default()).unwrap();
        let n = s.free().len();
        let largest = |v: &[Complex64]| v.iter().fold(0.0f64, |m, x| m.max(x.norm()));
        for (a, b) in found.h.iter().zip(&exact.h) {
            assert!((a - b).norm() < tolerance * b.norm(), "{a} {b}");
        }
        for k in 0..n {
            let column = |v: &[Complex64]| v.iter().skip(k).step_by(n).copied().collect::<Vec<_>>();
            let (a, b) = (column(&found.dh), column(&exact.dh));
            let gap = a.iter().zip(&b).fold(0.0f64, |m, (a, b)| m.max((a - b).norm()));
            // A cubic spring and the force that closes a play have no slope at rest; what is left of theirs goes with the amplitude squared.
            let size = if largest(&b) == 0.0 { f64::INFINITY } else { largest(&b) };
            assert!(gap <= 10.0 * tolerance * size, "{}: {gap:.2e} of {size:.2e}", s.free()[k].name);
        }
    }
}

/// Step in the variable of a free parameter for central differences.
fn step(system: &System, k: usize) -> f64 {
    let f = &system.free()[k];
    let instance = &system.instances[f.instance];
    match (f.log, instance.params[f.param].value) {
        (true, _) => 1e-5,
        (_, 0.0) => match instance.name() {
            "cubic_stiffness" => 10.0,
            "support_compliance" => 1e-10,
            "backlash" => 1e-9,
            _ => 1e-5,
        },
        (_, v) => 1e-5 * v,
    }
}

/// Largest gap between sensitivities and central differences, against the largest of the parameter; from parameter `first` on.
fn gaps(system: &System, omega: &[f64], force: f64, outputs: &[usize], first: usize, settings: Settings) -> Vec<(String, f64)> {
    let free = system.free();
    let base = at_amplitude(&system.model, &bind(system), omega, 2, force, outputs, true, settings).unwrap();
    (first..free.len())
        // A film has no meaning with d below 0, so there is no central difference around a rigid contact.
        .filter(|k| {
            system.instances[free[*k].instance].name() != "film"
                || free[*k].param != 2
                || system.instances[free[*k].instance].params[2].value > 0.0
        })
        .map(|k| {
            let (f, h) = (&free[k], step(system, k));
            let at = |h: f64| {
                let mut moved = system.clone();
                let i = &mut moved.instances[f.instance];
                i.follower = false;
                i.params[f.param].value = if f.log { i.params[f.param].value * h.exp() } else { i.params[f.param].value + h };
                run(&moved, omega, 2, force, outputs, settings)
            };
            // The best of three steps: kinks and curvature spoil large ones, rounding small ones.
            let gap = [3.0, 0.3, 0.03].map(|factor| {
                let h = factor * h;
                let (up, down) = (at(h), at(-h));
                let (mut gap, mut size) = (0.0f64, 0.0f64);
                for l in 0..base.h.len() {
                    let numeric = (up[l] - down[l]) / (2.0 * h);
                    gap = gap.max((numeric - base.dh[l * free.len() + k]).norm());
                    size = size.max(numeric.norm());
                }
                gap / size
            });
            if gap.iter().all(|g| *g > 1e-7) {
                println!("{} at three steps: {:.1e} {:.1e} {:.1e}", f.name, gap[0], gap[1], gap[2]);
            }
            (f.name.clone(), gap.into_iter().fold(f64::INFINITY, f64::min))
        })
        .collect()
}

const MIXED: [(&str, &str, &[f64]); 8] = [
    ("maxwell", "c0.x", &[500.0, 0.04]),
    ("elastic_slip", "c1.x", &[1.2, 4e-4]),
    ("film", "c2.x", &[0.5, 0.02, 2e-4]),
    ("cubic_stiffness", "c0.x", &[2e8]),
    ("backlash", "c1.x", &[2e-4, 0.5]),
    ("support_compliance", "c2.x", &[4e-5]),
    ("structural_damping", "c1.x", &[150.0, 0.1, 100.0, 3.0]),
    ("coulomb", "c0.x", &[0.3, 2e-2]),
];

#[test]
fn sensitivities_equal_central_differences() {
    let mut worst = 0.0f64;
    let lines = [18.0, 34.0];
    let mut systems: Vec<(System, f64)> = cases().into_iter().map(|(_, s, f)| (s, f)).collect();
    systems.push((with(&MIXED), 4.0));
    for (system, force) in &systems {
        for (_, gap) in gaps(system, &lines, *force, &[0, 2], 0, fine(7, 128)) {
            worst = worst.max(gap);
        }
    }
    println!("worst {worst:.1e}");
    assert!(worst < 1e-6, "{worst:.1e}");
}

#[test]
fn candidates_give_the_slope_at_zero_strength() {
    let mut system = with(&[("elastic_slip", "c1.x", &[1.2, 4e-4])]);
    let first = system.free().len();
    for (name, at, shape) in [
        ("maxwell", "c1.x", &[0.0, 0.01][..]),
        ("elastic_slip", "c0.x", &[0.0, 3e-4]),
        ("film", "c0.x", &[0.0, 0.01, 1e-4]),
        ("cubic_stiffness", "c2.x", &[0.0]),
        ("support_compliance", "c2.x", &[0.0]),
        ("maxwell", "c2.x", &[0.0, 0.02]),
        ("backlash", "c0.x", &[0.0, 0.7]),
        ("backlash", "c1.x", &[0.0, 0.7]),
    ] {
        let mut i = instance(&system.model, name, at, shape);
        i.follower = true;
        i.params.iter_mut().skip(1).for_each(|p| p.free = false);
        system.instances.push(i);
    }
    // A linear candidate beside a nonlinear one is marched here and exact there: of second order in the samples, 6e-5 at 256.
    // The differences turn each candidate into an effect in turn; their steps leave the strength's sign, as the laws allow.
    for (name, gap) in gaps(&system, &[18.0, 34.0], 4.0, &[0, 2], first, fine(7, 256)) {
        println!("{name}: {gap:.1e}");
        assert!(gap < 1e-4, "{name}: {gap:.1e}");
    }
}

#[test]
fn a_hardening_oscillator_is_followed_along_its_upper_branch_and_falls_off_it() {
    let (m, k, c, k3, force) = (1.0, 100.0, 0.4, 4e3, 1.0);
    let duffing = system(&[m], &[("linear_stiffness", "c0.x", &[k]), ("viscous", "c0.x", &[c]), ("cubic_stiffness", "c0.x", &[k3])]);
    let up: Vec<f64> = (0..160).map(|l| 6.0 + 0.1 * l as f64).collect();
    let down: Vec<f64> = up.iter().rev().copied().collect();
    let sweep = |omega: &[f64]| run(&duffing, omega, 0, force, &[0], fine(1, 64));
    let rising = sweep(&up);
    let mut falling = sweep(&down);
    falling.reverse();
    // One harmonic of x^3 is (3/4) a^3: every point must lie on that curve.
    for (w, h) in up.iter().zip(&rising).chain(up.iter().zip(&falling)) {
        let a = h.norm() * force;
        let exact = Complex64::new(k + 0.75 * k3 * a * a - m * w * w, c * w).inv();
        assert!((h - exact).norm() < 1e-9 * exact.norm(), "{w}: {h} {exact}");
    }
    let apart: Vec<f64> =
        up.iter().zip(rising.iter().zip(&falling)).filter(|(_, (r, f))| r.norm() > 1.5 * f.norm()).map(|(w, _)| *w).collect();
    assert!(apart.len() > 10, "two branches: {apart:?}");
    assert!((rising[0] - falling[0]).norm() < 1e-12 && (rising[159] - falling[159]).norm() < 1e-10, "one branch at either end");
    // The peak of the upper branch on the backbone, where the damper alone resists: a = F/(c w), w^2 = k + 0.75 k3 a^2.
    let top = rising.iter().map(|h| h.norm() * force).fold(0.0, f64::max);
    let mut w = 10.0f64;
    (0..200).for_each(|_| w = 0.5 * (w + (k + 0.75 * k3 * (force / (c * w)).powi(2)).sqrt()));
    assert!((top / (force / (c * w)) - 1.0).abs() < 0.02, "{top} {}", force / (c * w));
}

#[test]
fn free_structures_and_bodies_held_by_friction_alone_have_a_response() {
    // Two bodies joined by a slipping spring, held by nothing.
    let mut bodies = vec![body("m1", 1.0), body("m2", 2.0), body("ground", 0.0)];
    bodies.swap(0, 2);
    let model = Model::new(bodies, vec![Connector { name: "c0".into(), from: 1, to: 2 }]).unwrap();
    let instances = vec![instance(&model, "linear_stiffness", "c0.x", &[400.0]), instance(&model, "elastic_slip", "c0.x", &[0.5, 1e-3])];
    let free = System { model, instances };
    let (w, force) = (15.0, 3.0);
    let h = run(&free, &[w], 0, force, &[0, 1], fine(1, 1024));
    // Momentum: the force moves the common centre.
    let total = (h[0] * 2.0 + h[1]) * (-w * w);
    assert!((total - 1.0).norm() < 1e-9, "{total} {h:?}");
    let a = (h[1] - h[0]).norm() * force;
    assert!(a > 1.5e-3, "slips: {a}");
    let theta = (1.0 - 2e-3 / a).acos();
    let z = Complex64::new(theta - 0.5 * (2.0 * theta).sin(), theta.sin().powi(2)) * (500.0 / PI) + 400.0;
    let reduced = 2.0 / 3.0;
    let exact = (z - reduced * w * w).inv() * (-reduced / 2.0);
    assert!((h[1] - h[0] - exact).norm() < 1e-4 * exact.norm(), "{} {exact}", h[1] - h[0]);
    // A body on a film alone: nothing sets its mean position.
    let slider = system(&[1.0], &[("film", "c0.x", &[0.5, 0.02, 0.0])]);
    let h = run(&slider, &[w], 0, force, &[0], Settings::default())[0];
    assert!((h.norm() * w * w - 1.0).abs() < 0.2 && h.im < 0.0, "{h}");
}

#[test]
fn requests_without_meaning_are_refused() {
    let one = with(&[("elastic_slip", "c1.x", &[1.2, 4e-4])]);
    let ask = |omega: f64, dof: usize, force: f64, settings: Settings| -> EngineError {
        at_amplitude(&one.model, &bind(&one), &[omega], dof, force, &[0], false, settings).map(|r: Receptance| r.h).unwrap_err()
    };
    for error in [
        ask(10.0, 0, 0.0, Settings::default()),
        ask(10.0, 0, -1.0, Settings::default()),
        ask(10.0, 0, f64::NAN, Settings::default()),
        ask(0.0, 0, 1.0, Settings::default()),
        ask(f64::INFINITY, 0, 1.0, Settings::default()),
        ask(10.0, 7, 1.0, Settings::default()),
        ask(10.0, 0, 1.0, fine(0, 256)),
        ask(10.0, 0, 1.0, fine(7, 100)),
        ask(10.0, 0, 1.0, fine(40, 256)),
    ] {
        assert!(!error.accepted().is_empty() && !error.to_string().is_empty(), "{error:?}");
    }
}

/// The first body moved in three harmonics about a mean, the last under a force and one that stays.
fn driven(steps: usize) -> Loads {
    let at = |k: usize| TAU * k as f64 / steps as f64;
    let w = 40.0;
    let moved = |k: usize| {
        let t = at(k);
        [
            1e-4 + 1e-3 * t.sin() + 2e-4 * (2.0 * t).cos(),
            w * (1e-3 * t.cos() - 4e-4 * (2.0 * t).sin()),
            -w * w * (1e-3 * t.sin() + 8e-4 * (2.0 * t).cos()),
        ]
    };
    Loads {
        dt: TAU / w / steps as f64,
        prescribed: vec![(0, (0..=steps).map(moved).collect())],
        forces: vec![(2, (0..=steps).map(|k| 0.4 * at(k % steps).sin()).collect())],
    }
}

/// Values, and sensitivities, of every kind of probe by the balance and by a march in many steps.
#[test]
fn the_steady_cycle_equals_the_marched_one() {
    use super::super::march::Probe;
    let probes = [
        Probe::Dof(1),
        Probe::Velocity(2),
        Probe::Acceleration(1),
        Probe::Relative(2),
        Probe::RelativeVelocity(2),
        Probe::RelativeAcceleration(1),
        Probe::Force(1),
        Probe::Force(2),
        Probe::Reaction(0),
    ];
    // Effect, rms error of the values and of the sensitivities over their size.
    let cases: [(&str, &[f64], f64, f64); 5] = [
        ("maxwell", &[500.0, 0.02], 2e-5, 1e-4),
        ("added_mass", &[0.1], 2e-5, 1e-4),
        ("cubic_stiffness", &[4e8], 1e-4, 1e-3),
        // Kinks beside a spring of 2500 N/m.
        ("elastic_slip", &[0.02, 1e-4], 2e-3, 5e-2),
        ("bilinear_stiffness", &[100.0], 2e-3, 5e-2),
    ];
    for (effect, values, close, closer) in cases {
        let system = with(&[(effect, "c2.x", values)]);
        let bound = bind(&system);
        let (few, many) = (driven(400), driven(3200));
        let balanced = super::balanced(&system.model, &bound, &few, &probes, true).expect(effect);
        let marched = super::super::periodic::periodic(&system.model, &bound, &many, &probes, true).unwrap();
        let columns = balanced.columns;
        assert_eq!((columns, balanced.steps), (marched.columns, 400));
        for (p, probe) in probes.iter().enumerate() {
            let rms = |v: &dyn Fn(usize) -> f64| ((0..400).map(|k| v(k).powi(2)).sum::<f64>() / 400.0).sqrt();
            let size = rms(&|k| marched.values[p][8 * k + 7]);
            let off = rms(&|k| balanced.values[p][k] - marched.values[p][8 * k + 7]);
            assert!(off <= close * size, "{effect} {probe:?}: {off} of {size}");
            for c in 0..columns {
                // In the first harmonics: beside a kink an acceleration's derivative jumps, and has all of them.
                let by = |k: usize| marched.slopes[p][(8 * k + 7) * columns + c];
                let of = |v: &dyn Fn(usize) -> f64, h: usize| -> Complex64 {
                    (0..400).map(|k| Complex64::from_polar(v(k), -TAU * (h * (k + 1)) as f64 / 400.0)).sum()
                };
                let norm = |v: &dyn Fn(usize) -> f64| (0..=8).map(|h| of(v, h).norm_sqr()).sum::<f64>().sqrt();
                let off = norm(&|k| balanced.slopes[p][k * columns + c] - by(k));
                let size = norm(&by);
                assert!(off <= closer * size.max(1e-12), "{effect} {probe:?} column {c}: {off} of {size}");
            }
        }
    }
}

/// Where everything is moved, and where no force is found in harmonics, the march has to do it.
#[test]
fn what_the_balance_leaves_to_the_march() {
    let system = with(&[]);
    let bound = bind(&system);
    let mut all = driven(100);
    all.prescribed = (0..3).map(|d| (d, all.prescribed[0].1.clone())).collect();
    assert!(super::balanced(&system.model, &bound, &all, &[], false).is_none());
    // Friction that does most of the work, and a saw tooth, have all harmonics.
    let system = with(&[("elastic_slip", "c2.x", &[1.0, 1e-4])]);
    assert!(super::balanced(&system.model, &bind(&system), &driven(400), &[], false).is_none());
    let mut rough = driven(400);
    rough.forces[0].1 = (0..=400).map(|k| (k % 400) as f64).collect();
    assert!(super::balanced(&system.model, &bound, &rough, &[], false).is_none());
}

/// Every line asks whether the time is over: a balance that has to be followed past folds takes seconds a line.
#[test]
fn it_is_given_up_when_its_time_is_over() {
    let s = with(&[("coulomb", "c1.x", &[1.0])]);
    let watch = crate::parallel::Watch { deadline: Some(std::time::Instant::now()), ..Default::default() };
    let (bound, omega) = (bind(&s), [20.0, 21.0]);
    let found =
        crate::parallel::watched(&watch, || at_amplitude(&s.model, &bound, &omega, 2, 1.0, &[0], false, Settings::default()).map(|r| r.h));
    assert!(matches!(found, Err(EngineError::GivenUp)), "{found:?}");
}

#[test]
fn a_sharp_play_is_balanced_on_every_line() {
    // A play of 2 um that closes within a sample, beside a drag: at 64.6 Hz Newton's method ends 4e-5 from a balance of the sampled law.
    let laws: [(&str, &str, &[f64]); 4] = [
        ("linear_stiffness", "c0.x", &[34702.81072637826]),
        ("viscous", "c0.x", &[5.351553138559908]),
        ("backlash", "c0.x", &[1.801834087401653e-6, 0.0223]),
        ("quadratic_damping", "c0.x", &[13.162270438014716]),
    ];
    let lines: Vec<f64> = LINES.iter().map(|f| TAU * f).collect();
    let system = system(&[0.27], &laws);
    let of = |(samples, harmonics)| run(&system, &lines, 0, 1.3, &[0], Settings { harmonics, samples, tolerance: 1e-9 });
    let [coarse, middle, fine] = [(64, 3), (128, 7), (256, 15)].map(of);
    for (k, f) in LINES.iter().enumerate() {
        let off = |h: &[Complex64]| (h[k] - fine[k]).norm() / fine[k].norm();
        assert!(off(&coarse) < 0.02 && off(&middle) < 0.01, "{f} Hz: {} {}", off(&coarse), off(&middle));
    }
}

/// Lines of a stepped sine [Hz].
const LINES: [f64; 60] = [
    22.89, 23.3, 23.72, 24.15, 24.58, 25.03, 25.48, 25.94, 26.41, 26.89, 27.37, 27.87, 28.37, 28.88, 29.4, 29.93, 30.48, 31.03, 31.59,
    32.16, 32.74, 33.33, 33.93, 34.54, 35.17, 35.8, 36.45, 37.11, 37.78, 38.46, 39.15, 39.86, 40.58, 41.31, 42.06, 42.82, 43.59, 44.38,
    45.18, 46.0, 46.83, 47.67, 48.54, 49.41, 50.3, 51.21, 52.14, 53.08, 54.04, 55.01, 56.01, 57.02, 58.05, 59.1, 60.16, 61.25, 62.36,
    63.48, 64.63, 65.8,
];
