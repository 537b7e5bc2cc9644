//! Chains of parts that turn far: against closed forms, against equations written another way, sensitivities against differences.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::effect::find;
use crate::model::space::{Arc, Curve, Part, Section, Space};
use crate::model::{Axis, Body, Bound, Connector, Instance, Level, Load, Model, ParamValue, Site, System};

use super::EngineError;
use super::equilibrium::equilibrium;
use super::march::{Loads, March, Probe, State};
use super::modal::{Range, modes};
use super::periodic::periodic;

/// Parts b1 ... bn along a curve, joined by c1 ... c(n-1), and c0 that joins b1 to the ground at the curve's start.
pub(super) fn chain(curve: &Curve, n: usize, section: Section, clamped: bool) -> Model {
    let (mut parts, mut frames) = curve.parts(n, Some(&section));
    let body = |name: String, free: &[Axis]| Body { name, mass: 0.0, inertia: 0.0, free: free.to_vec() };
    let mut bodies: Vec<Body> = (1..=n).map(|k| body(format!("b{k}"), &Axis::ALL)).collect();
    let mut connectors: Vec<Connector> = (1..n).map(|k| Connector { name: format!("c{k}"), from: k - 1, to: k }).collect();
    if clamped {
        bodies.push(body("ground".into(), &[]));
        parts.push(Part { origin: curve.start, centre: [0.0; 3], mass: 0.0, inertia: [[0.0; 3]; 3], dofs: [None; 6] });
        connectors.push(Connector { name: "c0".into(), from: n, to: 0 });
        frames.push(curve.frame(0.0));
    }
    Model::spatial(bodies, connectors, Space { parts, frames, stems: vec![] }).unwrap()
}

pub(super) fn straight(length: f64) -> Curve {
    Curve { start: [0.0; 3], heading: FRAC_PI_2, arcs: vec![Arc::Straight(length)] }
}

pub(super) fn instance(model: &Model, name: &str, at: &str, values: &[f64]) -> Instance {
    let effect = find(name).unwrap();
    let params = effect.info().params.iter().enumerate();
    let params = params.map(|(k, p)| ParamValue::free(values.get(k).copied().unwrap_or(p.default), p.sign)).collect();
    let places = at.split(',').flat_map(|a| model.places_at(a).unwrap()).collect();
    Instance::new(effect, at, Site::Places(places), params)
}

/// Springs on all six axes of c<first> ... c<last>.
pub(super) fn springs(model: Model, first: usize, last: usize, k: [f64; 6]) -> System {
    let each = Axis::ALL.iter().zip(k);
    let instances = each.map(|(a, k)| instance(&model, "linear_stiffness", &format!("c{first}-{last}.{}", a.name()), &[k])).collect();
    System { model, instances }
}

fn bind(system: &System) -> Bound {
    Bound::new(system, &system.free(), "t", &BTreeMap::new()).unwrap()
}

fn load(system: &mut System, at: &str, force: f64, steps: usize) {
    let dof = system.model.dof(at).unwrap();
    system.model.loads.push(Load { dof, path: vec![Level::Value(force)], steps });
}

pub(super) const STEEL: Section = Section { width: 0.02, thickness: 0.004, density: 7800.0 };

/// A clamped chain of n rigid links in its plane by absolute angles: link k turns by `t_k`, its centre of mass moves by
/// `l (t_1 + ... + t_(k-1) + t_k / 2)` across the chain, springs see `t_k - t_(k-1)`.
fn by_angles(n: usize, length: f64, section: &Section, k: f64) -> Vec<f64> {
    let l = length / n as f64;
    let m = section.density * section.width * section.thickness * l;
    let j = m * (l * l + section.thickness * section.thickness) / 12.0;
    let (mut mass, mut stiffness) = (DMatrix::<f64>::zeros(n, n), DMatrix::<f64>::zeros(n, n));
    for p in 0..n {
        let arm = |a: usize| {
            if a < p {
                l
            } else if a == p {
                0.5 * l
            } else {
                0.0
            }
        };
        for a in 0..n {
            for b in 0..n {
                mass[(a, b)] += m * arm(a) * arm(b) + if a == p && b == p { j } else { 0.0 };
            }
        }
        stiffness[(p, p)] += k;
        if p > 0 {
            stiffness[(p - 1, p - 1)] += k;
            stiffness[(p, p - 1)] -= k;
            stiffness[(p - 1, p)] -= k;
        }
    }
    let root = mass.cholesky().unwrap().l();
    let inner = root.solve_lower_triangular(&stiffness).unwrap().transpose();
    let reduced = root.solve_lower_triangular(&inner).unwrap();
    let mut values: Vec<f64> = reduced.symmetric_eigenvalues().iter().map(|e| e.sqrt() / TAU).collect();
    values.sort_by(f64::total_cmp);
    values
}

