//! The likelihood on made-up tests: noise alone, a model error, and what each counts as.

use nalgebra::{DMatrix, DVector};

use crate::data::TestKind;
use crate::response::{BlockKind, Instruments, Misreading, Plan};

use super::record::Channel;
use super::{Evidence, Record, Seen, Settings, Variances, beside};

/// Deterministic numbers of variance 1.
fn noise(n: usize, seed: f64) -> DVector<f64> {
    DVector::from_fn(n, |i, _| {
        let u = |k: f64| ((i as f64 + 1.0) * k + seed).sin() * 43758.5453;
        let (a, b) = (u(12.9898).rem_euclid(1.0).max(1e-12), u(78.233).rem_euclid(1.0));
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    })
}

/// Tests of one loop each, noise of a hundredth of the response.
fn evidence(tests: usize) -> Evidence {
    let n = 81;
    let record = || Record {
        coefficients: crate::response::Coefficients::empty(n),
        channels: vec![Channel {
            range: 0..n,
            label: "force at c1.x".into(),
            kind: BlockKind::Loop,
            modes: 0,
            harmonics: crate::data::harmonic_of(200),
            least: 0.003,
            allowed: 0.0,
            free: 1.0,
            colour: 1.0,
        }],
        noise: vec![1e-4 / n as f64; n],
        size: vec![1.0 / n as f64; n],
        instruments: Instruments::none(n),
        scatters: true,
        curved: (2, 0.01),
        kind: TestKind::Cycle,
    };
    Evidence { records: (0..tests).map(|_| record()).collect(), settings: Settings::default() }
}

/// Residuals of noise and of an error of the given size in the third harmonic, one parameter along the first.
fn seen(tests: usize, error: f64) -> Vec<Seen> {
    drawn(0, tests, error)
}

/// The same, the noise another draw.
fn drawn(draw: usize, tests: usize, error: f64) -> Vec<Seen> {
    let of = |t: usize| {
        let mut r = noise(81, (draw * tests + t) as f64) * (1e-2 / 9.0);
        r[3] += error;
        let mut j = DMatrix::zeros(81, 1);
        j[(1, 0)] = 1.0;
        Seen { r, strengths: j.clone(), bends: DMatrix::zeros(j.nrows(), 0), j }
    };
    (0..tests).map(of).collect()
}

fn estimated(e: &Evidence, seen: &[Seen]) -> Variances {
    let once = e.estimate(seen, &e.independent(), &Variances::start(e, seen));
    e.estimate(seen, &e.independent(), &once)
}

#[test]
fn where_noise_rules_every_coefficient_is_a_fact() {
    let e = evidence(5);
    let one = seen(5, 0.0);
    let v = estimated(&e, &one);
    assert!(v.model_error(&e) < 0.005 && v.kappa.abs() < 0.3, "{v:?}");
    assert!(e.counts(&one, &v).n > 0.85 * 405.0);
    let (mut error, mut facts) = (0.0, 0.0);
    for draw in 0..8 {
        let seen = drawn(draw, 5, 0.0);
        let v = estimated(&e, &seen);
        let (own, n) = (v.model_error(&e), e.counts(&seen, &v).n);
        assert!(own < 0.006 && v.kappa.abs() < 0.3, "{draw}: {v:?} {n}");
        (error, facts) = (error + own / 8.0, facts + n / 8.0);
    }
    assert!(error < 0.005 && facts > 0.85 * 405.0, "{error} {facts}");
}

/// A model that leaves ten times the noise, whose coefficients count as few: under these counts noise of twice the size is no way out.
#[test]
fn what_counts_as_few_is_no_noise() {
    let e = evidence(3);
    let seen: Vec<Seen> = (0..3).map(|t| Seen { r: noise(81, t as f64) * (1e-1 / 9.0), ..drawn(0, 3, 0.0).swap_remove(t) }).collect();
    let start = Variances::start(&e, &seen);
    assert!((0.08..0.12).contains(&start.model_error(&e)), "all that is left: {start:?}");
    let counts = e.counts(&seen, &start);
    assert!(counts.n < 25.0, "{}", counts.n);
    let v = e.estimate(&seen, &counts, &start);
    assert!((0.07..0.14).contains(&v.model_error(&e)) && v.kappa.abs() < 0.05, "{v:?}");
    // The other summit: noise of twice the size and no error, which the coarsened square alone would allow.
    let other = Variances { tau: (0.003f64).ln(), kappa: 2f64.ln(), own: vec![vec![0.0]; 3], ..v.clone() };
    assert!(e.likelihood(&seen, &counts, &v) > e.likelihood(&seen, &counts, &other) + 30.0);
}

