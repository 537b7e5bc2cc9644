use super::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

#[test]
fn the_residual_scale_does_not_end_the_fit_at_its_start() {
    // argmin 0.11's GaussNewtonLS pairs the cost ||r|| with the gradient of 1/2 ||r||^2 and returns this start as converged
    let start = [3.0, 0.2, -1.0];
    let reference = fit(&decay([1.0, 1.5, 0.3], 1.0), &start, &options(3), &Monitor::default()).unwrap();
    let scaled = fit(&decay([1.0, 1.5, 0.3], 1e4), &start, &options(3), &Monitor::default()).unwrap();
    assert!(scaled.termination.is_converged());
    assert!(scaled.cost < 1e-3 * scaled.start_cost, "{} of {}", scaled.cost, scaled.start_cost);
    approx::assert_relative_eq!(scaled.p.as_slice(), reference.p.as_slice(), max_relative = 1e-9);
}

/// Costs after each accepted iteration, divided by the square of the residual's scale.
fn path(outcome: &FitOutcome, by: f64) -> Vec<f64> {
    let accepted = outcome.log.iter().filter(|e| matches!(e.event, Event::Accepted { .. }));
    accepted.map(|e| e.cost / (by * by)).collect()
}

#[test]
fn iterates_do_not_depend_on_units() {
    let truth = [1.0, 1.5, 0.3];
    let start = [3.0, 0.2, -1.0];
    let constrain = |o: &mut FitOptions, unit: f64| {
        // an active bound and an active order, so that the quadratic program is in the loop too
        o.constraints.lower[0] = 1.2 * unit;
        o.constraints = o.constraints.clone().row(vec![(1, 1.0), (0, 0.1 / unit)], 1.6);
    };
    for constrained in [false, true] {
        let mut plain = options(3);
        if constrained {
            constrain(&mut plain, 1.0);
        }
        let reference = fit(&decay(truth, 1.0), &start, &plain, &Monitor::default()).unwrap();
        let reference_path = path(&reference, 1.0);
        assert!(reference_path.len() >= 4);
        for (by, unit) in [(1e8, 1.0), (1e-8, 1.0), (1.0, 1e8), (1.0, 1e-8)] {
            let inner = decay(truth, by);
            // p0 in another unit: p0 = unit * its old value
            let f = move |p: &[f64]| {
                let (r, mut j) = inner.jacobian(&[p[0] / unit, p[1], p[2]])?;
                j.column_mut(0).unscale_mut(unit);
                Ok((r, j))
            };
            let mut stated = options(3);
            if constrained {
                constrain(&mut stated, unit);
            }
            let found = fit(&With { n: 3, m: 40, f }, &[start[0] * unit, start[1], start[2]], &stated, &Monitor::default()).unwrap();
            let found_path = path(&found, by);
            // the last iterations live on rounding; all but those must be the same
            let common = reference_path.len().min(found_path.len());
            assert!(common + 1 >= reference_path.len().max(found_path.len()), "{found_path:?} against {reference_path:?}");
            for (a, b) in found_path.iter().zip(&reference_path) {
                approx::assert_relative_eq!(a, b, max_relative = 1e-6);
            }
            approx::assert_relative_eq!(found.p[0] / unit, reference.p[0], max_relative = 1e-7);
            approx::assert_relative_eq!(found.p[1], reference.p[1], max_relative = 1e-7);
        }
    }
}

