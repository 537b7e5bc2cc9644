//! Is there a feasible point, which constraints conflict, which feasible point is nearest: small problems for Clarabel.

use super::constraints::{Constraints, Inequality, ROUNDING, Source};
use super::linalg::Reduced;
use super::step::StepProblem;
use super::{IdentifyError, qp};
use nalgebra::{DMatrix, DVector};

/// Decides whether any point satisfies all constraints.
///
/// Bounds and orders alone are decided exactly: the least value of every parameter, pushed up along the orders, must stay below its upper
/// bound. With linear rows it is a linear program: minimise t >= 0 subject to a'p <= b + t, each row in units of its own terms; at t > 0 the
/// multipliers are a certificate of Farkas, and the rows that carry them are the conflict that is named.
pub(super) fn check(constraints: &Constraints, sorted: &[usize], names: &[String]) -> Result<(), IdentifyError> {
    check_orders(constraints, sorted, names)?;
    if constraints.rows.is_empty() {
        return Ok(());
    }
    // rows over fixed parameters need their values as inequalities
    let mut rows = constraints.inequalities();
    for j in (0..names.len()).filter(|&j| constraints.is_fixed(j)) {
        let v = constraints.lower[j];
        rows.push(Inequality { a: vec![(j, 1.0)], b: v, source: Source::Upper(j) });
        rows.push(Inequality { a: vec![(j, -1.0)], b: -v, source: Source::Lower(j) });
    }
    let scale = typical(constraints);
    let n = scale.len();
    let mut program = qp::Program::new(n + 1);
    program.linear[n] = 1.0;
    // the least curvature that keeps p from running along directions without bounds; t stays exact to 1e-8
    (0..n).for_each(|j| program.quadratic.push((j, j, 1e-9)));
    for row in &rows {
        let size = row.a.iter().map(|&(j, a)| (a * scale[j]).abs()).fold(0.0, f64::max);
        if size == 0.0 {
            if row.b < 0.0 {
                return Err(IdentifyError::Infeasible { constraints: vec![constraints.label(row.source, names)] });
            }
            continue;
        }
        let mut a: Vec<_> = row.a.iter().map(|&(j, a)| (j, a * scale[j] / size)).collect();
        a.push((n, -1.0));
        program.at_most(a, row.b / size);
    }
    program.at_most(vec![(n, -1.0)], 0.0);
    let solution = program
        .solve()
        .filter(|s| s.trusted)
        .ok_or(IdentifyError::Numerical { while_doing: "deciding whether the constraints can be met" })?;
    if solution.x[n] <= 1e-6 {
        return Ok(());
    }
    let top = solution.z.iter().copied().fold(0.0, f64::max);
    let conflict = rows.iter().zip(&solution.z).filter(|(_, z)| **z > 1e-3 * top);
    Err(IdentifyError::Infeasible { constraints: conflict.map(|(row, _)| constraints.label(row.source, names)).collect() })
}

fn check_orders(constraints: &Constraints, sorted: &[usize], names: &[String]) -> Result<(), IdentifyError> {
    let mut least = constraints.lower.clone();
    let mut pushed_by = vec![None; names.len()];
    for &j in sorted {
        for (k, o) in constraints.orders.iter().enumerate().filter(|(_, o)| o.below == j) {
            if least[j] + o.gap > least[o.above] {
                least[o.above] = least[j] + o.gap;
                pushed_by[o.above] = Some(k);
            }
        }
        let upper = constraints.upper[j];
        if least[j] > upper + ROUNDING * (least[j].abs() + upper.abs()) {
            let mut conflict = vec![constraints.label(Source::Upper(j), names)];
            let mut at = j;
            while let Some(k) = pushed_by[at] {
                conflict.push(constraints.label(Source::Order(k), names));
                at = constraints.orders[k].below;
            }
            conflict.push(constraints.label(Source::Lower(at), names));
            return Err(IdentifyError::Infeasible { constraints: conflict });
        }
    }
    Ok(())
}

