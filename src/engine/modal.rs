//! Damped modes: the nonlinear eigenproblem `Z(s) phi = 0` of small motion about rest, `Z(s) = s^2 M + sum_e z_e(s) b_e b_e'`, where
//! `z_e(s)` is the dynamic stiffness of a place's element (friction stuck). Frequency-dependent laws are taken as they are.
//!
//! Every mode starts from one of the undamped structure with the storage stiffness at a frequency of the range. Inverse iteration with
//! the symmetric Rayleigh functional `phi' Z(s) phi = 0` (Schwetlick and Schreiber, Linear Algebra Appl. 436, 2012; cubic for symmetric
//! problems) finds the damped one by block-tridiagonal solves. A start that falls onto a mode found before is taken up again with that
//! mode projected out.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::model::{Bound, Model};

use super::EngineError;
use super::blocktri::{BlockTri, BlockTriError, Layout, Levels};

/// One damped mode.
#[derive(Clone, Debug)]
pub struct Mode {
    /// `|s| / 2 pi` [Hz].
    pub frequency_hz: f64,
    /// Damping ratio `-Re(s) / |s|`; 0 for a rigid-body mode.
    pub damping: f64,
    /// Eigenvalue s [1/s], `Im(s) >= 0`.
    pub lambda: Complex64,
    /// Displacements of all degrees of freedom, scaled to `phi' Z'(s) phi = 2 s` (undamped: `phi' M phi = 1`), rigid-body modes to
    /// `phi' M phi = 1`.
    pub shape: Vec<Complex64>,
    /// Derivative of the eigenvalue with respect to each free parameter; empty unless asked for. Of a repeated eigenvalue it is the
    /// one along the shape found.
    pub dlambda: Vec<Complex64>,
}

impl Mode {
    /// Derivative of [`Mode::frequency_hz`] with respect to a free parameter.
    pub fn frequency_slope(&self, k: usize) -> f64 {
        self.size_slope(k) / TAU
    }
    /// Derivative of [`Mode::damping`] with respect to a free parameter.
    pub fn damping_slope(&self, k: usize) -> f64 {
        let size = self.lambda.norm();
        if size == 0.0 { 0.0 } else { (self.lambda.re / size * self.size_slope(k) - self.dlambda[k].re) / size }
    }
    fn size_slope(&self, k: usize) -> f64 {
        let size = self.lambda.norm();
        if size == 0.0 { 0.0 } else { (self.lambda.conj() * self.dlambda[k]).re / size }
    }
}

/// Which modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Those with a frequency from the first to the second [Hz].
    Band(f64, f64),
    /// The lowest, this many (rigid-body modes count).
    Lowest(usize),
}

/// Modes in the order of their frequencies.
///
/// # Errors
/// [`EngineError::Effect`] for a law without a small-signal limit, [`EngineError::NoMode`] where the iteration fails,
/// [`EngineError::Request`] for a band without meaning, [`EngineError::Linear`] for a massless body that nothing holds.
pub fn modes(model: &Model, bound: &Bound, range: Range, sensitivities: bool) -> Result<Vec<Mode>, EngineError> {
    let (low, high) = match range {
        Range::Band(low, high) if !(low >= 0.0 && high > low && high.is_finite()) => {
            return Err(EngineError::Request {
                what: "the frequency band of the modes",
                value: format!("{low} to {high} Hz"),
                accepted: "0 <= lower end < upper end".into(),
            });
        }
        Range::Band(low, high) => (low, high),
        Range::Lowest(_) => (0.0, f64::INFINITY),
    };
    let mut problem = Problem::new(model, bound)?;
    // Without mass nothing vibrates.
    if problem.mass.iter().all(|m| *m == 0.0) {
        return Ok(vec![]);
    }
    let starts = problem.starts(range)?;
    let mut found: Vec<Mode> = Vec::new();
    for start in starts {
        let mode = match problem.rigid(&start)? {
            Some(mode) => mode,
            None => problem.damped(&start, &found)?,
        };
        found.push(mode);
    }
    found.retain(|m| m.frequency_hz >= low && m.frequency_hz <= high);
    found.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    if let Range::Lowest(count) = range {
        found.truncate(count);
    }
    if sensitivities {
        for mode in &mut found {
            mode.dlambda = problem.slopes(mode)?;
        }
    }
    Ok(found)
}

/// Undamped mode to start from.
struct Start {
    omega: f64,
    shape: Vec<f64>,
}

struct Problem<'a> {
    bound: &'a Bound,
    mass: Vec<f64>,
    slots: Vec<[Option<usize>; 4]>,
    diagonal: Vec<usize>,
    matrix: BlockTri<Complex64>,
    /// Number of the first element with the same law.
    same: Vec<usize>,
    z: Vec<Complex64>,
    dz: Vec<Complex64>,
    dp: Vec<Complex64>,
    /// Largest undamped circular frequency.
    highest: f64,
}

