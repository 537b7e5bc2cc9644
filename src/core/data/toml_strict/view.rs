//! Typed access to the tree.

use super::error::{TomlError, TomlProblem, misspelt, nearest};
use super::tree::{Node, Table, TomlFile, Value, quoted_key};
use crate::limits::MAGNITUDE;
use crate::units::{self, Dimension, Quantity, Spread, Unit};

/// A table of the file, with its place.
#[derive(Clone, Debug)]
pub struct TableView<'a> {
    file: &'a TomlFile,
    table: &'a Table,
    line: usize,
    path: String,
}

/// A value of the file, with its place.
#[derive(Clone, Debug)]
pub struct ValueView<'a> {
    file: &'a TomlFile,
    node: &'a Node,
    path: String,
}

impl<'a> TableView<'a> {
    pub(super) fn root(file: &'a TomlFile) -> Self {
        Self { file, table: &file.root, line: 1, path: String::new() }
    }

    /// Line, from 1, where the table begins.
    pub fn line(&self) -> usize {
        self.line
    }

    /// Key path of the table; empty at the root.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The keys, in the order of the file.
    pub fn keys(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.table.entries.iter().map(|e| e.0.as_str())
    }

    /// An error about this table.
    pub fn error(&self, problem: TomlProblem) -> TomlError {
        error(self.file, self.line, &self.path, problem)
    }

    /// An error about this table with a message and what would be accepted.
    pub fn refuse(&self, message: impl Into<String>, accepted: impl Into<String>) -> TomlError {
        self.error(TomlProblem::Value { message: message.into(), accepted: accepted.into() })
    }

    /// The table as the text of a `[[key]]`.
    pub fn to_toml(&self, key: &str) -> String {
        let lines = self.table.entries.iter().map(|(key, _, node)| format!("{} = {}\n", quoted_key(key), node.value.to_toml()));
        format!("[[{key}]]\n{}", lines.collect::<String>())
    }

    fn key_path(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_string() } else { format!("{}.{key}", self.path) }
    }

    /// Refuses any key that is not in `accepted`, naming the nearest.
    pub fn only(&self, accepted: &[&str]) -> Result<(), TomlError> {
        let Some((key, line, _)) = self.table.entries.iter().find(|e| !accepted.contains(&e.0.as_str())) else { return Ok(()) };
        let problem = TomlProblem::UnknownKey {
            key: key.clone(),
            nearest: nearest(key, accepted.iter().copied()),
            accepted: accepted.iter().map(|a| a.to_string()).collect(),
        };
        Err(error(self.file, *line, &self.key_path(key), problem))
    }

    /// Whether the key stands there.
    pub fn has(&self, key: &str) -> bool {
        self.table.entries.iter().any(|e| e.0 == key)
    }

    /// The value of a key, if it stands there.
    pub fn get(&self, key: &str) -> Option<ValueView<'a>> {
        let (_, _, node) = self.table.entries.iter().find(|e| e.0 == key)?;
        Some(ValueView { file: self.file, node, path: self.key_path(key) })
    }

    /// The value of a required key; `accepted` says what should stand there, for the error.
    /// A key that was meant to be it and is misspelt is named as such, not as missing.
    pub fn require(&self, key: &str, accepted: &str) -> Result<ValueView<'a>, TomlError> {
        let missing = || {
            if let Some((found, line, _)) = self.table.entries.iter().find(|e| misspelt(&e.0, key)) {
                let problem =
                    TomlProblem::UnknownKey { key: found.clone(), nearest: Some(key.to_string()), accepted: vec![key.to_string()] };
                return error(self.file, *line, &self.key_path(found), problem);
            }
            self.error(TomlProblem::MissingKey { key: key.to_string(), accepted: format!("{key} = {accepted}") })
        };
        self.get(key).ok_or_else(missing)
    }

    /// A required string.
    pub fn string(&self, key: &str) -> Result<&'a str, TomlError> {
        self.require(key, "a string")?.string()
    }

    /// A required quantity, in SI.
    pub fn quantity(&self, key: &str, dimension: Dimension) -> Result<Quantity, TomlError> {
        self.require(key, &format!("a quantity of {} ({})", dimension.name(), dimension.examples()))?.quantity(dimension)
    }

    /// Reads an optional key with one of the getters of [`ValueView`]: `t.optional("fixed", |v| v.bool())`.
    pub fn optional<T>(&self, key: &str, read: impl FnOnce(ValueView<'a>) -> Result<T, TomlError>) -> Result<Option<T>, TomlError> {
        self.get(key).map(read).transpose()
    }

    /// The tables of a list of tables (`[[test]]`, or an inline list); empty when the key is not there.
    pub fn tables(&self, key: &str) -> Result<Vec<TableView<'a>>, TomlError> {
        self.get(key).map_or(Ok(Vec::new()), |v| v.list()?.into_iter().map(|v| v.table()).collect())
    }

    /// Every entry in the order of the file.
    pub fn entries(&self) -> impl Iterator<Item = (&'a str, ValueView<'a>)> + '_ {
        self.table.entries.iter().map(|(key, _, node)| (key.as_str(), ValueView { file: self.file, node, path: self.key_path(key) }))
    }
}

