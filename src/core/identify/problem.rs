//! What is minimised: whitened residuals, prior rows, robust losses.

use super::{EvalError, IdentifyError};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// A whitened nonlinear least-squares problem: minimise cost(p) = 1/2 ||r(p)||^2.
///
/// Whitened means that every residual is divided by its noise (r_i = (computed - measured) / sigma_i), so that a perfect model gives
/// residuals of unit variance. The Jacobian is J[i, j] = d r_i / d p_j, shape `n_residuals` x `n_params`.
pub trait LeastSquares: Sync {
    fn n_params(&self) -> usize;
    fn n_residuals(&self) -> usize;
    /// r(p), length `n_residuals`.
    fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError>;
    /// (r(p), J(p)) in one evaluation; sensitivities are analytic, never differenced.
    fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError>;
}

/// Prior knowledge of one parameter, p_j ~ N(mean, sigma^2): the row (p_j - mean) / sigma is appended to the residual.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    pub index: usize,
    pub mean: f64,
    pub sigma: f64,
}

/// Loss rho(r) of one whitened residual; the cost is the sum of rho over all residuals. Every loss behaves as r^2/2 near zero, so the
/// convention cost = 1/2 ||r||^2 holds wherever residuals are small against `k` (in units of sigma).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// r^2/2
    #[default]
    Squares,
    /// r^2/2 for |r| <= k, else k |r| - k^2/2
    Huber(f64),
    /// k^2 (sqrt(1 + (r/k)^2) - 1)
    SoftL1(f64),
    /// k^2/2 ln(1 + (r/k)^2)
    Cauchy(f64),
}

impl Loss {
    /// rho(r)
    pub fn value(self, r: f64) -> f64 {
        match self {
            Self::Squares => 0.5 * r * r,
            Self::Huber(k) if r.abs() <= k => 0.5 * r * r,
            Self::Huber(k) => k * (r.abs() - 0.5 * k),
            // r^2 / (sqrt(1 + x^2) + 1) instead of the difference, which cancels for small r
            Self::SoftL1(k) => r * r / ((1.0 + (r / k).powi(2)).sqrt() + 1.0),
            Self::Cauchy(k) => 0.5 * k * k * ((r / k).powi(2)).ln_1p(),
        }
    }

    /// The weight w(r) = rho'(r) / r of iterative reweighting: the gradient of the cost is J' (w r) exactly.
    pub fn weight(self, r: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Huber(k) => (k / r.abs()).min(1.0),
            Self::SoftL1(k) => 1.0 / (1.0 + (r / k).powi(2)).sqrt(),
            Self::Cauchy(k) => 1.0 / (1.0 + (r / k).powi(2)),
        }
    }

    fn validate(self) -> Result<(), IdentifyError> {
        match self {
            Self::Squares => Ok(()),
            Self::Huber(k) | Self::SoftL1(k) | Self::Cauchy(k) if k.is_finite() && k > 0.0 => Ok(()),
            Self::Huber(k) | Self::SoftL1(k) | Self::Cauchy(k) => Err(IdentifyError::Option {
                option: "loss",
                value: format!("the width {k}"),
                accepted: "a positive width in units of the noise, for instance 1.345",
            }),
        }
    }
}

/// A loss over a block of residuals (one test, usually). Residuals in no block have [`Loss::Squares`].
#[derive(Debug, Clone, PartialEq)]
pub struct LossBlock {
    pub rows: Range<usize>,
    pub loss: Loss,
}

/// The problem with its prior rows: residuals first, priors after them.
pub(crate) struct Augmented<'a, P: LeastSquares + ?Sized> {
    pub problem: &'a P,
    pub priors: &'a [Prior],
}

