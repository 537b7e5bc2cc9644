//! Poles by weighted least squares of the FRFs, residues and residual terms eliminated.
//!
//! A mode of a structure whose damping is spread like its stiffness or mass is normal: its shape is real, and its residues r = psi psi' / (2 i w_d)
//! are imaginary. Residues that are left complex without need cost accuracy (a third of it at the end of a band), so where an F test does not
//! object they are taken as imaginary.

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
    /// Its residues are imaginary.
    pub normal: bool,
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
/// Residues are complex where imaginary ones would fit as badly as they do in less than this share of the draws of a normal mode.
const NORMAL: f64 = 0.05;

/// A pole while it is being fitted.
#[derive(Debug, Clone, Copy)]
struct Working {
    pole: Complex64,
    orders: usize,
    /// Residues are imaginary: the shape is real.
    normal: bool,
}

impl Working {
    /// Real numbers in a residue.
    fn width(&self) -> usize {
        if self.normal { 1 } else { 2 }
    }
}

/// Column of the first number of each residue; the last entry is that of the residual terms.
fn places(poles: &[Working]) -> Vec<usize> {
    let widths = std::iter::once(0).chain(poles.iter().map(Working::width));
    widths
        .scan(0, |at, w| {
            *at += w;
            Some(*at)
        })
        .collect()
}

/// Residue over |s| of pole m.
fn residue(poles: &[Working], places: &[usize], c: &DVector<f64>, m: usize) -> Complex64 {
    let at = places[m];
    if poles[m].normal { Complex64::new(0.0, c[at]) } else { Complex64::new(c[at], c[at + 1]) }
}

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

/// The poles of a fit, refined on another set over the same lines, in their order.
pub(super) fn again(set: &FrfSet, poles: &[Pole]) -> Vec<Complex64> {
    let mut working: Vec<Working> = poles.iter().map(|p| Working { pole: p.pole, orders: p.orders, normal: p.normal }).collect();
    Problem::of(set).descend(&mut working);
    working.iter().map(|w| w.pole).collect()
}

pub(super) fn refine(set: &FrfSet, candidates: &[Candidate]) -> Refined {
    let problem = Problem::of(set);
    let (f1, f2) = problem.band();
    let mut poles: Vec<Working> = candidates.iter().map(|c| Working { pole: c.pole, orders: c.orders, normal: false }).collect();
    let mut state = problem.descend(&mut poles);
    // What lies beyond the band is more than a constant where it is near: a pole above it, and one below.
    for guess in [1.15 * f2, 0.85 * f1] {
        (poles, state) = problem.with_pole_beyond(poles, state, guess, false, CHANCE);
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
        if problem.chance(state.cost, &poles, tried.cost, &fewer) < CHANCE {
            break;
        }
        (poles, state) = (fewer, tried);
    }
    (poles, state) = problem.with_normal_modes(poles, state);
    problem.result(poles, state)
}

/// Chance that an F of `more` and `left` degrees of freedom lies above `f`. A model that leaves nothing has an F without bound, for which
/// the distribution has no value; 1e100 is beyond any chance already.
fn f_beyond(f: f64, more: f64, left: f64) -> f64 {
    if f > 0.0 { FisherSnedecor::new(more, left).map_or(1.0, |d| d.sf(f.min(1e100))) } else { 1.0 }
}

