//! The linear part of the structure at the harmonics of one line, condensed to the places of the nonlinear elements.

use std::sync::Arc;

use num_complex::Complex64;

use crate::effect::Inputs;
use crate::model::{Bound, Depth, Element, ElementScratch, Model, Sensed};

use super::super::EngineError;
use super::super::blocktri::{BlockTri, BlockTriError, Layout, Levels};

/// How an element enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// Linear, candidates on it included: a complex stiffness at each harmonic.
    Linear,
    /// Linear itself, but candidates of the score test on it are not: marched once the motion is known.
    Candidate,
    /// Nonlinear, number among these.
    Nonlinear(usize),
}

/// What drives the structure, harmonic by harmonic.
#[derive(Clone, Debug, Default)]
pub(super) struct Drive {
    /// General forces at degrees of freedom, `forces[k]` those of harmonic k.
    pub forces: Vec<Vec<(usize, Complex64)>>,
    /// Degrees of freedom that are moved, with their displacement at every harmonic.
    pub held: Vec<(usize, Vec<Complex64>)>,
}

impl Drive {
    /// A harmonic force.
    pub fn force(dof: usize, amplitude: f64) -> Drive {
        Drive { forces: vec![vec![], vec![(dof, Complex64::new(amplitude, 0.0))]], held: vec![] }
    }

    /// Highest harmonic in it.
    pub fn highest(&self) -> usize {
        let moved = self.held.iter().map(|(_, series)| series.len());
        moved.chain([self.forces.len()]).max().unwrap_or(1).saturating_sub(1)
    }

    /// Whether it acts at a harmonic.
    pub fn acts(&self, k: usize) -> bool {
        self.forces.get(k).is_some_and(|f| !f.is_empty())
            || self.held.iter().any(|(_, series)| series.get(k).is_some_and(|u| u.norm() > 0.0))
    }
}

/// Displacements per unit load at one harmonic.
#[derive(Default)]
pub(super) struct Flexibility {
    /// Columns: unit general force at each nonlinear place; length n each.
    pub places: Vec<Complex64>,
    /// Under the drive alone.
    pub drive: Vec<Complex64>,
    /// Columns: unit load at each output (fundamental only).
    pub outputs: Vec<Complex64>,
    /// Complex stiffness that stands in the structure for each nonlinear element.
    pub stand_in: Vec<Complex64>,
}

/// Assembly and solution at the harmonics of a line.
pub(super) struct Structure<'a> {
    pub bound: &'a Bound,
    pub parts: Vec<Part>,
    /// Of each element that is [`Part::Candidate`], which parameters its stiffness says all of, and what is marched for the others.
    pub candidates: Vec<(Vec<bool>, Vec<Element>)>,
    /// Element index of each nonlinear one.
    pub nonlinear: Vec<usize>,
    pub n: usize,
    mass: Vec<f64>,
    slots: Vec<[Option<usize>; 4]>,
    diagonal: Vec<usize>,
    matrix: BlockTri<Complex64>,
    /// Number of the first element with the same law.
    same: Vec<usize>,
    z: Vec<Complex64>,
    /// Slope of each nonlinear element at rest where its law has no small-signal stiffness.
    rest_slope: Vec<f64>,
    /// Which degrees of freedom are moved: their rows say so instead of the equilibrium.
    held: Vec<bool>,
}

/// Ground stiffness against the largest entry of the matrix for a structure whose mean position nothing holds.
const LOOSE: f64 = 1e-7;

