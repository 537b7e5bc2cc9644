//! Footer and page headers of a Parquet file, checked before polars decodes them.
//!
//! polars takes memory for as many values as a page header claims before it looks at the page. A damaged header that claims 2^60 values ends
//! the process (an allocation that fails cannot be caught), so the claims are held against the column's own count first; likewise for the
//! lists of the footer, which must have room in it. Both are Thrift compact structs (Apache Parquet format, `parquet.thrift`): only the
//! integers of page headers are read here, everything else is stepped over. The decoder takes a field to be of the type the format gives it,
//! whatever type the file says it is of, and would lose its way where the two differ; so that is an error too.

/// A column chunk's own claims.
pub(super) struct Chunk {
    pub start: usize,
    pub length: usize,
    pub values: i64,
    pub uncompressed: i64,
    /// Numbers, and not text.
    pub numbers: bool,
}

/// What a page may hold beside its values: statistics, levels of a nested column, padding.
const BESIDE: i64 = 1 << 16;
/// Bytes a number takes without encoding, with its levels of definition and repetition.
const NUMBER: i64 = 24;
/// Text that compresses better than this is not taken for a measurement's.
const TEXT_RATIO: i64 = 1 << 10;

/// Structs within lists within structs: a footer needs eleven levels (statistics of a column of a row group).
const DEPTH: usize = 24;
/// Bytes of the least struct that stands in a list: a field with its value, and the end.
const LEAST: u64 = 3;

/// Steps over the footer: all it claims must be in it. A file that does not end as Parquet does is left to the decoder to refuse.
pub(super) fn footer(bytes: &[u8]) -> Result<(), &'static str> {
    let Some((rest, tail)) = bytes.split_last_chunk::<8>() else { return Ok(()) };
    let [a, b, c, d, magic @ ..] = *tail;
    let length = u32::from_le_bytes([a, b, c, d]) as usize;
    if magic != *b"PAR1" || length > rest.len() {
        return Ok(());
    }
    let mut reader = Compact { bytes: &rest[rest.len() - length..] };
    reader.structure(Of::File, 0, &mut Page::default()).ok_or("its footer claims more than it holds")
}

/// Checks every page of a chunk: counts not negative, not above the chunk's, and summing to it; sizes within the chunk.
pub(super) fn check(bytes: &[u8], chunk: &Chunk) -> Result<(), &'static str> {
    let end = chunk.start.checked_add(chunk.length).filter(|e| *e <= bytes.len()).ok_or("a column lies outside the file")?;
    let mut rest = bytes.get(chunk.start..end).ok_or("a column lies outside the file")?;
    let mut values = 0i64;
    while !rest.is_empty() {
        let mut reader = Compact { bytes: rest };
        let mut page = Page::default();
        reader.structure(Of::Page, 0, &mut page).ok_or("a page header cannot be read")?;
        let size = usize::try_from(page.compressed).map_err(|_| "a page has a negative size")?;
        if page.uncompressed < 0 || page.uncompressed > chunk.uncompressed {
            return Err("a page claims more bytes than its column");
        }
        // What cannot be so by the page's own count of values, or by any compression of text.
        let most = if chunk.numbers {
            NUMBER.saturating_mul(page.values.max(page.dictionary).clamp(0, chunk.values))
        } else {
            TEXT_RATIO.saturating_mul(page.compressed)
        };
        if page.uncompressed > most.saturating_add(BESIDE) {
            return Err("a page claims more bytes than its values take");
        }
        if page.values < 0 || page.values > chunk.values || page.dictionary < 0 || page.dictionary > chunk.values {
            return Err("a page claims more values than its column");
        }
        values += page.values;
        rest = reader.bytes.get(size..).ok_or("a page lies outside its column")?;
    }
    if values == chunk.values { Ok(()) } else { Err("the pages do not hold as many values as their column") }
}