const ITERATIONS: usize = 60;
/// Change of the eigenvalue, against its size, at which it stands.
const TOLERANCE: f64 = 1e-13;
/// What is accepted where rounding ends the iteration earlier.
const ACCEPTED: f64 = 1e-10;
/// Undamped frequencies at or below this part of the highest are those of rigid bodies.
const RIGID: f64 = 3e-7;

impl<'a> Problem<'a> {
    fn new(model: &Model, bound: &'a Bound) -> Result<Self, EngineError> {
        let n = model.dofs.len();
        let pairs: Vec<_> = bound.elements.iter().filter_map(|e| Some((e.to?, e.from?))).chain((0..n).map(|d| (d, d))).collect();
        let layout = Arc::new(Layout::new(Levels::new(n, &pairs)?));
        let slot = |i: Option<usize>, j: Option<usize>| match (i, j) {
            (Some(i), Some(j)) => layout.slot(i, j).map(Some),
            _ => Ok(None),
        };
        let mut slots = Vec::with_capacity(bound.elements.len());
        for e in &bound.elements {
            slots.push([slot(e.to, e.to)?, slot(e.from, e.from)?, slot(e.to, e.from)?, slot(e.from, e.to)?]);
        }
        let (mut firsts, mut same): (Vec<usize>, Vec<usize>) = (vec![], vec![]);
        for (i, e) in bound.elements.iter().enumerate() {
            same.push(firsts.iter().copied().find(|&j| bound.elements[j].same_law(e)).unwrap_or_else(|| {
                firsts.push(i);
                i
            }));
        }
        Ok(Problem {
            bound,
            mass: model.dofs.iter().map(|d| d.mass).collect(),
            slots,
            diagonal: (0..n).map(|d| layout.slot(d, d)).collect::<Result<_, _>>()?,
            matrix: BlockTri::new(layout),
            same,
            z: vec![],
            dz: vec![],
            dp: vec![],
            highest: 0.0,
        })
    }

    fn relative(&self, e: usize, u: &[Complex64]) -> Complex64 {
        let e = &self.bound.elements[e];
        e.to.map_or(Complex64::ZERO, |d| u[d]) - e.from.map_or(Complex64::ZERO, |d| u[d])
    }

    /// Stiffnesses of all elements at `s` and their derivatives.
    fn laws(&mut self, s: Complex64) -> Result<(), EngineError> {
        self.z.clear();
        self.dz.clear();
        for (i, element) in self.bound.elements.iter().enumerate() {
            let first = self.same[i];
            let (z, dz) = if first < i { (self.z[first], self.dz[first]) } else { element.stiffness(s, &mut self.dp)? };
            self.z.push(z);
            self.dz.push(dz);
        }
        Ok(())
    }

    fn factor(&mut self, s: Complex64) -> Result<(), BlockTriError> {
        self.matrix.clear();
        for (d, slot) in self.diagonal.iter().enumerate() {
            self.matrix.add_at(*slot, s * s * self.mass[d]);
        }
        for (slots, z) in self.slots.iter().zip(&self.z) {
            for (slot, value) in slots.iter().zip([*z, *z, -*z, -*z]) {
                if let Some(slot) = slot {
                    self.matrix.add_at(*slot, value);
                }
            }
        }
        self.matrix.factor().map(|_| ())
    }

    /// `u' Z(s) v` and `u' Z'(s) v` with the laws at `s` at hand.
    fn products(&self, s: Complex64, u: &[Complex64], v: &[Complex64]) -> (Complex64, Complex64) {
        let inertia: Complex64 = self.mass.iter().zip(u.iter().zip(v)).map(|(m, (a, b))| a * b * *m).sum();
        let (mut value, mut slope) = (s * s * inertia, s * inertia * 2.0);
        for (e, (z, dz)) in self.z.iter().zip(&self.dz).enumerate() {
            let ab = self.relative(e, u) * self.relative(e, v);
            value += z * ab;
            slope += dz * ab;
        }
        (value, slope)
    }

    /// `Z'(s) u` with the laws at `s` at hand.
    fn slope_times(&self, s: Complex64, u: &[Complex64]) -> Vec<Complex64> {
        let mut out: Vec<Complex64> = self.mass.iter().zip(u).map(|(m, x)| s * x * (2.0 * m)).collect();
        for (e, dz) in self.dz.iter().enumerate() {
            let f = dz * self.relative(e, u);
            let element = &self.bound.elements[e];
            if let Some(d) = element.to {
                out[d] += f;
            }
            if let Some(d) = element.from {
                out[d] -= f;
            }
        }
        out
    }