#[test]
fn a_clamped_chain_has_the_modes_of_its_links() {
    let (n, length) = (12, 0.12);
    let system = springs(chain(&straight(length), n, STEEL, true), 0, n - 1, [3e12, 3e12, 3e12, 1e9, 1e9, 120.0]);
    let found = modes(&system.model, &bind(&system), Range::Lowest(5), false).unwrap();
    let exact = by_angles(n, length, &STEEL, 120.0);
    for k in 0..5 {
        let f = found[k].frequency_hz;
        assert!((f / exact[k] - 1.0).abs() < 1e-6, "{k}: {f} {}", exact[k]);
    }
    // A fine chain is a beam: its first two clamped-free frequencies with EI = k l.
    let n = 60;
    let (l, rho_a) = (length / n as f64, STEEL.density * STEEL.width * STEEL.thickness);
    let system = springs(chain(&straight(length), n, STEEL, true), 0, n - 1, [3e12, 3e12, 3e12, 1e9, 1e9, 10.0 / l]);
    let found = modes(&system.model, &bind(&system), Range::Lowest(2), false).unwrap();
    for (mode, beta) in found.iter().zip([1.87510407, 4.69409113]) {
        let beam = (beta / length).powi(2) * (10.0 / rho_a).sqrt() / TAU;
        assert!((mode.frequency_hz / beam - 1.0).abs() < 0.03, "{} {beam}", mode.frequency_hz);
    }
}

#[test]
fn a_free_chain_has_six_rigid_motions() {
    let n = 8;
    let system = springs(chain(&straight(0.1), n, STEEL, false), 1, n - 1, [3e10, 3e10, 3e10, 5e4, 140.0, 100.0]);
    let found = modes(&system.model, &bind(&system), Range::Lowest(9), false).unwrap();
    assert!(found[..6].iter().all(|m| m.frequency_hz == 0.0) && found[6].frequency_hz > 100.0, "{found:?}");
}

/// Bisshopp and Drucker (Q. Appl. Math. 3, 1945): a cantilever under a dead load across its tip.
#[test]
fn a_chain_under_a_tip_load_is_the_elastica() {
    let (n, length, ei) = (160, 1.0, 2.0);
    // Springs half a part from the ends carry half a part's length.
    for (load_number, across, along) in [(1.0, 0.301721, 0.056433), (10.0, 0.810609, 0.554996)] {
        let l = length / n as f64;
        let mut system = springs(chain(&straight(length), n, STEEL, true), 0, n - 1, [1e9, 1e9, 1e9, 1e7, 1e7, ei / l]);
        let root = system.model.places_at("c0.psi").unwrap()[0];
        // The first spring stands for half a part only.
        for i in &mut system.instances {
            if let Site::Places(p) = &mut i.site {
                p.retain(|p| *p != root);
            }
        }
        system.instances.push(instance(&system.model, "linear_stiffness", "c0.psi", &[2.0 * ei / l]));
        // The tip: the last part's origin moved to its end.
        if let Some(space) = &mut system.model.space {
            let part = &mut space.parts[n - 1];
            part.centre = [0.0, -0.5 * l, 0.0];
            part.origin[1] += 0.5 * l;
        }
        load(&mut system, &format!("b{n}.x"), load_number * ei / (length * length), 12);
        let at = equilibrium(&system.model, &bind(&system), &[], 0).unwrap().unwrap();
        let of = |name: &str| at.state.q[system.model.dof(name).unwrap()];
        let (x, y) = (of(&format!("b{n}.x")), of(&format!("b{n}.y")));
        assert!((x / across - 1.0).abs() < 1e-4 && (-y / along - 1.0).abs() < 2e-4, "{load_number}: {x} {y}");
    }
}

