//! Modes against closed forms, against an independent state-space problem, and their sensitivities against differences.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use nalgebra::DMatrix;
use num_complex::Complex64;

use crate::effect::find;
use crate::model::{Axis, Body, Bound, Connector, Instance, Model, ParamValue, Site, System};

use super::super::EngineError;
use super::{Mode, Modes, Range, modes};

fn body(name: &str, mass: f64) -> Body {
    Body { name: name.into(), mass, inertia: 0.0, free: if name == "ground" { vec![] } else { vec![Axis::X] } }
}

/// Bodies with these masses and connectors c0, c1, ... between the given pairs; body 0 is the ground.
fn graph(masses: &[f64], pairs: &[(usize, usize)]) -> Model {
    let mut bodies = vec![body("ground", 0.0)];
    bodies.extend(masses.iter().enumerate().map(|(k, m)| body(&format!("m{}", k + 1), *m)));
    let connectors = pairs.iter().enumerate().map(|(k, (a, b))| Connector { name: format!("c{k}"), from: *a, to: *b }).collect();
    Model::new(bodies, connectors).unwrap()
}

fn system(model: Model, effects: &[(&str, &str, &[f64])]) -> System {
    let instance = |(name, at, values): &(&str, &str, &[f64])| {
        let effect = find(name).unwrap();
        let all = effect.info().params.iter().enumerate().map(|(k, p)| (values.get(k).copied().unwrap_or(p.default), p.sign));
        let params = all.map(|(v, sign)| ParamValue::free(v, sign)).collect();
        let site = Site::Places(model.places_at(at).unwrap());
        Instance::new(effect, *at, site, params)
    };
    let instances = effects.iter().map(instance).collect();
    System { model, instances }
}

fn chain(masses: &[f64]) -> Model {
    graph(masses, &(0..masses.len()).map(|k| (k, k + 1)).collect::<Vec<_>>())
}

fn bind(system: &System) -> Bound {
    Bound::new(system, &system.free(), "t", &BTreeMap::new()).unwrap()
}

fn run(system: &System, range: Range) -> Vec<Mode> {
    modes(&system.model, &bind(system), range, true).unwrap()
}

#[test]
fn a_uniform_fixed_free_chain_has_its_closed_form() {
    let (n, k, m) = (40, 3e4, 0.2);
    let all = run(&system(chain(&vec![m; n]), &[("linear_stiffness", &format!("c0-{}.x", n - 1), &[k])]), Range::Lowest(n));
    assert_eq!(all.len(), n);
    for (r, mode) in all.iter().enumerate() {
        let exact = 2.0 * (k / m).sqrt() * ((2 * r + 1) as f64 * PI / (4 * n + 2) as f64).sin() / TAU;
        assert!((mode.frequency_hz / exact - 1.0).abs() < 1e-12, "{r}: {} {exact}", mode.frequency_hz);
        assert!(mode.damping.abs() < 1e-14);
        // Undamped frequencies go with the square root of the stiffness.
        assert!((mode.frequency_slope(0) * 2.0 * k / exact - 1.0).abs() < 1e-11, "{}", mode.frequency_slope(0));
    }
}

#[test]
fn dampers_in_proportion_to_the_springs_have_closed_form_damping() {
    let (n, k, m, c) = (8, 1e5, 0.1, 4.0);
    let all = run(&system(chain(&vec![m; n]), &[("linear_stiffness", "c0-7.x", &[k]), ("viscous", "c0-7.x", &[c])]), Range::Lowest(n));
    for (r, mode) in all.iter().enumerate() {
        let w = 2.0 * (k / m).sqrt() * ((2 * r + 1) as f64 * PI / (4 * n + 2) as f64).sin();
        // |s| = w and zeta = c w / (2 k), as long as it is below 1.
        assert!((mode.lambda.norm() / w - 1.0).abs() < 1e-12 && (mode.damping / (0.5 * c * w / k) - 1.0).abs() < 1e-11, "{r} {mode:?}");
        assert!((mode.damping_slope(1) / (0.5 * w / k) - 1.0).abs() < 1e-10, "{r}");
    }
}

