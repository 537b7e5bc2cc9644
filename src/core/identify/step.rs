//! The damped, constrained step: min ||A d + q||^2 + lambda ||D d||^2 subject to the constraints at p + d.
//!
//! [A | q] is the triangle of the whitened [J | r], so the step sees J alone and never J'J. It is solved in u = D d. When the plain
//! damped least-squares step is feasible it is the answer. Otherwise Clarabel solves, over (u, w),
//!
//! ```text
//! min 1/2 ||w||^2 + 1/2 lambda ||u||^2   s.t.   (A D^-1) u - w = -q,   G u <= h,
//! ```
//!
//! and says which rows are active; the step is then recomputed on that active set by orthogonal elimination, which brings the interior
//! point's 1e-9 to rounding and gives multipliers of the same accuracy.

use super::constraints::{Constraints, Inequality, ROUNDING, Source};
use super::linalg::{PivotedQr, Reduced, damped_least_squares, pivoted_qr};
use super::qp;
use nalgebra::{DMatrix, DVector};

/// A step with the constraints it rests on.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub d: DVector<f64>,
    /// active constraints with their multipliers: d cost / d (limit), in units of cost per unit of the limit, >= 0
    pub active: Vec<(Source, f64)>,
}

/// Everything the step depends on but the damping.
pub(crate) struct StepProblem {
    b: DMatrix<f64>,
    q: DVector<f64>,
    free: Vec<usize>,
    d: Vec<f64>,
    n: usize,
    rows: Vec<ScaledRow>,
}

/// A step in u with the rows it rests on and their multipliers.
type Rested = (DVector<f64>, Vec<(usize, f64)>);

struct ScaledRow {
    /// unit gradient in u
    g: DVector<f64>,
    /// slack at p, in u
    h: f64,
    /// rounding of h
    tolerance: f64,
    /// norm the row was divided by
    norm: f64,
    source: Source,
}

impl StepProblem {
    /// `d` are the column scales; a parameter whose scale is zero is held still, as is one whose bounds coincide.
    pub fn new(reduced: &Reduced, d: &[f64], p: &[f64], constraints: &Constraints, inequalities: &[Inequality]) -> Self {
        let n = p.len();
        let free: Vec<usize> = (0..n).filter(|&j| d[j] > 0.0 && !constraints.is_fixed(j)).collect();
        let b = DMatrix::from_fn(reduced.a.nrows(), free.len(), |i, c| reduced.a[(i, free[c])] / d[free[c]]);
        let mut place = vec![usize::MAX; n];
        free.iter().enumerate().for_each(|(c, &j)| place[j] = c);
        let rows = inequalities
            .iter()
            .filter_map(|row| {
                let mut g = DVector::zeros(free.len());
                row.a.iter().filter(|&&(j, _)| place[j] != usize::MAX).for_each(|&(j, a)| g[place[j]] += a / d[j]);
                let norm = g.norm();
                let tolerance = ROUNDING * row.magnitude(p) / norm;
                (norm > 0.0).then(|| ScaledRow { g: g / norm, h: row.slack(p).max(0.0) / norm, tolerance, norm, source: row.source })
            })
            .collect();
        Self { b, q: reduced.q.clone(), free, d: d.to_vec(), n, rows }
    }

    pub fn is_constrained(&self) -> bool {
        !self.rows.is_empty()
    }

    /// The step for damping `lambda` > 0; None when Clarabel finds no answer.
    pub fn solve(&self, lambda: f64) -> Option<Step> {
        let size = self.q.norm();
        if self.free.is_empty() || size == 0.0 {
            return Some(Step { d: DVector::zeros(self.n), active: vec![] });
        }
        let u = damped_least_squares(&self.b, &self.q, lambda);
        if self.is_feasible(&u) {
            return Some(self.finish(&u, vec![]));
        }
        let found = self.by_clarabel(lambda, size, u.norm());
        // without any answer the rows that the plain step violates are the guess to start from
        let violated = || (0..self.rows.len()).filter(|&i| self.rows[i].g.dot(&u) > self.rows[i].h + self.rows[i].tolerance).collect();
        let (interior, guess) = found.map_or_else(|| (None, violated()), |(interior, guess)| (interior, guess));
        self.polish(lambda, guess).or(interior).map(|(u, active)| self.finish(&u, active))
    }

    fn is_feasible(&self, u: &DVector<f64>) -> bool {
        self.rows.iter().all(|row| row.g.dot(u) <= row.h + row.tolerance)
    }

    fn finish(&self, u: &DVector<f64>, active: Vec<(usize, f64)>) -> Step {
        let mut d = DVector::zeros(self.n);
        self.free.iter().enumerate().for_each(|(c, &j)| d[j] = u[c] / self.d[j]);
        Step { d, active: active.into_iter().map(|(i, y)| (self.rows[i].source, y / self.rows[i].norm)).collect() }
    }

