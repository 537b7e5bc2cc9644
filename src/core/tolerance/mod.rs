//! Tolerances: what the tolerance cases of a table say of interference, contact area and dissipated energy.
//!
//! The way from a dataset to the energies of the cases: conditions of the rows (tolerances, contact areas, interferences) -> eqs. 4 to 6 of
//! the paper ([`interference`]) -> laws of the model's coefficients over the conditions (eqs. 7 and 8, coefficient effects of the study) ->
//! steady cycles of the calibrated model ([`crate::predict`]) -> energies and ratios to one case beside the table's ([`energies`]). Where the study
//! names strengths and libraries of terms, a law of those strengths in the quantities of the table is identified through the model ([`through`], by
//! its [`link`] from strengths to energies), with the whole search inside each leave-one-out fold and a permutation test ([`search`]).
//! Tolerances of parts as distributions ([`deviation`]) move the contact area of an assembly ([`assembly`]) and by eq. 6 its interference; the model over the area
//! ([`surrogate`]) gives yields, the share of every tolerance ([`contribution`]) and the loosest tolerances that keep a yield ([`synthesis`]).
//! Nothing here knows a number of the paper, a model or TOML: all come from the dataset, `[tolerance]` of study.toml and the engines.
//!
//! Source: *An Integrated Approach to Characterize the Dynamic Behaviour of a Mechanical Chain Tensioner by Functional Tolerancing*,
//! section 4.

pub mod assembly;
pub mod cases;
pub mod contribution;
pub mod deviation;
pub mod energies;
pub mod error;
pub mod interference;
pub mod laws;
pub mod link;
pub mod outcome;
pub mod search;
pub mod sequence;
pub mod surface;
pub mod surrogate;
pub mod synthesis;
pub mod through;

pub use assembly::AreaLaw;
pub use cases::{Case, Cases};
pub use contribution::Contribution;
pub use deviation::{PartTolerance, Shape};
pub use energies::{Prediction, Quantity};
pub use error::ToleranceError;
pub use interference::{Constant, Housing, Pair};
pub use laws::{Forms, Law, Laws, Library, Term};
pub use link::Link;
pub use outcome::{Cycle, Finding, ModelError, Outcome, Rung};
pub use search::{Found, Verdict};
pub use surface::{Layer, Surface};
pub use surrogate::Chebyshev;
pub use synthesis::{Answer as Synthesis, Limited};
pub use through::{Compared, LawOutcome, LawQuestion};