#[test]
fn active_bounds_and_orders_are_exact() {
    // isotonic regression with a bound: min (p0-3)^2 + (p1-1)^2 + (p2-2)^2, p0 <= p1 <= p2, p0 >= 2.5
    let problem = Linear { a: DMatrix::identity(3, 3), b: DVector::from_vec(vec![3.0, 1.0, 2.0]) };
    let mut o = options(3);
    o.constraints = o.constraints.order(0, 1, 0.0).order(1, 2, 0.0);
    let found = fit(&problem, &[0.0, 1.0, 5.0], &o, &Monitor::default()).unwrap();
    approx::assert_relative_eq!(found.p.as_slice(), [2.0, 2.0, 2.0].as_slice(), epsilon = 1e-12);
    o.constraints.lower[0] = 2.5;
    let found = fit(&problem, &[2.7, 4.0, 5.0], &o, &Monitor::default()).unwrap();
    assert_eq!(found.p[0], 2.5, "the bound holds to the bit");
    approx::assert_relative_eq!(found.p.as_slice(), [2.5, 2.5, 2.5].as_slice(), epsilon = 1e-12);
    assert!(o.constraints.is_feasible(&found.p));
    assert!(found.active.iter().any(|a| a.label == "p0 >= 2.5" && (a.multiplier - 1.5).abs() < 1e-9), "{:?}", found.active);
}

#[test]
fn a_parameter_without_influence_stays_and_is_reported() {
    let problem = Linear { a: DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 2.0, 0.0, 3.0, 0.0]), b: DVector::from_vec(vec![1.0, 2.0, 3.5]) };
    let found = fit(&problem, &[0.0, 0.7], &options(2), &Monitor::default()).unwrap();
    assert_eq!((found.p[1], found.held.as_slice()), (0.7, [1].as_slice()));
    assert!(found.log.iter().any(|e| matches!(&e.event, Event::Held { name } if name == "p1")));
    assert!(found.termination.is_converged());
}

