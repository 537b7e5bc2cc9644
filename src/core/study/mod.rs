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
//! | `[[leave_out]]` | `test`, `quantity` (natural_frequency, modal_damping), `mode`, `why`: a row that is computed and compared with nothing |
//! | `[[shift]]` | `test`, `against`, `sigma`: a modal test whose frequencies are compared as shifts against those of another |
//! | `fit = { loss, width, max_iterations, starts, points, frf_tolerance }` | loss: squares, huber, soft_l1, cauchy; width in units of the noise; points of a loop that are compared; part of \|H\| that the model of an FRF may be off by itself, beside the noise |
//! | `search = { effects, places, max_added, slack }` | what the search for missing effects may try; beside these its constants, by the names of [`crate::diagnose::Settings`], such as `model_error_least`, `scatter_most`, `facts_most` |
//! | `[[body]]` | `name`, `fixed = true` or `free = ["x", ...]`, `mass` (or `{ start, min, max, slack }`), `inertia`, `count` (then `name1` ... ) |
//! | `[[connector]]` | `name`, and `from`, `to` or `chain = "body with count"`; `ground` need not be declared |
//! | `[[load]]` | a load that stays: `at` (`m8.x`), `force`, or `condition = "load"` and `factor` (a test that does not state it is not loaded), `via = ["138.3 N"]` values passed through before, `steps` from one to the next |
//! | `[[effect]]` | `effect`, `at` (place, range `c1-7.x`, list of places; for a channel effect `test.role` or `*.role`), its parameters |
//! | parameter | `"20 N/mm"` or `{ start, min, max, prior = { mean, sigma }, fixed = true, slack }`; settings are fitted where bounds, `fixed = false` or `free = true` say so |
//! | formula | `expression`, `states = { z = "rate" }`, `active`; every other key is a parameter ([`crate::effect::formula`]) |
//! | coefficient effects | `of = "viscous.c"` (`viscous#2.c` for the second there), `condition`, `reference` |
//! | `per = "i"` in an effect | values of its own at every value of the condition, `monotone = "rising"` or `"falling"` their order; `only = { i = "0.3 mm" }`: the values at one |
//! | `[[order]]` | `order = [names of free parameters, rising]`, `gap` |
//! | `[[prediction]]` | `case`, `quantity` and its keys ([`Predicted`]), `conditions`, `reference` |
//! | `[tolerance]` | the cases of an energy test of another `dataset`: `test`, `reference`, `interference = [{ name, area, resolution }]`, `housing`, `cycle`, `condition`, `range`, `quantities`, `terms`, `permutations`, `surface` ([`ToleranceSpec`]); tolerances of parts as distributions: `parts`, `correlations`, `bands`, `modes`, `assembly`, `synthesis` ([`Parts`]) |
//!
//! # Parts that turn far
//! These tables replace `[[body]]`; degrees of freedom are `part.x`, `.y`, `.z` (displacement of the part's origin along fixed axes) and
//! `.theta`, `.phi`, `.psi` (rotation vector), places the six components of a connector ([`crate::model::space`]),
//! and the free axes of every part against the ground.
//!
//! | key | what |
//! |---|---|
//! | `[[arc]]` | the curve of the parts' centres in the xy plane, arc after arc: `radius` and `angle` (positive: to the left), or `length` of a straight piece; of the first `start = ["0 mm", "0 mm"]` and `heading` (from x towards y, 90 deg where it is left out); later ones may state theirs, and must meet |
//! | `[[part]]` along the arcs | `name`, `count = 22` of equal length (`name1` ...) or `"modal basis"` with `modulus` and `highest` frequency of interest; `section = { width, thickness, density }`, or `mass` and `inertia` (three, along the part) of each |
//! | `[[part]]` elsewhere | `name`, `at = ["x", "y", "z"]`, `mass`, `inertia`; `free = [...]` or `fixed = true` |
//! | `[[joint]]` | to the ground: `part`, `free` axes that stay, `at` the point (`"start"` and `"end"` of the arcs), from then on the part's origin. `free = ["psi"]` is a pin |
//! | `[[point]]` | `name`, `at`: a point to load and measure; its part (`part`, or the nearest) takes it as origin and its name |
//! | `[[connector]]` | `name` and `chain = "part with count"` (`name1` ... at the interfaces), or `from`, `to`, `at` and `heading` of its y axis (fixed axes where it is left out); `absent = ["loop-*"]` tests it is not there in; `attached = "loaded"`: it is attached when the loads that stay have come on and carries none of them: it takes part in modal and frf tests alone |

mod channels;
mod effects;
mod engineering;
mod error;
mod formula;
mod graph;
mod levels;
mod load;
mod mechanism;
mod orders;
mod parts;
mod prediction;
pub mod run;
pub mod schema;
mod settings;
mod site;
mod starts;
mod space;
mod text;
mod tolerance;
mod write;

pub use effects::CoefficientOf;
pub use engineering::{dimension_of, unit_of};
pub use error::{StudyError, TestProblem};
pub use graph::{BodySpec, ConnectorSpec, Ends, GraphSpec};
pub use load::Study;
pub use orders::OrderSpec;
pub use parts::{Assembly, Band, Banded, Parts, SynthesisSpec};
pub use prediction::{CycleQuantity, Predicted, PredictionSpec};
pub use settings::{FitSettings, LeaveOut, SearchSettings, ShiftOf, Split};
pub use tolerance::{CaseCondition, ToleranceSpec, ToleranceTable};

#[cfg(test)]
mod tests;