/// Errors of its own in every channel are worth less where they say no more than the common one.
#[test]
fn own_errors_are_integrated_out() {
    let e = evidence(2);
    let (counts, v) = (e.independent(), v_of(&e, 0.05));
    let d = 1e-4 / 81.0 + 0.05f64.powi(2) / 81.0;
    // 81 coefficients of which the error has the part p each know its logarithm by 2 p^2.
    let known = 81.0 * 2.0 * (0.05f64.powi(2) / 81.0 / d).powi(2);
    let apart = -2.0 * 0.5 * (1.0 + 0.49 * known).ln();
    approx::assert_relative_eq!(e.prior(&counts, &v), apart - 0.5 * ((-6.2f64).exp() / 0.02).powi(2), max_relative = 1e-9);
    // At the least error that is claimed there is nothing to fit.
    let least = Variances { own: vec![vec![-9.0]; 2], ..v };
    approx::assert_relative_eq!(e.prior(&counts, &least), -0.5 * ((-6.2f64).exp() / 0.02).powi(2) - 81.0 / 0.49, max_relative = 1e-9);
}

#[test]
fn a_model_error_is_found_and_counts_as_few() {
    let e = evidence(5);
    let seen = seen(5, 0.2);
    let v = estimated(&e, &seen);
    let error = v.model_error(&e);
    assert!((0.1..0.4).contains(&error), "{error}");
    let counts = e.counts(&seen, &v);
    assert!((counts.facts - 16.0).abs() < 1e-9 && counts.n < 30.0, "{} {}", counts.facts, counts.n);
    // An FRF's error counts as six facts a resonance, a row of a table as one.
    let mut lines = evidence(1);
    (lines.records[0].channels[0].kind, lines.records[0].channels[0].modes) = (BlockKind::Frf, 2);
    assert!((lines.counts(&seen[..1], &v_of(&lines, 0.2)).facts - 12.0).abs() < 1e-9);
    lines.records[0].channels[0].kind = BlockKind::Table;
    assert_eq!(lines.counts(&seen[..1], &v_of(&lines, 0.2)).n, 81.0);
}

fn v_of(e: &Evidence, error: f64) -> Variances {
    Variances {
        tau: error.ln(),
        kappa: 0.0,
        omega: -6.2,
        apart: [0.0; crate::data::TestKind::WORDS.len()],
        own: vec![vec![0.0]; e.records.len()],
    }
}

/// A test of one FRF in lines of equal noise and size, the residual a smooth function of the given power beside noise of exactly its size.
fn lines(smooth: f64) -> (Evidence, Vec<Seen>, DMatrix<f64>, f64) {
    let (mut e, n, nu) = (evidence(1), 81, 1e-4);
    let c = &mut e.records[0].channels[0];
    (c.kind, c.modes, c.least) = (BlockKind::Frf, 1, 0.001);
    (e.records[0].noise, e.records[0].size) = (vec![nu; n], vec![1.0; n]);
    super::facts::smooth(&mut e.records, &e.settings);
    let cosine = |i: usize, k: usize| (std::f64::consts::PI * k as f64 * (i as f64 + 0.5) / n as f64).cos();
    let mut basis = DMatrix::from_fn(n, 6, cosine);
    basis.column_iter_mut().for_each(|mut c| {
        let norm = c.norm();
        c /= norm;
    });
    let w = noise(n, 3.0);
    let rough = &w - &basis * basis.tr_mul(&w);
    let rough = &rough * ((n - 6) as f64 * nu).sqrt() / rough.norm();
    let r = rough + basis.column(2) * (smooth * n as f64).sqrt();
    let seen = vec![Seen { r, j: DMatrix::zeros(n, 0), strengths: DMatrix::zeros(n, 0), bends: DMatrix::zeros(n, 0) }];
    (e, seen, basis, nu)
}

