//! One channel of a test as NumPy arrays.

use misfit::diagnose::results;
use misfit::response::BlockKind;
use num_complex::Complex64;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;

/// One channel of a test against a model: measured, computed and standard deviation in SI units. Those of an FRF are complex.
#[pyclass(frozen, module = "misfit._native")]
pub struct Curve {
    /// Id of the test.
    #[pyo3(get)]
    test: String,
    /// Such as `force at c1.x`.
    #[pyo3(get)]
    label: String,
    /// SI unit of the values.
    #[pyo3(get)]
    unit: String,
    /// loop, frf, record or table.
    #[pyo3(get)]
    kind: &'static str,
    /// Phase [rad] of a loop, frequency [Hz] of an FRF, time [s] of a record, row of a table.
    #[pyo3(get)]
    abscissa: Py<PyArray1<f64>>,
    /// Driven displacement at the points; empty where not driven.
    #[pyo3(get)]
    x: Py<PyArray1<f64>>,
    /// Driven velocity at the points; empty where not driven.
    #[pyo3(get)]
    v: Py<PyArray1<f64>>,
    /// Measured values.
    #[pyo3(get)]
    measured: Py<PyAny>,
    /// Computed values.
    #[pyo3(get)]
    computed: Py<PyAny>,
    /// Standard deviation of the measured values; of an FRF that of the real part + i that of the imaginary part.
    #[pyo3(get)]
    sigma: Py<PyAny>,
}

impl Curve {
    pub fn new(py: Python<'_>, test: String, c: results::Curve) -> Self {
        let kind = c.kind;
        let real = |v: Vec<f64>| PyArray1::from_vec(py, v).unbind();
        let values = |v: Vec<f64>| match kind {
            BlockKind::Frf => {
                let pairs = v.chunks_exact(2).map(|p| Complex64::new(p[0], p[1])).collect();
                PyArray1::from_vec(py, pairs).into_any().unbind()
            }
            _ => PyArray1::from_vec(py, v).into_any().unbind(),
        };
        Curve {
            test,
            label: c.label,
            unit: c.unit,
            kind: match kind {
                BlockKind::Loop => "loop",
                BlockKind::Frf => "frf",
                BlockKind::Record => "record",
                BlockKind::Table => "table",
            },
            abscissa: real(c.abscissa),
            x: real(c.x),
            v: real(c.v),
            measured: values(c.measured),
            computed: values(c.computed),
            sigma: values(c.sigma),
        }
    }
}

#[pymethods]
impl Curve {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let n = self.abscissa.bind(py).readonly().as_array().len();
        Ok(format!("Curve({}: {} [{}], {}, {n} points)", self.test, self.label, self.unit, self.kind))
    }
}
