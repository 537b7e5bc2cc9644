//! When a fit ends, why it ended, and its history.

use serde::{Deserialize, Serialize};

/// Which test was met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Convergence {
    Gradient,
    Step,
    Cost,
    /// the residual vanished, to rounding
    ZeroResidual,
}

/// Why a fit ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind", content = "detail")]
pub enum Termination {
    Converged(Convergence),
    /// no step lowers the cost, though the linear model promises one, or many do by next to nothing: noise in the model, a kink, or a jump
    Stalled,
    MaxIterations,
    /// cancelled or out of time; the outcome is the best state so far
    Interrupted,
    /// no step could be evaluated at all; the outcome is the last state that could
    Failed(String),
}

impl Termination {
    pub fn is_converged(&self) -> bool {
        matches!(self, Self::Converged(_))
    }

    /// converged, stalled, max_iterations, interrupted or failed
    pub fn name(&self) -> &'static str {
        match self {
            Self::Converged(_) => "converged",
            Self::Stalled => "stalled",
            Self::MaxIterations => "max_iterations",
            Self::Interrupted => "interrupted",
            Self::Failed(_) => "failed",
        }
    }
}

/// One line of the fit's history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LogEntry {
    pub iteration: u64,
    pub event: Event,
    /// cost before the event's step
    pub cost: f64,
    pub lambda: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// step taken, with its gain ratio (achieved / predicted drop)
    Accepted {
        ratio: f64,
        relative_step: f64,
    },
    /// step damped and tried again
    Rejected {
        reason: String,
    },
    /// a parameter that moves no residual is held still
    Held {
        name: String,
    },
    /// checkpoint could not be written; the fit goes on
    CheckpointFailed {
        reason: String,
    },
    Ended {
        reason: String,
    },
}

/// Relative tolerances and limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    pub f_tol: f64,
    pub x_tol: f64,
    pub g_tol: f64,
    /// fall of the cost, in its own unit, that is worth no step; 0: none
    pub drop: f64,
    pub max_iterations: u64,
    /// first damping, in units of the squared column norms
    pub lambda: f64,
    /// geodesic acceleration: one more residual evaluation per long step, many fewer iterations in curved valleys
    pub acceleration: bool,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self { f_tol: 1e-15, x_tol: 1e-10, g_tol: 1e-9, drop: 0.0, max_iterations: 1000, lambda: 1e-3, acceleration: true }
    }
}
