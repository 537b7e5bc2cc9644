//! Elements: condensation of series effects against differences.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use crate::effect::dispatch::INPUTS;
use crate::effect::{Inputs, find};

use super::*;

fn one_place(effects: &[(&str, &[f64])]) -> System {
    let body = |name: &str, free: Vec<Axis>| Body { name: name.into(), mass: 0.0, inertia: 0.0, free };
    let model = Model::new(vec![body("ground", vec![]), body("end", vec![Axis::X])], vec![Connector { name: "c1".into(), from: 0, to: 1 }])
        .unwrap();
    let instances = effects
        .iter()
        .map(|(name, p)| {
            let effect = find(name).unwrap();
            let params = effect.info().params.iter().zip(*p).map(|(i, v)| ParamValue::free(*v, i.sign)).collect();
            Instance::new(effect, "c1.x", Site::Places(vec![0]), params)
        })
        .collect();
    System { model, instances }
}

#[test]
fn elements_with_openings_have_exact_tangents() {
    let sets: [&[(&str, &[f64])]; 4] = [
        &[("linear_stiffness", &[1.0]), ("support_compliance", &[0.5])],
        &[("linear_stiffness", &[1.0]), ("viscous", &[0.3]), ("support_compliance", &[0.5]), ("backlash", &[0.4, 0.2])],
        &[("elastic_slip", &[0.5, 0.2]), ("film", &[0.4, 0.3, 0.1]), ("backlash", &[0.4, 0.2]), ("linear_stiffness", &[0.2])],
        &[
            ("maxwell", &[0.5, 0.2]),
            ("support_compliance", &[0.5]),
            ("cubic_stiffness", &[0.5]),
            ("structural_damping", &[0.2, 0.1, 10.0, 0.7]),
        ],
    ];
    for set in sets {
        let system = one_place(set);
        let free = system.free();
        let bound = |s: &System| Bound::new(s, &free, "t", &BTreeMap::new()).unwrap();
        let base = bound(&system);
        let element = &base.elements[0];
        let (ns, dt) = (element.n_states(), 0.02);
        let mut s = vec![0.0; ns];
        let (mut out, mut scratch) = (Sensed::default(), ElementScratch::default());
        let x = |t: f64| t.sin() + 0.3 * (2.7 * t).sin();
        for k in 1..300 {
            let t = k as f64 * dt;
            let u = Inputs { x: x(t), v: t.cos() + 0.81 * (2.7 * t).cos(), a: 0.0, dx: x(t) - x(t - dt) };
            let old = s.clone();
            let mut value_states = old.clone();
            let value = element.value(&u, dt, &mut value_states, &mut scratch);
            element.tangent(&u, dt, &mut s, &mut [], Depth::Params, &mut out, &mut scratch);
            assert!((value - out.f).abs() < 1e-12 && value_states.iter().zip(&s).all(|(a, b)| (a - b).abs() < 1e-12), "step {k}");
            if k % 11 != 0 {
                continue;
            }
            for column in 0..INPUTS + ns + free.len() {
                let h = 1e-6;
                let at = |h: f64| {
                    let (mut u, mut s, mut system) = (u, old.clone(), system.clone());
                    match column {
                        0 => u.x += h,
                        1 => u.v += h,
                        2 => u.a += h,
                        3 => u.dx += h,
                        c if c < INPUTS + ns => s[c - INPUTS] += h,
                        c => {
                            let f = &free[c - INPUTS - ns];
                            system.instances[f.instance].params[f.param].value += h;
                        }
                    }
                    let f = bound(&system).elements[0].value(&u, dt, &mut s, &mut ElementScratch::default());
                    [vec![f], s].concat()
                };
                let (up, down) = (at(h), at(-h));
                for row in 0..=ns {
                    // Parameters stand in the element in another order than among the free ones.
                    let analytic = if column < INPUTS + ns {
                        out.row(row)[column]
                    } else {
                        let k = column - INPUTS - ns;
                        let p = element.chains.iter().position(|c| c.iter().any(|(f, _)| *f == k)).unwrap();
                        out.params(row)[p]
                    };
                    let numeric = (up[row] - down[row]) / (2.0 * h);
                    assert!(
                        (analytic - numeric).abs() < 1e-6 * (1.0 + numeric.abs()),
                        "{set:?} step {k} row {row} column {column}: {analytic} {numeric}"
                    );
                }
            }
        }
    }
}

#[test]
fn an_opening_of_zero_is_no_series_effect() {
    let with =
        one_place(&[("linear_stiffness", &[1.0]), ("viscous", &[0.3]), ("elastic_slip", &[0.5, 0.2]), ("support_compliance", &[0.0])]);
    let without = one_place(&[("linear_stiffness", &[1.0]), ("viscous", &[0.3]), ("elastic_slip", &[0.5, 0.2])]);
    let bind = |s: &System| Bound::new(s, &[], "t", &BTreeMap::new()).unwrap();
    let (a, b) = (bind(&with), bind(&without));
    let (mut s, mut t) = (vec![0.0; 3], vec![0.0; 1]);
    let mut scratch = ElementScratch::default();
    for k in 1..100 {
        let x = |k: usize| (0.1 * k as f64).sin();
        let u = Inputs { x: x(k), v: 0.3, a: 0.0, dx: x(k) - x(k - 1) };
        assert_eq!(a.elements[0].value(&u, 0.1, &mut s, &mut scratch), b.elements[0].value(&u, 0.1, &mut t, &mut scratch));
    }
}

