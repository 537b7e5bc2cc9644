//! Parquet: the tables of the CSV export.

use crate::data::written;

use super::{ExportError, Exported, Exporter, Source, csv};

pub(super) struct Parquet;

impl Exporter for Parquet {
    fn name(&self) -> &'static str {
        "parquet"
    }
    fn files(&self, of: &Source) -> Result<Exported, ExportError> {
        let set = of.set;
        let fail = |e: polars::error::PolarsError| ExportError { format: "parquet", reason: e.to_string() };
        let files = vec![
            ("parameters.parquet".into(), csv::parameters(set).and_then(written::parquet).map_err(fail)?),
            ("covariance.parquet".into(), csv::covariance(set).and_then(written::parquet).map_err(fail)?),
        ];
        Ok(files.into())
    }
}
