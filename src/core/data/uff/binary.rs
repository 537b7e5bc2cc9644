//! Set 58b: where its bytes end, and their decoding.
//!
//! Line of the number: I6 `58`, A1 `b`, I6 byte order (1 little, 2 big endian), I6 floating-point format (2 IEEE 754), I12 lines of text that
//! follow, I12 bytes of data that follow them. The count of bytes, the count of points in the text and the closing marker have to agree.

use super::function;
use super::scan::{closes, is_marker_at};
use super::text::{Fault, Fields, Line};

const WHOLE: &str = "a file copied as binary, whose counts of points and bytes agree with the bytes that stand there";

/// What the line of the number says.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Binary {
    pub big_endian: bool,
    /// Where the data begin, counted from the body of the set.
    pub data: usize,
    /// Bytes of one point.
    pub stride: usize,
    /// Bytes the header names, where they are not those that stand there.
    pub lie: Option<u64>,
}

/// Reads the line of the number (`head`), finds where the data begin and end. `body` is the offset of the line after it; the offsets of faults
/// count from the beginning of the file.
pub(super) fn locate(bytes: &[u8], head: &str, body: usize) -> Result<(Binary, usize), Fault> {
    let line = Line { offset: body, text: head.into() };
    let fields = Fields::new(&line, &[6, 1, 6, 6, 12, 12]);
    let order = fields.integer(2, "the byte order")?;
    let format = fields.integer(3, "the floating-point format")?;
    let text_lines = fields.integer(4, "the number of lines of text")?;
    let declared = fields.integer(5, "the number of bytes")?;
    if !matches!(order, 1 | 2) {
        return Err(Fault::new(body, format!("a byte order of {order}"), "1 (little endian) or 2 (big endian)"));
    }
    if format != 2 {
        return Err(Fault::new(
            body,
            format!("floating-point format {format}"),
            "format 2, IEEE 754; export the file again from the program that wrote it",
        ));
    }
    if !matches!(text_lines, 0 | 11) {
        return Err(Fault::new(body, format!("{text_lines} lines of text before the data"), "11 lines"));
    }
    let rest = bytes.get(body..).unwrap_or(&[]);
    let in_file = |f: Fault| Fault { offset: body + f.offset, ..f };
    let (header, data) = function::header(rest).map_err(in_file)?;
    let strides = strides(header.ordinate_type, header.even)
        .ok_or_else(|| Fault::new(body, format!("ordinate data type {}", header.ordinate_type), function::TYPES))?;
    let start = body + data;
    let size = |stride: usize| header.points.checked_mul(stride).and_then(|n| n.checked_add(start)).filter(|end| *end <= bytes.len());
    let found = strides.iter().find_map(|s| size(*s).filter(|end| closes(bytes, *end)).map(|end| (*s, end)));
    let Some((stride, end)) = found else {
        return Err(Fault::new(start, contradiction(bytes, start, header.points, strides, declared), WHOLE));
    };
    let stands = (end - start) as u64;
    let lie = u64::try_from(declared).ok().filter(|d| *d != stands);
    Ok((Binary { big_endian: order == 2, data, stride, lie }, end))
}

/// Says which of the counts does not hold.
fn contradiction(bytes: &[u8], start: usize, points: usize, strides: &[usize], declared: i64) -> String {
    let stride = strides.first().copied().unwrap_or(1) as u128;
    let needed = points as u128 * stride;
    let left = bytes.len().saturating_sub(start);
    let said = format!("{points} points of {stride} bytes need {needed} bytes, the header names {declared}");
    let marker = memchr::memmem::find_iter(bytes.get(start..).unwrap_or(&[]), b"    -1").find(|k| is_marker_at(bytes, start + k));
    let Some(end) = marker.map(|k| start + k) else {
        return if needed > left as u128 {
            format!("the file ends before the set does: {said}, {left} are left")
        } else {
            format!("no closing line `    -1` after the data: {said}")
        };
    };
    let data = bytes.get(start..end).unwrap_or(&[]);
    let stands = data.len();
    let pairs = memchr::memmem::find_iter(data, b"\r\n").count();
    let lone = memchr::memchr_iter(b'\n', data).count() - pairs;
    if lone == 0 && pairs > 0 && stands as u128 > needed && (stands as u128 - needed) <= pairs as u128 + 2 {
        return format!("{said}, {stands} stand there, and every line feed has a carriage return before it: the file was copied as text");
    }
    format!("{said}, and a closing line stands after {stands}")
}

/// Bytes a point may have: abscissa (where uneven, single or double) and ordinate.
fn strides(ordinate_type: i64, even: bool) -> Option<&'static [usize]> {
    Some(match (ordinate_type, even) {
        (2, true) => &[4],
        (2, false) => &[8],
        (4, true) => &[8],
        (4, false) => &[16, 12],
        (5, true) => &[8],
        (5, false) => &[12],
        (6, true) => &[16],
        (6, false) => &[24, 20],
        _ => return None,
    })
}

/// The numbers of the data in the order they stand: (abscissa,) ordinate (, imaginary part).
pub(super) fn numbers(body: &[u8], b: &Binary, double: bool) -> Vec<f64> {
    let data = body.get(b.data..).unwrap_or(&[]);
    // An uneven double with a single-precision abscissa is the one mixed record.
    let mixed = double && b.stride % 8 == 4;
    if mixed {
        let single = |c: &[u8]| {
            c.first_chunk::<4>().map_or(f64::NAN, |c| f64::from(if b.big_endian { f32::from_be_bytes(*c) } else { f32::from_le_bytes(*c) }))
        };
        let pair = |c: &[u8]| {
            c.first_chunk::<8>().map_or(f64::NAN, |c| if b.big_endian { f64::from_be_bytes(*c) } else { f64::from_le_bytes(*c) })
        };
        return data.chunks_exact(b.stride).flat_map(|p| std::iter::once(single(p)).chain(p[4..].chunks_exact(8).map(pair))).collect();
    }
    match (double, b.big_endian) {
        (true, false) => data.as_chunks::<8>().0.iter().map(|c| f64::from_le_bytes(*c)).collect(),
        (true, true) => data.as_chunks::<8>().0.iter().map(|c| f64::from_be_bytes(*c)).collect(),
        (false, false) => data.as_chunks::<4>().0.iter().map(|c| f64::from(f32::from_le_bytes(*c))).collect(),
        (false, true) => data.as_chunks::<4>().0.iter().map(|c| f64::from(f32::from_be_bytes(*c))).collect(),
    }
}