/// A bent chain in space with nonlinear laws, clamped, loaded out of its plane.
fn mixed() -> System {
    let curve = Curve {
        start: [0.0; 3],
        heading: 1.2,
        arcs: vec![Arc::Turn { radius: 0.08, angle: 0.6 }, Arc::Turn { radius: 0.05, angle: -0.8 }],
    };
    let mut system = springs(chain(&curve, 4, STEEL, true), 0, 3, [4e5, 5e5, 6e5, 40.0, 30.0, 25.0]);
    let more = [
        ("viscous", "c0-3.psi", vec![2e-3]),
        ("viscous", "c0-3.theta,c0-3.phi", vec![3e-3]),
        ("viscous", "c0-3.x,c0-3.y,c0-3.z", vec![20.0]),
        ("cubic_stiffness", "c1.psi", vec![900.0]),
        ("elastic_slip", "c2.psi", vec![0.3, 0.03]),
        ("maxwell", "c0.psi", vec![6.0, 0.004]),
        ("support_compliance", "c3.psi", vec![0.004]),
    ];
    for (name, at, values) in more {
        let i = instance(&system.model, name, at, &values);
        system.instances.push(i);
    }
    system
}

fn loaded() -> System {
    let mut system = mixed();
    load(&mut system, "b4.x", 110.0, 8);
    load(&mut system, "b4.z", 40.0, 8);
    load(&mut system, "b3.phi", 2.0, 8);
    system
}

/// Checks slopes of a run against central differences in the fit's variables.
fn check_slopes(system: &System, tolerance: f64, run: impl Fn(&System, bool) -> (Vec<f64>, Vec<f64>)) {
    let free = system.free();
    let (values, slopes) = run(system, true);
    for (k, f) in free.iter().enumerate() {
        let value = system.instances[f.instance].params[f.param].value;
        let h = 2e-5 * value.abs().max(1e-12);
        let at = |h: f64| {
            let mut moved = system.clone();
            moved.instances[f.instance].params[f.param].value += h;
            run(&moved, false).0
        };
        let (up, down) = (at(h), at(-h));
        let scale = if f.log { value } else { 1.0 };
        let numeric: Vec<f64> = up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * h) * scale).collect();
        let size = numeric.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        let floor = values.iter().fold(0.0f64, |m, v| m.max(v.abs())) * 1e-10 / h * scale;
        for (i, n) in numeric.iter().enumerate() {
            let exact = slopes[i * free.len() + k];
            assert!((exact - n).abs() <= tolerance * size + floor, "{} at {i}: {exact} {n} of {size}", f.name);
        }
    }
}

#[test]
fn the_slopes_of_an_equilibrium_are_its_derivatives() {
    check_slopes(&loaded(), 1e-6, |s, sens| {
        let bound = bind(s);
        let at = equilibrium(&s.model, &bound, &[], if sens { bound.n_free } else { 0 }).unwrap().unwrap();
        (at.state.q.iter().chain(&at.elements).copied().collect(), [at.state.dq, at.d_elements].concat())
    });
}

#[test]
fn the_slopes_of_loaded_modes_are_their_derivatives() {
    let base = loaded();
    let at = equilibrium(&base.model, &bind(&base), &[], 0).unwrap().unwrap();
    let turned = at.state.q[base.model.dof("b4.psi").unwrap()];
    assert!(turned.abs() > 0.3, "the load turns the tip by {turned}");
    check_slopes(&base, 2e-6, |s, sens| {
        let bound = bind(s);
        let found = modes(&s.model, &bound, Range::Lowest(4), sens).unwrap();
        let values = found.iter().flat_map(|m| [m.lambda.re, m.lambda.im]).collect();
        let n = if sens { bound.n_free } else { 0 };
        let slopes = found
            .iter()
            .flat_map(|m| [0, 1].map(|p| (0..n).map(|k| if p == 0 { m.dlambda[k].re } else { m.dlambda[k].im }).collect::<Vec<_>>()));
        (values, slopes.flatten().collect())
    });
}

