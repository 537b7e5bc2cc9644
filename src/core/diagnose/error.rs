//! What can go wrong in fit and diagnosis.

use crate::data::DataError;
use crate::explain::Explain;
use crate::identify::{EvalError, IdentifyError};
use crate::model::ModelError;
use crate::response::ResponseError;

/// Errors of the diagnose stage.
#[derive(Debug, thiserror::Error)]
pub enum DiagnoseError {
    /// Measurements that no model can have been measured with.
    #[error(transparent)]
    Data(#[from] DataError),
    /// From the response stage.
    #[error(transparent)]
    Response(#[from] ResponseError),
    /// From the identification.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// From the model.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl DiagnoseError {
    /// A model that cannot be computed where it begins.
    pub fn start_fails(reason: impl Into<String>) -> DiagnoseError {
        IdentifyError::StartFails(EvalError::new(reason)).into()
    }

    fn inner(&self) -> &dyn Explain {
        match self {
            DiagnoseError::Data(e) => e,
            DiagnoseError::Response(e) => e,
            DiagnoseError::Identify(e) => e,
            DiagnoseError::Model(e) => e,
        }
    }
}

impl Explain for DiagnoseError {
    fn stage(&self) -> &'static str {
        self.inner().stage()
    }
    fn place(&self) -> String {
        self.inner().place()
    }
    fn accepted(&self) -> String {
        self.inner().accepted()
    }
}
