//! What can be wrong with a model.

use crate::explain::Explain;

/// Errors of the model stage.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum ModelError {
    /// A name that is not there.
    #[error("there is no {what} `{name}`{}", nearest.as_ref().map(|n| format!("; the nearest is `{n}`")).unwrap_or_default())]
    NoSuch {
        /// Body, connector, axis, place, channel, parameter.
        what: &'static str,
        /// Name asked for.
        name: String,
        /// Nearest existing name.
        nearest: Option<String>,
        /// All existing names.
        known: Vec<String>,
    },
    /// A name that is there twice.
    #[error("the {what} `{name}` is declared twice")]
    Twice {
        /// Body or connector.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Something that cannot be.
    #[error("{message}")]
    Invalid {
        /// Body, connector, effect or parameter.
        place: String,
        /// What is wrong.
        message: String,
        /// What would be accepted.
        accepted: String,
    },
}

impl ModelError {
    /// A [`ModelError::NoSuch`] with the nearest of the known names looked up.
    pub fn no_such(what: &'static str, name: &str, known: impl IntoIterator<Item = String>) -> Self {
        let known: Vec<String> = known.into_iter().collect();
        let nearest = known
            .iter()
            .map(|k| (strsim::jaro_winkler(k, name), k))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(score, _)| *score > 0.6)
            .map(|(_, k)| k.clone());
        ModelError::NoSuch { what, name: name.into(), nearest, known }
    }
    /// A [`ModelError::Invalid`].
    pub fn invalid(place: impl Into<String>, message: impl Into<String>, accepted: impl Into<String>) -> Self {
        ModelError::Invalid { place: place.into(), message: message.into(), accepted: accepted.into() }
    }
}

impl Explain for ModelError {
    fn stage(&self) -> &'static str {
        "model"
    }
    fn place(&self) -> String {
        match self {
            ModelError::NoSuch { name, .. } | ModelError::Twice { name, .. } => name.clone(),
            ModelError::Invalid { place, .. } => place.clone(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            ModelError::NoSuch { what, known, .. } => {
                let shown = known.iter().take(40).cloned().collect::<Vec<_>>().join(", ");
                format!("{what}: one of {shown}{}", if known.len() > 40 { ", ..." } else { "" })
            }
            ModelError::Twice { what, .. } => format!("a {what} name used once"),
            ModelError::Invalid { accepted, .. } => accepted.clone(),
        }
    }
}