#[test]
fn the_slopes_of_a_loaded_receptance_are_its_derivatives() {
    let omega: Vec<f64> = (1..25).map(|k| 60.0 * k as f64).collect();
    check_slopes(&loaded(), 3e-6, |s, sens| {
        let bound = bind(s);
        let (i, o) = (s.model.dof("b4.x").unwrap(), s.model.dof("b2.y").unwrap());
        let r = super::frf::receptance(&s.model, &bound, &omega, &[i], &[o, i], sens).unwrap();
        let n = bound.n_free;
        let parts = |h: &Complex64| [h.re, h.im];
        let slopes =
            r.dh.chunks(n.max(1)).flat_map(|row| [row.iter().map(|d| d.re).collect::<Vec<_>>(), row.iter().map(|d| d.im).collect()]);
        (r.h.iter().flat_map(parts).collect(), slopes.flatten().collect())
    });
}

/// Small motion about an equilibrium is what the march does there.
#[test]
fn the_receptance_at_a_load_is_that_of_a_small_marched_cycle() {
    let mut system = loaded();
    // Both engines need the same small-signal limit: what slips or settles over a path is left out.
    system.instances.retain(|i| !matches!(i.name(), "elastic_slip" | "maxwell"));
    let bound = bind(&system);
    let (x, y) = (system.model.dof("b4.x").unwrap(), system.model.dof("b2.y").unwrap());
    let omega = 400.0;
    let steps = 300;
    let amplitude = 1e-4;
    let path: Vec<f64> = (0..=steps).map(|k| amplitude * (TAU * k as f64 / steps as f64).sin()).collect();
    let loads = Loads { dt: TAU / omega / steps as f64, prescribed: vec![], forces: vec![(x, path)] };
    let cycle = periodic(&system.model, &bound, &loads, &[Probe::Dof(x), Probe::Dof(y)], false).unwrap();
    let r = super::frf::receptance(&system.model, &bound, &[omega], &[x], &[x, y], false).unwrap();
    for (values, h) in cycle.values.iter().zip(&r.h) {
        let n = values.len() as f64;
        let sum: Complex64 = values.iter().enumerate().map(|(k, v)| v * Complex64::from_polar(1.0, -TAU * (k + 1) as f64 / n)).sum();
        let marched = sum * 2.0 / n * Complex64::I / amplitude;
        assert!((marched - h).norm() < 2e-3 * h.norm(), "{marched} {h}");
    }
}

/// What relaxes over thirty cycles carries none of a steady load: the mean of the steady cycle, and its slopes, are those without it.
#[test]
fn a_cycle_that_creeps_ends_where_the_relaxed_structure_stands() {
    let n = 12;
    let springs = || springs(chain(&straight(0.3), n, STEEL, true), 0, n - 1, [1e7, 1e7, 1e7, 300.0, 300.0, 300.0]);
    let steps = 40;
    let mean = |system: &System| {
        let x = system.model.dof("b12.x").unwrap();
        let path = (0..=steps).map(|k| 0.05 + 0.02 * (TAU * k as f64 / steps as f64).sin()).collect();
        let loads = Loads { dt: 1.0 / steps as f64, prescribed: vec![], forces: vec![(x, path)] };
        let cycle = periodic(&system.model, &bind(system), &loads, &[Probe::Dof(x)], true).unwrap();
        let mean = |v: &[f64], from: usize, by: usize| v.iter().skip(from).step_by(by).sum::<f64>() / steps as f64;
        let slopes: Vec<f64> = (0..cycle.columns).map(|c| mean(&cycle.slopes[0], c, cycle.columns)).collect();
        (mean(&cycle.values[0], 0, 1), slopes, cycle.cycles)
    };
    let relaxed = mean(&springs());
    let mut system = springs();
    system.instances.push(instance(&system.model, "maxwell", "c0-11.psi", &[200.0, 30.0]));
    let (value, slopes, cycles) = mean(&system);
    println!("{cycles} cycles: {value:e} {:e}; {slopes:?} {:?}", relaxed.0, relaxed.1);
    approx::assert_relative_eq!(value, relaxed.0, max_relative = 1e-5);
    let largest = relaxed.1.iter().fold(0.0f64, |m, s| m.max(s.abs()));
    for (a, b) in slopes.iter().zip(&relaxed.1) {
        assert!((a - b).abs() < 1e-4 * largest, "{a} {b}");
    }
    // With respect to the logarithm of its stiffness and of its relaxation time.
    assert!(slopes[6..].iter().all(|s| s.abs() < 1e-4 * value.abs()), "{slopes:?}");
    assert!(cycles < 40, "{cycles}");
}

