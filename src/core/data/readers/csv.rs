//! Text with columns: comma, semicolon, tab or spaces. polars parses the numbers; the structure is checked first, because polars fills a
//! short row with nulls and does not say in which line a cell cannot be read.

use super::dialect::{self, Dialect, cells, unclosed};
use super::{Column, Columns, DataError, Wanted};
use super::{complex, stamp};
use crate::data::error::FileError;
use crate::limits::LINE_BYTES;
use polars::prelude::*;
use std::io::{Cursor, Read};
use std::path::Path;

/// Bytes of a file that are looked at together: a long record is read part by part, and only its numbers are held.
const PART: usize = 32 << 20;

/// Cells among which one of date and time makes a column of them: the first may be the bad one.
const STAMPED: usize = 5;

pub(super) fn read(path: &Path, source: impl Read, wanted: &[Wanted]) -> Result<Columns, DataError> {
    parts(path, source, wanted, PART, PART)
}

/// The same with `head` bytes to find the dialect in, and parts of `size` bytes.
pub(super) fn parts(path: &Path, mut source: impl Read, wanted: &[Wanted], head: usize, size: usize) -> Result<Columns, DataError> {
    let file = || path.to_path_buf();
    let mut held = Vec::new();
    // Whether the file ends with what is held.
    let mut more = |held: &mut Vec<u8>, count: usize| match source.by_ref().take(count as u64).read_to_end(held) {
        Ok(got) => Ok(got < count),
        Err(e) => Err(DataError::Unreadable { file: file(), reason: e.to_string() }),
    };
    let mut ended = more(&mut held, head)?;
    if ended && (held.trim_ascii().is_empty() || held == b"\xef\xbb\xbf") {
        return Err(DataError::Empty { file: file() });
    }
    dialect::whole_text(path, &held)?;
    ending(path, &held, 1)?;
    let mut dialect = dialect::find(path, &held)?;
    let mut from = dialect.body.min(held.len());
    let mut all: Option<(Columns, Vec<usize>)> = None;
    // Moment from which columns of date and time are counted, and which columns these are.
    let (mut origin, mut stamped) = (None, vec![false; wanted.len()]);
    loop {
        let end = if ended { held.len() } else { from + whole_lines(&held[from..]) };
        let body = std::str::from_utf8(&held[from..end]).map_err(|e| {
            let before = held[from..end].iter().take(e.valid_up_to()).filter(|b| **b == b'\n').count();
            DataError::NotText { file: file(), line: dialect.first_line + before }
        })?;
        // Blank lines at the end are no rows; a blank line between rows is refused below.
        let body = body.trim_end_matches(['\n', '\r']);
        if !body.trim().is_empty() {
            let (columns, at) = match &mut all {
                Some(all) => all,
                None => all.insert((Columns::new(vec![], "line", dialect.first_line), place(path, &dialect, wanted)?)),
            };
            let part = rows(path, body, &dialect, at, wanted, ended, (&mut origin, &mut stamped))?;
            dialect.first_line += part.len();
            columns.append(part).map_err(|_| DataError::Unreadable {
                file: file(),
                reason: format!("its numbers up to line {} do not fit into memory", dialect.first_line - 1),
            })?;
        }
        if ended {
            break;
        }
        held.drain(..end);
        from = 0;
        ended = more(&mut held, size)?;
        ending(path, &held, dialect.first_line)?;
    }
    let (mut columns, at) = all.ok_or_else(|| DataError::NoRows { file: file() })?;
    let unit = |(i, stamped): (&usize, &bool)| if *stamped { Some("s".to_string()) } else { dialect.units.get(*i).cloned().flatten() };
    columns.units = at.iter().zip(&stamped).map(unit).collect();
    Ok(columns)
}

/// Refuses a line, or blank lines together, of more than [`LINE_BYTES`]: they would be held until they end. `line` is that of the first byte.
fn ending(path: &Path, bytes: &[u8], line: usize) -> Result<(), DataError> {
    let mut from = 0;
    while bytes.len() - from > LINE_BYTES {
        let reach = &bytes[from..=from + LINE_BYTES];
        let end = memchr::memrchr(b'\n', reach).filter(|_| !reach.iter().all(u8::is_ascii_whitespace));
        let Some(end) = end else {
            let before = memchr::memchr_iter(b'\n', &bytes[..from]).count();
            return Err(FileError {
                file: path.to_path_buf(),
                place: format!("line {}", line + before),
                message: format!("no row ends within {} MB", LINE_BYTES >> 20),
                accepted: "text of one row a line".into(),
            }
            .into());
        };
        from += end + 1;
    }
    Ok(())
}

/// Bytes up to the end of the last whole line that is not blank: blank ones may be the end of the file.
fn whole_lines(bytes: &[u8]) -> usize {
    let whole = &bytes[..memchr::memrchr(b'\n', bytes).map_or(0, |k| k + 1)];
    let last = whole.iter().rposition(|b| !b.is_ascii_whitespace()).unwrap_or(whole.len());
    memchr::memchr(b'\n', &whole[last..]).map_or(0, |k| last + k + 1)
}