    /// Undamped modes with the storage stiffness at a frequency of the range, those that may end in it.
    fn starts(&mut self, range: Range) -> Result<Vec<Start>, EngineError> {
        match range {
            Range::Band(low, high) => {
                let all = self.undamped(TAU * 0.5 * (low + high))?;
                Ok(all.into_iter().filter(|s| s.omega >= 0.5 * TAU * low && s.omega <= 2.0 * TAU * high).collect())
            }
            Range::Lowest(count) => {
                // The frequency at which the stiffness is taken comes from a first round.
                let inertia: f64 = self.mass.iter().sum();
                self.laws(Complex64::I)?;
                let stiffness: f64 = self.z.iter().map(|z| z.norm()).sum();
                let guess = if inertia > 0.0 && stiffness > 0.0 { (stiffness / inertia).sqrt() } else { 1.0 };
                let middle = |all: &[Start]| all.iter().take(count).map(|s| s.omega).sum::<f64>() / all.len().min(count).max(1) as f64;
                let first = middle(&self.undamped(guess)?);
                let mut all = self.undamped(if first > 0.0 { first } else { guess })?;
                // Two more than asked for: damping may change the order.
                all.truncate(count + 2);
                Ok(all)
            }
        }
    }

    fn undamped(&mut self, omega: f64) -> Result<Vec<Start>, EngineError> {
        self.laws(Complex64::new(0.0, omega))?;
        let heavy: Vec<usize> = (0..self.mass.len()).filter(|d| self.mass[*d] > 0.0).collect();
        let light: Vec<usize> = (0..self.mass.len()).filter(|d| self.mass[*d] <= 0.0).collect();
        let stiffness = |of: fn(Complex64) -> f64| {
            let mut k = DMatrix::<f64>::zeros(self.mass.len(), self.mass.len());
            for (element, z) in self.bound.elements.iter().zip(&self.z) {
                for (i, si) in [(element.to, 1.0), (element.from, -1.0)] {
                    for (j, sj) in [(element.to, 1.0), (element.from, -1.0)] {
                        if let (Some(i), Some(j)) = (i, j) {
                            k[(i, j)] += si * sj * of(*z);
                        }
                    }
                }
            }
            k
        };
        // Massless degrees of freedom follow the others; where only damping holds one, its modulus does.
        let mut k = stiffness(|z| z.re);
        let mut inner = k.select_rows(&light).select_columns(&light).cholesky();
        if inner.is_none() {
            k = stiffness(|z| z.norm());
            inner = k.select_rows(&light).select_columns(&light).cholesky();
        }
        let Some(inner) = inner else {
            return Err(BlockTriError::Singular { dof: light.first().copied().unwrap_or(0), pivot: 0.0 }.into());
        };
        let coupling = k.select_rows(&light).select_columns(&heavy);
        let follow = if light.is_empty() { DMatrix::zeros(0, heavy.len()) } else { -inner.solve(&coupling) };
        let mut reduced = k.select_rows(&heavy).select_columns(&heavy) + coupling.transpose() * &follow;
        let root: Vec<f64> = heavy.iter().map(|d| self.mass[*d].sqrt()).collect();
        for i in 0..heavy.len() {
            for j in 0..heavy.len() {
                reduced[(i, j)] /= root[i] * root[j];
            }
        }
        reduced = (&reduced + reduced.transpose()) * 0.5;
        let eigen = reduced.symmetric_eigen();
        self.highest = eigen.eigenvalues.iter().fold(0.0f64, |m, e| m.max(*e)).sqrt();
        let mut starts: Vec<Start> = (0..heavy.len())
            .map(|c| {
                let y = DVector::from_iterator(heavy.len(), (0..heavy.len()).map(|i| eigen.eigenvectors[(i, c)] / root[i]));
                let inside = &follow * &y;
                let mut shape = vec![0.0; self.mass.len()];
                heavy.iter().zip(y.iter()).chain(light.iter().zip(inside.iter())).for_each(|(d, x)| shape[*d] = *x);
                Start { omega: eigen.eigenvalues[c].max(0.0).sqrt(), shape }
            })
            .collect();
        starts.sort_by(|a, b| a.omega.total_cmp(&b.omega));
        Ok(starts)
    }

    /// A rigid-body mode, if nothing resists the start's shape.
    fn rigid(&mut self, start: &Start) -> Result<Option<Mode>, EngineError> {
        if start.omega > RIGID * self.highest {
            return Ok(None);
        }
        let shape: Vec<Complex64> = start.shape.iter().map(|x| Complex64::new(*x, 0.0)).collect();
        Ok(Some(Mode { frequency_hz: 0.0, damping: 0.0, lambda: Complex64::ZERO, shape, dlambda: vec![] }))
    }

