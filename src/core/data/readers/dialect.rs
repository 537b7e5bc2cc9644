//! How a text file is written: separator, decimal mark, where its header and its rows begin, units in the header.
//!
//! The header is the first line that is followed by rows of as many cells, numbers among them. Comment lines and other text may stand before it,
//! a row of units after it. Where two readings are possible the file is refused.

use std::path::Path;

use super::DataError;
use crate::data::error::FileError;
use crate::data::uff::decode;
use crate::units::parse_unit_any;

/// Bytes of a file in which its header is looked for.
pub(super) const HEAD: usize = 1 << 20;
/// Lines before the header at most.
const PREAMBLE: usize = 100;
/// Rows looked at.
const ROWS: usize = 5;

/// How the file is written.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Dialect {
    /// `,`, `;`, tab, or space for runs of spaces.
    pub separator: u8,
    pub decimal_comma: bool,
    /// Cells of the header.
    pub names: Vec<String>,
    /// Unit of each column: in brackets in the header, or from the row of units.
    pub units: Vec<Option<String>>,
    /// Where the rows begin: byte, and line from 1.
    pub body: usize,
    pub first_line: usize,
}

/// Refuses bytes that no text begins with.
pub(super) fn whole_text(path: &Path, bytes: &[u8]) -> Result<(), DataError> {
    let Some(at) = memchr::memchr(0, &bytes[..bytes.len().min(HEAD)]) else { return Ok(()) };
    let line = 1 + memchr::memchr_iter(b'\n', &bytes[..at]).count();
    Err(FileError {
        file: path.to_path_buf(),
        place: format!("line {line}"),
        message: "a byte of 0, which no text has: the file is binary, damaged, or UTF-16".into(),
        accepted: "UTF-8 text, or a name that ends as the format's do: .parquet, .uff, .unv, .mat".into(),
    }
    .into())
}

struct Line<'a> {
    text: std::borrow::Cow<'a, str>,
    end: usize,
}

/// Finds the dialect. A file without a line that fits is taken to begin with its header, so that the errors name what is wrong there.
pub(crate) fn find(path: &Path, bytes: &[u8]) -> Result<Dialect, DataError> {
    let lines = head(bytes);
    let comment = |l: &Line| {
        let t = l.text.trim();
        t.is_empty() || t.starts_with(['#', '%']) || t.starts_with("//")
    };
    for (h, line) in lines.iter().enumerate().take(PREAMBLE).filter(|(_, l)| !comment(l)) {
        let fits: Vec<(usize, Dialect)> = SEPARATORS.iter().filter_map(|s| candidate(&lines, h, *s)).collect();
        let best = fits.iter().map(|f| f.0).max().unwrap_or(0);
        let mut top = fits.into_iter().filter(|f| f.0 == best);
        match (top.next(), top.next()) {
            (Some(a), Some(b)) if b.1.separator != b' ' => {
                let reason =
                    format!("line {}: the columns may be separated by `{}` or by `{}`", h + 1, show(a.1.separator), show(b.1.separator));
                return Err(DataError::Format { file: path.to_path_buf(), reason });
            }
            (Some((_, dialect)), _) => return marks(path, dialect, &lines),
            _ => {}
        }
        // A line of numbers ends the preamble: what follows is no header.
        if cells(&line.text, b',').is_some_and(|c| !c.is_empty() && c.iter().all(|c| numeric(c))) {
            break;
        }
    }
    let first = lines.iter().position(|l| !comment(l)).unwrap_or(0);
    let line = lines.get(first);
    let text = line.map_or("", |l| &l.text);
    let separator = SEPARATORS[..3].iter().copied().find(|s| cells(text, *s).is_some_and(|c| c.len() > 1)).unwrap_or(b',');
    let names = cells(text, separator).ok_or_else(|| unclosed(path, first + 1))?;
    let body = line.map_or(bytes.len(), |l| l.end);
    let units = names.iter().map(|n| bracket(n)).collect();
    marks(path, Dialect { separator, decimal_comma: false, names, units, body, first_line: first + 2 }, &lines)
}

const SEPARATORS: [u8; 4] = [b'\t', b';', b',', b' '];

fn show(separator: u8) -> &'static str {
    match separator {
        b'\t' => "tab",
        b';' => ";",
        b',' => ",",
        _ => "space",
    }
}

pub(super) fn unclosed(path: &Path, line: usize) -> DataError {
    DataError::Format { file: path.to_path_buf(), reason: format!("line {line}: a quote is not closed") }
}

fn head(bytes: &[u8]) -> Vec<Line<'_>> {
    let mut from = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    let mut lines = Vec::new();
    while from < bytes.len() && lines.len() < PREAMBLE + ROWS + 3 {
        let end = memchr::memchr(b'\n', &bytes[from..]).map_or(bytes.len(), |k| from + k + 1);
        let line = bytes[from..end].strip_suffix(b"\n").unwrap_or(&bytes[from..end]);
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        lines.push(Line { text: decode(&line[..line.len().min(100_000)]), end });
        from = end;
    }
    lines
}

