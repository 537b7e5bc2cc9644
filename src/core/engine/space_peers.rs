//! The chain of 22 rigid parts against Exudyn 1.13: `benches/peers/multibody.py` builds the same chain there and prints the numbers.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};

use crate::effect::find;
use crate::model::space::{Arc, Curve, Part, Section, Space};
use crate::model::{Axis, Body, Bound, Connector, Instance, Level, Load, Model, ParamValue, Site, System};

use super::equilibrium::equilibrium;
use super::march::{Loads, March};
use super::modal::{Range, modes};

const N: usize = 22;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// 22 parts along three arcs with the stiffness of the paper's Table 4, on a pin at the start and a closed shelf at the end; rotational
/// dampers of `tau` [s] times the stiffness.
pub(super) fn tensioner(tau: f64) -> System {
    let turn = |radius: f64, degrees: f64| Arc::Turn { radius, angle: degrees * DEGREE };
    let curve = Curve { start: [0.0; 3], heading: FRAC_PI_2, arcs: vec![turn(0.15, 12.0), turn(0.06, 35.0), turn(0.12, 18.0)] };
    let (mut parts, frames) = curve.parts(N, Some(&Section { width: 0.020, thickness: 0.009, density: 3200.0 }));
    // The first part turns about the pin, the last one slides with its end.
    let ends = [(0, curve.start), (N - 1, curve.at(curve.length()).0)];
    for (k, at) in ends {
        let part: &mut Part = &mut parts[k];
        part.centre = std::array::from_fn(|i| part.origin[i] - at[i]);
        part.origin = at;
    }
    let free = |k: usize| match k {
        0 => vec![Axis::Psi],
        k if k == N - 1 => vec![Axis::Y, Axis::Psi],
        _ => Axis::ALL.to_vec(),
    };
    let bodies = (0..N).map(|k| Body { name: format!("b{}", k + 1), mass: 0.0, inertia: 0.0, free: free(k) }).collect();
    let connectors = (1..N).map(|k| Connector { name: format!("GF{k}"), from: k - 1, to: k }).collect();
    let model = Model::spatial(bodies, connectors, Space { parts, frames, stems: vec![] }).unwrap();
    assert_eq!(model.dofs.len(), 123);
    let mut instances = Vec::new();
    let mut put = |name: &str, at: String, value: f64| {
        let effect = find(name).unwrap();
        let params = effect.info().params.iter().map(|p| ParamValue::free(value, p.sign)).collect();
        let site = Site::Places(model.places_at(&at).unwrap());
        instances.push(Instance::new(effect, at, site, params));
    };
    for (group, ky, psi) in [("1-3", 3.6e9, 1.49), ("4-18", 4.2e9, 1.96), ("19-21", 3.0e9, 1.49)] {
        let k = [3e10, ky, 9e10, 1000.0 / DEGREE, 2.5 / DEGREE, psi / DEGREE];
        for (axis, k) in Axis::ALL.iter().zip(k) {
            put("linear_stiffness", format!("GF{group}.{}", axis.name()), k);
            if axis.rotational() && tau > 0.0 {
                put("viscous", format!("GF{group}.{}", axis.name()), k * tau);
            }
        }
    }
    System { model, instances }
}

fn bind(system: &System) -> Bound {
    Bound::new(system, &[], "t", &BTreeMap::new()).unwrap()
}

fn close(found: &[f64], exudyn: &[f64], tolerance: f64) {
    for (a, b) in found.iter().zip(exudyn) {
        assert!((a / b - 1.0).abs() < tolerance, "{found:?}\n{exudyn:?}");
    }
}

fn read(system: &System, q: &[f64]) -> [f64; 3] {
    ["b11.x", "b11.y", "b22.y"].map(|d| q[system.model.dof(d).unwrap()])
}

/// Frequencies of the lowest modes in the plane.
fn in_plane(system: &System, count: usize) -> Vec<f64> {
    let model = &system.model;
    let found = modes(model, &bind(system), Range::Lowest(count + 4), false).unwrap();
    let share = |shape: &[num_complex::Complex64]| {
        let sum = |flat: bool| -> f64 {
            let here = model.dofs.iter().zip(shape).filter(|(d, _)| matches!(d.axis, Axis::X | Axis::Y | Axis::Psi) == flat);
            here.map(|(d, x)| d.mass * x.norm_sqr()).sum()
        };
        sum(true) > sum(false)
    };
    found.iter().filter(|m| share(&m.shape)).map(|m| m.frequency_hz).take(count).collect()
}