    fn damped(&mut self, start: &Start, found: &[Mode]) -> Result<Mode, EngineError> {
        let near = |lambda: Complex64, shape: &[Complex64], other: &Mode| {
            let inner = |a: &[Complex64], b: &[Complex64]| a.iter().zip(b).map(|(x, y)| x.conj() * y).sum::<Complex64>();
            let along = inner(shape, &other.shape).norm_sqr() / (inner(shape, shape).re * inner(&other.shape, &other.shape).re);
            (lambda - other.lambda).norm() <= 1e-7 * lambda.norm() && along > 1.0 - 1e-4
        };
        let mut taken: Vec<usize> = Vec::new();
        loop {
            let (lambda, shape) = self.iterate(start, found, &taken)?;
            match found.iter().position(|m| near(lambda, &shape, m)) {
                None => {
                    let damping = -lambda.re / lambda.norm();
                    return Ok(Mode { frequency_hz: lambda.norm() / TAU, damping, lambda, shape, dlambda: vec![] });
                }
                Some(again) if taken.contains(&again) => return Err(EngineError::NoMode { frequency: start.omega / TAU, residual: 0.0 }),
                Some(again) => taken.push(again),
            }
        }
    }

    /// Inverse iteration from a start, with the modes `taken` projected out.
    fn iterate(&mut self, start: &Start, found: &[Mode], taken: &[usize]) -> Result<(Complex64, Vec<Complex64>), EngineError> {
        let mut u: Vec<Complex64> = start.shape.iter().map(|x| Complex64::new(*x, 0.0)).collect();
        let mut s = Complex64::new(0.0, start.omega);
        s = self.functional(s, &u)?;
        let mut change = f64::INFINITY;
        for _ in 0..ITERATIONS {
            self.laws(s)?;
            let mut next = self.slope_times(s, &u);
            if self.factor(s).is_err() {
                // Exactly at the eigenvalue: a shift in the last digits keeps the direction.
                let aside = s * Complex64::new(1.0, 1e-9);
                self.laws(aside)?;
                self.factor(aside)?;
            }
            self.matrix.solve(&mut next)?;
            let largest = next.iter().fold(Complex64::ZERO, |m, x| if x.norm() > m.norm() { *x } else { m });
            if !(largest.norm() > 0.0 && largest.is_finite()) {
                break;
            }
            u = next.iter().map(|x| x / largest).collect();
            for &t in taken {
                // Modes of a nonlinear problem are orthogonal in the divided difference of Z, that at the midpoint to second order.
                let middle = (s + found[t].lambda) * 0.5;
                self.laws(middle)?;
                let share = self.products(middle, &found[t].shape, &u).1 / self.products(middle, &found[t].shape, &found[t].shape).1;
                u.iter_mut().zip(&found[t].shape).for_each(|(x, y)| *x -= share * y);
            }
            let better = self.functional(s, &u)?;
            let last = change;
            change = (better - s).norm() / better.norm();
            s = better;
            if change <= TOLERANCE || (change >= last && change <= ACCEPTED) {
                if s.im < 0.0 {
                    s = s.conj();
                    u.iter_mut().for_each(|x| *x = x.conj());
                }
                self.laws(s)?;
                let scale = (self.products(s, &u, &u).1 / (s * 2.0)).sqrt();
                u.iter_mut().for_each(|x| *x /= scale);
                return Ok((s, u));
            }
        }
        Err(EngineError::NoMode { frequency: start.omega / TAU, residual: change })
    }

    /// The root of `u' Z(s) u = 0` next to `s`.
    fn functional(&mut self, mut s: Complex64, u: &[Complex64]) -> Result<Complex64, EngineError> {
        for _ in 0..20 {
            self.laws(s)?;
            let (value, slope) = self.products(s, u, u);
            let step = value / slope;
            if !step.is_finite() {
                break;
            }
            s -= step;
            if step.norm() <= 1e-15 * s.norm() {
                break;
            }
        }
        Ok(s)
    }

    /// `ds/dp = -phi' (dZ/dp) phi / phi' Z'(s) phi`.
    fn slopes(&mut self, mode: &Mode) -> Result<Vec<Complex64>, EngineError> {
        let mut slopes = vec![Complex64::ZERO; self.bound.n_free];
        if mode.lambda == Complex64::ZERO {
            return Ok(slopes);
        }
        self.laws(mode.lambda)?;
        let weight = self.products(mode.lambda, &mode.shape, &mode.shape).1.inv();
        for (e, element) in self.bound.elements.iter().enumerate().filter(|(_, e)| e.chains.iter().any(|c| !c.is_empty())) {
            element.stiffness(mode.lambda, &mut self.dp)?;
            let x = self.relative(e, &mode.shape);
            for (chain, dp) in element.chains.iter().zip(&self.dp) {
                chain.iter().for_each(|(theta, slope)| slopes[*theta] -= dp * x * x * weight * *slope);
            }
        }
        Ok(slopes)
    }
}

#[cfg(test)]
mod tests;
