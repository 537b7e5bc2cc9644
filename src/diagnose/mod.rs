//! From misfit to missing physics: fit a case, see where it fails, search what explains it, prove it, and climb.

mod accept;
mod approach;
mod candidates;
mod case;
mod damping;
mod error;
mod exchange;
mod factors;
mod findings;
mod folds;
mod horizon;
mod judge;
mod kin;
mod ladder;
mod next;
mod pair;
mod picks;
mod refit;
pub mod results;
mod score;
mod search;
mod secant;
mod selection;
mod simplify;
mod trace;
mod unexplained;

pub use approach::approached;
pub use case::{Case, Fitted, Search, compare, fit, unit_of};
pub use error::DiagnoseError;
pub use ladder::{diagnose, ladder};
pub use unexplained::{Missed, Unexplained};

/// What tests of whole studies look into.
#[cfg(test)]
pub(crate) mod testing {
    pub use super::candidates::{Scene, candidates};
    pub use super::refit::{Bench, cost, whitened};
    pub use super::score::{Score, score};
}
