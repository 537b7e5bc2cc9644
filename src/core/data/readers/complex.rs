//! Complex numbers as text, as NumPy, MATLAB and others write them: `(1+2j)`, `1-2i`, `2.5e-3 + 1e-4j`. A column of them is asked for by its
//! parts, `real(H)` and `imag(H)`.

/// Which part of a complex column is asked for: 0 the real one, 1 the imaginary one; and the name of the column.
pub(super) fn part(name: &str) -> Option<(usize, &str)> {
    let inside = |word: &str| name.strip_prefix(word)?.strip_prefix('(')?.strip_suffix(')').map(str::trim);
    ["real", "imag"].iter().enumerate().find_map(|(k, word)| Some((k, inside(word)?)))
}

/// Real and imaginary part; of a real number too.
pub(super) fn parse(cell: &str) -> Option<[f64; 2]> {
    let cell = cell.trim();
    let cell = cell.strip_prefix('(').and_then(|c| c.strip_suffix(')')).unwrap_or(cell);
    let text: String = cell.chars().filter(|c| !c.is_whitespace()).collect();
    let Some(text) = text.strip_suffix(['j', 'i', 'J', 'I']) else { return Some([number(&text)?, 0.0]) };
    let text = text.strip_suffix('*').unwrap_or(text);
    // The sign between the parts is the last one that belongs to no exponent.
    let bytes = text.as_bytes();
    let sign = (1..bytes.len()).rev().find(|k| matches!(bytes[*k], b'+' | b'-') && !matches!(bytes[*k - 1], b'e' | b'E'));
    let (re, im) = text.split_at(sign.unwrap_or(0));
    Some([if re.is_empty() { 0.0 } else { number(re)? }, number(im)?])
}

/// A number with a point or, where it has none, a comma for it: `inf` and `nan` are none here.
fn number(text: &str) -> Option<f64> {
    let text = if text.contains('.') { text.into() } else { text.replacen(',', ".", 1) };
    text.bytes().any(|b| b.is_ascii_digit()).then(|| text.parse().ok()).flatten()
}

/// Whether the cell is complex and not a plain number.
pub(super) fn is(cell: &str) -> bool {
    cell.trim_end().ends_with(['j', 'i', 'J', 'I', ')']) && parse(cell).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_programs_write_is_read() {
        for (text, value) in [
            ("(1+2j)", [1.0, 2.0]),
            ("(-1.5e-03-2e+01j)", [-1.5e-3, -20.0]),
            ("2.5e-3 + 1e-4i", [2.5e-3, 1e-4]),
            ("3j", [0.0, 3.0]),
            ("-3e-2j", [0.0, -3e-2]),
            ("1-2*i", [1.0, -2.0]),
            ("(7)", [7.0, 0.0]),
            ("7.5", [7.5, 0.0]),
            ("-0,3-4,0i", [-0.3, -4.0]),
        ] {
            assert_eq!(parse(text), Some(value), "{text}");
        }
        for text in ["", "j", "(1+2j", "1+j2", "a+2j", "1+2k", "nan+1j", "(1+infj)", "--1j"] {
            assert_eq!(parse(text), None, "{text}");
        }
        assert!(is("(1+2j)") && !is("1.5") && !is("N (mm)"));
        assert_eq!((part("real(H)"), part("imag( H [m/N] )"), part("real H")), (Some((0, "H")), Some((1, "H [m/N]")), None));
    }
}
