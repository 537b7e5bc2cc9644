//! Orthogonal factorisations by faer on nalgebra's column-major storage. J'J is formed nowhere.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::qr::no_pivoting::factor;
use faer::{Mat, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};

pub(crate) fn view(a: &DMatrix<f64>) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(a.as_slice(), a.nrows(), a.ncols())
}

fn to_nalgebra(a: MatRef<'_, f64>) -> DMatrix<f64> {
    DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)])
}

/// [J | r] reduced to its triangle [A | q]: ||A d + q|| = ||J d + r|| for every d, with at most n + 1 rows.
#[derive(Debug, Clone)]
pub(crate) struct Reduced {
    pub a: DMatrix<f64>,
    pub q: DVector<f64>,
}

impl Reduced {
    /// Takes what is left of columns that are rounding for none.
    pub fn forget(&mut self, columns: &[usize]) {
        columns.iter().for_each(|&j| self.a.column_mut(j).fill(0.0));
    }
}

/// Householder QR with kept memory: one reduction per iteration, all of the same size.
#[derive(Default)]
pub(crate) struct QrReducer {
    work: Vec<f64>,
    coefficients: Option<Mat<f64>>,
    scratch: Option<MemBuffer>,
    shape: (usize, usize),
}

impl QrReducer {
    /// Reduces diag(w) [J | r]; `sqrt_weights` None means w = 1.
    pub fn reduce(&mut self, j: &DMatrix<f64>, r: &DVector<f64>, sqrt_weights: Option<&[f64]>) -> Reduced {
        let (m, n) = (j.nrows(), j.ncols() + 1);
        self.work.clear();
        self.work.extend_from_slice(j.as_slice());
        self.work.extend_from_slice(r.as_slice());
        if let Some(w) = sqrt_weights {
            for column in self.work.chunks_exact_mut(m.max(1)) {
                column.iter_mut().zip(w).for_each(|(v, w)| *v *= w);
            }
        }
        let block = factor::recommended_block_size::<f64>(m, n);
        if self.shape != (m, n) {
            self.coefficients = Some(Mat::zeros(block, m.min(n)));
            self.scratch = Some(MemBuffer::new(factor::qr_in_place_scratch::<f64>(m, n, block, Par::Seq, Default::default())));
            self.shape = (m, n);
        }
        if let (Some(scratch), Some(coefficients)) = (&mut self.scratch, &mut self.coefficients) {
            factor::qr_in_place(
                MatMut::from_column_major_slice_mut(&mut self.work, m, n),
                coefficients.as_mut(),
                Par::Seq,
                MemStack::new(scratch),
                Default::default(),
            );
        }
        let k = m.min(n);
        let upper = |i: usize, c: usize| if i <= c { self.work[c * m + i] } else { 0.0 };
        Reduced { a: DMatrix::from_fn(k, n - 1, upper), q: DVector::from_fn(k, |i, _| upper(i, n - 1)) }
    }
}

/// argmin ||B u + c||^2 + damping ||u||^2 by QR of [B; sqrt(damping) I]; `damping` > 0 makes it full rank.
pub(crate) fn damped_least_squares(b: &DMatrix<f64>, c: &DVector<f64>, damping: f64) -> DVector<f64> {
    let (k, n) = b.shape();
    if n == 0 {
        return DVector::zeros(0);
    }
    let root = damping.sqrt();
    let stacked = Mat::from_fn(k + n, n + 1, |i, j| match (i < k, j < n) {
        (true, true) => b[(i, j)],
        (true, false) => -c[i],
        (false, true) if i - k == j => root,
        _ => 0.0,
    });
    let qr = stacked.qr();
    let r = qr.thin_R();
    let mut u = Mat::from_fn(n, 1, |i, _| r[(i, n)]);
    faer::linalg::triangular_solve::solve_upper_triangular_in_place(r.get(..n, ..n), u.as_mut(), Par::Seq);
    DVector::from_fn(n, |i, _| u[(i, 0)])
}

