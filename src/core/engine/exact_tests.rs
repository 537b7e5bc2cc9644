//! Exact steps against closed forms and against the march for any model, and their sensitivities against differences.

use crate::model::System;

use super::march::{Loads, March, Probe};
use super::tests::{bind, chain, instance, mixed};

/// A force or a motion of the last of three masses that begins at rest: two sines under a rise.
fn pushed(t: f64) -> f64 {
    (1.0 - (-(t / 0.05).powi(4)).exp()) * (4.0 * (18.0 * t).sin() + 2.5 * (47.0 * t).cos())
}

fn by_force(steps: usize, dt: f64) -> Loads {
    Loads { dt, prescribed: vec![], forces: vec![(2, (0..=steps).map(|k| pushed(k as f64 * dt)).collect())] }
}

/// A displacement with its rates by differences of its own formula.
fn by_motion(steps: usize, dt: f64) -> Loads {
    let x = |t: f64| 5e-4 * pushed(t);
    let h = 1e-4;
    let at = |t: f64| {
        let (a, b, c, d, e) = (x(t - 2.0 * h), x(t - h), x(t), x(t + h), x(t + 2.0 * h));
        let rate = (a - 8.0 * b + 8.0 * d - e) / (12.0 * h);
        [c, rate, (-a + 16.0 * b - 30.0 * c + 16.0 * d - e) / (12.0 * h * h)]
    };
    Loads { dt, prescribed: vec![(2, (0..=steps).map(|k| at(k as f64 * dt)).collect())], forces: vec![] }
}

/// Readings of one probe at the ends of steps, `columns` slopes each.
#[derive(Clone, Default)]
struct Read {
    values: Vec<f64>,
    slopes: Vec<f64>,
}

/// The readings of one march, probe by probe.
fn run(system: &System, loads: &Loads, probes: &[Probe], exact: bool, every: usize, sensitivities: bool) -> Vec<Read> {
    let bound = bind(system);
    let columns = if sensitivities { bound.n_free } else { 0 };
    let march = if exact { March::exact(&system.model, &bound, loads, 0.6) } else { March::new(&system.model, &bound, loads, 0.6) };
    let mut march = march.unwrap();
    let (mut state, mut read) = (march.rest(columns), vec![Read::default(); probes.len()]);
    let steps = loads.prescribed.first().map(|p| p.1.len()).or(loads.forces.first().map(|f| f.1.len())).unwrap() - 1;
    let mut d = vec![0.0; columns];
    for k in 1..=steps {
        march.step(k, &mut state, columns).unwrap();
        for (probe, read) in probes.iter().zip(&mut read).filter(|_| k % every == 0) {
            read.values.push(march.read(*probe, &state, &mut d));
            read.slopes.extend(&d);
        }
    }
    read
}

fn largest(x: impl Iterator<Item = f64>) -> f64 {
    x.fold(0.0, |m, v| m.max(v.abs()))
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    largest(a.iter().zip(b).map(|(a, b)| a - b)) / largest(b.iter().copied())
}

/// Extrapolated from two marches of which the second has half the steps.
fn beyond(fine: &[f64], coarse: &[f64]) -> Vec<f64> {
    fine.iter().zip(coarse).map(|(f, c)| f + (f - c) / 3.0).collect()
}

/// Two masses in free decay from a release, in steps of a fifth of a period: nothing is lost of amplitude or phase.
#[test]
fn a_free_decay_is_exact_in_steps_of_any_length() {
    let model = chain(&[1.0]);
    let (k, c) = (100.0, 0.4);
    let system =
        System { instances: vec![instance(&model, "linear_stiffness", "c0.x", &[k]), instance(&model, "viscous", "c0.x", &[c])], model };
    let bound = bind(&system);
    let (steps, dt) = (200, 0.125);
    let loads = Loads { dt, prescribed: vec![], forces: vec![(0, vec![0.0; steps + 1])] };
    let mut march = March::exact(&system.model, &bound, &loads, 0.6).unwrap();
    let mut state = march.rest(2);
    state.q[0] = 1e-3;
    let (decay, w) = (0.5 * c, (k - 0.25 * c * c).sqrt());
    let motion = |t: f64, k: f64, c: f64| {
        let (decay, w) = (0.5 * c, (k - 0.25 * c * c).sqrt());
        1e-3 * (-decay * t).exp() * ((w * t).cos() + decay / w * (w * t).sin())
    };
    for s in 1..=steps {
        march.step(s, &mut state, 2).unwrap();
        let t = s as f64 * dt;
        assert!((state.q[0] - motion(t, k, c)).abs() < 1e-13, "{s}: {} {}", state.q[0], motion(t, k, c));
    }
    let t = steps as f64 * dt;
    let velocity = -1e-3 * (-decay * t).exp() * (w + decay * decay / w) * (w * t).sin();
    assert!((state.v[0] - velocity).abs() < 1e-12 && (state.a[0] + k * state.q[0] + c * state.v[0]).abs() < 1e-12);
}