impl Problem<'_> {
    fn of(set: &FrfSet) -> Problem<'_> {
        let omega: Vec<f64> = set.frequency.iter().map(|f| TAU * f).collect();
        Problem { set, scale: omega[omega.len() - 1], omega }
    }

    fn columns(&self) -> usize {
        self.set.h.len()
    }

    /// Real numbers in a model: poles, residues, residual terms.
    fn numbers(&self, poles: &[Working]) -> usize {
        2 * poles.len() + self.columns() * (poles.iter().map(Working::width).sum::<usize>() + 2)
    }

    /// Degrees of freedom left by a model.
    fn freedom(&self, poles: &[Working]) -> f64 {
        let data = 2 * self.omega.len() * self.columns();
        data.saturating_sub(self.numbers(poles)).max(1) as f64
    }

    /// The chance that what the model `poles` gains over the nested `fewer` is noise alone: F test.
    fn chance(&self, cost: f64, poles: &[Working], without: f64, fewer: &[Working]) -> f64 {
        let (more, left) = ((self.numbers(poles) - self.numbers(fewer)) as f64, self.freedom(poles));
        let f = (without - cost) / more / (cost / left).max(f64::MIN_POSITIVE);
        f_beyond(f, more, left)
    }

    /// First and last frequency in Hz.
    fn band(&self) -> (f64, f64) {
        (self.set.frequency[0], self.set.frequency[self.set.frequency.len() - 1])
    }

    /// Adds a pole that begins at `guess` (Hz) where it stays outside the band and gains more than chance gives in one of 1 / `level` trials.
    fn with_pole_beyond(&self, poles: Vec<Working>, state: State, guess: f64, normal: bool, level: f64) -> (Vec<Working>, State) {
        let (f1, f2) = self.band();
        let mut more = poles.clone();
        more.push(Working { pole: TAU * guess * Complex64::new(-0.05, 1.0), orders: 0, normal });
        let tried = self.descend(&mut more);
        let outside = more.last().is_some_and(|p| !(f1..=f2).contains(&of_pole(p.pole).0));
        if outside && self.chance(tried.cost, &more, state.cost, &poles) < level { (more, tried) } else { (poles, state) }
    }

    /// Takes the residues as imaginary where the data do not object: of all poles, or else of one after the other, the least objected to first.
    fn with_normal_modes(&self, mut poles: Vec<Working>, mut state: State) -> (Vec<Working>, State) {
        let normal = |poles: &[Working], which: &dyn Fn(usize) -> bool| -> Vec<Working> {
            poles.iter().enumerate().map(|(k, p)| Working { normal: p.normal || which(k), ..*p }).collect()
        };
        let mut all = normal(&poles, &|_| true);
        let tried = self.descend(&mut all);
        // Complex residues of the poles beyond the band also stood in for poles farther out, which now speak for themselves.
        let farthest = all.iter().map(|p| of_pole(p.pole).0).fold(self.band().1, f64::max);
        let (all, tried) = self.with_pole_beyond(all, tried, 1.2 * farthest, true, NORMAL);
        if self.numbers(&all) <= self.numbers(&poles) && self.chance(state.cost, &poles, tried.cost, &all) >= NORMAL {
            return (all, tried);
        }
        while poles.iter().any(|p| !p.normal) {
            let open = (0..poles.len()).filter(|k| !poles[*k].normal);
            let held = open.map(|k| (k, self.evaluate(&normal(&poles, &|j| j == k)).cost));
            let Some((k, _)) = held.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            let mut one = normal(&poles, &|j| j == k);
            let tried = self.descend(&mut one);
            if self.chance(state.cost, &poles, tried.cost, &one) < NORMAL {
                break;
            }
            (poles, state) = (one, tried);
        }
        (poles, state)
    }

    /// Weighted basis of an FRF: rows real and imaginary part of each line.
    fn basis(&self, poles: &[Working], j: usize) -> DMatrix<f64> {
        let lines = self.omega.len();
        let places = places(poles);
        let rest = places[poles.len()];
        let mut b = DMatrix::zeros(2 * lines, rest + 2);
        for (k, w) in self.omega.iter().enumerate() {
            let weight = 1.0 / self.set.sigma[j][k];
            let at = Complex64::new(0.0, *w);
            for (Working { pole: s, normal, .. }, &place) in poles.iter().zip(&places) {
                // The residue times |s| keeps the columns of one size.
                let (p, q) = (s.norm() / (at - s), s.norm() / (at - s.conj()));
                let (re, im) = (p + q, Complex64::i() * (p - q));
                let own = if *normal { &[im][..] } else { &[re, im] };
                for (c, value) in own.iter().enumerate() {
                    b[(k, place + c)] = value.re * weight;
                    b[(lines + k, place + c)] = value.im * weight;
                }
            }
            b[(k, rest)] = weight;
            b[(k, rest + 1)] = -(self.omega[0] / w).powi(2) * weight;
        }
        b
    }

    /// Cost, and gradient and normal matrix over (Re s, Im s) of each pole with the linear parameters projected out (Kaufman's form).
    fn evaluate(&self, poles: &[Working]) -> State {
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
    fn column(&self, poles: &[Working], j: usize) -> State {
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
        let places = places(poles);
        let mut d = DMatrix::zeros(2 * lines, n);
        for (k, w) in self.omega.iter().enumerate() {
            let weight = 1.0 / self.set.sigma[j][k];
            let at = Complex64::new(0.0, *w);
            for (m, Working { pole: s, .. }) in poles.iter().enumerate() {
                let residue = residue(poles, &places, &c, m) * s.norm();
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
    fn descend(&self, poles: &mut [Working]) -> State {
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
            let mut next = poles.to_vec();
            for (m, p) in next.iter_mut().enumerate() {
                // A step of more than half of |s| leaves what the linearisation knows.
                let move_by = Complex64::new(step[2 * m], step[2 * m + 1]);
                let limit = 0.3 * p.pole.norm();
                p.pole += if move_by.norm() > limit { move_by * (limit / move_by.norm()) } else { move_by };
                p.pole.re = p.pole.re.min(-1e-6 * p.pole.norm());
                p.pole.im = p.pole.im.max(1e-3 * self.scale * 1e-3);
            }
            let tried = self.evaluate(&next);
            if tried.cost < state.cost {
                // A change of the squares by this little moves no pole by a hundredth of its deviation.
                let done = state.cost - tried.cost < 1e-4 + 1e-9 * state.cost;
                poles.copy_from_slice(&next);
                state = tried;
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

    fn result(&self, poles: Vec<Working>, state: State) -> Refined {
        let (f1, f2) = self.band();
        let chi_squared = state.cost / self.freedom(&poles);
        // Where the model leaves more than the noise the intervals grow with it.
        // They are those of complex residues in any case: a phase of a third of a degree, which no test sees, moves a pole by more than the
        // deviation that imaginary ones alone would give.
        let free: Vec<Working> = poles.iter().map(|p| Working { normal: false, ..*p }).collect();
        let covariance = self.evaluate(&free).normal.try_inverse().map(|c| c * chi_squared.max(1.0));
        let places = places(&poles);
        let all = poles.iter().enumerate().map(|(m, Working { pole: s, orders, normal })| {
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
            let residues = state.linear.iter().map(|c| residue(&poles, &places, c, m) * w).collect();
            Pole { pole: *s, orders: *orders, reported, normal: *normal, frequency_sigma, damping_sigma, residues }
        });
        let all: Vec<Pole> = all.collect();
        Refined { error: self.error(&poles, &state), poles: all, chi_squared }
    }

    /// Rms of the difference over rms of the FRFs, without weights.
    fn error(&self, poles: &[Working], state: &State) -> f64 {
        let (mut above, mut below) = (0.0, 0.0);
        for (j, h) in self.set.h.iter().enumerate() {
            let model = self.basis(poles, j) * &state.linear[j];
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

#[cfg(test)]
mod tests {
    use super::f_beyond;

    #[test]
    fn a_model_that_leaves_nothing_gains_beyond_chance() {
        for f in [1e150, 1e300, 1.7e308, f64::INFINITY] {
            assert!(f_beyond(f, 4.0, 100.0) < 1e-100, "{f}");
        }
        assert!((f_beyond(f64::NAN, 4.0, 100.0), f_beyond(-1.0, 4.0, 100.0)) == (1.0, 1.0));
        assert!((f_beyond(2.462_6, 4.0, 100.0) - 0.05).abs() < 1e-4);
    }
}
