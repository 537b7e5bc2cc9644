//! Tables: Arrow for polars, pandas and pyarrow through the Arrow PyCapsule interface, columns for everybody else.

use misfit::work::Failure;
use numpy::PyArray1;
use polars::prelude::{Column, CompatLevel, DataFrame, DataType, SchemaExt};
use polars_arrow::array::{Array, StructArray};
use polars_arrow::datatypes::{ArrowDataType, Field};
use polars_arrow::ffi::{ArrowArrayStream, export_iterator};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyList};
use serde_json::Value;

use crate::error::{raise, refuse};

/// A table. `polars.DataFrame(table)`, `pandas.DataFrame.from_arrow(table)` and `pyarrow.table(table)` take its columns as they are.
#[pyclass(frozen, module = "misfit._native")]
pub struct Table {
    frame: DataFrame,
}

/// The stream of a table in its capsule.
#[repr(transparent)]
struct Exported(ArrowArrayStream);

// SAFETY: the stream owns arrays that are shared between threads by reference counts, and is read by one consumer.
unsafe impl Send for Exported {}

impl Table {
    pub fn new(frame: DataFrame) -> Self {
        Table { frame }
    }
}

#[pymethods]
impl Table {
    /// A table of records in JSON: a list of objects. Numbers, words and truth values are columns of their type, other values their JSON.
    #[staticmethod]
    fn of_json(py: Python<'_>, json: &str) -> PyResult<Table> {
        let records: Vec<serde_json::Map<String, Value>> =
            serde_json::from_str(json).map_err(|e| refuse(py, "result", "table", e.to_string(), "a list of objects"))?;
        frame(&records).map(Table::new).map_err(|e| raise(py, &Failure::new("result", "table", e.to_string(), "a list of objects")))
    }

    /// Names of the columns.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.frame.get_column_names().iter().map(ToString::to_string).collect()
    }

    fn __len__(&self) -> usize {
        self.frame.height()
    }

    /// A column: numbers as a NumPy array with nan where there is none, anything else as a list.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let column = self.frame.column(name).map_err(|_| PyKeyError::new_err(name.to_string()))?;
        if let Ok(numbers) = column.f64() {
            return Ok(PyArray1::from_iter(py, numbers.iter().map(|v| v.unwrap_or(f64::NAN))).into_any());
        }
        if let Ok(words) = column.str() {
            return Ok(PyList::new(py, words.iter().collect::<Vec<_>>())?.into_any());
        }
        let truths = column.bool().map_err(|e| refuse(py, "result", name, e.to_string(), "a column of numbers, words or truth values"))?;
        Ok(PyList::new(py, truths.iter().collect::<Vec<_>>())?.into_any())
    }

    /// The Arrow PyCapsule interface: a stream of one batch, whose buffers are those of this table.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(&self, py: Python<'py>, requested_schema: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyCapsule>> {
        // A consumer may ask for another schema, and has to cope with this one.
        let _ = requested_schema;
        let level = CompatLevel::newest();
        let fields: Vec<Field> = self.frame.schema().iter_fields().map(|f| f.to_arrow(level)).collect();
        let of = ArrowDataType::Struct(fields);
        let batch = |arrays: Vec<Box<dyn Array>>| {
            let n = arrays.first().map_or(0, |a| a.len());
            StructArray::try_new(of.clone(), n, arrays, None).map(|a| Box::new(a) as Box<dyn Array>)
        };
        let batches: Vec<_> = self.frame.iter_chunks(level, false).map(|b| batch(b.into_arrays())).collect();
        let stream = export_iterator(Box::new(batches.into_iter()), Field::new("".into(), of.clone(), false));
        PyCapsule::new_with_value(py, Exported(stream), c"arrow_array_stream")
    }

    fn __repr__(&self) -> String {
        format!("Table({} rows: {})", self.frame.height(), self.columns().join(", "))
    }
}

/// Columns of records, in the order in which the keys come up.
fn frame(records: &[serde_json::Map<String, Value>]) -> polars::error::PolarsResult<DataFrame> {
    let mut names: Vec<&String> = vec![];
    for key in records.iter().flat_map(|r| r.keys()) {
        if !names.contains(&key) {
            names.push(key);
        }
    }
    let column = |name: &&String| {
        let values: Vec<&Value> = records.iter().map(|r| r.get(*name).unwrap_or(&Value::Null)).collect();
        let all = |is: fn(&Value) -> bool| values.iter().all(|v| v.is_null() || is(v)) && values.iter().any(|v| !v.is_null());
        let name = name.as_str().into();
        if all(Value::is_boolean) {
            Column::new(name, values.iter().map(|v| v.as_bool()).collect::<Vec<_>>())
        } else if all(Value::is_number) {
            Column::new(name, values.iter().map(|v| v.as_f64()).collect::<Vec<_>>())
        } else if values.iter().all(|v| v.is_null()) {
            Column::full_null(name, values.len(), &DataType::Float64)
        } else {
            let text = |v: &&Value| match v {
                Value::Null => None,
                Value::String(s) => Some(s.clone()),
                other => Some(other.to_string()),
            };
            Column::new(name, values.iter().map(text).collect::<Vec<_>>())
        }
    };
    let columns = names.iter().map(column).collect();
    DataFrame::new(records.len(), columns)
}
