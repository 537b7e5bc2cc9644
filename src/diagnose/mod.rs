//! From misfit to missing physics: fit a case, see where it fails, search what explains it, prove it, and climb.

mod accept;
mod candidates;
mod case;
mod error;
mod exchange;
mod factors;
mod findings;
mod judge;
mod ladder;
mod next;
mod picks;
mod refit;
pub mod results;
mod score;
mod search;
mod selection;
mod simplify;
mod trace;
mod unexplained;

#[cfg(test)]
pub(crate) use candidates::{Scene, candidates};
pub use case::{Case, Fitted, Search, compare, fit, unit_of};
pub use error::DiagnoseError;
pub use ladder::{diagnose, ladder};
pub use unexplained::{Missed, Unexplained};