#[derive(Default)]
struct Page {
    uncompressed: i64,
    compressed: i64,
    /// Values of a data page.
    values: i64,
    /// Values of a dictionary page.
    dictionary: i64,
}

impl Page {
    fn integer(&mut self, of: Of, field: i16, value: i64) {
        match (of, field) {
            (Of::Page, 2) => self.uncompressed = value,
            (Of::Page, 3) => self.compressed = value,
            (Of::DataPage | Of::DataPage2, 1) => self.values = value,
            (Of::DictionaryPage, 1) => self.dictionary = value,
            // Nulls and rows of a version 2 page: as many as values at most; negative ones poison the count.
            (Of::DataPage2, 2 | 3) if value < 0 => self.values = -1,
            _ => {}
        }
    }
}

/// The structs of the format.
#[derive(Debug, Clone, Copy)]
enum Of {
    Page,
    DataPage,
    DictionaryPage,
    DataPage2,
    File,
    Schema,
    Logical,
    Decimal,
    Moment,
    Unit,
    Integer,
    KeyValue,
    RowGroup,
    Sorting,
    Column,
    Meta,
    Statistics,
    Encoding,
    /// One the decoder does not look into.
    Any,
}

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Holds {
    Bool,
    Byte,
    Int,
    Bytes,
    List,
    Structs,
    Struct,
}

impl Of {
    /// What field `id` holds, and of which struct, where the format says so.
    fn field(self, id: i16) -> Option<(Holds, Of)> {
        use Holds::{Bool, Byte, Bytes, Int, List, Struct, Structs};
        Some(match (self, id) {
            (Of::Page, 1..=4) => (Int, Of::Any),
            (Of::Page, 5) => (Struct, Of::DataPage),
            (Of::Page, 6) => (Struct, Of::Any),
            (Of::Page, 7) => (Struct, Of::DictionaryPage),
            (Of::Page, 8) => (Struct, Of::DataPage2),
            (Of::DataPage, 1..=4) | (Of::DictionaryPage, 1..=2) | (Of::DataPage2, 1..=6) => (Int, Of::Any),
            (Of::DataPage, 5) | (Of::DataPage2, 8) => (Struct, Of::Statistics),
            (Of::DictionaryPage, 3) | (Of::DataPage2, 7) => (Bool, Of::Any),
            (Of::File, 1 | 3) => (Int, Of::Any),
            (Of::File, 2) => (Structs, Of::Schema),
            (Of::File, 4) => (Structs, Of::RowGroup),
            (Of::File, 5) | (Of::Meta, 8) => (Structs, Of::KeyValue),
            (Of::File, 6 | 9) | (Of::KeyValue, 1 | 2) => (Bytes, Of::Any),
            (Of::File, 7) => (Structs, Of::Any),
            (Of::File, 8) => (Struct, Of::Any),
            (Of::Schema, 1..=3 | 5..=9) => (Int, Of::Any),
            (Of::Schema, 4) => (Bytes, Of::Any),
            (Of::Schema, 10) => (Struct, Of::Logical),
            (Of::Logical, 5) => (Struct, Of::Decimal),
            (Of::Logical, 7 | 8) => (Struct, Of::Moment),
            (Of::Logical, 10) => (Struct, Of::Integer),
            (Of::Logical, _) | (Of::Unit, _) => (Struct, Of::Any),
            (Of::Decimal, 1 | 2) => (Int, Of::Any),
            (Of::Moment, 1) | (Of::Integer, 2) => (Bool, Of::Any),
            (Of::Moment, 2) => (Struct, Of::Unit),
            (Of::Integer, 1) => (Byte, Of::Any),
            (Of::RowGroup, 1) => (Structs, Of::Column),
            (Of::RowGroup, 4) => (Structs, Of::Sorting),
            (Of::RowGroup, 2 | 3 | 5..=7) => (Int, Of::Any),
            (Of::Sorting, 1) => (Int, Of::Any),
            (Of::Sorting, 2 | 3) => (Bool, Of::Any),
            (Of::Column, 1 | 9) => (Bytes, Of::Any),
            (Of::Column, 2 | 4..=7) => (Int, Of::Any),
            (Of::Column, 3) => (Struct, Of::Meta),
            (Of::Column, 8) => (Struct, Of::Any),
            (Of::Meta, 1 | 4..=7 | 9..=11 | 14 | 15) => (Int, Of::Any),
            (Of::Meta, 2 | 3) => (List, Of::Any),
            (Of::Meta, 12) => (Struct, Of::Statistics),
            (Of::Meta, 13) => (Structs, Of::Encoding),
            (Of::Meta, 16 | 17) => (Struct, Of::Any),
            (Of::Encoding, 1..=3) => (Int, Of::Any),
            (Of::Statistics, 1 | 2 | 5 | 6) => (Bytes, Of::Any),
            (Of::Statistics, 3 | 4) => (Int, Of::Any),
            (Of::Statistics, 7 | 8) => (Bool, Of::Any),
            _ => return None,
        })
    }
}

