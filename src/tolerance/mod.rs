//! Tolerances: what the tolerance cases of a table say of interference, contact area and dissipated energy.
//!
//! The way from a dataset to the energies of the cases: conditions of the rows (tolerances, contact areas, interferences) -> eqs. 4 to 6 of
//! the paper ([`interference`]) -> laws of the model's coefficients in the interference (eqs. 7 and 8, coefficient effects of the study) ->
//! steady cycles of the calibrated model -> ratios to one case, one scale for all ([`energies`]). Where these fail, [`search`] looks for a
//! law of the energies in the quantities of the table, with the whole search inside each leave-one-out fold and a permutation test.
//! Nothing here knows a number of the paper: all come from the dataset and from `[tolerance]` of study.toml.
//!
//! Source: *An Integrated Approach to Characterize the Dynamic Behaviour of a Mechanical Chain Tensioner by Functional Tolerancing*,
//! section 4.

pub mod cases;
pub mod energies;
pub mod error;
pub mod interference;
pub mod laws;
pub mod outcome;
pub mod search;
pub mod surface;

pub use cases::{Case, Cases};
pub use energies::{Energies, Predicted, Prediction};
pub use error::ToleranceError;
pub use interference::{Constant, Housing, Pair};
pub use laws::{Law, Laws, Term};
pub use outcome::{Finding, Outcome, Question, answer};
pub use search::{Found, Verdict};
pub use surface::Surface;
