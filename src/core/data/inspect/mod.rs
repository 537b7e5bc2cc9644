//! What a file from a test bench holds, before anything is declared: histories, FRFs, their channels, units, sampling, cycles and bands.
//!
//! Nothing is decided for the engineer: a unit the file does not give stays empty, and what a column is has to be confirmed.

mod guess;
mod history;
mod universal;

pub use guess::guess_role;
pub use history::{Corrected, Cyclic, FoundHistory, found as history};

use super::readers::dialect::bracket;
use super::readers::{self, Column, FileKind, Wanted};
use super::uff::UffFile;
use super::{DataError, FrfQuantity, Note, Role};
use std::path::{Path, PathBuf};

/// A node of a structure, an axis at it, and whether against its direction.
pub type At = (i64, &'static str, bool);

/// A column of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundColumn {
    /// As dataset.toml names it.
    pub column: String,
    /// What it seems to be.
    pub role: Option<Role>,
    /// The unit the file gives.
    pub unit: Option<String>,
    pub values: Vec<f64>,
    /// Whether one letter is all that says what it is.
    pub guessed: bool,
    /// Node and axis where the file gives them: `(12, "z", against the axis)`.
    pub at: Option<At>,
}

/// A file and what is in it.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundFile {
    pub path: PathBuf,
    pub items: Vec<FoundItem>,
}

/// One thing in a file that can be a test, or is only said.
#[derive(Debug, Clone, PartialEq)]
pub enum FoundItem {
    History(Box<FoundHistory>),
    Frf(FoundFrf),
    Modes(FoundModes),
    /// Something that is no measurement, or none this version makes a test of.
    Other(String),
}

/// An FRF.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundFrf {
    /// Function of a universal file.
    pub record: Option<String>,
    /// Node and axis where the file gives them: `(12, "z", against the axis)`.
    pub respond: Option<At>,
    pub excite: Option<At>,
    pub quantity: Option<FrfQuantity>,
    /// Frequency, real and imaginary part (or amplitude and phase), coherence.
    pub columns: Vec<(Role, String, Option<String>)>,
    pub lines: usize,
    /// Hz
    pub band: (f64, f64),
    /// Frequency [Hz] and magnitude in the unit of the file, line by line.
    pub magnitude: Vec<(f64, f64)>,
    /// Number of averages behind the coherence; no file gives it.
    pub averages: Option<u32>,
    pub findings: Vec<String>,
}

/// Modes that somebody has identified: shapes of a universal file with their frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundModes {
    /// Frequency [Hz] and damping ratio, where the file gives one, by rising frequency.
    pub modes: Vec<(f64, Option<f64>)>,
    /// Nodes of the shapes.
    pub nodes: Vec<i64>,
}

/// Looks into a file.
pub fn inspect(path: &Path) -> Result<FoundFile, DataError> {
    let items = match FileKind::of(path)? {
        FileKind::Universal => universal::items(&UffFile::from_bytes(path, readers::bytes(path)?)?)?,
        _ => tabular(path, columns(path)?)?,
    };
    Ok(FoundFile { path: path.to_path_buf(), items })
}

/// The columns of numbers in a table, and why the others are none.
struct Table {
    columns: Vec<FoundColumn>,
    unread: Vec<(String, DataError)>,
}

fn columns(path: &Path) -> Result<Table, DataError> {
    let names = readers::names(path)?;
    let wanted = |name: &String| Wanted { name: name.clone(), text: false };
    // Most files hold numbers only; where one column does not, each is tried alone.
    let read: Vec<Result<Read, DataError>> = match readers::read(path, &names.iter().map(|n| wanted(&n.0)).collect::<Vec<_>>(), None) {
        Ok(all) => with_units(all).map(Ok).collect(),
        Err(first) => {
            let none = || DataError::NoRows { file: path.to_path_buf() };
            let alone = |n: &(String, Option<String>)| with_units(readers::read(path, &[wanted(&n.0)], None)?).next().ok_or_else(none);
            let each: Vec<_> = names.iter().map(alone).collect();
            if each.iter().all(Result::is_err) {
                return Err(first);
            }
            each
        }
    };
    let mut table = Table { columns: vec![], unread: vec![] };
    for ((column, unit), read) in names.into_iter().zip(read) {
        match read {
            // Date and time are read in seconds, whatever the header says.
            Ok((Column::Numbers(values), own)) => {
                let unit = unit.or(own);
                let (role, guessed) = (guess_role(&column, unit.as_deref()), guess::by_letter(&column, unit.as_deref()));
                table.columns.push(FoundColumn { role, column, unit, values, guessed, at: None });
            }
            Ok((Column::Text(_), _)) => {}
            Err(e) => table.unread.push((column, e)),
        }
    }
    Ok(table)
}

