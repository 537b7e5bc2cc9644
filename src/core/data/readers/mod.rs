//! Readers of measurement files, one per file: columns by name, as numbers or text.

mod complex;
mod csv;
pub(crate) mod dialect;
mod mat;
mod parquet;
mod parquet_pages;
mod stamp;
mod universal;

use super::toml_strict::nearest;
use super::{DataError, FrfQuantity};
use crate::limits;
use std::collections::TryReserveError;
use std::fs::File;
use std::io::Read;
use std::path::Path;

pub(super) use stamp::ACCEPTED as STAMPS;

/// A column that is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    pub name: String,
    /// Text instead of numbers.
    pub text: bool,
}

/// The columns that were asked for, in that order.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    pub columns: Vec<Column>,
    /// What a row is called in errors: `line` (CSV, the header is line 1) or `row` (Parquet, from 1).
    row_name: &'static str,
    first_row: usize,
    /// What the file says of the unit of each column.
    pub units: Vec<Option<String>>,
    /// What the file says an FRF in it is.
    pub quantity: Option<FrfQuantity>,
}

/// The cells of a column. Numbers are finite; a missing cell is an error, in text it is empty.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    Numbers(Vec<f64>),
    Text(Vec<String>),
}

impl Columns {
    fn new(columns: Vec<Column>, row_name: &'static str, first_row: usize) -> Self {
        Self { columns, row_name, first_row, units: Vec::new(), quantity: None }
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, |c| match c {
            Column::Numbers(v) => v.len(),
            Column::Text(v) => v.len(),
        })
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Puts the rows of a later part of the same file below these, where memory is left for them.
    fn append(&mut self, part: Self) -> Result<(), TryReserveError> {
        if self.columns.is_empty() {
            self.columns = part.columns;
            return Ok(());
        }
        for pair in self.columns.iter_mut().zip(part.columns) {
            match pair {
                (Column::Numbers(all), Column::Numbers(more)) => {
                    all.try_reserve(more.len())?;
                    all.extend(more);
                }
                (Column::Text(all), Column::Text(more)) => {
                    all.try_reserve(more.len())?;
                    all.extend(more);
                }
                // The parts of a column are read as the same kind.
                _ => {}
            }
        }
        Ok(())
    }

    /// The first row is left out of the columns: the places are those of the others.
    pub fn skip_first(&mut self) {
        self.first_row += 1;
    }

    /// `line 7` or `row 6` of the row of index `i`.
    pub fn place(&self, i: usize) -> String {
        format!("{} {}", self.row_name, i + self.first_row)
    }
}

/// Kinds of file by the extension of their name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    Text,
    Parquet,
    Universal,
    Matlab,
}

impl FileKind {
    /// The kind a file name stands for.
    pub fn of(path: &Path) -> Result<Self, DataError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        match extension.as_str() {
            "csv" | "txt" | "tsv" | "dat" | "asc" => Ok(Self::Text),
            "parquet" | "pq" => Ok(Self::Parquet),
            "uff" | "unv" | "uf" | "ufb" | "bunv" => Ok(Self::Universal),
            "mat" => Ok(Self::Matlab),
            _ => Err(DataError::NoReader { file: path.to_path_buf(), extension }),
        }
    }
}

fn unreadable(path: &Path, why: &std::io::Error) -> DataError {
    DataError::Unreadable { file: path.to_path_buf(), reason: why.to_string() }
}

fn open(path: &Path) -> Result<File, DataError> {
    limits::bounded(path, limits::DATA_BYTES).map(|f| f.0).map_err(|e| unreadable(path, &e))
}

/// The whole file; an empty one is an error.
pub fn bytes(path: &Path) -> Result<Vec<u8>, DataError> {
    let bytes = limits::bytes(path, limits::DATA_BYTES).map_err(|e| unreadable(path, &e))?;
    if bytes.is_empty() { Err(DataError::Empty { file: path.to_path_buf() }) } else { Ok(bytes) }
}