/// What is asked for bit by bit is what is asked for at once, and no start is tried twice.
#[test]
fn modes_that_are_asked_for_later_join_those_that_were_found() {
    let (n, k, m) = (12, 1e5, 0.1);
    let system = system(
        chain(&vec![m; n]),
        &[
            ("linear_stiffness", "c0-11.x", &[k]),
            ("viscous", "c0-3.x", &[3.0]),
            ("viscous", "c7.x", &[6.0]),
            ("maxwell", "c5.x", &[2e4, 1e-3]),
        ],
    );
    let bound = bind(&system);
    let at_once = run(&system, Range::Lowest(9));
    let mut modes = Modes::new(&system.model, &bound, Range::Lowest(2), true).unwrap();
    let first = modes.lowest(2).unwrap();
    assert_eq!((first.len(), modes.tried), (2, 4));
    let all = modes.lowest(9).unwrap();
    assert_eq!((all.len(), modes.tried), (9, 11));
    for (a, b) in all.iter().zip(&at_once).chain(first.iter().zip(&at_once)) {
        assert!((a.lambda - b.lambda).norm() < 1e-11 * b.lambda.norm(), "{} {}", a.lambda, b.lambda);
        assert_eq!(a.dlambda.len(), bound.n_free);
        for (x, y) in a.dlambda.iter().zip(&b.dlambda) {
            assert!((x - y).norm() < 1e-8 * y.norm().max(1e-12 * b.lambda.norm()), "{x} {y}");
        }
    }
    assert_eq!(modes.lowest(100).unwrap().len(), n);
    assert_eq!(modes.lowest(3).unwrap().len(), 3);
}

#[test]
fn modes_with_unlike_dampers_are_those_of_the_state_space() {
    let masses = [0.4, 0.3, 0.5, 0.2, 0.6];
    let pairs = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (0, 5)];
    let (k, c) = ([3000.0, 2000.0, 2500.0, 1800.0, 4000.0, 900.0], [2.0, 9.0, 0.5, 6.0, 1.0, 4.0]);
    let names: Vec<String> = (0..6).map(|e| format!("c{e}.x")).collect();
    let (ks, cs): (Vec<[f64; 1]>, Vec<[f64; 1]>) = (k.map(|k| [k]).into(), c.map(|c| [c]).into());
    let mut effects: Vec<(&str, &str, &[f64])> = vec![];
    for e in 0..6 {
        effects.push(("linear_stiffness", &names[e], &ks[e]));
        effects.push(("viscous", &names[e], &cs[e]));
    }
    let all = run(&system(graph(&masses, &pairs), &effects), Range::Lowest(5));
    let mut a = DMatrix::<f64>::zeros(10, 10);
    for i in 0..5 {
        a[(i, 5 + i)] = 1.0;
    }
    for (e, (f, t)) in pairs.iter().enumerate() {
        for (i, si) in [(*t, 1.0), (*f, -1.0)] {
            for (j, sj) in [(*t, 1.0), (*f, -1.0)] {
                if i > 0 && j > 0 {
                    a[(4 + i, j - 1)] -= si * sj * k[e] / masses[i - 1];
                    a[(4 + i, 4 + j)] -= si * sj * c[e] / masses[i - 1];
                }
            }
        }
    }
    let mut exact: Vec<Complex64> = a.complex_eigenvalues().iter().map(|s| Complex64::new(s.re, s.im)).filter(|s| s.im > 0.0).collect();
    exact.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
    assert_eq!(exact.len(), 5);
    for (mode, exact) in all.iter().zip(&exact) {
        assert!((mode.lambda - exact).norm() < 1e-11 * exact.norm(), "{} {exact}", mode.lambda);
    }
}

#[test]
fn repeated_frequencies_are_found_as_often_as_they_occur() {
    // Two equal oscillators beside each other, joined by nothing but the ground, and a third with the double frequency.
    let model = graph(&[1.0, 1.0, 1.0], &[(0, 1), (0, 2), (0, 3)]);
    let all = run(&system(model, &[("linear_stiffness", "c0-1.x", &[100.0]), ("linear_stiffness", "c2.x", &[400.0])]), Range::Lowest(3));
    let expect = [10.0, 10.0, 20.0];
    for (mode, w) in all.iter().zip(expect) {
        assert!((mode.lambda - Complex64::new(0.0, w)).norm() < 1e-11, "{}", mode.lambda);
    }
    let cross: Complex64 = all[0].shape.iter().zip(&all[1].shape).map(|(a, b)| a * b).sum();
    assert!(cross.norm() < 1e-9, "independent shapes: {cross}");
    // Unlike dampers part the two: neither is lost.
    let model = graph(&[1.0, 1.0], &[(0, 1), (0, 2)]);
    let all = run(
        &system(model, &[("linear_stiffness", "c0-1.x", &[100.0]), ("viscous", "c0.x", &[0.2]), ("viscous", "c1.x", &[0.6])]),
        Range::Lowest(2),
    );
    let mut damping: Vec<f64> = all.iter().map(|m| m.damping).collect();
    damping.sort_by(f64::total_cmp);
    assert!((damping[0] - 0.01).abs() < 1e-12 && (damping[1] - 0.03).abs() < 1e-12, "{damping:?}");
}

