//! What can go wrong in writing a report.

use std::path::PathBuf;

use crate::explain::Explain;

/// Errors of the report stage.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The columns of a curve do not belong together.
    #[error("`{column}` has {found} values where {wanted} were expected")]
    Curve {
        /// Id of the test.
        test: String,
        /// Channel.
        label: String,
        /// Column.
        column: &'static str,
        /// Its length.
        found: usize,
        /// The length the others ask for.
        wanted: usize,
    },
    /// The file could not be written.
    #[error("{} could not be written: {source}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

impl Explain for ReportError {
    fn stage(&self) -> &'static str {
        "report"
    }
    fn place(&self) -> String {
        match self {
            ReportError::Curve { test, label, .. } => format!("test {test}, {label}"),
            ReportError::Write { file, .. } => file.display().to_string(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            ReportError::Curve { .. } => "measured, computed and sigma with one value per point (per line two, for an FRF)".into(),
            ReportError::Write { .. } => "a file in a folder that exists and may be written".into(),
        }
    }
}