impl<P: LeastSquares + ?Sized> Augmented<'_, P> {
    pub fn n_rows(&self) -> usize {
        self.problem.n_residuals() + self.priors.len()
    }

    pub fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        let r = self.problem.residuals(p)?;
        let r = self.with_priors(r, p)?;
        if finite(&r) { Ok(r) } else { Err(EvalError::new(not_finite(&r))) }
    }

    pub fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> {
        let (r, j) = self.problem.jacobian(p)?;
        let (m, n) = (self.problem.n_residuals(), self.problem.n_params());
        if j.shape() != (m, n) {
            return Err(EvalError::new(format!("the sensitivities are {} x {} instead of {m} x {n}", j.nrows(), j.ncols())));
        }
        let r = self.with_priors(r, p)?;
        if !finite(&r) {
            return Err(EvalError::new(not_finite(&r)));
        }
        let j = if self.priors.is_empty() {
            j
        } else {
            let mut j = j.resize_vertically(self.n_rows(), 0.0);
            for (row, prior) in self.priors.iter().enumerate() {
                j[(m + row, prior.index)] = 1.0 / prior.sigma;
            }
            j
        };
        match j.iter().position(|v| !v.is_finite()) {
            Some(at) => {
                Err(EvalError::new(format!("the sensitivity of residual {} to parameter {} is not finite", at % j.nrows(), at / j.nrows())))
            }
            None if !j.norm_squared().is_finite() => Err(EvalError::new("the sensitivities overflow")),
            None => Ok((r, j)),
        }
    }

    fn with_priors(&self, r: DVector<f64>, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        let m = self.problem.n_residuals();
        if r.len() != m {
            return Err(EvalError::new(format!("{} residuals instead of {m}", r.len())));
        }
        if self.priors.is_empty() {
            return Ok(r);
        }
        let mut r = r.resize_vertically(self.n_rows(), 0.0);
        for (row, prior) in self.priors.iter().enumerate() {
            r[m + row] = (p[prior.index] - prior.mean) / prior.sigma;
        }
        Ok(r)
    }
}

fn finite(r: &DVector<f64>) -> bool {
    r.iter().all(|v| v.is_finite()) && r.norm_squared().is_finite()
}

fn not_finite(r: &DVector<f64>) -> String {
    match r.iter().position(|v| !v.is_finite()) {
        Some(i) => format!("residual {i} is {}", r[i]),
        None => "the sum of squares overflows".into(),
    }
}

/// Losses laid out per row, so that the inner loop asks no range.
#[derive(Debug, Clone)]
pub(crate) struct Losses {
    per_row: Vec<Loss>, // empty when every loss is Squares
}

impl Losses {
    pub fn new(blocks: &[LossBlock], n_residuals: usize) -> Result<Self, IdentifyError> {
        let mut per_row = Vec::new();
        for block in blocks {
            block.loss.validate()?;
            if block.rows.end > n_residuals || block.rows.start > block.rows.end {
                return Err(IdentifyError::Dimension { what: "rows of a loss".into(), got: block.rows.end, expected: n_residuals });
            }
            if block.loss != Loss::Squares {
                per_row.resize(n_residuals, Loss::Squares);
                per_row[block.rows.clone()].fill(block.loss);
            }
        }
        Ok(Self { per_row })
    }

    /// Sum of rho(r_i); prior rows, which follow the residuals, are always squares.
    pub fn cost(&self, r: &DVector<f64>) -> f64 {
        let robust: f64 = self.per_row.iter().zip(r.iter()).map(|(l, &v)| l.value(v)).sum();
        robust + 0.5 * r.iter().skip(self.per_row.len()).map(|v| v * v).sum::<f64>()
    }

    /// sqrt(w_i) of row i, or None when the row is plain squares throughout.
    pub fn sqrt_weights(&self, r: &DVector<f64>) -> Option<Vec<f64>> {
        if self.per_row.is_empty() {
            return None;
        }
        let mut w = vec![1.0; r.len()];
        for ((w, l), &v) in w.iter_mut().zip(&self.per_row).zip(r.iter()) {
            *w = l.weight(v).sqrt();
        }
        Some(w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_loss_is_the_integral_of_weight_times_residual() {
        for loss in [Loss::Squares, Loss::Huber(1.3), Loss::SoftL1(0.7), Loss::Cauchy(2.0)] {
            for r in [-40.0f64, -1.0, -1e-3, 0.2, 1.0, 7.0] {
                let h = 1e-5 * r.abs();
                let slope = (loss.value(r + h) - loss.value(r - h)) / (2.0 * h);
                approx::assert_relative_eq!(slope, loss.weight(r) * r, max_relative = 1e-6);
            }
            approx::assert_relative_eq!(loss.value(1e-4), 0.5e-8, max_relative = 1e-6);
        }
    }
}
