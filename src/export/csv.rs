//! CSV: parameters, and their covariance.

use polars::prelude::{Column, DataFrame};

use crate::data::written;

use super::{CalibratedSet, ExportError, Exported, Exporter, Source};

pub(super) struct Csv;

impl Exporter for Csv {
    fn name(&self) -> &'static str {
        "csv"
    }
    fn files(&self, of: &Source) -> Result<Exported, ExportError> {
        let set = of.set;
        let fail = |e: polars::error::PolarsError| ExportError { format: "csv", reason: e.to_string() };
        let files = vec![
            ("parameters.csv".into(), parameters(set).and_then(written::csv).map_err(fail)?),
            ("covariance.csv".into(), covariance(set).and_then(written::csv).map_err(fail)?),
        ];
        Ok(files.into())
    }
}

/// One row per parameter, the declared ones after the identified; SI.
pub(super) fn parameters(set: &CalibratedSet) -> polars::error::PolarsResult<DataFrame> {
    let (p, fixed) = (&set.parameters, &set.fixed);
    let text = |of: &dyn Fn(&crate::diagnose::results::ParameterResult) -> String| -> Vec<Option<String>> {
        p.iter().map(|p| Some(of(p))).chain(fixed.iter().map(|_| None)).collect()
    };
    let number = |of: &dyn Fn(&crate::diagnose::results::ParameterResult) -> Option<f64>| -> Vec<Option<f64>> {
        p.iter().map(of).chain(fixed.iter().map(|_| None)).collect()
    };
    let names: Vec<&str> = p.iter().map(|p| p.name.as_str()).chain(fixed.iter().map(|f| f.name.as_str())).collect();
    let values: Vec<f64> = p.iter().map(|p| p.value).chain(fixed.iter().map(|f| f.value)).collect();
    let identified: Vec<Option<bool>> = p.iter().map(|p| Some(p.identifiable)).chain(fixed.iter().map(|_| None)).collect();
    let columns = vec![
        Column::new("name".into(), &names),
        Column::new("value".into(), values),
        Column::new("unit".into(), text(&|p| p.unit.clone())),
        Column::new("std".into(), number(&|p| p.std)),
        Column::new("low_95".into(), number(&|p| p.interval.0)),
        Column::new("high_95".into(), number(&|p| p.interval.1)),
        Column::new("identifiable".into(), identified),
    ];
    DataFrame::new(names.len(), columns)
}

/// The covariance of the free parameters as a square table with their names; SI.
pub(super) fn covariance(set: &CalibratedSet) -> polars::error::PolarsResult<DataFrame> {
    let names: Vec<&str> = set.parameters.iter().map(|p| p.name.as_str()).collect();
    let mut columns = vec![Column::new("name".into(), &names)];
    for (k, name) in names.iter().enumerate() {
        let cells: Vec<Option<f64>> = set.covariance.iter().map(|row| row.get(k).copied().flatten()).collect();
        columns.push(Column::new((*name).into(), cells));
    }
    DataFrame::new(names.len(), columns)
}
