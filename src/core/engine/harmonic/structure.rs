//! The linear part of the structure at the harmonics of one line, condensed to the places of the nonlinear elements.
//!
//! A model along one axis is linear but for its elements. Parts that turn far are taken as linear about a position of theirs ([`About`]): the rows by
//! which they strain their elements, their inertia and the geometric stiffness of the forces present stay those of that position, displacements count from it,
//! and an element sees what strains it there with what the displacements add.

use std::sync::Arc;

use num_complex::Complex64;

use crate::effect::Inputs;
use crate::model::{Bound, Depth, Element, ElementScratch, Model, Sensed};

use super::super::EngineError;
use super::super::blocktri::{BlockTri, BlockTriError, Layout, Levels};
use super::super::small::Small;
use kept::Kept;

pub(super) mod kept;

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

/// A position of parts that turn far, about which they move by little.
#[derive(Clone, Debug)]
pub(super) struct About {
    /// Coordinates.
    pub q: Vec<f64>,
    /// Force at every place.
    pub forces: Vec<f64>,
}

impl About {
    /// The linear system there.
    pub fn small<'a>(&self, model: &Model, bound: &'a Bound) -> Small<'a> {
        let mut left = self.forces.clone();
        // The elements of a place share its force: the first of them takes it.
        let forces: Vec<f64> = bound.elements.iter().map(|e| std::mem::take(&mut left[e.place])).collect();
        Small::about(model, bound, &self.q, &forces)
    }
}

/// What drives the structure, harmonic by harmonic.
#[derive(Clone, Debug, Default)]
pub(super) struct Drive {
    /// General forces at degrees of freedom, `forces[k]` those of harmonic k.
    pub forces: Vec<Vec<(usize, Complex64)>>,
    /// Degrees of freedom that are moved, with their displacement at every harmonic.
    pub held: Vec<(usize, Vec<Complex64>)>,
    /// The motion of a nonlinear mode in place of forces; `None` where there is a drive.
    pub kept: Option<Kept>,
}

impl Drive {
    /// A harmonic force.
    pub fn force(dof: usize, amplitude: f64) -> Drive {
        Drive { forces: vec![vec![], vec![(dof, Complex64::new(amplitude, 0.0))]], held: vec![], kept: None }
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
            || (k == 1 && self.kept.is_some())
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
    /// Under a unit force at the place whose first harmonic is kept (fundamental only).
    pub place: Vec<Complex64>,
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
    /// The system of small motion, and the coordinates from which displacements count.
    small: Small<'a>,
    about: Vec<f64>,
    /// Whether elements are strained there.
    strained: bool,
    /// Entries of the matrix between degrees of freedom that are free: inertia, geometric stiffness, and of each element.
    inertia: Vec<(usize, f64)>,
    geometric: Vec<(usize, f64)>,
    slots: Vec<Vec<(usize, f64)>>,
    diagonal: Vec<usize>,
    matrix: BlockTri<Complex64>,
    /// Number of the first element with the same law.
    same: Vec<usize>,
    z: Vec<Complex64>,
    /// Where these were taken.
    s: Complex64,
    /// Slope of each nonlinear element at rest where its law has no small-signal stiffness.
    rest_slope: Vec<f64>,
    /// Which degrees of freedom are moved: their rows say so instead of the equilibrium.
    held: Vec<bool>,
    /// Harmonic of the last [`Structure::factor`].
    harmonic: usize,
    /// Damping ratio of a nonlinear mode whose inertia feeds what its laws dissipate; 0 of a driven motion.
    damping: f64,
    /// Where the spring at the place of [`Drive::kept`] enters the matrix, and its stiffness at the last [`Structure::factor`].
    spring: Vec<(usize, f64)>,
    spring_stiffness: f64,
}

/// Ground stiffness against the largest entry of the matrix for a structure whose mean position nothing holds.
const LOOSE: f64 = 1e-7;

impl<'a> Structure<'a> {
    /// `about`: where a spatial model is taken as linear.
    pub fn new(model: &Model, bound: &'a Bound, drive: &Drive, about: Option<&About>) -> Result<Self, EngineError> {
        let n = model.dofs.len();
        let mut held = vec![false; n];
        drive.held.iter().for_each(|(d, _)| held[*d] = true);
        let small = match about {
            Some(about) => about.small(model, bound),
            None => Small::about(model, bound, &vec![0.0; n], &vec![0.0; bound.elements.len()]),
        };
        let kept = drive.kept.as_ref().map_or(&[][..], |kept| &kept.row);
        let mut pairs = small.pairs();
        pairs.extend(kept.iter().flat_map(|(i, _)| kept.iter().map(move |(j, _)| (*i, *j))));
        let layout = Arc::new(Layout::new(Levels::new(n, &pairs)?));
        let free = |entries: &mut dyn Iterator<Item = (usize, usize, f64)>| -> Result<Vec<(usize, f64)>, EngineError> {
            let free = entries.filter(|(i, j, _)| !held[*i] && !held[*j]);
            free.map(|(i, j, value)| Ok((layout.slot(i, j)?, value))).collect()
        };
        let of_row = |row: &Vec<(usize, f64)>| free(&mut row.iter().flat_map(|(i, a)| row.iter().map(move |(j, b)| (*i, *j, a * b))));
        let slots = small.rows.iter().map(of_row).collect::<Result<_, _>>()?;
        let spring = of_row(&kept.to_vec())?;
        let (inertia, geometric) = (free(&mut small.mass.iter().copied())?, free(&mut small.stiffness.iter().copied())?);
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
        let strain = |e: usize| small.strain(e);
        Ok(Structure {
            rest_slope: nonlinear.iter().map(|&i| rest_slope(&bound.elements[i], strain(i))).collect(),
            strained: (0..bound.elements.len()).any(|e| strain(e) != 0.0),
            about: about.map_or_else(|| vec![0.0; n], |about| about.q.clone()),
            bound,
            candidates: parts
                .iter()
                .zip(&bound.elements)
                .map(|(p, e)| if *p == Part::Candidate { e.candidates() } else { (vec![], vec![]) })
                .collect(),
            parts,
            nonlinear,
            n,
            inertia,
            geometric,
            slots,
            diagonal: (0..n).map(|d| layout.slot(d, d)).collect::<Result<_, _>>()?,
            matrix: BlockTri::new(layout),
            same,
            z: vec![],
            s: Complex64::ZERO,
            held,
            small,
            harmonic: 0,
            damping: 0.0,
            spring,
            spring_stiffness: 0.0,
        })
    }

