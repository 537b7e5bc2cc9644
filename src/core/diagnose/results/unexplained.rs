//! What no candidate explains, as it is told.

use serde::Serialize;

/// What would explain the rest.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Unexplained {
    /// Place.
    pub at: String,
    /// The force as it was fitted: a formula, or the equation of a spline.
    pub expression: String,
    /// The `[[effect]]` to be pasted into study.toml: formula, velocity_spline or displacement_spline.
    pub formula: String,
    /// Part of the cost on the fit tests that it takes away.
    pub explains: f64,
    /// Pooled error before, on the select tests; on the fit tests where there are none.
    pub error_before: f64,
    /// The same with it.
    pub error_after: f64,
    /// The force that is missing, test by test.
    pub picture: Vec<Missed>,
}

/// The missing force along one cycle [SI].
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Missed {
    /// Test; empty for the formula over a made-up cycle of the largest motion, where no test drives the place itself.
    pub test: String,
    /// Phase [rad].
    pub phase: Vec<f64>,
    /// Relative displacement.
    pub x: Vec<f64>,
    /// Relative velocity.
    pub v: Vec<f64>,
    /// Measured less computed; empty where nobody measured it.
    pub force: Vec<f64>,
    /// The formula.
    pub formula: Vec<f64>,
}
