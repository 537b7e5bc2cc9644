//! Mass of a chain of parts.

use super::geometry::{Geometry, Moves};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Mass of a chain of parts.
pub struct SectionMass;

static INFO: Info = Info {
    name: "section_mass",
    role: Role::Geometry,
    claim: "a chain is heavier or lighter than its section and density say: its natural frequencies are lower or higher, its static stiffness stays",
    equation: "m = (1 + m_rel) m_0, J = (1 + m_rel) J_0 of every part",
    params: &[Param::strength("m", Dim::One, Sign::Any, "relative change of the mass").within(-0.9, 9.0)],
    states: 0,
    ports: Ports::NONE,
    family: "geometry",
    source: "mass per length of a uniform beam: Meirovitch, Fundamentals of Vibrations (2001), ch. 8",
    range: "-0.9 to 9",
};

impl Geometry for SectionMass {
    fn info(&self) -> &'static Info {
        &INFO
    }
    fn moves(&self) -> Moves {
        Moves::Mass
    }
    fn step(&self) -> f64 {
        1e-3
    }
}
