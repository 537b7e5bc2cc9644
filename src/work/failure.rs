//! An error of any stage on its way to a person or a script.

use std::fmt;
use std::io::Write;

use serde_json::{Value, json};

use crate::explain::Explain;

use super::terminal::plain;

/// What could not be done, where, and what would be accepted.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    stage: String,
    place: String,
    message: String,
    accepted: String,
}

impl Failure {
    pub fn new(stage: &str, place: impl Into<String>, message: impl Into<String>, accepted: impl Into<String>) -> Self {
        Failure { stage: stage.into(), place: place.into(), message: message.into(), accepted: accepted.into() }
    }

    /// `{error: {stage, where, message, accepted}}`.
    pub fn json(&self) -> Value {
        json!({ "error": { "stage": self.stage, "where": self.place, "message": self.message, "accepted": self.accepted } })
    }

    /// `{where, message}` of the verb `check`, with what would be accepted.
    pub fn problem(&self) -> Value {
        json!({ "stage": self.stage, "where": self.place, "message": self.message, "accepted": self.accepted })
    }

    /// The same where the block of this kind that was the n-th when it was read is the m-th of the file: `key test[n].id`.
    pub fn counted(mut self, kind: &str, n: usize, m: usize) -> Self {
        self.place = self.place.replace(&format!(", key {kind}[{n}]"), &format!(", key {kind}[{m}]"));
        self
    }

    pub fn place(&self) -> &str {
        &self.place
    }
    pub fn message(&self) -> &str {
        &self.message
    }
    pub fn accepted(&self) -> &str {
        &self.accepted
    }

    /// On stderr, for people.
    pub fn tell(&self) {
        let label = |text: &str| console::style(text.to_string()).for_stderr().bold();
        // Where nobody can read it, the exit code says it still.
        let mut stderr = std::io::stderr();
        let _ = writeln!(stderr, "{} {}", label(&format!("error[{}]:", self.stage)).red(), plain(&self.message));
        for (name, text) in [("where", &self.place), ("accepted", &self.accepted)].iter().filter(|(_, text)| !text.is_empty()) {
            let _ = writeln!(stderr, "  {} {}", label(&format!("{name}:")), plain(text));
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.place.is_empty() { write!(f, "{}", self.message) } else { write!(f, "{}\nwhere: {}", self.message, self.place) }
    }
}

impl std::error::Error for Failure {}

impl<E: Explain> From<E> for Failure {
    fn from(e: E) -> Self {
        Failure::new(e.stage(), e.place(), e.to_string(), e.accepted())
    }
}
