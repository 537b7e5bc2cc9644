//! Identification: constrained nonlinear least squares on whitened residuals, and what can be said of its answer.
//!
//! minimise cost(p) = 1/2 ||r(p)||^2 + prior rows, subject to bounds, orders and linear rows. The stage knows nothing of physics: anything
//! that implements [`LeastSquares`] can be identified.
//!
//! | before | [`gate()`]: does every parameter move the residual, can the data be reached |
//! |---|---|
//! | the fit | [`fit()`]: constrained Levenberg-Marquardt ([`lm`]) under a [`Monitor`]; [`multi_start`] runs several |
//! | after | [`uncertainty()`]: covariance, named null space; [`profile()`]: interval of one parameter by refitting; [`bootstrap()`]: scatter of refits to resampled residuals |
//!
//! The tests score the solver against NIST's certified answers.

mod bootstrap;
mod constraints;
mod crawl;
mod ending;
mod error;
mod feasibility;
mod fit;
mod gate;
mod journal;
mod linalg;
pub mod lm;
mod monitor;
mod multi_start;
mod problem;
mod profile;
mod qp;
mod step;
#[cfg(test)]
mod tests;
mod uncertainty;

pub use bootstrap::{Replicate, Spread, bootstrap, quantile};
pub use constraints::{Constraints, LinearRow, Order};
pub use ending::{Convergence, Event, LogEntry, Termination, Tolerances};
pub use error::{EvalError, IdentifyError};
pub use fit::{ActiveConstraint, FitOptions, FitOutcome, fit, go_on};
pub use gate::{Blocking, GateParameter, GateReport, gate};
pub use journal::{Journal, Kept};
pub use monitor::{Checkpoint, CheckpointFile, Monitor, Progress, interrupt_flag};
pub use multi_start::{StartResult, latin_hypercube, multi_start};
pub use problem::{LeastSquares, Loss, LossBlock, Prior};
pub use profile::{Profile, profile};
pub(crate) use qp::Program;
pub use uncertainty::{Measure, NullCombination, ParameterUncertainty, Uncertainty, UncertaintyOptions, uncertainty};
