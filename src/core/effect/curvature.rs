//! Curvature of the arcs of a chain.

use super::geometry::{Geometry, Moves};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Curvature of the arcs of a chain.
pub struct Curvature;

static INFO: Info = Info {
    name: "curvature",
    role: Role::Geometry,
    claim: "the arcs of a chain are bent more or less than drawn: how much a mode stretches the chain, and so its frequency under each load, follows",
    equation: "1/R = (1 + c) / R_0, lengths of the arcs and direction between their ends kept",
    params: &[Param::strength("c", Dim::One, Sign::Any, "relative change of the curvature; -1: straight, below: bent to the other side")],
    states: 0,
    ports: Ports::NONE,
    family: "geometry",
    source: "shallow arches: Timoshenko & Gere, Theory of Elastic Stability, 2nd ed., ch. 7",
    range: "arcs that turn by less than 360 deg in all",
};

impl Geometry for Curvature {
    fn info(&self) -> &'static Info {
        &INFO
    }
    fn moves(&self) -> Moves {
        Moves::Curvature
    }
    fn step(&self) -> f64 {
        1e-3
    }
}