impl<'a> ValueView<'a> {
    /// Line, from 1.
    pub fn line(&self) -> usize {
        self.node.line
    }

    /// Key path.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// An error about this value.
    pub fn error(&self, problem: TomlProblem) -> TomlError {
        error(self.file, self.node.line, &self.path, problem)
    }

    /// An error about this value with a message and what would be accepted.
    pub fn refuse(&self, message: impl Into<String>, accepted: impl Into<String>) -> TomlError {
        self.error(TomlProblem::Value { message: message.into(), accepted: accepted.into() })
    }

    /// The value as it is written in a file.
    pub fn to_toml(&self) -> String {
        self.node.value.to_toml()
    }

    fn wrong_type(&self, wanted: impl Into<String>) -> TomlError {
        self.error(TomlProblem::WrongType { found: self.node.value.describe(), wanted: wanted.into() })
    }

    /// Whether it is a string of nothing.
    pub fn is_blank(&self) -> bool {
        matches!(&self.node.value, Value::String(s) if s.trim().is_empty())
    }

    /// A string that is not empty.
    pub fn string(&self) -> Result<&'a str, TomlError> {
        match &self.node.value {
            Value::String(_) if self.is_blank() => Err(self.refuse("an empty string", "a string that is not empty")),
            Value::String(s) => Ok(s),
            _ => Err(self.wrong_type("a string")),
        }
    }

    /// A name: a string of letters, digits and `_ - . :` without spaces, at most 100 characters.
    pub fn name(&self) -> Result<&'a str, TomlError> {
        let s = self.string()?;
        let fine = s.chars().count() <= 100 && s.chars().all(|c| c.is_alphanumeric() || "_-.:".contains(c));
        if fine {
            Ok(s)
        } else {
            Err(self.refuse(format!("`{s}` is not a name"), "letters, digits and _ - . : without spaces, at most 100 of them"))
        }
    }

    /// One of a few words.
    pub fn word<T: Copy>(&self, what: &str, words: &[(&str, T)]) -> Result<T, TomlError> {
        let found = self.string()?;
        words.iter().find(|w| w.0 == found).map(|w| w.1).ok_or_else(|| {
            self.error(TomlProblem::UnknownWord {
                what: what.to_string(),
                found: found.to_string(),
                nearest: nearest(found, words.iter().map(|w| w.0)),
                accepted: words.iter().map(|w| w.0.to_string()).collect(),
            })
        })
    }

    pub fn bool(&self) -> Result<bool, TomlError> {
        match self.node.value {
            Value::Boolean(b) => Ok(b),
            _ => Err(self.wrong_type("true or false")),
        }
    }

    /// An integer from `min` to `max`.
    pub fn integer(&self, min: i64, max: i64) -> Result<i64, TomlError> {
        match self.node.value {
            Value::Integer(i) if (min..=max).contains(&i) => Ok(i),
            Value::Integer(i) => Err(self.refuse(format!("{i} is out of range"), format!("an integer from {min} to {max}"))),
            _ => Err(self.wrong_type(format!("an integer from {min} to {max}"))),
        }
    }

    /// A finite number without unit (TOML integer or float).
    pub fn number(&self) -> Result<f64, TomlError> {
        match self.node.value {
            Value::Integer(i) => Ok(i as f64),
            Value::Float(f) if f.abs() <= MAGNITUDE => Ok(f),
            Value::Float(f) if f.is_finite() => {
                Err(self.refuse(format!("{f:e} is beyond any number that is reckoned with"), format!("a number of at most {MAGNITUDE:e}")))
            }
            Value::Float(f) => Err(self.refuse(format!("{f} is not a finite number"), "a finite number")),
            _ => Err(self.wrong_type("a number")),
        }
    }

    /// A quantity: a string with a unit; a dimensionless one may be a bare TOML number.
    pub fn quantity(&self, dimension: Dimension) -> Result<Quantity, TomlError> {
        match &self.node.value {
            Value::String(s) => units::parse_quantity(s, dimension).map_err(|e| self.error(TomlProblem::Quantity(e))),
            Value::Integer(_) | Value::Float(_) if dimension.is_dimensionless() => Ok(Quantity::si(self.number()?, dimension)),
            Value::Integer(_) | Value::Float(_) => {
                let text = self.number()?.to_string();
                Err(self.error(TomlProblem::Quantity(units::UnitError::MissingUnit { text, expected: dimension })))
            }
            _ => Err(self.wrong_type(format!("a quantity of {} as a string ({})", dimension.name(), dimension.examples()))),
        }
    }

    /// A quantity that may be one of several dimensions (translation or rotation); the first that fits is taken, and errors speak of the first.
    pub fn quantity_of(&self, dimensions: &[Dimension]) -> Result<Quantity, TomlError> {
        let mut first_error = None;
        for dimension in dimensions {
            match self.quantity(*dimension) {
                Ok(q) => return Ok(q),
                Err(e) => first_error = first_error.or(Some(e)),
            }
        }
        Err(first_error.unwrap_or_else(|| self.wrong_type("a quantity")))
    }

    /// A quantity of any dimension, with its standard deviation where one is given: `"0.4 mm +- 0.02 mm"` or `{ value, sigma }`.
    pub fn spread(&self, expected: Option<Dimension>) -> Result<Spread, TomlError> {
        let quantity_error = |v: &ValueView<'_>, e| v.error(TomlProblem::Quantity(e));
        match &self.node.value {
            Value::String(s) => units::parse_spread(s, expected).map_err(|e| quantity_error(self, e)),
            Value::Integer(_) | Value::Float(_) => match expected {
                Some(d) => Ok(Spread { quantity: self.quantity(d)?, sigma: None }),
                None => Ok(Spread { quantity: Quantity::si(self.number()?, Dimension::DIMENSIONLESS), sigma: None }),
            },
            Value::Table(_) => {
                let table = self.table()?;
                table.only(&["value", "sigma"])?;
                let value = table.require("value", "a quantity such as \"0.4 mm\"")?.spread(expected)?;
                let sigma = table.optional("sigma", |v| v.deviation(&value.quantity.unit, value.quantity.value))?;
                if sigma.is_some() && value.sigma.is_some() {
                    return Err(self.refuse("the standard deviation is given twice", "sigma once"));
                }
                Ok(Spread { quantity: value.quantity, sigma: sigma.or(value.sigma) })
            }
            _ => {
                Err(self.wrong_type("a quantity such as \"0.4 mm\", \"0.4 mm +- 0.02 mm\" or { value = \"0.4 mm\", sigma = \"0.02 mm\" }"))
            }
        }
    }

    /// A standard deviation (above 0, SI) of a value that has `unit`; a percentage counts of `relative_to` (SI).
    pub fn deviation(&self, unit: &Unit, relative_to: f64) -> Result<f64, TomlError> {
        let dimension = unit.dimension;
        let sigma = match &self.node.value {
            Value::String(s) if s.trim_end().ends_with('%') && !dimension.is_dimensionless() => {
                units::parse(s, Dimension::DIMENSIONLESS).map_err(|e| self.error(TomlProblem::Quantity(e)))? * relative_to.abs()
            }
            _ => {
                let q = self.quantity(dimension)?;
                q.unit.difference_to_si(q.unit.from_si(q.value))
            }
        };
        if sigma > 0.0 {
            Ok(sigma)
        } else {
            Err(self.refuse(
                format!("a standard deviation of {} is not above 0", self.node.value.describe()),
                format!("a {} above 0 ({}), or a percentage", dimension.name(), dimension.examples()),
            ))
        }
    }

    /// A list.
    pub fn list(&self) -> Result<Vec<ValueView<'a>>, TomlError> {
        match &self.node.value {
            Value::Array(a) => {
                let view = |(i, node)| ValueView { file: self.file, node, path: format!("{}[{i}]", self.path) };
                Ok(a.iter().enumerate().map(view).collect())
            }
            _ => Err(self.wrong_type("a list")),
        }
    }

    /// A list of strings.
    pub fn strings(&self) -> Result<Vec<&'a str>, TomlError> {
        self.list()?.iter().map(|v| v.string()).collect()
    }

    /// A table.
    pub fn table(&self) -> Result<TableView<'a>, TomlError> {
        match &self.node.value {
            Value::Table(table) => Ok(TableView { file: self.file, table, line: self.node.line, path: self.path.clone() }),
            _ => Err(self.wrong_type("a table")),
        }
    }

    pub fn is_table(&self) -> bool {
        matches!(self.node.value, Value::Table(_))
    }

    pub fn is_list(&self) -> bool {
        matches!(self.node.value, Value::Array(_))
    }

    pub fn is_string(&self) -> bool {
        matches!(self.node.value, Value::String(_))
    }

    pub fn is_bool(&self) -> bool {
        matches!(self.node.value, Value::Boolean(_))
    }
}

/// Refuses a name that has stood before; `seen` keeps the names with their lines.
pub fn unique(seen: &mut Vec<(String, usize)>, what: &str, id: &str, value: &ValueView<'_>) -> Result<(), TomlError> {
    if let Some((_, first_line)) = seen.iter().find(|s| s.0 == id) {
        return Err(value.error(TomlProblem::Duplicate { what: what.to_string(), id: id.to_string(), first_line: *first_line }));
    }
    seen.push((id.to_string(), value.line()));
    Ok(())
}

fn error(file: &TomlFile, line: usize, key: &str, problem: TomlProblem) -> TomlError {
    TomlError { stage: file.stage, file: file.path.clone(), line, key: key.to_string(), problem: Box::new(problem) }
}
