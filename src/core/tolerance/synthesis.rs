//! Synthesis: the loosest tolerances, by a declared cost of tightness sum c_k / t_k, that keep a yield.
//!
//! An assembly has x = x_0 + sum t_k h_k, h from the draws of its deviations, and quantities y_q(x) with bands. About the present widths y is linear in t, with
//! mean m(t) and standard deviation |L' (1, t)| over the draws; a band then asks z |L' (1, t)| <= b - m(t), a second-order cone. z is the quantile of the
//! draws themselves over their deviation, times a factor that is bisected until the yield of the draws through the full function is the one asked for. Linear
//! model and factor are renewed until the cost no longer falls. c_k / t_k is a rotated cone, so each step is one conic programme, solved by Clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus};
use nalgebra::{DMatrix, SymmetricEigen};

/// A quantity with its band.
pub struct Limited<'a> {
    /// Value over x.
    pub value: &'a (dyn Fn(f64) -> f64 + Sync),
    /// Slope over x.
    pub slope: &'a (dyn Fn(f64) -> f64 + Sync),
    /// Least and greatest value; infinite where there is no bound.
    pub band: (f64, f64),
}

/// What is asked.
pub struct Question<'a> {
    /// x of every draw without the tolerances that are chosen.
    pub fixed: &'a [f64],
    /// dx / dt of every draw, a row of `costs.len()`.
    pub slopes: &'a [f64],
    /// Cost times width of each tolerance that is chosen [m].
    pub costs: &'a [f64],
    /// Least and greatest width [m].
    pub ranges: &'a [(f64, f64)],
    /// Widths to begin with [m].
    pub start: &'a [f64],
    /// The bands.
    pub limited: &'a [Limited<'a>],
    /// Yield to keep.
    pub asked: f64,
}

/// The answer.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Widths that keep the yield.
    Found {
        /// Widths [m].
        widths: Vec<f64>,
        /// sum c_k / t_k.
        cost: f64,
        /// Yield over the draws it was found with.
        reached: f64,
        /// Conic programmes solved.
        programmes: usize,
    },
    /// None: even at the least widths the yield is below the one asked for.
    Infeasible {
        /// Yield at the least widths.
        reached: f64,
        /// Tolerance that carries the largest part of the variance there; none where what is not chosen does.
        in_the_way: Option<usize>,
        /// Its part.
        part: f64,
    },
}

/// Renewals of the linear model, at most.
const RENEWALS: usize = 6;
/// Bisections of the factor.
const BISECTIONS: usize = 14;
/// Relative fall of the cost from which a renewal is worth another.
const WORTH: f64 = 1e-4;

/// Relative steps of the exchanges at the end, and halvings of the width that gives way.
const EXCHANGES: [f64; 3] = [0.02, 0.006, 0.002];
const HALVINGS: usize = 9;
/// Relative fall of the cost from which an exchange counts.
const CHANCE: f64 = 3e-4;

/// Mean and deviation of a quantity as a cone in (1, t), and the side it bounds.
struct Cone {
    /// Sign of the bound: 1 upper, -1 lower.
    side: f64,
    bound: f64,
    /// Mean without t, and its slopes.
    mean: (f64, Vec<f64>),
    /// Rows r with sigma^2 = sum (r . (1, t))^2.
    rows: Vec<Vec<f64>>,
    z: f64,
}

