//! The parsed file as an owned tree, each node with its line.

use super::error::{TomlError, TomlProblem};
use super::view::TableView;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// A TOML file read and parsed.
#[derive(Debug, Clone)]
pub struct TomlFile {
    pub(super) stage: &'static str,
    pub(super) path: PathBuf,
    pub(super) text: String,
    pub(super) root: Table,
}

#[derive(Debug, Clone)]
pub(super) struct Node {
    pub line: usize,
    pub value: Value,
}

#[derive(Debug, Clone)]
pub(super) enum Value {
    String(String),
    Integer(i64),
    Float(f64),
    Boolean(bool),
    Datetime(String),
    Array(Vec<Node>),
    Table(Table),
}

#[derive(Debug, Clone, Default)]
pub(super) struct Table {
    /// Key, line of the key, value; in the order of the file.
    pub entries: Vec<(String, usize, Node)>,
}

impl Value {
    /// The value with its type, for error messages: `string "1 Hz"`.
    pub fn describe(&self) -> String {
        match self {
            Self::String(s) => format!("the string \"{}\"", clip(s)),
            Self::Integer(i) => format!("the integer {i}"),
            Self::Float(f) => format!("the number {f}"),
            Self::Boolean(b) => format!("the boolean {b}"),
            Self::Datetime(d) => format!("the date {d}"),
            Self::Array(a) => format!("a list of {}", a.len()),
            Self::Table(_) => "a table".to_string(),
        }
    }
}

impl Value {
    /// The value as it is written in a file.
    pub fn to_toml(&self) -> String {
        match self {
            Self::String(s) => toml::Value::String(s.clone()).to_string(),
            Self::Integer(i) => i.to_string(),
            Self::Float(f) => toml::Value::Float(*f).to_string(),
            Self::Boolean(b) => b.to_string(),
            Self::Datetime(d) => d.clone(),
            Self::Array(a) => format!("[{}]", a.iter().map(|n| n.value.to_toml()).collect::<Vec<_>>().join(", ")),
            Self::Table(t) => {
                let entries = t.entries.iter().map(|(key, _, n)| format!("{} = {}", quoted_key(key), n.value.to_toml()));
                format!("{{ {} }}", entries.collect::<Vec<_>>().join(", "))
            }
        }
    }
}

/// A key, in quotes where it needs them.
pub(super) fn quoted_key(key: &str) -> String {
    let bare = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { key.to_string() } else { toml::Value::String(key.to_string()).to_string() }
}

fn clip(s: &str) -> String {
    if s.chars().count() > 40 { s.chars().take(40).chain("...".chars()).collect() } else { s.to_string() }
}

impl TomlFile {
    /// Reads and parses `path`. `stage` names the stage in errors (`data`, `study`).
    pub fn read(path: &Path, stage: &'static str) -> Result<Self, TomlError> {
        let fail = |problem| TomlError { stage, file: path.to_path_buf(), line: 0, key: String::new(), problem: Box::new(problem) };
        let bytes = crate::limits::bytes(path, crate::limits::CONFIG_BYTES).map_err(|e| fail(TomlProblem::Unreadable(e.to_string())))?;
        let text = String::from_utf8(bytes).map_err(|e| {
            let line = 1 + e.as_bytes().iter().take(e.utf8_error().valid_up_to()).filter(|b| **b == b'\n').count();
            TomlError { line, ..fail(TomlProblem::Syntax("bytes that are not UTF-8".to_string())) }
        })?;
        Self::parse(path, text, stage)
    }

    /// Parses a text that came from `path`.
    pub fn parse(path: &Path, text: String, stage: &'static str) -> Result<Self, TomlError> {
        let lines = Lines::new(&text);
        let root = {
            let fail = |line, problem| TomlError { stage, file: path.to_path_buf(), line, key: String::new(), problem: Box::new(problem) };
            let body = text.strip_prefix('\u{feff}').unwrap_or(&text);
            let shift = text.len() - body.len();
            let parsed = DeTable::parse(body).map_err(|e| {
                let line = lines.of(e.span().map_or(0, |s| s.start) + shift);
                fail(line, TomlProblem::Syntax(e.message().to_string()))
            })?;
            let tree = Tree { lines: &lines, shift };
            tree.table(parsed.get_ref()).map_err(|(line, message)| fail(line, TomlProblem::Syntax(message)))?
        };
        Ok(Self { stage, path: path.to_path_buf(), text, root })
    }

    /// The file's path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file's text as read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The root table.
    pub fn root(&self) -> TableView<'_> {
        TableView::root(self)
    }
}

/// Byte offsets of line starts.
struct Lines(Vec<usize>);

impl Lines {
    fn new(text: &str) -> Self {
        Self(std::iter::once(0).chain(text.bytes().enumerate().filter(|(_, b)| *b == b'\n').map(|(i, _)| i + 1)).collect())
    }

    /// Line, from 1, of a byte offset.
    fn of(&self, offset: usize) -> usize {
        self.0.partition_point(|start| *start <= offset).max(1)
    }
}

struct Tree<'a> {
    lines: &'a Lines,
    shift: usize,
}

impl Tree<'_> {
    fn table(&self, table: &DeTable<'_>) -> Result<Table, (usize, String)> {
        let mut entries = Vec::with_capacity(table.len());
        for (key, value) in table.iter() {
            let line = self.lines.of(key.span().start + self.shift);
            let at = self.lines.of(value.span().start + self.shift);
            entries.push((key.get_ref().to_string(), line, self.node(value.get_ref(), at)?));
        }
        // The map is ordered by key; errors and lists read better in the order of the file.
        entries.sort_by_key(|e| e.1);
        Ok(Table { entries })
    }

    fn node(&self, value: &DeValue<'_>, line: usize) -> Result<Node, (usize, String)> {
        let value = match value {
            DeValue::String(s) => Value::String(s.to_string()),
            DeValue::Integer(i) => match i64::from_str_radix(i.as_str(), i.radix()) {
                Ok(i) => Value::Integer(i),
                Err(_) => return Err((line, format!("the integer {i} does not fit 64 bits"))),
            },
            DeValue::Float(f) => match f.as_str().parse::<f64>() {
                Ok(f) => Value::Float(f),
                Err(_) => return Err((line, format!("the number {f} cannot be read"))),
            },
            DeValue::Boolean(b) => Value::Boolean(*b),
            DeValue::Datetime(d) => Value::Datetime(d.to_string()),
            DeValue::Array(a) => {
                let node = |v: &toml::Spanned<DeValue<'_>>| self.node(v.get_ref(), self.lines.of(v.span().start + self.shift));
                Value::Array(a.iter().map(node).collect::<Result<_, _>>()?)
            }
            DeValue::Table(t) => Value::Table(self.table(t)?),
        };
        Ok(Node { line, value })
    }
}
