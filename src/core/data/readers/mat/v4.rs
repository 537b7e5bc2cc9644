//! MATLAB files of version 4 (`save -v4`, and programs that never wrote another): of each variable a header of 20 bytes, its name, its numbers.
//!
//! Format: The MathWorks, "MAT-File Format", level 4.

use super::array::{Array, Body, Numbers};
use std::borrow::Cow;

/// Longest name, with the zero that ends it.
const NAME: usize = 64;

/// The header of a variable.
struct Header<'a> {
    name: &'a str,
    /// Type of its numbers, as a data element of version 5 has it.
    kind: u32,
    /// 0: numbers, 1: text, 2: sparse.
    class: u32,
    rows: usize,
    columns: usize,
    complex: bool,
    big: bool,
    /// Where its numbers begin.
    numbers: usize,
}

fn header(bytes: &[u8], at: usize) -> Option<Header<'_>> {
    let word = |k: usize, big: bool| {
        let four = bytes.get(at + 4 * k..)?.first_chunk::<4>()?;
        Some(if big { u32::from_be_bytes(*four) } else { u32::from_le_bytes(*four) })
    };
    // Thousands name the order of the bytes, tens the type of the numbers, ones the class.
    let big = word(0, false)? >= 1000;
    let form = word(0, big)?.checked_sub(if big { 1000 } else { 0 }).filter(|f| *f < 60)?;
    let kind = *[9, 7, 5, 3, 4, 2].get((form / 10) as usize)?;
    let class = Some(form % 10).filter(|c| *c <= 2)?;
    let size = |k: usize| word(k, big).and_then(|n| usize::try_from(n).ok()).filter(|n| *n <= i32::MAX as usize);
    let (rows, columns, length) = (size(1)?, size(2)?, size(4)?);
    let complex = match word(3, big)? {
        0 => false,
        1 => true,
        _ => return None,
    };
    let name = bytes.get(at + 20..at + 20 + length).filter(|_| (2..=NAME).contains(&length))?.strip_suffix(&[0])?;
    let name = std::str::from_utf8(name).ok().filter(|n| n.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'))?;
    Some(Header { name, kind, class, rows, columns, complex, big, numbers: at + 20 + length })
}

/// Whether the bytes begin with a variable of version 4: such a file has no mark of its own.
pub(super) fn is(bytes: &[u8]) -> bool {
    header(bytes, 0).is_some()
}

/// The variable at `at`, and where the next one begins.
pub(super) fn variable(bytes: &[u8], at: usize) -> Result<(Array<'_>, usize), String> {
    let h = header(bytes, at).ok_or_else(|| format!("no variable of version 4 at byte {at}"))?;
    let part = |from: usize| -> Option<(Numbers<'_>, usize)> {
        let end = h.rows.checked_mul(h.columns)?.checked_mul(Numbers::width_of(h.kind))?.checked_add(from)?;
        Some((Numbers { kind: h.kind, bytes: Cow::Borrowed(bytes.get(from..end)?), big: h.big }, end))
    };
    let short = || format!("it ends inside `{}`", h.name);
    let (re, mut end) = part(h.numbers).ok_or_else(short)?;
    let mut im = None;
    if h.complex {
        let (numbers, after) = part(end).ok_or_else(short)?;
        (im, end) = (Some(numbers), after);
    }
    let (class, body) = match h.class {
        0 => (6, Body::Numeric { re, im }),
        1 => (4, Body::Other),
        _ => (5, Body::Other),
    };
    Ok((Array { name: h.name.to_string(), class, dims: vec![h.rows, h.columns], body }, end))
}
