//! Tests that hold for every effect of the library.

use num_complex::Complex64;

use super::dispatch::{INPUTS, Tangent, Wanted};
use super::info::Kind;
use super::*;

mod limits;

/// Parameters of order one for a motion of order one.
fn sample(info: &Info) -> Vec<f64> {
    let value = |p: &Param| match (info.name, p.name) {
        (_, _) if p.kind == Kind::Strength => 0.8,
        (_, "d") => 0.15,
        ("maxwell", "tau") => 0.7,
        ("fractional_zener", "tau") => 0.05,
        ("structural_damping", "f_low") => 0.05,
        // A narrow band: the slowest branch (a twentieth of it) settles within the cycles that are marched, and few are so fast
        // against the step that their update is of first order only.
        ("springpot", "f_low") => 2.0,
        ("springpot", "f_high") => 4.0,
        (_, "f_high") => 20.0,
        (_, "vr") => 0.05,
        ("lugre", "tau") => 0.02,
        ("lugre", "skew") => 0.2,
        ("bouc_wen", "n") => 2.0,
        ("bouc_wen", "sigma") => 0.7,
        ("power_damping", "n") => 1.5,
        ("iwan", "chi") => -0.3,
        (_, "side") => 1.0,
        ("contact" | "hunt_crossley", "n") => 1.5,
        ("wedge_friction", "r") => 6.0,
        ("pinched_bouc_wen", "n") => 2.0,
        ("pinched_bouc_wen", "sigma") => 0.7,
        ("pinched_bouc_wen", "q") => 0.1,
        ("absorber", "f0") => 0.9,
        ("absorber", "zeta") => 0.5,
        ("contact", "alpha") => 0.3,
        _ => 0.4,
    };
    info.params.iter().map(value).collect()
}

/// The sample and its variants: other signs, other branches of the law.
fn samples(info: &Info) -> Vec<Vec<f64>> {
    let base = sample(info);
    let with = |changes: &[(&str, f64)]| {
        let mut p = base.clone();
        changes.iter().for_each(|(name, v)| p[info.param(name).unwrap()] = *v);
        p
    };
    let variants: Vec<Vec<f64>> = match info.name {
        "contact" => vec![with(&[("side", -1.0)]), with(&[("g", -0.4)]), with(&[("g", -0.4), ("side", -1.0), ("n", 1.0)])],
        "hunt_crossley" => {
            vec![with(&[("side", -1.0)]), with(&[("g", -0.4), ("chi", 2.0)]), with(&[("g", -0.4), ("side", -1.0), ("n", 1.0)])]
        }
        "preload" => vec![with(&[("f", -0.8)])],
        "asymmetric_damping" => vec![with(&[("beta", -1.0)]), with(&[("beta", 1.0)])],
        "digressive_damping" => vec![with(&[("v0", 0.05)])],
        "wedge_friction" => {
            vec![with(&[("side", -1.0), ("r", 0.5)]), with(&[("x0", -0.4)]), with(&[("x0", -0.4), ("side", -1.0), ("r", 2.0)])]
        }
        "pinched_bouc_wen" => vec![with(&[("n", 1.0), ("sigma", 0.5), ("zeta", 0.9), ("q", 0.3)])],
        "fractional_zener" => vec![with(&[("alpha", 0.7)])],
        "bilinear_stiffness" => vec![with(&[("x0", -0.4)]), with(&[("k", -0.8)])],
        "quadratic_stiffness" => vec![with(&[("k2", -0.8)])],
        "power_damping" => vec![with(&[("n", 0.5)])],
        "bouc_wen" => vec![with(&[("n", 1.0), ("sigma", 1.0)]), with(&[("n", 4.0), ("sigma", 0.5)])],
        "lugre" => vec![with(&[("b", 0.0), ("tau", 1.5), ("skew", -0.5)])],
        "iwan" => vec![with(&[("chi", 0.0)]), with(&[("chi", 3.0)])],
        "springpot" => vec![with(&[("alpha", 0.9)]), with(&[("alpha", 0.1)])],
        _ => vec![],
    };
    std::iter::once(base.clone()).chain(variants).collect()
}

