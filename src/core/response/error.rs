//! What can go wrong between a test and a model.

use crate::data::DataError;
use crate::engine::EngineError;
use crate::explain::Explain;
use crate::model::ModelError;

/// Errors of the response stage.
#[derive(Debug, thiserror::Error)]
pub enum ResponseError {
    /// The record is of no use.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The test names something the model does not have.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The engine failed on a test.
    #[error("test `{test}`: {source}")]
    Engine {
        /// Test.
        test: String,
        /// Cause.
        source: EngineError,
    },
    /// The test cannot be computed on this model.
    #[error("test `{test}`: {message}")]
    Invalid {
        /// Test.
        test: String,
        /// What is wrong.
        message: String,
        /// What would be accepted.
        accepted: String,
    },
}

impl ResponseError {
    /// A [`ResponseError::Invalid`].
    pub fn invalid(test: &str, message: impl Into<String>, accepted: impl Into<String>) -> Self {
        ResponseError::Invalid { test: test.into(), message: message.into(), accepted: accepted.into() }
    }
}

impl Explain for ResponseError {
    fn stage(&self) -> &'static str {
        match self {
            ResponseError::Data(e) => e.stage(),
            ResponseError::Model(e) => e.stage(),
            ResponseError::Engine { source, .. } => source.stage(),
            ResponseError::Invalid { .. } => "response",
        }
    }
    fn place(&self) -> String {
        match self {
            ResponseError::Data(e) => e.place(),
            ResponseError::Model(e) => e.place(),
            ResponseError::Engine { test, source } if source.place().is_empty() => test.clone(),
            ResponseError::Engine { test, source } => format!("{test}: {}", source.place()),
            ResponseError::Invalid { test, .. } => test.clone(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            ResponseError::Data(e) => e.accepted(),
            ResponseError::Model(e) => e.accepted(),
            ResponseError::Engine { source, .. } => source.accepted(),
            ResponseError::Invalid { accepted, .. } => accepted.clone(),
        }
    }
}
