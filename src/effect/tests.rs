//! Tests that hold for every effect of the library.

use num_complex::Complex64;

use super::dispatch::{INPUTS, Tangent};
use super::info::Kind;
use super::*;

/// Parameters of order one for a motion of order one.
fn sample(info: &Info) -> Vec<f64> {
    info.params
        .iter()
        .map(|p| match (p.kind, p.name) {
            (Kind::Strength, _) => 0.8,
            (_, "d") => 0.15,
            (_, "tau") => 0.7,
            (Kind::Setting, "f_low") => 0.05,
            (Kind::Setting, "f_high") => 20.0,
            (Kind::Setting, "vr") => 0.05,
            _ => 0.4,
        })
        .collect()
}

fn forces() -> impl Iterator<Item = &'static dyn ForceLaw> {
    LIBRARY.iter().filter_map(|e| if let Effect::Force(f) = e { Some(*f) } else { None })
}

/// Motion of two incommensurate sines.
fn motion(k: usize, dt: f64) -> Inputs<f64> {
    let at = |t: f64| t.sin() + 0.3 * (2.7 * t).sin();
    let t = k as f64 * dt;
    Inputs { x: at(t), v: t.cos() + 0.81 * (2.7 * t).cos(), a: -t.sin() - 2.187 * (2.7 * t).sin(), dx: at(t) - at(t - dt) }
}

#[test]
fn every_name_is_unique_documented_and_starts_with_a_strength() {
    let mut seen = std::collections::HashSet::new();
    for effect in LIBRARY {
        let info = effect.info();
        assert!(seen.insert(info.name), "{} twice", info.name);
        assert_eq!(info.params[0].kind, Kind::Strength, "{}", info.name);
        assert!(!info.claim.is_empty() && !info.equation.is_empty() && !info.source.is_empty() && !info.range.is_empty());
        assert!(info.params.iter().all(|p| !p.doc.is_empty()));
        assert!(info.params.len() <= 7, "{}: the stiffness tangent holds seven parameters", info.name);
    }
    let error = find("colomb").unwrap_err();
    assert_eq!(error, EffectError::Unknown { name: "colomb".into(), nearest: "coulomb".into() });
}

#[test]
fn tangents_equal_central_differences() {
    for law in forces() {
        let info = law.info();
        let (p, dt) = (sample(info), 0.02);
        let (np, ns) = (p.len(), info.states);
        let active = vec![true; np];
        let mut s = vec![0.0; ns];
        let mut t = Tangent::default();
        for k in 1..150 {
            let u = motion(k, dt);
            let old = s.clone();
            law.tangent(&u, dt, &mut s, &p, &active, &mut t);
            if k % 7 != 0 {
                continue;
            }
            let run = |u: &Inputs<f64>, s0: &[f64], p: &[f64]| {
                let mut s = s0.to_vec();
                let f = law.value(u, dt, &mut s, p);
                [vec![f], s].concat()
            };
            assert!(run(&u, &old, &p)[1..].iter().zip(&s).all(|(a, b)| (a - b).abs() < 1e-14));
            for column in 0..INPUTS + ns + np {
                let at = |h: f64| {
                    let (mut u, mut s, mut p) = (u, old.clone(), p.clone());
                    match column {
                        0 => u.x += h,
                        1 => u.v += h,
                        2 => u.a += h,
                        3 => u.dx += h,
                        c if c < INPUTS + ns => s[c - INPUTS] += h,
                        c => p[c - INPUTS - ns] += h,
                    }
                    run(&u, &s, &p)
                };
                let h = 1e-5;
                let (up, down) = (at(h), at(-h));
                for row in 0..=ns {
                    let analytic = match column {
                        c if c < INPUTS => t.inputs(row)[c],
                        c if c < INPUTS + ns => t.states(row)[c - INPUTS],
                        c => t.params(row)[c - INPUTS - ns],
                    };
                    let numeric = (up[row] - down[row]) / (2.0 * h);
                    assert!(
                        (analytic - numeric).abs() <= 2e-7 * (1.0 + analytic.abs()),
                        "{} step {k} row {row} column {column}: {analytic} against {numeric}",
                        info.name
                    );
                }
            }
        }
    }
}

#[test]
fn forces_are_proportional_to_the_strength_and_states_do_not_know_it() {
    for law in forces() {
        let mut p = sample(law.info());
        let (mut one, mut many, mut none) = (vec![0.0; law.info().states], vec![0.0; law.info().states], vec![0.0; law.info().states]);
        for k in 1..200 {
            let u = motion(k, 0.02);
            p[0] = 1.0;
            let f1 = law.value(&u, 0.02, &mut one, &p);
            p[0] = 5.0;
            let f5 = law.value(&u, 0.02, &mut many, &p);
            p[0] = 0.0;
            assert_eq!(law.value(&u, 0.02, &mut none, &p), 0.0, "{}", law.info().name);
            assert!((f5 - 5.0 * f1).abs() <= 1e-12 * f5.abs(), "{}", law.info().name);
            assert_eq!(one, many);
            assert_eq!(one, none);
        }
    }
}