/// Every force law at every sample.
fn sampled() -> impl Iterator<Item = (&'static dyn ForceLaw, Vec<f64>)> {
    forces().flat_map(|law| samples(law.info()).into_iter().map(move |p| (law, p)))
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
        // The parameters of a formula stand in the study.
        assert!(matches!(effect, Effect::Formula(_)) || info.params[0].kind == Kind::Strength, "{}", info.name);
        assert!(!info.claim.is_empty() && !info.equation.is_empty() && !info.source.is_empty() && !info.range.is_empty());
        assert!(info.params.iter().all(|p| !p.doc.is_empty()));
        assert!(info.params.len() <= 7, "{}: the stiffness tangent holds seven parameters", info.name);
    }
    let error = find("colomb").unwrap_err();
    assert_eq!(error, EffectError::Unknown { name: "colomb".into(), nearest: "coulomb".into() });
}

#[test]
fn tangents_equal_central_differences() {
    let (mut checked, mut kinks) = (0, 0);
    for (law, p) in sampled() {
        let (info, dt) = (law.info(), 0.02);
        let (np, ns) = (p.len(), info.states);
        let active = vec![true; np];
        let mut s = vec![0.0; ns];
        let mut t = Tangent::default();
        for k in 1..150 {
            let u = motion(k, dt);
            let old = s.clone();
            law.tangent(&u, dt, &mut s, &p, Wanted::Params(&active), &mut t);
            // What Newton's method asks for alone is the same, and leaves the same states.
            let (mut alone, mut by_inputs) = (old.clone(), Tangent::default());
            law.tangent(&u, dt, &mut alone, &p, Wanted::Inputs, &mut by_inputs);
            assert_eq!((by_inputs.f, by_inputs.inputs(0), &alone), (t.f, t.inputs(0), &s), "{} at step {k}", info.name);
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
                // Differences of fourth order.
                let (up, down, far_up, far_down, middle) = (at(h), at(-h), at(2.0 * h), at(-2.0 * h), at(0.0));
                for row in 0..=ns {
                    let analytic = match column {
                        c if c < INPUTS => t.inputs(row)[c],
                        c if c < INPUTS + ns => t.states(row)[c - INPUTS],
                        c => t.params(row)[c - INPUTS - ns],
                    };
                    let numeric = (8.0 * (up[row] - down[row]) - (far_up[row] - far_down[row])) / (12.0 * h);
                    checked += 1;
                    if (analytic - numeric).abs() <= 2e-7 * (1.0 + analytic.abs()) {
                        continue;
                    }
                    // A slider within the reach of the differences of its limit: the slope is that of one side.
                    kinks += 1;
                    let sides = [(far_up[row] - middle[row]) / (2.0 * h), (middle[row] - far_down[row]) / (2.0 * h)];
                    let (low, high) = (sides[0].min(sides[1]) - 1e-3, sides[0].max(sides[1]) + 1e-3);
                    assert!(
                        ns > 0 && low < analytic && analytic < high,
                        "{} {p:?} step {k} row {row} column {column}: {analytic} against {numeric}",
                        info.name
                    );
                }
            }
        }
    }
    assert!(kinks < checked / 200, "{kinks} of {checked}");
}

