//! The study: `study.toml` in memory, wired to its dataset, and written back.
//!
//! [`Study::load`] reads a study with its dataset and checks one against the other: every name, unit, bound, order and split is settled
//! before anything is computed. [`Study::write_effect`] appends an effect to the file of the user, leaving the rest as it is;
//! [`Study::text`] writes a whole new study from values a fit has found.

mod channels;
mod effects;
mod engineering;
mod error;
mod graph;
mod load;
mod mechanism;
mod orders;
mod prediction;
mod settings;
mod site;
mod text;
mod write;

pub use effects::CoefficientOf;
pub use engineering::{dimension_of, unit_of};
pub use error::{StudyError, TestProblem};
pub use graph::{BodySpec, ConnectorSpec, Ends, GraphSpec};
pub use load::Study;
pub use orders::OrderSpec;
pub use prediction::{CycleQuantity, Predicted, PredictionSpec};
pub use settings::{FitSettings, SearchSettings, Split};

#[cfg(test)]
mod tests;
