//! Where the strengths of one test are.

use nalgebra::{DMatrix, DVector};

use super::likelihood::weights;
use super::{Counts, Evidence, Seen, Variances};
use crate::response::BlockKind;

impl Evidence {
    /// Whether deviations of strengths add up along test t, so that it has to be computed at its own: records.
    pub fn adds_up(&self, t: usize) -> bool {
        self.records[t].scatters && self.records[t].channels.iter().any(|c| c.kind == BlockKind::Record)
    }

    /// Logarithms `d` of the factors on the strengths of test t, those of [`Seen::strays`] in turn, that are likeliest from where it was computed: the best
    /// linear unbiased prediction (Robinson, Statist. Sci. 6, 1991) `d = -omega^2 S'V^-1 r`.
    pub fn likeliest_strays(&self, t: usize, seen: &Seen, counts: &Counts, v: &Variances) -> Option<DVector<f64>> {
        let shared = self.records[t].shared(seen, v.omega);
        let (w, b) = (self.weights(t, counts, v), &shared);
        let bw = weighed(b, &w);
        let factor = inner(&bw, b).cholesky()?;
        let u = factor.solve(&(bw.transpose() * &seen.r));
        let n = seen.strays.len();
        Some(u.rows(u.len() - n, n) * -v.omega.exp()).filter(|d| d.iter().all(|d| d.is_finite()))
    }

    /// Half the sum of squares of what test t leaves at its strays, instruments granted, and of the strays in units of their scatter.
    pub fn cost_at_strays(&self, t: usize, seen: &Seen, counts: &Counts, v: &Variances) -> f64 {
        let (b, w, r) = (&self.records[t].instruments, self.weights(t, counts, v), seen.at_strays());
        let bw = weighed(b, &w);
        let Some(factor) = inner(&bw, b).cholesky() else { return f64::INFINITY };
        let along = bw.transpose() * &r;
        let strays: f64 = seen.strays.iter().map(|s| (s.1 / v.omega.exp()).powi(2)).sum();
        0.5 * (r.component_mul(&w).dot(&r) - along.dot(&factor.solve(&along)) + strays)
    }

    fn weights(&self, t: usize, counts: &Counts, v: &Variances) -> DVector<f64> {
        weights(&self.records[t].parts(v.kappa, &v.own_errors(t, &self.records[t])), &counts.z[t])
    }
}

fn weighed(b: &DMatrix<f64>, w: &DVector<f64>) -> DMatrix<f64> {
    let mut b = b.clone();
    b.column_iter_mut().for_each(|mut c| c.component_mul_assign(w));
    b
}

/// `I + B'W B`.
fn inner(bw: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut inner = bw.transpose() * b;
    (0..inner.nrows()).for_each(|k| inner[(k, k)] += 1.0);
    inner
}
