//! MATLAB files of versions 4, 5 (`save -v6` and `-v7`) and 7.3 (HDF5): numeric variables, and those in structures, as columns.
//!
//! A column is named as MATLAB names it: `t`, `run.force`, `M(:,2)`, in cells `c{3}`, in an array of structures `runs(2).force`, of complex numbers `real(H)` and
//! `imag(H)`. Format: The MathWorks, "MAT-File Format", level 5.

mod array;
mod hdf;
mod v4;

use array::{Array, Body, Bytes};

use super::{Column, Columns, DataError, Wanted, complex};
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
    pub complex: bool,
}

fn broken(path: &Path, message: impl Into<String>, accepted: &str) -> DataError {
    FileError { file: path.to_path_buf(), place: String::new(), message: message.into(), accepted: accepted.to_string() }.into()
}

/// Class of a cell array.
const CELL: u8 = 1;

const REMEDY: &str = "a file of version 4, 5, 7 or 7.3: in MATLAB, save(\"file.mat\", \"-v7\")";

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
    let damaged = |e: String| broken(path, format!("a damaged MATLAB file: {e}"), "a whole file; save it again");
    if v4::is(bytes) {
        let mut at = 0;
        while at < bytes.len() {
            let (variable, next) = v4::variable(bytes, at).map_err(damaged)?;
            each(&variable)?;
            at = next;
        }
        return Ok(());
    }
    let order = bytes.get(126..128).unwrap_or(&[]);
    let big = match order {
        b"IM" => false,
        b"MI" => true,
        _ => return Err(broken(path, "not a MATLAB file of version 4, 5, 7 or 7.3", REMEDY)),
    };
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
            walk(a, a.name.clone(), &mut |a, name| {
                all.extend(leaf(a, name));
                Ok(())
            })
        },
    )?;
    Ok(all)
}

/// Names of the columns: vectors of numbers and the columns of matrices, of complex ones their parts.
pub(super) fn names(path: &Path, bytes: &[u8]) -> Result<Vec<String>, DataError> {
    let all = list(path, bytes)?;
    let each = |l: &Listed| {
        let columns = match (l.rows, l.columns) {
            (1, _) | (_, 1) => vec![l.name.clone()],
            (_, columns) => (1..=columns.min(64)).map(|k| format!("{}(:,{k})", l.name)).collect(),
        };
        let parts = |name: String| if l.complex { ["real", "imag"].map(|part| format!("{part}({name})")).to_vec() } else { vec![name] };
        columns.into_iter().flat_map(parts).collect::<Vec<_>>()
    };
    let names: Vec<String> = all.iter().filter(|l| l.numeric && l.rows.saturating_mul(l.columns) > 1).flat_map(each).collect();
    if names.is_empty() {
        let one = |l: &Listed| format!("`{}`: {} of {} x {}", l.name, l.class, l.rows, l.columns);
        let inside = all.iter().take(8).map(one).collect::<Vec<_>>().join(", ");
        let accepted = "vectors of numbers, alone, in structures or in cells";
        return Err(broken(path, format!("no vector of numbers: {inside}"), accepted));
    }
    Ok(names)
}

/// Calls `each` with an array and all that it holds, under their names.
fn walk<'a, 'b>(
    a: &'b Array<'a>,
    name: String,
    each: &mut dyn FnMut(&'b Array<'a>, &str) -> Result<(), DataError>,
) -> Result<(), DataError> {
    each(a, &name)?;
    match &a.body {
        Body::Struct(fields) => fields.iter().try_for_each(|(field, value)| walk(value, format!("{name}.{field}"), each)),
        Body::Elements(all) => {
            let of = |k: usize| if a.class == CELL { format!("{name}{{{}}}", k + 1) } else { format!("{name}({})", k + 1) };
            all.iter().enumerate().try_for_each(|(k, value)| walk(value, of(k), each))
        }
        Body::Numeric { .. } | Body::Other => Ok(()),
    }
}

/// What holds nothing else, as listed.
fn leaf(a: &Array<'_>, name: &str) -> Option<Listed> {
    let (rows, columns) = a.shape();
    let (numeric, complex) = match &a.body {
        Body::Numeric { im, .. } => (true, im.is_some()),
        Body::Struct(_) => return None,
        Body::Elements(all) if !all.is_empty() => return None,
        Body::Elements(_) | Body::Other => (false, false),
    };
    Some(Listed { name: name.into(), class: a.class_word(), rows, columns, numeric, complex })
}

/// `M(:,2)`: the name and the column from 1.
fn index(name: &str) -> (&str, Option<usize>) {
    let parsed = || {
        let (base, rest) = name.rsplit_once('(')?;
        let number = rest.trim().strip_suffix(')')?.trim().strip_prefix(':')?.trim().strip_prefix(',')?.trim();
        Some((base.trim(), number.parse().ok().filter(|n| *n > 0)?))
    };
    parsed().map_or((name.trim(), None), |(base, n)| (base, Some(n)))
}

pub(super) fn read(path: &Path, bytes: &[u8], wanted: &[Wanted]) -> Result<Columns, DataError> {
    let mut found: Vec<Option<Vec<f64>>> = vec![None; wanted.len()];
    let mut all = Vec::new();
    // Which part of a complex variable, its name, and which column of a matrix.
    let place = |w: &Wanted| -> (Option<usize>, String, Option<usize>) {
        let (part, inside) = complex::part(&w.name).map_or((None, w.name.as_str()), |(part, inside)| (Some(part), inside));
        let (name, column) = index(inside);
        (part, name.to_string(), column)
    };
    let places: Vec<_> = wanted.iter().map(place).collect();
    let asked = |name: &str| places.iter().any(|p| p.1.split(['.', '{', '(']).next() == Some(name));
    variables(path, bytes, asked, |variable| {
        walk(variable, variable.name.clone(), &mut |a, name| {
            all.extend(leaf(a, name));
            for ((w, (part, _, column)), slot) in wanted.iter().zip(&places).zip(&mut found).filter(|((_, p), _)| p.1 == name) {
                *slot = Some(column_of(path, &w.name, a, *part, *column)?);
            }
            Ok(())
        })
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

fn column_of(path: &Path, name: &str, a: &Array<'_>, part: Option<usize>, column: Option<usize>) -> Result<Vec<f64>, DataError> {
    let accepted = "a real numeric vector, or one column of a matrix as `M(:,2)`";
    let (rows, columns) = a.shape();
    let Body::Numeric { re, im } = &a.body else {
        let (word, article) = (a.class_word(), if a.class_word().starts_with(['a', 'o']) { "an" } else { "a" });
        return Err(broken(path, format!("`{name}` is {article} {word}"), accepted));
    };
    let numbers = match (im, part) {
        (None, None) | (Some(_), Some(0)) => re,
        (Some(im), Some(_)) => im,
        (Some(_), None) => return Err(broken(path, format!("`{name}` is complex"), &format!("its parts, real({name}) and imag({name})"))),
        (None, Some(_)) => {
            return Err(broken(path, format!("`{name}` is asked of numbers that are real"), "the name of the variable alone"));
        }
    };
    match column {
        None if rows == 1 || columns == 1 => Ok(numbers.numbers(0, rows * columns)),
        None => Err(broken(path, format!("`{name}` is a matrix of {rows} x {columns}"), accepted)),
        Some(k) if k <= columns => Ok(numbers.numbers((k - 1) * rows, rows)),
        Some(k) => Err(broken(path, format!("`{name}` asks for column {k} of {columns}"), accepted)),
    }
}

#[cfg(test)]
mod tests;
