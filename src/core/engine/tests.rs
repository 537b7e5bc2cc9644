//! Engines against closed forms, against each other, and their sensitivities against differences.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::effect::find;
use crate::model::{Axis, Body, Bound, Connector, Instance, Model, ParamValue, Site, System};

use super::march::{Loads, March, Probe};
use super::periodic::periodic;

fn body(name: &str, mass: f64) -> Body {
    Body { name: name.into(), mass, inertia: 0.0, free: if name == "ground" { vec![] } else { vec![Axis::X] } }
}

/// ground - m1 - m2 - ... with connectors c0, c1, ...
pub(super) fn chain(masses: &[f64]) -> Model {
    let mut bodies = vec![body("ground", 0.0)];
    bodies.extend(masses.iter().enumerate().map(|(k, m)| body(&format!("m{}", k + 1), *m)));
    let connectors = (0..masses.len()).map(|k| Connector { name: format!("c{k}"), from: k, to: k + 1 }).collect();
    Model::new(bodies, connectors).unwrap()
}

pub(super) fn instance(model: &Model, name: &str, at: &str, values: &[f64]) -> Instance {
    let effect = find(name).unwrap();
    let params = effect
        .info()
        .params
        .iter()
        .enumerate()
        .map(|(k, p)| ParamValue::free(values.get(k).copied().unwrap_or(p.default), p.sign))
        .collect();
    Instance::new(effect, at, Site::Places(model.places_at(at).unwrap()), params)
}

pub(super) fn bind(system: &System) -> Bound {
    Bound::new(system, &system.free(), "t", &BTreeMap::new()).unwrap()
}

fn sine(dof: usize, amplitude: f64, omega: f64, steps: usize) -> Loads {
    let dt = TAU / omega / steps as f64;
    let path = (0..=steps)
        .map(|k| {
            let (s, c) = (TAU * k as f64 / steps as f64).sin_cos();
            [amplitude * s, amplitude * omega * c, -amplitude * omega * omega * s]
        })
        .collect();
    Loads { dt, prescribed: vec![(dof, path)], forces: vec![] }
}

fn force(dof: usize, mean: f64, amplitude: f64, omega: f64, steps: usize) -> Loads {
    let path = (0..=steps).map(|k| mean + amplitude * (TAU * k as f64 / steps as f64).sin()).collect();
    Loads { dt: TAU / omega / steps as f64, prescribed: vec![], forces: vec![(dof, path)] }
}

fn first_harmonic(values: &[f64]) -> Complex64 {
    let n = values.len();
    let sum: Complex64 = values.iter().enumerate().map(|(k, v)| v * Complex64::from_polar(1.0, -TAU * (k + 1) as f64 / n as f64)).sum();
    sum * 2.0 / n as f64
}

#[test]
fn a_driven_spring_and_damper_have_the_closed_form_loop() {
    let model = chain(&[0.0]);
    let instances = vec![instance(&model, "linear_stiffness", "c0.x", &[20e3]), instance(&model, "viscous", "c0.x", &[100.0])];
    let system = System { model, instances };
    let loads = sine(0, 1e-3, TAU, 200);
    let cycle = periodic(&system.model, &bind(&system), &loads, &[Probe::Reaction(0)], true).unwrap();
    for (k, f) in cycle.values[0].iter().enumerate() {
        let (s, c) = (TAU * (k + 1) as f64 / 200.0).sin_cos();
        assert!((f - (20.0 * s + 0.1 * TAU * c)).abs() < 1e-12, "{k}: {f} {}", 20.0 * s + 0.1 * TAU * c);
        assert!((cycle.slopes[0][2 * k] - 1e-3 * s).abs() < 1e-15);
        assert!((cycle.slopes[0][2 * k + 1] - 1e-3 * TAU * c).abs() < 1e-15);
    }
}