/// Without laws that are not linear the slopes are cubics over a step: their error falls with the fourth power of it.
#[test]
fn slopes_of_linear_laws_are_of_fourth_order() {
    let mut system = mixed(false);
    system.instances.retain(|i| matches!(i.name(), "linear_stiffness" | "viscous"));
    system.instances.push(instance(&system.model, "added_mass", "c0.x", &[0.05]));
    let free = system.free();
    let (steps, dt) = (300, 4e-3);
    let error = |parts: usize, k: usize| {
        let at = |h: f64| {
            let mut moved = system.clone();
            let p = &mut moved.instances[free[k].instance].params[free[k].param];
            p.value *= 1.0 + h;
            run(&moved, &by_force(steps * parts, dt / parts as f64), &[Probe::Dof(0)], true, parts, false).remove(0).values
        };
        let scale = if free[k].log { 1.0 } else { system.instances[free[k].instance].params[free[k].param].value };
        let numeric: Vec<f64> = at(1e-5).iter().zip(at(-1e-5)).map(|(a, b)| (a - b) / 2e-5).collect();
        let slopes = run(&system, &by_force(steps * parts, dt / parts as f64), &[Probe::Dof(0)], true, parts, true).remove(0).slopes;
        let own: Vec<f64> = slopes.chunks(free.len()).map(|d| d[k] * scale).collect();
        apart(&own, &numeric)
    };
    for (k, f) in free.iter().enumerate() {
        let (coarse, fine) = (error(1, k), error(2, k));
        assert!(coarse < 2e-3 && fine < coarse / 10.0, "{}: {coarse} {fine}", f.name);
    }
}

/// The last step of Newton's method is not looked at again, and states follow it all the same: with sensitivities, where they are computed with these, and
/// without. Laws that superpose take one such step.
#[test]
fn states_follow_the_motion_with_and_without_sensitivities() {
    let mut superposed = mixed(false);
    superposed.instances.retain(|i| ["linear_stiffness", "viscous", "maxwell", "structural_damping"].contains(&i.name()));
    superposed.instances.push(instance(&superposed.model, "inertia_deviation", "c0.x", &[0.4, 0.3, 2000.0, 4.0]));
    for system in [mixed(false), superposed] {
        let of = |sensitivities| run(&system, &by_force(600, 1e-3), &[Probe::Dof(0), Probe::Force(1)], true, 1, sensitivities);
        let (with, without) = (of(true), of(false));
        for (with, without) in with.iter().zip(&without) {
            assert!(apart(&with.values, &without.values) < 1e-7, "{}", apart(&with.values, &without.values));
        }
    }
}

/// What is read of displacements alone needs no sensitivities of accelerations.
#[test]
fn slopes_of_displacements_are_the_same_without_those_of_accelerations() {
    let mut system = mixed(false);
    system.instances.push(instance(&system.model, "inertia_deviation", "c0.x", &[0.4, 0.3, 2000.0, 4.0]));
    let (bound, loads) = (bind(&system), by_force(300, 1e-3));
    let of = |reads: bool| {
        let mut march = March::exact(&system.model, &bound, &loads, 0.6).unwrap();
        march.reads_beyond_state = reads;
        let mut state = march.rest(bound.n_free);
        (1..=300).for_each(|k| march.step(k, &mut state, bound.n_free).unwrap());
        (state.dq, state.dv)
    };
    assert_eq!(of(true), of(false));
}

