//! A study made of Python objects and arrays: its files, written into a folder.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use misfit::data::written;
use misfit::export::stand_alone;
use misfit::limits;
use misfit::study::Study;
use misfit::work::Failure;
use numpy::{AllowTypeChange, PyArrayLike1};
use polars::prelude::{Column, DataFrame};
use pyo3::prelude::*;
use serde_json::Value;

use crate::error::{raise, refuse};

/// Columns of the records by file name.
type Records<'py> = HashMap<String, Vec<(String, PyArrayLike1<'py, f64, AllowTypeChange>)>>;

/// Writes `study.toml`, `data/dataset.toml` and a Parquet file for each record into `folder`; `study` and `dataset` are JSON. Returns study.toml.
#[pyfunction]
pub fn write_study(py: Python<'_>, folder: PathBuf, study: &str, dataset: &str, records: Records<'_>) -> PyResult<PathBuf> {
    let data = folder.join("data");
    std::fs::create_dir_all(&data).map_err(|e| unwritten(py, &data, &e))?;
    for (file, columns) in &records {
        write_record(py, &data.join(file), columns)?;
    }
    write_toml(py, &data.join("dataset.toml"), dataset)?;
    let path = folder.join("study.toml");
    write_toml(py, &path, study)?;
    Ok(path)
}

/// Writes the study with all its data into `folder`, where it stands alone.
#[pyfunction]
#[pyo3(signature = (path, folder, data=None))]
pub fn save_study(py: Python<'_>, path: PathBuf, folder: PathBuf, data: Option<PathBuf>) -> PyResult<()> {
    let save = || -> Result<(), Failure> {
        let study = Study::load(&path, data.as_deref())?;
        stand_alone(&study, &study.system, &folder)?;
        Ok(())
    };
    py.detach(save).map_err(|e| raise(py, &e))
}

fn unwritten(py: Python<'_>, path: &Path, e: &dyn std::fmt::Display) -> PyErr {
    raise(py, &Failure::new("study", path.display().to_string(), e.to_string(), "a folder that can be written"))
}

/// Checks and writes the columns of one record.
fn write_record(py: Python<'_>, path: &Path, columns: &[(String, PyArrayLike1<'_, f64, AllowTypeChange>)]) -> PyResult<()> {
    let rows = columns.first().map_or(0, |c| c.1.as_array().len());
    let mut list = vec![];
    for (name, values) in columns {
        let values = values.as_array();
        if values.len() != rows {
            let message = format!("{} values, and {rows} in `{}`", values.len(), columns[0].0);
            return Err(refuse(py, "data", &format!("column `{name}`"), message, "columns of one length"));
        }
        if let Some(row) = values.iter().position(|v| !v.is_finite()) {
            let message = format!("the value in row {row} is {}", if values[row].is_nan() { "missing (nan)" } else { "infinite" });
            return Err(refuse(
                py,
                "data",
                &format!("column `{name}`"),
                message,
                "a finite number in every row; drop or fill rows without one",
            ));
        }
        list.push(Column::new(name.as_str().into(), values.to_vec()));
    }
    let bytes = DataFrame::new(rows, list).and_then(written::parquet).map_err(|e| unwritten(py, path, &e))?;
    limits::replace(path, &bytes).map_err(|e| unwritten(py, path, &e))
}

fn write_toml(py: Python<'_>, path: &Path, json: &str) -> PyResult<()> {
    let bad = |e: &dyn std::fmt::Display| refuse(py, "study", &path.display().to_string(), e.to_string(), "tables, lists, words, numbers");
    let mut value: Value = serde_json::from_str(json).map_err(|e| bad(&e))?;
    // TOML has no null: a key without a value is left out.
    prune(&mut value);
    let table = toml::Value::try_from(&value).map_err(|e| bad(&e))?;
    let text = toml::to_string(&table).map_err(|e| bad(&e))?;
    limits::replace(path, text.as_bytes()).map_err(|e| unwritten(py, path, &e))
}

fn prune(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.retain(|_, v| !v.is_null());
            map.values_mut().for_each(prune);
        }
        Value::Array(list) => list.iter_mut().for_each(prune),
        _ => {}
    }
}
