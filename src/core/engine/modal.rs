//! Damped modes: the nonlinear eigenproblem `Z(s) phi = 0` of small motion about the operating point, with the system of
//! `engine::small` (friction stuck). Frequency-dependent laws are taken as they are.
//!
//! Every mode starts from one of the undamped structure with the storage stiffness at a frequency of the range. Inverse iteration with
//! the symmetric Rayleigh functional `phi' Z(s) phi = 0` (Schwetlick and Schreiber, Linear Algebra Appl. 436, 2012; cubic for symmetric
//! problems) finds the damped one by block-tridiagonal solves. A start that falls onto a mode found before is taken up again with that
//! mode projected out.

mod form;
mod lowest;
mod mode;
mod shares;
mod undamped;

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex64;

use crate::model::{Bound, Model};
use crate::parallel;

use super::EngineError;
use super::blocktri::{BlockTri, BlockTriError, Layout, Levels};
use super::small::Small;

use form::{Form, alike};

pub use mode::Mode;
pub use shares::{Shares, shares};
pub use undamped::count;

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
    match range {
        Range::Band(low, high) if !(low >= 0.0 && high > low && high.is_finite()) => Err(EngineError::Request {
            what: "the frequency band of the modes",
            value: format!("{low} to {high} Hz"),
            accepted: "0 <= lower end < upper end".into(),
        }),
        Range::Band(low, high) => {
            let mut modes = Modes::new(model, bound, range, sensitivities)?;
            modes.try_starts(usize::MAX)?;
            modes.found.retain(|m| m.frequency_hz >= low && m.frequency_hz <= high);
            modes.first(usize::MAX)
        }
        Range::Lowest(count) => Modes::new(model, bound, range, sensitivities)?.lowest(count),
    }
}

/// The modes of a model, found as far as they are asked for.
pub struct Modes<'a> {
    problem: Problem<'a>,
    starts: Vec<Start>,
    /// How many starts were tried.
    tried: usize,
    found: Vec<Mode>,
    sensitivities: bool,
}

impl<'a> Modes<'a> {
    /// Those of a range, none found yet. `Range::Lowest(n)`: stiffness that follows the frequency is taken for the starts as it is at the lowest n.
    ///
    /// # Errors
    /// As [`modes`].
    pub fn new(model: &Model, bound: &'a Bound, range: Range, sensitivities: bool) -> Result<Self, EngineError> {
        let mut problem = Problem::new(model, bound, sensitivities)?;
        // Without mass nothing vibrates.
        let still = problem.small.mass.iter().all(|m| m.2 == 0.0);
        let starts = if still { vec![] } else { problem.starts(range)? };
        Ok(Modes { problem, starts, tried: 0, found: vec![], sensitivities })
    }

    /// The lowest `count`, or all where there are fewer, in the order of their frequencies. What was found before is not looked for again.
    ///
    /// # Errors
    /// As [`modes`].
    pub fn lowest(&mut self, count: usize) -> Result<Vec<Mode>, EngineError> {
        // Two more than asked for: damping may change the order.
        self.try_starts(count.saturating_add(2))?;
        self.first(count)
    }

    fn try_starts(&mut self, count: usize) -> Result<(), EngineError> {
        while self.tried < count {
            if parallel::given_up() {
                return Err(EngineError::GivenUp);
            }
            if self.tried == self.starts.len() && self.problem.more {
                self.starts = self.problem.lowest(count.max(2 * self.tried))?;
            }
            let Some(start) = self.starts.get(self.tried) else { break };
            self.tried += 1;
            let mode = match self.problem.rigid(start)? {
                Some(mode) => Some(mode),
                None => match self.problem.damped(start, &self.found) {
                    // A motion beyond its critical damping has two real poles, to which other starts may lead as well.
                    Err(EngineError::NoMode { .. }) if self.found.iter().any(Mode::creeps) || self.problem.creeps(start)? => None,
                    mode => Some(mode?),
                },
            };
            self.found.extend(mode);
        }
        self.found.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        Ok(())
    }

    fn first(&mut self, count: usize) -> Result<Vec<Mode>, EngineError> {
        let count = count.min(self.found.len());
        for mode in self.found[..count].iter_mut().filter(|m| self.sensitivities && m.dlambda.is_empty()) {
            mode.dlambda = self.problem.slopes(mode)?;
        }
        Ok(self.found[..count].to_vec())
    }
}

/// Undamped mode to start from.
struct Start {
    omega: f64,
    shape: Vec<f64>,
}

