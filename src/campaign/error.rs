//! What can be wrong with a campaign.

use std::path::PathBuf;

use crate::data::toml_strict::TomlError;
use crate::explain::Explain;

/// Errors of the campaign stage.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// campaign.toml.
    #[error(transparent)]
    Toml(#[from] TomlError),
    /// A file that cannot be written or read.
    #[error("{} cannot be used: {reason}", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The folder of the results.
    #[error("{message}")]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is wrong.
        message: String,
        /// What would do.
        accepted: String,
    },
    /// The scheduler.
    #[error("{command} failed: {reason}")]
    Scheduler {
        /// Command that failed.
        command: String,
        /// What it said.
        reason: String,
    },
}

impl CampaignError {
    /// An error of a file.
    pub(super) fn file(path: &std::path::Path, reason: impl ToString) -> CampaignError {
        CampaignError::File { path: path.to_path_buf(), reason: reason.to_string() }
    }
}

impl Explain for CampaignError {
    fn stage(&self) -> &'static str {
        "campaign"
    }
    fn place(&self) -> String {
        match self {
            CampaignError::Toml(e) => e.place(),
            CampaignError::File { path, .. } | CampaignError::Folder { path, .. } => path.display().to_string(),
            CampaignError::Scheduler { command, .. } => command.clone(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            CampaignError::Toml(e) => e.accepted(),
            CampaignError::File { .. } => "a file that can be read and written".into(),
            CampaignError::Folder { accepted, .. } => accepted.clone(),
            CampaignError::Scheduler { .. } => "a Slurm installation that takes jobs (`sinfo` says), or --on local".into(),
        }
    }
}
