//! What can go wrong while a model is computed.

use crate::effect::EffectError;
use crate::explain::Explain;

use super::blocktri::BlockTriError;

/// Errors of the engines.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum EngineError {
    /// The linear system is singular or not finite.
    #[error(transparent)]
    Linear(#[from] BlockTriError),
    /// A law refuses.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// No equilibrium was found at a step.
    #[error("no equilibrium at step {step} of {steps}: the out-of-balance force stays at {residual:.2e} of the forces present")]
    NoEquilibrium {
        /// Step.
        step: usize,
        /// Steps in the march.
        steps: usize,
        /// Relative residual reached.
        residual: f64,
    },
    /// An equilibrium that is none.
    #[error("the equilibrium is not stable at step {step} of {steps} of the loading path: nothing holds `{dof}`")]
    Unstable {
        /// Step.
        step: usize,
        /// Steps of the path.
        steps: usize,
        /// Degree of freedom that moves most.
        dof: String,
    },
    /// The response grew beyond all numbers.
    #[error("the response is not finite at step {step}")]
    NotFinite {
        /// Step.
        step: usize,
    },
    /// The cycle does not repeat.
    #[error("the response does not settle into a cycle: the change per cycle stays at {change:.2e} after {cycles} cycles")]
    NotPeriodic {
        /// Relative change over the last cycle.
        change: f64,
        /// Cycles marched.
        cycles: usize,
    },
    /// The march to the steady cycle takes more than any that ends.
    #[error("no steady cycle within {most} iterations of Newton's method: {cycles} cycles of {steps} steps took {iterations}")]
    Work {
        /// Cycles marched.
        cycles: usize,
        /// Steps per cycle.
        steps: usize,
        /// Iterations that they took.
        iterations: usize,
        /// Iterations that they may take.
        most: usize,
    },
    /// Ctrl-C, or the time allowed was used up, while it was computed.
    #[error("the computation was stopped before its end")]
    GivenUp,
    /// A request that has no meaning.
    #[error("{what} is {value}")]
    Request {
        /// What was asked for.
        what: &'static str,
        /// What it is.
        value: String,
        /// What would be accepted.
        accepted: String,
    },
    /// Harmonic balance found no steady response.
    #[error(
        "no steady response found at {frequency} Hz under a force of {amplitude} N (N m about an axis), peak: the balance stays at {residual:.2e} of the displacements"
    )]
    NoHarmonicBalance {
        /// Frequency [Hz].
        frequency: f64,
        /// Force, peak [N or N m].
        amplitude: f64,
        /// Relative residual reached.
        residual: f64,
    },
    /// A nonlinear mode was not found.
    #[error("no nonlinear mode: {why}")]
    NoNonlinearMode {
        /// What failed.
        why: String,
    },
    /// An eigenvalue was not found.
    #[error("no mode of the damped structure was found near {frequency} Hz: the iteration stays at {residual:.2e}")]
    NoMode {
        /// Frequency of the undamped mode it started from [Hz].
        frequency: f64,
        /// Relative residual reached.
        residual: f64,
    },
}

impl Explain for EngineError {
    fn stage(&self) -> &'static str {
        "engine"
    }
    fn place(&self) -> String {
        match self {
            EngineError::Linear(e) => e.place(),
            EngineError::Effect(e) => e.place(),
            EngineError::NoEquilibrium { step, .. } | EngineError::NotFinite { step } => format!("step {step}"),
            EngineError::Unstable { step, dof, .. } => format!("step {step}, {dof}"),
            EngineError::NotPeriodic { .. } | EngineError::Work { .. } => "cycle".into(),
            EngineError::GivenUp => "time".into(),
            EngineError::Request { what, .. } => (*what).into(),
            EngineError::NoNonlinearMode { .. } => "amplitude of the nonlinear mode".into(),
            EngineError::NoHarmonicBalance { frequency, .. } | EngineError::NoMode { frequency, .. } => format!("{frequency} Hz"),
        }
    }
    fn accepted(&self) -> String {
        match self {
            EngineError::Linear(e) => e.accepted(),
            EngineError::Effect(e) => e.accepted(),
            EngineError::NoEquilibrium { .. } | EngineError::NotFinite { .. } => {
                "parameters for which the structure stands: positive stiffness along every path, softening within its range".into()
            }
            EngineError::Unstable { .. } => {
                "a load below buckling, supports that stay closed under it, and a force effect along every direction that is free".into()
            }
            EngineError::Request { accepted, .. } => accepted.clone(),
            EngineError::NoHarmonicBalance { .. } => {
                "a structure with damping, an excitation at which it has a steady response, more harmonics or samples for stiff friction"
                    .into()
            }
            EngineError::NoNonlinearMode { .. } => {
                "a place that moves in the mode, damping below critical at every amplitude, amplitudes at which the laws hold the structure"
                    .into()
            }
            EngineError::NoMode { .. } => "laws whose stiffness varies slowly with frequency around the mode, or a narrower band".into(),
            EngineError::NotPeriodic { .. } => "a stable structure with damping".into(),
            EngineError::Work { .. } => {
                "a structure whose steps take a few iterations each: sections, stiffness and masses of like size, a load within its range"
                    .into()
            }
            EngineError::GivenUp => "more time (--max-seconds)".into(),
        }
    }
}