#[test]
fn a_force_driven_oscillator_has_the_closed_form_amplitude() {
    let (m, k, c, omega) = (2.0, 800.0, 6.0, 14.0);
    let model = chain(&[m]);
    let instances = vec![instance(&model, "linear_stiffness", "c0.x", &[k]), instance(&model, "viscous", "c0.x", &[c])];
    let system = System { model, instances };
    let exact = (Complex64::new(k - m * omega * omega, c * omega)).inv() * 5.0;
    let error = |steps| {
        let cycle = periodic(&system.model, &bind(&system), &force(0, 3.0, 5.0, omega, steps), &[Probe::Dof(0)], false).unwrap();
        let mean = cycle.values[0].iter().sum::<f64>() / steps as f64;
        assert!((mean - 3.0 / k).abs() < 1e-9);
        (first_harmonic(&cycle.values[0]) * Complex64::I - exact).norm() / exact.norm()
    };
    let (coarse, fine) = (error(400), error(800));
    assert!(fine < 2e-3 && (coarse / fine - 4.0).abs() < 0.3, "second order: {coarse} {fine}");
}

#[test]
fn a_jenkins_element_dissipates_four_f_times_the_slipping_amplitude() {
    let model = chain(&[0.0]);
    let instances = vec![instance(&model, "elastic_slip", "c0.x", &[3.0, 2e-4])];
    let system = System { model, instances };
    let loads = sine(0, 1e-3, TAU, 4000);
    let cycle = periodic(&system.model, &bind(&system), &loads, &[Probe::Reaction(0)], false).unwrap();
    let f = &cycle.values[0];
    let x: Vec<f64> = (1..=4000).map(|k| 1e-3 * (TAU * k as f64 / 4000.0).sin()).collect();
    let work: f64 = (0..4000).map(|k| 0.5 * (f[k] + f[(k + 1) % 4000]) * (x[(k + 1) % 4000] - x[k])).sum();
    assert!((work / (4.0 * 3.0 * (1e-3 - 2e-4)) - 1.0).abs() < 1e-5, "{work}");
}

/// A system with every kind of law on a short chain.
pub(super) fn mixed(followers: bool) -> System {
    let model = chain(&[0.4, 0.3, 0.5]);
    let mut instances = vec![
        instance(&model, "linear_stiffness", "c0.x", &[3000.0]),
        instance(&model, "linear_stiffness", "c1.x", &[2000.0]),
        instance(&model, "linear_stiffness", "c2.x", &[2500.0]),
        instance(&model, "viscous", "c0-2.x", &[4.0]),
        instance(&model, "maxwell", "c0.x", &[500.0, 0.04]),
        instance(&model, "elastic_slip", "c1.x", &[1.2, 4e-4]),
        instance(&model, "film", "c2.x", &[0.5, 0.02, 2e-4]),
        instance(&model, "cubic_stiffness", "c0.x", &[2e8]),
        instance(&model, "backlash", "c1.x", &[2e-4, 0.5]),
        instance(&model, "support_compliance", "c2.x", &[4e-5]),
        instance(&model, "structural_damping", "c1.x", &[150.0, 2.0, 10.0, 3.0]),
        instance(&model, "coulomb", "c0.x", &[0.3, 5e-3]),
    ];
    if followers {
        for (name, at, shape) in [
            ("maxwell", "c1.x", vec![0.0, 0.01]),
            ("elastic_slip", "c0.x", vec![0.0, 3e-4]),
            ("film", "c0.x", vec![0.0, 0.01, 0.0]),
            ("cubic_stiffness", "c2.x", vec![0.0]),
            ("support_compliance", "c0.x", vec![0.0]),
            ("backlash", "c0.x", vec![0.0, 0.7]),
            ("support_compliance", "c1.x", vec![0.0]),
        ] {
            let mut i = instance(&model, name, at, &shape);
            i.follower = true;
            i.params.iter_mut().skip(1).for_each(|p| p.free = false);
            instances.push(i);
        }
    }
    System { model, instances }
}