/// A column that was read, and the unit its file gives.
type Read = (Column, Option<String>);

/// Each column with the unit its file gives.
fn with_units(read: readers::Columns) -> impl Iterator<Item = Read> {
    let units = read.units.into_iter().chain(std::iter::repeat(None));
    read.columns.into_iter().zip(units)
}

/// The reason why a column is not read, with its place.
fn why(e: &DataError) -> String {
    match e {
        DataError::Cell { row, what, .. } => format!("{row}: {what}"),
        e => e.to_string(),
    }
}

fn tabular(path: &Path, Table { mut columns, unread }: Table) -> Result<Vec<FoundItem>, DataError> {
    // Beside the parts of an FRF, `f` is no force.
    let of = |columns: &[FoundColumn], role: Role| columns.iter().any(|c| c.role == Some(role));
    if !of(&columns, Role::Time) && !of(&columns, Role::Frequency) && (of(&columns, Role::Imag) || of(&columns, Role::Phase)) {
        let letter = |c: &&mut FoundColumn| c.guessed && c.column.eq_ignore_ascii_case("f");
        columns.iter_mut().find(letter).into_iter().for_each(|c| c.role = Some(Role::Frequency));
    }
    let has = |role: Role| columns.iter().find(|c| c.role == Some(role));
    if has(Role::Time).is_some() {
        let mut found = history::found(columns, &Corrected::default());
        // A channel with a bad cell is told; a column of text is no channel.
        let named = unread.iter().filter(|(name, _)| guess_role(name, bracket(name).as_deref()).is_some());
        found.findings.extend(named.map(|(name, e)| Note::new(name, format!("not read: {}", why(e)))));
        return Ok(vec![FoundItem::History(Box::new(found))]);
    }
    // What is called a time and cannot be read is what is wrong.
    if let Some(k) = unread.iter().position(|(name, _)| guess_role(name, bracket(name).as_deref()) == Some(Role::Time)) {
        return Err(unread.into_iter().nth(k).map_or(DataError::NoRows { file: path.to_path_buf() }, |u| u.1));
    }
    let parts = [[Role::Real, Role::Imag], [Role::Amplitude, Role::Phase]].into_iter().find(|p| p.iter().all(|r| has(*r).is_some()));
    if let (Some(f), Some(parts)) = (has(Role::Frequency), parts) {
        let band = f.values.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        let roles = [Role::Frequency].into_iter().chain(parts).chain(has(Role::Coherence).map(|_| Role::Coherence));
        let named = roles.filter_map(|r| has(r).map(|c| (r, c.column.clone(), c.unit.clone()))).collect();
        let quantity = columns.iter().find(|c| c.role == Some(parts[0])).and_then(|c| guess::quantity(c.unit.as_deref()));
        let values = parts.map(|p| has(p).map_or(&[][..], |c| &c.values));
        // Of real and imaginary part, or of amplitude and phase.
        let size = |k: usize| if parts[0] == Role::Real { values[0][k].hypot(values[1][k]) } else { values[0][k] };
        let lines = f.values.len().min(values[0].len()).min(values[1].len());
        let magnitude = (0..lines).map(|k| (f.values[k], size(k))).collect();
        let frf = FoundFrf {
            record: None,
            respond: None,
            excite: None,
            quantity,
            columns: named,
            lines: f.values.len(),
            band,
            magnitude,
            averages: None,
            findings: vec![],
        };
        return Ok(vec![FoundItem::Frf(frf)]);
    }
    let names: Vec<&str> = columns.iter().map(|c| c.column.as_str()).collect();
    Err(super::error::FileError {
        file: path.to_path_buf(),
        place: String::new(),
        message: format!(
            "neither a history (no column of time) nor an FRF (no frequency with real and imaginary part) among {}{}",
            names.join(", "),
            unread.iter().map(|(name, e)| format!("; `{name}` is not read, {}", why(e))).collect::<String>()
        ),
        accepted: "columns whose names or units say what they are, such as `time [s]`, `displacement [mm]`, `force [N]`; a file without a column of time \
                   is written into dataset.toml by hand, with `{ role = \"time\", rate = \"610.35 Hz\" }` among the channels of its test"
            .into(),
    }
    .into())
}

#[cfg(test)]
mod tests;