/// A system of every kind of law, under a force and under a motion: both methods come to the same.
#[test]
fn exact_steps_come_to_what_the_march_for_any_model_does() {
    let mut system = mixed(false);
    system.instances.push(instance(&system.model, "inertia_deviation", "c0.x", &[0.4, 0.3, 2000.0, 4.0]));
    system.instances.push(instance(&system.model, "added_mass", "c0.x", &[0.05]));
    let dt = 2e-3;
    let force = [Probe::Dof(0), Probe::Velocity(2), Probe::Acceleration(2), Probe::Relative(1), Probe::Force(0), Probe::Force(1)];
    let motion = [Probe::Reaction(2), Probe::Dof(0), Probe::Force(2), Probe::RelativeVelocity(1)];
    for (probes, loads) in [(&force[..], by_force as fn(usize, f64) -> Loads), (&motion[..], by_motion)] {
        let of = |exact, parts: usize| run(&system, &loads(400 * parts, dt / parts as f64), probes, exact, parts, false);
        let (marched, half, coarse, fine) = (of(false, 128), of(false, 64), of(true, 4), of(true, 16));
        for (k, probe) in probes.iter().enumerate() {
            let truth = beyond(&marched[k].values, &half[k].values);
            let (coarse, fine) = (apart(&coarse[k].values, &truth), apart(&fine[k].values, &truth));
            assert!(fine < coarse / 8.0 && fine < 3e-4, "{probe:?}: {coarse} {fine}");
        }
    }
}

/// Slopes of all parameters of laws that are not linear are those of differences of the same steps.
#[test]
fn slopes_of_exact_steps_equal_differences() {
    // Where a slider begins to slip within a step, a difference steps over it.
    let mut system = mixed(false);
    system.instances.retain(|i| i.name() != "elastic_slip");
    let free = system.free();
    let (parts, dt) = (8, 2e-3);
    for (loads, probes) in [
        (by_force(200 * parts, dt / parts as f64), vec![Probe::Dof(0), Probe::Acceleration(2), Probe::Force(1)]),
        (by_motion(200 * parts, dt / parts as f64), vec![Probe::Reaction(2), Probe::Dof(0)]),
    ] {
        let slopes = run(&system, &loads, &probes, true, parts, true);
        for (k, f) in free.iter().enumerate() {
            let value = system.instances[f.instance].params[f.param].value;
            let h = if f.log { 1e-4 } else { 1e-4 * value };
            let at = |h: f64| {
                let mut moved = system.clone();
                let p = &mut moved.instances[f.instance].params[f.param];
                p.value = if f.log { value * h.exp() } else { value + h };
                run(&moved, &loads, &probes, true, parts, false)
            };
            for ((probe, read), (above, below)) in probes.iter().zip(&slopes).zip(at(h).iter().zip(at(-h))) {
                let numeric: Vec<f64> = above.values.iter().zip(below.values).map(|(a, b)| (a - b) / (2.0 * h)).collect();
                let own: Vec<f64> = read.slopes.chunks(free.len()).map(|d| d[k]).collect();
                let gap = apart(&own, &numeric);
                // Those of linear laws are cubics over a step.
                let tolerance = if matches!(system.instances[f.instance].name(), "linear_stiffness" | "viscous") { 1e-4 } else { 1e-5 };
                assert!(gap < tolerance, "{} at {probe:?}: {gap}", f.name);
            }
        }
    }
}

/// The slope to a candidate's strength is that of the strength from zero on.
#[test]
fn followers_of_exact_steps_give_the_slope_at_zero_strength() {
    let system = mixed(true);
    let free = system.free();
    let loads = by_force(1600, 2.5e-4);
    let slopes = run(&system, &loads, &[Probe::Dof(0)], true, 8, true).remove(0).slopes;
    for (k, f) in free.iter().enumerate().filter(|(_, f)| system.instances[f.instance].follower) {
        let h = match system.instances[f.instance].name() {
            "cubic_stiffness" => 100.0,
            "support_compliance" => 1e-9,
            "backlash" => 1e-8,
            _ => 1e-4,
        };
        let at = |h: f64| {
            let mut moved = system.clone();
            moved.instances[f.instance].follower = false;
            moved.instances[f.instance].params[f.param].value = h;
            run(&moved, &loads, &[Probe::Dof(0)], true, 8, false).remove(0).values
        };
        let numeric: Vec<f64> = at(h).iter().zip(at(-h)).map(|(a, b)| (a - b) / (2.0 * h)).collect();
        let own: Vec<f64> = slopes.chunks(free.len()).map(|d| d[k]).collect();
        let gap = apart(&own, &numeric);
        assert!(gap < 1e-4, "{}: {gap}", f.name);
    }
}
