//! What can be wrong with a dataset, and where.

use super::toml_strict::TomlError;
use crate::explain::Explain;
use std::fmt;
use std::path::PathBuf;

/// An error of the stage `data`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DataError {
    #[error(transparent)]
    Toml(#[from] TomlError),
    #[error("test `{test}`: the file {} is not there{}", tried.display(), if *overridden { " (the data folder was given on the command line)" } else { "" })]
    MissingFile { test: String, tried: PathBuf, overridden: bool },
    #[error("the file cannot be read: {reason}")]
    Unreadable { file: PathBuf, reason: String },
    #[error("files that end in `{extension}` have no reader")]
    NoReader { file: PathBuf, extension: String },
    #[error("bytes that are not UTF-8")]
    NotText { file: PathBuf, line: usize },
    #[error("the file is empty")]
    Empty { file: PathBuf },
    #[error("the file has a header and no rows")]
    NoRows { file: PathBuf },
    #[error("no column `{column}`{}; the file has {}", nearest.as_ref().map_or(String::new(), |n| format!(", nearest is `{n}`")), list(columns))]
    MissingColumn { file: PathBuf, column: String, nearest: Option<String>, columns: Vec<String> },
    #[error("column `{column}` stands twice in the header")]
    DoubleColumn { file: PathBuf, column: String },
    #[error("{}{found} cells, where the header has {wanted}", if *last { "the file stops in the middle of a row: " } else { "" })]
    Ragged { file: PathBuf, line: usize, found: usize, wanted: usize, last: bool },
    #[error("a blank line between rows")]
    BlankLine { file: PathBuf, line: usize },
    #[error("column `{column}`: {what}")]
    Cell { file: PathBuf, row: String, column: String, what: String },
    #[error("{reason}")]
    Format { file: PathBuf, reason: String },
    #[error("{0}")]
    Content(Box<Content>),
    #[error("{0}")]
    File(Box<FileError>),
}

/// What is wrong inside a file of a format with places of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct FileError {
    pub file: PathBuf,
    /// `line 14, set 58 (the 2nd of the file)`.
    pub place: String,
    pub message: String,
    pub accepted: String,
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<FileError> for DataError {
    fn from(e: FileError) -> Self {
        Self::File(Box::new(e))
    }
}

/// What was read contradicts itself or its declaration.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    pub file: PathBuf,
    /// `line 7`, `row 6`.
    pub row: Option<String>,
    pub test: String,
    /// `force at c1.x`.
    pub channel: Option<String>,
    pub message: String,
    pub accepted: String,
}

impl fmt::Display for Content {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let channel = self.channel.as_ref().map_or(String::new(), |c| format!(", channel {c}"));
        write!(f, "test `{}`{channel}: {}", self.test, self.message)
    }
}

impl From<Content> for DataError {
    fn from(content: Content) -> Self {
        Self::Content(Box::new(content))
    }
}

fn list(columns: &[String]) -> String {
    let shown: Vec<String> = columns.iter().take(20).map(|c| format!("`{}`", c.chars().take(40).collect::<String>())).collect();
    let more = if columns.len() > 20 { format!(" and {} more", columns.len() - 20) } else { String::new() };
    shown.join(", ") + &more
}

impl Explain for DataError {
    fn stage(&self) -> &'static str {
        match self {
            Self::Toml(e) => e.stage(),
            _ => "data",
        }
    }

    fn place(&self) -> String {
        match self {
            Self::Toml(e) => e.place(),
            Self::MissingFile { test, tried, .. } => format!("{}, test {test}", tried.display()),
            Self::Unreadable { file, .. }
            | Self::NoReader { file, .. }
            | Self::Empty { file }
            | Self::NoRows { file }
            | Self::MissingColumn { file, .. }
            | Self::DoubleColumn { file, .. }
            | Self::Format { file, .. } => file.display().to_string(),
            Self::NotText { file, line } | Self::Ragged { file, line, .. } | Self::BlankLine { file, line } => {
                format!("{}, line {line}", file.display())
            }
            Self::Cell { file, row, column, .. } => format!("{}, {row}, column `{column}`", file.display()),
            Self::Content(c) => {
                let row = c.row.as_ref().map_or(String::new(), |r| format!(", {r}"));
                let channel = c.channel.as_ref().map_or(String::new(), |c| format!(", channel {c}"));
                format!("{}{row}, test {}{channel}", c.file.display(), c.test)
            }
            Self::File(e) if e.place.is_empty() => e.file.display().to_string(),
            Self::File(e) => format!("{}, {}", e.file.display(), e.place),
        }
    }

    fn accepted(&self) -> String {
        match self {
            Self::Toml(e) => e.accepted(),
            Self::MissingFile { overridden: true, .. } => "the file in the folder given by --data".into(),
            Self::MissingFile { .. } => "the file beside dataset.toml, in its `folder`, or in the folder given by --data".into(),
            Self::Unreadable { .. } => format!("a regular file that can be read, of at most {} GB", crate::limits::DATA_BYTES >> 30),
            Self::NoReader { .. } => "a file that ends in .csv, .txt, .tsv, .dat, .asc, .parquet, .uff, .unv or .mat".into(),
            Self::NotText { .. } => "UTF-8 text".into(),
            Self::Empty { .. } | Self::NoRows { .. } => "one header row, then rows of numbers".into(),
            Self::MissingColumn { columns, .. } => format!("one of {}", list(columns)),
            Self::DoubleColumn { .. } => "a different name for each column".into(),
            Self::Ragged { wanted, .. } => {
                format!("{wanted} cells in every row; decimal commas only where the separator is a semicolon or a tab")
            }
            Self::BlankLine { .. } => "rows without blank lines between them".into(),
            Self::Cell { .. } => format!("a finite number; in a column of time also {}", super::readers::STAMPS),
            Self::Format { .. } => "text with one header row over columns of numbers, or Parquet".into(),
            Self::Content(c) => c.accepted.clone(),
            Self::File(e) => e.accepted.clone(),
        }
    }
}