struct Problem<'a> {
    small: Small<'a>,
    /// Slots of the block of each relative displacement that elements act at, and of each entry of mass and geometric stiffness.
    slots: Vec<Vec<(usize, f64)>>,
    /// Which of these displacements is each element's: a spring and a damper at one joint add up before they go into the matrix.
    acts_at: Vec<usize>,
    mass_slots: Vec<usize>,
    stiffness_slots: Vec<usize>,
    matrix: BlockTri<Complex64>,
    z: Vec<Complex64>,
    dz: Vec<Complex64>,
    dp: Vec<Complex64>,
    /// Stiffnesses of the elements of each displacement together.
    sums: Vec<Complex64>,
    /// Largest undamped circular frequency.
    highest: f64,
    /// What the undamped modes that were found last are made of, where all were.
    of: Option<undamped::Undamped>,
    /// Circular frequency at which the stiffness of the lowest undamped modes is taken.
    reference: f64,
    /// Whether there may be undamped modes above those that were found.
    more: bool,
}

const ITERATIONS: usize = 60;
/// Shifts off an eigenvalue at which the system is singular to rounding.
const SHIFTS: [f64; 4] = [1e-9, 1e-7, 1e-5, 1e-3];
/// Change of the eigenvalue, against its size, at which it stands.
const TOLERANCE: f64 = 1e-13;
/// What is accepted where rounding ends the iteration earlier.
const ACCEPTED: f64 = 1e-10;
/// Undamped frequencies at or below this part of the highest are those of rigid bodies.
const RIGID: f64 = 3e-7;

impl<'a> Problem<'a> {
    fn new(model: &Model, bound: &'a Bound, sensitivities: bool) -> Result<Self, EngineError> {
        let small = Small::new(model, bound, sensitivities)?;
        let layout = Arc::new(Layout::new(Levels::new(small.n, &small.pairs())?));
        let (acts_at, first) = alike(&small.rows);
        let mut slots = Vec::with_capacity(first.len());
        for row in first.iter().map(|e| &small.rows[*e]) {
            let mut block = Vec::with_capacity(row.len() * row.len());
            for (i, bi) in row {
                for (j, bj) in row {
                    block.push((layout.slot(*i, *j)?, bi * bj));
                }
            }
            slots.push(block);
        }
        let of = |m: &[(usize, usize, f64)]| m.iter().map(|e| layout.slot(e.0, e.1)).collect::<Result<Vec<_>, _>>();
        Ok(Problem {
            slots,
            acts_at,
            sums: vec![],
            mass_slots: of(&small.mass)?,
            stiffness_slots: of(&small.stiffness)?,
            matrix: BlockTri::new(layout),
            small,
            z: vec![],
            dz: vec![],
            dp: vec![],
            highest: 0.0,
            of: None,
            reference: 0.0,
            more: false,
        })
    }

    /// Stiffnesses of all elements at `s` and their derivatives.
    fn laws(&mut self, s: Complex64) -> Result<(), EngineError> {
        self.z.clear();
        self.dz.clear();
        for i in 0..self.acts_at.len() {
            let first = self.small.same[i];
            let (z, dz) = if first < i {
                (self.z[first], self.dz[first])
            } else {
                let (z, dz, _) = self.small.law(i, s, &mut self.dp)?;
                (z, dz)
            };
            self.z.push(z);
            self.dz.push(dz);
        }
        Ok(())
    }

    fn factor(&mut self, s: Complex64) -> Result<(), BlockTriError> {
        self.matrix.clear();
        for (slot, m) in self.mass_slots.iter().zip(&self.small.mass) {
            self.matrix.add_at(*slot, s * s * m.2);
        }
        for (slot, k) in self.stiffness_slots.iter().zip(&self.small.stiffness) {
            self.matrix.add_at(*slot, Complex64::from(k.2));
        }
        self.sums.clear();
        self.sums.resize(self.slots.len(), Complex64::ZERO);
        self.acts_at.iter().zip(&self.z).for_each(|(at, z)| self.sums[*at] += z);
        for (block, z) in self.slots.iter().zip(&self.sums) {
            for (slot, b) in block {
                self.matrix.add_at(*slot, *z * *b);
            }
        }
        self.matrix.factor().map(|_| ())
    }

    /// `Z'(s) u` with the laws at `s` at hand.
    fn slope_times(&self, s: Complex64, u: &[Complex64]) -> Vec<Complex64> {
        let mut out = vec![Complex64::ZERO; self.small.n];
        for (i, j, m) in &self.small.mass {
            out[*i] += s * u[*j] * (2.0 * m);
        }
        for (e, dz) in self.dz.iter().enumerate().filter(|(_, dz)| **dz != Complex64::ZERO) {
            let f = dz * self.small.relative(e, u);
            self.small.rows[e].iter().for_each(|(d, b)| out[*d] += f * *b);
        }
        out
    }

