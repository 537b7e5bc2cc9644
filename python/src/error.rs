//! Errors on their way to Python: `misfit.Error` with stage, where, message and accepted.

use misfit::work::Failure;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The exception of a failure.
pub fn raise(py: Python<'_>, failure: &Failure) -> PyErr {
    let made = || -> PyResult<PyErr> {
        let stated = failure.json();
        let of = |key: &str| stated["error"][key].as_str().unwrap_or_default().to_string();
        let keys = PyDict::new(py);
        for key in ["message", "stage", "where", "accepted"] {
            keys.set_item(key, of(key))?;
        }
        let class = py.import("misfit._errors")?.getattr("Error")?;
        Ok(PyErr::from_value(class.call((), Some(&keys))?))
    };
    made().unwrap_or_else(|e| e)
}

/// The exception of words put together here.
pub fn refuse(py: Python<'_>, stage: &str, place: &str, message: impl Into<String>, accepted: &str) -> PyErr {
    raise(py, &Failure::new(stage, place, message, accepted))
}
