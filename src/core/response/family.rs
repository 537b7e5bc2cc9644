//! Families of modes, by which a table is paired with a model where it states them.

use num_complex::Complex64;

use crate::model::space::Space;
use crate::model::space::rotation::{V3, cross, dot, sub, times};
use crate::model::{Axis, Model};

/// What most of a mode's kinetic energy is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Motion in the xy plane.
    InPlane,
    /// Rotation about the chain.
    Torsion,
    /// Motion out of the xy plane without it.
    OutOfPlane,
}

impl Family {
    /// The family a table names, if it names one: `xy bending` (or `bending`), `torsion`, `yz bending`.
    pub fn parse(text: &str) -> Option<Family> {
        let has = |word: &str| text.to_lowercase().contains(word);
        match (has("torsion"), has("yz"), has("bending") || has("xy")) {
            (true, false, false) => Some(Family::Torsion),
            (false, true, _) => Some(Family::OutOfPlane),
            (false, false, true) => Some(Family::InPlane),
            _ => None,
        }
    }

    /// The name in tables.
    pub fn word(self) -> &'static str {
        match self {
            Family::InPlane => "xy bending",
            Family::Torsion => "torsion",
            Family::OutOfPlane => "yz bending",
        }
    }

    /// The family of a shape.
    pub fn of(model: &Model, shape: &[Complex64]) -> Family {
        let mut energy = [0.0; 3];
        match &model.space {
            Some(space) => (0..space.parts.len()).for_each(|k| add_part(model, space, k, shape, &mut energy)),
            None => {
                for (dof, x) in model.dofs.iter().zip(shape) {
                    let family = match dof.axis {
                        Axis::X | Axis::Y | Axis::Psi => 0,
                        Axis::Phi => 1,
                        Axis::Z | Axis::Theta => 2,
                    };
                    energy[family] += dof.mass * x.norm_sqr();
                }
            }
        }
        match energy {
            [a, b, c] if a >= b && a >= c => Family::InPlane,
            [_, b, c] if b >= c => Family::Torsion,
            _ => Family::OutOfPlane,
        }
    }
}

fn add_part(model: &Model, space: &Space, k: usize, shape: &[Complex64], energy: &mut [f64; 3]) {
    let part = &space.parts[k];
    let along = tangent(model, space, k);
    for pick in [|x: Complex64| x.re, |x: Complex64| x.im] {
        let q = part.dofs.map(|d| d.map_or(0.0, |d| pick(shape[d])));
        let turn: V3<f64> = [q[3], q[4], q[5]];
        let moved = cross(turn, part.centre);
        let at: V3<f64> = std::array::from_fn(|i| q[i] + moved[i]);
        energy[0] += part.mass * (at[0] * at[0] + at[1] * at[1]) + part.inertia[2][2] * turn[2] * turn[2];
        let flat = [turn[0], turn[1], 0.0];
        let twist = along.map(|x| x * dot(flat, along));
        let rest = sub(flat, twist);
        energy[1] += dot(twist, times(&part.inertia, twist));
        energy[2] += part.mass * at[2] * at[2] + dot(rest, times(&part.inertia, rest));
    }
}

/// Direction of the chain at a part: from its first connector to its last.
fn tangent(model: &Model, space: &Space, k: usize) -> V3<f64> {
    let mut points =
        model.connectors[..model.declared].iter().zip(&space.frames).filter(|(c, _)| c.from == k || c.to == k).map(|(_, f)| f.point);
    let first = points.next().unwrap_or(space.parts[k].origin);
    let last = points.next_back().unwrap_or(space.parts[k].origin);
    let d = sub(last, first);
    let size = dot(d, d).sqrt();
    if size > 0.0 { d.map(|x| x / size) } else { [0.0, 1.0, 0.0] }
}
