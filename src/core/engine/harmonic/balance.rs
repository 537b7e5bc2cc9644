//! Newton's method on the balance at the nonlinear places, and what follows from its solution.

use std::sync::Arc;

use faer::linalg::solvers::{PartialPivLu, Solve};
use faer::{MatMut, MatRef};
use nalgebra::{DMatrix, DVector, Dyn, SVD};
use num_complex::Complex64;

use crate::model::{Bound, Model};
use crate::parallel;

use super::super::EngineError;
use super::Settings;
use super::aft::{Aft, PERIODIC};
use super::basis::Basis;
use super::structure::{Drive, Flexibility, Structure};

/// What is accepted where rounding in a stiff law ends the descent earlier.
const ACCEPTED: f64 = 1e-9;
/// What is accepted where neither Newton's method from the line before nor from the linear response descends farther: a play that closes
/// within a sample gives the sampled law a kink wherever it closes on another sample, and a balance may lie on one. Its neighbours are as
/// far from the law as such a residual is.
const ON_A_KINK: f64 = 1e-4;
const ITERATIONS: usize = 60;
/// How near the states of the laws are brought to their periodic values: this part of the residual, and so much at most.
const WITHIN: (f64, f64) = (1e-4, 1e-6);
/// Factor by which a step must bring the residual down for its derivatives to serve once more.
const REUSED: f64 = 0.2;

/// Harmonic balance of one structure under one drive.
pub(super) struct Balance<'a> {
    pub(super) structure: Structure<'a>,
    pub(super) basis: Arc<Basis>,
    pub(super) harmonics: usize,
    pub(super) drive: Drive,
    pub(super) outputs: Vec<usize>,
    pub(super) omega: f64,
    pub(super) flex: Vec<Flexibility>,
    /// `G_k`, element by element.
    g: Vec<Vec<Complex64>>,
    pub(super) aft: Vec<Aft>,
    pub(super) x: DVector<f64>,
    pub(super) residual: DVector<f64>,
    pub(super) matrix: DMatrix<f64>,
    known: bool,
    /// Frequency and solution of the line before the last.
    earlier: Option<(f64, DVector<f64>)>,
    /// How near the states of the laws are brought to their periodic values.
    within: f64,
    /// Change of the displacements, against the largest of their element, at which the balance holds.
    tolerance: f64,
    /// Whether the derivatives of the laws have been taken, at whatever motion.
    derived: bool,
    /// Where Newton's method has ended nearest to a balance under the whole force: frequency, residual, displacements.
    pub(super) nearest: Option<(f64, f64, DVector<f64>)>,
}

impl<'a> Balance<'a> {
    pub fn new(model: &Model, bound: &'a Bound, drive: Drive, outputs: &[usize], settings: Settings) -> Result<Self, EngineError> {
        Balance::of(Structure::new(model, bound, &drive, None)?, drive, outputs, settings)
    }

    /// That of this structure.
    pub fn of(structure: Structure<'a>, drive: Drive, outputs: &[usize], settings: Settings) -> Result<Self, EngineError> {
        let basis = Basis::of(settings.harmonics, settings.samples);
        let size = structure.nonlinear.len() * basis.width;
        Ok(Balance {
            aft: structure.nonlinear.iter().map(|_| Aft::default()).collect(),
            structure,
            basis,
            harmonics: settings.harmonics,
            drive,
            outputs: outputs.to_vec(),
            omega: 0.0,
            flex: (0..=settings.harmonics).map(|_| Flexibility::default()).collect(),
            g: vec![vec![]; settings.harmonics + 1],
            x: DVector::zeros(size),
            residual: DVector::zeros(size),
            matrix: DMatrix::zeros(size, size),
            known: false,
            earlier: None,
            within: PERIODIC,
            tolerance: settings.tolerance,
            derived: false,
            nearest: None,
        })
    }

    /// Coefficients of one element's displacement.
    pub(super) fn width(&self) -> usize {
        self.basis.width
    }

    pub(super) fn m(&self) -> usize {
        self.structure.nonlinear.len()
    }

