//! The likelihood of a model's residuals, and the restricted one by which variances are estimated.

use nalgebra::{DMatrix, DVector};

use super::{Counts, Errors, Evidence, Seen, Variances, beside};

/// Ridge on the information of the parameters, of which the tests may not know all.
const RIDGE: f64 = 1e-9;

/// `(X'V^-1X, ln|V|)` of a test of variances `d` that shares the columns `b`, counted `z` times.
fn information(x: &DMatrix<f64>, b: &DMatrix<f64>, d: &[f64], z: &DVector<f64>) -> Option<(DMatrix<f64>, f64)> {
    let (mut ld, mut w) = (0.0, DVector::zeros(d.len()));
    for (i, d) in d.iter().enumerate() {
        if d.is_finite() && z[i] > 0.0 {
            ld += z[i] * d.ln();
            w[i] = z[i] / d;
        }
    }
    let weighed = |m: &DMatrix<f64>| {
        let mut m = m.clone();
        m.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
        m
    };
    let (xw, bw) = (weighed(x), weighed(b));
    let mut inner = bw.transpose() * b;
    (0..inner.nrows()).for_each(|k| inner[(k, k)] += 1.0);
    let factor = inner.cholesky()?;
    let u = factor.l().solve_lower_triangular(&(bw.transpose() * x))?;
    ld += 2.0 * factor.l().diagonal().iter().map(|v| v.ln()).sum::<f64>();
    let whole = xw.transpose() * x - u.transpose() * u;
    Some((whole, ld)).filter(|(m, ld)| ld.is_finite() && m.iter().all(|v| v.is_finite()))
}

impl Evidence {
    /// Residual and derivatives of each test, `X = [r, J / ||J||]`.
    pub(super) fn columns(&self, seen: &[Seen]) -> Vec<DMatrix<f64>> {
        let parameters = seen.first().map_or(0, |s| s.j.ncols());
        // Parameters in units in which they all matter alike.
        let size: Vec<f64> = (0..parameters)
            .map(|k| seen.iter().zip(&self.records).map(|(s, r)| s.j.column(k).norm_squared() / r.size.iter().sum::<f64>()).sum::<f64>())
            .map(|s| if s > 0.0 && s.is_finite() { s.sqrt() } else { 1.0 })
            .collect();
        let of = |s: &Seen| {
            let mut j = s.j.clone();
            j.column_iter_mut().zip(&size).for_each(|(mut c, size)| c /= *size);
            beside(&alone(&s.r), &j)
        };
        seen.iter().map(of).collect()
    }

    /// `(r'V^-1 r, ln|V|)` of a test.
    fn of_residual(&self, t: usize, seen: &Seen, z: &DVector<f64>, kappa: f64, omega: f64, errors: &Errors) -> Option<(f64, f64)> {
        let record = &self.records[t];
        let b = record.shared(seen, omega, errors);
        information(&alone(&seen.r), &b, &record.variance(kappa, errors), z).map(|(inner, ld)| (inner[(0, 0)], ld))
    }

    /// `l_z` of the residuals, the prior of the variances with it.
    pub fn likelihood(&self, seen: &[Seen], counts: &Counts, v: &Variances) -> f64 {
        let mut sum = v.prior(&self.settings);
        for (t, s) in seen.iter().enumerate() {
            let of = self.of_residual(t, s, &counts.z[t], v.kappa, v.omega, &v.errors(t, &self.settings));
            let Some((squares, ld)) = of else { return f64::NEG_INFINITY };
            sum -= 0.5 * (ld + squares);
        }
        sum
    }

    /// `r'V^-1 r` over all tests.
    pub fn squares(&self, seen: &[Seen], counts: &Counts, v: &Variances) -> f64 {
        let of = |t: usize| self.of_residual(t, &seen[t], &counts.z[t], v.kappa, v.omega, &v.errors(t, &self.settings));
        (0..self.records.len()).map(|t| of(t).map_or(0.0, |s| s.0)).sum()
    }

    /// Root mean square of the residuals in units of their noise, instruments within tolerance and strengths that scatter granted.
    pub fn over_noise(&self, seen: &[Seen], v: &Variances) -> f64 {
        let counts = self.independent();
        let of = |t: usize| {
            let none = Errors::none(self.records[t].channels.len());
            self.of_residual(t, &seen[t], &counts.z[t], v.kappa.max(0.0), v.omega, &none).map_or(f64::INFINITY, |s| s.0)
        };
        ((0..self.records.len()).map(of).sum::<f64>() / counts.n.max(1.0)).sqrt()
    }
}

/// A residual as a matrix of one column.
fn alone(r: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(r.len(), 1, r.as_slice())
}

/// The restricted likelihood: the parameters integrated out to first order.
pub(super) fn restricted(e: &Evidence, columns: &[DMatrix<f64>], seen: &[Seen], counts: &Counts, v: &Variances) -> Option<f64> {
    let p = columns.first()?.ncols();
    let (mut whole, mut ld) = (DMatrix::zeros(p, p), 0.0);
    for (t, (record, x)) in e.records.iter().zip(columns).enumerate() {
        let errors = v.errors(t, &e.settings);
        let b = record.shared(&seen[t], v.omega, &errors);
        let (inner, own) = information(x, &b, &record.variance(v.kappa, &errors), &counts.z[t])?;
        (whole, ld) = (whole + inner, ld + own);
    }
    let mut k = whole.view((1, 1), (p - 1, p - 1)).into_owned();
    (0..p - 1).for_each(|i| k[(i, i)] += RIDGE * (k[(i, i)] + RIDGE));
    let restricted = if p > 1 { k.cholesky()?.l().diagonal().iter().map(|v| v.ln()).sum::<f64>() } else { 0.0 };
    Some(-0.5 * (ld + whole[(0, 0)]) - restricted).filter(|l| l.is_finite())
}

/// What the columns `b` take of a residual, `B'V^-1 r`: its expected value under their priors.
pub(super) fn taken(r: &DVector<f64>, b: &DMatrix<f64>, d: &[f64], z: &DVector<f64>) -> DVector<f64> {
    let w = DVector::from_iterator(d.len(), d.iter().zip(z.iter()).map(|(d, z)| if d.is_finite() { z / d } else { 0.0 }));
    let mut bw = b.clone();
    bw.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
    let mut inner = bw.transpose() * b;
    (0..inner.nrows()).for_each(|k| inner[(k, k)] += 1.0);
    let Some(factor) = inner.cholesky() else { return DVector::zeros(b.ncols()) };
    factor.solve(&(bw.transpose() * r))
}
