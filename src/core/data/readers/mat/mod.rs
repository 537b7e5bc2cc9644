//! MATLAB files of version 5 (`save -v6` and `-v7`) and 7.3 (HDF5): numeric variables, and those in structures, as columns.
//!
//! A column is named as MATLAB names it: `t`, `run.force`, `M(:,2)`. Format: The MathWorks, "MAT-File Format", level 5.

mod array;
mod hdf;

use array::{Array, Body, Bytes};

use super::{Column, Columns, DataError, Wanted};
use crate::data::error::FileError;
use std::io::Read;
use std::path::Path;

/// Inflated bytes of a variable at most: ten times the file, or this.
const INFLATED: usize = 32 << 20;

/// A variable as listed: name, class and size.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Listed {
    pub name: String,
    pub class: &'static str,
    pub rows: usize,
    pub columns: usize,
    pub numeric: bool,
}

fn broken(path: &Path, message: impl Into<String>, accepted: &str) -> DataError {
    FileError { file: path.to_path_buf(), place: String::new(), message: message.into(), accepted: accepted.to_string() }.into()
}

const REMEDY: &str = "a file of version 5, 7 or 7.3: in MATLAB, save(\"file.mat\", \"-v7\")";

fn limit(bytes: &[u8]) -> usize {
    (10 * bytes.len()).max(INFLATED)
}

fn bomb(path: &Path, limit: usize) -> DataError {
    let message = format!("a variable inflates beyond {} MB, ten times the file", limit >> 20);
    broken(path, message, "the file saved without compression: save(\"file.mat\", \"-v6\")")
}