/// The likelihood of an FRF is that of a smooth error of six dimensions, computed with its whole covariance.
#[test]
fn the_error_along_lines_is_a_smooth_function() {
    let (e, seen, basis, nu) = lines(4e-4);
    for error in [0.002, 0.02, 0.2] {
        let v = v_of(&e, error);
        let whole = DMatrix::identity(81, 81) * nu + &basis * basis.transpose() * (error * error * 81.0 / 6.0);
        let factor = whole.cholesky().unwrap();
        let direct = -factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>() - 0.5 * seen[0].r.dot(&factor.solve(&seen[0].r));
        approx::assert_relative_eq!(
            e.likelihood(&seen, &e.counts(&seen, &v), &v) - e.prior(&e.counts(&seen, &v), &v),
            direct,
            max_relative = 1e-9
        );
    }
}

/// A mode of 1 % damping is measured at one frequency. A model that computes it 10 % higher is likelier than one that holds everything still, though its peak
/// stands where hardly anything was measured. By the measured size alone it is the other way round.
#[test]
fn a_displaced_mode_is_likelier_than_none() {
    let mode = |w0: f64, zeta: f64| -> Vec<f64> {
        let line = |k: usize| {
            let w = 0.6 + 0.004 * k as f64;
            let h = 1.0 / num_complex::Complex::new(w0 * w0 - w * w, 2.0 * zeta * w0 * w);
            [h.re, h.im]
        };
        (0..200).flat_map(line).collect()
    };
    let (measured, displaced, still) = (mode(0.9, 0.01), mode(1.0, 0.01), mode(1.0, 1.0));
    let gains = |signal: &[f64]| {
        let mut e = evidence(1);
        let c = &mut e.records[0].channels[0];
        (c.kind, c.modes, c.least, c.range) = (BlockKind::Frf, 1, 0.001, 0..400);
        let size = super::record::sizes(&measured, signal, c, e.settings.neighbours);
        (e.records[0].noise, e.records[0].size, e.records[0].instruments) = (vec![1e-4; 400], size, Instruments::none(400));
        super::facts::smooth(&mut e.records, &e.settings);
        let likelihood = |computed: &[f64]| {
            let r = DVector::from_iterator(400, computed.iter().zip(&measured).map(|(c, m)| c - m));
            let seen = [Seen { r, j: DMatrix::zeros(400, 0), strengths: DMatrix::zeros(400, 0), bends: DMatrix::zeros(400, 0) }];
            let v = e.estimate(&seen, &e.independent(), &Variances::start(&e, &seen));
            e.likelihood(&seen, &e.independent(), &v)
        };
        likelihood(&displaced) - likelihood(&still)
    };
    assert!(gains(&displaced) > 0.0 && gains(&measured) < 0.0, "{} {}", gains(&displaced), gains(&measured));
}

/// What a study allows its model along the lines of an FRF is an error of the model: who takes it away gains little, and beyond it there is none.
#[test]
fn what_is_allowed_along_lines_is_no_effect() {
    let of = |smooth: f64, allowed: f64| {
        let (mut e, seen, ..) = lines(smooth);
        let c = &mut e.records[0].channels[0];
        (c.least, c.allowed) = (c.least.max(allowed), allowed);
        let v = estimated(&e, &seen);
        (e.likelihood(&seen, &e.independent(), &v), v.model_error(&e))
    };
    let gains = |allowed: f64| of(0.0, allowed).0 - of(4e-4, allowed).0;
    assert!(gains(0.0) > 10.0 && gains(0.03) < 2.0, "{} {}", gains(0.0), gains(0.03));
    assert!(of(4e-4, 0.0).1 > 0.008 && of(4e-4, 0.03).1 == 0.0);
    // An error beyond what is allowed is one.
    assert!(of(0.04, 0.03).1 > 0.05, "{}", of(0.04, 0.03).1);
}

/// An error of twice the noise's power is seen with its size, though it lies in one of the six directions: a fact of it shows in many lines.
#[test]
fn an_error_along_lines_is_no_noise() {
    let (e, seen, ..) = lines(2e-4);
    let start = Variances::start(&e, &seen);
    let counts = e.counts(&seen, &start);
    let v = e.estimate(&seen, &counts, &e.estimate(&seen, &counts, &start));
    assert!((0.008..0.03).contains(&v.model_error(&e)), "{v:?}");
    let none = Variances { tau: (0.001f64).ln(), ..v_of(&e, 0.001) };
    assert!(e.likelihood(&seen, &counts, &v) > e.likelihood(&seen, &counts, &none) + 20.0);
}

