//! Tables as bytes of a file.

use polars::error::PolarsResult;
use polars::prelude::{CsvWriter, DataFrame, ParquetWriter, SerWriter};

/// The table as a Parquet file.
pub fn parquet(mut table: DataFrame) -> PolarsResult<Vec<u8>> {
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes).finish(&mut table)?;
    Ok(bytes)
}

/// The table as a CSV file with a line of names.
pub fn csv(mut table: DataFrame) -> PolarsResult<Vec<u8>> {
    let mut bytes = Vec::new();
    CsvWriter::new(&mut bytes).finish(&mut table)?;
    Ok(bytes)
}
