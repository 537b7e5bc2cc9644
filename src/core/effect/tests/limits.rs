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
fn structural_damping_has_a_flat_loss_modulus_over_its_band() {
    let law = law("structural_damping");
    for (low, high, within) in [(0.01, 1e4, 0.007), (20.0, 2e4, 0.005), (5.0, 500.0, 0.005), (50.0, 60.0, 0.003), (0.01, 1e5, 0.02)] {
        for f_ref in [0.0, low, f64::sqrt(low * high)] {
            let p = [1.0, low, high, f_ref];
            let at = |f: f64| law.stiffness(Complex64::new(0.0, TAU * f), &p).unwrap();
            for step in 0..=100 {
                let f = low * (high / low).powf(0.01 * f64::from(step));
                assert!((at(f).im - 1.0).abs() < within, "{low} to {high} Hz, {f} Hz: {}", at(f).im);
            }
            // As causality demands of a loss modulus that does not change, a decade inside, where its end is not felt.
            for f in [10.0 * low, 0.1 * high, (low * high).sqrt()] {
                let rise = 2.0 / std::f64::consts::PI * (f / f_ref).ln();
                let inside = f_ref >= 10.0 * low && (10.0 * low..=0.1 * high).contains(&f);
                assert!(!inside || (at(f).re - rise).abs() < 0.03, "{low} to {high} Hz, {f} Hz: {} against {rise}", at(f).re);
            }
            assert!(at(f_ref).re.abs() < 1e-12, "the spring beside it keeps its dynamic stiffness at {f_ref} Hz: {}", at(f_ref));
        }
    }
}

