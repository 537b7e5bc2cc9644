use super::*;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// `CASES=20000 cargo test ...` runs more of them than every day's test.
fn cases(usual: u32) -> u32 {
    std::env::var("CASES").ok().and_then(|c| c.parse().ok()).unwrap_or(usual)
}

/// A random linear problem with bounds, a chain of orders and a feasible start; columns differ by up to eight decades.
fn problem() -> impl Strategy<Value = (Linear, Constraints, Vec<f64>)> {
    (2usize..7, 1usize..4).prop_flat_map(|(n, extra)| {
        let m = n + extra;
        let values = (
            proptest::collection::vec(-1.0..1.0f64, m * n + m),
            proptest::collection::vec((-4.0..4.0f64, 0.0..1.0f64, 0.0..1.0f64, 0u8..4), n),
        );
        (values, proptest::collection::vec((0..n, 0..n, 0.0..0.5f64), 0..4), proptest::collection::vec(-1.0..1.0f64, n + 1)).prop_map(
            move |((entries, columns), orders, row)| {
                let scale: Vec<f64> = columns.iter().map(|c| 10f64.powf(c.0)).collect();
                // parameters live in units 1/scale, so that all pull alike
                let a = DMatrix::from_fn(m, n, |i, j| entries[i * n + j] * scale[j]);
                let b = DVector::from_fn(m, |i, _| 2.0 * entries[m * n + i]);
                let start: Vec<f64> = columns.iter().zip(&scale).map(|(c, s)| (2.0 * c.1 - 1.0) / s).collect();
                let mut constraints = Constraints::none(n);
                for (j, c) in columns.iter().enumerate() {
                    if c.3 & 1 == 1 {
                        constraints.lower[j] = start[j] - 0.4 * c.2 / scale[j];
                    }
                    if c.3 & 2 == 2 {
                        constraints.upper[j] = start[j] + 0.4 * (1.0 - c.2) / scale[j];
                    }
                }
                // orders the start satisfies, from the smaller to the larger, hence without a circle
                for (x, y, share) in orders {
                    let (below, above) = if start[x] < start[y] { (x, y) } else { (y, x) };
                    if start[below] < start[above] {
                        constraints = constraints.order(below, above, share * (start[above] - start[below]));
                    }
                }
                // in half of the cases a row over all parameters, the start on its inner side or on it
                if row[n] > 0.0 {
                    let terms: Vec<_> = (0..n).map(|j| (j, row[j] * scale[j])).collect();
                    let here: f64 = terms.iter().map(|&(j, a)| a * start[j]).sum();
                    constraints = constraints.row(terms, here + if row[n] > 0.5 { row[n] - 0.5 } else { 0.0 });
                }
                (Linear { a, b }, constraints, start)
            },
        )
    })
}

/// Karush-Kuhn-Tucker by its own means, in column-normalised variables. Returns ||gradient + sum y_i a_i|| / ||r|| at the best y >= 0 over the active rows.
fn kkt_residual(problem: &Linear, constraints: &Constraints, p: &[f64]) -> f64 {
    let r = problem.residuals(p).unwrap();
    let norms: Vec<f64> = problem.a.column_iter().map(|c| if c.norm() > 0.0 { c.norm() } else { 1.0 }).collect();
    let n = p.len();
    let gradient = DVector::from_fn(n, |j, _| problem.a.column(j).dot(&r) / norms[j]);
    let mut normals: Vec<DVector<f64>> = vec![];
    let mut add = |terms: &[(usize, f64)], slack: f64, size: f64| {
        if slack.abs() <= 1e-9 * size {
            let g = DVector::from_fn(n, |j, _| terms.iter().filter(|t| t.0 == j).map(|t| t.1 / norms[j]).sum::<f64>());
            normals.push(g.normalize());
        }
    };
    for j in 0..n {
        add(&[(j, 1.0)], constraints.upper[j] - p[j], p[j].abs() + 1.0 / norms[j]);
        add(&[(j, -1.0)], p[j] - constraints.lower[j], p[j].abs() + 1.0 / norms[j]);
    }
    for o in &constraints.orders {
        let size = p[o.above].abs() + p[o.below].abs();
        add(&[(o.below, 1.0), (o.above, -1.0)], p[o.above] - p[o.below] - o.gap, size);
    }
    for row in &constraints.rows {
        let terms: Vec<(usize, f64)> = row.coefficients.clone();
        let slack = row.limit - terms.iter().map(|&(j, a)| a * p[j]).sum::<f64>();
        add(&terms, slack, row.limit.abs() + terms.iter().map(|&(j, a)| (a * p[j]).abs()).sum::<f64>());
    }
    unmet(&gradient, &normals) / r.norm().max(1e-300)
}

