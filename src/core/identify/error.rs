//! What can go wrong before, during and after a fit.

use crate::explain::Explain;
use std::path::PathBuf;

/// The model could not be evaluated at one point of the parameter space.
///
/// At a trial step this rejects the step (it is damped and tried again); at the start it is an error of the fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{reason}")]
pub struct EvalError {
    pub reason: String,
    /// test, parameter or residual it is about; empty where it is not known
    pub place: String,
    /// what would be accepted; empty where there is no more to say than "a start that can be computed"
    pub accepted: String,
}

impl EvalError {
    pub fn new(reason: impl Into<String>) -> Self {
        Self { reason: reason.into(), place: String::new(), accepted: String::new() }
    }

    /// With the place, and what would be accepted there.
    pub fn at(place: impl Into<String>, reason: impl Into<String>, accepted: impl Into<String>) -> Self {
        Self { reason: reason.into(), place: place.into(), accepted: accepted.into() }
    }
}

/// Errors of the identification stage.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    #[error("{what}: {got} given, {expected} expected")]
    Dimension { what: String, got: usize, expected: usize },
    #[error("{what} of {name} is {value}, which is not a usable number")]
    NotFinite { what: &'static str, name: String, value: f64 },
    #[error("{name}: the lower bound {lower} lies above the upper bound {upper}")]
    BoundsCrossed { name: String, lower: f64, upper: f64 },
    #[error("{name}: the start {value} lies outside its bounds [{lower}, {upper}]")]
    StartOutsideBounds { name: String, value: f64, lower: f64, upper: f64 },
    #[error("the start violates {constraint} by {by:e}")]
    StartViolates { constraint: String, by: f64 },
    #[error("the order runs in a circle: {}", .names.join(" <= "))]
    OrderCycle { names: Vec<String> },
    #[error("no point satisfies all constraints; in conflict: {}", .constraints.join("; "))]
    Infeasible { constraints: Vec<String> },
    #[error("the model cannot be evaluated at the start: {0}")]
    StartFails(EvalError),
    #[error("checkpoint {}: {reason}", .path.display())]
    Checkpoint { path: PathBuf, reason: String },
    #[error("option {option}: {value} cannot be used")]
    Option { option: &'static str, value: String, accepted: &'static str },
    #[error("every one of {} starts failed; the first: {first}", .count)]
    AllStartsFailed { count: usize, first: String },
    #[error("linear algebra failed while {while_doing}")]
    Numerical { while_doing: &'static str },
}

impl Explain for IdentifyError {
    fn stage(&self) -> &'static str {
        "identify"
    }

    fn place(&self) -> String {
        match self {
            Self::NotFinite { name, .. } | Self::BoundsCrossed { name, .. } | Self::StartOutsideBounds { name, .. } => name.clone(),
            Self::StartViolates { constraint, .. } => constraint.clone(),
            Self::OrderCycle { names } => names.join(", "),
            Self::Infeasible { constraints } => constraints.join("; "),
            Self::Checkpoint { path, .. } => path.display().to_string(),
            Self::Option { option, .. } => (*option).to_string(),
            Self::Dimension { what, .. } => what.clone(),
            Self::StartFails(why) if !why.place.is_empty() => why.place.clone(),
            Self::StartFails(_) => "the starting values".into(),
            Self::AllStartsFailed { .. } => "fit.starts".into(),
            Self::Numerical { while_doing } => format!("the fit, {while_doing}"),
        }
    }

    fn accepted(&self) -> String {
        match self {
            Self::Dimension { expected, .. } => format!("exactly {expected} entries"),
            Self::NotFinite { what, .. } if *what == "lower bound" || *what == "upper bound" => {
                "a number, or an infinite bound for none".into()
            }
            Self::NotFinite { .. } => "a finite number".into(),
            Self::BoundsCrossed { .. } => "a lower bound not above the upper bound".into(),
            Self::StartOutsideBounds { lower, upper, .. } => format!("a start within [{lower}, {upper}]"),
            Self::StartViolates { constraint, .. } => format!("a start with {constraint}"),
            Self::OrderCycle { .. } => "an order without a circle; parameters meant to be equal are one shared parameter".into(),
            Self::Infeasible { .. } => "bounds and orders that at least one point satisfies; relax one of those named".into(),
            Self::StartFails(why) if !why.accepted.is_empty() => format!("other starting values, or {}", why.accepted),
            Self::StartFails(_) => "a start at which every test of the model can be computed and is finite".into(),
            Self::Checkpoint { .. } => "a checkpoint written by the same problem (same parameters, same number of residuals)".into(),
            Self::Option { accepted, .. } => (*accepted).to_string(),
            Self::AllStartsFailed { .. } => "at least one start at which the model can be computed".into(),
            Self::Numerical { .. } => "residuals and sensitivities of finite size".into(),
        }
    }
}
