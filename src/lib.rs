//! `misfit` calibrates models of assembled flexible mechanical systems against measured hysteresis loops and frequency response
//! functions, and finds out what physics the model is missing.
//!
//! What the verbs do is library code:
//!
//! ```
//! use misfit::prelude::*;
//!
//! let study = Study::load("studies/04-interference".as_ref(), None)?;
//! let case = Case::from_study(&study, 1)?;
//! let (_, fitted, result) = fit(&case, &[SplitName::Fit, SplitName::Select], &Monitor::default())?;
//! assert_eq!(result.termination, "converged");
//! for p in &result.parameters {
//!     println!("{} = {} {}", p.name, p.value, p.unit);
//! }
//! assert_eq!(fitted.free.len(), result.n_free);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `diagnose` says where the model fails and which effects may explain it, `ladder` adds them until none earns its place.
//!
//! The modules stand in the order of the flow; a file imports only from modules above its own (`tests` checks it).

pub mod explain;
pub mod limits;
pub mod units;
pub mod parallel;
pub mod data;
pub mod effect;
pub mod model;
pub mod engine;
pub mod response;
pub mod identify;
pub mod residual;
pub mod evidence;
pub mod diagnose;
pub mod tolerance;
pub mod study;
pub mod predict;
pub mod trial;
pub mod report;
pub mod export;
pub mod campaign;
pub mod work;
pub mod serve;
pub mod cli;

/// What a program that fits and diagnoses needs.
pub mod prelude {
    pub use crate::diagnose::results::{FitResult, LadderResult, SplitName, Verdict};
    pub use crate::diagnose::{Case, Fitted, compare, diagnose, fit, ladder};
    pub use crate::effect::find;
    pub use crate::explain::Explain;
    pub use crate::identify::Monitor;
    pub use crate::model::System;
    pub use crate::study::Study;
}