    /// Condenses the linear part at a frequency.
    pub(super) fn condense(&mut self, omega: f64) -> Result<(), EngineError> {
        let (n, m) = (self.structure.n, self.m());
        self.omega = omega;
        for k in 0..=self.harmonics {
            if m == 0 && !self.structure.moves(k, &self.drive) {
                continue;
            }
            self.structure.solve(k, omega, &self.drive, &self.outputs, &mut self.flex[k])?;
            self.g[k].clear();
            for a in 0..m {
                for b in 0..m {
                    let column = &self.flex[k].places[b * n..(b + 1) * n];
                    self.g[k].push(self.structure.relative(self.structure.nonlinear[a], column));
                }
            }
        }
        Ok(())
    }

    /// Solves the balance at a frequency, starting from where the two lines before lead, else from the line before.
    pub fn line(&mut self, omega: f64) -> Result<(), EngineError> {
        if parallel::given_up() {
            return Err(EngineError::GivenUp);
        }
        let (from, last) = (self.known.then_some(self.omega), self.x.clone());
        self.nearest = None;
        self.condense(omega)?;
        if self.m() == 0 {
            return Ok(());
        }
        let mut residual = f64::INFINITY;
        if let Some(from) = from.filter(|from| *from != omega) {
            let mut found = self.lead(from, omega) && self.newton(1.0, &mut residual);
            if !found {
                self.x.copy_from(&last);
                found = self.newton(1.0, &mut residual);
            }
            if found {
                self.earlier = Some((from, last));
                return Ok(());
            }
            self.earlier = None;
            self.x.copy_from(&last);
            if self.raise_frequency(from, omega, &mut residual)? {
                return Ok(());
            }
            self.condense(omega)?;
        } else if from.is_some() && self.newton(1.0, &mut residual) {
            return Ok(());
        }
        self.linear_start();
        if self.newton(1.0, &mut residual) || self.on_a_kink() || self.raise_force(&mut residual) || self.follow_force(&mut residual) {
            self.known = true;
            return Ok(());
        }
        Err(if parallel::given_up() { EngineError::GivenUp } else { self.failed(residual) })
    }

    /// Goes to where Newton's method has ended nearest to a balance at this frequency; whether that is near enough to be one.
    pub(super) fn on_a_kink(&mut self) -> bool {
        let Some((_, _, x)) = self.nearest.take().filter(|(omega, norm, _)| *omega == self.omega && *norm <= ON_A_KINK) else {
            return false;
        };
        let scales = self.scales(1.0);
        let left = std::mem::replace(&mut self.x, x);
        let found = self.balance(1.0, &scales).is_some();
        if !found {
            self.x = left;
        }
        found
    }

    /// Moves the solution along the straight line through the last two, where the next frequency is not much further than they are apart.
    fn lead(&mut self, from: f64, omega: f64) -> bool {
        let Some((earlier, before)) = &self.earlier else { return false };
        let ahead = (omega - from) / (from - earlier);
        if !(ahead.is_finite() && ahead.abs() <= 2.0) {
            return false;
        }
        self.x *= 1.0 + ahead;
        self.x.axpy(-ahead, before, 1.0);
        true
    }

    /// Solves the balance at a frequency from the response with the stand-in stiffnesses, the drive raised in steps where that is too far.
    pub(super) fn settle(&mut self, omega: f64) -> Result<(), EngineError> {
        self.condense(omega)?;
        if self.m() == 0 {
            return Ok(());
        }
        let mut residual = f64::INFINITY;
        self.linear_start();
        if self.newton(1.0, &mut residual) || self.raise_force(&mut residual) {
            return Ok(());
        }
        Err(self.failed(residual))
    }

    /// Largest coefficient in the last quarter of the harmonics, over the largest of all, of the element where it is largest: what the series leaves out.
    pub(super) fn tail(&self) -> f64 {
        let w = self.basis.width;
        let largest = |part: &[f64]| part.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let whole = largest(self.x.as_slice()).max(f64::MIN_POSITIVE);
        let of = |x: &[f64]| largest(&x[w - w / 4..]) / largest(x).max(1e-3 * whole);
        self.x.as_slice().chunks(w).map(of).fold(0.0, f64::max)
    }