/// Reads the columns `wanted` of `path`; the reader is chosen by the file's extension. `record` names a function of a universal file.
pub fn read(path: &Path, wanted: &[Wanted], record: Option<&str>) -> Result<Columns, DataError> {
    match FileKind::of(path)? {
        FileKind::Text => csv::read(path, open(path)?, wanted),
        FileKind::Parquet => parquet::read(path, bytes(path)?, wanted),
        FileKind::Universal => universal::read(path, bytes(path)?, wanted, record),
        FileKind::Matlab => mat::read(path, &bytes(path)?, wanted),
    }
}

/// The columns of a table, with the units its header gives.
pub(crate) fn names(path: &Path) -> Result<Vec<(String, Option<String>)>, DataError> {
    match FileKind::of(path)? {
        FileKind::Text => {
            let mut head = Vec::new();
            open(path)?.take(dialect::HEAD as u64).read_to_end(&mut head).map_err(|e| unreadable(path, &e))?;
            if head.is_empty() {
                return Err(DataError::Empty { file: path.to_path_buf() });
            }
            dialect::whole_text(path, &head)?;
            let d = dialect::find(path, &head)?;
            let first = csv::first_row(&head, &d);
            let each = |(k, (name, unit)): (usize, (String, Option<String>))| match first.get(k).is_some_and(|c| complex::is(c)) {
                true => ["real", "imag"].map(|part| (format!("{part}({})", dialect::bare(&name)), unit.clone())).to_vec(),
                false => vec![(name, unit)],
            };
            Ok(d.names.into_iter().zip(d.units).enumerate().flat_map(each).collect())
        }
        FileKind::Parquet => Ok(parquet::names(path, bytes(path)?)?.into_iter().map(|n| (n.clone(), dialect::bracket(&n))).collect()),
        FileKind::Universal => {
            Err(DataError::Format { file: path.to_path_buf(), reason: "a universal file has functions, not columns".into() })
        }
        FileKind::Matlab => Ok(mat::names(path, &bytes(path)?)?.into_iter().map(|n| (n, None)).collect()),
    }
}

/// The index of each wanted column in the file's header.
fn locate(path: &Path, header: &[String], wanted: &[Wanted]) -> Result<Vec<usize>, DataError> {
    wanted
        .iter()
        .map(|w| {
            // `Force` finds `Force [N]` where no column has the very name, and `real(H)` the complex column `H`.
            let there = |name: &str| header.iter().any(|h| h == name || dialect::bare(h) == name);
            let name = complex::part(&w.name).map(|p| p.1).filter(|n| !header.contains(&w.name) && there(n)).unwrap_or(&w.name);
            let exact = header.iter().any(|h| h == name);
            let same = |h: &&String| if exact { *h == name } else { dialect::bare(h) == name };
            let mut found = header.iter().enumerate().filter(|(_, h)| same(h)).map(|(i, _)| i);
            let (first, second) = (found.next(), found.next());
            match (first, second) {
                (Some(i), None) => Ok(i),
                (Some(_), Some(_)) => Err(DataError::DoubleColumn { file: path.to_path_buf(), column: w.name.clone() }),
                _ => Err(DataError::MissingColumn {
                    file: path.to_path_buf(),
                    column: w.name.clone(),
                    nearest: nearest(&w.name, header.iter().map(String::as_str)),
                    columns: header.to_vec(),
                }),
            }
        })
        .collect()
}

/// Refuses NaN and infinity, naming the row.
fn finite(path: &Path, columns: &Columns, wanted: &[Wanted]) -> Result<(), DataError> {
    for (column, w) in columns.columns.iter().zip(wanted) {
        if let Column::Numbers(values) = column
            && let Some((i, v)) = values.iter().enumerate().find(|(_, v)| !v.is_finite())
        {
            let what = format!("{v} is not a finite number");
            return Err(DataError::Cell { file: path.to_path_buf(), row: columns.place(i), column: w.name.clone(), what });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
