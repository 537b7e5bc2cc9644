//! Parquet through polars.

use super::parquet_pages::{self, Chunk};
use super::{Column, Columns, DataError, Wanted};
use polars::io::parquet::read::FileMetadata;
use polars::prelude::*;
use std::cell::Cell;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::Path;
use std::sync::Once;

/// Rows beyond which a file is not taken for a measurement: a damaged header can claim any number, and memory is taken before a byte is read.
const MAX_ROWS: usize = 200_000_000;
/// Rows, likewise, for each byte of the file (runs of equal values take next to nothing), beside a number that is always believed.
const ROWS_PER_BYTE: usize = 1 << 12;
const FEW_ROWS: usize = 1_000_000;
/// Bytes, likewise, of one column in one row group.
const MAX_CHUNK: i64 = 1 << 31;

pub(super) fn read(path: &Path, bytes: Vec<u8>, wanted: &[Wanted]) -> Result<Columns, DataError> {
    guarded(path, &bytes, || decode(path, &bytes, wanted))
}

/// Names of the columns.
pub(super) fn names(path: &Path, bytes: Vec<u8>) -> Result<Vec<String>, DataError> {
    guarded(path, &bytes, || {
        let broken = |e: PolarsError| DataError::Format { file: path.to_path_buf(), reason: format!("not a readable Parquet file: {e}") };
        let mut reader = ParquetReader::new(Cursor::new(bytes.as_slice()));
        Ok(reader.schema().map_err(broken)?.iter_names().map(|n| n.to_string()).collect())
    })
}

/// The decoder checks less than it should and panics on some damaged files; what it panics on is an unreadable file, nothing more.
fn guarded<T>(path: &Path, bytes: &[u8], work: impl FnOnce() -> Result<T, DataError>) -> Result<T, DataError> {
    let broken = |reason: String| DataError::Format { file: path.to_path_buf(), reason: format!("not a readable Parquet file: {reason}") };
    parquet_pages::footer(bytes).map_err(|e| broken(e.to_string()))?;
    quiet_while_decoding();
    DECODING.set(true);
    let outcome = catch_unwind(AssertUnwindSafe(work));
    DECODING.set(false);
    outcome.unwrap_or_else(|_| Err(broken("the decoder gave up on damaged bytes".to_string())))
}

thread_local! {
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// Keeps the panics that are caught here out of the terminal; every other panic goes to the hook that was there before.
fn quiet_while_decoding() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info| {
            if !DECODING.get() {
                before(info);
            }
        }));
    });
}

fn decode(path: &Path, bytes: &[u8], wanted: &[Wanted]) -> Result<Columns, DataError> {
    let broken = |e: PolarsError| {
        let reason: String = e.to_string().lines().next().unwrap_or("").chars().take(120).collect();
        DataError::Format { file: path.to_path_buf(), reason: format!("not a readable Parquet file: {reason}") }
    };
    let mut reader = ParquetReader::new(Cursor::new(bytes)).read_parallel(ParallelStrategy::None);
    let schema = reader.schema().map_err(broken)?;
    let header: Vec<String> = schema.iter_names().map(|n| n.to_string()).collect();
    let rows = reader.num_rows().map_err(broken)?;
    if rows > MAX_ROWS.min(FEW_ROWS + ROWS_PER_BYTE * bytes.len()) {
        let reason = format!("not a readable Parquet file: it claims {rows} rows in {} bytes", bytes.len());
        return Err(DataError::Format { file: path.to_path_buf(), reason });
    }
    if rows == 0 {
        return Err(DataError::NoRows { file: path.to_path_buf() });
    }
    let at = super::locate(path, &header, wanted)?;
    // Columns of date and time are a feature of polars that is not compiled in: the decoder would give up on them without a word of which.
    let moment = |i: &usize| {
        use ArrowDataType::{Date32, Date64, Duration, Time32, Time64, Timestamp};
        let kind = schema.get(&header[*i]).map(|f| f.dtype());
        matches!(kind, Some(Date32 | Date64 | Duration(_) | Time32(_) | Time64(_) | Timestamp(..)))
    };
    if let Some(i) = at.iter().find(|i| moment(i)) {
        return Err(DataError::Cell {
            file: path.to_path_buf(),
            row: "row 1".into(),
            column: header[*i].clone(),
            what: "holds dates or times as Parquet keeps them, which are not read: a column of seconds is, and date and time as text"
                .into(),
        });
    }
    let metadata = reader.get_metadata().map_err(broken)?.clone();
    pages(bytes, &metadata, &schema, at.iter().filter_map(|i| header.get(*i)))
        .map_err(|e| DataError::Format { file: path.to_path_buf(), reason: format!("not a readable Parquet file: {e}") })?;
    let mut projection = at.clone();
    projection.sort_unstable();
    projection.dedup();
    let frame = reader.with_projection(Some(projection)).finish().map_err(broken)?;
    let mut columns = Vec::with_capacity(at.len());
    for (w, i) in wanted.iter().zip(&at) {
        let column = frame.column(&header[*i]).map_err(broken)?;
        let bad = |row: usize, what: &str| DataError::Cell {
            file: path.to_path_buf(),
            row: format!("row {}", row + 1),
            column: w.name.clone(),
            what: what.to_string(),
        };
        let kind = column.dtype().clone();
        columns.push(if w.text {
            let text = column.cast(&DataType::String).map_err(broken)?;
            Column::Text(text.str().map_err(broken)?.iter().map(|c| c.unwrap_or("").trim().to_string()).collect())
        } else if kind.is_primitive_numeric() {
            let values = column.cast(&DataType::Float64).map_err(broken)?;
            let cell = |(row, v): (usize, Option<f64>)| v.ok_or_else(|| bad(row, "an empty cell"));
            Column::Numbers(values.f64().map_err(broken)?.iter().enumerate().map(cell).collect::<Result<_, _>>()?)
        } else {
            return Err(bad(0, &format!("holds {kind}, not numbers")));
        });
    }
    let columns = Columns::new(columns, "row", 1);
    super::finite(path, &columns, wanted)?;
    Ok(columns)
}

/// Holds the claims of the footer and of the page headers of the wanted columns against each other.
fn pages<'a>(
    bytes: &[u8],
    metadata: &FileMetadata,
    schema: &ArrowSchema,
    wanted: impl Iterator<Item = &'a String> + Clone,
) -> Result<(), &'static str> {
    let size = |v: i64| usize::try_from(v).map_err(|_| "a column has a negative offset or size");
    let mut rows = 0usize;
    for group in &metadata.row_groups {
        rows = rows.checked_add(group.num_rows()).ok_or("too many rows")?;
        for name in wanted.clone() {
            for column in group.columns_under_root_iter(name).ok_or("a row group lacks a column")? {
                let chunk = Chunk {
                    start: size(column.dictionary_page_offset().unwrap_or(column.data_page_offset()))?,
                    length: size(column.compressed_size())?,
                    values: column.num_values(),
                    uncompressed: column.uncompressed_size(),
                    numbers: schema.get(name.as_str()).is_some_and(|f| f.dtype().is_numeric()),
                };
                if usize::try_from(chunk.values) != Ok(group.num_rows()) {
                    return Err("a column does not hold a number for every row");
                }
                if chunk.uncompressed > MAX_CHUNK {
                    return Err("a column claims more bytes than a measurement has");
                }
                parquet_pages::check(bytes, &chunk)?;
            }
        }
    }
    if rows == metadata.num_rows { Ok(()) } else { Err("the row groups do not hold as many rows as the file") }
}
