use super::*;

#[test]
fn nist_standard_errors_agree_with_the_certified_ones() {
    let mut worst = (f64::INFINITY, String::new());
    for problem in nist::problems().unwrap() {
        let (m, n) = (problem.y.len(), problem.certified.len());
        // whitened by the certified residual standard deviation, the noise is one and `std` itself is what NIST certifies
        let noise = (problem.certified_rss / (m - n) as f64).sqrt();
        let f = |p: &[f64]| problem.jacobian(p).map(|(r, j)| (r / noise, j / noise));
        let o = FitOptions::new((0..n).map(|j| format!("b{}", j + 1)));
        let found = fit(&With { n, m, f }, &problem.starts[1], &o, &Monitor::default()).unwrap();
        let u = uncertainty(&found, &o, &UncertaintyOptions::default()).unwrap();
        for (parameter, certified) in u.parameters.iter().zip(&problem.certified_std) {
            let std = parameter.std.unwrap_or_else(|| panic!("{} {}: {:?}", problem.name, parameter.name, parameter.note));
            let digits = nist::digits(std, *certified);
            if digits < worst.0 {
                worst = (digits, format!("{} {}", problem.name, parameter.name));
            }
            assert!(digits >= 4.0, "{} {}: {std:e} against {certified:e}", problem.name, parameter.name);
        }
    }
    println!("standard errors: at least {:.1} digits ({})", worst.0, worst.1);
}

fn linear(rows: &[&[f64]], b: &[f64]) -> Linear {
    let n = rows[0].len();
    Linear { a: DMatrix::from_fn(rows.len(), n, |i, j| rows[i][j]), b: DVector::from_row_slice(b) }
}

#[test]
fn a_null_combination_is_named_and_gives_no_small_number() {
    // only k1 + k2 is seen, in unlike units; k3 is well seen; k4 not at all
    let problem = linear(
        &[&[1e3, 1e-3, 0.0, 0.0], &[2e3, 2e-3, 1.0, 0.0], &[0.0, 0.0, 1.0, 0.0], &[1e3, 1e-3, -1.0, 0.0], &[3e3, 3e-3, 0.0, 0.0]],
        &[5.0, 11.0, 1.2, 4.1, 15.2],
    );
    let o = FitOptions::new(["k1", "k2", "k3", "k4"]);
    let found = fit(&problem, &[2e-3, 3e3, 1.0, 5.0], &o, &Monitor::default()).unwrap();
    assert!(found.termination.is_converged());
    // What is seen, not whether it may be zero.
    let u = uncertainty(&found, &o, &UncertaintyOptions::measured(vec![Measure::Position; 4])).unwrap();
    let identifiable: Vec<bool> = u.parameters.iter().map(|p| p.identifiable).collect();
    assert_eq!(identifiable, [false, false, true, false]);
    assert!(u.parameters[0].std.is_none() && u.parameters[1].std.is_none() && u.parameters[3].std.is_none());
    assert_eq!(u.unidentifiable.len(), 2, "{:?}", u.unidentifiable);
    let pair = u.unidentifiable.iter().find(|c| c.coefficients.len() == 2).unwrap();
    assert!(pair.label.contains("k1") && pair.label.contains("k2") && pair.label.contains(" - "), "{}", pair.label);
    assert!(u.unidentifiable.iter().any(|c| c.label == "k4"));
    // with k1 k2 merged into one column c = 1, 2, 0, 1, 3 the variance of k3 is that of an ordinary regression
    let merged = linear(&[&[1.0, 0.0], &[2.0, 1.0], &[0.0, 1.0], &[1.0, -1.0], &[3.0, 0.0]], &[5.0, 11.0, 1.2, 4.1, 15.2]);
    let inverse = (merged.a.transpose() * &merged.a).try_inverse().unwrap();
    approx::assert_relative_eq!(u.parameters[2].std.unwrap(), inverse[(1, 1)].sqrt(), max_relative = 1e-9);
}

