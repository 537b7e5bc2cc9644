//! Geometry: where the parts of a model lie in the reference position, as parameters that a fit can move.
//!
//! A law of the geometry exerts no force. It moves what the forces act between, and the whole response follows from the moved model. Its derivatives
//! are central differences of that response.

use super::Info;

/// What a law of the geometry moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moves {
    /// The curvature of the arcs that parts are counted along, `at` their stem.
    Curvature,
    /// The mass of parts that are counted along arcs, `at` their stem.
    Mass,
    /// The point of a part that a joint, a load or a connector holds, `at` the point and an axis.
    Point,
}

/// A law of the geometry.
pub trait Geometry: Send + Sync {
    /// What the effect says of itself.
    fn info(&self) -> &'static Info;
    /// What it moves.
    fn moves(&self) -> Moves;
    /// Half the way between the two evaluations of a derivative [unit of the parameter, SI]: small against what changes a response visibly, large
    /// against the rounding of stiff links.
    fn step(&self) -> f64;
}
