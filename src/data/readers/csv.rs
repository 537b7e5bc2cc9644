//! CSV: one header row, comma, decimal point. polars parses the numbers; the structure is checked first, line by line, because polars
//! fills a short row with nulls and does not say in which line a cell cannot be read.

use super::{Column, Columns, DataError, Wanted};
use polars::prelude::*;
use std::io::Cursor;
use std::path::Path;

pub(super) fn read(path: &Path, bytes: Vec<u8>, wanted: &[Wanted]) -> Result<Columns, DataError> {
    let file = || path.to_path_buf();
    let text = std::str::from_utf8(&bytes).map_err(|e| {
        let line = 1 + bytes.iter().take(e.valid_up_to()).filter(|b| **b == b'\n').count();
        DataError::NotText { file: file(), line }
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        return Err(DataError::Empty { file: file() });
    }
    let (head, body) = text.split_once('\n').unwrap_or((text, ""));
    let header: Vec<String> = cells(head).ok_or_else(|| unclosed(path, 1))?;
    // Blank lines at the end are no rows; a blank line between rows is refused below.
    let body = body.trim_end_matches(['\n', '\r']);
    if body.trim().is_empty() {
        return Err(DataError::NoRows { file: file() });
    }
    let at = match super::locate(path, &header, wanted) {
        Err(DataError::MissingColumn { .. }) if header.len() == 1 && head.contains([';', '\t']) => {
            return Err(DataError::Format { file: file(), reason: "the header is not separated by commas".to_string() });
        }
        Err(DataError::MissingColumn { .. }) if header.iter().all(|h| h.parse::<f64>().is_ok()) => {
            return Err(DataError::Format {
                file: file(),
                reason: "the first line holds numbers, where the header row is expected".to_string(),
            });
        }
        other => other?,
    };
    structure(path, body, header.len())?;
    let columns = match frame(body, &header, &at, wanted, false) {
        Ok(frame) => numbers(path, &frame, &at, wanted)?,
        // polars could not read some cell as a number: read the cells as text and name the first bad one.
        Err(_) => {
            let frame =
                frame(body, &header, &at, wanted, true).map_err(|e| DataError::Format { file: file(), reason: clip(&e.to_string()) })?;
            numbers(path, &frame, &at, wanted)?
        }
    };
    super::finite(path, &columns, wanted)?;
    Ok(columns)
}

/// The cells of a line, trimmed, quotes taken off; none when a quote is not closed on the line.
fn cells(line: &str) -> Option<Vec<String>> {
    let line = line.strip_suffix('\r').unwrap_or(line);
    let (mut all, mut cell, mut quoted) = (Vec::new(), String::new(), false);
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => all.push(std::mem::take(&mut cell).trim().to_string()),
            _ => cell.push(c),
        }
    }
    all.push(cell.trim().to_string());
    (!quoted).then_some(all)
}

fn unclosed(path: &Path, line: usize) -> DataError {
    DataError::Format { file: path.to_path_buf(), reason: format!("line {line}: a quote is not closed") }
}

/// Every line has as many cells as the header.
fn structure(path: &Path, body: &str, wanted: usize) -> Result<(), DataError> {
    let mut lines = body.split('\n').enumerate().peekable();
    while let Some((i, line)) = lines.next() {
        let number = i + 2;
        if line.trim().is_empty() {
            return Err(DataError::BlankLine { file: path.to_path_buf(), line: number });
        }
        let found = if line.contains('"') {
            cells(line).ok_or_else(|| unclosed(path, number))?.len()
        } else {
            1 + line.bytes().filter(|b| *b == b',').count()
        };
        if found != wanted {
            let last = lines.peek().is_none() && found < wanted;
            return Err(DataError::Ragged { file: path.to_path_buf(), line: number, found, wanted, last });
        }
    }
    Ok(())
}

/// Reads the body through polars; columns get the names of their positions, so that doubled headers elsewhere do no harm.
fn frame(body: &str, header: &[String], at: &[usize], wanted: &[Wanted], as_text: bool) -> PolarsResult<DataFrame> {
    let mut types = vec![DataType::String; header.len()];
    if !as_text {
        for (i, _) in at.iter().zip(wanted).filter(|(_, w)| !w.text) {
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
        .into_reader_with_file_handle(Cursor::new(body.as_bytes()))
        .finish()
}

fn numbers(path: &Path, frame: &DataFrame, at: &[usize], wanted: &[Wanted]) -> Result<Columns, DataError> {
    let format = |e: PolarsError| DataError::Format { file: path.to_path_buf(), reason: clip(&e.to_string()) };
    let mut columns = Vec::with_capacity(at.len());
    for (i, w) in at.iter().zip(wanted) {
        let series = frame.column(&i.to_string()).map_err(format)?;
        let bad = |row: usize, what: String| DataError::Cell {
            file: path.to_path_buf(),
            row: format!("line {}", row + 2),
            column: w.name.clone(),
            what,
        };
        columns.push(if w.text {
            Column::Text(series.str().map_err(format)?.iter().map(|c| c.unwrap_or("").trim().to_string()).collect())
        } else if let Ok(values) = series.f64() {
            let cell = |(row, v): (usize, Option<f64>)| v.ok_or_else(|| bad(row, "an empty cell".to_string()));
            Column::Numbers(values.iter().enumerate().map(cell).collect::<Result<_, _>>()?)
        } else {
            let cell = |(row, c): (usize, Option<&str>)| match c.map(str::trim).unwrap_or("") {
                "" => Err(bad(row, "an empty cell".to_string())),
                c => c.parse::<f64>().map_err(|_| bad(row, format!("`{}` is not a number", clip(c)))),
            };
            Column::Numbers(series.str().map_err(format)?.iter().enumerate().map(cell).collect::<Result<_, _>>()?)
        });
    }
    Ok(Columns { columns, row_name: "line", first_row: 2 })
}

fn clip(text: &str) -> String {
    text.lines().next().unwrap_or("").chars().take(120).collect()
}
