//! Tests of the identification stage as a whole, through its public functions.

mod after;
mod nist;
mod property;
mod solver;

use super::*;
use nalgebra::{DMatrix, DVector};

/// r = A p - b
#[derive(Debug)]
pub(crate) struct Linear {
    pub a: DMatrix<f64>,
    pub b: DVector<f64>,
}

impl LeastSquares for Linear {
    fn n_params(&self) -> usize {
        self.a.ncols()
    }
    fn n_residuals(&self) -> usize {
        self.a.nrows()
    }
    fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        Ok(&self.a * DVector::from_column_slice(p) - &self.b)
    }
    fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> {
        Ok((self.residuals(p)?, self.a.clone()))
    }
}

/// Any residual with its Jacobian, as a pair of closures' result.
pub(crate) struct With<F: Fn(&[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> + Sync> {
    pub n: usize,
    pub m: usize,
    pub f: F,
}

impl<F: Fn(&[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> + Sync> LeastSquares for With<F> {
    fn n_params(&self) -> usize {
        self.n
    }
    fn n_residuals(&self) -> usize {
        self.m
    }
    fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        Ok((self.f)(p)?.0)
    }
    fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> {
        (self.f)(p)
    }
}

/// y = p0 exp(-p1 t) + p2 on 40 points, residual scaled by `by`.
pub(crate) fn decay(truth: [f64; 3], by: f64) -> impl LeastSquares {
    let y = move |p: &[f64], t: f64| p[0] * (-p[1] * t).exp() + p[2];
    let f = move |p: &[f64]| {
        let m = 40;
        let t = |i: usize| 0.1 * i as f64;
        // a fixed, noise-like misfit, so that the minimum is not a zero
        let wobble = |i: usize| 1e-2 * (7.0 * i as f64).sin();
        let r = DVector::from_fn(m, |i, _| by * (y(p, t(i)) - y(&truth, t(i)) - wobble(i)));
        let j = DMatrix::from_fn(m, 3, |i, c| {
            let e = (-p[1] * t(i)).exp();
            by * [e, -p[0] * t(i) * e, 1.0][c]
        });
        Ok((r, j))
    };
    With { n: 3, m: 40, f }
}

pub(crate) fn options(n: usize) -> FitOptions {
    FitOptions::new((0..n).map(|j| format!("p{j}")))
}