/// Cells of the first row, as far as `head` holds it.
pub(super) fn first_row(head: &[u8], dialect: &Dialect) -> Vec<String> {
    let body = head.get(dialect.body..).unwrap_or_default();
    let line = body.split(|b| *b == b'\n').next().unwrap_or_default();
    cells(&String::from_utf8_lossy(line), dialect.separator).unwrap_or_default()
}

/// Which part of a complex column is asked for, where no column has the name as it stands.
fn part_of(dialect: &Dialect, wanted: &Wanted) -> Option<usize> {
    complex::part(&wanted.name).map(|p| p.0).filter(|_| !dialect.names.contains(&wanted.name))
}

fn place(path: &Path, dialect: &Dialect, wanted: &[Wanted]) -> Result<Vec<usize>, DataError> {
    match super::locate(path, &dialect.names, wanted) {
        Err(DataError::MissingColumn { .. }) if dialect.names.iter().all(|h| h.parse::<f64>().is_ok()) => Err(DataError::Format {
            file: path.to_path_buf(),
            reason: "the first line holds numbers, where the header row is expected".to_string(),
        }),
        other => other,
    }
}

/// Moment from which date and time are counted, once one is read, and the columns that hold them.
type Stamps<'a> = (&'a mut Option<i64>, &'a mut [bool]);

/// The columns `at` of whole lines; `ended`: the last one is the last of the file.
fn rows(
    path: &Path,
    body: &str,
    dialect: &Dialect,
    at: &[usize],
    wanted: &[Wanted],
    ended: bool,
    stamps: Stamps<'_>,
) -> Result<Columns, DataError> {
    let spaced;
    let body = if dialect.separator == b' ' {
        // Runs of spaces become one separator; the lines stay where they are.
        spaced = body.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>().join("\n");
        spaced.as_str()
    } else {
        body
    };
    structure(path, body, dialect, ended)?;
    if dialect.decimal_comma {
        no_points(path, body, dialect, at, wanted)?;
    }
    let columns = match frame(body, dialect, at, wanted, false) {
        Ok(frame) => numbers(path, &frame, dialect, at, wanted, stamps)?,
        // polars could not read some cell as a number: read the cells as text and name the first bad one.
        Err(_) => {
            let format = |e: PolarsError| DataError::Format { file: path.to_path_buf(), reason: clip(&e.to_string()) };
            numbers(path, &frame(body, dialect, at, wanted, true).map_err(format)?, dialect, at, wanted, stamps)?
        }
    };
    super::finite(path, &columns, wanted)?;
    Ok(columns)
}

/// Every line has as many cells as the header; `ended`: the last one is the last of the file.
fn structure(path: &Path, body: &str, dialect: &Dialect, ended: bool) -> Result<(), DataError> {
    let wanted = dialect.names.len();
    let separator = dialect.separator;
    let check = |number: usize, line: &str, found: usize, last: bool| {
        if line.trim().is_empty() {
            return Err(DataError::BlankLine { file: path.to_path_buf(), line: number });
        }
        if found != wanted {
            return Err(DataError::Ragged { file: path.to_path_buf(), line: number, found, wanted, last: last && found < wanted });
        }
        Ok(())
    };
    if memchr::memchr(b'"', body.as_bytes()).is_some() {
        let mut lines = body.split('\n').enumerate().peekable();
        while let Some((i, line)) = lines.next() {
            let number = i + dialect.first_line;
            let found = cells(line, separator).ok_or_else(|| unclosed(path, number))?.len();
            check(number, line, found, ended && lines.peek().is_none())?;
        }
        return Ok(());
    }
    // One pass over separators and line ends: this runs over every byte of long records.
    let (mut line, mut start, mut found) = (dialect.first_line, 0, 1);
    for at in memchr::memchr2_iter(separator, b'\n', body.as_bytes()) {
        if body.as_bytes()[at] == separator {
            found += 1;
            continue;
        }
        if found != wanted || at - start < wanted {
            check(line, &body[start..at], found, false)?;
        }
        (line, start, found) = (line + 1, at + 1, 1);
    }
    check(line, &body[start..], found, ended)
}

/// Beside decimal commas a point can only be a mark of thousands, or a mistake.
fn no_points(path: &Path, body: &str, dialect: &Dialect, at: &[usize], wanted: &[Wanted]) -> Result<(), DataError> {
    if memchr::memchr(b'.', body.as_bytes()).is_none() {
        return Ok(());
    }
    for (i, line) in body.lines().enumerate().filter(|(_, l)| l.contains('.')) {
        let cells = cells(line, dialect.separator).unwrap_or_default();
        for (k, w) in at.iter().zip(wanted).filter(|(_, w)| !w.text) {
            if let Some(cell) = cells.get(*k).filter(|c| c.contains('.') && stamp::nanoseconds(c).is_none()) {
                let what = format!("`{}` has a decimal point, and the file is written with decimal commas", clip(cell));
                return Err(DataError::Cell {
                    file: path.to_path_buf(),
                    row: format!("line {}", dialect.first_line + i),
                    column: w.name.clone(),
                    what,
                });
            }
        }
    }
    Ok(())
}