fn check_cycle(system: &System, loads: &Loads, probes: &[Probe], skip: usize, tolerance: f64) {
    let free = system.free();
    let base = periodic(&system.model, &bind(system), loads, probes, true).unwrap();
    for k in skip..free.len() {
        let at = |h: f64| {
            let mut moved = system.clone();
            let f = &free[k];
            let i = &mut moved.instances[f.instance];
            i.follower = false;
            i.params[f.param].value = if f.log { i.params[f.param].value * h.exp() } else { i.params[f.param].value + h };
            periodic(&moved.model, &bind(&moved), loads, probes, false).unwrap()
        };
        let value = system.instances[free[k].instance].params[free[k].param].value;
        // Strengths at zero move by a step that suits their unit. Smaller steps drown in the tolerance of the periodic state.
        let h = match (free[k].log, value) {
            (true, _) => 1e-4,
            (_, 0.0) => match system.instances[free[k].instance].name() {
                "cubic_stiffness" => 100.0,
                "support_compliance" => 1e-9,
                "backlash" => 1e-8,
                _ => 1e-4,
            },
            (_, v) => 1e-4 * v,
        };
        let (up, down) = (at(h), at(-h));
        for p in 0..probes.len() {
            let (mut gap, mut size) = (0.0f64, 0.0f64);
            for s in 0..base.steps {
                let numeric = (up.values[p][s] - down.values[p][s]) / (2.0 * h);
                let analytic = base.slopes[p][s * base.columns + k];
                gap = gap.max((numeric - analytic).abs());
                size = size.max(numeric.abs());
            }
            assert!(gap <= tolerance * size, "{} at probe {p}: {gap} of {size}", free[k].name);
        }
    }
}

#[test]
fn cycle_sensitivities_equal_central_differences() {
    let system = mixed(false);
    let probes = [Probe::Dof(2), Probe::Dof(0), Probe::Relative(1), Probe::Force(1)];
    check_cycle(&system, &force(2, 1.0, 4.0, 18.0, 160), &probes, 0, 1e-6);
    let probes = [Probe::Reaction(2), Probe::Dof(0), Probe::Force(0)];
    check_cycle(&system, &sine(2, 2e-3, 18.0, 160), &probes, 0, 1e-6);
}

/// Sixty masses, too many for a monodromy matrix, on dampers whose slow branches take hundreds of periods to fade: the steady cycle and its sensitivities are
/// those of the receptance.
#[test]
fn what_fades_slowly_in_a_large_chain_stands_where_the_receptance_says() {
    let (n, omega, steps) = (60, 30.0, 1600);
    let model = chain(&vec![0.05; n]);
    let system = System {
        instances: vec![
            instance(&model, "linear_stiffness", &format!("c0-{}.x", n - 1), &[4e5]),
            instance(&model, "viscous", &format!("c0-{}.x", n - 1), &[40.0]),
            instance(&model, "maxwell", "c10.x", &[2e5, 60.0]),
            instance(&model, "structural_damping", "c30.x", &[3e4, 0.01, 1e3, 0.0]),
        ],
        model,
    };
    let free = system.free();
    let cycle = periodic(&system.model, &bind(&system), &force(n - 1, 0.0, 1.0, omega, steps), &[Probe::Dof(n - 1)], true).unwrap();
    let exact = super::frf::receptance(&system.model, &bind(&system), &[omega], &[n - 1], &[n - 1], true).unwrap();
    // The force is a sine: -i on the real axis of the receptance.
    let turned = |values: &[f64]| first_harmonic(values) * Complex64::I;
    assert!((turned(&cycle.values[0]) - exact.h[0]).norm() < 2e-5 * exact.h[0].norm(), "{} {}", turned(&cycle.values[0]), exact.h[0]);
    for (k, f) in free.iter().enumerate() {
        let column: Vec<f64> = (0..steps).map(|i| cycle.slopes[0][i * free.len() + k]).collect();
        let (found, want) = (turned(&column), exact.dh[k]);
        assert!((found - want).norm() < 1e-4 * want.norm() + 1e-9 * exact.h[0].norm(), "{}: {found} {want}", f.name);
    }
    // Marched, the slowest branch would take hundreds of cycles to fade.
    assert!(10.0 * cycle.cycles as f64 * TAU / omega < 60.0, "{} cycles", cycle.cycles);
}

#[test]
fn followers_give_the_slope_at_zero_strength() {
    let system = mixed(true);
    let first = system.free().iter().position(|f| system.instances[f.instance].follower).unwrap();
    check_cycle(&system, &force(2, 1.0, 4.0, 18.0, 160), &[Probe::Dof(2), Probe::Dof(0)], first, 1e-5);
}

