//! What can go wrong in a prediction.

use crate::explain::Explain;
use crate::identify::IdentifyError;
use crate::response::ResponseError;
use crate::tolerance::ToleranceError;

/// Errors of the predict stage.
#[derive(Debug, thiserror::Error)]
pub enum PredictError {
    /// The model of a cycle.
    #[error("{0}")]
    Response(#[from] ResponseError),
    /// The uncertainty of the fit.
    #[error("{0}")]
    Identify(#[from] IdentifyError),
    /// The cases.
    #[error("{0}")]
    Tolerance(#[from] ToleranceError),
    /// A case that the model cannot compute.
    #[error("case {case}: {message}")]
    Case {
        /// Name of the case.
        case: String,
        /// What is wrong.
        message: String,
        /// What would do.
        accepted: String,
        /// File and line.
        place: String,
    },
}

impl Explain for PredictError {
    fn stage(&self) -> &'static str {
        match self {
            PredictError::Response(e) => e.stage(),
            PredictError::Identify(e) => e.stage(),
            PredictError::Tolerance(e) => e.stage(),
            PredictError::Case { .. } => "predict",
        }
    }
    fn place(&self) -> String {
        match self {
            PredictError::Response(e) => e.place(),
            PredictError::Identify(e) => e.place(),
            PredictError::Tolerance(e) => e.place(),
            PredictError::Case { place, .. } => place.clone(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            PredictError::Response(e) => e.accepted(),
            PredictError::Identify(e) => e.accepted(),
            PredictError::Tolerance(e) => e.accepted(),
            PredictError::Case { accepted, .. } => accepted.clone(),
        }
    }
}