/// Calls `each` with every variable of the file; numbers of those that are not `wanted` may be left out.
fn variables(
    path: &Path,
    bytes: &[u8],
    wanted: impl Fn(&str) -> bool,
    mut each: impl FnMut(&Array<'_>) -> Result<(), DataError>,
) -> Result<(), DataError> {
    if hdf::is(bytes) {
        return hdf::variables(path, bytes, wanted, each);
    }
    let order = bytes.get(126..128).unwrap_or(&[]);
    let big = match order {
        b"IM" => false,
        b"MI" => true,
        _ => return Err(broken(path, "not a MATLAB file of version 5, 7 or 7.3", REMEDY)),
    };
    let damaged = |e: String| broken(path, format!("a damaged MATLAB file: {e}"), "a whole file; save it again");
    let mut at = 128;
    while bytes.len().saturating_sub(at) >= 8 {
        let element = array::element(bytes, at, big).map_err(damaged)?;
        at = element.next;
        match element.kind {
            array::MATRIX => each(&array::parse(Bytes { data: element.data, big }, 0).map_err(damaged)?)?,
            array::COMPRESSED => {
                let limit = limit(bytes);
                let mut inflated = Vec::new();
                let mut decoder = flate2::read::ZlibDecoder::new(element.data).take(limit as u64 + 1);
                decoder.read_to_end(&mut inflated).map_err(|e| damaged(e.to_string()))?;
                if inflated.len() > limit {
                    return Err(bomb(path, limit));
                }
                let inner = array::element(&inflated, 0, big).map_err(damaged)?;
                if inner.kind == array::MATRIX {
                    each(&array::parse(Bytes { data: inner.data, big }, 0).map_err(damaged)?)?;
                }
            }
            _ => {}
        }
    }
    if at == 128 { Err(damaged("no variables".into())) } else { Ok(()) }
}

/// Every numeric variable, and those inside structures, by the name a column would use.
pub(crate) fn list(path: &Path, bytes: &[u8]) -> Result<Vec<Listed>, DataError> {
    let mut all = Vec::new();
    variables(
        path,
        bytes,
        |_| false,
        |a| {
            walk(a, a.name.clone(), &mut all);
            Ok(())
        },
    )?;
    Ok(all)
}

fn walk(a: &Array<'_>, name: String, all: &mut Vec<Listed>) {
    if let Body::Struct(fields) = &a.body {
        for (field, value) in fields {
            walk(value, format!("{name}.{field}"), all);
        }
        return;
    }
    let (rows, columns) = a.shape();
    all.push(Listed { name, class: a.class_word(), rows, columns, numeric: matches!(a.body, Body::Numeric { .. }) });
}

/// `M(:,2)`: the name and the column from 1.
fn index(name: &str) -> (&str, Option<usize>) {
    let parsed = || {
        let (base, rest) = name.split_once('(')?;
        let number = rest.trim().strip_suffix(')')?.trim().strip_prefix(':')?.trim().strip_prefix(',')?.trim();
        Some((base.trim(), number.parse().ok().filter(|n| *n > 0)?))
    };
    parsed().map_or((name.trim(), None), |(base, n)| (base, Some(n)))
}

pub(super) fn read(path: &Path, bytes: &[u8], wanted: &[Wanted]) -> Result<Columns, DataError> {
    let mut found: Vec<Option<Vec<f64>>> = vec![None; wanted.len()];
    let mut all = Vec::new();
    let asked = |name: &str| wanted.iter().any(|w| index(&w.name).0.split('.').next() == Some(name));
    variables(path, bytes, asked, |variable| {
        walk(variable, variable.name.clone(), &mut all);
        for (w, slot) in wanted.iter().zip(&mut found) {
            let (name, column) = index(&w.name);
            let mut parts = name.split('.');
            if parts.next() != Some(variable.name.as_str()) {
                continue;
            }
            let mut a = variable;
            for part in parts {
                let Body::Struct(fields) = &a.body else { return Err(no_such(path, &w.name, &all)) };
                let Some((_, inner)) = fields.iter().find(|f| f.0 == part) else { return Err(no_such(path, &w.name, &all)) };
                a = inner;
            }
            *slot = Some(column_of(path, &w.name, a, column)?);
        }
        Ok(())
    })?;
    let mut columns = Vec::with_capacity(wanted.len());
    for (w, values) in wanted.iter().zip(found) {
        let values = values.ok_or_else(|| no_such(path, &w.name, &all))?;
        if w.text {
            return Err(broken(path, format!("`{}` holds numbers, not text", w.name), "a table of text in a CSV file"));
        }
        columns.push(values);
    }
    if let (Some(a), Some((k, b))) =
        (columns.first(), columns.iter().enumerate().find(|(_, c)| columns.first().is_some_and(|f| f.len() != c.len())))
    {
        let message = format!("`{}` has {} values, `{}` has {}", wanted[0].name, a.len(), wanted[k].name, b.len());
        return Err(broken(path, message, "channels of one length"));
    }
    if columns.first().is_none_or(Vec::is_empty) {
        return Err(DataError::NoRows { file: path.to_path_buf() });
    }
    let columns = Columns::new(columns.into_iter().map(Column::Numbers).collect(), "row", 1);
    super::finite(path, &columns, wanted)?;
    Ok(columns)
}

fn no_such(path: &Path, name: &str, all: &[Listed]) -> DataError {
    let names: Vec<String> = all.iter().filter(|l| l.numeric).map(|l| l.name.clone()).collect();
    DataError::MissingColumn {
        file: path.to_path_buf(),
        column: name.to_string(),
        nearest: super::nearest(name, names.iter().map(String::as_str)),
        columns: names,
    }
}

fn column_of(path: &Path, name: &str, a: &Array<'_>, column: Option<usize>) -> Result<Vec<f64>, DataError> {
    let accepted = "a real numeric vector, or one column of a matrix as `M(:,2)`";
    let (rows, columns) = a.shape();
    let Body::Numeric { re, complex } = &a.body else {
        return Err(broken(path, format!("`{name}` is a {}", a.class_word()), accepted));
    };
    if *complex {
        return Err(broken(path, format!("`{name}` is complex"), "real vectors; store real and imaginary part as two variables"));
    }
    match column {
        None if rows == 1 || columns == 1 => Ok(re.numbers(0, rows * columns)),
        None => Err(broken(path, format!("`{name}` is a matrix of {rows} x {columns}"), accepted)),
        Some(k) if k <= columns => Ok(re.numbers((k - 1) * rows, rows)),
        Some(k) => Err(broken(path, format!("`{name}` asks for column {k} of {columns}"), accepted)),
    }
}

#[cfg(test)]
mod tests;
