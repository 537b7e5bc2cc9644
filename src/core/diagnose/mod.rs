//! From misfit to missing physics: fit a case, see where it fails, search what explains it, prove it, and climb.

mod approach;
mod candidates;
mod case;
mod chance;
mod climb;
mod compare;
mod damping;
mod error;
mod factors;
mod fault;
mod findings;
mod held_out;
mod horizon;
mod kin;
mod ladder;
mod left;
mod listed;
mod loosened;
mod map;
mod method;
mod mode_energy;
mod named;
mod nearby;
mod next;
mod own_case;
mod pairs;
mod picks;
mod plateau;
mod proposals;
mod race;
mod reason;
mod refit;
pub mod results;
mod revise;
mod revive;
mod righted;
mod score;
mod search;
mod secant;
mod selection;
mod settings;
mod slack;
mod spread;
mod states;
mod survivors;
mod trace;
mod turns;
mod unexplained;
mod verdict;
mod weigh;

pub use approach::approached;
pub use case::{Case, Fitted, Search, fit, unit_of};
pub use compare::{compare, glance};
pub use error::DiagnoseError;
pub use ladder::{diagnose, ladder, ladder_keeping};
pub use map::{Mark, map};
pub use method::{Fitting, Scoring, Telling};
pub use mode_energy::modes as mode_energies;
pub use proposals::Proposals;
pub use race::Race;
pub use reason::{Fault, Reason};
pub use settings::{STATED, Settings, Stated};
pub use slack::{Slack, deviates};
pub use unexplained::{Missed, Unexplained};

/// What tests of whole studies look into.
#[cfg(test)]
pub(crate) mod testing {
    pub use super::candidates::{Name, Scene, candidates};
    pub use super::case::begin;
    pub(crate) use super::climb::{Added, Climb};
    pub(crate) use super::next::within;
    pub use super::refit::{Bench, cost, whitened};
    pub use super::righted::{phased, unclipped};
    pub use super::score::{Score, score};
    pub use super::settings::Settings;
    pub use super::slack::{correction, given};
    pub(crate) use super::weigh::{Scale, Tied, Weighed};
}
