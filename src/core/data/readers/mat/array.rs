//! Arrays of a MATLAB file: those of version 5 parsed here, those of version 7.3 put together by [`super::hdf`].

use std::borrow::Cow;

pub(super) const MATRIX: u32 = 14;
pub(super) const COMPRESSED: u32 = 15;
/// Structures in structures are followed this far.
pub(super) const DEPTH: usize = 8;

/// Bytes in the byte order of the file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bytes<'a> {
    pub data: &'a [u8],
    pub big: bool,
}

/// A data element: its type, its bytes, where the next one begins.
pub(super) struct Element<'a> {
    pub kind: u32,
    pub data: &'a [u8],
    pub next: usize,
}

/// An array.
#[derive(Debug)]
pub(super) struct Array<'a> {
    pub name: String,
    pub class: u8,
    pub dims: Vec<usize>,
    pub body: Body<'a>,
}

#[derive(Debug)]
pub(super) enum Body<'a> {
    Numeric {
        re: Numbers<'a>,
        im: Option<Numbers<'a>>,
    },
    /// A structure of one element.
    Struct(Vec<(String, Array<'a>)>),
    /// The elements of a cell array, or of an array of structures.
    Elements(Vec<Array<'a>>),
    Other,
}

/// Numbers as stored, in types of data elements (`miINT8` = 1 and so on).
#[derive(Debug, Clone)]
pub(super) struct Numbers<'a> {
    pub kind: u32,
    pub bytes: Cow<'a, [u8]>,
    pub big: bool,
}

fn u32_at(bytes: &[u8], at: usize, big: bool) -> Option<u32> {
    let four = bytes.get(at..)?.first_chunk::<4>()?;
    Some(if big { u32::from_be_bytes(*four) } else { u32::from_le_bytes(*four) })
}

/// The element at `at`: a tag of type and size, or both in four bytes with four bytes of data.
pub(super) fn element(bytes: &[u8], at: usize, big: bool) -> Result<Element<'_>, String> {
    let short = || format!("it ends inside an element at byte {at}");
    let tag = u32_at(bytes, at, big).ok_or_else(short)?;
    if tag >> 16 != 0 {
        let size = (tag >> 16) as usize;
        let data = bytes.get(at + 4..at + 4 + size.min(4)).filter(|_| size <= 4).ok_or_else(short)?;
        return Ok(Element { kind: tag & 0xffff, data, next: at + 8 });
    }
    let size = u32_at(bytes, at + 4, big).ok_or_else(short)? as usize;
    let data = bytes.get(at + 8..at + 8 + size).ok_or_else(short)?;
    // Elements are padded to eight bytes, compressed ones are not.
    let padded = if tag == COMPRESSED { size } else { size.next_multiple_of(8) };
    Ok(Element { kind: tag, data, next: at + 8 + padded })
}

impl Numbers<'_> {
    /// Bytes of a number of that type.
    pub fn width_of(kind: u32) -> usize {
        match kind {
            1 | 2 => 1,
            3 | 4 => 2,
            5..=7 => 4,
            _ => 8,
        }
    }

    fn len(&self) -> usize {
        self.bytes.len() / Self::width_of(self.kind)
    }

    /// `count` numbers from number `from` on.
    pub fn numbers(&self, from: usize, count: usize) -> Vec<f64> {
        let width = Self::width_of(self.kind);
        let all = self.bytes.chunks_exact(width).skip(from).take(count);
        let big = self.big;
        macro_rules! read {
            ($t:ty) => {
                all.map(|c| c.try_into().map_or(f64::NAN, |b| (if big { <$t>::from_be_bytes(b) } else { <$t>::from_le_bytes(b) }) as f64))
                    .collect()
            };
        }
        match self.kind {
            1 => read!(i8),
            2 => read!(u8),
            3 => read!(i16),
            4 => read!(u16),
            5 => read!(i32),
            6 => read!(u32),
            7 => read!(f32),
            12 => read!(i64),
            13 => read!(u64),
            _ => read!(f64),
        }
    }
}

impl Array<'_> {
    /// Rows, and columns with all further dimensions.
    pub fn shape(&self) -> (usize, usize) {
        let rows = self.dims.first().copied().unwrap_or(0);
        (rows, self.dims.iter().skip(1).fold(1, |n: usize, d| n.saturating_mul(*d)))
    }

    pub fn class_word(&self) -> &'static str {
        match (self.class, &self.body) {
            (1, _) => "cell array",
            (2, Body::Struct(_)) => "structure",
            (2, _) => "array of structures",
            (3, _) => "object",
            (4, _) => "text",
            (5, _) => "sparse matrix",
            (16, _) => "function handle",
            (17, _) => "object",
            (_, Body::Numeric { im: Some(_), .. }) => "complex array",
            _ => "numeric array",
        }
    }
}