/// min sum_j ((x_j - p_j) / scale_j)^2 over the feasible set.
pub(super) fn project(constraints: &Constraints, p: &[f64], scale: &[f64]) -> Result<Vec<f64>, IdentifyError> {
    let n = constraints.n_params();
    if p.len() != n || scale.len() != n {
        return Err(IdentifyError::Dimension { what: "point to project".into(), got: p.len().min(scale.len()), expected: n });
    }
    let scale: Vec<f64> = scale.iter().map(|s| if s.is_finite() && *s > 0.0 { *s } else { 1.0 }).collect();
    let start: Vec<f64> = (0..n).map(|j| p[j].max(constraints.lower[j]).min(constraints.upper[j])).collect();
    let mut program = qp::Program::new(n);
    (0..n).for_each(|j| program.quadratic.push((j, j, 1.0)));
    (0..n).for_each(|j| program.linear[j] = (start[j] - p[j]) / scale[j]);
    let mut sources = Vec::new();
    for row in constraints.inequalities() {
        let a: Vec<_> = row.a.iter().filter(|&&(j, _)| !constraints.is_fixed(j)).map(|&(j, a)| (j, a * scale[j])).collect();
        let size = a.iter().map(|&(_, a)| a.abs()).fold(0.0, f64::max);
        if size > 0.0 {
            program.at_most(a.iter().map(|&(j, a)| (j, a / size)).collect(), row.slack(&start) / size);
            sources.push(row.source);
        }
    }
    (0..n).filter(|&j| constraints.is_fixed(j)).for_each(|j| program.equal(vec![(j, 1.0)], 0.0));
    let solution =
        program.solve().filter(|s| s.trusted).ok_or(IdentifyError::Numerical { while_doing: "projecting on the constraints" })?;
    let mut x: Vec<f64> = (0..n).map(|j| start[j] + scale[j] * solution.x[j]).collect();
    let active: Vec<_> = solution.active().map(|i| sources[i]).collect();
    constraints.snap(&mut x, &active);
    // what remains of a linear row, of the interior point's own accuracy, is closed along its gradient
    for row in constraints.inequalities() {
        let slack = row.slack(&x);
        if slack < 0.0 {
            let norm: f64 = row.a.iter().map(|&(j, a)| (a * scale[j]).powi(2)).sum();
            let shift = 2.0 * slack / norm.max(f64::MIN_POSITIVE);
            row.a.iter().for_each(|&(j, a)| x[j] += shift * a * scale[j] * scale[j]);
        }
    }
    constraints.snap(&mut x, &[]);
    // feasible now, and within the interior point's accuracy of the answer; one step on the exact active set closes the rest
    let reduced = Reduced {
        a: DMatrix::from_fn(n, n, |i, j| if i == j { 1.0 / scale[j] } else { 0.0 }),
        q: DVector::from_fn(n, |j, _| (x[j] - p[j]) / scale[j]),
    };
    let d: Vec<f64> = scale.iter().map(|s| 1.0 / s).collect();
    if let Some(step) = StepProblem::new(&reduced, &d, &x, constraints, &constraints.inequalities()).solve(1e-16) {
        let mut closer: Vec<f64> = x.iter().zip(step.d.iter()).map(|(x, d)| x + d).collect();
        constraints.snap(&mut closer, &step.active.iter().map(|a| a.0).collect::<Vec<_>>());
        if constraints.is_feasible(&closer) {
            x = closer;
        }
    }
    Ok(x)
}

/// Typical size of each parameter: its finite bounds, or those of the parameters it is ordered with.
fn typical(constraints: &Constraints) -> Vec<f64> {
    let of_bounds = |j: usize| {
        let finite = [constraints.lower[j], constraints.upper[j]].into_iter().filter(|v| v.is_finite());
        finite.map(f64::abs).fold(0.0, f64::max)
    };
    let size = |j: usize| {
        let partners = constraints.orders.iter().filter(|o| o.below == j || o.above == j).map(|o| of_bounds(o.below + o.above - j));
        [of_bounds(j), partners.fold(0.0, f64::max), 1.0].into_iter().find(|v| *v > 0.0).unwrap_or(1.0)
    };
    (0..constraints.n_params()).map(size).collect()
}
