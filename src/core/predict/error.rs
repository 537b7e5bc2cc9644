//! What can go wrong in a prediction.

use crate::diagnose::DiagnoseError;
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
    /// The fit of a rung.
    #[error("{0}")]
    Fit(#[from] DiagnoseError),
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

impl PredictError {
    /// The error of an earlier stage, or place and accepted of this one.
    fn inner(&self) -> Result<&dyn Explain, (&str, &str)> {
        match self {
            PredictError::Response(e) => Ok(e),
            PredictError::Fit(e) => Ok(e),
            PredictError::Identify(e) => Ok(e),
            PredictError::Tolerance(e) => Ok(e),
            PredictError::Case { accepted, place, .. } => Err((place, accepted)),
        }
    }
}

impl Explain for PredictError {
    fn stage(&self) -> &'static str {
        self.inner().map_or("predict", |e| e.stage())
    }
    fn place(&self) -> String {
        self.inner().map_or_else(|own| own.0.into(), |e| e.place())
    }
    fn accepted(&self) -> String {
        self.inner().map_or_else(|own| own.1.into(), |e| e.accepted())
    }
}
