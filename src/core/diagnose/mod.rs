//! From misfit to missing physics: fit a case, see where it fails, search what explains it, prove it, and climb.
//!
//! Four rooms, each imports from those above it only: `settings` (every constant of a decision), `results` (what is told, data alone), `calibrate` (a case, its fit, how likely it is), `search`.

mod error;
mod trace;
mod settings;
pub mod results;
mod calibrate;
mod search;

pub use calibrate::approach::approached;
pub use calibrate::case::{Case, Fitted, Search};
pub use calibrate::compare::{compare, glance};
pub use calibrate::fit::{fit, unit_of};
pub use calibrate::mode_energy::modes as mode_energies;
pub use calibrate::slack::Slack;
pub use calibrate::units::odd_units;
pub use error::DiagnoseError;
pub use results::{Fault, Missed, Reason, Unexplained};
pub use search::climb::unbounded;
pub use search::ladder::{diagnose, ladder};
pub use search::map::{Mark, map};
pub use settings::{Fitting, Proposals, Race, STATED, Scoring, Settings, Stated, Telling};

/// What tests of whole studies look into.
#[cfg(test)]
pub(crate) mod testing {
    pub use super::calibrate::fit::begin;
    pub use super::calibrate::slack::{correction, given};
    pub(crate) use super::calibrate::weigh::{Scale, Tied, Weighed};
    pub use super::search::candidates::{Name, Scene, candidates};
    pub(crate) use super::search::climb::{Added, Climb};
    pub(crate) use super::search::levels::{printed as level, variations as at_other_levels};
    pub(crate) use super::search::next::within;
    pub use super::search::refit::{Bench, cost, whitened};
    pub use super::search::righted::{drifting, phased, unclipped};
    pub use super::search::score::{Score, score};
    pub use super::settings::Settings;
}
