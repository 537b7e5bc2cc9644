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

/// Displacements per unit load at one harmonic.
#[derive(Default)]
pub(super) struct Flexibility {
    /// Columns: unit general force at each nonlinear place; length n each.
    pub places: Vec<Complex64>,
    /// Under the drive alone (fundamental only).
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
    dp: Vec<Complex64>,
    /// Slope of each nonlinear element at rest where its law has no small-signal stiffness.
    rest_slope: Vec<f64>,
}

/// Ground stiffness against the largest entry of the matrix for a structure whose mean position nothing holds.
const LOOSE: f64 = 1e-7;

impl<'a> Structure<'a> {
    pub fn new(model: &Model, bound: &'a Bound) -> Result<Self, EngineError> {
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
            parts,
            nonlinear,
            n,
            mass: model.dofs.iter().map(|d| d.mass).collect(),
            slots,
            diagonal: (0..n).map(|d| layout.slot(d, d)).collect::<Result<_, _>>()?,
            matrix: BlockTri::new(layout),
            same,
            z: vec![],
            dp: vec![],
        })
    }

    /// Relative displacement of an element in a column of all degrees of freedom.
    pub fn relative(&self, element: usize, u: &[Complex64]) -> Complex64 {
        let e = &self.bound.elements[element];
        e.to.map_or(Complex64::ZERO, |d| u[d]) - e.from.map_or(Complex64::ZERO, |d| u[d])
    }

    /// Solves at harmonic `k` of `omega`: nonlinear elements stand in with a linear stiffness of their own, which the caller takes out
    /// of their force again.
    pub fn solve(
        &mut self,
        k: usize,
        omega: f64,
        drive: (usize, f64),
        outputs: &[usize],
        out: &mut Flexibility,
    ) -> Result<(), EngineError> {
        let s = Complex64::new(0.0, k as f64 * omega);
        self.stiffnesses(s, omega)?;
        out.stand_in.clear();
        out.stand_in.extend(self.nonlinear.iter().map(|&e| self.z[e]));
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
        let n = self.n;
        out.places.clear();
        out.places.resize(n * self.nonlinear.len(), Complex64::ZERO);
        for (a, &e) in self.nonlinear.iter().enumerate() {
            let element = &self.bound.elements[e];
            for (dof, sign) in [(element.to, 1.0), (element.from, -1.0)] {
                if let Some(d) = dof {
                    out.places[a * n + d] += sign;
                }
            }
        }
        self.matrix.solve(&mut out.places)?;
        if k == 1 {
            out.drive.clear();
            out.drive.resize(n, Complex64::ZERO);
            out.drive[drive.0] = Complex64::new(drive.1, 0.0);
            self.matrix.solve(&mut out.drive)?;
            out.outputs.clear();
            out.outputs.resize(n * outputs.len(), Complex64::ZERO);
            outputs.iter().enumerate().for_each(|(o, d)| out.outputs[o * n + d] = Complex64::ONE);
            self.matrix.solve(&mut out.outputs)?;
        }
        Ok(())
    }

    fn stiffnesses(&mut self, s: Complex64, omega: f64) -> Result<(), EngineError> {
        self.z.clear();
        for (i, element) in self.bound.elements.iter().enumerate() {
            let z = if self.same[i] < i {
                self.z[self.same[i]]
            } else if let Part::Nonlinear(a) = self.parts[i] {
                let at = |s: Complex64, dp: &mut Vec<Complex64>| {
                    element.stiffness(s, dp).map(|z| z.0).ok().filter(|z| z.is_finite() && z.norm() > 0.0)
                };
                // Without a stiffness of its own at rest (a film under a constant load) the fundamental's stands in.
                let z = at(s, &mut self.dp).or_else(|| at(Complex64::new(0.0, omega), &mut self.dp));
                z.map_or(Complex64::new(self.rest_slope[a], 0.0), |z| if s.im == 0.0 { Complex64::new(z.norm(), 0.0) } else { z })
            } else {
                element.stiffness(s, &mut self.dp)?.0
            };
            self.z.push(z);
        }
        Ok(())
    }

    fn assemble(&mut self, s: Complex64, ground: f64) {
        self.matrix.clear();
        for (d, slot) in self.diagonal.iter().enumerate() {
            self.matrix.add_at(*slot, s * s * self.mass[d] + ground);
        }
        for (slots, z) in self.slots.iter().zip(&self.z) {
            for (slot, value) in slots.iter().zip([*z, *z, -*z, -*z]) {
                if let Some(slot) = slot {
                    self.matrix.add_at(*slot, value);
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