#[test]
fn a_loosely_known_parameter_says_what_it_is_mixed_up_with() {
    // k1 and k2 act alike but for 1 %; k3 is seen alone and is nothing within its noise; k4 is known
    let rows: [&[f64]; 4] = [&[1.0, 1.0, 0.0, 0.0], &[1.0, 1.01, 0.0, 0.0], &[0.0, 0.0, 1.0, 0.0], &[0.0, 0.0, 0.0, 1.0]];
    let o = FitOptions::new(["k1", "k2", "k3", "k4"]);
    let found = fit(&linear(&rows, &[5.0, 5.01, 0.3, 40.0]), &[1.0; 4], &o, &Monitor::default()).unwrap();
    let u = uncertainty(&found, &o, &UncertaintyOptions::default()).unwrap();
    let note = |k: usize| u.parameters[k].note.as_deref().unwrap_or_default();
    let identifiable: Vec<bool> = u.parameters.iter().map(|p| p.identifiable).collect();
    assert_eq!(identifiable, [false, false, false, true], "{:?}", u.parameters);
    assert!(note(0).contains("mixed up with k2 (correlation -1.000)") && note(1).contains("mixed up with k1"), "{} | {}", note(0), note(1));
    assert_eq!((note(2), note(3)), ("zero is in its interval", ""));
}

#[test]
fn constraints_that_press_are_held() {
    // p0 wants to be negative; p1 and p2 want the wrong order and are tied to one value
    let problem = linear(&[&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[1.0, 1.0, 0.0]], &[-3.0, 4.0, 2.0, 3.0]);
    let mut o = options(3);
    o.constraints = Constraints::bounds(vec![0.0, f64::NEG_INFINITY, f64::NEG_INFINITY], vec![f64::INFINITY; 3]).order(1, 2, 0.0);
    let found = fit(&problem, &[1.0, 0.0, 1.0], &o, &Monitor::default()).unwrap();
    assert_eq!(found.p[0], 0.0);
    approx::assert_relative_eq!(found.p[1], 3.0, epsilon = 1e-12);
    let u = uncertainty(&found, &o, &UncertaintyOptions::default()).unwrap();
    assert!(u.parameters[0].at_bound && u.parameters[0].std.is_none() && u.parameters[0].identifiable);
    // tied: one value from three rows
    for k in [1, 2] {
        approx::assert_relative_eq!(u.parameters[k].std.unwrap(), (1.0f64 / 3.0).sqrt(), max_relative = 1e-9);
    }
    approx::assert_relative_eq!(u.correlation(1, 2).unwrap(), 1.0, max_relative = 1e-9);
}

/// Two springs in series, k1 = 400 seen well, k2 rigid: displacement F/k1 + F/k2 with noise 1e-3 of it.
fn series() -> impl LeastSquares {
    let f = |p: &[f64]| {
        let force = |i: usize| 10.0 * (i + 1) as f64;
        let sigma = 1e-4;
        let wobble = |i: usize| 0.7 * (5.0 * i as f64).sin();
        // the first spring is also measured alone
        let r = DVector::from_fn(20, |i, _| {
            let x = if i < 10 { force(i) * (1.0 / p[0] + 1.0 / p[1]) } else { force(i - 10) / p[0] };
            let y = if i < 10 { force(i) * (1.0 / 400.0 + 1.0 / 30e6) } else { force(i - 10) / 400.0 };
            (x - y) / sigma + wobble(i)
        });
        let j = DMatrix::from_fn(20, 2, |i, c| {
            let force = force(i % 10);
            if c == 1 && i >= 10 { 0.0 } else { -force / (p[c] * p[c]) / sigma }
        });
        Ok((r, j))
    };
    With { n: 2, m: 20, f }
}

#[test]
fn a_rigid_stiffness_has_an_infinite_interval() {
    let mut o = FitOptions::new(["k1", "k2"]);
    o.constraints.lower = vec![1.0, 1.0];
    let problem = series();
    let mut found = fit(&problem, &[300.0, 30e6], &o, &Monitor::default()).unwrap();
    // wherever the fit left k2, the statement is about the published value
    found.p[1] = 30e6;
    let (r, j) = problem.jacobian(&found.p).unwrap();
    (found.cost, found.residuals, found.jacobian) = (0.5 * r.norm_squared(), r, j);
    let mut u = uncertainty(&found, &o, &UncertaintyOptions::default()).unwrap();
    u.probe(&problem, &found, &o).unwrap();
    let k2 = &u.parameters[1];
    assert!(!k2.identifiable && k2.std.is_none() && k2.interval.1.is_none(), "{k2:?}");
    assert!(u.unidentifiable.iter().any(|c| c.label == "k2"));
    assert!(u.parameters[0].identifiable);
}