/// The dialect if line `h` is its header under this separator, with the number of numeric cells in the rows looked at.
fn candidate(lines: &[Line<'_>], h: usize, separator: u8) -> Option<(usize, Dialect)> {
    let mut names = cells(&lines[h].text, separator)?;
    let mut first = h + 1;
    let next = cells(&lines.get(first)?.text, separator)?;
    let unit_like = |c: &String| c.is_empty() || parse_unit_any(strip(c)).is_ok();
    let has_units = next.len() == names.len() && next.iter().any(|c| !c.is_empty()) && next.iter().all(|c| unit_like(c) && !numeric(c));
    let unit_row = if has_units {
        first += 1;
        Some(next)
    } else {
        None
    };
    let row = |i: usize| lines.get(i).filter(|l| !l.text.trim().is_empty()).map(|l| cells(&l.text, separator));
    let rows: Vec<Vec<String>> = (first..first + ROWS).map_while(row).collect::<Option<_>>()?;
    let n = rows.first()?.len();
    if separator == b' ' && names.len() != n {
        names = grouped(&lines[h].text);
    }
    if n < 2 || names.len() != n || names.iter().any(|c| numeric(c)) {
        return None;
    }
    let mut count = 0;
    for k in 0..n {
        let column = || rows.iter().map(|r| r.get(k).map_or("", String::as_str)).filter(|c| !c.is_empty());
        let numbers = column().filter(|c| numeric(c)).count();
        // A column of numbers begins with one; a bad cell further down is refused where it stands.
        if numbers > 0 && (column().next().is_some_and(|c| !numeric(c)) || 2 * numbers < column().count()) {
            return None;
        }
        count += numbers;
    }
    if count == 0 || rows.iter().any(|r| r.len() != n) {
        return None;
    }
    let units: Vec<Option<String>> = match unit_row {
        Some(row) => {
            row.iter().zip(&names).map(|(u, name)| Some(strip(u).to_string()).filter(|u| !u.is_empty()).or_else(|| bracket(name))).collect()
        }
        None => names.iter().map(|n| bracket(n)).collect(),
    };
    let body = lines.get(first - 1)?.end;
    Some((count, Dialect { separator, decimal_comma: false, names, units, body, first_line: first + 1 }))
}

/// Settles the decimal mark by the rows looked at.
fn marks(path: &Path, mut dialect: Dialect, lines: &[Line<'_>]) -> Result<Dialect, DataError> {
    if dialect.separator == b',' {
        return Ok(dialect);
    }
    let rows = lines.iter().skip(dialect.first_line - 1).take(ROWS).filter_map(|l| cells(&l.text, dialect.separator));
    let found: Vec<String> = rows.flatten().filter(|c| numeric(c)).collect();
    let comma = found.iter().any(|c| c.contains(','));
    if comma && found.iter().any(|c| c.contains('.')) {
        let reason = format!("line {}: decimal commas and decimal points stand side by side", dialect.first_line);
        return Err(DataError::Format { file: path.to_path_buf(), reason });
    }
    dialect.decimal_comma = comma;
    Ok(dialect)
}

/// A number with a point or a comma.
pub(super) fn numeric(cell: &str) -> bool {
    let one = cell.bytes().filter(|b| *b == b',').count() <= 1;
    one && cell.bytes().any(|b| b.is_ascii_digit()) && cell.replace(',', ".").parse::<f64>().is_ok()
}

/// The cells of a line, trimmed, quotes taken off; none when a quote is not closed on the line.
pub(super) fn cells(line: &str, separator: u8) -> Option<Vec<String>> {
    if separator == b' ' {
        let closed = |word: &str| word.matches('"').count().is_multiple_of(2);
        return line.split_whitespace().all(closed).then(|| line.split_whitespace().map(str::to_string).collect());
    }
    let (mut all, mut cell, mut quoted) = (Vec::new(), String::new(), false);
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            c if c == char::from(separator) && !quoted => all.push(std::mem::take(&mut cell).trim().to_string()),
            _ => cell.push(c),
        }
    }
    all.push(cell.trim().to_string());
    (!quoted).then_some(all)
}

/// Words, with brackets and what is in them joined to the word before: `Force (N mm)`.
fn grouped(line: &str) -> Vec<String> {
    let (mut all, mut depth): (Vec<String>, usize) = (Vec::new(), 0);
    for word in line.split_whitespace() {
        let opens = word.starts_with(['[', '(']);
        match all.last_mut() {
            Some(last) if depth > 0 || opens => {
                last.push(' ');
                last.push_str(word);
            }
            _ => all.push(word.to_string()),
        }
        depth = (depth + word.matches(['[', '(']).count()).saturating_sub(word.matches([']', ')']).count());
    }
    all
}

fn strip(text: &str) -> &str {
    let text = text.trim();
    let inner = |open: char, close: char| text.strip_prefix(open).and_then(|t| t.strip_suffix(close));
    inner('[', ']').or_else(|| inner('(', ')')).unwrap_or(text).trim()
}

/// The unit in the brackets at the end of a name: `N` of `Force [N]`.
pub(crate) fn bracket(name: &str) -> Option<String> {
    let open = match name.trim_end().chars().last()? {
        ']' => '[',
        ')' => '(',
        _ => return None,
    };
    let at = name.find(open)?;
    let inside = name.trim_end().get(at + 1..name.trim_end().len() - 1)?.trim();
    // A number in brackets counts something; it is no unit.
    (!inside.is_empty() && inside.parse::<f64>().is_err()).then(|| inside.to_string())
}

/// The name without the unit in brackets.
pub(crate) fn bare(name: &str) -> &str {
    match bracket(name) {
        Some(_) => name.find(['[', '(']).and_then(|at| name.get(..at)).unwrap_or(name).trim(),
        None => name.trim(),
    }
}