impl<'a> Structure<'a> {
    pub fn new(model: &Model, bound: &'a Bound, drive: &Drive) -> Result<Self, EngineError> {
        let n = model.dofs.len();
        let mut held = vec![false; n];
        drive.held.iter().for_each(|(d, _)| held[*d] = true);
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
        let (mut parts, mut nonlinear) = (Vec::new(), Vec::new());
        for (i, e) in bound.elements.iter().enumerate() {
            parts.push(match (e.is_linear_at_every_amplitude(), e.followers_are_linear()) {
                (true, true) => Part::Linear,
                (true, false) => Part::Candidate,
                (false, _) => {
                    nonlinear.push(i);
                    Part::Nonlinear(nonlinear.len() - 1)
                }
            });
        }
        let mut firsts: Vec<usize> = Vec::new();
        let same = (0..bound.elements.len())
            .map(|i| {
                firsts.iter().copied().find(|&j| bound.elements[j].same_law(&bound.elements[i])).unwrap_or_else(|| {
                    firsts.push(i);
                    i
                })
            })
            .collect();
        Ok(Structure {
            rest_slope: nonlinear.iter().map(|&i| rest_slope(&bound.elements[i])).collect(),
            bound,
            candidates: parts
                .iter()
                .zip(&bound.elements)
                .map(|(p, e)| if *p == Part::Candidate { e.candidates() } else { (vec![], vec![]) })
                .collect(),
            parts,
            nonlinear,
            n,
            mass: model.dofs.iter().map(|d| d.mass).collect(),
            slots,
            diagonal: (0..n).map(|d| layout.slot(d, d)).collect::<Result<_, _>>()?,
            matrix: BlockTri::new(layout),
            same,
            z: vec![],
            held,
        })
    }

    /// Relative displacement of an element in a column of all degrees of freedom.
    pub fn relative(&self, element: usize, u: &[Complex64]) -> Complex64 {
        let e = &self.bound.elements[element];
        e.to.map_or(Complex64::ZERO, |d| u[d]) - e.from.map_or(Complex64::ZERO, |d| u[d])
    }

    /// Solves at harmonic `k` of `omega`: nonlinear elements stand in with a linear stiffness of their own, which the caller takes out
    /// of their force again.
    pub fn solve(&mut self, k: usize, omega: f64, drive: &Drive, outputs: &[usize], out: &mut Flexibility) -> Result<(), EngineError> {
        self.factor(k, omega)?;
        out.stand_in.clear();
        out.stand_in.extend(self.nonlinear.iter().map(|&e| self.z[e]));
        let n = self.n;
        out.places.clear();
        out.places.resize(n * self.nonlinear.len(), Complex64::ZERO);
        for (a, &e) in self.nonlinear.iter().enumerate() {
            self.load(e, Complex64::ONE, &mut out.places[a * n..(a + 1) * n]);
        }
        self.matrix.solve(&mut out.places)?;
        out.drive.clear();
        out.drive.resize(n, Complex64::ZERO);
        if drive.acts(k) {
            self.driven(k, drive, &mut out.drive);
            self.matrix.solve(&mut out.drive)?;
        }
        if k == 1 {
            out.outputs.clear();
            out.outputs.resize(n * outputs.len(), Complex64::ZERO);
            outputs.iter().enumerate().for_each(|(o, d)| out.outputs[o * n + d] = Complex64::ONE);
            self.matrix.solve(&mut out.outputs)?;
        }
        Ok(())
    }

    /// Factors the structure at harmonic `k`.
    pub fn factor(&mut self, k: usize, omega: f64) -> Result<(), EngineError> {
        let s = Complex64::new(0.0, k as f64 * omega);
        self.stiffnesses(s, omega)?;
        self.assemble(s, 0.0);
        let line = |e: BlockTriError| match e {
            BlockTriError::Singular { dof, pivot } => BlockTriError::SingularLine { dof, frequency: s.im / std::f64::consts::TAU, pivot },
            other => other,
        };
        match self.matrix.factor() {
            Ok(_) => {}
            Err(BlockTriError::Singular { .. }) if k == 0 => {
                let size = self.z.iter().fold(0.0, |m: f64, z| m.max(z.norm()));
                self.assemble(s, LOOSE * size);
                self.matrix.factor().map_err(line)?;
            }
            Err(e) => return Err(line(e).into()),
        }
        Ok(())
    }

    /// Answers to loads at the degrees of freedom, column after column, by the factors of the last [`Structure::factor`].
    pub fn answer(&mut self, columns: &mut [Complex64]) -> Result<(), EngineError> {
        Ok(self.matrix.solve(columns)?)
    }

