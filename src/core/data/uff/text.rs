//! Lines and fixed columns of the text in a universal file.

use std::borrow::Cow;

use super::numbers::number;

/// What is wrong inside a set; the offset counts from the beginning of its body.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fault {
    pub offset: usize,
    pub message: String,
    pub accepted: &'static str,
}

impl Fault {
    pub fn new(offset: usize, message: impl Into<String>, accepted: &'static str) -> Self {
        Self { offset, message: message.into(), accepted }
    }
}

/// Text of a file that may be UTF-8 or, where it is not, Latin-1 (`m/s²` as one byte).
pub fn decode(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|b| char::from(*b)).collect()),
    }
}

/// A line with where it begins in the body.
#[derive(Debug, Clone)]
pub(super) struct Line<'a> {
    pub offset: usize,
    pub text: Cow<'a, str>,
}

/// Line after line, ends (`\n`, `\r\n`) taken off.
#[derive(Debug, Clone)]
pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    pub at: usize,
}

impl<'a> Lines<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    pub fn next(&mut self) -> Option<Line<'a>> {
        let rest = self.bytes.get(self.at..).filter(|r| !r.is_empty())?;
        let (line, used) = match memchr::memchr(b'\n', rest) {
            Some(end) => (rest.get(..end)?, end + 1),
            None => (rest, rest.len()),
        };
        let offset = self.at;
        self.at += used;
        Some(Line { offset, text: decode(line.strip_suffix(b"\r").unwrap_or(line)) })
    }

    /// The next line, which must be there.
    pub fn need(&mut self, what: &str) -> Result<Line<'a>, Fault> {
        let at = self.at;
        self.next().ok_or_else(|| Fault::new(at, format!("the set ends before {what}"), "a whole set"))
    }

    /// What is left.
    pub fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or(&[])
    }
}

/// `width` characters from column `from` (counted from 0), trimmed; empty past the end of the line.
fn column(text: &str, from: usize, width: usize) -> &str {
    let cut = |n: usize| {
        if text.is_ascii() { n.min(text.len()) } else { text.char_indices().nth(n).map_or(text.len(), |c| c.0) }
    };
    text.get(cut(from)..cut(from + width)).unwrap_or("").trim()
}

/// A line of fixed columns; where the columns do not hold what they should, its words are taken instead, if there are exactly as many.
pub(super) struct Fields<'a> {
    line: &'a Line<'a>,
    cells: Vec<&'a str>,
    words: Vec<&'a str>,
}

impl<'a> Fields<'a> {
    pub fn new(line: &'a Line<'a>, widths: &[usize]) -> Self {
        let mut from = 0;
        let cells = widths
            .iter()
            .map(|w| {
                from += w;
                column(&line.text, from - w, *w)
            })
            .collect();
        let words: Vec<&str> = line.text.split_whitespace().collect();
        Self { line, words: if words.len() == widths.len() { words } else { Vec::new() }, cells }
    }

    pub fn text(&self, i: usize) -> String {
        self.cells.get(i).map_or(String::new(), |c| c.to_string())
    }

    /// A whole number; a blank is 0, as Fortran reads it.
    pub fn integer(&self, i: usize, what: &str) -> Result<i64, Fault> {
        let parse = |t: &str| if t.is_empty() { Some(0) } else { t.parse::<i64>().ok() };
        self.pick(i, what, "a whole number in its columns", parse)
    }

    /// A finite number; a blank is 0, as Fortran reads it.
    pub fn real(&self, i: usize, what: &str) -> Result<f64, Fault> {
        let parse = |t: &str| if t.is_empty() { Some(0.0) } else { number(t.as_bytes()).filter(|v| v.is_finite()) };
        self.pick(i, what, "a finite number in its columns", parse)
    }

    fn pick<T>(&self, i: usize, what: &str, accepted: &'static str, parse: impl Fn(&str) -> Option<T>) -> Result<T, Fault> {
        let cell = self.cells.get(i).copied().unwrap_or("");
        // Columns that split a word are not the columns this line was written in.
        let whole = self.words.is_empty() || cell.is_empty() || self.words.contains(&cell);
        let found = if whole { parse(cell) } else { None };
        found.or_else(|| parse(self.words.get(i)?)).ok_or_else(|| {
            let shown: String = cell.chars().take(40).collect();
            Fault::new(self.line.offset, format!("{what} is `{shown}`"), accepted)
        })
    }
}
