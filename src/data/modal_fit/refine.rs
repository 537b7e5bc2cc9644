//! Poles by weighted least squares of the FRFs, residues and residual terms eliminated.

use super::pick::Candidate;
use super::{FrfSet, of_pole};
use crate::parallel;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use std::f64::consts::TAU;

/// A pole of the final model.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pole {
    pub pole: Complex64,
    pub orders: usize,
    /// Inside the band: a mode. Others stand in for what lies beyond it.
    pub reported: bool,
    pub frequency_sigma: f64,
    pub damping_sigma: f64,
    /// Residue in each FRF.
    pub residues: Vec<Complex64>,
}

pub(super) struct Refined {
    pub poles: Vec<Pole>,
    pub chi_squared: f64,
    pub error: f64,
}

/// A pole the data need lowers the weighted squares more than chance would in one of this many trials.
const CHANCE: f64 = 1e-6;
const ITERATIONS: usize = 40;

/// What one evaluation gives.
struct State {
    /// Weighted sum of squares.
    cost: f64,
    gradient: DVector<f64>,
    normal: DMatrix<f64>,
    /// [FRF][parameter]: Re and Im of each residue, then upper and lower residual term.
    linear: Vec<DVector<f64>>,
}

struct Problem<'a> {
    set: &'a FrfSet,
    omega: Vec<f64>,
    scale: f64,
}

pub(super) fn refine(set: &FrfSet, candidates: &[Candidate]) -> Refined {
    let omega: Vec<f64> = set.frequency.iter().map(|f| TAU * f).collect();
    let problem = Problem { set, scale: omega[omega.len() - 1], omega };
    let (f1, f2) = (set.frequency[0], set.frequency[set.frequency.len() - 1]);
    let mut poles: Vec<(Complex64, usize)> = candidates.iter().map(|c| (c.pole, c.orders)).collect();
    let mut state = problem.descend(&mut poles);
    // What lies beyond the band is more than a constant where it is near: a pole above it, and one below.
    for guess in [1.15 * f2, 0.85 * f1] {
        let mut more = poles.clone();
        more.push((TAU * guess * Complex64::new(-0.05, 1.0), 0));
        let tried = problem.descend(&mut more);
        let outside = more.last().is_some_and(|p| !(f1..=f2).contains(&of_pole(p.0).0));
        if outside && problem.needed(tried.cost, state.cost, more.len()) {
            (poles, state) = (more, tried);
        }
    }
    // Backward elimination: the pole whose loss costs least goes first.
    while !poles.is_empty() {
        let without = |k: usize| {
            let mut fewer = poles.clone();
            fewer.remove(k);
            fewer
        };
        // With the others held the loss is too great; only the least of them is worth a descent.
        let held = (0..poles.len()).map(|k| (k, problem.evaluate(&without(k)).cost));
        let Some((k, _)) = held.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        let mut fewer = without(k);
        let tried = problem.descend(&mut fewer);
        if problem.needed(state.cost, tried.cost, poles.len()) {
            break;
        }
        (poles, state) = (fewer, tried);
    }
    problem.result(poles, state, f1, f2)
}