/// The likelihood of independent coefficients is the sum of Gaussian ones, the constant left out.
#[test]
fn the_likelihood_is_that_of_its_covariance() {
    let e = evidence(2);
    let (mut seen, v) = (seen(2, 0.05), v_of(&evidence(2), 0.05));
    seen.iter_mut().for_each(|s| s.strengths = DMatrix::zeros(81, 0));
    let d = 1e-4 / 81.0 + 0.05f64.powi(2) / 81.0;
    let direct: f64 = seen.iter().flat_map(|s| s.r.iter()).map(|r| -0.5 * (d.ln() + r * r / d)).sum();
    approx::assert_relative_eq!(e.likelihood(&seen, &e.independent(), &v) - e.prior(&e.independent(), &v), direct, max_relative = 1e-6);
    // Whitened residuals have the same sum of squares.
    assert!(e.over_noise(&seen, &v) > 1.5);
}

#[test]
fn a_strength_that_differs_from_test_to_test_is_no_model_error() {
    let e = evidence(6);
    let mut seen = seen(6, 0.0);
    for (t, s) in seen.iter_mut().enumerate() {
        s.r[1] += [0.03, -0.02, 0.025, -0.03, 0.01, -0.015][t];
    }
    let v = estimated(&e, &seen);
    assert!((0.01..=0.0401).contains(&v.omega.exp()) && v.model_error(&e) < 0.006, "{v:?}");
}

/// Records of one event beside loops that are means of many cycles: strengths that scatter ten times as much there are none of the model's error, and no scatter of
/// the loops.
#[test]
fn each_kind_of_test_scatters_by_itself() {
    let mut e = evidence(8);
    e.records[4..].iter_mut().for_each(|r| r.kind = TestKind::Transient);
    let mut seen = seen(8, 0.0);
    for (t, s) in seen.iter_mut().enumerate() {
        s.r[1] += [0.003, -0.002, 0.0025, -0.003, 0.03, -0.02, 0.025, -0.03][t];
    }
    let v = estimated(&e, &seen);
    let [loops, records] = [0, 4].map(|t| v.scatter(&e.records[t]).exp());
    assert!(loops < 0.006 && (0.015..=0.0401).contains(&records) && v.model_error(&e) < 0.006, "{loops} {records} {v:?}");
    // Of one kind alone there is one width.
    let v = estimated(&evidence(4), &seen[4..]);
    assert!(v.apart.iter().all(|a| *a == 0.0) && (0.015..=0.0401).contains(&v.omega.exp()), "{v:?}");
}

/// What varies alike is as good as its triangular factor: 81 coefficients of one noise against 81 of noises that differ by rounding.
#[test]
fn coefficients_that_vary_alike_say_together_what_each_says_by_itself() {
    let (lots, seen) = (evidence(3), seen(3, 0.1));
    let mut each = lots.clone();
    each.records.iter_mut().for_each(|r| r.noise.iter_mut().enumerate().for_each(|(i, n)| *n *= 1.0 + 1e-13 * i as f64));
    let (counts, v) = (lots.independent(), v_of(&lots, 0.05));
    assert_eq!(lots.records[0].alike(&counts.z[0]).len(), 1);
    assert_eq!(each.records[0].alike(&counts.z[0]).len(), 81);
    let of = |e: &Evidence| {
        let squares = super::likelihood::Squares::of(e, &e.grams(&seen, &counts), &v);
        super::likelihood::restricted(e, &super::common::Common::of(e), &squares, &seen, &v).unwrap()
    };
    approx::assert_relative_eq!(of(&lots), of(&each), max_relative = 1e-10);
}

