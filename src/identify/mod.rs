//! Identification: constrained nonlinear least squares on whitened residuals, and what can be said of its answer.
//!
//! minimise 1/2 ||r(p)||^2 + priors, subject to bounds, orders and linear rows. The stage knows nothing of physics: anything that
//! implements [`LeastSquares`] can be identified.
//!
//! - [`fit()`]: constrained Levenberg-Marquardt ([`lm`])
//! - [`Monitor`]: progress, interruption, deadline, checkpoint

mod constraints;
mod error;
mod feasibility;
mod fit;
mod linalg;
pub mod lm;
mod monitor;
mod problem;
mod qp;
mod step;
pub mod nist;

pub use constraints::{Constraints, LinearRow, Order};
pub use error::{EvalError, IdentifyError};
pub use fit::{ActiveConstraint, FitOptions, FitOutcome, fit};
pub use lm::{Convergence, Event, LogEntry, Termination, Tolerances};
pub use monitor::{Checkpoint, CheckpointFile, Monitor, Progress, interrupt_flag};
pub use problem::{LeastSquares, Loss, LossBlock, Prior};
