//! What can be wrong with a table of tolerance cases.

use crate::explain::Explain;

/// Errors of the tolerance stage.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ToleranceError {
    /// A row without a quantity, or with one of another dimension.
    #[error("case {case}: {message}")]
    Row {
        /// File and line.
        place: String,
        /// Name of the case.
        case: String,
        /// What is wrong.
        message: String,
        /// What would do.
        accepted: String,
    },
    /// Too few cases for what is asked.
    #[error("{what} with {found} cases")]
    TooFew {
        /// What is asked.
        what: String,
        /// Cases there are.
        found: usize,
        /// Cases needed.
        needed: usize,
    },
    /// Something that `[tolerance]` asks for and that cannot be.
    #[error("{message}")]
    Asked {
        /// Key of `[tolerance]`.
        key: String,
        /// What is wrong.
        message: String,
        /// What would do.
        accepted: String,
    },
}

impl Explain for ToleranceError {
    fn stage(&self) -> &'static str {
        "tolerance"
    }
    fn place(&self) -> String {
        match self {
            ToleranceError::Row { place, .. } => place.clone(),
            ToleranceError::TooFew { .. } => "tolerance".into(),
            ToleranceError::Asked { key, .. } => format!("tolerance.{key}"),
        }
    }
    fn accepted(&self) -> String {
        match self {
            ToleranceError::Row { accepted, .. } | ToleranceError::Asked { accepted, .. } => accepted.clone(),
            ToleranceError::TooFew { needed, .. } => format!("{needed} cases or more"),
        }
    }
}