#[test]
fn places_are_named_and_ranges_resolved() {
    let model = one_place(&[]).model;
    assert_eq!(model.places_at("c1.x").unwrap(), vec![0]);
    for (at, said) in [("c2.x", "c1.x"), ("c1.y", "c1.x"), ("c1-9.x", "c9.x"), ("c1", "no axis"), ("c1.q", "axis")] {
        let error = model.places_at(at).unwrap_err();
        assert!(format!("{error} {error:?}").contains(said), "{at}: {error:?}");
    }
}

#[test]
fn a_law_finds_what_it_acts_on_where_instances_come_and_go() {
    let mut system = one_place(&[("viscous", &[0.3]), ("linear_stiffness", &[1.0]), ("cubic_stiffness", &[0.5])]);
    let law = find("linear_law").unwrap();
    let unit = crate::units::Unit::si(crate::units::Dimension::LENGTH);
    let target = Target { instances: vec![1], param: 0, condition: "i".into(), reference: 0.0, unit };
    let params = law.info().params.iter().map(|p| ParamValue::fixed(p.default)).collect();
    system.instances.push(Instance { target: Some(target), ..Instance::new(law, "c1.x", Site::Places(vec![0]), params) });
    let on = |s: &System| s.instances[s.instances.last().unwrap().target.as_ref().unwrap().instances[0]].name();
    assert_eq!(on(&system), "linear_stiffness");
    let fewer = system.without(0).unwrap();
    assert_eq!((fewer.instances.len(), on(&fewer)), (3, "linear_stiffness"));
    assert_eq!(on(&system.without(2).unwrap()), "linear_stiffness");
    let more = fewer.with(0, vec![system.instances[0].clone(), system.instances[0].clone()]);
    assert_eq!((more.instances.len(), on(&more)), (5, "linear_stiffness"));
    // What is acted on cannot be taken from under it.
    assert!(system.without(1).is_none());
}

/// A film whose force scale follows a condition gives way to an elastic slip, whose limit follows it then; to a law without such a parameter it cannot.
#[test]
fn a_law_is_exchanged_with_what_acts_on_it() {
    let mut system = one_place(&[("linear_stiffness", &[1.0]), ("film", &[0.4, 0.3, 0.1])]);
    let unit = crate::units::Unit::si(crate::units::Dimension::LENGTH);
    let target = Target { instances: vec![1], param: 0, condition: "i".into(), reference: 0.0, unit };
    let law = find("interference_law").unwrap();
    let params = law.info().params.iter().map(|_| ParamValue::fixed(1.0)).collect();
    system.instances.push(Instance { target: Some(target), ..Instance::new(law, "c1.x", Site::Places(vec![0]), params) });
    let other = |name: &str, values: &[f64]| one_place(&[(name, values)]).instances.remove(0);
    let exchanged = system.exchanged(1, other("elastic_slip", &[0.5, 0.2])).unwrap();
    assert_eq!((exchanged.instances.len(), exchanged.instances[1].name()), (3, "elastic_slip"));
    let scaled = exchanged.instances[2].target.as_ref().unwrap();
    assert_eq!((scaled.instances.as_slice(), elastic(scaled.param)), ([1].as_slice(), "f"));
    assert!(system.exchanged(1, other("viscous", &[0.5])).is_none());
    assert!(system.exchanged(7, other("viscous", &[0.5])).is_none());
}

fn elastic(param: usize) -> &'static str {
    find("elastic_slip").unwrap().info().params[param].name
}

#[test]
fn structural_damping_without_storage_stands_at_the_frequency_of_the_drive() {
    let system = one_place(&[("linear_stiffness", &[500.0]), ("structural_damping", &[40.0, 0.01, 1e4, -2.0])]);
    let free = system.free();
    let bound = || Bound::new(&system, &free, "t", &BTreeMap::new()).unwrap();
    let f_ref = free.iter().position(|f| f.name.ends_with("f_ref")).unwrap();
    let stands = |b: &Bound| b.elements[0].chains.iter().flatten().any(|c| c.0 == f_ref);
    assert!(stands(&bound()) && !stands(&bound().driven_at(30.0)));
    let stored = |bound: &Bound, f: f64| {
        let (steps, mut s, mut scratch) = (2000, vec![0.0; bound.elements[0].n_states()], ElementScratch::default());
        let dt = 1.0 / (f * steps as f64);
        let x = |k: usize| (TAU * f * dt * k as f64).sin();
        // A cycle that begins anew from states that a slow branch has not forgotten: the last of many.
        let mut sum = 0.0;
        for k in 1..=40 * steps {
            let u = Inputs { x: x(k), dx: x(k) - x(k - 1), ..Inputs::default() };
            let force = bound.elements[0].value(&u, dt, &mut s, &mut scratch);
            sum += if k > 39 * steps { 2.0 * force * u.x / steps as f64 } else { 0.0 };
        }
        sum
    };
    for f in [0.5, 2.0, 30.0] {
        let stored = stored(&bound().driven_at(f), f);
        assert!((stored - 500.0).abs() < 0.2, "{f} Hz: {stored}");
    }
    assert!(stored(&bound(), 30.0) > 550.0, "by itself it stands at 2 Hz");
}
