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
            EffectError::Unknown { name, .. } => name.clone(),
            EffectError::NoSmallSignal { name, .. } => (*name).into(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            EffectError::Unknown { .. } => {
                format!("one of: {}", super::LIBRARY.iter().map(|e| e.info().name).collect::<Vec<_>>().join(", "))
            }
            EffectError::NoSmallSignal { remedy, .. } => (*remedy).into(),
        }
    }
}