/// Neighbouring lines that are alike, on a curve that bends: `(1 + rho) / (1 - rho)` of the noise of a mean over them.
#[test]
fn the_colour_of_noise_is_told_from_its_roughness() {
    for (rho, put_in) in [(0.0f64, 1.0), (0.6, 4.0)] {
        let (w, n) = (noise(2000, 7.0), 1000);
        let mut lines = vec![0.0; 2 * n];
        for part in 0..2 {
            let mut walk = w[part];
            for k in 0..n {
                walk = rho * walk + (1.0 - rho * rho).sqrt() * w[2 * k + part];
                lines[2 * k + part] = 100.0 * (k as f64 / 60.0).sin() + walk;
            }
        }
        let told = super::record::colour(&[(&lines, &vec![1.0; 2 * n])], &Settings::default());
        assert!((told / put_in - 1.0).abs() < 0.3, "{told} for {put_in}");
    }
}

/// A model that errs by 1 % on loops and by 3 % on FRFs does so in tests that it has not seen; what it has never seen it misses as all do.
#[test]
fn a_channel_errs_elsewhere_as_those_of_its_name_do() {
    let mut fitted = evidence(3);
    (fitted.records[2].channels[0].kind, fitted.records[2].channels[0].label) = (BlockKind::Frf, "receptance m1.x/m1.x".into());
    let (low, high) = (0.01f64.ln(), 0.03f64.ln());
    let v = Variances { own: vec![vec![low], vec![low], vec![high]], tau: 0.0, ..v_of(&fitted, 1.0) };
    let mut held = fitted.clone();
    held.records[0].channels[0].label = "force at c9.x".into();
    let errors = v.carried(&fitted, &held).own;
    approx::assert_relative_eq!(errors[1][0], low, max_relative = 1e-12);
    approx::assert_relative_eq!(errors[2][0], high, max_relative = 1e-12);
    approx::assert_relative_eq!(errors[0][0], (2.0 * low + high) / 3.0, max_relative = 1e-12);
}

/// A step to the least of a quadratic cost takes as many nats as it was said to, a prior with it.
#[test]
fn a_step_gains_what_it_promises() {
    let (e, v) = (evidence(2), v_of(&evidence(2), 0.02));
    let counts = e.independent();
    let mut begun = drawn(3, 2, 0.05);
    for (t, s) in begun.iter_mut().enumerate() {
        s.j = DMatrix::from_columns(&[noise(81, 11.0 + t as f64) / 9.0, noise(81, 17.0 + t as f64) / 9.0]);
        s.r += &s.j * DVector::from_vec(vec![0.3, -0.2]);
    }
    let (value, mean, sigma) = (0.4, 0.1, 0.5);
    let cost = |d: &DVector<f64>| {
        let moved: Vec<Seen> = begun.iter().map(|s| Seen { r: &s.r + &s.j * d, ..s.clone() }).collect();
        0.5 * (e.squares(&moved, &counts, &v) + ((value + d[0] - mean) / sigma).powi(2))
    };
    let promised = e.within_a_step(&begun, &counts, &v, &[(0, value, mean, sigma)]).unwrap();
    // The least by differences of the quadratic cost itself.
    let unit = |k: usize, h: f64| DVector::from_fn(2, |i, _| if i == k { h } else { 0.0 });
    let zero = DVector::zeros(2);
    let g = DVector::from_fn(2, |k, _| (cost(&unit(k, 1.0)) - cost(&unit(k, -1.0))) / 2.0);
    let h = DMatrix::from_fn(2, 2, |i, k| {
        let (i, k) = (unit(i, 1.0), unit(k, 1.0));
        (cost(&(&i + &k)) - cost(&(&i - &k)) - cost(&(&k - &i)) + cost(&(-&i - &k))) / 4.0
    });
    let least = -h.lu().solve(&g).unwrap();
    approx::assert_relative_eq!(promised, cost(&zero) - cost(&least), max_relative = 1e-6);
}