/// Reads the body through polars; columns get the names of their positions, so that doubled headers elsewhere do no harm.
fn frame(body: &str, dialect: &Dialect, at: &[usize], wanted: &[Wanted], as_text: bool) -> PolarsResult<DataFrame> {
    let mut types = vec![DataType::String; dialect.names.len()];
    if !as_text {
        for (i, _) in at.iter().zip(wanted).filter(|(_, w)| !w.text && part_of(dialect, w).is_none()) {
            types[*i] = DataType::Float64;
        }
    }
    let schema: Schema = types.into_iter().enumerate().map(|(i, t)| Field::new(i.to_string().into(), t)).collect();
    let mut names: Vec<usize> = at.to_vec();
    names.sort_unstable();
    names.dedup();
    let names: Vec<PlSmallStr> = names.into_iter().map(|i| i.to_string().into()).collect();
    CsvReadOptions::default()
        .with_has_header(false)
        .with_schema(Some(Arc::new(schema)))
        .with_columns(Some(names.into()))
        .with_rechunk(true)
        .map_parse_options(|o| o.with_separator(dialect.separator).with_decimal_comma(dialect.decimal_comma))
        .into_reader_with_file_handle(Cursor::new(body.as_bytes()))
        .finish()
}

fn numbers(
    path: &Path,
    frame: &DataFrame,
    dialect: &Dialect,
    at: &[usize],
    wanted: &[Wanted],
    (origin, stamped): Stamps<'_>,
) -> Result<Columns, DataError> {
    let format = |e: PolarsError| DataError::Format { file: path.to_path_buf(), reason: clip(&e.to_string()) };
    let number = |cell: &str| if dialect.decimal_comma { cell.replace(',', ".").parse::<f64>() } else { cell.parse::<f64>() };
    let mut columns = Vec::with_capacity(at.len());
    for ((i, w), stamped) in at.iter().zip(wanted).zip(stamped) {
        let series = frame.column(&i.to_string()).map_err(format)?;
        let bad = |row: usize, what: String| DataError::Cell {
            file: path.to_path_buf(),
            row: format!("line {}", row + dialect.first_line),
            column: w.name.clone(),
            what,
        };
        columns.push(if w.text {
            Column::Text(series.str().map_err(format)?.iter().map(|c| c.unwrap_or("").trim().to_string()).collect())
        } else if let Some(part) = part_of(dialect, w) {
            let cell = |(row, c): (usize, Option<&str>)| match c.map(str::trim).unwrap_or("") {
                "" => Err(bad(row, "an empty cell".to_string())),
                c => Ok(complex::parse(c).map(|z| z[part])),
            };
            let value = |(row, c): (usize, Option<&str>)| {
                cell((row, c))?.ok_or_else(|| bad(row, format!("`{}` is no complex number such as (1+2j)", clip(c.unwrap_or("")))))
            };
            Column::Numbers(series.str().map_err(format)?.iter().enumerate().map(value).collect::<Result<_, _>>()?)
        } else if let Ok(values) = series.f64() {
            let cell = |(row, v): (usize, Option<f64>)| v.ok_or_else(|| bad(row, "an empty cell".to_string()));
            Column::Numbers(values.iter().enumerate().map(cell).collect::<Result<_, _>>()?)
        } else {
            let mut first = series.str().map_err(format)?.iter().take(STAMPED).flatten();
            if *stamped || first.any(|c| stamp::nanoseconds(c.trim()).is_some()) {
                *stamped = true;
                let moment = |(row, c): (usize, Option<&str>)| -> Result<f64, DataError> {
                    let cell = c.map(str::trim).unwrap_or("");
                    let what = || if cell.is_empty() { "an empty cell".into() } else { format!("`{}` is not a date and time", clip(cell)) };
                    let at = stamp::nanoseconds(cell).ok_or_else(|| bad(row, what()))?;
                    Ok(1e-9 * at.saturating_sub(*origin.get_or_insert(at)) as f64)
                };
                columns.push(Column::Numbers(series.str().map_err(format)?.iter().enumerate().map(moment).collect::<Result<_, _>>()?));
                continue;
            }
            let cell = |(row, c): (usize, Option<&str>)| match c.map(str::trim).unwrap_or("") {
                "" => Err(bad(row, "an empty cell".to_string())),
                c => number(c).map_err(|_| {
                    let ask = format!("`{}` is complex: ask for real({name}) and imag({name})", clip(c), name = dialect::bare(&w.name));
                    bad(row, if complex::is(c) { ask } else { format!("`{}` is not a number", clip(c)) })
                }),
            };
            Column::Numbers(series.str().map_err(format)?.iter().enumerate().map(cell).collect::<Result<_, _>>()?)
        });
    }
    Ok(Columns::new(columns, "line", dialect.first_line))
}

fn clip(text: &str) -> String {
    text.lines().next().unwrap_or("").chars().take(120).collect()
}
