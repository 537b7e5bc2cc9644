//! What a file from a test bench holds, before anything is declared: histories, FRFs, their channels, units, sampling, cycles and bands.
//!
//! Nothing is decided for the engineer: a unit the file does not give stays empty, and what a column is has to be confirmed.

mod backbone;
mod guess;
mod history;
mod universal;

pub use backbone::{BackboneColumn, FoundBackbone};
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
    /// Of a time that no column of the file holds: its samples for each second, Hz.
    pub clock: Option<f64>,
}

impl FoundColumn {
    /// The time of so many samples at a rate [Hz] that somebody has stated.
    fn clock(rate: f64, samples: usize) -> FoundColumn {
        let values = (0..samples).map(|k| k as f64 / rate).collect();
        FoundColumn {
            column: CLOCK.into(),
            role: Some(Role::Time),
            unit: Some("s".into()),
            values,
            guessed: false,
            at: None,
            clock: Some(rate),
        }
    }
}

/// What the time of a stated rate is called among the columns of a file.
const CLOCK: &str = "(stated rate)";

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
    Backbone(FoundBackbone),
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

/// Looks into a file. `rate` [Hz] is that of histories in tables without a column of time.
///
/// # Errors
/// A file that cannot be read, or holds no history, FRF or backbone.
pub fn inspect(path: &Path, rate: Option<f64>) -> Result<FoundFile, DataError> {
    let items = match FileKind::of(path)? {
        FileKind::Universal => universal::items(&UffFile::from_bytes(path, readers::bytes(path)?)?)?,
        _ => records(path, columns(path)?, rate)?,
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
                table.columns.push(FoundColumn { role, column, unit, values, guessed, at: None, clock: None });
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

/// The structure that a column belongs to: what stands before the name of its field. Of one in a table that is nothing.
fn structure(name: &str) -> &str {
    let inside = ["real(", "imag("].iter().find_map(|part| name.strip_prefix(part)).unwrap_or(name);
    inside.rsplit_once('.').map_or("", |n| n.0)
}

/// Roles that a channel of a history has beside its time.
const MOVES: [Role; 4] = [Role::Displacement, Role::Velocity, Role::Acceleration, Role::Force];

/// What a table holds: one thing or, where several structures have a time (or frequency) of their own, one each.
fn records(path: &Path, table: Table, rate: Option<f64>) -> Result<Vec<FoundItem>, DataError> {
    let begins = |c: &FoundColumn| match c.role {
        Some(Role::Time | Role::Frequency) => true,
        Some(role) => rate.is_some() && MOVES.contains(&role),
        None => false,
    };
    let mut own: Vec<String> = Vec::new();
    for c in table.columns.iter().filter(|c| begins(c)) {
        if !own.iter().any(|o| o == structure(&c.column)) {
            own.push(structure(&c.column).to_string());
        }
    }
    if own.len() < 2 {
        return tabular(path, table, rate);
    }
    let mut parts: Vec<Table> = own.iter().map(|_| Table { columns: vec![], unread: vec![] }).collect();
    let of = |name: &str| own.iter().position(|o| o == structure(name));
    let mut others = Vec::new();
    for c in table.columns {
        match of(&c.column) {
            Some(k) => parts[k].columns.push(c),
            None => others.push(format!("`{}`", c.column)),
        }
    }
    for (name, e) in table.unread {
        match of(&name) {
            Some(k) => parts[k].unread.push((name, e)),
            None => others.push(format!("`{name}`")),
        }
    }
    let (mut items, mut first, mut none) = (Vec::new(), None, true);
    for looked in parts.into_iter().map(|t| tabular(path, t, rate)) {
        none &= looked.is_err();
        match looked {
            Ok(found) => items.extend(found),
            Err(e) => {
                items.push(FoundItem::Other(e.to_string()));
                first = first.or(Some(e));
            }
        }
    }
    if let Some(e) = first.filter(|_| none) {
        return Err(e);
    }
    if !others.is_empty() {
        items.push(FoundItem::Other(format!("not used, without a time beside them: {}", others.join(", "))));
    }
    Ok(items)
}

fn tabular(path: &Path, Table { mut columns, unread }: Table, rate: Option<f64>) -> Result<Vec<FoundItem>, DataError> {
    // Beside the parts of an FRF, `f` is no force.
    let of = |columns: &[FoundColumn], role: Role| columns.iter().any(|c| c.role == Some(role));
    if !of(&columns, Role::Time) && !of(&columns, Role::Frequency) && (of(&columns, Role::Imag) || of(&columns, Role::Phase)) {
        let letter = |c: &&mut FoundColumn| c.guessed && c.column.eq_ignore_ascii_case("f");
        columns.iter_mut().find(letter).into_iter().for_each(|c| c.role = Some(Role::Frequency));
    }
    let has = |role: Role| columns.iter().find(|c| c.role == Some(role));
    let history = |columns: Vec<FoundColumn>| {
        let mut found = history::found(columns, &Corrected::default());
        // A channel with a bad cell is told; a column of text is no channel.
        let named = unread.iter().filter(|(name, _)| guess_role(name, bracket(name).as_deref()).is_some());
        found.findings.extend(named.map(|(name, e)| Note::new(name, format!("not read: {}", why(e)))));
        vec![FoundItem::History(Box::new(found))]
    };
    if has(Role::Time).is_some() {
        return Ok(history(columns));
    }
    // What is called a time and cannot be read is what is wrong.
    if let Some(k) = unread.iter().position(|(name, _)| guess_role(name, bracket(name).as_deref()) == Some(Role::Time)) {
        return Err(unread.into_iter().nth(k).map_or(DataError::NoRows { file: path.to_path_buf() }, |u| u.1));
    }
    let parts = [[Role::Real, Role::Imag], [Role::Amplitude, Role::Phase]].into_iter().find(|p| p.iter().all(|r| has(*r).is_some()));
    if let (Some(f), Some(parts)) = (has(Role::Frequency), parts) {
        let band = f.values.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        let roles = [Role::Frequency].into_iter().chain(parts).chain(has(Role::Coherence).map(|_| Role::Coherence));
        let mut named: Vec<_> = roles.filter_map(|r| has(r).map(|c| (r, c.column.clone(), c.unit.clone()))).collect();
        // A force beside every line is what the line was excited with.
        let forces = has(Role::Force).filter(|c| !c.guessed && c.values.len() == f.values.len() && c.values.iter().all(|v| *v > 0.0));
        named.extend(forces.map(|c| (Role::Excitation, c.column.clone(), c.unit.clone())));
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
    if let Some(backbone) = FoundBackbone::of(&columns) {
        return Ok(vec![FoundItem::Backbone(backbone)]);
    }
    // Nothing but the rate says when the samples of such a table were taken.
    let longest = columns.iter().filter(|c| c.role.is_none_or(|r| MOVES.contains(&r))).map(|c| c.values.len()).max();
    if let (Some(rate), Some(samples)) = (rate, longest) {
        columns.insert(0, FoundColumn::clock(rate, samples));
        return Ok(history(columns));
    }
    let names: Vec<&str> = columns.iter().map(|c| c.column.as_str()).collect();
    let tabled = match has(Role::Frequency) {
        Some(_) => "; natural frequency and damping ratio over amplitude as `amplitude [mm]`, `frequency [Hz]`, `damping [%]`",
        None => "",
    };
    Err(super::error::FileError {
        file: path.to_path_buf(),
        place: String::new(),
        message: format!(
            "neither a history (no column of time) nor an FRF (no frequency with real and imaginary part) among {}{}",
            names.join(", "),
            unread.iter().map(|(name, e)| format!("; `{name}` is not read, {}", why(e))).collect::<String>()
        ),
        accepted: format!(
            "columns whose names or units say what they are, such as `time [s]`, `displacement [mm]`, `force [N]`; `misfit new --rate 610.35` for a file \
                   without a column of time; what no name tells is written into dataset.toml by hand, with the columns as they are named here{tabled}"
        ),
    }
    .into())
}

#[cfg(test)]
mod tests;