#[test]
fn a_free_chain_has_its_rigid_body_mode() {
    let (n, k, m) = (6, 1e4, 0.5);
    let model = graph(&vec![m; n], &(1..n).map(|k| (k, k + 1)).collect::<Vec<_>>());
    let all = run(&system(model, &[("linear_stiffness", "c0-4.x", &[k]), ("viscous", "c0-4.x", &[1.0])]), Range::Lowest(n));
    assert_eq!((all.len(), all[0].lambda), (n, Complex64::ZERO));
    let first = all[0].shape[0];
    assert!(all[0].shape.iter().all(|x| (x - first).norm() < 1e-9 * first.norm()) && (first.norm_sqr() * m * n as f64 - 1.0).abs() < 1e-9);
    for (r, mode) in all.iter().enumerate().skip(1) {
        let w = 2.0 * (k / m).sqrt() * (r as f64 * PI / (2 * n) as f64).sin();
        assert!((mode.lambda.norm() / w - 1.0).abs() < 1e-11 && (mode.damping / (0.5 * w / k) - 1.0).abs() < 1e-9, "{r} {mode:?}");
    }
    assert!(modes(&system(chain(&[1.0]), &[]).model, &bind(&system(chain(&[1.0]), &[])), Range::Band(2.0, 1.0), false).is_err());
}

/// Every law with a small-signal limit, a massless body among the others.
fn mixed() -> System {
    system(
        chain(&[0.4, 0.0, 0.5, 0.3]),
        &[
            ("linear_stiffness", "c0.x", &[3000.0]),
            ("linear_stiffness", "c1.x", &[2000.0]),
            ("linear_stiffness", "c2-3.x", &[2500.0]),
            ("viscous", "c0-3.x", &[0.8]),
            ("maxwell", "c0.x", &[500.0, 0.02]),
            ("elastic_slip", "c1.x", &[1.2, 4e-4]),
            ("structural_damping", "c2.x", &[150.0, 5.0, 40.0, 3.0]),
            ("film", "c3.x", &[0.5, 0.02, 2e-4]),
            ("support_compliance", "c3.x", &[4e-5]),
        ],
    )
}

#[test]
fn modes_of_frequency_dependent_laws_are_roots_and_their_slopes_the_differences() {
    let base = mixed();
    let free = base.free();
    let all = run(&base, Range::Lowest(3));
    assert_eq!(all.len(), 3);
    for mode in &all {
        // The determinant of a chain by its own recurrence, independent of the solver: it vanishes next to its slope.
        let determinant = |s: Complex64| {
            let z: Vec<Complex64> = bind(&base).elements.iter().map(|e| e.stiffness(s, &mut vec![]).unwrap().0).collect();
            let mass = [0.4, 0.0, 0.5, 0.3];
            let diagonal = |i: usize| s * s * mass[i] + z[i] + z.get(i + 1).copied().unwrap_or(Complex64::ZERO);
            let (mut before, mut now) = (Complex64::ONE, diagonal(0));
            for i in 1..4 {
                (before, now) = (now, diagonal(i) * now - z[i] * z[i] * before);
            }
            now
        };
        let h = 1e-6 * mode.lambda.norm();
        let slope = (determinant(mode.lambda + h) - determinant(mode.lambda - h)) / (2.0 * h);
        let miss = (determinant(mode.lambda) / slope).norm() / mode.lambda.norm();
        assert!(miss < 1e-12, "{miss:.2e} at {}", mode.lambda);
    }
    let mut worst = 0.0f64;
    for (k, f) in free.iter().enumerate() {
        let value = base.instances[f.instance].params[f.param].value;
        let h = if f.log { 1e-5 } else { 1e-5 * value };
        let at = |h: f64| {
            let mut moved = base.clone();
            moved.instances[f.instance].params[f.param].value = if f.log { value * h.exp() } else { value + h };
            run(&moved, Range::Lowest(3))
        };
        let (up, down) = (at(h), at(-h));
        for (r, mode) in all.iter().enumerate() {
            let check = |numeric: f64, analytic: f64, size: f64| {
                // What a parameter hardly moves is lost in the differences.
                let gap = (numeric - analytic).abs() / (numeric.abs() + 1e-5 * size);
                assert!(gap < 1e-6, "{} mode {r}: {numeric} {analytic}", f.name);
                gap
            };
            let unit = if f.log { 1.0 } else { value };
            let frequency = (up[r].frequency_hz - down[r].frequency_hz) / (2.0 * h);
            let damping = (up[r].damping - down[r].damping) / (2.0 * h);
            worst = worst.max(check(frequency * unit, mode.frequency_slope(k) * unit, mode.frequency_hz));
            worst = worst.max(check(damping * unit, mode.damping_slope(k) * unit, 1.0));
        }
    }
    println!("worst {worst:.1e}");
}