#[test]
fn the_march_keeps_the_energy_of_a_free_oscillator() {
    let model = chain(&[1.0]);
    let system = System { instances: vec![instance(&model, "linear_stiffness", "c0.x", &[100.0])], model };
    let bound = bind(&system);
    let steps = 2000;
    let loads = Loads { dt: 1e-3, prescribed: vec![], forces: vec![(0, vec![0.0; steps + 1])] };
    let mut march = March::new(&system.model, &bound, &loads, 1.0).unwrap();
    let mut state = march.rest(0);
    (state.q[0], state.a[0]) = (1e-3, -0.1);
    state.w[0] = -0.1;
    for k in 1..=steps {
        march.step(k, &mut state, 0).unwrap();
    }
    let energy = 0.5 * state.v[0].powi(2) + 50.0 * state.q[0].powi(2);
    assert!((energy / 50e-6 - 1.0).abs() < 1e-6, "{energy}");
    assert!((state.q[0] - 1e-3 * (20.0f64).cos()).abs() < 2e-6, "{}", state.q[0]);
}

#[test]
fn receptance_equals_the_closed_form_and_its_slopes_the_differences() {
    let mut system = mixed(true);
    // A rigid law has no small-signal limit.
    system.instances.retain(|i| i.name() != "coulomb" && i.name() != "film");
    let free = system.free();
    let omega: Vec<f64> = (1..60).map(|k| 4.0 * k as f64).collect();
    let run = |s: &System, sens| super::frf::receptance(&s.model, &bind(s), &omega, &[2], &[0, 2], sens).unwrap();
    let base = run(&system, true);
    for k in 0..free.len() {
        let f = &free[k];
        let value = system.instances[f.instance].params[f.param].value;
        let h = if f.log {
            1e-4
        } else if value == 0.0 {
            1e-12
        } else {
            1e-5 * value
        };
        let h = if system.instances[f.instance].name() == "cubic_stiffness"
            || system.instances[f.instance].name() == "elastic_slip" && value == 0.0
        {
            1e-6
        } else {
            h
        };
        let h = if system.instances[f.instance].name() == "maxwell" && value == 0.0 { 1e-3 } else { h };
        let at = |h: f64| {
            let mut moved = system.clone();
            let i = &mut moved.instances[f.instance];
            i.follower = false;
            i.params[f.param].value = if f.log { value * h.exp() } else { value + h };
            run(&moved, false)
        };
        let (up, down) = (at(h), at(-h));
        let (mut gap, mut size) = (0.0f64, 0.0f64);
        for l in 0..base.h.len() {
            let numeric = (up.h[l] - down.h[l]) / (2.0 * h);
            gap = gap.max((numeric - base.dh[l * free.len() + k]).norm());
            size = size.max(numeric.norm());
        }
        assert!(gap <= 1e-6 * size + 1e-18, "{}: {gap} of {size}", f.name);
    }
    // One oscillator in closed form.
    let model = chain(&[2.0]);
    let instances = vec![instance(&model, "linear_stiffness", "c0.x", &[800.0]), instance(&model, "viscous", "c0.x", &[6.0])];
    let one = System { model, instances };
    let h = super::frf::receptance(&one.model, &bind(&one), &[14.0], &[0], &[0], false).unwrap().h[0];
    assert!((h - Complex64::new(800.0 - 2.0 * 196.0, 84.0).inv()).norm() < 1e-15);
}

#[test]
fn a_small_marched_cycle_gives_the_receptance() {
    let mut system = mixed(false);
    system.instances.retain(|i| !["coulomb", "backlash", "film"].contains(&i.name()));
    let omega = 25.0;
    let h = super::frf::receptance(&system.model, &bind(&system), &[omega], &[2], &[0, 2], false).unwrap().h;
    let marched = |steps| {
        let cycle =
            periodic(&system.model, &bind(&system), &force(2, 0.0, 1e-3, omega, steps), &[Probe::Dof(0), Probe::Dof(2)], false).unwrap();
        [first_harmonic(&cycle.values[0]) * Complex64::I * 1e3, first_harmonic(&cycle.values[1]) * Complex64::I * 1e3]
    };
    let (coarse, fine) = (marched(400), marched(800));
    for o in 0..2 {
        let limit = fine[o] + (fine[o] - coarse[o]) / 3.0;
        assert!((limit - h[o]).norm() < 3e-5 * h[o].norm(), "{limit} {}", h[o]);
    }
}

