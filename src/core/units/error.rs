//! What can be wrong with a quantity.

use super::Dimension;
use crate::explain::Explain;

/// Why a text is not the quantity or unit that is expected there.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UnitError {
    #[error("empty where a quantity is expected")]
    Empty { expected: Option<Dimension> },
    #[error("`{text}` is longer than {limit} characters")]
    TooLong { text: String, limit: usize },
    #[error("`{text}` does not begin with a number")]
    NoNumber { text: String, expected: Option<Dimension> },
    #[error("`{text}` is written with a decimal comma")]
    DecimalComma { text: String },
    #[error("`{text}` is not a finite number, or beyond any that is reckoned with")]
    NotFinite { text: String },
    #[error("unknown unit `{symbol}` in `{text}`{}", nearest.as_ref().map_or(String::new(), |n| format!(", nearest is `{n}`")))]
    UnknownUnit { text: String, symbol: String, nearest: Option<String>, expected: Option<Dimension> },
    #[error("`{text}`: {what}")]
    Syntax { text: String, what: String, expected: Option<Dimension> },
    #[error("`{text}` is {} ({found}), where {} is expected", with_article(&found.name()), with_article(&expected.name()))]
    WrongDimension { text: String, found: Dimension, expected: Dimension },
    #[error("`{text}` has no unit, where {} is expected", with_article(&expected.name()))]
    MissingUnit { text: String, expected: Dimension },
    #[error("`{text}`: {what}")]
    Spread { text: String, what: String },
}

impl Explain for UnitError {
    fn stage(&self) -> &'static str {
        "units"
    }

    fn place(&self) -> String {
        match self {
            Self::Empty { .. } => String::new(),
            Self::TooLong { text, .. }
            | Self::NoNumber { text, .. }
            | Self::DecimalComma { text }
            | Self::NotFinite { text }
            | Self::UnknownUnit { text, .. }
            | Self::Syntax { text, .. }
            | Self::WrongDimension { text, .. }
            | Self::MissingUnit { text, .. }
            | Self::Spread { text, .. } => format!("`{text}`"),
        }
    }

    fn accepted(&self) -> String {
        let any = "a number and a unit, such as \"20 N/mm\"".to_string();
        let of = |d: &Dimension| {
            if d.is_dimensionless() {
                "a number, or a number in 1, %, -".to_string()
            } else {
                format!("a number and a unit of {}: {}", d.name(), d.examples())
            }
        };
        match self {
            Self::Empty { expected }
            | Self::NoNumber { expected, .. }
            | Self::UnknownUnit { expected, .. }
            | Self::Syntax { expected, .. } => expected.as_ref().map_or(any, of),
            Self::WrongDimension { expected, .. } | Self::MissingUnit { expected, .. } => of(expected),
            Self::TooLong { limit, .. } => format!("at most {limit} characters"),
            Self::DecimalComma { .. } => "a decimal point, such as \"0.5 mm\"".to_string(),
            Self::NotFinite { .. } => format!("a finite number of at most {:e} in SI", crate::limits::MAGNITUDE),
            Self::Spread { .. } => "a value with a standard deviation, such as \"0.4 mm +- 0.02 mm\"".to_string(),
        }
    }
}

fn with_article(name: &str) -> String {
    let article = match name.chars().next() {
        Some('a' | 'e' | 'i' | 'o' | 'u') => "an ",
        Some(c) if c.is_lowercase() => "a ",
        _ => "",
    };
    format!("{article}{name}")
}
