//! Undamped modes, where the search for the damped ones starts.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::model::{Bound, Model};

use super::super::EngineError;
use super::super::blocktri::BlockTriError;
use super::lowest::{Entry, NOTHING, Pencil};
use super::{Problem, RIGID, Range, Start, modes};

/// Part of a frequency at which laws are as they are at rest.
const SLOW: f64 = 1e-4;
/// Degrees of freedom up to which all modes are computed at once, from full matrices (a third of a second at 300, and 27 times as long at three times as many).
const FULL: usize = 300;
/// Modes in one band of a model that is larger than that, at most: each takes a few solutions of the whole model.
const MOST: usize = 500;

/// Number of modes with a frequency between `low` and `high` [Hz]; of a model with more than 300 degrees of freedom the undamped ones, with the storage stiffness
/// at either end, which takes a time that is linear in its parts.
///
/// # Errors
/// As [`modes`].
pub fn count(model: &Model, bound: &Bound, low: f64, high: f64) -> Result<usize, EngineError> {
    if model.dofs.len() <= FULL {
        return modes(model, bound, Range::Band(low, high), false).map(|found| found.len());
    }
    let mut problem = Problem::new(model, bound, false)?;
    let mut below = |f: f64| {
        let omega = TAU * f.max(SLOW * high);
        problem.pencil(omega)?.below(omega * omega)
    };
    let (up_to, before) = (below(high)?, below(low)?);
    Ok(up_to.saturating_sub(before))
}

/// What undamped modes are made of beside mass and geometric stiffness.
struct Undamped {
    omega: f64,
    mass: Vec<Entry>,
    /// Mass at the row of each element.
    inertia: Vec<f64>,
}

/// Undamped modes that are wanted: circular frequencies from the first to the second, or at least so many of the lowest.
#[derive(Clone, Copy)]
enum Wanted {
    Between(f64, f64),
    Lowest(usize),
}