#[test]
fn a_strength_that_may_be_absent_is_not_identified_and_a_position_at_zero_is() {
    // y = a t + b t^2 with b = 0 within its noise: its deviation is known, and that it is there is not
    let t = |i: usize| 0.1 * i as f64;
    let rows = DMatrix::from_fn(50, 2, |i, c| [t(i), t(i).powi(2)][c] / 0.1);
    let b = DVector::from_fn(50, |i, _| 2.0 * t(i) / 0.1 + (9.0 * i as f64).sin());
    let problem = Linear { a: rows, b };
    let mut o = FitOptions::new(["a", "b"]);
    o.constraints.lower[1] = -10.0;
    let found = fit(&problem, &[1.0, 1.0], &o, &Monitor::default()).unwrap();
    let mut u = uncertainty(&found, &o, &UncertaintyOptions::default()).unwrap();
    u.probe(&problem, &found, &o).unwrap();
    assert!(!u.parameters[1].identifiable && u.parameters[1].std.is_some(), "{:?}", u.parameters[1]);
    let position = UncertaintyOptions::measured(vec![Measure::Strength, Measure::Position]);
    let u = uncertainty(&found, &o, &position).unwrap();
    assert!(u.parameters.iter().all(|p| p.identifiable && p.note.is_none()), "{:?}", u.parameters);
    assert!(uncertainty(&found, &o, &UncertaintyOptions::measured(vec![Measure::Position])).is_err());
}

/// `y = ln(p)` seen with a given deviation of the logarithm: the judgement is the same in every unit of p.
#[test]
fn a_logarithm_is_judged_by_factors_in_every_unit() {
    for unit in [1.0f64, 1e-3, 1e4] {
        for (deviation, known) in [(0.06, true), (2.0, true), (6.0, false)] {
            let problem = linear(&[&[1.0 / deviation]], &[(1.1 * unit).ln() / deviation]);
            let o = FitOptions::new(["n"]);
            let found = fit(&problem, &[unit.ln()], &o, &Monitor::default()).unwrap();
            let u = uncertainty(&found, &o, &UncertaintyOptions::measured(vec![Measure::Logarithm])).unwrap();
            let n = &u.parameters[0];
            assert_eq!((n.identifiable, n.std.is_some()), (known, known), "{unit} {deviation}: {n:?}");
            assert!(!known || n.note.is_none(), "{n:?}");
        }
    }
}

/// A relaxation time that is only known to be short, or only known to be long: the interval is open on that side, whatever the unit.
#[test]
fn a_logarithm_is_probed_to_both_sides() {
    for (rising, unit) in [(true, 1.0f64), (true, 1e-6), (false, 1.0), (false, 1e-6)] {
        // Saturates upwards or downwards, 4 sigma high.
        let f = move |p: &[f64]| {
            let u = (p[0] - unit.ln()) * if rising { 1.0 } else { -1.0 };
            let level = 4.0 / (1.0 + (-u).exp());
            let slope = level * (1.0 - level / 4.0) * if rising { 1.0 } else { -1.0 };
            Ok((DVector::from_element(1, level - 3.0), DMatrix::from_element(1, 1, slope)))
        };
        let problem = With { n: 1, m: 1, f };
        let o = FitOptions::new(["tau"]);
        let found = fit(&problem, &[unit.ln()], &o, &Monitor::default()).unwrap();
        let mut u = uncertainty(&found, &o, &UncertaintyOptions::measured(vec![Measure::Logarithm])).unwrap();
        u.probe(&problem, &found, &o).unwrap();
        let tau = &u.parameters[0];
        let (near, open) = if rising { tau.interval } else { (tau.interval.1, tau.interval.0) };
        assert!(!tau.identifiable && open.is_none() && near.is_some(), "{rising} {unit}: {tau:?}");
        let far = tau.open_to.unwrap();
        assert!((far > tau.value) == rising, "{tau:?}");
    }
}

