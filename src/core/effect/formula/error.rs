//! What can be wrong with a formula.

use crate::explain::Explain;

/// Errors of a formula, with the text it stands in and the character, counted from 1.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum FormulaError {
    /// It does not parse, or its dimensions do not fit.
    #[error("`{text}`, character {position}: {message}")]
    Syntax {
        /// The formula.
        text: String,
        /// Character.
        position: usize,
        /// What is wrong.
        message: String,
        /// What would be accepted.
        accepted: String,
    },
    /// It has no value somewhere.
    #[error("`{text}`, character {position}: {what} at {motion}")]
    NoValue {
        /// The formula.
        text: String,
        /// Character.
        position: usize,
        /// What is wrong.
        what: String,
        /// Where: the variables.
        motion: String,
    },
    /// It gives energy back.
    #[error(
        "`{text}` gives energy back: {given:.3e} J in a closed cycle of amplitude {amplitude:.3e} m (rad about an axis) at {frequency:.3e} Hz"
    )]
    Energy {
        /// The formula.
        text: String,
        /// Energy [J].
        given: f64,
        /// Amplitude [m or rad].
        amplitude: f64,
        /// Frequency [Hz].
        frequency: f64,
    },
    /// Its states grow without end.
    #[error(
        "`{text}` is unstable: a state grows from {before:.3e} to {after:.3e} over equal cycles of amplitude {amplitude:.3e} m (rad about an axis) at {frequency:.3e} Hz"
    )]
    Unstable {
        /// The formula.
        text: String,
        /// Size of the state in an early cycle.
        before: f64,
        /// And in a late one.
        after: f64,
        /// Amplitude [m or rad].
        amplitude: f64,
        /// Frequency [Hz].
        frequency: f64,
    },
}

impl Explain for FormulaError {
    fn stage(&self) -> &'static str {
        "effect"
    }
    fn place(&self) -> String {
        match self {
            FormulaError::Syntax { text, position, .. } | FormulaError::NoValue { text, position, .. } => {
                format!("{text}, character {position}")
            }
            FormulaError::Energy { text, .. } | FormulaError::Unstable { text, .. } => text.clone(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            FormulaError::Syntax { accepted, .. } => accepted.clone(),
            FormulaError::NoValue { .. } => "a formula with a finite value for every motion the tests show".into(),
            FormulaError::Energy { .. } => {
                "a force that opposes the motion (F is the force that holds `to` there: +k*x, +c*v); active = true for a source of energy"
                    .into()
            }
            FormulaError::Unstable { .. } => "states that return under a periodic motion, such as dz/dt = v - z/tau".into(),
        }
    }
}