#[test]
fn a_band_holds_the_modes_in_it_and_a_rigid_law_is_refused() {
    let base = mixed();
    let all = run(&base, Range::Lowest(3));
    let band = run(&base, Range::Band(all[1].frequency_hz * 0.99, all[1].frequency_hz * 1.01));
    assert_eq!(band.len(), 1);
    assert!((band[0].lambda - all[1].lambda).norm() < 1e-11 * band[0].lambda.norm());
    let rigid = system(chain(&[1.0]), &[("linear_stiffness", "c0.x", &[100.0]), ("coulomb", "c0.x", &[1.0])]);
    let refused = modes(&rigid.model, &bind(&rigid), Range::Lowest(1), false);
    assert!(matches!(refused, Err(EngineError::Effect(_))), "{refused:?}");
}

/// Natural frequencies of n bodies of 1 kg between two walls on springs of 1 N/m, with this part of their mass between them [rad/s].
fn frequencies(n: usize, part: f64) -> Vec<f64> {
    let bodies: Vec<Body> =
        std::iter::once(Body::fixed("ground")).chain((1..=n).map(|k| Body::new(&format!("m{k}"), 1.0, &[Axis::X]))).collect();
    let name = |k: usize| if k == 0 || k > n { "ground".to_string() } else { format!("m{k}") };
    let ends: Vec<(String, String, String)> = (0..=n).map(|k| (format!("c{k}"), name(k), name(k + 1))).collect();
    let ends: Vec<(&str, &str, &str)> = ends.iter().map(|(c, a, b)| (c.as_str(), a.as_str(), b.as_str())).collect();
    let list = |of: &dyn Fn(usize) -> String, from: usize| (from..=n).map(of).collect::<Vec<_>>().join(", ");
    let (springs, nodes) = (list(&|k| format!("c{k}.x"), 0), list(&|k| format!("m{k}.x"), 1));
    let mut system = System::new(Model::joined(bodies, &ends).unwrap()).and("linear_stiffness", &springs, &[("k", 1.0)]).unwrap();
    if part > 0.0 {
        system =
            system.and("inertia_deviation", &springs, &[("part", part)]).unwrap().and("node_deviation", &nodes, &[("m", 0.0)]).unwrap();
    }
    let bound = Bound::new(&system, &[], "", &Default::default()).unwrap();
    modes(&system.model, &bound, Range::Lowest(n / 2), false).unwrap().iter().map(|m| 2.0 * PI * m.frequency_hz).collect()
}

/// Against the closed forms of a chain of r times as many bodies between the walls, `2 r sin(theta / r)`, and of a bar, `2 theta`, with
/// `theta = j pi / (2 (n + 1))`, up to half of the declared chain's modes.
#[test]
fn it_makes_a_coarse_chain_one_of_more_bodies_or_a_bar() {
    let n = 12;
    let plain = frequencies(n, 0.0);
    let off = |found: f64, exact: f64| (found / exact - 1.0).abs();
    for (bodies, part, within) in [(2.0, 0.5, 1e-9), (3.0, 16.0 / 27.0, 1e-3), (f64::INFINITY, 2.0 / 3.0, 2e-3)] {
        let found = frequencies(n, part);
        for j in 0..n / 2 {
            let theta = (j + 1) as f64 * PI / (2.0 * (n + 1) as f64);
            let exact = if bodies.is_finite() { 2.0 * bodies * (theta / bodies).sin() } else { 2.0 * theta };
            assert!(off(found[j], exact) < within, "{bodies} {j}: {} {exact}", found[j]);
            assert!(off(plain[j], exact) > 0.1 * theta * theta, "{bodies} {j}");
        }
    }
}
