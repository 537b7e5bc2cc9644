//! Page headers of a Parquet file, checked before polars decodes them.
//!
//! polars takes memory for as many values as a page header claims before it looks at the page. A damaged header that claims 2^60 values ends
//! the process (an allocation that fails cannot be caught), so the claims are held against the column's own count first. The headers are
//! Thrift compact structs (Apache Parquet format, PageHeader): only their integers are read here, everything else is stepped over.

/// A column chunk's own claims.
pub(super) struct Chunk {
    pub start: usize,
    pub length: usize,
    pub values: i64,
    pub uncompressed: i64,
}

/// Checks every page of a chunk: counts not negative, not above the chunk's, and summing to it; sizes within the chunk.
pub(super) fn check(bytes: &[u8], chunk: &Chunk) -> Result<(), &'static str> {
    let end = chunk.start.checked_add(chunk.length).filter(|e| *e <= bytes.len()).ok_or("a column lies outside the file")?;
    let mut rest = bytes.get(chunk.start..end).ok_or("a column lies outside the file")?;
    let mut values = 0i64;
    while !rest.is_empty() {
        let mut reader = Compact { bytes: rest };
        let mut page = Page::default();
        reader.structure(0, 0, &mut page).ok_or("a page header cannot be read")?;
        let size = usize::try_from(page.compressed).map_err(|_| "a page has a negative size")?;
        if page.uncompressed < 0 || page.uncompressed > chunk.uncompressed {
            return Err("a page claims more bytes than its column");
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
    /// `parent` is the field of the page header the integer stands in (0: in the header itself).
    fn integer(&mut self, parent: i16, field: i16, value: i64) {
        match (parent, field) {
            (0, 2) => self.uncompressed = value,
            (0, 3) => self.compressed = value,
            (5 | 8, 1) => self.values = value,
            (7, 1) => self.dictionary = value,
            // Nulls and rows of a version 2 page: as many as values at most; negative ones poison the count.
            (8, 2 | 3) if value < 0 => self.values = -1,
            _ => {}
        }
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

    fn structure(&mut self, parent: i16, depth: usize, page: &mut Page) -> Option<()> {
        if depth > 8 {
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
            match head & 0x0f {
                4..=6 => {
                    let value = self.zigzag()?;
                    if depth <= 1 {
                        page.integer(parent, field, value);
                    }
                }
                12 if depth == 0 => self.structure(field, 1, page)?,
                kind => self.value(kind, depth + 1, page)?,
            }
        }
    }

    /// Steps over a value of a kind: 1, 2 booleans (in the head), 3 byte, 4-6 integers, 7 double, 8 binary, 9, 10 list and set, 12 struct.
    fn value(&mut self, kind: u8, depth: usize, page: &mut Page) -> Option<()> {
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
                let n = if head >> 4 == 15 { self.varint()? } else { u64::from(head >> 4) };
                for _ in 0..n {
                    // A boolean takes a byte in a list.
                    if matches!(head & 0x0f, 1 | 2) { self.skip(1)? } else { self.value(head & 0x0f, depth + 1, page)? }
                }
                Some(())
            }
            // Inside a nested struct no integer means anything here: parent -1.
            12 => self.structure(-1, depth + 1, page),
            _ => None,
        }
    }
}