/// A constant force on a hardening spring: k x + k3 x^3 = f gives the operating point, k + 3 k3 x^2 the stiffness there, by the FRF of small
/// motion, by harmonic balance and by the mean of a cycle; the slope of the FRF to the force is that of differences.
#[test]
fn a_preload_moves_the_operating_point_and_adds_no_stiffness_of_its_own() {
    let model = chain(&[0.5]);
    let (k, k3, c) = (1000.0, 4e7, 3.0);
    let with = |f: f64| {
        let at = |name: &str, p: &[f64]| instance(&model, name, "c0.x", p);
        // Force on the body is -f: it goes to where the springs carry it.
        let instances = vec![at("linear_stiffness", &[k]), at("cubic_stiffness", &[k3]), at("viscous", &[c]), at("preload", &[-f])];
        System { model: model.clone(), instances }
    };
    let f = 6.0;
    let mut x = f / k;
    (0..50).for_each(|_| x -= (k * x + k3 * x.powi(3) - f) / (k + 3.0 * k3 * x * x));
    let system = with(f);
    let bound = bind(&system);
    let w = 30.0;
    let h = super::frf::receptance(&model, &bound, &[w], &[0], &[0], true).unwrap();
    let exact = Complex64::new(k + 3.0 * k3 * x * x - 0.5 * w * w, c * w).inv();
    assert!((h.h[0] - exact).norm() < 1e-9 * exact.norm(), "{} {exact}", h.h[0]);
    let moved = |f: f64| super::frf::receptance(&model, &bind(&with(f)), &[w], &[0], &[0], false).unwrap().h[0];
    let numeric = -(moved(f + 1e-4) - moved(f - 1e-4)) / 2e-4;
    let slope = h.dh[bound.n_free - 1];
    assert!((slope - numeric).norm() < 1e-6 * numeric.norm(), "{slope} {numeric}");
    let small = super::harmonic::at_amplitude(&model, &bound, &[w], 0, 1e-4, &[0], false, super::harmonic::Settings::default()).unwrap();
    assert!((small.h[0] - exact).norm() < 1e-4 * exact.norm(), "{} {exact}", small.h[0]);
    let cycle = periodic(&model, &bound, &force(0, 0.0, 1e-3, w, 400), &[Probe::Dof(0)], false).unwrap();
    let mean = cycle.values[0].iter().sum::<f64>() / 400.0;
    assert!((mean - x).abs() < 1e-6 * x, "{mean} {x}");
    // A candidate at its null value leaves the operating point where it is.
    let mut null = with(0.0);
    null.instances[3].follower = true;
    assert!(super::equilibrium::equilibrium(&model, &bind(&null), &[], 0).unwrap().is_none());
}

/// Under forces of their own each line is what it is under that force alone: a hardening spring whose response has one branch.
#[test]
fn every_line_of_an_frf_may_have_a_force_of_its_own() {
    let model = chain(&[0.5]);
    let at = |name: &str, p: &[f64]| instance(&model, name, "c0.x", p);
    let instances = vec![at("linear_stiffness", &[1000.0]), at("cubic_stiffness", &[4e7]), at("viscous", &[9.0])];
    let system = System { model: model.clone(), instances };
    let (bound, settings) = (bind(&system), super::harmonic::Settings::default());
    let omega: Vec<f64> = (1..40).map(|k| 2.0 * f64::from(k)).collect();
    // As at a constant response: least at the resonance.
    let forces: Vec<f64> = omega.iter().map(|w| 2e-3 * Complex64::new(1000.0 - 0.5 * w * w, 9.0 * w).norm()).collect();
    let all = super::harmonic::under_forces(&model, &bound, &omega, 0, &forces, &[0], true, settings).unwrap();
    let mut moved = 0.0f64;
    for (k, (w, f)) in omega.iter().zip(&forces).enumerate() {
        let one = super::harmonic::at_amplitude(&model, &bound, &[*w], 0, *f, &[0], true, settings).unwrap();
        assert!((one.h[0] - all.h[k]).norm() < 1e-9 * one.h[0].norm(), "{w}: {} {}", one.h[0], all.h[k]);
        let n = bound.n_free;
        let apart = (0..n).map(|p| (one.dh[p] - all.dh[k * n + p]).norm() / one.dh[p].norm().max(1e-30)).fold(0.0, f64::max);
        assert!(apart < 1e-6, "{w}: {apart}");
        let same = super::harmonic::at_amplitude(&model, &bound, &[*w], 0, forces[0], &[0], false, settings).unwrap();
        moved = moved.max((same.h[0] - one.h[0]).norm() / one.h[0].norm());
    }
    assert!(moved > 0.05, "one force for all lines gives the same: {moved}");
}
