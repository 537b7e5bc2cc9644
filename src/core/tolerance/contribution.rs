//! Contributions of independent inputs to the variance of an output: first-order and total Sobol indices.
//!
//! S_i = V(E(y | u_i)) / V(y), T_i = 1 - V(E(y | u_~i)) / V(y). Estimators of Saltelli et al. (Comput. Phys. Commun. 181 (2010) 259): S_i from the mean of
//! f(B) (f(A_B^i) - f(A)), T_i by Jansen from that of (f(A) - f(A_B^i))^2 / 2; A and B are two halves of quasi-random points, repeated with other shifts, whose
//! spread gives the interval.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::sequence;

/// Indices of one input with their 95 % intervals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contribution {
    /// First-order index.
    pub first: f64,
    /// Half width of its interval.
    pub first_error: f64,
    /// Total index.
    pub total: f64,
    /// Half width of its interval.
    pub total_error: f64,
}

/// Shifts that the spread is taken over.
const SHIFTS: usize = 12;

/// Indices of `f` over `d` inputs, uniform and independent in (0, 1), at most half of [`sequence::DIMENSIONS`]; `n` points a shift, a power of 2. A function
/// that does not vary has indices of 0.
pub fn contributions(d: usize, n: usize, seed: u64, f: &(dyn Fn(&[f64]) -> f64 + Sync)) -> Vec<Contribution> {
    let one = |shift: usize| -> Vec<(f64, f64)> {
        let points = sequence::points(n, 2 * d, seed.wrapping_add(shift as u64));
        let mut sums = vec![(0.0, 0.0); d];
        let (mut sum, mut squares) = (0.0, 0.0);
        let values: Vec<(f64, f64)> = points.chunks_exact(2 * d).map(|p| (f(&p[..d]), f(&p[d..]))).collect();
        // About the mean the estimator of the first order has a smaller variance.
        let mean = values.iter().map(|v| v.0 + v.1).sum::<f64>() / (2 * n) as f64;
        let mut u = vec![0.0; d];
        for (p, (a, b)) in points.chunks_exact(2 * d).zip(&values) {
            let (a, b) = (a - mean, b - mean);
            sum += a + b;
            squares += a * a + b * b;
            for i in 0..d {
                u.copy_from_slice(&p[..d]);
                u[i] = p[d + i];
                let mixed = f(&u) - mean;
                sums[i].0 += b * (mixed - a);
                sums[i].1 += 0.5 * (a - mixed).powi(2);
            }
        }
        let n = n as f64;
        let variance = squares / (2.0 * n) - (sum / (2.0 * n)).powi(2);
        let over = |v: f64| if variance > 0.0 { v / n / variance } else { 0.0 };
        sums.into_iter().map(|(s, t)| (over(s), over(t))).collect()
    };
    let all = crate::parallel::over(SHIFTS, one);
    let t = StudentsT::new(0.0, 1.0, (SHIFTS - 1) as f64).map_or(2.2, |t| t.inverse_cdf(0.975));
    let spread = |pick: &dyn Fn(&(f64, f64)) -> f64, i: usize| {
        let mean = all.iter().map(|s| pick(&s[i])).sum::<f64>() / SHIFTS as f64;
        let variance = all.iter().map(|s| (pick(&s[i]) - mean).powi(2)).sum::<f64>() / (SHIFTS - 1) as f64;
        (mean, t * (variance / SHIFTS as f64).sqrt())
    };
    let of = |i: usize| {
        let ((first, first_error), (total, total_error)) = (spread(&|s| s.0, i), spread(&|s| s.1, i));
        Contribution { first, first_error, total, total_error }
    };
    (0..d).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Ishigami and Homma (1990): sin x1 + a sin^2 x2 + b x3^4 sin x1 on (-pi, pi), a = 7, b = 0.1.
    #[test]
    fn ishigami_by_its_closed_form() {
        let f = |u: &[f64]| {
            let x = |k: usize| PI * (2.0 * u[k] - 1.0);
            x(0).sin() + 7.0 * x(1).sin().powi(2) + 0.1 * x(2).powi(4) * x(0).sin()
        };
        let (v1, v2) = (0.5 * (1.0 + 0.1 * PI.powi(4) / 5.0f64).powi(2), 49.0 / 8.0);
        let v13 = 0.01 * PI.powi(8) * 8.0 / 225.0;
        let v = v1 + v2 + v13;
        let found = contributions(3, 4096, 1, &f);
        for (k, (first, total)) in [(v1 / v, (v1 + v13) / v), (v2 / v, v2 / v), (0.0, v13 / v)].into_iter().enumerate() {
            assert!((found[k].first - first).abs() < 0.01 && (found[k].total - total).abs() < 0.01, "{k}: {:?} {first} {total}", found[k]);
            assert!(found[k].first_error < 0.01 && found[k].total_error < 0.01, "{:?}", found[k]);
        }
    }

    /// Sobol's g-function: prod (|4 u_i - 2| + a_i) / (1 + a_i); V_i = 1 / (3 (1 + a_i)^2), V = prod (1 + V_i) - 1.
    #[test]
    fn g_function_by_its_closed_form() {
        let a = [0.0, 0.5, 3.0, 9.0, 99.0, 99.0];
        let f = |u: &[f64]| u.iter().zip(a).map(|(u, a)| ((4.0 * u - 2.0).abs() + a) / (1.0 + a)).product::<f64>();
        let own: Vec<f64> = a.iter().map(|a| 1.0 / (3.0 * (1.0 + a) * (1.0f64 + a))).collect();
        let all: f64 = own.iter().map(|v| 1.0 + v).product();
        for (k, found) in contributions(6, 4096, 1, &f).iter().enumerate() {
            let (first, total) = (own[k] / (all - 1.0), own[k] * all / (1.0 + own[k]) / (all - 1.0));
            assert!((found.first - first).abs() < 0.01 && (found.total - total).abs() < 0.01, "{k}: {found:?} {first} {total}");
        }
    }

    #[test]
    fn what_does_not_vary_contributes_nothing() {
        assert!(contributions(2, 64, 1, &|_| 3.0).iter().all(|c| c.first == 0.0 && c.total == 0.0));
    }
}