    /// That no balance was found.
    pub(super) fn failed(&self, residual: f64) -> EngineError {
        EngineError::NoHarmonicBalance { frequency: self.omega / std::f64::consts::TAU, amplitude: self.amplitude(), residual }
    }

    /// Largest force of the drive.
    pub(super) fn amplitude(&self) -> f64 {
        self.drive.forces.iter().flatten().map(|(_, f)| f.norm()).fold(0.0, f64::max)
    }

    /// Displacement across a nonlinear element at a harmonic, with the stand-in stiffnesses.
    fn linear(&self, a: usize, k: usize) -> Complex64 {
        self.structure.seen(self.structure.nonlinear[a], k, &self.flex[k].drive)
    }

    /// Response with the stand-in stiffnesses.
    pub(super) fn linear_start(&mut self) {
        self.x.fill(0.0);
        let w = self.basis.width;
        for a in 0..self.m() {
            for k in 0..=self.harmonics {
                let x = self.linear(a, k);
                put(&mut self.x.as_mut_slice()[a * w..(a + 1) * w], k, x);
            }
        }
    }

    /// Newton's method with step control at `share` of the force; `x` holds the start and then the solution.
    pub(super) fn newton(&mut self, share: f64, reached: &mut f64) -> bool {
        let scales = self.scales(share);
        if !self.newton_pass(share, &scales, reached) {
            return false;
        }
        // Where the solution is much smaller than what it started from, its own size is the measure.
        let own = self.scales(share);
        own.iter().zip(&scales).all(|(own, used)| *own > 0.05 * used) || self.newton_pass(share, &own, reached)
    }

    /// Derivatives taken earlier, at the line before or a step before, serve as long as they bring the residual down fast: without
    /// derivatives the laws cost a fraction.
    fn newton_pass(&mut self, share: f64, scales: &[f64], reached: &mut f64) -> bool {
        let Some(mut norm) = self.balance(share, scales) else { return false };
        let mut before = self.x.clone();
        let mut factors = self.derived.then(|| {
            self.assemble();
            Factors::new(&self.matrix)
        });
        for _ in 0..ITERATIONS {
            *reached = norm;
            if norm <= self.tolerance {
                return true;
            }
            before.copy_from(&self.x);
            if let Some(step) = factors.as_ref().and_then(|f| f.solve(&self.residual)) {
                self.x -= step;
                match self.balance(share, scales) {
                    Some(next) if next < norm => {
                        if next > REUSED * norm {
                            factors = None;
                        }
                        norm = next;
                        continue;
                    }
                    _ => {
                        self.x.copy_from(&before);
                        if self.balance(share, scales).is_none() {
                            return false;
                        }
                    }
                }
            }
            let fresh = self.linearize();
            let Some(step) = fresh.solve(&self.residual) else { return false };
            let mut length = 1.0;
            let better = loop {
                self.x.copy_from(&before);
                self.x.axpy(-length, &step, 1.0);
                match self.balance(share, scales) {
                    Some(next) if next < norm => break Some(next),
                    _ if length < 1e-3 => break None,
                    _ => length *= 0.5,
                }
            };
            match better {
                Some(next) => {
                    factors = (next <= REUSED * norm).then_some(fresh);
                    norm = next;
                }
                None => {
                    self.x.copy_from(&before);
                    if share == 1.0 && self.nearest.as_ref().is_none_or(|n| n.0 != self.omega || norm < n.1) {
                        self.nearest = Some((self.omega, norm, before));
                    }
                    // Residual and derivatives belong to the point that stays.
                    return norm <= self.tolerance.max(ACCEPTED) && self.balance(share, scales).is_some();
                }
            }
        }
        norm <= ACCEPTED
    }

    /// Largest displacement coefficient of each element, of the start and of the linear response.
    pub(super) fn scales(&self, share: f64) -> Vec<f64> {
        let w = self.basis.width;
        let own: Vec<f64> = (0..self.m())
            .map(|a| {
                let linear = (0..=self.harmonics).map(|k| self.linear(a, k).norm()).fold(0.0, f64::max) * share;
                (0..w).map(|c| self.x[a * w + c].abs()).fold(0.1 * linear, f64::max)
            })
            .collect();
        let largest = own.iter().copied().fold(0.0, f64::max);
        own.iter().map(|s| s.max(1e-6 * largest).max(f64::MIN_POSITIVE)).collect()
    }