/// A decay of sixteen cycles whose spring is 1.5 % stiffer than the model's ends three quarters of a radian ahead of it: slope and curvature together say so, the slope alone
/// leaves the square of the angle.
#[test]
fn the_curvature_of_a_record_takes_what_its_slope_leaves_of_a_stiffer_spring() {
    use crate::data::{Channel, Control, Role, Test};
    use crate::model::{Axis, Body, Model, System};
    let model = Model::joined(vec![Body::fixed("ground"), Body::new("m", 1.0, &[Axis::X])], &[("c", "ground", "m")]).unwrap();
    let of = |k: f64| {
        let sprung = System::new(model.clone()).and("linear_stiffness", "c.x", &[("k", k)]).unwrap();
        sprung.and("viscous", "c.x", &[("c", 2.0)]).unwrap()
    };
    let time: Vec<f64> = (0..800).map(|k| k as f64 * 2e-3).collect();
    let push: Vec<f64> =
        time.iter().map(|t| if *t < 0.02 { 50.0 * (std::f64::consts::PI * t / 0.02).sin().powi(2) } else { 0.0 }).collect();
    let test = |x: Vec<f64>| {
        let channels = vec![Channel::new(Role::Force, "m.x", push.clone()), Channel::new(Role::Displacement, "m.x", x).with_sigma(1e-6)];
        Plan::new(&Test::transient("decay", Control::Force, time.clone(), channels).unwrap(), &model).unwrap()
    };
    let stiffer = of(4060.0);
    let plan = test(vec![0.0; 800]);
    let plan = test(plan.evaluate(&stiffer, &[], false).unwrap().values);
    let system = of(4000.0);
    let record = &Evidence::new(&[&plan], &system, &Settings::default()).records[0];
    let free = system.free();
    let seen = record.see(&plan, &plan.evaluate(&system, &free, true).unwrap(), &system, &free);
    assert_eq!(seen.bends.ncols(), 2);
    let left = |columns: &DMatrix<f64>| {
        let fitted = columns * columns.clone().svd(true, true).solve(&seen.r, 1e-12).unwrap();
        (&seen.r - fitted).norm() / seen.r.norm()
    };
    let (slope, both) = (left(&seen.strengths), left(&beside(&seen.strengths, &seen.bends)));
    assert!(slope > 0.05 && both < 0.25 * slope, "{slope} {both}");
}

/// An instrument that is four standard deviations off is read as such, shrunk by what noise leaves open; beside it a good one is at rest.
#[test]
fn a_reading_beyond_tolerance_is_told_in_its_standard_deviations() {
    let mut e = evidence(2);
    let (n, std) = (81, 0.01);
    let column = DMatrix::from_fn(n, 1, |i, _| if i == 0 { std } else { 0.0 });
    e.records.iter_mut().for_each(|r| r.instruments = Instruments { columns: column.clone(), of: vec![(0, Misreading::Offset, std)] });
    let mut seen = seen(2, 0.0);
    seen[0].r[0] = 4.0 * std;
    seen[1].r[0] = 0.0;
    let v = Variances { tau: -30.0, ..Variances::start(&e, &seen) };
    let read = e.readings(&seen, &e.independent(), &v);
    // (B'WB) / (1 + B'WB) of it, noise of variance 1e-4 / 81 beside the least error of the model.
    let noise = (1e-4 + 0.003f64.powi(2)) / n as f64;
    let part = std * std / (std * std + noise);
    assert!((read[0][0] - 4.0 * part).abs() < 0.05, "{read:?}, {part}");
    assert!(read[1][0].abs() < 1e-9);
}

/// Six tests of one sensor, all of them off by half of what its zero may be off by. That is a fact or so, and six where each test has a sensor of its own. The likelihood
/// is that of the whole covariance.
#[test]
fn what_a_sensor_misreads_in_all_tests_alike_is_one_fact() {
    let std = 0.01;
    let of = |label: &dyn Fn(usize) -> String| {
        let mut e = evidence(6);
        for (t, r) in e.records.iter_mut().enumerate() {
            let columns = DMatrix::from_fn(81, 1, |i, _| if i == 0 { std } else { 0.0 });
            (r.instruments, r.channels[0].label) = (Instruments { columns, of: vec![(0, Misreading::Offset, std)] }, label(t));
        }
        e
    };
    let (one, each) = (of(&|_| "force at c1.x".into()), of(&|t| format!("force at c{t}.x")));
    let mut off = seen(6, 0.0);
    off.iter_mut().for_each(|s| (s.r[0], s.strengths) = (0.5 * std, DMatrix::zeros(81, 0)));
    let mut right = off.clone();
    right.iter_mut().for_each(|s| s.r[0] = 0.0);
    let v = Variances { tau: -30.0, omega: one.settings.no_scatter, ..Variances::start(&one, &off) };
    let counts = one.independent();
    let nats = |e: &Evidence| e.likelihood(&right, &counts, &v) - e.likelihood(&off, &counts, &v);
    // By the covariance of the six means: noise and the least error of the model, half of the zero each test's, half the sensor's.
    let noise = (1e-4 + 0.003f64.powi(2)) / 81.0;
    let whole = DMatrix::from_fn(6, 6, |i, k| 0.5 * std * std * if i == k { 2.0 } else { 1.0 } + if i == k { noise } else { 0.0 });
    let r = DVector::repeat(6, 0.5 * std);
    approx::assert_relative_eq!(nats(&one), 0.5 * r.dot(&whole.lu().solve(&r).unwrap()), max_relative = 1e-6);
    approx::assert_relative_eq!(nats(&each), 3.0 * 0.25 / (1.0 + noise / (std * std)), max_relative = 1e-6);
    // What estimates variances says the same.
    let restricted = |e: &Evidence, seen: &[Seen]| {
        super::likelihood::restricted(
            e,
            &super::common::Common::of(e),
            &super::likelihood::Squares::of(e, &e.grams(seen, &counts), &v),
            seen,
            &v,
        )
        .unwrap()
    };
    approx::assert_relative_eq!(restricted(&one, &right) - restricted(&one, &off), nats(&one), max_relative = 1e-6);
}

