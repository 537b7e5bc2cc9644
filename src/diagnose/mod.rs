//! From misfit to missing physics: fit a case, see where it fails, search what explains it, prove it, and climb.

mod accept;
mod candidates;
mod case;
mod error;
mod factors;
mod findings;
mod ladder;
mod next;
mod nuisance;
mod refit;
pub mod results;
mod score;
mod search;
mod simplify;
mod trace;

pub use case::{Case, Fitted, Search, compare, fit};
pub use error::DiagnoseError;
pub use ladder::{diagnose, ladder};