    /// The QP in units of ||q||, where everything is of order one. A row far away is brought to a cap: when the answer stays clear of
    /// it, the answer is that of the uncapped problem too (convexity); when not, the cap is raised.
    fn by_clarabel(&self, lambda: f64, size: f64, plain: f64) -> Option<(Option<Rested>, Vec<usize>)> {
        let (k, nf) = self.b.shape();
        let mut cap = 1e3 * (plain / size).max(1.0);
        for _ in 0..6 {
            let mut program = qp::Program::new(nf + k);
            (0..nf).for_each(|c| program.quadratic.push((c, c, lambda)));
            (0..k).for_each(|i| program.quadratic.push((nf + i, nf + i, 1.0)));
            for i in 0..k {
                let mut row: Vec<_> = (0..nf).map(|c| (c, self.b[(i, c)])).collect();
                row.push((nf + i, -1.0));
                program.equal(row, -self.q[i] / size);
            }
            for row in &self.rows {
                program.at_most(row.g.iter().copied().enumerate().collect(), (row.h / size).min(cap));
            }
            let found = program.solve()?;
            let active: Vec<usize> = found.active().collect();
            if active.iter().any(|&i| self.rows[i].h / size > cap) {
                cap *= 1e3;
                continue;
            }
            // an interior point may sit outside: a hair is for snapping, from more scale back (u = 0 is feasible, the set is convex)
            let mut u = DVector::from_fn(nf, |c, _| found.x[c] * size);
            let hair = 1e-8 * u.norm();
            let reach = self.rows.iter().map(|row| (row.g.dot(&u), row.h)).filter(|(gu, h)| gu - h > hair);
            let back = reach.map(|(gu, h)| h / gu).fold(1.0, f64::min);
            u *= back;
            let multipliers = active.iter().map(|&i| (i, found.z[i] * size)).collect();
            return Some((found.trusted.then_some((u, multipliers)), active));
        }
        None
    }

    /// Recomputes the step on an active set held as equalities; rows that turn out violated join, rows that pull the wrong way leave.
    fn polish(&self, lambda: f64, mut active: Vec<usize>) -> Option<Rested> {
        for _ in 0..2 * self.rows.len() + 2 {
            let gradients = DMatrix::from_fn(self.free.len(), active.len(), |i, c| self.rows[active[c]].g[i]);
            let factor = pivoted_qr(&gradients, 1e-12);
            let u = self.on_active(lambda, &active, &factor);
            let worst = self.rows.iter().enumerate().filter(|(i, _)| !active.contains(i));
            let worst =
                worst.map(|(i, row)| (i, row.g.dot(&u) - row.h - row.tolerance - 1e-14 * u.norm())).max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((i, violation)) = worst
                && violation > 0.0
            {
                if factor.rank == self.free.len() {
                    return None; // a vertex already: the interior point's answer stands
                }
                active.push(i);
                continue;
            }
            let y = self.multipliers(lambda, &u, &factor, active.len());
            let gradient_size = (self.b.tr_mul(&self.q)).norm();
            match y.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)) {
                Some((c, &least)) if least < -1e-11 * gradient_size => {
                    active.remove(c);
                }
                _ => return Some((u, active.into_iter().zip(y.into_iter().map(|y| y.max(0.0))).collect())),
            }
        }
        None
    }

    fn on_active(&self, lambda: f64, active: &[usize], factor: &PivotedQr) -> DVector<f64> {
        let (nf, rank) = (self.free.len(), factor.rank);
        // G u = h on the range: R' t = h in pivoted order
        let mut t = DVector::zeros(rank);
        for i in 0..rank {
            let known: f64 = (0..i).map(|c| factor.r[(c, i)] * t[c]).sum();
            t[i] = (self.rows[active[factor.perm[i]]].h - known) / factor.r[(i, i)];
        }
        let on_rows = factor.q.columns(0, rank) * t;
        if rank == nf {
            return on_rows;
        }
        let null = factor.q.columns(rank, nf - rank);
        let v = damped_least_squares(&(&self.b * null), &(&self.q + &self.b * &on_rows), lambda);
        on_rows + null * v
    }

    /// y with sum y_i g_i = -gradient, by the factor of the active gradients (dependent rows get zero).
    fn multipliers(&self, lambda: f64, u: &DVector<f64>, factor: &PivotedQr, n_active: usize) -> Vec<f64> {
        let gradient = self.b.tr_mul(&(&self.b * u + &self.q)) + u * lambda;
        let rhs = factor.q.columns(0, factor.rank).tr_mul(&-gradient);
        let mut y = vec![0.0; n_active];
        for i in (0..factor.rank).rev() {
            let known: f64 = (i + 1..factor.rank).map(|c| factor.r[(i, c)] * y[factor.perm[c]]).sum();
            y[factor.perm[i]] = (rhs[i] - known) / factor.r[(i, i)];
        }
        y
    }
}

/// The scales D of a step from those of the columns. A held parameter has zero and does not move, unless a row joins it to one that does:
/// it would stand in that one's way, though nothing keeps it where it is. It then has the scale at which both move the row alike, and
/// yields as far as it is pushed.
pub(super) fn yielding(columns: &[f64], held: &[usize], constraints: &Constraints, rows: &[Inequality]) -> Vec<f64> {
    let mut scale = columns.to_vec();
    held.iter().for_each(|&j| scale[j] = 0.0);
    // each round reaches those that are joined to what the last round reached
    for _ in 0..held.len() {
        let before = scale.clone();
        for &j in held.iter().filter(|&&j| before[j] == 0.0 && !constraints.is_fixed(j)) {
            for row in rows {
                let Some(own) = row.a.iter().find(|t| t.0 == j) else { continue };
                let others = row.a.iter().filter(|t| t.0 != j && t.1 != 0.0 && !constraints.is_fixed(t.0));
                scale[j] = others.map(|t| before[t.0] * (own.1 / t.1).abs()).fold(scale[j], f64::max);
            }
        }
        if scale == before {
            break;
        }
    }
    scale
}

/// ||D v||
pub(super) fn scaled_norm(v: &DVector<f64>, scale: &[f64]) -> f64 {
    v.iter().zip(scale).map(|(v, s)| (v * s).powi(2)).sum::<f64>().sqrt()
}

/// 1/2 (||q||^2 - ||q + A d||^2), without the cancellation of that form.
pub(super) fn predicted_drop(reduced: &Reduced, d: &DVector<f64>) -> f64 {
    let ad = &reduced.a * d;
    -(reduced.q.dot(&ad) + 0.5 * ad.norm_squared())
}
