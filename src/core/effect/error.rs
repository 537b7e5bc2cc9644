//! What can go wrong with an effect.

use crate::explain::Explain;

/// Errors of the effect library.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum EffectError {
    /// No effect of this name.
    #[error("there is no effect `{name}`; the nearest is `{nearest}`")]
    Unknown {
        /// Name asked for.
        name: String,
        /// Nearest name in the library.
        nearest: String,
    },
    /// A law that a program registers and that no study could use.
    #[error("{message}")]
    Refused {
        /// Effect.
        name: String,
        /// What is wrong.
        message: String,
        /// What would be accepted.
        accepted: String,
    },
    /// The law has no limit at small amplitude.
    #[error("`{name}` has no small-amplitude limit")]
    NoSmallSignal {
        /// Effect.
        name: &'static str,
        /// What to do instead.
        remedy: &'static str,
    },
}

impl Explain for EffectError {
    fn stage(&self) -> &'static str {
        "effect"
    }
    fn place(&self) -> String {
        match self {
            EffectError::Unknown { name, .. } | EffectError::Refused { name, .. } => name.clone(),
            EffectError::NoSmallSignal { name, .. } => (*name).into(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            EffectError::Unknown { .. } => {
                format!("one of: {}", super::own::names().join(", "))
            }
            EffectError::Refused { accepted, .. } => accepted.clone(),
            EffectError::NoSmallSignal { remedy, .. } => (*remedy).into(),
        }
    }
}