/// Parses the content of a matrix element.
pub(super) fn parse(bytes: Bytes<'_>, depth: usize) -> Result<Array<'_>, String> {
    let Bytes { data, big } = bytes;
    // An empty field of a structure has no content at all.
    if data.is_empty() {
        return Ok(Array { name: String::new(), class: 0, dims: vec![0, 0], body: Body::Other });
    }
    let flags = element(data, 0, big)?;
    let word = u32_at(flags.data, 0, big).filter(|_| flags.kind == 6).ok_or("an array without flags")?;
    let (class, complex) = ((word & 0xff) as u8, word & 0x0800 != 0);
    if class == 17 {
        // Opaque objects have neither dimensions nor a common form.
        let name = element(data, flags.next, big).map(|e| text(e.data)).unwrap_or_default();
        return Ok(Array { name, class, dims: vec![1, 1], body: Body::Other });
    }
    let sizes = element(data, flags.next, big)?;
    let size = |c: &[u8]| u32_at(c, 0, big).and_then(|n| usize::try_from(n).ok()).filter(|n| *n <= i32::MAX as usize);
    let dims: Vec<usize> = sizes.data.chunks_exact(4).map(size).collect::<Option<_>>().ok_or("a negative dimension")?;
    if sizes.kind != 5 || dims.len() < 2 {
        return Err("an array without dimensions".into());
    }
    let count = dims.iter().try_fold(1usize, |n, d| n.checked_mul(*d)).ok_or("dimensions beyond any array")?;
    let named = element(data, sizes.next, big)?;
    let name = text(named.data);
    let at = named.next;
    let body = match class {
        6..=15 => {
            let part = |at: usize| {
                let stored = element(data, at, big)?;
                let numbers = Numbers { kind: stored.kind, bytes: Cow::Borrowed(stored.data), big };
                if !matches!(stored.kind, 1..=7 | 9 | 12 | 13) {
                    return Err(format!("`{name}` is stored in numbers of type {}", stored.kind));
                }
                if numbers.len() != count {
                    return Err(format!("`{name}` has {} numbers, and its dimensions say {count}", numbers.len()));
                }
                Ok((numbers, stored.next))
            };
            let (re, after) = part(at)?;
            Body::Numeric { re, im: if complex { Some(part(after)?.0) } else { None } }
        }
        1 if depth < DEPTH => Body::Elements(cells(data, at, count, big, depth)?),
        2 if depth < DEPTH => structures(data, at, count, big, depth)?,
        _ => Body::Other,
    };
    Ok(Array { name, class, dims, body })
}

/// The array in the element at `at`, inside another one, and where the next one begins.
fn inner(data: &[u8], at: usize, big: bool, depth: usize) -> Result<(Array<'_>, usize), String> {
    let value = element(data, at, big)?;
    if value.kind != MATRIX {
        return Err("a cell or a field of a structure that is no array".into());
    }
    Ok((parse(Bytes { data: value.data, big }, depth + 1)?, value.next))
}

/// The cells of a cell array, column by column as MATLAB counts them. Each takes bytes of the file, whatever the dimensions say.
fn cells(data: &[u8], mut at: usize, count: usize, big: bool, depth: usize) -> Result<Vec<Array<'_>>, String> {
    let mut all = Vec::new();
    for _ in 0..count {
        let (cell, next) = inner(data, at, big, depth)?;
        all.push(cell);
        at = next;
    }
    Ok(all)
}

/// A structure, or the structures of an array: all fields of the first, then all of the second.
fn structures(data: &[u8], at: usize, count: usize, big: bool, depth: usize) -> Result<Body<'_>, String> {
    let length = element(data, at, big)?;
    let width = u32_at(length.data, 0, big).filter(|w| (1..=4096).contains(w)).ok_or("a structure without names of its fields")? as usize;
    let named = element(data, length.next, big)?;
    let names: Vec<String> = named.data.chunks_exact(width).map(text).collect();
    let mut at = named.next;
    // Structures without fields take no bytes: none of them is worth a place.
    let count = if names.is_empty() { count.min(1) } else { count };
    let mut all = Vec::new();
    for _ in 0..count {
        let mut fields = Vec::with_capacity(names.len());
        for name in &names {
            let (value, next) = inner(data, at, big, depth)?;
            fields.push((name.clone(), value));
            at = next;
        }
        all.push(fields);
    }
    if count == 1 {
        return Ok(Body::Struct(all.pop().unwrap_or_default()));
    }
    let one = |fields| Array { name: String::new(), class: 2, dims: vec![1, 1], body: Body::Struct(fields) };
    Ok(Body::Elements(all.into_iter().map(one).collect()))
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