#[test]
fn structural_damping_without_storage_is_the_loss_of_the_one_with_it() {
    let law = law("structural_damping");
    let at = |s: Complex64, f_ref: f64| law.stiffness_tangent(s, &[3.0, 0.05, 1e3, f_ref], &mut [Complex64::default(); 4]).unwrap();
    for f in [-20.0, -0.3, 0.01, 0.3, 20.0, 3e3] {
        let on_axis = Complex64::new(0.0, TAU * f);
        let (z, slope) = at(on_axis, -7.0);
        assert_eq!((z.re, z.im, slope), (0.0, at(on_axis, 7.0).0.im, Complex64::default()), "{f} Hz");
        // A mode that decays loses as motion that does not.
        assert_eq!(at(on_axis - 0.1 * f.abs(), -7.0).0, z, "{f} Hz");
    }
    // Time knows no frequency: what is left of a motion at 7 Hz is the same.
    let path: Vec<f64> = (1..400).map(|k| (TAU * 7.0 * k as f64 * 1e-3).sin()).collect();
    let [own, fixed] = [-7.0, 7.0].map(|f_ref| along(law, &[3.0, 0.05, 1e3, f_ref], 1e-3, &path));
    assert_eq!(own, fixed);
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

/// Mean of a force over a sine of displacement of amplitude `x` at the circular frequency `w`, and work over the last of two cycles.
fn cycle(name: &str, p: &[f64], x: f64, w: f64) -> (f64, f64) {
    let (law, steps) = (law(name), 20_000);
    let dt = TAU / w / steps as f64;
    let mut s = vec![0.0; law.info().states];
    let (mut mean, mut work, mut old) = (0.0, 0.0, 0.0);
    for k in 1..=2 * steps {
        let ((sin, cos), before) = ((w * k as f64 * dt).sin_cos(), (w * (k as f64 - 1.0) * dt).sin());
        let u = Inputs { x: x * sin, v: x * w * cos, a: -x * w * w * sin, dx: x * (sin - before) };
        let f = law.value(&u, dt, &mut s, p);
        if k > steps {
            mean += f / steps as f64;
            work += 0.5 * (f + old) * u.dx;
        }
        old = f;
    }
    (mean, work)
}

#[test]
fn a_preload_is_a_force_and_nothing_else() {
    let (mean, work) = cycle("preload", &[-3.0], 2.0, 5.0);
    assert!((mean + 3.0).abs() < 1e-9 && work.abs() < 1e-9, "{mean} {work}");
}

/// The even part of the force does no work over a sine, whatever beta: pi c w X^2; its mean is c beta times that of |v|, 2/pi w X.
#[test]
fn asymmetric_damping_has_the_loss_of_its_mean_and_a_force_that_grows_with_velocity() {
    for beta in [-1.0, -0.3, 0.0, 0.7, 1.0] {
        let (c, x, w) = (3.0, 0.2, 4.0);
        let (mean, work) = cycle("asymmetric_damping", &[c, beta], x, w);
        assert!((work / (std::f64::consts::PI * c * w * x * x) - 1.0).abs() < 1e-6, "{beta}: {work}");
        assert!((mean - c * beta * 2.0 / std::f64::consts::PI * w * x).abs() < 1e-6, "{beta}: {mean}");
    }
    assert_eq!(at("asymmetric_damping", 0.0, -2.0, &[3.0, 1.0]), 0.0);
}

/// Loss 4 c V X (1/a - pi/(2 a^2) + J/a^2), a = V/v0 < 1, J = 2/sqrt(1 - a^2) atan(sqrt((1 - a)/(1 + a))), the integral of 1/(1 + a cos)
/// over a quarter turn.
#[test]
fn digressive_damping_has_the_loss_of_its_closed_form_and_levels_off() {
    let (c, x, w) = (3.0, 0.2, 4.0);
    for a in [0.1f64, 0.5, 0.9] {
        let v = x * w;
        let j = 2.0 / (1.0 - a * a).sqrt() * ((1.0 - a) / (1.0 + a)).sqrt().atan();
        let exact = 4.0 * c * v * x * (1.0 / a - std::f64::consts::FRAC_PI_2 / (a * a) + j / (a * a));
        let (_, work) = cycle("digressive_damping", &[c, v / a], x, w);
        assert!((work / exact - 1.0).abs() < 1e-6, "{a}: {work} against {exact}");
    }
    assert!((at("digressive_damping", 0.0, -1e6, &[3.0, 0.1]) + 0.3).abs() < 1e-6);
}

#[test]
fn smooth_coulomb_is_a_damper_below_its_width_and_friction_above() {
    let (f, x, w) = (2.0, 0.5, 1.0);
    let (_, narrow) = cycle("smooth_coulomb", &[f, 1e-4], x, w);
    assert!((narrow / (4.0 * f * x) - 1.0).abs() < 1e-3, "{narrow}");
    let (_, wide) = cycle("smooth_coulomb", &[f, 100.0], x, w);
    assert!((wide / (std::f64::consts::PI * f / 100.0 * x * x * w) - 1.0).abs() < 1e-4, "{wide}");
    assert!((at("smooth_coulomb", 0.0, 0.3, &[f, 0.3]) / f - 1f64.tanh()).abs() < 1e-12);
}

/// Rigid: the loss is twice the area under the normal force over the travel. Elastic under a normal force that hardly changes: a slider
/// behind a spring.
#[test]
fn wedge_friction_loses_twice_the_area_under_its_normal_force() {
    let (k, x) = (3.0, 0.5);
    let loss = |x0: f64, side: f64, r: f64| cycle("wedge_friction", &[k, x0, side, r], x, 1.0).1;
    for (x0, side, exact) in [
        (-1.0, 1.0, 2.0 * k * 2.0 * x),
        (0.1, 1.0, k * (x - 0.1) * (x - 0.1)),
        (0.1, -1.0, k * (x - 0.1) * (x - 0.1)),
        (0.0, 0.0, 2.0 * k * x * x),
    ] {
        let work = loss(x0, side, 1e5);
        assert!((work / exact - 1.0).abs() < 1e-3, "{x0} {side}: {work} against {exact}");
    }
    // Far from lift-off, N = 100: force k N, slip displacement N / r.
    let (far, slip) = (loss(-100.0, 1.0, 1000.0), 4.0 * k * 100.0 * (x - 0.1));
    assert!((far / slip - 1.0).abs() < 0.01, "{far} against {slip}");
}

/// m v dv/dx = -k x^n (1 + chi v): the impact ends at the speed w of chi v - ln(1 + chi v) = -chi w - ln(1 - chi w), whatever n.
#[test]
fn hunt_crossley_gives_back_the_speed_of_its_closed_form() {
    for (n, chi) in [(1.0, 0.5), (1.5, 0.5), (2.0, 0.1)] {
        let p = [400.0, 0.0, chi, 1.0, n, 0.3];
        let (mut x, mut v, dt) = (0.0f64, 1.0, 2e-6);
        loop {
            // Stoermer-Verlet with the force at the half step's speed.
            x += 0.5 * dt * v;
            v -= dt * at("hunt_crossley", x, v - 0.5 * dt * at("hunt_crossley", x, v, &p), &p);
            x += 0.5 * dt * v;
            if x < 0.0 {
                break;
            }
        }
        let (before, after) = (chi - (1.0 + chi).ln(), chi * v - (1.0 + chi * v).ln());
        assert!((after / before - 1.0).abs() < 1e-3, "n {n}, chi {chi}: {v} leaves {after} of {before}");
        assert!((-v - (1.0 - 2.0 / 3.0 * chi)).abs() < 0.5 * chi * chi, "n {n}, chi {chi}: {v}");
    }
    for (x, v) in [(0.5, 1.0), (0.5, -9.0), (-0.9, 0.2), (0.1, 3.0)] {
        let (hc, hertz) =
            (at("hunt_crossley", x, v, &[7.0, 0.2, 0.3, 0.0, 1.5, 0.1]), at("contact", x, v, &[7.0, 0.2, 0.0, 1.5, 0.1, 0.2]));
        assert!((hc - hertz).abs() < 1e-12, "{x} {v}: {hc} {hertz}");
    }
}

#[test]
fn a_saturating_spring_levels_off() {
    let f = |x: f64| at("saturating_stiffness", x, 0.0, &[5.0, 0.2]);
    assert!((f(1e-6) - 5e-6).abs() < 1e-12 && (f(0.2) - 0.5f64.sqrt()).abs() < 1e-12 && (f(-1e6) + 1.0).abs() < 1e-9);
}

/// Without a waist it is Bouc-Wen; along a monotonic path with n = 1 in the pinched stretch dz/dx = h (1 - z)/d, by a fine Runge-Kutta.
#[test]
fn pinched_bouc_wen_is_bouc_wen_with_a_waist() {
    let path: Vec<f64> = (1..600).map(|k| (0.05 * k as f64).sin()).collect();
    let (plain, none) = (
        along(law("bouc_wen"), &[1.0, 0.2, 2.0, 0.7], 1.0, &path),
        along(law("pinched_bouc_wen"), &[1.0, 0.2, 0.0, 0.1, 0.2, 2.0, 0.7], 1.0, &path),
    );
    assert!(plain.iter().zip(&none).all(|(a, b)| (a - b).abs() < 2e-3));
    let (zeta, q, w, d, end) = (0.8, 0.1, 0.2, 0.5, 0.9);
    let rate = |z: f64| (1.0 - zeta * (-((z - q) / w).powi(2)).exp()) * (1.0 - z) / d;
    let (mut exact, steps) = (0.0, 20_000);
    let dx = end / steps as f64;
    for _ in 0..steps {
        let k1 = rate(exact);
        let k2 = rate(exact + 0.5 * dx * k1);
        let k3 = rate(exact + dx * (2.0 * k2 - k1));
        exact += dx / 6.0 * (k1 + 4.0 * k2 + k3);
    }
    let path: Vec<f64> = (1..=60).map(|k| end * k as f64 / 60.0).collect();
    let last = *along(law("pinched_bouc_wen"), &[1.0, d, zeta, q, w, 1.0, 0.5], 0.1, &path).last().unwrap();
    assert!((last - exact).abs() < 1e-4, "{last} against {exact}");
    // The waist: at the crossing of zero force the loop is softer than above it.
    let slope = |z: f64| rate(z) * d / (1.0 - z);
    assert!(slope(q) < 0.3 && slope(0.7) > 0.95);
}

#[test]
fn fractional_zener_is_the_cole_cole_law_with_its_limits() {
    for alpha in [0.2, 0.4, 0.6, 0.75] {
        let p = [3.0, 0.1, alpha];
        for k in -30..=30 {
            let w = 10.0 * 10f64.powf(0.1 * k as f64);
            let z = law("fractional_zener").stiffness(Complex64::new(0.0, w), &p).unwrap();
            let u = Complex64::new(0.0, w * 0.1).powf(alpha);
            let exact = u / (u + 1.0) * 3.0;
            assert!((z - exact).norm() < 0.007 * 3.0, "order {alpha} at {w} rad/s: {z} against {exact}");
        }
    }
}

/// A drop of the body by a unit step of velocity: the hidden mass rings at its damped frequency, r = -exp(-zeta w t) sin(wd t)/wd.
#[test]
fn the_absorber_rings_as_a_mass_on_its_spring() {
    let (f0, zeta, dt) = (2.0f64, 0.05f64, 1e-4f64);
    let (w, wd) = (TAU * f0, TAU * f0 * (1.0 - zeta * zeta).sqrt());
    let law = law("absorber");
    // From rest with the velocity at hand from the start of the first step on.
    let (mut s, mut gap) = (vec![0.0, 0.0, 1.0], 0.0f64);
    for k in 1..=20_000 {
        let t = k as f64 * dt;
        let f = law.value(&Inputs { x: t, v: 1.0, a: 0.0, dx: dt }, dt, &mut s, &[3.0, f0, zeta]);
        // y'' = -(w^2 r + 2 zeta w r').
        let (decay, (sin, cos)) = ((-zeta * w * t).exp(), (wd * t).sin_cos());
        let (r, dr) = (-decay * sin / wd, -decay * (cos - zeta * w / wd * sin));
        gap = gap.max((f + 3.0 * (w * w * r + 2.0 * zeta * w * dr)).abs());
    }
    assert!(gap < 1e-3 * 3.0 * w, "{gap}");
    // Slow motion feels its mass.
    let z = law.stiffness(Complex64::new(0.0, 0.01), &[3.0, f0, zeta]).unwrap();
    assert!((z + 3.0 * 1e-4).norm() < 1e-8, "{z}");
}
