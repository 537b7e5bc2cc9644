//! Rigid parts that turn far: where they lie, what a connector measures between them, their inertia.
//!
//! A model with a [`Space`] is spatial: all its bodies are rigid parts with a place in space, their degrees of freedom the displacement of
//! an origin and a rotation vector, along fixed axes, from the reference position. Both are plain coordinates, so that every engine works
//! on them as on those of a linear chain; the rotation vector from the reference is regular up to a full turn of a part against its own
//! reference, and the relative one of a connector up to half a turn between its two parts.
//!
//! Joints to the ground hold degrees of freedom at zero: a part on a pin takes the pin as its origin, moves in psi alone, and the
//! constraint holds exactly. That is what Lagrange multipliers give for such joints (eqs. 1-2 of the paper) without their indefinite
//! matrix and without drift. A joint between two parts that both move is a connector with the stiffness its author declares.
//!
//! The paper's tensioner: part 1 on the pin (psi), 20 parts free, part 22 on the closed shelf (y, psi): 1 + 20 x 6 + 2 = 123 degrees of
//! freedom. A shelf that may open is a connector from the ground to part 22 with a unilateral law along x; part 22 is then free in x
//! too, 124, and lifting off leaves it to the chain. Where nothing else holds it, there is no equilibrium, and that is said.
//!
//! | file | what |
//! |---|---|
//! | `rotation` | rotation vectors, their tangents, over dual numbers |
//! | `joint` | the six components of a connector, first and second derivatives |
//! | `plane` | the same between parts that move in the plane alone |
//! | `body` | inertia, gyroscopic terms included |
//! | `curve` | arcs and the parts along them |
//! | `shape` | the same as parameters: other curvature, points elsewhere |

pub mod body;
pub mod curve;
pub mod joint;
pub mod plane;
pub mod rotation;
pub mod shape;

use std::collections::{HashMap, HashSet};

use super::ModelError;
use super::graph::{Axis, Body, Connector, Dof, Model, Place, held_to_ground, unique};
pub use body::{Inertial, Part};
pub use curve::{Arc, Curve, Section};
pub use joint::{Frame, Pose, Relative};
pub use plane::{InPlane, PlaneJoint};
use rotation::UNIT;
pub use shape::{Outline, Stem};

/// Where the parts and connectors of a spatial model are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Space {
    /// One for every body; `dofs` as in the model.
    pub parts: Vec<Part>,
    /// One for every connector.
    pub frames: Vec<Frame>,
    /// Parts that are counted along a curve.
    pub stems: Vec<Stem>,
}

impl Space {
    /// The connector in the plane, where both its parts move there alone.
    pub fn plane(&self, connector: usize, from: usize, to: usize) -> Option<PlaneJoint> {
        let flat = |part: &Part| part.dofs[2..5].iter().all(Option::is_none);
        let (a, b) = (&self.parts[from], &self.parts[to]);
        if flat(a) && flat(b) { PlaneJoint::new(&self.frames[connector], a.origin, b.origin) } else { None }
    }

    /// Coordinates of a part among all, 0 where it is held.
    #[inline]
    pub fn coordinates(&self, part: usize, q: &[f64]) -> [f64; 6] {
        self.parts[part].dofs.map(|d| d.map_or(0.0, |d| q[d]))
    }
}

impl Model {
    /// Builds a spatial model. The `dofs` of the parts are set here, from the free axes of the bodies.
    pub fn spatial(bodies: Vec<Body>, connectors: Vec<Connector>, mut space: Space) -> Result<Model, ModelError> {
        unique("body", bodies.iter().map(|b| b.name.as_str()))?;
        unique("connector", connectors.iter().map(|c| c.name.as_str()))?;
        if space.parts.len() != bodies.len() || space.frames.len() != connectors.len() {
            return Err(ModelError::invalid(
                "space",
                "parts or frames do not match the graph",
                "one part per body, one frame per connector",
            ));
        }
        let mut dofs = Vec::new();
        let mut index = HashMap::new();
        for (b, (body, part)) in bodies.iter().zip(&mut space.parts).enumerate() {
            check_part(body, part)?;
            part.dofs = [None; 6];
            for &axis in &body.free {
                let k = axis as usize;
                if index.insert((b, axis), dofs.len()).is_some() {
                    return Err(ModelError::Twice { what: "free axis", name: format!("{}.{}", body.name, axis.name()) });
                }
                part.dofs[k] = Some(dofs.len());
                dofs.push(Dof { body: b, axis, mass: part.mass_along(k) });
            }
        }
        if dofs.is_empty() {
            return Err(ModelError::invalid("part", "no part has a free axis: nothing can move", "at least one part that is free to move"));
        }
        let mut places = Vec::new();
        for (c, connector) in connectors.iter().enumerate() {
            if connector.from == connector.to {
                let message = format!("connector `{}` joins part `{}` to itself", connector.name, bodies[connector.to].name);
                return Err(ModelError::invalid(&connector.name, message, "two different parts"));
            }
            places.extend(Axis::ALL.iter().map(|axis| Place { connector: c, axis: *axis, from: None, to: None }));
        }
        let reached: HashSet<usize> = connectors.iter().flat_map(|c| [c.from, c.to]).collect();
        if let Some(b) = (0..bodies.len()).find(|b| !bodies[*b].free.is_empty() && !reached.contains(b)) {
            let name = &bodies[b].name;
            return Err(ModelError::invalid(
                name,
                format!("nothing holds part `{name}`: no connector reaches it"),
                "a connector to every part that can move",
            ));
        }
        let declared = connectors.len();
        let mut connectors = connectors;
        for held in held_to_ground(&bodies, &connectors) {
            let (at, c) = (&bodies[held.to], connectors.len());
            places.extend(at.free.iter().map(|axis| Place { connector: c, axis: *axis, from: None, to: None }));
            space.frames.push(Frame { point: space.parts[held.to].origin, axes: UNIT });
            connectors.push(held);
        }
        Ok(Model { bodies, connectors, declared, dofs, places, space: Some(space), loads: vec![], absent: vec![], attached: vec![] })
    }
}

fn check_part(body: &Body, part: &Part) -> Result<(), ModelError> {
    let bad = |message: String, accepted: &str| Err(ModelError::invalid(&body.name, message, accepted));
    if !(part.mass.is_finite() && part.mass >= 0.0) {
        return bad(format!("the mass of part `{}` is {}", body.name, part.mass), "zero or more");
    }
    let numbers = part.origin.iter().chain(&part.centre).chain(part.inertia.iter().flatten());
    if let Some(x) = numbers.into_iter().find(|x| !x.is_finite()) {
        return bad(format!("the place or inertia of part `{}` holds {x}", body.name), "finite numbers");
    }
    let j = nalgebra::Matrix3::from_fn(|r, c| part.inertia[r][c]);
    let least = j.symmetric_eigenvalues().min();
    if least < -1e-12 * j.amax() || (j - j.transpose()).amax() > 1e-9 * j.amax() {
        return bad(
            format!("the inertia tensor of part `{}` is not one of a body", body.name),
            "a symmetric tensor without negative principal values",
        );
    }
    Ok(())
}
