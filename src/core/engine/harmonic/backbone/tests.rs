//! Nonlinear modes against closed forms, against the linear modes, and their slopes against differences.

use std::f64::consts::{PI, TAU};

use super::super::super::modal::{Range, modes};
use super::super::tests::{bind, fine, instance, system, with};
use super::*;
use crate::explain::Explain;
use crate::model::System;

/// Modes at these amplitudes of the displacement of a degree of freedom.
fn along(system: &System, dof: usize, which: Which, amplitudes: &[f64], slopes: bool, settings: Settings) -> Vec<NonlinearMode> {
    let bound = bind(system);
    let (row, apart) = ([(dof, 1.0)], bound.apart());
    let mut backbone = Backbone::new(&system.model, &apart, &row, which, settings).unwrap();
    amplitudes.iter().map(|x| backbone.at(*x, slopes).unwrap()).collect()
}

fn refused(system: &System, dof: usize, which: Which, amplitude: f64) -> EngineError {
    let bound = bind(system);
    let (row, apart) = ([(dof, 1.0)], bound.apart());
    let found = Backbone::new(&system.model, &apart, &row, which, Settings::default()).and_then(|mut b| b.at(amplitude, false));
    found.unwrap_err()
}

#[test]
fn a_hardening_spring_has_the_frequency_of_its_period() {
    let (m, k, c, k3) = (2.0, 800.0, 0.8, 3e5);
    let duffing = system(&[m], &[("linear_stiffness", "c0.x", &[k]), ("viscous", "c0.x", &[c]), ("cubic_stiffness", "c0.x", &[k3])]);
    let amplitudes = [1e-4, 0.01, 0.03, 0.06, 0.2];
    for (x, mode) in amplitudes.iter().zip(along(&duffing, 0, Which::Number(1), &amplitudes, false, fine(1, 64))) {
        let omega = ((k + 0.75 * k3 * x * x) / m).sqrt();
        assert!((TAU * mode.frequency_hz / omega - 1.0).abs() < 1e-9, "{x}");
        assert!((mode.damping / (c / (2.0 * m * omega)) - 1.0).abs() < 1e-8, "{x}");
    }
    // Without damping the period is an elliptic integral of the largest displacement, which is the sum of the harmonics.
    let free = system_without_damping(m, k, k3);
    let bound = bind(&free);
    let (row, apart) = ([(0, 1.0)], bound.apart());
    let mut backbone = Backbone::new(&free.model, &apart, &row, Which::Number(1), fine(15, 256)).unwrap();
    for x in amplitudes {
        let mode = backbone.at(x, false).unwrap();
        let largest: f64 = backbone.motion().unwrap().1.iter().map(|q| q[0].re).sum();
        let n = 20_000;
        let slow = |i: usize| {
            (k / m + k3 / m * largest * largest * (1.0 + (PI * (i as f64 + 0.5) / (2 * n) as f64).sin().powi(2)) / 2.0).sqrt().recip()
        };
        let period = 4.0 * PI / (2 * n) as f64 * (0..n).map(slow).sum::<f64>();
        assert!((mode.frequency_hz * period - 1.0).abs() < 1e-8, "{x}: {} {}", mode.frequency_hz, 1.0 / period);
        assert!(mode.damping.abs() < 1e-9, "{x}: {}", mode.damping);
    }
}

fn system_without_damping(m: f64, k: f64, k3: f64) -> System {
    system(&[m], &[("linear_stiffness", "c0.x", &[k]), ("cubic_stiffness", "c0.x", &[k3])])
}

#[test]
fn friction_damps_by_its_energy_per_cycle() {
    let (m, k, f) = (1.5, 6000.0, 0.2);
    // A force of constant size dissipates 4 f X a cycle, which leaves the frequency as it is.
    let rubs = system(&[m], &[("linear_stiffness", "c0.x", &[k]), ("coulomb", "c0.x", &[f, 1e-6])]);
    let amplitudes = [1e-3, 2e-3, 5e-3];
    for harmonics in [1, 15] {
        for (x, mode) in amplitudes.iter().zip(along(&rubs, 0, Which::Number(1), &amplitudes, false, fine(harmonics, 1024))) {
            let omega = (k / m).sqrt();
            let exact = 2.0 * f / (PI * m * omega * omega * x);
            // What higher harmonics change is of the second order in the damping.
            let close = if harmonics == 1 { 1e-6 } else { exact * exact };
            assert!((TAU * mode.frequency_hz / omega - 1.0).abs() < close, "{x}: {}", mode.frequency_hz);
            assert!((mode.damping / exact - 1.0).abs() < 2e-3, "{x}: {} {exact}", mode.damping);
        }
    }
    // A spring before the slider: the first harmonic of its loop (Iwan 1966).
    let (slip, d) = (0.6, 2e-4);
    let sticks = system(&[m], &[("linear_stiffness", "c0.x", &[k]), ("elastic_slip", "c0.x", &[slip, d])]);
    let amplitudes = [5e-5, 1.9e-4, 3e-4, 8e-4, 4e-3];
    for (x, mode) in amplitudes.iter().zip(along(&sticks, 0, Which::Nearest(11.0), &amplitudes, false, fine(1, 4096))) {
        let theta = if *x > d { (1.0 - 2.0 * d / x).acos() } else { PI };
        let z = num_complex::Complex64::new(theta - 0.5 * (2.0 * theta).sin(), theta.sin().powi(2)) * (slip / d / PI);
        let squared = (k + z.re) / m;
        assert!(((TAU * mode.frequency_hz).powi(2) / squared - 1.0).abs() < 2e-6, "{x}: {}", mode.frequency_hz);
        let exact = z.im / (2.0 * m * squared);
        assert!((mode.damping - exact).abs() < 3e-6 + 1e-4 * exact, "{x}: {} {exact}", mode.damping);
        // The same as 4 f (X - d) a cycle.
        let energy = if *x > d { 4.0 * slip * (x - d) } else { 0.0 };
        assert!((PI * z.im * x * x - energy).abs() < 1e-12, "{x}");
    }
}