/// Column-pivoted QR of a matrix of constraint gradients (columns): A P = Q R, with its rank.
pub(crate) struct PivotedQr {
    /// full orthogonal factor, n x n
    pub q: DMatrix<f64>,
    /// upper trapezoid
    pub r: DMatrix<f64>,
    /// column `perm[i]` of A stands at place i
    pub perm: Vec<usize>,
    pub rank: usize,
}

pub(crate) fn pivoted_qr(a: &DMatrix<f64>, relative_tolerance: f64) -> PivotedQr {
    let qr = view(a).col_piv_qr();
    let r = to_nalgebra(qr.thin_R());
    let top = if r.is_empty() { 0.0 } else { r[(0, 0)].abs() };
    let rank = (0..r.nrows().min(r.ncols())).take_while(|&i| r[(i, i)].abs() > relative_tolerance * top).count();
    PivotedQr { q: to_nalgebra(qr.compute_Q().as_ref()), r, perm: qr.P().arrays().0.to_vec(), rank }
}

/// Singular values (descending, one per column) and V of A = U diag(s) V'; None when the iteration does not converge. A tall A is reduced to
/// its triangle first, which has the same s and V: U, rows by rows, is never formed.
pub(crate) fn svd(a: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let svd = if a.nrows() > a.ncols() { view(a).qr().thin_R().svd() } else { view(a).svd() }.ok()?;
    let s = svd.S().column_vector();
    let n = a.ncols();
    let values = DVector::from_fn(n, |i, _| if i < s.nrows() { s[i] } else { 0.0 });
    Some((values, to_nalgebra(svd.V())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reduction_keeps_the_norm_and_weights_rows() {
        let j = DMatrix::from_fn(7, 3, |i, c| ((i * 3 + c) as f64).sin());
        let r = DVector::from_fn(7, |i, _| (i as f64).cos());
        let w: Vec<f64> = (0..7).map(|i| 0.3 + i as f64).collect();
        let d = DVector::from_vec(vec![0.3, -2.0, 1.1]);
        let mut reducer = QrReducer::default();
        let plain = reducer.reduce(&j, &r, None);
        approx::assert_relative_eq!((&plain.a * &d + &plain.q).norm(), (&j * &d + &r).norm(), max_relative = 1e-14);
        let weighted = reducer.reduce(&j, &r, Some(&w));
        let full = DVector::from_iterator(7, (&j * &d + &r).iter().zip(&w).map(|(a, b)| a * b));
        approx::assert_relative_eq!((&weighted.a * &d + &weighted.q).norm(), full.norm(), max_relative = 1e-14);
    }

    #[test]
    fn singular_values_of_tall_and_wide() {
        let tall = DMatrix::from_fn(9, 3, |i, j| ((i * 3 + j) as f64).sin() + if j == 2 { 2.0 } else { 0.0 });
        let (s, v) = svd(&tall).unwrap();
        for k in 0..3 {
            approx::assert_relative_eq!((&tall * v.column(k)).norm(), s[k], max_relative = 1e-13);
        }
        let (s, v) = svd(&tall.transpose()).unwrap();
        assert_eq!((s.len(), v.shape()), (9, (9, 9)));
        assert!((tall.transpose() * v.column(8)).norm() < 1e-14 && s[8] == 0.0);
    }

    #[test]
    fn pivoted_qr_sees_the_rank() {
        let a = DMatrix::from_row_slice(3, 3, &[1.0, 2.0, 0.0, 1.0, 2.0, 1.0, 0.0, 0.0, 1.0]);
        let f = pivoted_qr(&a, 1e-12);
        assert_eq!(f.rank, 2);
        let permuted = DMatrix::from_fn(3, 3, |i, j| a[(i, f.perm[j])]);
        approx::assert_relative_eq!(&f.q * &f.r, permuted, epsilon = 1e-14);
    }
}
