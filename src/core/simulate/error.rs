//! What can go wrong on the virtual rig.

use std::path::PathBuf;

use crate::data::DataError;
use crate::diagnose::DiagnoseError;
use crate::explain::Explain;
use crate::response::ResponseError;
use crate::study::run::RunError;

/// Errors of the simulate stage.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// The study makes no case.
    #[error("{0}")]
    Case(#[from] DiagnoseError),
    /// The model of a test.
    #[error("{0}")]
    Response(#[from] ResponseError),
    /// A record that cannot be taken as a programme, or a dataset that does not read back.
    #[error("{0}")]
    Data(#[from] DataError),
    /// A file that cannot be written.
    #[error("{0}")]
    Run(#[from] RunError),
    /// The folder holds a dataset.
    #[error("a dataset is there already, and measurements are never written over")]
    Occupied {
        /// Folder.
        path: PathBuf,
    },
    /// The noise or the number of cycles is none that can be simulated.
    #[error("{what} is {value}")]
    Setting {
        /// Name of the setting.
        what: &'static str,
        /// Its value.
        value: String,
        /// What would do.
        accepted: &'static str,
    },
}

impl SimulateError {
    /// The error of an earlier stage, or stage, place and accepted of this one.
    fn inner(&self) -> Result<&dyn Explain, (&'static str, String, &'static str)> {
        match self {
            SimulateError::Case(e) => Ok(e),
            SimulateError::Response(e) => Ok(e),
            SimulateError::Data(e) => Ok(e),
            SimulateError::Run(e) => Ok(e),
            SimulateError::Occupied { path } => Err(("study", path.display().to_string(), "--out with a new folder")),
            SimulateError::Setting { what, accepted, .. } => Err(("simulate", (*what).into(), accepted)),
        }
    }
}

impl Explain for SimulateError {
    fn stage(&self) -> &'static str {
        self.inner().map_or_else(|own| own.0, |e| e.stage())
    }
    fn place(&self) -> String {
        self.inner().map_or_else(|own| own.1, |e| e.place())
    }
    fn accepted(&self) -> String {
        self.inner().map_or_else(|own| own.2.into(), |e| e.accepted())
    }
}