/// Of a linear structure whose damping is proportional to its stiffness the modes are those of the eigenproblem, masses at connectors included.
#[test]
fn a_linear_structure_has_its_linear_modes_at_every_amplitude() {
    let mut chain = with(&[("added_mass", "c0.x", &[0.2])]);
    chain.instances.retain(|i| i.name() != "viscous");
    for (at, k) in [("c0.x", 3000.0), ("c1.x", 2000.0), ("c2.x", 2500.0)] {
        chain.instances.push(instance(&chain.model, "viscous", at, &[2e-4 * k]));
    }
    let linear = modes(&chain.model, &bind(&chain), Range::Lowest(3), true).unwrap();
    for (number, exact) in linear.iter().enumerate() {
        for which in [Which::Number(number + 1), Which::Nearest(exact.frequency_hz * 1.02)] {
            for mode in along(&chain, 2, which, &[1e-6, 1.0], true, fine(3, 64)) {
                assert!(
                    (mode.frequency_hz / exact.frequency_hz - 1.0).abs() < 1e-8,
                    "{number}: {} {}",
                    mode.frequency_hz,
                    exact.frequency_hz
                );
                assert!((mode.damping - exact.damping).abs() < 1e-8, "{number}: {} {}", mode.damping, exact.damping);
                for (k, slope) in mode.slopes.iter().enumerate() {
                    let [f, z] = [exact.frequency_slope(k), exact.damping_slope(k)];
                    // A parameter moves the damping off proportion, where the two differ in the second order of zeta.
                    assert!((slope[0] - f).abs() < 1e-2 * f.abs().max(1e-9) + 1e-5, "{number} {k}: {slope:?} {f} {z}");
                    assert!((slope[1] - z).abs() < 1e-2 * z.abs() + 1e-7, "{number} {k}: {slope:?} {f} {z}");
                }
            }
        }
    }
}

#[test]
fn slopes_equal_differences_also_of_candidates_without_strength() {
    let laws: [(&str, &str, &[f64]); 5] = [
        ("elastic_slip", "c1.x", &[1.2, 4e-4]),
        ("cubic_stiffness", "c0.x", &[2e8]),
        ("maxwell", "c2.x", &[500.0, 0.04]),
        ("added_mass", "c0.x", &[0.1]),
        ("quadratic_damping", "c2.x", &[3.0]),
    ];
    let mut system = with(&laws);
    for (name, at, shape) in [
        ("cubic_stiffness", "c2.x", &[0.0][..]),
        ("elastic_slip", "c0.x", &[0.0, 3e-4]),
        ("added_mass", "c2.x", &[0.0]),
        ("support_compliance", "c2.x", &[0.0]),
    ] {
        let mut i = instance(&system.model, name, at, shape);
        i.follower = true;
        i.params.iter_mut().skip(1).for_each(|p| p.free = false);
        system.instances.push(i);
    }
    let (free, settings) = (system.free(), fine(7, 256));
    let amplitudes = [6e-4, 1.2e-3];
    let base = along(&system, 2, Which::Number(1), &amplitudes, true, settings);
    for (k, f) in free.iter().enumerate() {
        let value = system.instances[f.instance].params[f.param].value;
        let step = match (f.log, value, system.instances[f.instance].name()) {
            (true, ..) => 1e-4,
            (_, 0.0, "cubic_stiffness") => 1e3,
            (_, 0.0, "support_compliance") => 1e-9,
            (_, 0.0, _) => 1e-4,
            _ => 1e-4 * value,
        };
        let at = |h: f64| {
            let mut moved = system.clone();
            let i = &mut moved.instances[f.instance];
            i.follower = false;
            i.params[f.param].value = if f.log { value * h.exp() } else { value + h };
            along(&moved, 2, Which::Number(1), &amplitudes, false, settings)
        };
        let (up, down) = (at(step), at(-step));
        for (l, mode) in base.iter().enumerate() {
            let of = |m: &NonlinearMode| [m.frequency_hz, m.damping];
            for (q, name) in ["frequency", "damping"].iter().enumerate() {
                let numeric = (of(&up[l])[q] - of(&down[l])[q]) / (2.0 * step);
                let size = numeric.abs().max(1e-4 * of(mode)[q] / if f.log { 1.0 } else { step * 1e4 });
                println!("{} {name} at {}: {} by differences {numeric}", f.name, amplitudes[l], mode.slopes[k][q]);
                assert!((mode.slopes[k][q] - numeric).abs() < 2e-3 * size, "{} {name} at {}", f.name, amplitudes[l]);
            }
        }
    }
}

