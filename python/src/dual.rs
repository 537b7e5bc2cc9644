//! The number that a law written in Python is evaluated over: a value with its derivatives, so that slopes are exact and none has to be written.

use num_dual::{DualDVec64, DualNum};
use pyo3::basic::CompareOp;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// A real number with its derivatives. Arithmetic, comparisons and the functions of NumPy work on it as on a float; those of `math` do not.
#[pyclass(frozen, module = "misfit._native")]
#[derive(Clone)]
pub struct Dual(pub DualDVec64);

impl Dual {
    /// The derivative with respect to variable `k`.
    pub fn slope(&self, k: usize) -> f64 {
        self.0.eps.0.as_ref().map_or(0.0, |m| m[k])
    }

    /// A function with value `f` and slope `d` at this number. A slope times no derivative is none, also where it is infinite.
    fn chain(&self, f: f64, d: f64) -> Dual {
        let mut out = self.0.clone();
        out.re = f;
        if let Some(eps) = &mut out.eps.0 {
            eps.iter_mut().filter(|e| **e != 0.0).for_each(|e| *e *= d);
        }
        Dual(out)
    }
}

/// The other operand: a number of either kind.
fn number(other: &Bound<'_, PyAny>) -> PyResult<DualDVec64> {
    match other.cast::<Dual>() {
        Ok(d) => Ok(d.get().0.clone()),
        Err(_) => other.extract::<f64>().map(DualDVec64::from_re),
    }
}

#[pymethods]
impl Dual {
    /// The value without its derivatives.
    #[getter]
    fn value(&self) -> f64 {
        self.0.re
    }

    fn __add__(&self, other: &Bound<'_, PyAny>) -> PyResult<Dual> {
        Ok(Dual(self.0.clone() + number(other)?))
    }
    fn __radd__(&self, other: &Bound<'_, PyAny>) -> PyResult<Dual> {
        self.__add__(other)
    }
    fn __sub__(&self, other: &Bound<'_, PyAny>) -> PyResult<Dual> {
        Ok(Dual(self.0.clone() - number(other)?))
    }
    fn __rsub__(&self, other: &Bound<'_, PyAny>) -> PyResult<Dual> {
        Ok(Dual(number(other)? - self.0.clone()))
    }
    fn __mul__(&self, other: &Bound<'_, PyAny>) -> PyResult<Dual> {
        Ok(Dual(self.0.clone() * number(other)?))
    }
    fn __rmul__(&self, other: &Bound<'_, PyAny>) -> PyResult<Dual> {
        self.__mul__(other)
    }
    fn __truediv__(&self, other: &Bound<'_, PyAny>) -> PyResult<Dual> {
        Ok(Dual(self.0.clone() / number(other)?))
    }
    fn __rtruediv__(&self, other: &Bound<'_, PyAny>) -> PyResult<Dual> {
        Ok(Dual(number(other)? / self.0.clone()))
    }
    fn __pow__(&self, exponent: &Bound<'_, PyAny>, modulo: Option<&Bound<'_, PyAny>>) -> PyResult<Dual> {
        if modulo.is_some() {
            return Err(PyTypeError::new_err("a power of a Dual has no modulus"));
        }
        let n = number(exponent)?;
        let base = self.0.re;
        if n.eps.0.is_none() {
            // Of a whole power the base may be negative; at 0 the slope is that of the limit.
            let n = n.re;
            return Ok(self.chain(base.powf(n), if n == 0.0 { 0.0 } else { n * base.powf(n - 1.0) }));
        }
        if base <= 0.0 {
            // 0^n has no slope in n > 0; a negative base has no value for all n around.
            return Ok(Dual(DualDVec64::from_re(base.powf(n.re))));
        }
        Ok(Dual((n * self.0.ln()).exp()))
    }
    fn __rpow__(&self, base: &Bound<'_, PyAny>, modulo: Option<&Bound<'_, PyAny>>) -> PyResult<Dual> {
        if modulo.is_some() {
            return Err(PyTypeError::new_err("a power of a Dual has no modulus"));
        }
        let base = number(base)?.re;
        let value = base.powf(self.0.re);
        Ok(self.chain(value, if base > 0.0 { value * base.ln() } else { 0.0 }))
    }
    fn __neg__(&self) -> Dual {
        Dual(-self.0.clone())
    }
    fn __pos__(&self) -> Dual {
        self.clone()
    }
    /// Its slope at 0 is 0, the mean of both sides.
    fn __abs__(&self) -> Dual {
        let re = self.0.re;
        self.chain(re.abs(), if re == 0.0 { 0.0 } else { re.signum() })
    }
    fn __bool__(&self) -> bool {
        self.0.re != 0.0
    }
    fn __richcmp__(&self, other: &Bound<'_, PyAny>, op: CompareOp) -> PyResult<bool> {
        let (a, b) = (self.0.re, number(other)?.re);
        Ok(match op {
            CompareOp::Lt => a < b,
            CompareOp::Le => a <= b,
            CompareOp::Eq => a == b,
            CompareOp::Ne => a != b,
            CompareOp::Gt => a > b,
            CompareOp::Ge => a >= b,
        })
    }
    fn __hash__(&self) -> u64 {
        self.0.re.to_bits()
    }
    fn __float__(&self) -> PyResult<f64> {
        Err(PyTypeError::new_err(
            "a number with derivatives is no float: numpy's functions in place of math's, .value where no derivative is meant",
        ))
    }
    fn __repr__(&self) -> String {
        format!("Dual({})", self.0.re)
    }

    fn sqrt(&self) -> Dual {
        let root = self.0.re.sqrt();
        self.chain(root, 0.5 / root)
    }
    fn exp(&self) -> Dual {
        Dual(self.0.exp())
    }
    fn expm1(&self) -> Dual {
        Dual(self.0.exp_m1())
    }
    fn log(&self) -> Dual {
        Dual(self.0.ln())
    }
    fn log1p(&self) -> Dual {
        Dual(self.0.ln_1p())
    }
    fn log10(&self) -> Dual {
        Dual(self.0.log10())
    }
    fn sin(&self) -> Dual {
        Dual(self.0.sin())
    }
    fn cos(&self) -> Dual {
        Dual(self.0.cos())
    }
    fn tan(&self) -> Dual {
        Dual(self.0.tan())
    }
    fn sinh(&self) -> Dual {
        Dual(self.0.sinh())
    }
    fn cosh(&self) -> Dual {
        Dual(self.0.cosh())
    }
    /// Without the quotient of two large exponentials.
    fn tanh(&self) -> Dual {
        let t = self.0.re.tanh();
        self.chain(t, 1.0 - t * t)
    }
    fn arcsin(&self) -> Dual {
        Dual(self.0.asin())
    }
    fn arccos(&self) -> Dual {
        Dual(self.0.acos())
    }
    fn arctan(&self) -> Dual {
        Dual(self.0.atan())
    }
    fn arcsinh(&self) -> Dual {
        Dual(self.0.asinh())
    }
    fn arctanh(&self) -> Dual {
        Dual(self.0.atanh())
    }
}