#[test]
fn frequencies_and_deflections_are_those_of_the_peers() {
    let rest = modes(&tensioner(0.0).model, &bind(&tensioner(0.0)), Range::Lowest(6), false).unwrap();
    let rest: Vec<f64> = rest.iter().map(|m| m.frequency_hz).collect();
    let exudyn = [158.14120703968032, 543.0058652850962, 1149.6683484073437, 1995.0323364862086, 2136.9149005343374, 3040.7654897999655];
    println!("at rest {rest:?} Hz, Exudyn {exudyn:?}");
    close(&rest, &exudyn, 1e-6);
    // Force, deflections by Exudyn, frequencies in the plane of links that do not stretch by plane_chain.py.
    let cases: [(f64, [f64; 3], [f64; 4]); 3] = [
        (
            80.0,
            [0.0018494615069816686, 0.00016275996298549533, -0.002539101146058889],
            [161.5029584678591, 560.1625545582358, 1167.5461953927752, 2013.1805748071583],
        ),
        (
            138.3,
            [0.002994164866428079, 0.0002056513227665993, -0.004363100334340966],
            [163.83216964195552, 573.0861869715379, 1183.5785033209158, 2029.1434429853457],
        ),
        (
            -138.3,
            [-0.0039695149016285985, -0.0007040113883699517, 0.004089994877462352],
            [151.45745677700037, 523.2206965684288, 1135.256771381511, 1978.593598260556],
        ),
    ];
    let at_rest = [158.14269313166358, 543.0931976589709, 1150.0310228847143, 1995.780565678263];
    let unloaded = in_plane(&tensioner(0.0), 4);
    for (force, deflection, frequencies) in cases {
        let mut system = tensioner(0.0);
        let dof = system.model.dof("b11.x").unwrap();
        system.model.loads.push(Load { dof, path: vec![Level::Value(force)], steps: 10 });
        let at = equilibrium(&system.model, &bind(&system), &[], 0).unwrap().unwrap();
        println!("{force} N: {:?} m, Exudyn {deflection:?}", read(&system, &at.state.q));
        close(&read(&system, &at.state.q), &deflection, 1e-5);
        // What stretch does to the frequencies is the same at every load: their ratios to those at rest are compared.
        let found: Vec<f64> = in_plane(&system, 4).iter().zip(&unloaded).map(|(a, b)| a / b).collect();
        let exact: Vec<f64> = frequencies.iter().zip(&at_rest).map(|(a, b)| a / b).collect();
        println!("{force} N: {found:?}, plane chain {exact:?}");
        close(&found, &exact, 1e-4);
    }
}

fn march(steps: usize) -> (Vec<[f64; 3]>, std::time::Duration) {
    let system = tensioner(2e-5);
    let bound = bind(&system);
    let duration = 0.012;
    let push = |t: f64| 138.3 * (TAU * t / duration).sin().powi(2) * if t < 0.5 * duration { 1.0 } else { -1.0 };
    let path = (0..=steps).map(|k| push(duration * k as f64 / steps as f64)).collect();
    let loads = Loads { dt: duration / steps as f64, prescribed: vec![], forces: vec![(system.model.dof("b11.x").unwrap(), path)] };
    let mut march = March::new(&system.model, &bound, &loads, 0.7).unwrap();
    let mut state = march.rest(0);
    let mut all = Vec::new();
    let start = std::time::Instant::now();
    for k in 1..=steps {
        march.step(k, &mut state, 0).unwrap();
        if (k * 12) % steps == 0 {
            all.push(read(&system, &state.q));
        }
    }
    (all, start.elapsed())
}

#[test]
fn a_transient_with_large_rotations_is_that_of_exudyn() {
    let steps = 2400;
    let (found, time) = march(steps);
    // Exudyn with 9600 steps, every millisecond.
    let exudyn: [[f64; 3]; 12] = [
        [8.390944875871775e-05, 1.7433506800688947e-05, -9.523648381733196e-05],
        [0.0009441229516078588, 0.00012068859508432284, -0.0012259185011116863],
        [0.002965972290701939, 0.00021561095998200858, -0.0043336693310470215],
        [0.004649884379030517, 0.0001160479668688083, -0.007451573375108503],
        [0.004201826338506245, 0.00011970648343169465, -0.006585728776399805],
        [0.0008288493116382963, 9.437556954351028e-05, -0.0011303927227662713],
        [-0.0037444930515258407, -0.0006222113585303835, 0.003909916384386952],
        [-0.006037217434169944, -0.0012491162698631125, 0.005651674663939774],
        [-0.005572761245744937, -0.0011086945021615002, 0.005315039618947526],
        [-0.0036076728531717513, -0.0006179144053668484, 0.0037895580000819745],
        [-0.0010515360143528753, -0.00013096086434064708, 0.0012369640092852463],
        [0.0013404199169574204, 0.0001152333508277828, -0.0018186254859089424],
    ];
    let mut worst: f64 = 0.0;
    for i in 0..3 {
        let size = exudyn.iter().fold(0.0f64, |m, e| m.max(e[i].abs()));
        worst = found.iter().zip(&exudyn).fold(worst, |w, (a, b)| w.max((a[i] - b[i]).abs() / size));
    }
    println!("largest difference over the largest displacement {worst:.2e}; {:.1} us a step", time.as_secs_f64() * 1e6 / steps as f64);
    assert!(worst < 1e-4, "{worst}: {found:?}");
}
