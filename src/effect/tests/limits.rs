//! Each law against what it must be in a limit, and against closed forms that are not itself.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::super::*;

fn law(name: &str) -> &'static dyn ForceLaw {
    match find(name).unwrap() {
        Effect::Force(law) => *law,
        other => panic!("{other:?} is no force"),
    }
}

/// Force over a path of displacements taken at equal times `dt`.
fn along(law: &dyn ForceLaw, p: &[f64], dt: f64, path: &[f64]) -> Vec<f64> {
    let mut s = vec![0.0; law.info().states];
    let mut before = 0.0;
    path.iter()
        .map(|&x| {
            let dx = x - before;
            before = x;
            law.value(&Inputs { x, v: dx / dt, a: 0.0, dx }, dt, &mut s, p)
        })
        .collect()
}

fn at(name: &str, x: f64, v: f64, p: &[f64]) -> f64 {
    law(name).value(&Inputs { x, v, a: 0.0, dx: 0.0 }, 1.0, &mut [], p)
}

#[test]
fn contact_is_hertz_beyond_the_gap_and_never_pulls() {
    // k, g, side, n, r, alpha: with k = c r^(1/2) the force is c d^(3/2).
    let c = 3.0f64;
    let p = |g: f64, side: f64, alpha: f64| [c * 0.2f64.sqrt(), g, side, 1.5, 0.2, alpha];
    for x in [-1.0, 0.1, 0.3, 0.7, 2.0] {
        let hertz = |d: f64| c * d.max(0.0).powf(1.5);
        assert!((at("contact", x, 0.0, &p(0.3, 1.0, 0.0)) - hertz(x - 0.3)).abs() < 1e-13);
        assert!((at("contact", x, 0.0, &p(0.3, -1.0, 0.0)) + hertz(-x - 0.3)).abs() < 1e-13);
        assert!((at("contact", x, 0.0, &p(0.3, 0.0, 0.0)) - hertz(x - 0.3) + hertz(-x - 0.3)).abs() < 1e-13);
    }
    let fast = at("contact", 1.0, -100.0, &p(0.3, 1.0, 0.5));
    assert_eq!(fast, 0.0, "a face that flies away does not pull");
    assert!(at("contact", 1.0, 0.1, &p(0.3, 1.0, 0.5)) > at("contact", 1.0, -0.1, &p(0.3, 1.0, 0.5)));
}

/// Restitution of a mass on a Hunt-Crossley stop is 1 - alpha v for slow impacts (their eq. of the first order in alpha v).
#[test]
fn contact_restitution_falls_by_alpha_times_the_speed() {
    let (alpha, v0) = (0.05, 1.0);
    let p = [400.0, 0.0, 1.0, 1.5, 1.0, alpha];
    let (mut x, mut v, dt) = (0.0f64, v0, 1e-5);
    let force = |x: f64, v: f64| at("contact", x, v, &p);
    loop {
        // Classical Runge-Kutta on a unit mass.
        let slope = |x: f64, v: f64| (v, -force(x, v));
        let (k1, l1) = slope(x, v);
        let (k2, l2) = slope(x + 0.5 * dt * k1, v + 0.5 * dt * l1);
        let (k3, l3) = slope(x + 0.5 * dt * k2, v + 0.5 * dt * l2);
        let (k4, l4) = slope(x + dt * k3, v + dt * l3);
        x += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
        v += dt / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
        if x < 0.0 {
            break;
        }
    }
    assert!((-v / v0 - (1.0 - alpha * v0)).abs() < 0.003, "{}", -v / v0);
}

#[test]
fn springs_bend_where_they_say() {
    for (x, k_below, k_above) in [(-0.4, 2.0, 5.0), (0.3, 2.0, 5.0), (0.0, 2.0, 5.0)] {
        // Beside a spring of the lower stiffness the slopes are those of both sides, and nothing acts at x = 0.
        let p = [k_above - k_below, x];
        let f = |u: f64| k_below * u + at("bilinear_stiffness", u, 0.0, &p);
        assert_eq!(f(0.0), 0.0);
        assert!((f(x - 0.1) - f(x - 0.2) - 0.1 * k_below).abs() < 1e-14);
        assert!((f(x + 0.2) - f(x + 0.1) - 0.1 * k_above).abs() < 1e-14);
    }
    assert_eq!(at("quadratic_stiffness", -3.0, 0.0, &[2.0]), 18.0);
}

#[test]
fn power_damping_holds_coulomb_viscous_and_quadratic() {
    for v in [-2.0, -0.3, 0.5, 1.7] {
        let power = |n: f64| at("power_damping", 0.0, v, &[0.8, n, 0.5, 1e-9]);
        assert!((power(0.0) - 0.8 * f64::signum(v)).abs() < 1e-12);
        assert!((power(1.0) - at("viscous", 0.0, v, &[0.8 / 0.5])).abs() < 1e-12);
        assert!((power(2.0) - at("quadratic_damping", 0.0, v, &[0.8 / 0.25])).abs() < 1e-12);
        assert!((power(0.6) - 0.8 * f64::signum(v) * (v.abs() / 0.5).powf(0.6)).abs() < 1e-12);
    }
}

