//! Numbers as Fortran writes them, fast.

use super::text::Fault;

const ACCEPTED: &str = "numbers such as 1.5, -3.2E-04 or 1.0D+00, separated by spaces or in the columns of the set";

/// One number: `1.5`, `-3E-4`, `1.0D+00`, `.5d2`, and `1.2345-105` (three digits of exponent push the letter out of a Fortran field).
/// `nan` and `inf` are read as such; the caller refuses them.
pub fn number(text: &[u8]) -> Option<f64> {
    if let Ok(v) = fast_float2::parse::<f64, _>(text) {
        return Some(v);
    }
    // Without a digit up front it is no number in Fortran dress.
    let sign = usize::from(matches!(text.first(), Some(b'+' | b'-')));
    let at = sign + text.get(sign..)?.iter().position(|b| matches!(b, b'd' | b'D' | b'+' | b'-'))?;
    if at == sign || text.len() > 64 {
        return None;
    }
    let mut plain = text.get(..at)?.to_vec();
    plain.push(b'e');
    let letter = usize::from(matches!(text.get(at), Some(b'd' | b'D')));
    plain.extend_from_slice(text.get(at + letter..)?);
    fast_float2::parse::<f64, _>(&plain).ok()
}

/// All numbers of `bytes`, line by line. Where the words of a line are not all numbers, its columns are tried: `patterns` are lists of widths,
/// repeated along the line. At most `limit` numbers are taken, so that a file which lies cannot fill the memory.
pub(super) fn all(bytes: &[u8], patterns: &[&[usize]], limit: usize) -> Result<Vec<f64>, Fault> {
    // A number and the space before it take two bytes at least.
    let mut out = Vec::with_capacity(limit.min(bytes.len() / 2 + 1));
    let mut from = 0;
    while from < bytes.len() && out.len() < limit {
        let end = memchr::memchr(b'\n', &bytes[from..]).map_or(bytes.len(), |k| from + k);
        let line = &bytes[from..end];
        let before = out.len();
        if !words(line, &mut out) {
            out.truncate(before);
            if !patterns.iter().any(|p| {
                out.truncate(before);
                columns(line, p, &mut out)
            }) {
                return Err(fault(line, from));
            }
        }
        from = end + 1;
    }
    Ok(out)
}

/// Appends the words of a line; false at the first that is no number.
#[inline]
fn words(line: &[u8], out: &mut Vec<f64>) -> bool {
    let mut at = 0;
    loop {
        while at < line.len() && line[at] <= b' ' {
            at += 1;
        }
        if at == line.len() {
            return true;
        }
        match fast_float2::parse_partial::<f64, _>(&line[at..]) {
            Ok((v, used)) if line.get(at + used).is_none_or(|b| *b <= b' ') => {
                out.push(v);
                at += used;
            }
            _ => {
                let end = line[at..].iter().position(|b| *b <= b' ').map_or(line.len(), |k| at + k);
                // A sign inside a word may part two numbers that fill their columns: only a letter makes the reading sure.
                let sure = line[at..end].iter().any(|b| matches!(b, b'd' | b'D')) && end - at <= 25;
                match number(&line[at..end]).filter(|_| sure) {
                    Some(v) => out.push(v),
                    None => return false,
                }
                at = end;
            }
        }
    }
}

/// Appends the columns of a line; false where one holds no number. Blanks at the end are no columns.
fn columns(line: &[u8], widths: &[usize], out: &mut Vec<f64>) -> bool {
    let line = line.trim_ascii_end();
    let (mut at, mut k) = (0, 0);
    while at < line.len() {
        let end = (at + widths.get(k % widths.len().max(1)).copied().unwrap_or(13)).min(line.len());
        match number(line[at..end].trim_ascii()) {
            Some(v) => out.push(v),
            None => return false,
        }
        at = end;
        k += 1;
    }
    true
}

fn fault(line: &[u8], offset: usize) -> Fault {
    let bad = line.split(|b| *b <= b' ').find(|w| !w.is_empty() && number(w).is_none()).unwrap_or(line);
    let shown: String = super::text::decode(bad).chars().take(40).collect();
    Fault::new(offset, format!("`{shown}` is not a number"), ACCEPTED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fortran_numbers() {
        for (text, value) in [
            ("1.5", 1.5),
            ("-3.2E-04", -3.2e-4),
            ("1.0D+00", 1.0),
            ("-2.73149999999999960D+02", -273.15),
            ("+.5d2", 50.0),
            ("1.2345-105", 1.2345e-105),
            ("1.2345+105", 1.2345e105),
            ("7", 7.0),
        ] {
            assert_eq!(number(text.as_bytes()), Some(value), "{text}");
        }
        for text in ["", "-", "1.0.0", "abc", "1.0D", "D+00", "1,5", "--1"] {
            assert_eq!(number(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn words_or_columns() {
        let six: &[&[usize]] = &[&[13]];
        assert_eq!(all(b" 1.0 2\r\n3.5D+01\n\n", six, 100).unwrap(), [1.0, 2.0, 35.0]);
        // Full columns without a space between them.
        assert_eq!(all(b"-1.00000E+000-2.00000E+000\n", six, 100).unwrap(), [-1.0, -2.0]);
        assert_eq!(all(b" 1.00000E-105 2.00000-105\n", six, 100).unwrap(), [1e-105, 2e-105]);
        let e = all(b" 1.0 2.0\n 1.0 x.0\n", six, 100).unwrap_err();
        assert_eq!((e.offset, e.message.as_str()), (9, "`x.0` is not a number"));
        assert_eq!(all(b"1 2 3\n4 5 6\n7", six, 4).unwrap().len(), 6);
    }
}