#[test]
fn forces_are_proportional_to_the_strength_and_states_do_not_know_it() {
    for (law, mut p) in sampled() {
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
    // What the spring at its place loses less than the model has there, and node_deviation more.
    for (law, p) in sampled().filter(|(law, _)| law.info().name != "inertia_deviation") {
        for (amplitude, omega) in [(0.02, 0.3), (0.5, 1.0), (2.0, 7.0)] {
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
            assert!(work >= -1e-6 * stored, "{} {p:?} at {amplitude}, {omega}: {work} of {stored}", law.info().name);
        }
    }
}

#[test]
fn the_small_signal_stiffness_is_that_of_a_marched_small_cycle() {
    for (law, p) in sampled() {
        for omega in [0.5, 3.0, 20.0] {
            // `F/x` of the steady cycle at an amplitude.
            let marched = |amplitude: f64, steps: usize| {
                let dt = std::f64::consts::TAU / omega / steps as f64;
                let mut s = vec![0.0; law.info().states];
                let mut sum = Complex64::ZERO;
                // What lies between nodes is damped as little as they are.
                let settles = if law.info().family == "deviation" { 100.0 } else { 20.0 };
                let cycles = 3 + (settles * omega / std::f64::consts::TAU).ceil() as usize;
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
            let Ok(z) = law.stiffness(Complex64::new(0.0, omega), &p) else {
                // Above the velocity at which the update is rounded off, a rigid law stiffens without end as the amplitude falls.
                let (large, small) = (marched(10.0, 400).norm(), marched(1.0, 400).norm());
                assert!(small > 2.0 * large, "{} {p:?} refuses a limit that it has: {large}, {small}", law.info().name);
                continue;
            };
            // Richardson extrapolation over two step lengths removes the second-order error of the update.
            let (coarse, fine) = (marched(1e-9, 400), marched(1e-9, 800));
            let limit = fine + (fine - coarse) / 3.0;
            // What vanishes with the amplitude is compared with the strength of 0.8.
            let allowed = if z.norm() < 1e-6 { 1e-6 } else { 2e-4 * z.norm() };
            assert!((limit - z).norm() <= allowed, "{} {p:?} at {omega} rad/s: marched {limit}, exact {z}", law.info().name);
        }
    }
}

#[test]
fn stiffness_slopes_equal_central_differences() {
    for (law, p) in sampled() {
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
            assert!(((shifted(h) - shifted(-h)) / (2.0 * h) - dp[k]).norm() < 1e-7 * (1.0 + dp[k].norm()), "{} {p:?}", law.info().name);
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
fn a_law_superposes_exactly_where_it_says_so() {
    for (law, p) in sampled() {
        let run = |part: &dyn Fn(usize) -> Inputs<f64>| {
            let mut s = vec![0.0; law.info().states];
            (1..200).map(|k| law.value(&part(k), 0.02, &mut s, &p)).collect::<Vec<_>>()
        };
        let sine = |k: usize, n: f64, size: f64| {
            let (t, at) = (k as f64 * 0.02, |t: f64| size * (n * t).sin());
            Inputs { x: at(t), v: n * size * (n * t).cos(), a: -n * n * at(t), dx: at(t) - at(t - 0.02) }
        };
        let whole = run(&|k| motion(k, 0.02));
        let parts = [run(&|k| sine(k, 1.0, 1.0)), run(&|k| sine(k, 2.7, 0.3))];
        let largest = whole.iter().fold(0.0f64, |m, f| m.max(f.abs()));
        let gap = (0..whole.len()).map(|k| (whole[k] - parts[0][k] - parts[1][k]).abs()).fold(0.0, f64::max);
        assert_eq!(gap < 1e-12 * largest, law.superposes(), "{} {p:?}: {gap:e} of {largest}", law.info().name);
        assert!(law.superposes() || !law.linear());
    }
    for effect in LIBRARY {
        let Effect::Series(law) = effect else { continue };
        let p = sample(law.info());
        let bent = law.opening(2.0, &p).0 - 2.0 * law.opening(1.0, &p).0;
        assert_eq!(bent.abs() < 1e-12, law.linear(), "{}", law.info().name);
    }
}

#[test]
fn bounds_and_grids_agree_with_the_sign() {
    let scales = Scales { x: 1.0, travel: (-1.0, 1.0), v: 1.0, least_v: 0.5, f: 1.0, periods: (0.1, 10.0), small: false };
    for info in LIBRARY.iter().map(Effect::info) {
        for p in info.params {
            assert!(p.min < p.max && p.min >= p.sign.lowest(), "{}.{}", info.name, p.name);
            let fits = |v: f64| v >= p.min && v <= p.max && (p.sign != Sign::Positive || v > 0.0);
            assert!(p.grid.values(&scales).into_iter().all(fits), "{}.{}", info.name, p.name);
            assert!(p.kind == Kind::Shape || fits(p.default) || p.kind == Kind::Strength, "{}.{}", info.name, p.name);
            assert!(p.kind != Kind::Shape || p.grid != Grid::None, "{}.{}: a shape is searched", info.name, p.name);
        }
        let trials: usize = info.params.iter().filter(|p| p.grid != Grid::None).map(|p| p.grid.values(&scales).len()).product();
        assert!(trials <= 8, "{}: {trials} shapes at each place", info.name);
    }
}

#[test]
fn coefficients_are_one_at_the_reference_and_at_the_null() {
    for effect in LIBRARY {
        let Effect::Coefficient(law) = effect else { continue };
        let (p, mut dp) = (sample(law.info()), [0.0]);
        assert_eq!(law.factor(0.0, &p, &mut dp), 1.0, "{}", law.info().name);
        assert_eq!(law.factor(3.0, &[0.0], &mut dp), 1.0, "{}", law.info().name);
        let factor = law.factor(1.7, &p, &mut dp);
        let numeric = (law.factor(1.7, &[p[0] + 1e-6], &mut [0.0]) - law.factor(1.7, &[p[0] - 1e-6], &mut [0.0])) / 2e-6;
        assert!((dp[0] - numeric).abs() < 1e-8 * factor.abs().max(1.0), "{}", law.info().name);
        assert_ne!(factor, 1.0);
    }
}

#[test]
fn channels_read_truly_at_the_null_and_have_exact_slopes() {
    let drive = Complex64::new(0.3, -0.7);
    let at = Moment { acceleration: 1.3, time: -0.4 };
    for effect in LIBRARY {
        let Effect::Channel(law) = effect else { continue };
        let (name, null) = (law.info().name, [law.info().params[0].default]);
        let (mut dp, mut dw) = ([0.0], [Complex64::ZERO]);
        assert_eq!((law.shift(&null, &mut dp), law.reading(2.0, at, &null, &mut dp)), (0.0, (2.0, 1.0)), "{name}");
        assert!((law.factor(5.0, drive, &null, &mut dw).0 - 1.0).norm() < 1e-15, "{name}");
        let p = [0.6];
        let (up, down) = ([p[0] + 1e-6], [p[0] - 1e-6]);
        let (_, dy) = law.reading(2.0, at, &p, &mut dp);
        let numeric = (law.reading(2.0, at, &up, &mut [0.0]).0 - law.reading(2.0, at, &down, &mut [0.0]).0) / 2e-6;
        assert!((dp[0] - numeric).abs() < 1e-8, "{name}");
        assert!((dy - (law.reading(2.1, at, &p, &mut [0.0]).0 - law.reading(1.9, at, &p, &mut [0.0]).0) / 0.2).abs() < 1e-8, "{name}");
        let shift = law.shift(&p, &mut dp);
        assert!((dp[0] - (law.shift(&up, &mut [0.0]) - law.shift(&down, &mut [0.0])) / 2e-6).abs() < 1e-8, "{name}");
        let (factor, slope) = law.factor(5.0, drive, &p, &mut dw);
        let by = |p: &[f64], d: Complex64| law.factor(5.0, d, p, &mut [Complex64::ZERO]).0;
        assert!(((by(&up, drive) - by(&down, drive)) / 2e-6 - dw[0]).norm() < 1e-7, "{name}");
        assert!(((by(&p, drive + 1e-6) - by(&p, drive - 1e-6)) / 2e-6 - slope).norm() < 1e-7, "{name}");
        // Every channel effect is seen somewhere; what says it is not seen in frequency is not.
        let seen = (factor - 1.0).norm() > 1e-3;
        assert_eq!(seen, law.in_frequency(), "{name}");
        assert!(seen || shift != 0.0 || law.reading(2.0, at, &p, &mut dp).0 != 2.0, "{name}");
    }
}
