//! Errors that tests have in common: one sensor reads all of them.

use nalgebra::{DMatrix, DMatrixViewMut};

/// Errors `C x`, `x ~ N(0, I)`, beside those that each test has by itself: the covariance of all rows, whitened test by test, is `I + C C'`. With
/// `C = U S W'` its inverse root is `I + U diag((1 + s^2)^-1/2 - 1) U'`, as of what the rows of one test share ([`crate::response::Covariance`]).
#[derive(Clone, Debug)]
pub struct Common {
    u: DMatrix<f64>,
    shrink: Vec<f64>,
}

impl Common {
    /// `columns`: C, one standard deviation each, in the rows of all tests as these are whitened by themselves. None where there is none.
    pub fn new(columns: DMatrix<f64>) -> Option<Common> {
        if columns.ncols() == 0 || columns.nrows() == 0 || columns.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let svd = columns.svd(true, false);
        let shrink = svd.singular_values.iter().map(|s| 1.0 / (1.0 + s * s).sqrt() - 1.0).collect();
        Some(Common { u: svd.u?, shrink })
    }

    /// Whitens rows of all tests, one column or many, that are whitened test by test.
    pub fn whiten(&self, mut rows: DMatrixViewMut<f64>) {
        let mut along = self.u.tr_mul(&rows);
        for (mut row, shrink) in along.row_iter_mut().zip(&self.shrink) {
            row *= *shrink;
        }
        rows.gemm(1.0, &self.u, &along, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_whitened_by_the_inverse_of_their_covariance() {
        let c = DMatrix::from_fn(12, 3, |i, k| ((i * (k + 2)) as f64 * 0.37).sin() * 10f64.powi(k as i32 - 1));
        let r = DMatrix::from_fn(12, 2, |i, k| ((i + k) as f64 * 1.7).cos());
        let mut w = r.clone();
        Common::new(c.clone()).unwrap().whiten(w.as_view_mut());
        let want = r.tr_mul(&(DMatrix::identity(12, 12) + &c * c.transpose()).lu().solve(&r).unwrap());
        approx::assert_relative_eq!(w.tr_mul(&w), want, max_relative = 1e-10);
        assert!(Common::new(DMatrix::zeros(12, 0)).is_none());
    }
}
