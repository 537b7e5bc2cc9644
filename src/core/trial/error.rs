//! What can go wrong in a trial.

use std::path::PathBuf;

use crate::explain::Explain;
use crate::study::StudyError;

/// Errors of a trial itself; a case that the search cannot do is a result.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// A file or folder that cannot be written.
    #[error("{} cannot be written: {reason}", .path.display())]
    Write {
        /// File or folder.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The file of finished cases cannot be gone on from.
    #[error("{}{}: {reason}", .path.display(), .line.map_or(String::new(), |l| format!(", line {l}")))]
    Resume {
        /// The file.
        path: PathBuf,
        /// Line.
        line: Option<usize>,
        /// Why.
        reason: String,
        /// What would do.
        accepted: String,
    },
    /// No thread to run cases on.
    #[error("a thread cannot be started: {reason}")]
    Threads {
        /// Why.
        reason: String,
    },
    /// The generated study is no study: an error of the generator.
    #[error(transparent)]
    Study(#[from] StudyError),
}

impl Explain for TrialError {
    fn stage(&self) -> &'static str {
        "trial"
    }
    fn place(&self) -> String {
        match self {
            TrialError::Write { path, .. } => path.display().to_string(),
            TrialError::Resume { path, line, .. } => line.map_or(path.display().to_string(), |l| format!("{}:{l}", path.display())),
            TrialError::Threads { .. } => "--threads".into(),
            TrialError::Study(e) => e.place(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            TrialError::Write { .. } => "a folder that can be written".into(),
            TrialError::Resume { accepted, .. } => accepted.clone(),
            TrialError::Threads { .. } => "a number of threads the machine can start".into(),
            TrialError::Study(e) => e.accepted(),
        }
    }
}
