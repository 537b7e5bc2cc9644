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
//! Quantities are written with their units and turned into SI where they are read:
//!
//! ```
//! use misfit::units::{self, Dimension};
//! assert_eq!(units::parse("20 N/mm", Dimension::STIFFNESS).unwrap(), 20e3);
//! let k = units::parse("1490 N mm/deg", Dimension::ROTATIONAL_STIFFNESS).unwrap();
//! assert!((k - 1.49_f64.to_degrees()).abs() < 1e-12);
//! assert!(units::parse("20 mm", Dimension::FORCE).is_err());
//! ```
//!
//! The modules stand in the order of the flow; a file imports only from modules above its own (`tests` checks it).

pub use misfit_core::{
    data, diagnose, effect, engine, evidence, explain, identify, limits, model, parallel, predict, residual, response, simulate, study,
    tolerance, trial, units,
};

pub mod report;
pub mod export;
pub mod campaign;
pub mod work;
pub mod serve;
pub mod cli;

/// What a program needs that fits and diagnoses studies ([`Study::load`](study::Study::load)) or a model of its own
/// ([`Case::of`](diagnose::Case::of)), with laws of its own ([`register_force`](effect::register_force)). `examples/` has one program for each.
pub mod prelude {
    pub use num_complex::{Complex, Complex64};

    pub use crate::data::{Channel, Control, FrfQuantity, Role, Test};
    pub use crate::diagnose::results::{FitResult, LadderResult, SplitName, Verdict};
    pub use crate::diagnose::{Case, Fitted, compare, diagnose, fit, ladder};
    pub use crate::effect::{Dim, Force, Grid, Info, Inputs, Num, Param, Ports, Sign, find, register_force};
    pub use crate::explain::Explain;
    pub use crate::identify::Monitor;
    pub use crate::model::{Axis, Body, Model, System};
    pub use crate::predict::predictions;
    pub use crate::study::Study;
}