impl Problem<'_> {
    /// Undamped modes with the storage stiffness at a frequency of the range, those that may end in it, in the order of their frequencies.
    pub(super) fn starts(&mut self, range: Range) -> Result<Vec<Start>, EngineError> {
        let count = match range {
            Range::Band(low, high) => {
                return self.undamped(TAU * 0.5 * (low + high), Wanted::Between(0.5 * TAU * low, 2.0 * TAU * high));
            }
            Range::Lowest(count) => count,
        };
        // The frequency at which the stiffness is taken comes from a first round.
        let inertia: f64 = self.small.mass.iter().filter(|m| m.0 == m.1).map(|m| m.2).sum();
        self.laws(Complex64::I)?;
        let stiffness: f64 = self.z.iter().map(|z| z.norm()).sum();
        let guess = if inertia > 0.0 && stiffness > 0.0 { (stiffness / inertia).sqrt() } else { 1.0 };
        let middle = |all: &[Start]| all.iter().take(count).map(|s| s.omega).sum::<f64>() / all.len().min(count).max(1) as f64;
        let first = middle(&self.undamped(guess, Wanted::Lowest(count))?);
        self.reference = if first > 0.0 { first } else { guess };
        self.lowest(count + 2)
    }

    /// At least `count` of the lowest undamped modes, or all, with the stiffness at the frequency that was taken first.
    pub(super) fn lowest(&mut self, count: usize) -> Result<Vec<Start>, EngineError> {
        let starts = self.undamped(self.reference, Wanted::Lowest(count))?;
        self.more = self.small.n > FULL && starts.len() >= count;
        Ok(starts)
    }

    fn undamped(&mut self, omega: f64, wanted: Wanted) -> Result<Vec<Start>, EngineError> {
        if self.small.n > FULL {
            return self.some(omega, wanted);
        }
        let mut all = self.all(omega)?;
        if let Wanted::Between(low, high) = wanted {
            all.retain(|s| s.omega >= low && s.omega <= high);
        }
        Ok(all)
    }

    /// Laws at a frequency, and the mass that they are.
    fn prepared(&mut self, omega: f64) -> Result<Undamped, EngineError> {
        self.laws(Complex64::new(0.0, SLOW * omega))?;
        let slow: Vec<f64> = self.z.iter().map(|z| z.re).collect();
        self.laws(Complex64::new(0.0, omega))?;
        // Laws that are inertial count as mass, and so does what an absorber is softer by than at rest: in their dynamic stiffness they would be
        // negative springs.
        let mut inertia: Vec<f64> = self.small.bound.elements.iter().map(|e| e.inertia()).collect();
        for ((m, z), slow) in inertia.iter_mut().zip(&self.z).zip(&slow) {
            *m += ((slow - (z.re + omega * omega * *m)) / (omega * omega)).max(0.0);
        }
        let mut mass = self.small.mass.clone();
        for (row, m) in self.small.rows.iter().zip(&inertia).filter(|(_, m)| **m != 0.0) {
            row.iter().for_each(|(i, bi)| mass.extend(row.iter().map(|(j, bj)| (*i, *j, m * bi * bj))));
        }
        Ok(Undamped { omega, mass, inertia })
    }

    /// Stiffness with this part of the elements' dynamic stiffness.
    fn stiffness(&self, undamped: &Undamped, of: fn(Complex64) -> f64) -> Vec<Entry> {
        let mut k = self.small.stiffness.clone();
        for ((row, z), m) in self.small.rows.iter().zip(&self.z).zip(&undamped.inertia) {
            let z = of(z + undamped.omega * undamped.omega * m);
            row.iter().for_each(|(i, bi)| k.extend(row.iter().map(|(j, bj)| (*i, *j, bi * bj * z))));
        }
        k
    }

    /// The undamped structure of a large model.
    fn pencil(&mut self, omega: f64) -> Result<Pencil, EngineError> {
        let undamped = self.prepared(omega)?;
        let layout = self.matrix.layout().clone();
        let mut pencil = Pencil::new(self.stiffness(&undamped, |z| z.re), undamped.mass.clone(), layout.clone());
        // Massless degrees of freedom follow the others; where only damping holds one, its modulus does.
        if !pencil.follows()? {
            pencil = Pencil::new(self.stiffness(&undamped, |z| z.norm()), undamped.mass, layout);
            if !pencil.follows()? {
                return Err(BlockTriError::Singular { dof: pencil.light().unwrap_or(0), pivot: 0.0 }.into());
            }
        }
        Ok(pencil)
    }

    /// Those that are wanted, of a large model.
    fn some(&mut self, omega: f64, wanted: Wanted) -> Result<Vec<Start>, EngineError> {
        let pencil = self.pencil(omega)?;
        let all = pencil.heavy();
        let highest = pencil.highest(all)?;
        self.highest = highest.sqrt();
        if let Some(shape) = pencil.unstable(-NOTHING * highest)? {
            let dof = shape.iter().enumerate().fold((0, 0.0), |m, (d, x)| if x.abs() > m.1 { (d, x.abs()) } else { m }).0;
            return Err(EngineError::Unstable { step: 1, steps: 1, dof: self.small.name(dof) });
        }
        match wanted {
            Wanted::Lowest(count) => pencil.lowest(count, all, highest),
            Wanted::Between(low, high) => {
                let (low, high) = (if low > 0.0 { low * low } else { -NOTHING * highest }, (high * high).min(1.1 * highest));
                let there = pencil.below(high)?.saturating_sub(pencil.below(low)?);
                if there > MOST {
                    return Err(EngineError::Request {
                        what: "the number of modes in the band",
                        value: there.to_string(),
                        accepted: format!("at most {MOST} in a model of more than {FULL} degrees of freedom"),
                    });
                }
                pencil.between(low, high)
            }
        }
    }

    /// All of them, of a small model.
    fn all(&mut self, omega: f64) -> Result<Vec<Start>, EngineError> {
        let undamped = self.prepared(omega)?;
        let n = self.small.n;
        let dense = |entries: &[Entry]| {
            let mut m = DMatrix::<f64>::zeros(n, n);
            entries.iter().for_each(|(i, j, x)| m[(*i, *j)] += x);
            m
        };
        let mass = dense(&undamped.mass);
        let heavy: Vec<usize> = (0..n).filter(|d| mass[(*d, *d)] > 0.0).collect();
        let light: Vec<usize> = (0..n).filter(|d| mass[(*d, *d)] <= 0.0).collect();
        // Massless degrees of freedom follow the others; where only damping holds one, its modulus does.
        let mut k = dense(&self.stiffness(&undamped, |z| z.re));
        let mut inner = k.select_rows(&light).select_columns(&light).cholesky();
        if inner.is_none() {
            k = dense(&self.stiffness(&undamped, |z| z.norm()));
            inner = k.select_rows(&light).select_columns(&light).cholesky();
        }
        let Some(inner) = inner else {
            return Err(BlockTriError::Singular { dof: light.first().copied().unwrap_or(0), pivot: 0.0 }.into());
        };
        let coupling = k.select_rows(&light).select_columns(&heavy);
        let follow = if light.is_empty() { DMatrix::zeros(0, heavy.len()) } else { -inner.solve(&coupling) };
        let mut reduced = k.select_rows(&heavy).select_columns(&heavy) + coupling.transpose() * &follow;
        // With the mass as L L', the shapes are L'^-1 times the eigenvectors of L^-1 K L'^-1.
        let Some(root) = mass.select_rows(&heavy).select_columns(&heavy).cholesky() else {
            return Err(BlockTriError::Singular { dof: heavy.first().copied().unwrap_or(0), pivot: 0.0 }.into());
        };
        let root = root.l();
        let solved = |m: &DMatrix<f64>| root.solve_lower_triangular(m).unwrap_or_else(|| m.clone());
        reduced = solved(&solved(&reduced).transpose());
        reduced = (&reduced + reduced.transpose()) * 0.5;
        let eigen = reduced.symmetric_eigen();
        self.highest = eigen.eigenvalues.iter().fold(0.0f64, |m, e| m.max(*e)).sqrt();
        let least = eigen.eigenvalues.iter().copied().enumerate().fold((0, 0.0f64), |m, (k, e)| if e < m.1 { (k, e) } else { m });
        if -least.1 > (RIGID * self.highest).powi(2).max(1e-12 * self.highest * self.highest) {
            let shape = eigen.eigenvectors.column(least.0);
            return Err(EngineError::Unstable { step: 1, steps: 1, dof: self.small.name(heavy[shape.iamax()]) });
        }
        let shapes = root.transpose().solve_upper_triangular(&eigen.eigenvectors).unwrap_or_else(|| eigen.eigenvectors.clone());
        let mut starts: Vec<Start> = (0..heavy.len())
            .map(|c| {
                let y: DVector<f64> = shapes.column(c).into_owned();
                let inside = &follow * &y;
                let mut shape = vec![0.0; n];
                heavy.iter().zip(y.iter()).chain(light.iter().zip(inside.iter())).for_each(|(d, x)| shape[*d] = *x);
                Start { omega: eigen.eigenvalues[c].max(0.0).sqrt(), shape }
            })
            .collect();
        starts.sort_by(|a, b| a.omega.total_cmp(&b.omega));
        Ok(starts)
    }
}
