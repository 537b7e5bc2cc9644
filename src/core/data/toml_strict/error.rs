//! What can be wrong in a TOML file, and where.

use crate::explain::Explain;
use crate::units::UnitError;
use std::path::PathBuf;

/// A problem in a TOML file with its place.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{problem}")]
pub struct TomlError {
    /// `data` for dataset.toml, `study` for study.toml.
    pub stage: &'static str,
    pub file: PathBuf,
    /// Line, from 1; 0 when the file could not be read at all.
    pub line: usize,
    /// The key path, e.g. `test[2].channels[0].unit`; empty for the file as a whole.
    pub key: String,
    /// Boxed: an error is small to hand on.
    pub problem: Box<TomlProblem>,
}

/// What is wrong there.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TomlProblem {
    #[error("the file cannot be read: {0}")]
    Unreadable(String),
    #[error("not valid TOML: {0}")]
    Syntax(String),
    #[error("required key `{key}` is missing")]
    MissingKey { key: String, accepted: String },
    #[error("unknown key `{key}`{}", nearest.as_ref().map_or(String::new(), |n| format!(", nearest is `{n}`")))]
    UnknownKey { key: String, nearest: Option<String>, accepted: Vec<String> },
    #[error("found {found}, where {wanted} is expected")]
    WrongType { found: String, wanted: String },
    #[error("unknown {what} `{found}`{}", nearest.as_ref().map_or(String::new(), |n| format!(", nearest is `{n}`")))]
    UnknownWord { what: String, found: String, nearest: Option<String>, accepted: Vec<String> },
    #[error("{what} `{id}` stands twice, first in line {first_line}")]
    Duplicate { what: String, id: String, first_line: usize },
    #[error("{0}")]
    Quantity(UnitError),
    #[error("{message}")]
    Value { message: String, accepted: String },
}

impl Explain for TomlError {
    fn stage(&self) -> &'static str {
        self.stage
    }

    fn place(&self) -> String {
        let mut place = self.file.display().to_string();
        if self.line > 0 {
            place += &format!(", line {}", self.line);
        }
        if !self.key.is_empty() {
            place += &format!(", key {}", self.key);
        }
        place
    }

    fn accepted(&self) -> String {
        match self.problem.as_ref() {
            TomlProblem::Unreadable(_) => "a readable UTF-8 text file".to_string(),
            TomlProblem::Syntax(_) => "TOML 1.0".to_string(),
            TomlProblem::MissingKey { accepted, .. } | TomlProblem::Value { accepted, .. } => accepted.clone(),
            TomlProblem::UnknownKey { accepted, .. } => format!("the keys {}", accepted.join(", ")),
            TomlProblem::UnknownWord { accepted, .. } => format!("one of {}", accepted.join(", ")),
            TomlProblem::WrongType { wanted, .. } => wanted.clone(),
            TomlProblem::Duplicate { what, .. } => format!("a different name for each {what}"),
            TomlProblem::Quantity(e) => e.accepted(),
        }
    }
}

/// The entry of `accepted` that is nearest to `found`, if any is near enough to be meant.
pub fn nearest<'a>(found: &str, accepted: impl IntoIterator<Item = &'a str>) -> Option<String> {
    let lower = found.to_lowercase();
    accepted
        .into_iter()
        .map(|a| (strsim::jaro_winkler(&lower, &a.to_lowercase()), strsim::damerau_levenshtein(&lower, &a.to_lowercase()), a))
        .filter(|(similar, edits, _)| *similar > 0.75 || *edits <= 1)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, _, a)| a.to_string())
}

/// Whether `found` can only be meant to be `key`: one slip of the finger away, two in a long word. Two letters are too few to tell.
pub(crate) fn misspelt(found: &str, key: &str) -> bool {
    let slips = if key.len() >= 7 { 2 } else { 1 };
    let apart = strsim::damerau_levenshtein(&found.to_lowercase(), key);
    key.len() >= 2 && found.len() >= 3 && (1..=slips).contains(&apart)
}