#[test]
fn stribeck_falls_from_the_static_level_to_coulomb() {
    let p = [2.0, 0.1, 0.5, 1e-6];
    assert!((at("stribeck", 0.0, 1e-3, &p) - 3.0).abs() < 1e-3);
    assert!((at("stribeck", 0.0, -5.0, &p) + 2.0).abs() < 1e-9);
    assert!((at("stribeck", 0.0, 0.1, &p) - 2.0 * (1.0 + 0.5 * (-1.0f64).exp())).abs() < 1e-9);
    assert_eq!(at("stribeck", 0.0, 0.7, &[2.0, 0.1, 0.0, 1e-6]), at("coulomb", 0.0, 0.7, &[2.0, 1e-6]));
}

#[test]
fn lugre_sticks_then_slides_at_its_level() {
    let p = [2.0, 0.01, 0.3, 0.5, 0.2, 0.0];
    for v in [0.02, -0.3, 2.0] {
        let dt = 0.002 / f64::abs(v);
        let path: Vec<f64> = (1..400).map(|k| v * dt * k as f64).collect();
        let f = along(law("lugre"), &p, dt, &path);
        let steady = 2.0 * (1.0 + 0.5 * (-(v / 0.3f64).powi(2)).exp()) * (1.0 + 0.2 * v.signum()) * v.signum();
        assert!((f[398] - steady).abs() < 1e-9 * steady.abs(), "{} against {steady}", f[398]);
        // From rest the deflection nears its level as one minus an exponential of the travel.
        let level = steady / 2.0;
        let exact = 2.0 * level * (1.0 - (-path[3] / (0.01 * level)).exp());
        assert!((f[3] - exact).abs() < 1e-12 * exact.abs(), "{} against {exact}", f[3]);
    }
}

/// Dahl's law (n = 1, sigma = 1): along a monotonic path z = 1 - (1 - z0) exp(-h); n = 2: z = tanh(h).
#[test]
fn bouc_wen_follows_its_closed_forms() {
    let run = |n: f64, sigma: f64, steps: usize, end: f64| {
        let path: Vec<f64> = (1..=steps).map(|k| end * k as f64 / steps as f64).collect();
        *along(law("bouc_wen"), &[1.0, 0.5, n, sigma], 0.1, &path).last().unwrap()
    };
    for end in [0.1, 0.6, -3.0] {
        let h = f64::abs(end) / 0.5;
        assert!((run(1.0, 1.0, 7, end) - f64::signum(end) * (1.0 - (-h).exp())).abs() < 1e-13);
        let exact = f64::signum(end) * h.tanh();
        let errors: Vec<f64> = [10, 20, 40].iter().map(|n| (run(2.0, 0.7, *n, end) - exact).abs()).collect();
        assert!(errors[2] < 1e-4 && errors[1] < 0.3 * errors[0] + 1e-12 && errors[2] < 0.3 * errors[1] + 1e-12, "{errors:?}");
    }
    // A sharp yield is an elastic slider, at any step.
    let path: Vec<f64> = (1..400).map(|k| (0.05 * k as f64).sin()).collect();
    let (sharp, jenkins) =
        (along(law("bouc_wen"), &[1.0, 0.2, 50.0, 0.5], 1.0, &path), along(law("elastic_slip"), &[1.0, 0.2], 1.0, &path));
    assert!(sharp.iter().zip(&jenkins).all(|(a, b)| (a - b).abs() < 0.05));
    // Steps far beyond the yield displacement end on the limit.
    assert_eq!(along(law("bouc_wen"), &[1.0, 1e-6, 3.0, 0.5], 1.0, &[1.0, -1.0, 1.0]).last(), Some(&1.0));
}

/// Uniform density: backbone F = f (x/d)(2 - x/d) up to d, and by Masing's rules a loss of (4/3) f (X/d)^2 X per cycle of amplitude X <= d
/// (8 times the area under the backbone less 4 X F(X)); twelve sliders come within 2 % of it.
#[test]
fn iwan_has_the_backbone_and_the_loss_of_a_uniform_density() {
    let (f, d) = (2.0, 0.5);
    for x in [0.1, 0.25, 0.5, 0.9] {
        let path: Vec<f64> = (1..=50).map(|k| x * k as f64 / 50.0).collect();
        let last = *along(law("iwan"), &[f, d, 0.0], 1.0, &path).last().unwrap();
        let y = f64::min(x / d, 1.0);
        assert!((last - f * y * (2.0 - y)).abs() < 0.01 * f, "{x}: {last}");
    }
    for amplitude in [0.25, 0.5] {
        let steps = 4000;
        let path: Vec<f64> = (1..=2 * steps).map(|k| amplitude * (TAU * k as f64 / steps as f64).sin()).collect();
        let forces = along(law("iwan"), &[f, d, 0.0], 1.0, &path);
        let loss: f64 = (steps..2 * steps).map(|k| 0.5 * (forces[k] + forces[k - 1]) * (path[k] - path[k - 1])).sum();
        let exact = 4.0 / 3.0 * f * (amplitude / d).powi(2) * amplitude;
        assert!((loss / exact - 1.0).abs() < 0.02, "{loss} against {exact}");
    }
    // Many equal sliders are one.
    let path: Vec<f64> = (1..400).map(|k| (0.05 * k as f64).sin()).collect();
    let (many, one) = (along(law("iwan"), &[f, d, 50.0], 1.0, &path), along(law("elastic_slip"), &[f, d], 1.0, &path));
    assert!(many.iter().zip(&one).all(|(a, b)| (a - b).abs() < 0.05 * f));
}

