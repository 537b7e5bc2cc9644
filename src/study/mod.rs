//! The study: `study.toml` in memory, wired to its dataset, and written back.
//!
//! [`Study::load`] reads a study with its dataset and checks one against the other: every name, unit, bound, order and split is settled
//! before anything is computed. [`Study::write_effect`] appends an effect to the file of the user, leaving the rest as it is;
//! [`Study::save`] writes a whole new study with the values a fit has found.
//!
//! # study.toml
//! | key | what |
//! |---|---|
//! | `schema = 1`, `title`, `assumptions` | the first is required |
//! | `dataset = "data"` | folder with dataset.toml (or that file), relative to study.toml |
//! | `folder = "../raw"` | where the raw files lie, if not where dataset.toml says; `--data` goes before it |
//! | `split = { select = [...], held_out = [...] }` | test ids; every other test is fitted |
//! | `fit = { loss, width, max_iterations, starts }` | loss: squares, huber, soft_l1, cauchy; width in units of the noise |
//! | `search = { effects, places, max_added }` | what the search for missing effects may try |
//! | `[[body]]` | `name`, `fixed = true` or `free = ["x", ...]`, `mass`, `inertia`, `count` (then `name1` ... ) |
//! | `[[connector]]` | `name`, and `from`, `to` or `chain = "body with count"`; `ground` need not be declared |
//! | `[[effect]]` | `effect`, `at` (place, range `c1-7.x`, list of places; for a channel effect `test.role` or `*.role`), its parameters |
//! | parameter | `"20 N/mm"` or `{ start, min, max, prior = { mean, sigma }, fixed = true }`; settings: `free = true` to fit them |
//! | formula | `expression`, `states = { z = "rate" }`, `active`; every other key is a parameter ([`crate::effect::formula`]) |
//! | coefficient effects | `of = "viscous.c"` (`viscous#2.c` for the second there), `condition`, `reference` |
//! | `[[order]]` | `order = [names of free parameters, rising]`, `gap` |
//! | `[[prediction]]` | `case`, `quantity` and its keys ([`Predicted`]), `conditions`, `reference` |

mod channels;
mod effects;
mod engineering;
mod error;
mod formula;
mod graph;
mod load;
mod mechanism;
mod orders;
mod prediction;
pub mod run;
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