    /// A rigid-body mode, if nothing resists the start's shape.
    fn rigid(&mut self, start: &Start) -> Result<Option<Mode>, EngineError> {
        if start.omega > RIGID * self.highest {
            return Ok(None);
        }
        let shape: Vec<Complex64> = start.shape.iter().map(|x| Complex64::new(*x, 0.0)).collect();
        Ok(Some(Mode { frequency_hz: 0.0, damping: 0.0, lambda: Complex64::ZERO, shape, dlambda: vec![] }))
    }

    /// Whether the losses of a start's shape (`phi' M phi = 1`) at its frequency are those of critical damping or more.
    fn creeps(&mut self, start: &Start) -> Result<bool, EngineError> {
        let (shape, s): (Vec<Complex64>, _) = (start.shape.iter().map(|x| Complex64::from(*x)).collect(), Complex64::new(0.0, start.omega));
        self.laws(s)?;
        Ok(self.at(s, &self.form(&shape, &shape)).0.im >= 2.0 * start.omega * start.omega)
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
        let own: Vec<Form> = taken.iter().map(|t| self.form(&found[*t].shape, &found[*t].shape)).collect();
        let mut change = f64::INFINITY;
        for _ in 0..ITERATIONS {
            self.laws(s)?;
            let mut next = self.slope_times(s, &u);
            if self.factor(s).is_err() {
                // Exactly at the eigenvalue: a small shift keeps the direction. Next to stiff links a shift in the last digits drowns.
                for (k, shift) in SHIFTS.iter().enumerate() {
                    let aside = s * Complex64::new(1.0, *shift);
                    self.laws(aside)?;
                    match self.factor(aside) {
                        Err(e) if k + 1 == SHIFTS.len() => return Err(e.into()),
                        Err(_) => {}
                        Ok(()) => break,
                    }
                }
            }
            self.matrix.solve(&mut next)?;
            let largest = next.iter().fold(Complex64::ZERO, |m, x| if x.norm() > m.norm() { *x } else { m });
            if !(largest.norm() > 0.0 && largest.is_finite()) {
                break;
            }
            u = next.iter().map(|x| x / largest).collect();
            for (&t, own) in taken.iter().zip(&own) {
                // Modes of a nonlinear problem are orthogonal in the divided difference of Z, that at the midpoint to second order.
                let middle = (s + found[t].lambda) * 0.5;
                self.laws(middle)?;
                let share = self.at(middle, &self.form(&found[t].shape, &u)).1 / self.at(middle, own).1;
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
                let scale = (self.at(s, &self.form(&u, &u)).1 / (s * 2.0)).sqrt();
                u.iter_mut().for_each(|x| *x /= scale);
                return Ok((s, u));
            }
        }
        Err(EngineError::NoMode { frequency: start.omega / TAU, residual: change })
    }

    /// The root of `u' Z(s) u = 0` next to `s`.
    fn functional(&mut self, mut s: Complex64, u: &[Complex64]) -> Result<Complex64, EngineError> {
        let form = self.form(u, u);
        for _ in 0..20 {
            self.laws(s)?;
            let (value, slope) = self.at(s, &form);
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
        let bound = self.small.bound;
        let mut slopes = vec![Complex64::ZERO; bound.n_free];
        if mode.lambda == Complex64::ZERO {
            return Ok(slopes);
        }
        self.laws(mode.lambda)?;
        let weight = -self.at(mode.lambda, &self.form(&mode.shape, &mode.shape)).1.inv();
        // Elements of one law do their part together.
        let mut square = vec![Complex64::ZERO; bound.elements.len()];
        for (e, first) in self.small.same.iter().enumerate() {
            square[*first] += self.small.relative(e, &mode.shape).powi(2);
        }
        let depends = |e: usize| bound.elements[e].chains.iter().any(|c| !c.is_empty());
        for e in (0..square.len()).filter(|e| self.small.same[*e] == *e && depends(*e)) {
            self.small.law(e, mode.lambda, &mut self.dp)?;
            for (chain, dp) in bound.elements[e].chains.iter().zip(&self.dp) {
                chain.iter().for_each(|(theta, slope)| slopes[*theta] += dp * square[e] * *slope);
            }
        }
        if self.small.moves() {
            let laws = self.small.laws(mode.lambda)?;
            self.small.add_moved(mode.lambda, |e| laws[e], &mode.shape, &mode.shape, &mut slopes);
        }
        slopes.iter_mut().for_each(|d| *d *= weight);
        Ok(slopes)
    }
}

#[cfg(test)]
mod tests;