impl Problem<'_> {
    fn columns(&self) -> usize {
        self.set.h.len()
    }

    /// Degrees of freedom left by so many poles.
    fn freedom(&self, poles: usize) -> f64 {
        let data = 2 * self.omega.len() * self.columns();
        let used = 2 * poles + self.columns() * (2 * poles + 2);
        data.saturating_sub(used).max(1) as f64
    }

    /// Whether the better of two nested models is better by more than chance: F test of one pole and its residues.
    fn needed(&self, cost: f64, without: f64, poles: usize) -> bool {
        let (more, left) = ((2 + 2 * self.columns()) as f64, self.freedom(poles));
        let f = (without - cost) / more / (cost / left).max(f64::MIN_POSITIVE);
        f > 0.0 && FisherSnedecor::new(more, left).is_ok_and(|d| d.sf(f) < CHANCE)
    }

    /// Weighted basis of an FRF: rows real and imaginary part of each line.
    fn basis(&self, poles: &[(Complex64, usize)], j: usize) -> DMatrix<f64> {
        let lines = self.omega.len();
        let mut b = DMatrix::zeros(2 * lines, 2 * poles.len() + 2);
        for (k, w) in self.omega.iter().enumerate() {
            let weight = 1.0 / self.set.sigma[j][k];
            let at = Complex64::new(0.0, *w);
            for (m, (s, _)) in poles.iter().enumerate() {
                // The residue times |s| keeps the columns of one size.
                let (p, q) = (s.norm() / (at - s), s.norm() / (at - s.conj()));
                let (re, im) = (p + q, Complex64::i() * (p - q));
                b[(k, 2 * m)] = re.re * weight;
                b[(lines + k, 2 * m)] = re.im * weight;
                b[(k, 2 * m + 1)] = im.re * weight;
                b[(lines + k, 2 * m + 1)] = im.im * weight;
            }
            b[(k, 2 * poles.len())] = weight;
            b[(k, 2 * poles.len() + 1)] = -(self.omega[0] / w).powi(2) * weight;
        }
        b
    }

    /// Cost, and gradient and normal matrix over (Re s, Im s) of each pole with the linear parameters projected out (Kaufman's form).
    fn evaluate(&self, poles: &[(Complex64, usize)]) -> State {
        let parts: Vec<State> = parallel::over(self.columns(), |j| self.column(poles, j));
        let n = 2 * poles.len();
        let mut state = State { cost: 0.0, gradient: DVector::zeros(n), normal: DMatrix::zeros(n, n), linear: Vec::new() };
        for part in parts {
            state.cost += part.cost;
            state.gradient += part.gradient;
            state.normal += part.normal;
            state.linear.extend(part.linear);
        }
        state
    }

    /// The share of FRF j.
    fn column(&self, poles: &[(Complex64, usize)], j: usize) -> State {
        let (lines, n) = (self.omega.len(), 2 * poles.len());
        let basis = self.basis(poles, j);
        let target = DVector::from_fn(2 * lines, |r, _| {
            let h = self.set.h[j][r % lines] / self.set.sigma[j][r % lines];
            if r < lines { h.re } else { h.im }
        });
        let qr = basis.clone().qr();
        let (q, r) = (qr.q(), qr.r());
        let c = solve_triangle(&r, &q.tr_mul(&target));
        let residual = &target - &basis * &c;
        let mut d = DMatrix::zeros(2 * lines, n);
        for (k, w) in self.omega.iter().enumerate() {
            let weight = 1.0 / self.set.sigma[j][k];
            let at = Complex64::new(0.0, *w);
            for (m, (s, _)) in poles.iter().enumerate() {
                let residue = Complex64::new(c[2 * m], c[2 * m + 1]) * s.norm();
                let (p, q) = (residue / ((at - s) * (at - s)), residue.conj() / ((at - s.conj()) * (at - s.conj())));
                let (re, im) = ((p + q) * weight, Complex64::i() * (p - q) * weight);
                d[(k, 2 * m)] = re.re;
                d[(lines + k, 2 * m)] = re.im;
                d[(k, 2 * m + 1)] = im.re;
                d[(lines + k, 2 * m + 1)] = im.im;
            }
        }
        d -= &q * q.tr_mul(&d);
        State { cost: residual.norm_squared(), gradient: d.tr_mul(&residual), normal: d.transpose() * &d, linear: vec![c] }
    }

    /// Levenberg-Marquardt over the poles.
    fn descend(&self, poles: &mut Vec<(Complex64, usize)>) -> State {
        let mut state = self.evaluate(poles);
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            if poles.is_empty() {
                break;
            }
            let mut system = state.normal.clone();
            for k in 0..system.nrows() {
                system[(k, k)] *= 1.0 + damping;
                system[(k, k)] += f64::MIN_POSITIVE;
            }
            let Some(step) = system.cholesky().map(|c| c.solve(&state.gradient)) else {
                damping *= 10.0;
                continue;
            };
            let mut next = poles.clone();
            for (m, p) in next.iter_mut().enumerate() {
                // A step of more than half of |s| leaves what the linearisation knows.
                let move_by = Complex64::new(step[2 * m], step[2 * m + 1]);
                let limit = 0.3 * p.0.norm();
                p.0 += if move_by.norm() > limit { move_by * (limit / move_by.norm()) } else { move_by };
                p.0.re = p.0.re.min(-1e-6 * p.0.norm());
                p.0.im = p.0.im.max(1e-3 * self.scale * 1e-3);
            }
            let tried = self.evaluate(&next);
            if tried.cost < state.cost {
                // A change of the squares by this little moves no pole by a hundredth of its deviation.
                let done = state.cost - tried.cost < 1e-4 + 1e-9 * state.cost;
                (*poles, state) = (next, tried);
                damping = (damping * 0.2).max(1e-12);
                if done {
                    break;
                }
            } else {
                damping *= 5.0;
                if damping > 1e8 {
                    break;
                }
            }
        }
        state
    }

    fn result(&self, poles: Vec<(Complex64, usize)>, state: State, f1: f64, f2: f64) -> Refined {
        let chi_squared = state.cost / self.freedom(poles.len());
        // Where the model leaves more than the noise the intervals grow with it.
        let covariance = state.normal.clone().try_inverse().map(|c| c * chi_squared.max(1.0));
        let all = poles.iter().enumerate().map(|(m, (s, orders))| {
            let (frequency, damping) = of_pole(*s);
            let w = s.norm();
            // f = |s| / 2 pi, zeta = -Re s / |s|.
            let f_slope = [s.re / w / TAU, s.im / w / TAU];
            let z_slope = [-s.im * s.im / w.powi(3), s.re * s.im / w.powi(3)];
            let sigma = |g: [f64; 2]| {
                covariance.as_ref().map_or(f64::INFINITY, |c| {
                    let at = |a: usize, b: usize| c[(2 * m + a, 2 * m + b)];
                    (g[0] * g[0] * at(0, 0) + 2.0 * g[0] * g[1] * at(0, 1) + g[1] * g[1] * at(1, 1)).max(0.0).sqrt()
                })
            };
            let (frequency_sigma, damping_sigma) = (sigma(f_slope), sigma(z_slope));
            let determined = frequency_sigma < 0.5 * damping * frequency && damping_sigma < 0.5 * damping;
            let reported = (f1..=f2).contains(&frequency) && damping < 0.4 && determined;
            let residues = state.linear.iter().map(|c| Complex64::new(c[2 * m], c[2 * m + 1]) * w).collect();
            Pole { pole: *s, orders: *orders, reported, frequency_sigma, damping_sigma, residues }
        });
        let poles: Vec<Pole> = all.collect();
        Refined { error: self.error(&poles, &state), poles, chi_squared }
    }

    /// Rms of the difference over rms of the FRFs, without weights.
    fn error(&self, poles: &[Pole], state: &State) -> f64 {
        let list: Vec<(Complex64, usize)> = poles.iter().map(|p| (p.pole, 0)).collect();
        let (mut above, mut below) = (0.0, 0.0);
        for (j, h) in self.set.h.iter().enumerate() {
            let model = self.basis(&list, j) * &state.linear[j];
            let n = h.len();
            for (k, h) in h.iter().enumerate() {
                let computed = Complex64::new(model[k], model[n + k]) * self.set.sigma[j][k];
                above += (h - computed).norm_sqr();
                below += h.norm_sqr();
            }
        }
        if below > 0.0 { (above / below).sqrt() } else { 0.0 }
    }
}

/// R c = b; a column the others already span gets 0.
fn solve_triangle(r: &DMatrix<f64>, b: &DVector<f64>) -> DVector<f64> {
    let n = r.ncols();
    let largest = (0..n).map(|k| r[(k, k)].abs()).fold(0.0, f64::max);
    let mut c = DVector::zeros(n);
    for k in (0..n).rev() {
        let rest: f64 = (k + 1..n).map(|l| r[(k, l)] * c[l]).sum();
        c[k] = if r[(k, k)].abs() > 1e-13 * largest { (b[k] - rest) / r[(k, k)] } else { 0.0 };
    }
    c
}