/// The Thrift compact protocol, as far as stepping over a struct needs it.
struct Compact<'a> {
    bytes: &'a [u8],
}

impl Compact<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(*first)
    }

    fn skip(&mut self, n: usize) -> Option<()> {
        self.bytes = self.bytes.get(n..)?;
        Some(())
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn zigzag(&mut self) -> Option<i64> {
        let v = self.varint()?;
        Some((v >> 1) as i64 ^ -((v & 1) as i64))
    }

    fn structure(&mut self, of: Of, depth: usize, page: &mut Page) -> Option<()> {
        if depth > DEPTH {
            return None;
        }
        let mut field = 0i16;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            let delta = i16::from(head >> 4);
            field = if delta == 0 { i16::try_from(self.zigzag()?).ok()? } else { field.checked_add(delta)? };
            let kind = head & 0x0f;
            let known = of.field(field);
            let fits = |holds: Holds| match holds {
                Holds::Bool => matches!(kind, 1 | 2),
                Holds::Byte => kind == 3,
                Holds::Int => matches!(kind, 4..=6),
                Holds::Bytes => kind == 8,
                Holds::List | Holds::Structs => kind == 9,
                Holds::Struct => kind == 12,
            };
            if known.is_some_and(|(holds, _)| !fits(holds)) {
                return None;
            }
            match kind {
                4..=6 => page.integer(of, field, self.zigzag()?),
                _ => self.value(kind, known, depth + 1, page)?,
            }
        }
    }

    /// Steps over a value of a kind: 1, 2 booleans (in the head), 3 byte, 4-6 integers, 7 double, 8 binary, 9, 10 list and set, 12 struct.
    fn value(&mut self, kind: u8, known: Option<(Holds, Of)>, depth: usize, page: &mut Page) -> Option<()> {
        let inner = known.map_or(Of::Any, |(_, of)| of);
        match kind {
            1 | 2 => Some(()),
            3 => self.skip(1),
            4..=6 => self.varint().map(|_| ()),
            7 => self.skip(8),
            8 => {
                let n = usize::try_from(self.varint()?).ok()?;
                self.skip(n)
            }
            9 | 10 => {
                let head = self.byte()?;
                let of = head & 0x0f;
                let n = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
                let structs = matches!(known, Some((Holds::Structs, _)));
                let least = if of == 12 { LEAST } else { 1 };
                if depth > DEPTH || n > self.bytes.len() as u64 / least || (structs && n > 0 && of != 12) {
                    return None;
                }
                for _ in 0..n {
                    // A boolean takes a byte in a list.
                    if matches!(of, 1 | 2) { self.skip(1)? } else { self.value(of, Some((Holds::Struct, inner)), depth + 1, page)? }
                }
                Some(())
            }
            12 => self.structure(inner, depth + 1, page),
            _ => None,
        }
    }
}
