//! From misfit to missing physics: fit a case, see where it fails, search what explains it, prove it, and climb.

mod case;
mod error;
pub mod results;

pub use case::{Case, Fitted, Search, compare, fit};
pub use error::DiagnoseError;
