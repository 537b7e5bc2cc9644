//! Implicit steps of 22 rigid parts with large rotations and one nonlinear effect, for benches/peers/march.py: `march22 STEPS [linear]`
//! prints {microseconds_per_step, end: [x, y of part 11, y of part 22]}.
//!
//! The chain is that of benches/peers/chain22.py (Table 4 of the paper on a pin and a closed shelf), with rotational dampers and a constant
//! force on part 11, marched through 12 ms; the nonlinear effect is friction (elastic slip) in bending at connector 2.

use std::collections::BTreeMap;
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Instant;

use misfit::effect::find;
use misfit::engine::march::{Loads, March};
use misfit::model::space::{Arc, Curve, Section, Space};
use misfit::model::{Axis, Body, Bound, Connector, Instance, Model, ModelError, ParamValue, Site, System};
use serde_json::json;

const N: usize = 22;
const DEGREE: f64 = PI / 180.0;
const TAU: f64 = 2e-5;
const DURATION: f64 = 0.012;
const FORCE: f64 = 60.0;

fn tensioner(friction: bool) -> Result<System, Box<dyn Error>> {
    let turn = |radius: f64, degrees: f64| Arc::Turn { radius, angle: degrees * DEGREE };
    let curve = Curve { start: [0.0; 3], heading: FRAC_PI_2, arcs: vec![turn(0.15, 12.0), turn(0.06, 35.0), turn(0.12, 18.0)] };
    let (mut parts, frames) = curve.parts(N, Some(&Section { width: 0.020, thickness: 0.009, density: 3200.0 }));
    for (k, at) in [(0, curve.start), (N - 1, curve.at(curve.length()).0)] {
        parts[k].centre = std::array::from_fn(|i| parts[k].origin[i] - at[i]);
        parts[k].origin = at;
    }
    let free = |k: usize| match k {
        0 => vec![Axis::Psi],
        k if k == N - 1 => vec![Axis::Y, Axis::Psi],
        _ => Axis::ALL.to_vec(),
    };
    let bodies = (0..N).map(|k| Body { name: format!("b{}", k + 1), mass: 0.0, inertia: 0.0, free: free(k) }).collect();
    let connectors = (1..N).map(|k| Connector { name: format!("GF{k}"), from: k - 1, to: k }).collect();
    let model = Model::spatial(bodies, connectors, Space { parts, frames, stems: vec![] })?;
    let mut instances = Vec::new();
    let mut put = |name: &str, at: String, values: &[f64]| -> Result<(), Box<dyn Error>> {
        let effect = find(name)?;
        let params = effect.info().params.iter().zip(values).map(|(p, v)| ParamValue::of(p, *v)).collect();
        let site = Site::Places(model.places_at(&at)?);
        instances.push(Instance::new(effect, at, site, params));
        Ok(())
    };
    for (group, ky, psi) in [("1-3", 3.6e9, 1.49), ("4-18", 4.2e9, 1.96), ("19-21", 3.0e9, 1.49)] {
        let k = [3e10, ky, 9e10, 1000.0 / DEGREE, 2.5 / DEGREE, psi / DEGREE];
        for (axis, k) in Axis::ALL.iter().zip(k) {
            put("linear_stiffness", format!("GF{group}.{}", axis.name()), &[k])?;
            if axis.rotational() {
                put("viscous", format!("GF{group}.{}", axis.name()), &[k * TAU])?;
            }
        }
    }
    if friction {
        put("elastic_slip", "GF2.psi".into(), &[0.3, 0.005])?;
    }
    Ok(System { model, instances })
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let steps: usize = arguments.next().unwrap_or("1000".into()).parse()?;
    let system = tensioner(arguments.next().is_none())?;
    let missing = |name: &str| ModelError::no_such("degree of freedom", name, []);
    let dof = |name: &str| system.model.dof(name).ok_or_else(|| missing(name));
    let bound = Bound::new(&system, &[], "t", &BTreeMap::new())?;
    let loads = Loads { dt: DURATION / steps as f64, prescribed: vec![], forces: vec![(dof("b11.x")?, vec![FORCE; steps + 1])] };
    let mut march = March::new(&system.model, &bound, &loads, 0.7)?;
    let mut state = march.rest(0);
    let start = Instant::now();
    for k in 1..=steps {
        march.step(k, &mut state, 0)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let end = [dof("b11.x")?, dof("b11.y")?, dof("b22.y")?].map(|d| state.q[d]);
    println!("{}", json!({ "microseconds_per_step": seconds * 1e6 / steps as f64, "end": end }));
    Ok(())
}