    /// Relative displacement of an element in a column of all degrees of freedom.
    pub fn relative(&self, element: usize, u: &[Complex64]) -> Complex64 {
        self.small.relative(element, u)
    }

    /// What strains an element where the structure is taken as linear, of harmonic `k`.
    pub fn strain(&self, element: usize, k: usize) -> f64 {
        if k == 0 { self.small.strain(element) } else { 0.0 }
    }

    /// Relative displacement that an element has in harmonic `k` of the motion `u`.
    pub fn seen(&self, element: usize, k: usize, u: &[Complex64]) -> Complex64 {
        self.relative(element, u) + self.strain(element, k)
    }

    /// Coordinate where the structure is taken as linear, of harmonic `k`.
    pub fn position(&self, dof: usize, k: usize) -> f64 {
        if k == 0 { self.about[dof] } else { 0.0 }
    }

    /// Whether the linear structure moves at a harmonic.
    pub fn moves(&self, k: usize, drive: &Drive) -> bool {
        drive.acts(k) || (k == 0 && self.strained)
    }

    /// Solves at harmonic `k` of `omega`: nonlinear elements stand in with a linear stiffness of their own, which the caller takes out
    /// of their force again.
    pub fn solve(&mut self, k: usize, omega: f64, drive: &Drive, outputs: &[usize], out: &mut Flexibility) -> Result<(), EngineError> {
        self.damping = drive.kept.as_ref().map_or(0.0, |kept| kept.damping);
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
        if self.moves(k, drive) {
            self.driven(k, drive, &mut out.drive);
            self.matrix.solve(&mut out.drive)?;
        }
        if k == 1 {
            out.outputs.clear();
            out.outputs.resize(n * outputs.len(), Complex64::ZERO);
            outputs.iter().enumerate().for_each(|(o, d)| out.outputs[o * n + d] = Complex64::ONE);
            self.matrix.solve(&mut out.outputs)?;
        }
        match &drive.kept {
            Some(kept) if k == 1 => self.keep(kept, out),
            _ => Ok(()),
        }
    }

    /// Factors the structure at harmonic `k`.
    pub fn factor(&mut self, k: usize, omega: f64) -> Result<(), EngineError> {
        let s = Complex64::new(0.0, k as f64 * omega);
        (self.s, self.harmonic) = (s, k);
        self.stiffnesses(s, omega)?;
        if k == 1 {
            self.spring_stiffness = self.spring_for(s);
        }
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
        for (d, b) in self.small.rows[element].iter().filter(|(d, _)| !self.held[*d]) {
            column[*d] += force * *b;
        }
    }