    /// Puts a general force of an element's place into a column of loads; what is moved takes none.
    pub fn load(&self, element: usize, force: Complex64, column: &mut [Complex64]) {
        let e = &self.bound.elements[element];
        for (dof, sign) in [(e.to, 1.0), (e.from, -1.0)] {
            if let Some(d) = dof.filter(|d| !self.held[*d]) {
                column[d] += force * sign;
            }
        }
    }

    /// Loads of the drive: forces, what is moved, and what the elements carry over from there.
    fn driven(&self, k: usize, drive: &Drive, column: &mut [Complex64]) {
        for (d, force) in drive.forces.get(k).into_iter().flatten().filter(|(d, _)| !self.held[*d]) {
            column[*d] += force;
        }
        for (held, series) in &drive.held {
            let u = series.get(k).copied().unwrap_or_default();
            for (e, z) in self.bound.elements.iter().zip(&self.z) {
                let across = [(e.to, e.from), (e.from, e.to)].into_iter().find(|(one, _)| *one == Some(*held));
                if let Some((_, Some(other))) = across.filter(|(_, other)| other.is_some_and(|d| !self.held[d])) {
                    column[other] += z * u;
                }
            }
            column[*held] = u;
        }
    }

    /// Complex stiffness of an element at the harmonic of the last [`Structure::factor`].
    pub fn stiffness(&self, element: usize) -> Complex64 {
        self.z[element]
    }

    /// Mass at a degree of freedom.
    pub fn mass(&self, dof: usize) -> f64 {
        self.mass[dof]
    }

    fn stiffnesses(&mut self, s: Complex64, omega: f64) -> Result<(), EngineError> {
        self.z.clear();
        for (i, element) in self.bound.elements.iter().enumerate() {
            let z = if self.same[i] < i {
                self.z[self.same[i]]
            } else if let Part::Nonlinear(a) = self.parts[i] {
                let at = |s: Complex64| element.stiffness_at(s, 0.0, 0.0).ok().filter(|z| z.is_finite() && z.norm() > 0.0);
                // Without a stiffness of its own at rest (a film under a constant load) the fundamental's stands in.
                let z = at(s).or_else(|| at(Complex64::new(0.0, omega)));
                z.map_or(Complex64::new(self.rest_slope[a], 0.0), |z| if s.im == 0.0 { Complex64::new(z.norm(), 0.0) } else { z })
            } else {
                element.stiffness_at(s, 0.0, 0.0)?
            };
            self.z.push(z);
        }
        Ok(())
    }

    fn assemble(&mut self, s: Complex64, ground: f64) {
        self.matrix.clear();
        for (d, slot) in self.diagonal.iter().enumerate() {
            let value = if self.held[d] { Complex64::ONE } else { s * s * self.mass[d] + ground };
            self.matrix.add_at(*slot, value);
        }
        for ((slots, z), e) in self.slots.iter().zip(&self.z).zip(&self.bound.elements) {
            let free = |dof: Option<usize>| dof.is_some_and(|d| !self.held[d]);
            let (to, from) = (free(e.to), free(e.from));
            for ((slot, value), enters) in slots.iter().zip([*z, *z, -*z, -*z]).zip([to, from, to && from, to && from]) {
                if let Some(slot) = slot.filter(|_| enters) {
                    self.matrix.add_at(slot, value);
                }
            }
        }
    }
}

/// Stiffness of a law at rest from its own tangent; velocity-dependent parts are left out.
fn rest_slope(element: &Element) -> f64 {
    let (mut s, mut fs) = (vec![0.0; element.n_states()], vec![0.0; element.n_follower_states()]);
    let mut sensed = Sensed::default();
    element.tangent(&Inputs::default(), 1e-3, &mut s, &mut fs, Depth::Inputs, &mut sensed, &mut ElementScratch::default());
    let d = sensed.inputs(0);
    let slope = (d[0] + d[3]).abs();
    if slope.is_finite() { slope } else { 0.0 }
}