#[test]
fn what_is_no_mode_is_refused_with_its_reason() {
    // Two equal masses on equal springs: the second does not move against the ground's mean in neither; the middle of three does in the second mode.
    let springs: [(&str, &str, &[f64]); 3] =
        [("linear_stiffness", "c0.x", &[1e3]), ("linear_stiffness", "c1.x", &[1e3]), ("linear_stiffness", "c2.x", &[1e3])];
    // ground - m1 - m2 - m3, k2 and m3 such that m2 stands still in the second mode: w^2 = (k0 + k1)/m1 = k2/m3.
    let chain = system(&[1.0, 1.0, 0.5], &springs);
    let node = refused(&chain, 1, Which::Number(2), 1e-3);
    assert!(node.to_string().contains("node"), "{node}");
    let none = refused(&chain, 1, Which::Number(4), 1e-3);
    assert!(none.to_string().contains("mode 4 was asked for, and the model has 3"), "{none}");
    // A damper beyond the critical damping.
    let creeps = system(&[1.0], &[("linear_stiffness", "c0.x", &[100.0]), ("viscous", "c0.x", &[30.0])]);
    let error = refused(&creeps, 0, Which::Nearest(1.6), 1e-3);
    assert!(error.to_string().contains("no mode of the model that swings"), "{error}");
    // Friction that lets it swing at large amplitude alone.
    let sticky = system(&[1.0], &[("linear_stiffness", "c0.x", &[100.0]), ("coulomb", "c0.x", &[1.0, 1e-6])]);
    let error = refused(&sticky, 0, Which::Number(1), 1e-3);
    assert!(error.to_string().contains("overdamped"), "{error}");
    assert!(!error.accepted().is_empty() && error.place().contains("amplitude"));
    assert!(along(&sticky, 0, Which::Number(1), &[0.1], false, Settings::default())[0].damping < 0.1);
}

/// A spring on one side has no small-signal limit, and a stiff friction damps beyond the critical damping where it begins to slip: no way leads past that from small
/// amplitudes.
#[test]
fn laws_without_a_linear_mode_nearby_have_their_nonlinear_ones() {
    // Half a period on either stiffness.
    let (m, k, beside) = (1.0, 9e3, 3e4);
    let bilinear = system(&[m], &[("linear_stiffness", "c0.x", &[k]), ("bilinear_stiffness", "c0.x", &[beside])]);
    let (one, other) = ((k / m).sqrt(), ((k + beside) / m).sqrt());
    for mode in along(&bilinear, 0, Which::Number(1), &[1e-4, 1e-3], false, Settings::default()) {
        assert!((TAU * mode.frequency_hz / (2.0 * one * other / (one + other)) - 1.0).abs() < 1e-3, "{}", mode.frequency_hz);
    }
    // Beside a candidate in series as well.
    let mut rubs = system(&[m], &[("linear_stiffness", "c0.x", &[k]), ("coulomb", "c0.x", &[1.0, 1e-6])]);
    let mut candidate = instance(&rubs.model, "support_compliance", "c0.x", &[0.0]);
    candidate.follower = true;
    rubs.instances.push(candidate);
    assert_eq!(along(&rubs, 0, Which::Number(1), &[1e-3], true, Settings::default())[0].slopes.len(), rubs.free().len());
    let (f, d) = (1.0, 1e-6);
    let stiff = system(&[m], &[("linear_stiffness", "c0.x", &[k]), ("elastic_slip", "c0.x", &[f, d])]);
    let x = 1e-3;
    let mode = &along(&stiff, 0, Which::Number(1), &[x], false, fine(1, 1024))[0];
    let exact = 2.0 * f * (1.0 - d / x) / (PI * (TAU * mode.frequency_hz).powi(2) * m * x);
    assert!((mode.damping / exact - 1.0).abs() < 1e-3 && (TAU * mode.frequency_hz / one - 1.0).abs() < 5e-3, "{mode:?} {exact}");
}