    /// Evaluates the laws and the residual `x - x_lin + G (f - z x)` at `x`; its size against the scales, `None` where a law gives up. The states of
    /// the laws are brought as near to their periodic values as the last residual asks for, and nearer where this one is small.
    pub(super) fn balance(&mut self, share: f64, scales: &[f64]) -> Option<f64> {
        let mut norm = self.balance_within(share, scales)?;
        let remembers = self.structure.nonlinear.iter().any(|e| self.structure.bound.elements[*e].n_states() > 0);
        if remembers && self.within > PERIODIC && norm < 10.0 * self.within {
            self.within = PERIODIC;
            norm = self.balance_within(share, scales)?;
        }
        self.within = (WITHIN.0 * norm).clamp(PERIODIC, WITHIN.1);
        Some(norm)
    }

    fn balance_within(&mut self, share: f64, scales: &[f64]) -> Option<f64> {
        let (w, m) = (self.basis.width, self.m());
        for a in 0..m {
            let element = &self.structure.bound.elements[self.structure.nonlinear[a]];
            self.aft[a].evaluate(element, &self.basis, self.omega, &self.x.as_slice()[a * w..(a + 1) * w], self.within).ok()?;
        }
        self.residual.copy_from(&self.x);
        for a in 0..m {
            for k in 0..=self.harmonics {
                let linear = self.linear(a, k) * share;
                put(&mut self.residual.as_mut_slice()[a * w..(a + 1) * w], k, -linear);
                let sum: Complex64 = (0..m).map(|b| self.g[k][a * m + b] * self.out_of_line(b, k)).sum();
                put(&mut self.residual.as_mut_slice()[a * w..(a + 1) * w], k, sum);
            }
        }
        let norm = (0..m * w).map(|i| self.residual[i].abs() / scales[i / w]).fold(0.0, f64::max);
        (norm.is_finite() && self.residual.iter().all(|r| r.is_finite())).then_some(norm)
    }

    /// Force of a nonlinear element beyond its stand-in at a harmonic.
    pub(super) fn out_of_line(&self, a: usize, k: usize) -> Complex64 {
        let w = self.basis.width;
        take(&self.aft[a].f, k) - self.flex[k].stand_in[a] * take(&self.x.as_slice()[a * w..(a + 1) * w], k)
    }

    /// Jacobian of the residual at the motion last evaluated, ready to solve with.
    pub(super) fn linearize(&mut self) -> Factors {
        for (a, aft) in self.aft.iter_mut().enumerate() {
            let element = &self.structure.bound.elements[self.structure.nonlinear[a]];
            aft.differentiate(element, &self.basis, self.omega);
        }
        self.derived = true;
        self.assemble();
        Factors::new(&self.matrix)
    }

    /// Jacobian of the residual, `I + G (df/dx - z)`, with the derivatives of the laws as they were last taken.
    fn assemble(&mut self) {
        let (w, m) = (self.basis.width, self.m());
        self.matrix.fill_with_identity();
        for b in 0..m {
            for c in 0..w {
                for k in 0..=self.harmonics {
                    let df = self.force_slope(b, k, c);
                    for a in 0..m {
                        let d = self.g[k][a * m + b] * df;
                        let row = a * w;
                        if k == 0 {
                            self.matrix[(row, b * w + c)] += d.re;
                        } else {
                            self.matrix[(row + 2 * k - 1, b * w + c)] += d.re;
                            self.matrix[(row + 2 * k, b * w + c)] -= d.im;
                        }
                    }
                }
            }
        }
    }

