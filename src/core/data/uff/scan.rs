//! Finding the sets of a universal file.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::binary::{self, Binary};
use crate::data::DataError;
use crate::data::error::FileError;

/// A universal file with the places of its sets.
#[derive(Debug, Clone)]
pub struct UffFile {
    pub path: PathBuf,
    bytes: Vec<u8>,
    pub sets: Vec<Set>,
}

/// Where a set lies.
#[derive(Debug, Clone, PartialEq)]
pub struct Set {
    /// 58 for 58b too.
    pub number: u32,
    /// Byte of its number.
    pub offset: usize,
    /// Bytes after the line of the number up to the end marker.
    pub(super) body: Range<usize>,
    pub(super) binary: Option<Binary>,
}

impl Set {
    /// `58b`, `164`.
    pub fn name(&self) -> String {
        format!("{}{}", self.number, if self.binary.is_some() { "b" } else { "" })
    }
}

impl UffFile {
    /// Reads the file and finds its sets.
    pub fn open(path: &Path) -> Result<Self, DataError> {
        let bytes = crate::limits::bytes(path, crate::limits::DATA_BYTES)
            .map_err(|e| DataError::Unreadable { file: path.to_path_buf(), reason: e.to_string() })?;
        Self::from_bytes(path, bytes)
    }

    /// As [`UffFile::open`], from bytes already read.
    pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, DataError> {
        let mut file = Self { path: path.to_path_buf(), bytes, sets: Vec::new() };
        let mut at = 0;
        while let Some(start) = file.opening(at)? {
            let set = file.set(start)?;
            at = file.after_marker(set.body.end);
            file.sets.push(set);
        }
        if file.sets.is_empty() {
            return Err(file.error(0, None, "no set of a universal file", "sets between lines `    -1`"));
        }
        Ok(file)
    }

    /// The offset of the number line of the next set; none at the end of the file.
    fn opening(&self, mut at: usize) -> Result<Option<usize>, DataError> {
        while at < self.bytes.len() {
            let end = line_end(&self.bytes, at);
            if is_marker(&self.bytes[at..end]) {
                return Ok(Some((end + 1).min(self.bytes.len())));
            }
            // Blank lines, and the control characters some systems end a file with.
            if self.bytes[at..end].iter().any(|b| *b > b' ') {
                return Err(self.error(at, None, "text that belongs to no set", "a line `    -1` before and after each set"));
            }
            at = end + 1;
        }
        Ok(None)
    }

    fn set(&self, start: usize) -> Result<Set, DataError> {
        let end = line_end(&self.bytes, start);
        let line = self.bytes.get(start..end).unwrap_or(&[]);
        let head = super::text::decode(line);
        let first = head.get(..6.min(head.len())).unwrap_or(&head).trim();
        let word = head.split_whitespace().next().unwrap_or("");
        let number = first.parse().ok().or_else(|| word.trim_end_matches(['b', 'B']).parse().ok());
        let Some(number) = number else {
            let shown: String = head.trim().chars().take(40).collect();
            let message = if line.is_empty() {
                "the file ends after the opening of a set".into()
            } else {
                format!("`{shown}` where the number of a set is expected")
            };
            return Err(self.error(start, None, &message, "the number of a set after a line `    -1`, such as 58"));
        };
        let mut set = Set { number, offset: start, body: (end + 1).min(self.bytes.len())..0, binary: None };
        if number == 58 && head.trim_end().get(6..7).is_some_and(|c| c.eq_ignore_ascii_case("b")) {
            let found = binary::locate(&self.bytes, &head, set.body.start);
            let (binary, end) = found
                .map_err(|e| self.error(e.offset, Some(&Set { binary: Some(Binary::default()), ..set.clone() }), &e.message, e.accepted))?;
            set.body.end = end;
            set.binary = Some(binary);
            return Ok(set);
        }
        set.body.end = closing(&self.bytes, set.body.start).ok_or_else(|| {
            self.error(self.bytes.len(), Some(&set), "the file ends before the set does: no closing line `    -1`", "a whole file")
        })?;
        Ok(set)
    }

    fn after_marker(&self, at: usize) -> usize {
        // A binary set may close in the line of its last byte.
        let line = at + usize::from(self.bytes.get(at) == Some(&b'\r'));
        let line = line + usize::from(self.bytes.get(line) == Some(&b'\n'));
        line_end(&self.bytes, line) + 1
    }

    pub(super) fn body(&self, set: &Set) -> &[u8] {
        self.bytes.get(set.body.clone()).unwrap_or(&[])
    }

    /// An error at a byte; the line is named as long as all before it is text.
    pub(super) fn error(&self, offset: usize, set: Option<&Set>, message: &str, accepted: &str) -> DataError {
        let text = !self.sets.iter().any(|s| s.binary.is_some() && s.offset < offset);
        let inside = set.is_some_and(|s| s.binary.is_some() && offset > s.body.start + 2000);
        let before = self.bytes.get(..offset.min(self.bytes.len())).unwrap_or(&[]);
        let place =
            if text && !inside { format!("line {}", 1 + memchr::memchr_iter(b'\n', before).count()) } else { format!("byte {offset}") };
        let place = match set {
            Some(s) => format!(
                "{place}, set {} (the {} of the file)",
                s.name(),
                ordinal(self.sets.iter().filter(|t| t.offset < s.offset).count() + 1)
            ),
            None => place,
        };
        FileError { file: self.path.clone(), place, message: message.to_string(), accepted: accepted.to_string() }.into()
    }
}

fn ordinal(n: usize) -> String {
    let ending = match (n % 10, n % 100) {
        (1, k) if k != 11 => "st",
        (2, k) if k != 12 => "nd",
        (3, k) if k != 13 => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}

/// The end of the line that begins at `at` (its `\n`, or the end of the file).
fn line_end(bytes: &[u8], at: usize) -> usize {
    bytes.get(at..).and_then(|rest| memchr::memchr(b'\n', rest)).map_or(bytes.len(), |k| at + k)
}

/// `    -1` in the first six columns and nothing else; fewer spaces before it do no harm.
fn is_marker(line: &[u8]) -> bool {
    let end = line.trim_ascii_end();
    end.len() <= 6 && end.trim_ascii_start() == b"-1"
}

/// The offset of the first marker line at or after `from`, which begins a line.
fn closing(bytes: &[u8], from: usize) -> Option<usize> {
    if bytes.get(from..).is_some_and(|rest| is_marker(&rest[..line_end(rest, 0)])) {
        return Some(from);
    }
    let mut at = from;
    loop {
        at += memchr::memmem::find(bytes.get(at..)?, b"-1")?;
        let mut start = at;
        while start > from && bytes[start - 1] == b' ' {
            start -= 1;
        }
        if start > 0 && bytes[start - 1] == b'\n' && is_marker(&bytes[start..line_end(bytes, start)]) {
            return Some(start);
        }
        at += 2;
    }
}

/// Whether what is left of the line at `at` is a marker.
pub(super) fn is_marker_at(bytes: &[u8], at: usize) -> bool {
    bytes.get(at..line_end(bytes, at)).is_some_and(is_marker)
}

/// Whether the closing marker stands at `at`, or in the line after it.
pub(super) fn closes(bytes: &[u8], at: usize) -> bool {
    let rest = bytes.get(at..).unwrap_or(&[]);
    let rest = rest.strip_prefix(b"\r\n").or_else(|| rest.strip_prefix(b"\n")).unwrap_or(rest);
    is_marker(&rest[..line_end(rest, 0)])
}