    /// Loads of the drive: forces, what is moved, what the structure carries over from there, and what strains the elements already.
    fn driven(&self, k: usize, drive: &Drive, column: &mut [Complex64]) {
        for (d, force) in drive.forces.get(k).into_iter().flatten().filter(|(d, _)| !self.held[*d]) {
            column[*d] += force;
        }
        let mut moved = vec![Complex64::ZERO; if drive.held.is_empty() { 0 } else { self.n }];
        for (held, series) in &drive.held {
            moved[*held] = series.get(k).copied().unwrap_or_default() - self.position(*held, k);
        }
        for (e, z) in self.z.iter().enumerate() {
            let there = if moved.is_empty() { Complex64::ZERO } else { self.relative(e, &moved) };
            let force = z * (there + self.strain(e, k));
            if force != Complex64::ZERO {
                self.load(e, -force, column);
            }
        }
        if !moved.is_empty() {
            let inertia = self.small.mass.iter().map(|(i, j, m)| (*i, *j, self.s * self.s * *m));
            let geometric = self.small.stiffness.iter().map(|(i, j, k)| (*i, *j, Complex64::new(*k, 0.0)));
            inertia.chain(geometric).filter(|(i, ..)| !self.held[*i]).for_each(|(i, j, z)| column[i] -= z * moved[j]);
            drive.held.iter().for_each(|(d, _)| column[*d] = moved[*d]);
        }
    }

    /// Force of inertia and of geometric stiffness at a degree of freedom in the motion `u`.
    pub fn carried(&self, dof: usize, s: Complex64, u: &[Complex64]) -> Complex64 {
        let along = |entries: &[(usize, usize, f64)]| -> Complex64 {
            entries.iter().filter(|(i, ..)| *i == dof).map(|(_, j, value)| u[*j] * *value).sum()
        };
        s * s * along(&self.small.mass) + along(&self.small.stiffness)
    }

    /// How the force of an element acts at a degree of freedom.
    pub fn acting(&self, element: usize, dof: usize) -> f64 {
        self.small.rows[element].iter().filter(|(d, _)| *d == dof).map(|(_, b)| b).sum()
    }

    /// Complex stiffness of an element at the harmonic of the last [`Structure::factor`].
    pub fn stiffness(&self, element: usize) -> Complex64 {
        self.z[element]
    }

    fn stiffnesses(&mut self, s: Complex64, omega: f64) -> Result<(), EngineError> {
        self.z.clear();
        for (i, element) in self.bound.elements.iter().enumerate() {
            let z = if self.same[i] < i {
                self.z[self.same[i]]
            } else if let Part::Nonlinear(a) = self.parts[i] {
                let at = |s: Complex64| element.stiffness_at(s, self.small.strain(i), 0.0).ok().filter(|z| z.is_finite() && z.norm() > 0.0);
                // Without a stiffness of its own at rest (a film under a constant load) the fundamental's stands in.
                let z = at(s).or_else(|| at(Complex64::new(0.0, omega)));
                z.map_or(Complex64::new(self.rest_slope[a], 0.0), |z| if s.im == 0.0 { Complex64::new(z.norm(), 0.0) } else { z })
            } else {
                element.stiffness_at(s, 0.0, 0.0)? + s * s * (self.feed(self.harmonic) - 1.0) * element.inertia()
            };
            self.z.push(z);
        }
        Ok(())
    }

    fn assemble(&mut self, s: Complex64, ground: f64) {
        self.matrix.clear();
        for (d, slot) in self.diagonal.iter().enumerate() {
            self.matrix.add_at(*slot, if self.held[d] { Complex64::ONE } else { Complex64::new(ground, 0.0) });
        }
        let spring = if self.harmonic == 1 { self.spring_stiffness } else { 0.0 };
        let squared = s * s * self.feed(self.harmonic);
        self.inertia.iter().for_each(|(slot, m)| self.matrix.add_at(*slot, squared * *m));
        self.spring.iter().for_each(|(slot, b)| self.matrix.add_at(*slot, Complex64::from(spring * b)));
        self.geometric.iter().for_each(|(slot, k)| self.matrix.add_at(*slot, Complex64::new(*k, 0.0)));
        for (slots, z) in self.slots.iter().zip(&self.z) {
            slots.iter().for_each(|(slot, b)| self.matrix.add_at(*slot, z * *b));
        }
    }
}

/// Stiffness of a law at rest under a relative displacement from its own tangent; velocity-dependent parts are left out.
fn rest_slope(element: &Element, x: f64) -> f64 {
    let (mut s, mut fs) = (vec![0.0; element.n_states()], vec![0.0; element.n_follower_states()]);
    let mut sensed = Sensed::default();
    element.tangent(&Inputs { x, ..Inputs::default() }, 1e-3, &mut s, &mut fs, Depth::Inputs, &mut sensed, &mut ElementScratch::default());
    let d = sensed.inputs(0);
    let slope = (d[0] + d[3]).abs();
    if slope.is_finite() { slope } else { 0.0 }
}