fn transient(system: &System, steps: usize, duration: f64, radius: f64, sens: bool) -> (Vec<State>, Bound) {
    let bound = bind(system);
    let dof = |name: &str| system.model.dof(name).unwrap();
    let at = |k: usize| (TAU * k as f64 / steps as f64 * 2.0).sin();
    let loads = Loads {
        dt: duration / steps as f64,
        prescribed: vec![],
        forces: vec![
            (dof("b4.x"), (0..=steps).map(|k| 40.0 * at(k)).collect()),
            (dof("b3.z"), (0..=steps).map(|k| 15.0 * at(k)).collect()),
        ],
    };
    let mut march = March::new(&system.model, &bound, &loads, radius).unwrap();
    let columns = if sens { bound.n_free } else { 0 };
    let mut state = march.rest(columns);
    let mut all = vec![];
    for k in 1..=steps {
        march.step(k, &mut state, columns).unwrap();
        all.push(state.clone());
    }
    (all, bound)
}

#[test]
fn the_slopes_of_a_transient_with_large_rotations_are_its_derivatives() {
    let system = mixed();
    let widest = transient(&system, 150, 0.03, 0.7, false).0.iter().fold(0.0f64, |m, s| m.max(s.q[23].abs()));
    assert!(widest > 0.5, "the tip turns by {widest}");
    check_slopes(&system, 3e-6, |s, sens| {
        let states = transient(s, 150, 0.03, 0.7, sens).0;
        let late: Vec<&State> = states.iter().skip(100).step_by(10).collect();
        let values = late.iter().flat_map(|s| s.q.clone()).collect();
        (values, late.iter().flat_map(|s| s.dq.clone()).collect())
    });
}

/// Without sensitivities the last look of a step is at what states and reactions ask for; with them it is at everything.
#[test]
fn a_march_of_values_has_the_states_forces_and_reactions_of_one_with_slopes() {
    let system = mixed();
    let (bound, steps, dt) = (bind(&system), 200, 1e-4);
    let dof = |name: &str| system.model.dof(name).unwrap();
    let held = dof("b4.x");
    let w = TAU * 60.0;
    let path = (0..=steps).map(|k| w * dt * k as f64).map(|p| [2e-3 * (1.0 - p.cos()), 2e-3 * w * p.sin(), 2e-3 * w * w * p.cos()]);
    let force = (0..=steps).map(|k| 15.0 * (w * dt * k as f64).sin()).collect();
    let loads = Loads { dt, prescribed: vec![(held, path.collect())], forces: vec![(dof("b3.z"), force)] };
    let run = |columns: usize| -> Vec<Vec<f64>> {
        let mut march = March::new(&system.model, &bound, &loads, 0.7).unwrap();
        let mut state = march.rest(columns);
        let mut step = |k: usize| {
            march.step(k, &mut state, columns).unwrap();
            [state.q.clone(), state.s.clone(), march.element_forces(columns).0, vec![state.g[held]]]
        };
        (1..=steps).flat_map(&mut step).collect()
    };
    let (values, with_slopes) = (run(0), run(bound.n_free));
    for what in 0..4 {
        let of = |all: &[Vec<f64>]| -> Vec<f64> { all.iter().skip(what).step_by(4).flatten().copied().collect() };
        let (own, full) = (of(&values), of(&with_slopes));
        let size = full.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let gap = own.iter().zip(&full).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        println!("{what}: {:.1e} of {size}", gap / size);
        assert!(size > 0.0 && gap < 1e-8 * size, "{what}: {gap} of {size}");
    }
}

#[test]
fn the_march_with_large_rotations_is_of_second_order() {
    let system = mixed();
    let end = |steps: usize| transient(&system, steps, 0.02, 0.8, false).0.pop().unwrap().q;
    let finest = end(3200);
    let error = |steps: usize| {
        let q = end(steps);
        (DVector::from_vec(q) - DVector::from_vec(finest.clone())).norm()
    };
    let (coarse, fine) = (error(400), error(800));
    assert!(coarse / fine > 3.4 && coarse / fine < 5.2, "{coarse} {fine}");
}