#[test]
fn a_parameter_without_influence_is_in_no_ones_way() {
    // only the first of three is seen, as 0.6 p0 = 0.9; the orders p0 <= p1 <= p2 keep it below two that nothing is known of
    let problem = Linear {
        a: DMatrix::from_row_slice(4, 3, &[0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        b: DVector::from_row_slice(&[0.9, 0.1, 0.0, 0.0]),
    };
    let mut o = options(3);
    o.constraints = Constraints::none(3).order(0, 1, 0.0).order(1, 2, 0.25);
    let found = fit(&problem, &[-1.0, 0.0, 0.5], &o, &Monitor::default()).unwrap();
    assert!(found.termination.is_converged());
    approx::assert_relative_eq!(found.p[0], 1.5, max_relative = 1e-7);
    assert!(o.constraints.is_feasible(&found.p) && found.held == [1, 2], "{:?} {:?}", found.p, found.held);
    // One at its upper bound does not yield, and one beside nothing that moves stays where it is.
    o.constraints.upper[2] = 1.0;
    let found = fit(&problem, &[-1.0, 0.0, 0.5], &o, &Monitor::default()).unwrap();
    approx::assert_relative_eq!(found.p[0], 0.75, max_relative = 1e-7);
    o.constraints = Constraints::none(3).order(1, 2, 0.25);
    assert_eq!(fit(&problem, &[-1.0, 0.0, 0.5], &o, &Monitor::default()).unwrap().p[1..], [0.0, 0.5]);
}

#[test]
fn nan_and_failing_models_are_errors_at_the_start_and_damped_on_the_way() {
    let nan = With { n: 2, m: 3, f: |_: &[f64]| Ok((DVector::from_element(3, f64::NAN), DMatrix::from_element(3, 2, f64::NAN))) };
    assert!(matches!(fit(&nan, &[1.0, 1.0], &options(2), &Monitor::default()), Err(IdentifyError::StartFails(_))));
    let misshapen = With { n: 2, m: 3, f: |_: &[f64]| Ok((DVector::zeros(2), DMatrix::zeros(3, 2))) };
    assert!(matches!(fit(&misshapen, &[1.0, 1.0], &options(2), &Monitor::default()), Err(IdentifyError::StartFails(_))));
    // r = ln p: the Gauss-Newton step from 20 lands at a negative p, where the model fails
    let log = With {
        n: 1,
        m: 1,
        f: |p: &[f64]| match p[0] > 0.0 {
            true => Ok((DVector::from_element(1, p[0].ln()), DMatrix::from_element(1, 1, 1.0 / p[0]))),
            false => Err(EvalError::new("log of a negative number")),
        },
    };
    let mut o = options(1);
    o.tolerances.acceleration = false; // it would see the bend before the model is asked
    let found = fit(&log, &[20.0], &o, &Monitor::default()).unwrap();
    assert!((found.p[0] - 1.0).abs() < 1e-8 && found.termination.is_converged(), "{:?}", found.p);
    assert!(found.log.iter().any(|e| matches!(&e.event, Event::Rejected { reason } if reason.contains("negative"))));
}

#[test]
fn a_model_that_fails_everywhere_but_at_the_start_is_a_failed_fit_with_its_reason() {
    let only = With {
        n: 1,
        m: 1,
        f: |p: &[f64]| match p[0] == 1.0 {
            true => Ok((DVector::from_element(1, 1.0), DMatrix::from_element(1, 1, 1.0))),
            false => Err(EvalError::new("no equilibrium")),
        },
    };
    let found = fit(&only, &[1.0], &options(1), &Monitor::default()).unwrap();
    assert!(matches!(&found.termination, Termination::Failed(why) if why.contains("no equilibrium")), "{:?}", found.termination);
    assert_eq!(found.p, [1.0]);
}

#[test]
fn a_kink_is_stalled_not_converged() {
    // r = 1 + |p|, with the slope of one side claimed on both: no step from the kink lowers the cost
    let kink = With { n: 1, m: 1, f: |p: &[f64]| Ok((DVector::from_element(1, 1.0 + p[0].abs()), DMatrix::from_element(1, 1, 1.0))) };
    let found = fit(&kink, &[0.0], &options(1), &Monitor::default()).unwrap();
    assert_eq!(found.termination, Termination::Stalled);
}

#[test]
fn robust_losses_resist_outliers_and_their_cost_falls_steadily() {
    let n = 30;
    let a = DMatrix::from_fn(n, 2, |i, c| if c == 0 { 1.0 } else { i as f64 / 10.0 });
    let b = DVector::from_fn(n, |i, _| 2.0 + 0.5 * (i as f64 / 10.0) + if i % 10 == 3 { 40.0 } else { 0.1 * (i as f64).sin() });
    let problem = Linear { a, b };
    let error = |loss: Loss| {
        let mut o = options(2);
        o.losses = vec![LossBlock { rows: 0..n, loss }];
        let found = fit(&problem, &[0.0, 0.0], &o, &Monitor::default()).unwrap();
        assert!(found.termination.is_converged(), "{loss:?}: {:?}", found.termination);
        let costs: Vec<f64> = path(&found, 1.0);
        assert!(costs.windows(2).all(|w| w[1] <= w[0]));
        // the gradient of the cost reported, by differences of that cost
        for j in 0..2 {
            let cost = |h: f64| {
                let mut p = found.p.clone();
                p[j] += h;
                problem.residuals(&p).unwrap().iter().map(|&r| loss.value(r)).sum::<f64>()
            };
            assert!(((cost(1e-4) - cost(-1e-4)) / 2e-4).abs() < 1e-4, "{loss:?}");
        }
        (found.p[0] - 2.0).abs() + (found.p[1] - 0.5).abs()
    };
    assert!(error(Loss::Squares) > 1.0);
    for loss in [Loss::Huber(1.0), Loss::SoftL1(0.5), Loss::Cauchy(0.5)] {
        assert!(error(loss) < 0.3, "{loss:?}: {}", error(loss));
    }
}

#[test]
fn cancelling_keeps_the_best_state() {
    let problem = decay([1.0, 1.5, 0.3], 1.0);
    let flag = Arc::new(AtomicBool::new(false));
    let raise = flag.clone();
    let monitor = Monitor::default().cancel(flag).on_iteration(move |p| raise.store(p.iteration >= 2, Ordering::Relaxed));
    let found = fit(&problem, &[3.0, 0.2, -1.0], &options(3), &monitor).unwrap();
    assert_eq!((found.termination.clone(), found.iterations), (Termination::Interrupted, 3));
    assert!(found.cost < found.start_cost);
    approx::assert_relative_eq!(0.5 * problem.residuals(&found.p).unwrap().norm_squared(), found.cost, max_relative = 1e-14);
    let late = Monitor::default().max_seconds(0.0);
    assert_eq!(fit(&problem, &[3.0, 0.2, -1.0], &options(3), &late).unwrap().termination, Termination::Interrupted);
}

#[test]
fn a_resumed_fit_goes_on_where_it_was_interrupted() {
    let problem = decay([1.0, 1.5, 0.3], 1.0);
    let start = [3.0, 0.2, -1.0];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("best.json");
    let whole = fit(&problem, &start, &options(3), &Monitor::default()).unwrap();

    let flag = Arc::new(AtomicBool::new(false));
    let raise = flag.clone();
    let first =
        Monitor::default().cancel(flag).checkpoint(&path, true).on_iteration(move |p| raise.store(p.iteration >= 3, Ordering::Relaxed));
    let half = fit(&problem, &start, &options(3), &first).unwrap();
    assert_eq!(half.termination, Termination::Interrupted);
    // the start given is no longer looked at
    let rest = fit(&problem, &[9.0, 9.0, 9.0], &options(3), &Monitor::default().checkpoint(&path, true)).unwrap();
    assert!(rest.termination.is_converged());
    approx::assert_relative_eq!(rest.p.as_slice(), whole.p.as_slice(), max_relative = 1e-9);
    assert_eq!(rest.iterations, whole.iterations);

    let other = FitOptions::new(["a", "b", "c"]);
    let wrong = fit(&problem, &start, &other, &Monitor::default().checkpoint(&path, true));
    assert!(matches!(wrong, Err(IdentifyError::Checkpoint { .. })), "{wrong:?}");
    std::fs::write(&path, "{\"schema\": 1, \"names\"").unwrap();
    let broken = fit(&problem, &start, &options(3), &Monitor::default().checkpoint(&path, true));
    assert!(matches!(broken, Err(IdentifyError::Checkpoint { .. })));
}

#[test]
fn multi_start_finds_the_better_valley_and_ranks_failures_last() {
    // cost with two minima, near p = -1 (better) and p = 1; the model fails beyond 5
    let f = |p: &[f64]| {
        if p[0] > 5.0 {
            return Err(EvalError::new("too far"));
        }
        let r = DVector::from_vec(vec![p[0] * p[0] - 1.0, 0.1 * (p[0] + 1.0)]);
        Ok((r, DMatrix::from_column_slice(2, 1, &[2.0 * p[0], 0.1])))
    };
    let problem = With { n: 1, m: 2, f };
    let starts = vec![vec![9.0], vec![2.0], vec![-2.0]];
    let all = multi_start(&problem, &starts, &options(1), &Monitor::default()).unwrap();
    assert!((all[0].result.as_ref().unwrap().p[0] + 1.0).abs() < 1e-6);
    assert_eq!(all[2].start, vec![9.0]);
    assert!(all[2].describe().contains("too far"));
    assert!(matches!(multi_start(&problem, &[vec![8.0]], &options(1), &Monitor::default()), Err(IdentifyError::AllStartsFailed { .. })));

    let mut o = options(2);
    o.constraints = Constraints::bounds(vec![0.0, 1.0], vec![1.0, 1e4]).order(0, 1, 0.5);
    let starts = latin_hypercube(&[0.2, 2.0], &o, 20, 7).unwrap();
    assert_eq!(starts.len(), 20);
    assert!(starts.iter().all(|s| o.constraints.is_feasible(s)));
    assert_eq!(starts, latin_hypercube(&[0.2, 2.0], &o, 20, 7).unwrap());
    let low = starts.iter().filter(|s| s[1] < 100.0).count();
    assert!((8..=12).contains(&low), "spread in the logarithm: {low} of 20 in the lower two of four decades");
}

#[test]
fn large_problems_with_many_constraints_converge() {
    // 5000 x 40, bounds on all, a monotone chain, and half of the constraints active
    let (m, n) = (5000, 40);
    let a = DMatrix::from_fn(m, n, |i, j| ((i * 31 + j * 17) as f64 * 0.618).sin() + if i % n == j { 3.0 } else { 0.0 });
    let truth: Vec<f64> = (0..n).map(|j| 1.0 + (j as f64 * 0.9).sin()).collect();
    let b = &a * DVector::from_vec(truth) + DVector::from_fn(m, |i, _| 0.1 * (i as f64 * 1.7).cos());
    let mut o = options(n);
    o.constraints = Constraints::bounds(vec![0.5; n], vec![1.8; n]);
    for j in 0..n - 1 {
        o.constraints = o.constraints.order(j, j + 1, 0.0);
    }
    let found = fit(&Linear { a, b }, &(0..n).map(|j| 0.6 + 0.01 * j as f64).collect::<Vec<_>>(), &o, &Monitor::default()).unwrap();
    println!(
        "5000 x 40 with 119 constraints: {} iterations in {:.3} s, {} active, {:?}",
        found.iterations,
        found.wall_s,
        found.active.len(),
        found.termination
    );
    assert!(found.termination.is_converged() && o.constraints.is_feasible(&found.p) && found.active.len() > 10);
}

#[test]
fn nothing_to_fit_is_no_panic() {
    let nothing = Linear { a: DMatrix::zeros(3, 0), b: DVector::from_element(3, 1.0) };
    let found = fit(&nothing, &[], &options(0), &Monitor::default()).unwrap();
    assert!(found.termination.is_converged() && found.cost == 1.5);
    uncertainty(&found, &options(0), &UncertaintyOptions::default()).unwrap();
    gate(&nothing, &[], &options(0), &Monitor::default()).unwrap();
    let empty = Linear { a: DMatrix::zeros(0, 2), b: DVector::zeros(0) };
    let found = fit(&empty, &[1.0, 2.0], &options(2), &Monitor::default()).unwrap();
    assert_eq!(found.p, [1.0, 2.0]);
    let u = uncertainty(&found, &options(2), &UncertaintyOptions::default()).unwrap();
    assert!(u.parameters.iter().all(|p| p.std.is_none() && !p.identifiable));
    gate(&empty, &[1.0, 2.0], &options(2), &Monitor::default()).unwrap();
    // fewer residuals than parameters: the null space is named
    let wide = Linear { a: DMatrix::from_row_slice(1, 2, &[1.0, 1.0]), b: DVector::from_element(1, 4.0) };
    let found = fit(&wide, &[1.0, 1.0], &options(2), &Monitor::default()).unwrap();
    assert!(found.termination.is_converged());
    let u = uncertainty(&found, &options(2), &UncertaintyOptions::default()).unwrap();
    assert_eq!(u.unidentifiable.len(), 1);
    assert_eq!(u.unidentifiable[0].label, "p0 - p1");
}

/// Iterations that are gone on with begin at a lower cost than the start's, evaluate no Jacobian there again, and come to the same minimum.
#[test]
fn a_fit_is_gone_on_with_from_its_own_jacobian() {
    let problem = decay([1.0, 1.5, 0.3], 1.0);
    let (mut few, whole) = (options(3), options(3));
    few.tolerances.max_iterations = 2;
    let start = [3.0, 0.2, -1.0];
    let begun = fit(&problem, &start, &few, &Monitor::default()).unwrap();
    assert_eq!(begun.termination, Termination::MaxIterations);
    let before = begun.cost;
    let further = super::super::go_on(&problem, begun.clone(), &few, &Monitor::default()).unwrap();
    assert_eq!(further.start_cost, before);
    assert!(further.cost < before);
    // No more than one Jacobian for each step: the first is known.
    assert!(further.evaluations.1 <= 2, "{:?}", further.evaluations);
    let ended = super::super::go_on(&problem, further, &whole, &Monitor::default()).unwrap();
    let at_once = fit(&problem, &start, &whole, &Monitor::default()).unwrap();
    assert!(ended.termination.is_converged());
    approx::assert_relative_eq!(ended.p.as_slice(), at_once.p.as_slice(), max_relative = 1e-7);
}