#[test]
fn no_closed_cycle_gives_energy_back() {
    for law in forces() {
        for (amplitude, omega) in [(0.02, 0.3), (0.5, 1.0), (2.0, 7.0)] {
            let p = sample(law.info());
            let steps = 2000;
            let dt = std::f64::consts::TAU / omega / steps as f64;
            let mut s = vec![0.0; law.info().states];
            let (mut work, mut stored, mut old) = (0.0, 0.0f64, 0.0);
            for k in 1..=12 * steps {
                let (t, t0) = (k as f64 * dt, (k - 1) as f64 * dt);
                let dx = amplitude * ((omega * t).sin() - (omega * t0).sin());
                let u = Inputs {
                    x: amplitude * (omega * t).sin(),
                    v: amplitude * omega * (omega * t).cos(),
                    a: -amplitude * omega * omega * (omega * t).sin(),
                    dx,
                };
                let f = law.value(&u, dt, &mut s, &p);
                if k > 11 * steps {
                    work += 0.5 * (f + old) * dx;
                    stored += (0.5 * (f + old) * dx).abs();
                }
                old = f;
            }
            assert!(work >= -1e-6 * stored, "{} at {amplitude}, {omega}: {work} of {stored}", law.info().name);
        }
    }
}

#[test]
fn the_small_signal_stiffness_is_that_of_a_marched_small_cycle() {
    for law in forces() {
        let p = sample(law.info());
        for omega in [0.5, 3.0, 20.0] {
            let Ok(z) = law.stiffness(Complex64::new(0.0, omega), &p) else {
                assert_eq!(law.info().name, "coulomb", "only a rigid law may refuse");
                continue;
            };
            // Richardson extrapolation over two step lengths removes the second-order error of the update.
            let marched = |steps: usize| {
                let (amplitude, dt) = (1e-5, std::f64::consts::TAU / omega / steps as f64);
                let mut s = vec![0.0; law.info().states];
                let mut sum = Complex64::ZERO;
                let cycles = 3 + (20.0 * omega / std::f64::consts::TAU).ceil() as usize;
                for k in 1..=cycles * steps {
                    let (phase, before) = (omega * k as f64 * dt, omega * (k as f64 - 1.0) * dt);
                    let u = Inputs {
                        x: amplitude * phase.cos(),
                        v: -amplitude * omega * phase.sin(),
                        a: -amplitude * omega * omega * phase.cos(),
                        dx: amplitude * if k == 1 { phase.cos() } else { phase.cos() - before.cos() },
                    };
                    let f = law.value(&u, dt, &mut s, &p);
                    if k > (cycles - 1) * steps {
                        sum += f * Complex64::new(phase.cos(), -phase.sin());
                    }
                }
                sum * 2.0 / steps as f64 / amplitude
            };
            let (coarse, fine) = (marched(400), marched(800));
            let limit = fine + (fine - coarse) / 3.0;
            assert!((limit - z).norm() <= 2e-4 * (z.norm() + 1e-6), "{} at {omega} rad/s: marched {limit}, exact {z}", law.info().name);
        }
    }
}

#[test]
fn stiffness_slopes_equal_central_differences() {
    for law in forces() {
        let p = sample(law.info());
        let mut dp = vec![Complex64::ZERO; p.len()];
        let s = Complex64::new(-0.1, 2.0);
        let Ok((_, ds)) = law.stiffness_tangent(s, &p, &mut dp) else { continue };
        let h = 1e-6;
        let at = |s, p: &[f64]| law.stiffness(s, p).unwrap();
        assert!(((at(s + h, &p) - at(s - h, &p)) / (2.0 * h) - ds).norm() < 1e-8 * (1.0 + ds.norm()));
        for k in 0..p.len() {
            let shifted = |h: f64| {
                let mut p = p.clone();
                p[k] += h;
                at(s, &p)
            };
            assert!(((shifted(h) - shifted(-h)) / (2.0 * h) - dp[k]).norm() < 1e-7 * (1.0 + dp[k].norm()), "{}", law.info().name);
        }
    }
}

#[test]
fn series_open_with_the_force_and_vanish_at_the_null() {
    for effect in LIBRARY {
        let Effect::Series(law) = effect else { continue };
        let mut p = sample(law.info());
        let mut last = f64::NEG_INFINITY;
        for k in -50..50 {
            let (e, slope) = law.opening(k as f64 * 0.1, &p);
            assert!(e >= last && slope >= 0.0);
            last = e;
        }
        let (mut dp, mut dslope) = (vec![0.0; p.len()], vec![0.0; p.len()]);
        law.opening_params(0.3, &p, &mut dp, &mut dslope);
        for k in 0..p.len() {
            let at = |h: f64| {
                let mut p = p.clone();
                p[k] += h;
                law.opening(0.3, &p)
            };
            let (up, down) = (at(1e-6), at(-1e-6));
            assert!(((up.0 - down.0) / 2e-6 - dp[k]).abs() < 1e-7);
            assert!(((up.1 - down.1) / 2e-6 - dslope[k]).abs() < 1e-7);
        }
        p[0] = 0.0;
        assert_eq!(law.opening(3.0, &p), (0.0, 0.0));
    }
}

#[test]
fn structural_damping_has_a_flat_loss_modulus_inside_its_band() {
    let Effect::Force(law) = find("structural_damping").unwrap() else { panic!("a force") };
    let p = [1.0, 0.01, 1e4];
    for decade in 0..=4 {
        for step in 0..10 {
            let f = 0.2 * 10f64.powf((decade as f64 + 0.1 * step as f64) * 0.7);
            let z = law.stiffness(Complex64::new(0.0, std::f64::consts::TAU * f), &p).unwrap();
            assert!((z.im - 1.0).abs() < 0.02, "{f} Hz: {}", z.im);
        }
    }
}