    /// Derivative of [`Balance::out_of_line`] with respect to displacement coefficient `c` of its own element.
    pub(super) fn force_slope(&self, a: usize, k: usize, c: usize) -> Complex64 {
        let (w, j) = (self.basis.width, &self.aft[a].jacobian);
        let df = match k {
            0 => Complex64::new(j[c], 0.0),
            k => Complex64::new(j[(2 * k - 1) * w + c], -j[2 * k * w + c]),
        };
        if c.div_ceil(2) != k {
            return df;
        }
        let unit = if c > 0 && c.is_multiple_of(2) { -Complex64::I } else { Complex64::ONE };
        df - self.flex[k].stand_in[a] * unit
    }

    /// Appends `H` at the outputs.
    pub fn response(&self, h: &mut Vec<Complex64>) {
        let (n, force) = (self.structure.n, self.amplitude());
        for (o, &dof) in self.outputs.iter().enumerate() {
            let by_load = &self.flex[1].outputs[o * n..(o + 1) * n];
            let elements: Complex64 =
                (0..self.m()).map(|a| self.structure.relative(self.structure.nonlinear[a], by_load) * self.out_of_line(a, 1)).sum();
            h.push((self.flex[1].drive[dof] - elements) / force);
        }
    }

    /// Displacements of all degrees of freedom at a harmonic.
    pub(super) fn motion(&self, k: usize) -> Vec<Complex64> {
        let n = self.structure.n;
        let mut q = self.flex[k].drive.clone();
        q.resize(n, Complex64::ZERO);
        for a in 0..self.m() {
            let f = self.out_of_line(a, k);
            q.iter_mut().zip(&self.flex[k].places[a * n..(a + 1) * n]).for_each(|(q, u)| *q -= u * f);
        }
        q
    }

    /// Harmonics in which the structure moves.
    pub(super) fn moving(&self) -> Vec<usize> {
        (0..=self.harmonics).filter(|k| self.m() > 0 || self.structure.moves(*k, &self.drive)).collect()
    }
}

/// Coefficient `k` of a series as the complex amplitude of `Re(X e^{ikwt})`.
pub(super) fn take(series: &[f64], k: usize) -> Complex64 {
    if k == 0 { Complex64::new(series[0], 0.0) } else { Complex64::new(series[2 * k - 1], -series[2 * k]) }
}

/// Adds a complex amplitude to a series.
pub(super) fn put(series: &mut [f64], k: usize, x: Complex64) {
    if k == 0 {
        series[0] += x.re;
    } else {
        series[2 * k - 1] += x.re;
        series[2 * k] -= x.im;
    }
}

/// A matrix ready to solve with; directions that nothing determines (the mean position of a body that only slides) stay as they are.
pub(super) enum Factors {
    Regular(PartialPivLu<f64>),
    Singular(Box<SVD<f64, Dyn, Dyn>>),
}

impl Factors {
    fn new(matrix: &DMatrix<f64>) -> Self {
        let n = matrix.nrows();
        let lu = MatRef::from_column_major_slice(matrix.as_slice(), n, n).partial_piv_lu();
        let pivots = lu.U().diagonal().column_vector();
        let (largest, smallest) = pivots.iter().fold((0.0f64, f64::INFINITY), |(l, s), p| (l.max(p.abs()), s.min(p.abs())));
        match smallest > 1e-12 * largest {
            true => Factors::Regular(lu),
            false => Factors::Singular(Box::new(SVD::new(matrix.clone(), true, true))),
        }
    }

    pub(super) fn solve(&self, rhs: &DVector<f64>) -> Option<DVector<f64>> {
        let columns = DMatrix::from_column_slice(rhs.len(), 1, rhs.as_slice());
        let step = self.columns(&columns).column(0).into_owned();
        step.iter().all(|s| s.is_finite()).then_some(step)
    }

    pub(super) fn columns(&self, rhs: &DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Factors::Regular(lu) => {
                let mut found = rhs.clone();
                let (rows, columns) = found.shape();
                lu.solve_in_place(MatMut::from_column_major_slice_mut(found.as_mut_slice(), rows, columns));
                found
            }
            Factors::Singular(svd) => {
                let found = svd.solve(rhs, 1e-11 * svd.singular_values.max());
                found.unwrap_or_else(|_| DMatrix::from_element(rhs.nrows(), rhs.ncols(), f64::NAN))
            }
        }
    }
}
