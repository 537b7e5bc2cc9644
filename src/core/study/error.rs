//! What can be wrong with a study, and where.

use std::fmt;
use std::path::PathBuf;

use crate::data::DataError;
use crate::data::toml_strict::{TomlError, ValueView};
use crate::explain::Explain;
use crate::identify::IdentifyError;
use crate::model::ModelError;

/// An error of the stage `study`, or of an earlier stage whose work the study asked for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// Something in study.toml, with file, line and key.
    #[error(transparent)]
    Toml(#[from] TomlError),
    /// The dataset cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A test of the dataset that does not fit the study's model.
    #[error("{0}")]
    Test(Box<TestProblem>),
    /// A system that cannot be, or a name that is not there, outside of any file (command line, program).
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Bounds and orders that no point satisfies.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The file cannot be written; it was left as it was.
    #[error("study.toml was not written: {reason}")]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
        /// What would be accepted.
        accepted: String,
    },
}

/// A test that does not fit the model.
#[derive(Debug, Clone, PartialEq)]
pub struct TestProblem {
    /// dataset.toml.
    pub file: PathBuf,
    /// Line of the test in it.
    pub line: usize,
    /// Id of the test.
    pub test: String,
    /// Channel, condition or key it is about.
    pub about: String,
    /// What is wrong.
    pub message: String,
    /// What would be accepted.
    pub accepted: String,
}

impl fmt::Display for TestProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "test `{}`, {}: {}", self.test, self.about, self.message)
    }
}

impl From<TestProblem> for StudyError {
    fn from(problem: TestProblem) -> Self {
        StudyError::Test(Box::new(problem))
    }
}

impl Explain for StudyError {
    fn stage(&self) -> &'static str {
        match self {
            StudyError::Toml(e) => e.stage(),
            StudyError::Data(e) => e.stage(),
            StudyError::Model(e) => e.stage(),
            StudyError::Identify(e) => e.stage(),
            StudyError::Test(_) | StudyError::Write { .. } => "study",
        }
    }
    fn place(&self) -> String {
        match self {
            StudyError::Toml(e) => e.place(),
            StudyError::Data(e) => e.place(),
            StudyError::Model(e) => e.place(),
            StudyError::Identify(e) => e.place(),
            StudyError::Test(t) => format!("{}, line {}, test {}, {}", t.file.display(), t.line, t.test, t.about),
            StudyError::Write { file, .. } => file.display().to_string(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            StudyError::Toml(e) => e.accepted(),
            StudyError::Data(e) => e.accepted(),
            StudyError::Model(e) => e.accepted(),
            StudyError::Identify(e) => e.accepted(),
            StudyError::Test(t) => t.accepted.clone(),
            StudyError::Write { accepted, .. } => accepted.clone(),
        }
    }
}

/// An error of an earlier stage about what stands at `value` of study.toml.
pub(super) fn at(value: &ValueView<'_>, e: &impl Explain) -> TomlError {
    value.refuse(e.to_string(), e.accepted())
}