/// A rigid body that tumbles freely keeps its angular momentum and its energy.
#[test]
fn a_free_body_keeps_energy_and_angular_momentum() {
    let curve = straight(0.04);
    let mut system = springs(chain(&curve, 2, STEEL, false), 1, 1, [1e9, 1e9, 1e9, 1e6, 1e6, 1e6]);
    system.instances.iter_mut().for_each(|i| i.params.iter_mut().for_each(|p| p.free = false));
    let bound = bind(&system);
    let steps = 2000;
    let loads = Loads { dt: 2e-5, prescribed: vec![], forces: vec![(0, vec![0.0; steps + 1])] };
    let mut march = March::new(&system.model, &bound, &loads, 0.9).unwrap();
    let mut state = march.rest(0);
    let omega = [20.0, 3.0, 25.0];
    let space = system.model.space.clone().unwrap();
    for (k, part) in space.parts.iter().enumerate() {
        let r = [part.origin[0], part.origin[1] - 0.02, part.origin[2]];
        let v = crate::model::space::rotation::cross(omega, r);
        for i in 0..3 {
            state.v[6 * k + i] = v[i];
            state.v[6 * k + 3 + i] = omega[i];
        }
        let a = crate::model::space::rotation::cross(omega, v);
        (0..3).for_each(|i| {
            state.a[6 * k + i] = a[i];
            state.w[6 * k + i] = a[i];
        });
    }
    let quantities = |state: &State| {
        let (mut energy, mut momentum) = (0.0, [0.0; 3]);
        for (k, part) in space.parts.iter().enumerate() {
            use crate::model::space::rotation::*;
            let (q, v) = (space.coordinates(k, &state.q), space.coordinates(k, &state.v));
            let m = part.mass_matrix([q[3], q[4], q[5]]);
            for i in 0..6 {
                for j in 0..6 {
                    energy += 0.5 * v[i] * m[i][j] * v[j];
                }
            }
            let (less_unit, spin) = exponential([q[3], q[4], q[5]]);
            let w = transposed_times(&spin, [v[3], v[4], v[5]]);
            let h = times(&part.inertia, w);
            let own = add(h, times(&less_unit, h));
            let at = [part.origin[0] + q[0], part.origin[1] - 0.02 + q[1], part.origin[2] + q[2]];
            let orbit = cross(at, [v[0], v[1], v[2]].map(|x| x * part.mass));
            (0..3).for_each(|i| momentum[i] += own[i] + orbit[i]);
        }
        (energy, momentum)
    };
    let (e0, h0) = quantities(&state);
    for k in 1..=steps {
        march.step(k, &mut state, 0).unwrap();
    }
    let (e1, h1) = quantities(&state);
    let size = h0.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!((e1 / e0 - 1.0).abs() < 2e-4, "{e0} {e1}");
    assert!((0..3).all(|i| (h1[i] - h0[i]).abs() < 2e-4 * size), "{h0:?} {h1:?}");
    assert!(state.q[3..6].iter().map(|x| x * x).sum::<f64>().sqrt() > 0.9, "{:?}", &state.q[3..6]);
}

#[test]
fn a_load_that_buckles_or_lifts_off_is_refused() {
    let n = 10;
    let make = |force: f64| {
        let mut system = springs(chain(&straight(0.1), n, STEEL, true), 0, n - 1, [1e9, 1e9, 1e9, 50.0, 50.0, 5.0]);
        load(&mut system, &format!("b{n}.y"), force, 6);
        let bound = bind(&system);
        equilibrium(&system.model, &bound, &[], 0).map(|_| ())
    };
    // Euler: pi^2 EI / 4 L^2 with EI = 5 N m * 10 mm.
    let euler = std::f64::consts::PI.powi(2) * 5.0 * 0.01 / (4.0 * 0.01);
    assert!(make(-0.8 * euler).is_ok());
    let refused = make(-1.3 * euler).unwrap_err();
    assert!(matches!(refused, EngineError::Unstable { .. }), "{refused:?}");
    // A frame somewhere else: nothing holds the chain in x.
    let mut system = springs(chain(&straight(0.1), n, STEEL, true), 0, n - 1, [1e9, 1e9, 1e9, 50.0, 50.0, 5.0]);
    system.instances.retain(|i| i.at != format!("c0-{}.x", n - 1));
    load(&mut system, &format!("b{n}.x"), 1.0, 3);
    assert!(matches!(equilibrium(&system.model, &bind(&system), &[], 0), Err(EngineError::Unstable { .. })));
}