#[test]
fn structural_damping_has_a_flat_loss_modulus_inside_its_band() {
    let law = law("structural_damping");
    for f_ref in [0.0, 3.0, 40.0] {
        let p = [1.0, 0.01, 1e4, f_ref];
        let at = |f: f64| law.stiffness(Complex64::new(0.0, TAU * f), &p).unwrap();
        for step in 0..50 {
            let f = 0.2 * 10f64.powf(0.07 * step as f64);
            assert!((at(f).im - 1.0).abs() < 0.02, "{f} Hz: {}", at(f).im);
            // As causality demands of a loss modulus that does not change.
            let rise = 2.0 / std::f64::consts::PI * (f / f_ref).ln();
            assert!(f_ref == 0.0 || (at(f).re - rise).abs() < 0.02, "{f} Hz: {} against {rise}", at(f).re);
        }
        assert!(at(f_ref).re.abs() < 1e-12, "the spring beside it keeps its dynamic stiffness at {f_ref} Hz: {}", at(f_ref));
    }
}

#[test]
fn springpot_is_the_power_law_inside_its_band() {
    for alpha in [0.05, 0.2, 0.5, 0.8, 0.95] {
        let p = [3.0, alpha, 2.0, 0.01, 1e4];
        for k in 0..=60 {
            let f = 0.01 * 10f64.powf(0.1 * k as f64);
            let z = law("springpot").stiffness(Complex64::new(0.0, TAU * f), &p).unwrap();
            let exact = Complex64::new(0.0, f / 2.0).powf(alpha) * 3.0;
            assert!((z - exact).norm() < 0.01 * exact.norm(), "order {alpha} at {f} Hz: {z} against {exact}");
        }
    }
    // A band of three decades, a factor 3 inside.
    for alpha in [0.05, 0.2, 0.5, 0.8, 0.95] {
        for k in 0..=20 {
            let f = 0.3 * 10f64.powf(0.1 * k as f64);
            let z = law("springpot").stiffness(Complex64::new(0.0, TAU * f), &[3.0, alpha, 2.0, 0.1, 100.0]).unwrap();
            let exact = Complex64::new(0.0, f / 2.0).powf(alpha) * 3.0;
            assert!((z - exact).norm() < 1e-3 * exact.norm(), "order {alpha} at {f} Hz: {z} against {exact}");
        }
    }
    // Towards both ends of the order: a spring and a damper.
    let near = |alpha: f64, f: f64| law("springpot").stiffness(Complex64::new(0.0, TAU * f), &[3.0, alpha, 2.0, 0.1, 1e3]).unwrap();
    assert!((near(1e-6, 7.0) - 3.0).norm() < 1e-4);
    assert!((near(1.0 - 1e-6, 7.0) - Complex64::new(0.0, 3.0 * 3.5)).norm() < 1e-3);
}

/// Ramp x = v t from rest: D^alpha x = v t^(1-alpha)/Gamma(2 - alpha) (Podlubny, Fractional Differential Equations, sec. 2.3).
#[test]
fn springpot_answers_a_ramp_as_the_fractional_derivative_does() {
    let (alpha, v, dt) = (0.5f64, 2.0, 1e-3);
    let path: Vec<f64> = (1..=2000).map(|k| v * dt * k as f64).collect();
    let f = along(law("springpot"), &[1.0, alpha, 1.0 / TAU, 0.02, 2e3], dt, &path);
    for k in [100, 500, 1999] {
        let t = dt * (k + 1) as f64;
        // Gamma(3/2) = sqrt(pi)/2.
        let exact = v * t.powf(1.0 - alpha) / (std::f64::consts::PI.sqrt() / 2.0);
        assert!((f[k] / exact - 1.0).abs() < 0.02, "{t} s: {} against {exact}", f[k]);
    }
}

#[test]
fn laws_of_load_and_acceleration() {
    assert_eq!(law("added_mass").value(&Inputs { x: 9.0, v: 9.0, a: -1.5, dx: 9.0 }, 1.0, &mut [], &[2.0]), -3.0);
    let Effect::Coefficient(load) = find("load_stiffness").unwrap() else { panic!("a coefficient") };
    assert_eq!(load.factor(50.0, &[0.002], &mut [0.0]), 1.1);
}