/// A test that was foretold within twice the error of the fitted ones tells little against a model; under that error alone it would refute it by a hundred nats.
/// Where the error is as on the fitted ones the two say the same, but for what the spread of errors costs.
#[test]
fn a_held_out_test_allows_for_how_unevenly_models_err() {
    let e = evidence(1);
    let counts = e.independent();
    let v = Variances { kappa: 0.0, tau: 0.01f64.ln(), omega: e.settings.no_scatter, apart: Default::default(), own: vec![vec![0.0]] };
    let erring = |by: f64| {
        let r = DVector::from_fn(81, |i, _| by / 9.0 * if i % 2 == 0 { 1.0 } else { -1.0 });
        let none = DMatrix::zeros(81, 0);
        vec![Seen { r, strengths: none.clone(), bends: none.clone(), j: none }]
    };
    let plug = |seen: &[Seen]| e.likelihood(seen, &counts, &v) - e.prior(&counts, &v);
    // Error of 1 % beside noise of 1 %.
    let (as_fitted, thrice) = (erring(0.01 * 2f64.sqrt()), erring(0.03 * 2f64.sqrt()));
    assert!((e.predictive(&as_fitted, &counts, &v) - plug(&as_fitted)).abs() < 4.0);
    assert!(plug(&as_fitted) - plug(&thrice) > 300.0);
    assert!(e.predictive(&as_fitted, &counts, &v) - e.predictive(&thrice, &counts, &v) < 120.0);

    // What a model gets wrong by three hundred times its error costs by the logarithm of that, not by its square. By Laplace's method: half a logarithm of the
    // variance a coefficient (81 of them; noise and model error alike before), the prior at the factor, and how well either knows its factor.
    let far = e.predictive(&as_fitted, &counts, &v) - e.predictive(&erring(3.0), &counts, &v);
    let (factor, spread) = (300f64.ln(), 0.49);
    let (knows, knew) = (2.0 * 81.0 + 1.0 / spread, 0.5 * 81.0 + 1.0 / spread);
    let prior = 0.5 * factor * factor / spread - 0.5 * (factor / spread).powi(2) / knows;
    approx::assert_relative_eq!(far, 0.5 * 81.0 * (9.0 / 2e-4f64).ln() + prior + 0.5 * (knows / knew).ln(), max_relative = 2e-3);
}

#[test]
fn a_sum_of_logarithms_is_that_of_its_products() {
    let values: Vec<(f64, f64)> =
        (0..500).map(|k| (if k % 100 < 60 { 0.7 } else { 2.0 }, 10f64.powi(k % 37 - 30) * (1.0 + f64::from(k)))).collect();
    let mut sum = super::record::LogSum::default();
    values.iter().for_each(|(weight, value)| sum.add(*weight, *value));
    approx::assert_relative_eq!(sum.total(), values.iter().map(|(w, v)| w * v.ln()).sum::<f64>(), max_relative = 1e-12);
    assert_eq!(super::record::LogSum::default().total(), 0.0);
}