impl Question<'_> {
    fn x(&self, t: &[f64], draw: usize) -> f64 {
        let m = t.len();
        self.fixed[draw] + self.slopes[draw * m..(draw + 1) * m].iter().zip(t).map(|(h, t)| h * t).sum::<f64>()
    }

    /// Part of the draws that keep all bands.
    pub fn reached(&self, t: &[f64]) -> f64 {
        const BLOCK: usize = 8192;
        let n = self.fixed.len();
        let kept = |draw: &usize| {
            let x = self.x(t, *draw);
            self.limited.iter().all(|l| (l.band.0..=l.band.1).contains(&(l.value)(x)))
        };
        let block = |b: usize| (b * BLOCK..n.min((b + 1) * BLOCK)).filter(kept).count();
        crate::parallel::over(n.div_ceil(BLOCK), block).into_iter().sum::<usize>() as f64 / n.max(1) as f64
    }

    /// sum c_k / t_k.
    pub fn cost(&self, t: &[f64]) -> f64 {
        self.costs.iter().zip(t).map(|(c, t)| c / t).sum()
    }

    /// Cones of every bound about `t`.
    fn cones(&self, t: &[f64]) -> Vec<Cone> {
        let (m, n) = (t.len(), self.fixed.len());
        let mut all = Vec::new();
        for l in self.limited {
            let mut rows = vec![0.0; n * (m + 1)];
            let mut values = vec![0.0; n];
            for draw in 0..n {
                let x = self.x(t, draw);
                let (y, slope) = ((l.value)(x), (l.slope)(x));
                let row = &mut rows[draw * (m + 1)..(draw + 1) * (m + 1)];
                let mut own = y;
                for k in 0..m {
                    row[k + 1] = slope * self.slopes[draw * m + k];
                    own -= row[k + 1] * t[k];
                }
                row[0] = own;
                values[draw] = y;
            }
            let count = n as f64;
            let means: Vec<f64> = (0..=m).map(|k| rows.chunks_exact(m + 1).map(|r| r[k]).sum::<f64>() / count).collect();
            let mut covariance: DMatrix<f64> = DMatrix::zeros(m + 1, m + 1);
            for r in rows.chunks_exact(m + 1) {
                for a in 0..=m {
                    for b in 0..=a {
                        covariance[(a, b)] += (r[a] - means[a]) * (r[b] - means[b]) / count;
                    }
                }
            }
            covariance.fill_upper_triangle_with_lower_triangle();
            let mean = values.iter().sum::<f64>() / count;
            let sigma = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt();
            let eigen = SymmetricEigen::new(covariance);
            let rows: Vec<Vec<f64>> =
                (0..=m).map(|k| (0..=m).map(|j| eigen.eigenvalues[k].max(0.0).sqrt() * eigen.eigenvectors[(j, k)]).collect()).collect();
            values.sort_unstable_by(f64::total_cmp);
            let two = l.band.0.is_finite() && l.band.1.is_finite();
            let beyond = (1.0 - self.asked) * if two { 0.5 } else { 1.0 };
            let at = |p: f64| values[((p * count) as usize).min(n - 1)];
            for (side, bound, quantile) in [(1.0, l.band.1, at(1.0 - beyond)), (-1.0, l.band.0, at(beyond))] {
                if bound.is_finite() {
                    let z = if sigma > 0.0 { (side * (quantile - mean) / sigma).max(0.5) } else { 3.0 };
                    all.push(Cone { side, bound, mean: (means[0], means[1..].to_vec()), rows: rows.clone(), z });
                }
            }
        }
        all
    }

    /// The cheapest widths under the cones, their z times `factor`; none where there are none.
    fn programme(&self, cones: &[Cone], factor: f64) -> Option<Vec<f64>> {
        let m = self.costs.len();
        // Unknowns: t_k in units of the start, then tau_k >= 1 / t_k.
        let unit = self.start;
        let mut rows: Vec<(Vec<(usize, f64)>, f64)> = Vec::new();
        for k in 0..m {
            rows.push((vec![(k, 1.0)], self.ranges[k].1 / unit[k]));
            rows.push((vec![(k, -1.0)], -self.ranges[k].0 / unit[k]));
        }
        let mut kinds = vec![NonnegativeConeT(2 * m)];
        for k in 0..m {
            rows.push((vec![(k, -1.0), (m + k, -1.0)], 0.0));
            rows.push((vec![(k, 1.0), (m + k, -1.0)], 0.0));
            rows.push((vec![], 2.0));
            kinds.push(SecondOrderConeT(3));
        }
        for c in cones {
            // In units of the range between bound and mean, whatever the unit of the quantity.
            let scale = (c.bound - c.mean.0).abs().max(1e-300);
            let z = c.z * factor / scale;
            let room = |k: usize| (k, c.side * c.mean.1[k] * unit[k] / scale);
            rows.push(((0..m).map(room).collect(), c.side * (c.bound - c.mean.0) / scale));
            for r in &c.rows {
                rows.push(((0..m).map(|k| (k, -z * r[k + 1] * unit[k])).collect(), z * r[0]));
            }
            kinds.push(SecondOrderConeT(c.rows.len() + 1));
        }
        let (mut i, mut j, mut v) = (vec![], vec![], vec![]);
        for (row, (entries, _)) in rows.iter().enumerate() {
            for (column, value) in entries.iter().filter(|e| e.1 != 0.0) {
                i.push(row);
                j.push(*column);
                v.push(*value);
            }
        }
        let a = CscMatrix::new_from_triplets(rows.len(), 2 * m, i, j, v);
        let b: Vec<f64> = rows.iter().map(|r| r.1).collect();
        let whole: f64 = self.costs.iter().zip(unit).map(|(c, u)| c / u).sum();
        let mut q = vec![0.0; 2 * m];
        (0..m).for_each(|k| q[m + k] = self.costs[k] / unit[k] / whole);
        let settings = DefaultSettingsBuilder::default().verbose(false).max_threads(1).build().ok()?;
        let p = CscMatrix::new_from_triplets(2 * m, 2 * m, vec![], vec![], vec![]);
        let mut solver = DefaultSolver::new(&p, &q, &a, &b, &kinds, settings).ok()?;
        solver.solve();
        let found = matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
        let width = |k: usize| (solver.solution.x[k] * unit[k]).clamp(self.ranges[k].0, self.ranges[k].1);
        (found && solver.solution.x.iter().all(|v| v.is_finite())).then(|| (0..m).map(width).collect())
    }

    /// The largest part of the variance at `t`.
    fn in_the_way(&self, t: &[f64]) -> (Option<usize>, f64) {
        let m = t.len();
        let mut parts = vec![0.0; m + 1];
        for c in self.cones(t) {
            let spread = |k: usize, w: f64| c.rows.iter().map(|r| (r[k] * w).powi(2)).sum::<f64>();
            // Relative to the room there is, so that bands of several quantities add up.
            let room = c.bound - c.mean.0 - c.mean.1.iter().zip(t).map(|(g, t)| g * t).sum::<f64>();
            let over = 1.0 / (room * room).max(1e-300);
            parts[m] += over * spread(0, 1.0);
            (0..m).for_each(|k| parts[k] += over * spread(k + 1, t[k]));
        }
        let sum: f64 = parts.iter().sum();
        let worst = (0..=m).max_by(|a, b| parts[*a].total_cmp(&parts[*b])).unwrap_or(m);
        ((worst < m).then_some(worst), if sum > 0.0 { parts[worst] / sum } else { 0.0 })
    }

    /// The loosest tolerances.
    pub fn answer(&self) -> Answer {
        let least: Vec<f64> = self.ranges.iter().map(|r| r.0).collect();
        let floor = self.reached(&least);
        if floor < self.asked {
            let (in_the_way, part) = self.in_the_way(&least);
            return Answer::Infeasible { reached: floor, in_the_way, part };
        }
        let mut best = (least.clone(), self.cost(&least), floor);
        let most: Vec<f64> = self.ranges.iter().map(|r| r.1).collect();
        let mut t: Vec<f64> = self.start.iter().zip(self.ranges).map(|(s, r)| s.clamp(r.0, r.1)).collect();
        let mut programmes = 0;
        let ceiling = self.reached(&most);
        if ceiling >= self.asked {
            return Answer::Found { cost: self.cost(&most), widths: most, reached: ceiling, programmes };
        }
        for _ in 0..RENEWALS {
            let cones = self.cones(&t);
            // z too small: the yield is missed; too large: it is kept at a cost. A programme without answer counts as too large.
            let mut at = |factor: f64| {
                programmes += 1;
                let t = self.programme(&cones, factor)?;
                let reached = self.reached(&t);
                Some((self.cost(&t), reached, t))
            };
            let (mut low, mut high) = (0.0f64, f64::INFINITY);
            let (mut factor, mut own) = (1.0, None);
            for _ in 0..BISECTIONS {
                match at(factor) {
                    Some((cost, reached, t)) if reached < self.asked => {
                        let _ = (cost, t);
                        low = factor;
                    }
                    Some(kept) => {
                        own = Some(kept);
                        high = factor;
                    }
                    None => high = factor,
                }
                factor = if high.is_finite() { 0.5 * (low + high) } else { 1.3 * factor };
            }
            let Some((cost, reached, widths)) = own else {
                // Nothing under this linear model: from tighter tolerances it is a better one.
                t = t.iter().zip(&least).map(|(t, l)| (t * l).sqrt()).collect();
                continue;
            };
            let fell = 1.0 - cost / best.1;
            t = widths.clone();
            if fell > 0.0 {
                best = (widths, cost, reached);
            }
            if fell < WORTH {
                break;
            }
        }
        let widths = self.exchanged(best.0);
        Answer::Found { cost: self.cost(&widths), reached: self.reached(&widths), widths, programmes }
    }

    /// The last per mil that the linear model does not see: a width is tightened a little and another loosened as far as the draws keep the yield,
    /// wherever that is cheaper.
    fn exchanged(&self, mut t: Vec<f64>) -> Vec<f64> {
        let m = t.len();
        let kept = |t: &[f64]| self.reached(t) >= self.asked;
        // The greatest width of tolerance `k` that keeps the yield, beside the others of `t`, which do.
        let loosened = |t: &[f64], k: usize| {
            let mut all = t.to_vec();
            let (mut low, mut high) = (t[k], (t[k] * 1.1).min(self.ranges[k].1));
            for _ in 0..HALVINGS {
                all[k] = 0.5 * (low + high);
                if kept(&all) { low = all[k] } else { high = all[k] }
            }
            all[k] = low;
            all
        };
        for k in 0..m {
            t = loosened(&t, k);
        }
        for step in EXCHANGES {
            for (k, l) in (0..m).flat_map(|k| (0..m).map(move |l| (k, l))).filter(|(k, l)| k != l) {
                let mut other = t.clone();
                other[l] = (t[l] * (1.0 - step)).max(self.ranges[l].0);
                if !kept(&other) {
                    continue;
                }
                let other = loosened(&other, k);
                // Less than that is chance of the draws.
                if self.cost(&other) < (1.0 - CHANCE) * self.cost(&t) {
                    t = other;
                }
            }
        }
        t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tolerance::sequence;
    use statrs::distribution::{ContinuousCDF, Normal};

    const N: usize = 1 << 14;

    fn normal(m: usize) -> Vec<f64> {
        let normal = Normal::standard();
        sequence::points(N, m, 5).into_iter().map(|u| normal.inverse_cdf(u)).collect()
    }

    /// x = sum a_k t_k z_k within +-1 at 95.45 % (2 sigma): sum (a t)^2 = 1/4; Lagrange: t_k proportional to (c_k / a_k^2)^(1/3).
    #[test]
    fn a_linear_function_has_the_widths_of_its_closed_form() {
        let (a, c): ([f64; 3], [f64; 3]) = ([1.0, 2.0, 0.5], [1.0, 1.0, 3.0]);
        let z = normal(3);
        let slopes: Vec<f64> = z.chunks(3).flat_map(|z| (0..3).map(|k| a[k] * z[k]).collect::<Vec<f64>>()).collect();
        let limited = [Limited { value: &|x| x, slope: &|_| 1.0, band: (-1.0, 1.0) }];
        let fixed = vec![0.0; N];
        let ask = Question {
            fixed: &fixed,
            slopes: &slopes,
            costs: &c,
            ranges: &[(0.001, 5.0); 3],
            start: &[0.2; 3],
            limited: &limited,
            asked: 0.9545,
        };
        let raw: Vec<f64> = (0..3).map(|k| (c[k] / (a[k] * a[k])).cbrt()).collect();
        let scale = 0.5 / raw.iter().zip(a).map(|(t, a)| (t * a).powi(2)).sum::<f64>().sqrt();
        let Answer::Found { widths, reached, .. } = ask.answer() else { panic!("infeasible") };
        assert!((0.9545..0.9555).contains(&reached), "{reached}");
        for k in 0..3 {
            assert!((widths[k] / (scale * raw[k]) - 1.0).abs() < 0.02, "{k}: {} {}", widths[k], scale * raw[k]);
        }
    }

    /// A curved function with a one-sided band: not dearer than the best of a grid, and the yield is kept. So many draws, because the best of 3600 widths is
    /// the one that suits few draws by chance.
    #[test]
    fn no_dearer_than_a_grid_search() {
        const MANY: usize = 1 << 18;
        let normal = Normal::standard();
        let z: Vec<f64> = sequence::points(MANY, 2, 5).into_iter().map(|u| normal.inverse_cdf(u)).collect();
        let value = |x: f64| (0.8 * x).exp();
        let slope = |x: f64| 0.8 * (0.8 * x).exp();
        let limited = [Limited { value: &value, slope: &slope, band: (f64::NEG_INFINITY, 1.6) }];
        let fixed = vec![0.0; MANY];
        let costs = [1.0, 0.3];
        let ask = Question {
            fixed: &fixed,
            slopes: &z,
            costs: &costs,
            ranges: &[(0.02, 1.0), (0.02, 1.0)],
            start: &[0.1, 0.1],
            limited: &limited,
            asked: 0.9973,
        };
        let Answer::Found { cost, reached, .. } = ask.answer() else { panic!("infeasible") };
        assert!((0.9973..0.9974).contains(&reached), "{reached}");
        let width = |k: usize| 0.005 * k as f64;
        let mut best = f64::INFINITY;
        for a in 1..=60 {
            // The yield falls with every width: the loosest that keeps it is the cheapest beside `a`.
            let kept = |b: usize| ask.reached(&[width(a), width(b)]) >= 0.9973;
            let (mut low, mut high) = (0, 61);
            while high - low > 1 {
                let middle = (low + high) / 2;
                if kept(middle) { low = middle } else { high = middle }
            }
            if low > 0 {
                best = best.min(ask.cost(&[width(a), width(low)]));
            }
        }
        assert!(cost <= best, "{cost} against {best}");
    }

    #[test]
    fn what_cannot_be_kept_names_the_tolerance_in_the_way() {
        let z = normal(2);
        let slopes: Vec<f64> = z.chunks(2).flat_map(|z| [z[0], 10.0 * z[1]]).collect();
        let limited = [Limited { value: &|x| x, slope: &|_| 1.0, band: (-1.0, 1.0) }];
        let fixed = vec![0.0; N];
        let ask = Question {
            fixed: &fixed,
            slopes: &slopes,
            costs: &[1.0, 1.0],
            ranges: &[(0.1, 1.0), (0.1, 1.0)],
            start: &[0.5, 0.5],
            limited: &limited,
            asked: 0.99,
        };
        let Answer::Infeasible { reached, in_the_way, part } = ask.answer() else { panic!("feasible") };
        assert!(reached < 0.75 && in_the_way == Some(1) && part > 0.98, "{reached} {in_the_way:?} {part}");
    }
}
