//! The model: a graph of bodies joined by connectors, with effects at the connectors' axes and on the measuring channels.
//!
//! [`Model`] is the graph, [`System`] the graph with its effects and their parameters, [`Bound`] what one test sees of it: the numbers
//! of every effect at the test's conditions with their derivatives with respect to the free parameters.

mod between;
mod bound;
mod element;
mod error;
mod graph;
mod held;
pub mod space;
mod recurrence;
mod sensed;
mod system;

pub use bound::{Acting, Bound, BoundLoad, ChannelPiece};
pub use element::{Element, ElementScratch, Fading};
pub use error::ModelError;
pub use graph::{Axis, Body, Connector, Dof, Finder, Level, Load, Model, Place};
pub use held::held;
pub use sensed::{Depth, Sensed};
pub use system::{AtCondition, ChannelSite, FreeParam, Instance, ParamValue, Site, System, Target};

#[cfg(test)]
mod tests;