/// Least ||g + sum y_i a_i|| over y >= 0, by active sets (Lawson and Hanson, Solving Least Squares Problems, ch. 23). Descent along one y after the other takes a
/// million rounds where two normals are nearly opposite.
fn unmet(g: &DVector<f64>, normals: &[DVector<f64>]) -> f64 {
    let mut y = vec![0.0; normals.len()];
    let mut passive: Vec<usize> = vec![];
    let left = |y: &[f64]| normals.iter().zip(y).fold(g.clone(), |left, (a, y)| left + a * *y);
    for _ in 0..10 * normals.len() {
        let rest = left(&y);
        let pulls = (0..normals.len()).filter(|k| !passive.contains(k)).map(|k| (k, -normals[k].dot(&rest)));
        let Some((k, _)) = pulls.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|p| p.1 > 1e-13 * g.norm()) else { break };
        passive.push(k);
        while !passive.is_empty() {
            let columns: Vec<DVector<f64>> = passive.iter().map(|k| normals[*k].clone()).collect();
            let z = DMatrix::from_columns(&columns).svd(true, true).solve(&-g, 1e-14).unwrap();
            if z.iter().all(|z| *z > 0.0) {
                passive.iter().zip(z.iter()).for_each(|(k, z)| y[*k] = *z);
                break;
            }
            // As far towards it as all stay above zero; what has come to zero leaves.
            let part = passive.iter().zip(z.iter()).filter(|(_, z)| **z <= 0.0).map(|(k, z)| y[*k] / (y[*k] - z)).fold(1.0, f64::min);
            passive.iter().zip(z.iter()).for_each(|(k, z)| y[*k] += part * (z - y[*k]));
            passive.retain(|k| y[*k] > 1e-15);
            (0..y.len()).filter(|k| !passive.contains(k)).for_each(|k| y[k] = 0.0);
        }
    }
    left(&y).norm()
}

#[test]
fn multipliers_of_normals_that_are_nearly_opposite_are_found() {
    let normals = [DVector::from_vec(vec![-1.0, 0.0]), DVector::from_vec(vec![1.0, -0.004]).normalize()];
    assert!(unmet(&DVector::from_vec(vec![0.3, 1.4]), &normals) < 1e-9);
    assert!((unmet(&DVector::from_vec(vec![0.3, -1.4]), &normals) - 1.4).abs() < 1e-9, "no multiplier pulls that way");
    assert!((unmet(&DVector::from_vec(vec![-3.0, 4.0]), &normals[..1]) - 5.0).abs() < 1e-12);
}

#[test]
fn random_constrained_linear_problems_meet_the_optimality_conditions() {
    let mut runner = TestRunner::new(Config { cases: cases(400), failure_persistence: None, ..Config::default() });
    let outcome = runner.run(&problem(), |(problem, constraints, start)| {
        let mut o = options(start.len());
        o.constraints = constraints.clone();
        let found = fit(&problem, &start, &o, &Monitor::default()).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert!(found.termination.is_converged(), "{:?}", found.log);
        prop_assert!(constraints.is_feasible(&found.p));
        let kkt = kkt_residual(&problem, &constraints, &found.p);
        // the residual may be next to nothing where the data can be met: then there is nothing to be optimal about
        let met = found.cost <= 1e-16 * found.start_cost.max(1e-300);
        prop_assert!(kkt < 1e-6 || met, "kkt {kkt:e} at {:?}, cost {:e}, {:?}", found.p, found.cost, found.termination);
        Ok(())
    });
    outcome.unwrap();
}

#[test]
fn no_iterate_leaves_the_feasible_set() {
    let mut runner = TestRunner::new(Config { cases: cases(200), failure_persistence: None, ..Config::default() });
    let outcome = runner.run(&problem(), |(linear, constraints, start)| {
        // every point the model is asked for must be feasible; a bent residual makes it ask for several
        let outside = std::sync::atomic::AtomicUsize::new(0);
        let f = |p: &[f64]| {
            if !constraints.is_feasible(p) {
                outside.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            }
            let r = linear.residuals(p)?;
            let j = DMatrix::from_fn(r.len(), p.len(), |i, c| linear.a[(i, c)] * (1.0 + 0.3 * r[i].cos()));
            Ok((r.map(|v| v + 0.3 * v.sin()), j))
        };
        let bent = With { n: start.len(), m: linear.b.len(), f };
        let mut o = options(start.len());
        o.constraints = constraints.clone();
        let found = fit(&bent, &start, &o, &Monitor::default()).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(outside.load(std::sync::atomic::Ordering::Relaxed), 0);
        prop_assert!(found.cost <= found.start_cost * (1.0 + 1e-12)); // the resolution of the cost
        Ok(())
    });
    outcome.unwrap();
}

#[test]
fn hostile_numbers_give_errors_never_panics() {
    let value = prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(0.0),
        Just(1e300),
        Just(-1e300),
        Just(1e-300),
        -1.0..1.0f64
    ];
    let strategy = (proptest::collection::vec(value.clone(), 12), proptest::collection::vec(value, 12));
    let mut runner = TestRunner::new(Config { cases: cases(2000), failure_persistence: None, ..Config::default() });
    let outcome = runner.run(&strategy, |(a, b)| {
        let problem = Linear { a: DMatrix::from_row_slice(4, 3, &a), b: DVector::from_row_slice(&b[..4]) };
        let mut o = options(3);
        o.tolerances.max_iterations = 20;
        let _ = fit(&problem, &[0.5, 0.5, 0.5], &o, &Monitor::default());
        o.constraints = Constraints::bounds(b[4..7].to_vec(), b[7..10].to_vec()).order(0, 1, b[10]).row(vec![(0, b[11]), (2, a[0])], a[1]);
        let _ = fit(&problem, &[0.5, 0.5, 0.5], &o, &Monitor::default());
        let _ = gate(&problem, &[0.5, 0.5, 0.5], &o, &Monitor::default());
        if let Ok(found) = fit(&problem, &a[..3], &options(3), &Monitor::default()) {
            prop_assert!(found.p.iter().all(|v| v.is_finite()));
            let _ = uncertainty(&found, &options(3), &UncertaintyOptions::default());
        }
        Ok(())
    });
    outcome.unwrap();
}
