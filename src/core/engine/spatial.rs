//! Working memory for connectors between parts that turn far: their components, derivatives, and where they go.

use num_dual::Dual2_64;

use crate::model::space::{Pose, Relative, Space};
use crate::model::{Bound, Model};

/// A connector and what acts at it.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    pub connector: usize,
    pub from: usize,
    pub to: usize,
    /// Degrees of freedom of its twelve coordinates.
    pub dofs: [Option<usize>; 12],
    /// Elements at it, with the component of each.
    pub elements: Vec<(usize, usize)>,
    /// Whether a law there reads a velocity, an acceleration.
    pub rates: (bool, bool),
}

/// Components of a connector with their derivatives with respect to its twelve coordinates, and the rates of these derivatives.
#[derive(Clone, Debug, Default)]
pub(super) struct Measured {
    pub g: [f64; 6],
    pub b: [[f64; 12]; 6],
    /// `dB/dt`, which is also the derivative of the relative velocity with respect to the coordinates.
    pub rate: [[f64; 12]; 6],
    /// `d2B/dt2`, which is also the derivative of the relative acceleration.
    pub second: [[f64; 12]; 6],
}

/// The connectors with something at them.
pub(super) fn joints(model: &Model, bound: &Bound, space: &Space) -> Vec<Joint> {
    let mut joints: Vec<Joint> = Vec::new();
    for (e, element) in bound.elements.iter().enumerate() {
        let place = &model.places[element.place];
        let (v, a) = element.reads_rates();
        match joints.iter_mut().find(|j| j.connector == place.connector) {
            Some(joint) => {
                joint.elements.push((e, place.axis as usize));
                joint.rates = (joint.rates.0 | v, joint.rates.1 | a);
            }
            None => {
                let mut joint = joint(model, space, place.connector);
                joint.elements.push((e, place.axis as usize));
                joint.rates = (v, a);
                joints.push(joint);
            }
        }
    }
    joints
}

/// A connector without regard to what acts there.
pub(super) fn joint(model: &Model, space: &Space, connector: usize) -> Joint {
    let c = &model.connectors[connector];
    let (a, b) = (&space.parts[c.from].dofs, &space.parts[c.to].dofs);
    let dofs = std::array::from_fn(|k| if k < 6 { a[k] } else { b[k - 6] });
    Joint { connector, from: c.from, to: c.to, dofs, elements: vec![], rates: (false, false) }
}

impl Joint {
    /// Values of its twelve coordinates.
    #[inline]
    pub fn gather(&self, u: &[f64]) -> [f64; 12] {
        // Not `map`, which takes a copy of the array first.
        std::array::from_fn(|k| self.dofs[k].map_or(0.0, |d| u[d]))
    }

    /// Components, derivatives and poses at `q`.
    pub fn relative(&self, space: &Space, q: &[f64]) -> (Relative<f64>, Pose<f64>, Pose<f64>) {
        self.relative_of(space, &self.gather(q))
    }

    /// Components and derivatives between poses at hand.
    #[inline]
    pub fn between(&self, space: &Space, poses: &[Pose<f64>]) -> Relative<f64> {
        let (from, to) = (space.parts[self.from].origin, space.parts[self.to].origin);
        Relative::new(&space.frames[self.connector], from, to, &poses[self.from], &poses[self.to])
    }

    /// The same over any numbers.
    pub fn relative_of<T: crate::effect::Num>(&self, space: &Space, q: &[T; 12]) -> (Relative<T>, Pose<T>, Pose<T>) {
        let (a, b) = (Pose::new(&std::array::from_fn(|i| q[i])), Pose::new(&std::array::from_fn(|i| q[6 + i])));
        let (from, to) = (space.parts[self.from].origin, space.parts[self.to].origin);
        (Relative::new(&space.frames[self.connector], from, to, &a, &b), a, b)
    }

    /// Rates of the derivatives along the motion.
    pub fn rates_into(&self, space: &Space, q: &[f64], v: &[f64], a: &[f64], out: &mut Measured) {
        let (q, v, a) = (self.gather(q), self.gather(v), self.gather(a));
        let (path, ..) = self.relative_of(space, &std::array::from_fn(|i| Dual2_64::new(q[i], v[i], a[i])));
        out.rate = path.b.map(|row| row.map(|x| x.v1));
        out.second = path.b.map(|row| row.map(|x| x.v2));
    }
}

/// Pairs of degrees of freedom that a spatial model couples.
pub(super) fn pairs(joints: &[Joint], space: &Space) -> Vec<(usize, usize)> {
    let groups = joints.iter().map(|j| &j.dofs[..]).chain(space.parts.iter().map(|p| &p.dofs[..]));
    let mut pairs = Vec::new();
    for group in groups {
        let here: Vec<usize> = group.iter().flatten().copied().collect();
        pairs.extend(here.iter().flat_map(|&i| here.iter().map(move |&j| (i, j))));
    }
    pairs
}

#[inline]
pub(super) fn dot(row: &[f64; 12], u: &[f64; 12]) -> f64 {
    // In four sums, so that they go side by side.
    let mut sum = [0.0; 4];
    for (a, b) in row.as_chunks::<4>().0.iter().zip(u.as_chunks::<4>().0) {
        (0..4).for_each(|l| sum[l] += a[l] * b[l]);
    }
    (sum[0] + sum[1]) + (sum[2] + sum[3])
}
