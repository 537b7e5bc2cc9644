//! Offset of a hinge line, a loaded or a held point.

use super::geometry::{Geometry, Moves};
use super::info::{Dim, Info, Param, Ports, Role, Sign};
use crate::units::Dimension;

/// Offset of a hinge line, a loaded or a held point.
pub struct PointOffset;

static INFO: Info = Info {
    name: "point_offset",
    role: Role::Geometry,
    claim: "a hinge line, a loaded or a held point of a part lies beside where it is drawn: loads and supports have another arm",
    equation: "r = r_0 + d e, e the unit vector of the axis",
    params: &[Param::strength(
        "d",
        Dim::Declared(Dimension::LENGTH),
        Sign::Any,
        "way of the point along the axis, in the reference position",
    )],
    states: 0,
    ports: Ports::NONE,
    family: "geometry",
    source: "statics of a lever: a force that acts elsewhere has another moment",
    range: "points of the part",
};

impl Geometry for PointOffset {
    fn info(&self) -> &'static Info {
        &INFO
    }
    fn moves(&self) -> Moves {
        Moves::Point
    }
    fn step(&self) -> f64 {
        1e-5
    }
}