#[test]
fn coverage_of_the_95_percent_intervals() {
    use rand::{Rng, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
    let truth = [1.0, 1.5, 0.3];
    let (draws, mut inside) = (400, 0);
    for _ in 0..draws {
        // unit normal noise by Box-Muller, 40 residuals, signal over noise 50
        let noise: Vec<f64> = (0..40)
            .map(|_| (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt() * (std::f64::consts::TAU * rng.random::<f64>()).cos())
            .collect();
        let f = |p: &[f64]| {
            let t = |i: usize| 0.1 * i as f64;
            let y = |p: &[f64], i: usize| 50.0 * (p[0] * (-p[1] * t(i)).exp() + p[2]);
            let r = DVector::from_fn(40, |i, _| y(p, i) - y(&truth, i) - noise[i]);
            let j = DMatrix::from_fn(40, 3, |i, c| 50.0 * [(-p[1] * t(i)).exp(), -p[0] * t(i) * (-p[1] * t(i)).exp(), 1.0][c]);
            Ok((r, j))
        };
        let found = fit(&With { n: 3, m: 40, f }, &[2.0, 1.0, 0.0], &options(3), &Monitor::default()).unwrap();
        let u = uncertainty(&found, &options(3), &UncertaintyOptions::default()).unwrap();
        inside += u.parameters.iter().zip(truth).filter(|(p, t)| p.interval.0.unwrap() <= *t && *t <= p.interval.1.unwrap()).count();
    }
    let coverage = inside as f64 / (3 * draws) as f64;
    println!("coverage of the 95 % intervals: {:.1} %", 100.0 * coverage);
    assert!((0.93..=0.97).contains(&coverage), "{coverage}");
}

#[test]
fn profiles_equal_the_covariance_on_a_linear_problem_and_show_open_ends() {
    let problem = linear(&[&[1.0, 0.5], &[0.3, 1.0], &[1.0, -1.0], &[2.0, 0.1]], &[1.0, 2.0, 0.0, 3.0]);
    let o = options(2);
    let found = fit(&problem, &[0.5, 0.5], &o, &Monitor::default()).unwrap();
    let u = uncertainty(&found, &o, &UncertaintyOptions::default()).unwrap();
    for k in 0..2 {
        let shape = profile(&problem, &found, k, u.parameters[k].std, &o, &Monitor::default()).unwrap();
        approx::assert_relative_eq!(shape.interval.0.unwrap(), u.parameters[k].interval.0.unwrap(), max_relative = 1e-3);
        approx::assert_relative_eq!(shape.interval.1.unwrap(), u.parameters[k].interval.1.unwrap(), max_relative = 1e-3);
        assert!(shape.better.is_none());
    }
    // the rigid spring: a lower end, no upper one
    let problem = series();
    let mut o = options(2);
    o.constraints.lower = vec![1.0, 1.0];
    let mut found = fit(&problem, &[300.0, 1e6], &o, &Monitor::default()).unwrap();
    found.start[1] = found.p[1];
    let shape = profile(&problem, &found, 1, None, &o, &Monitor::default()).unwrap();
    assert!(shape.interval.1.is_none(), "{shape:?}");
    let lower = shape.interval.0.unwrap();
    assert!((1e4..1e7).contains(&lower), "{lower:e}");
}

#[test]
fn the_gate_names_what_moves_nothing_and_what_is_out_of_reach() {
    let problem = linear(&[&[1.0, 0.0], &[1.0, 0.0], &[2.0, 0.0]], &[50.0, 51.0, 99.0]);
    let mut o = options(2);
    let report = gate(&problem, &[1.0, 1.0], &o, &Monitor::default()).unwrap();
    assert!(report.free[0].moves_residual && report.free[0].lowers_cost && !report.free[1].moves_residual && !report.free[1].lowers_cost);
    assert!(report.reachable && report.blocking.is_empty());
    o.constraints.upper[0] = 5.0;
    let report = gate(&problem, &[1.0, 1.0], &o, &Monitor::default()).unwrap();
    assert!(!report.reachable && report.blocked_share > 0.99, "{report:?}");
    assert_eq!(report.blocking[0].label, "p0 <= 5");
    // the data ask for 49.8 with sigma 1/sqrt(6): 110 standard deviations above the bound
    approx::assert_relative_eq!(report.blocking[0].pull, (299.0 / 6.0 - 5.0) * 6f64.sqrt(), max_relative = 1e-6);
    o.constraints.upper[0] = f64::INFINITY;
    o.priors = vec![Prior { index: 0, mean: 5.0, sigma: 0.01 }];
    let report = gate(&problem, &[1.0, 1.0], &o, &Monitor::default()).unwrap();
    assert!(!report.reachable && report.blocking[0].label == "prior of p0", "{report:?}");
}

#[test]
fn a_prior_is_one_more_measurement() {
    let problem = linear(&[&[1.0], &[1.0]], &[2.0, 4.0]);
    let mut o = options(1);
    o.priors = vec![Prior { index: 0, mean: 9.0, sigma: 0.5 }];
    let found = fit(&problem, &[0.0], &o, &Monitor::default()).unwrap();
    approx::assert_relative_eq!(found.p[0], (2.0 + 4.0 + 4.0 * 9.0) / 6.0, max_relative = 1e-12);
    let u = uncertainty(&found, &o, &UncertaintyOptions::default()).unwrap();
    approx::assert_relative_eq!(u.parameters[0].std.unwrap(), (1.0f64 / 6.0).sqrt(), max_relative = 1e-12);
    o.priors[0].sigma = 0.0;
    assert!(matches!(fit(&problem, &[0.0], &o, &Monitor::default()), Err(IdentifyError::NotFinite { .. })));
}

/// A line through 300 points: the bootstrap's deviations are those of ordinary regression with the scatter that is there, twice the stated one.
#[test]
fn the_bootstrap_of_a_line_has_the_deviations_of_regression() {
    use rand::{Rng, SeedableRng};
    let n = 300;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let noise: Vec<f64> = (0..n).map(|_| (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0).collect();
    let x = |i: usize| i as f64 / n as f64;
    let problem = Linear {
        a: DMatrix::from_fn(n, 2, |i, j| if j == 0 { 1.0 } else { x(i) }),
        b: DVector::from_fn(n, |i, _| 3.0 + 2.0 * x(i) + 2.0 * noise[i]),
    };
    let o = FitOptions::new(["a", "b"]);
    let found = fit(&problem, &[0.0, 0.0], &o, &Monitor::default()).unwrap();
    let indices: Vec<usize> = (0..400).collect();
    let seen = std::sync::atomic::AtomicUsize::new(0);
    let count = |_: &Replicate| {
        seen.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    let all = bootstrap(&problem, &found, &o, std::slice::from_ref(&(0..n)), (&indices, 11), &Monitor::default(), &count).unwrap();
    assert_eq!((all.len(), seen.into_inner()), (400, 400));
    let inverse = (problem.a.transpose() * &problem.a).try_inverse().unwrap();
    let scatter = (2.0 * found.cost / (n - 2) as f64).sqrt();
    assert!((scatter - 2.0).abs() < 0.2, "{scatter}");
    for k in 0..2 {
        let values: Vec<f64> = all.iter().map(|r| r.p.as_ref().unwrap()[k]).collect();
        let mean = values.iter().sum::<f64>() / 400.0;
        let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 399.0).sqrt();
        // 400 draws and blocks of 8 of 300 points: a fifth.
        approx::assert_relative_eq!(std, scatter * inverse[(k, k)].sqrt(), max_relative = 0.2);
        assert!((mean - found.p[k]).abs() < 4.0 * std / 20.0, "{mean} {}", found.p[k]);
    }
    // Replicate 7 alone is replicate 7 among all.
    let again = bootstrap(&problem, &found, &o, std::slice::from_ref(&(0..n)), (&[7], 11), &Monitor::default(), &|_| {}).unwrap();
    assert_eq!(again[0], all[7]);
    assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
}

/// A stiffness k exp(a (i - i0)) from ln k at shims that are known to a deviation: ordinary regression with errors of the abscissa, where the slope is known.
#[test]
fn what_conditions_are_known_to_widens_the_intervals() {
    let (noise, shim, slope) = (0.01, 0.05, 0.6);
    let at = [-1.0, 0.0, 1.0];
    let rows: Vec<Vec<f64>> = at.iter().flat_map(|i| [[1.0, *i], [1.0, *i]]).map(|r| r.iter().map(|x| x / noise).collect()).collect();
    let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    let problem = linear(&rows, &[0.0; 6]);
    let o = options(2);
    let found = fit(&problem, &[0.0, slope], &o, &Monitor::default()).unwrap();
    let positions = || UncertaintyOptions::measured(vec![Measure::Position; 2]);
    let plain = uncertainty(&found, &o, &positions()).unwrap();
    // Two readings a shim: each shim has one deviation, common to both.
    let spread = DMatrix::from_fn(6, 3, |row, shim_of| if row / 2 == shim_of { slope * shim / noise } else { 0.0 });
    let wide = uncertainty(&found, &o, &UncertaintyOptions { spread, ..positions() }).unwrap();
    let variance = |u: &Uncertainty, k: usize| u.parameters[k].std.unwrap().powi(2);
    approx::assert_relative_eq!(variance(&plain, 1), noise * noise / 4.0, max_relative = 1e-9);
    approx::assert_relative_eq!(variance(&wide, 1), noise * noise / 4.0 + (slope * shim).powi(2) / 2.0, max_relative = 1e-9);
    approx::assert_relative_eq!(variance(&wide, 0), noise * noise / 6.0 + (slope * shim).powi(2) / 3.0, max_relative = 1e-9);
}
