//! The likelihood of a model's residuals, and the restricted one by which variances are estimated.

use nalgebra::{DMatrix, DVector};

use super::record::Part;
use super::{Counts, Evidence, Record, Seen, Variances, beside};

/// A test with its columns `X = [r, J / ||J||]` and `B`.
pub struct Gram {
    x: DMatrix<f64>,
    b: DMatrix<f64>,
}

/// `(X'V^-1X, ln|V|)` of a test whose coefficients vary by these parts, counted `z` times.
fn information(gram: &Gram, b: &DMatrix<f64>, parts: &[Part], z: &DVector<f64>) -> Option<(DMatrix<f64>, f64)> {
    let w = weights(parts, z);
    let mut ld: f64 = parts.iter().zip(z.iter()).map(|(p, z)| p.level(*z)).sum();
    let weighed = |m: &DMatrix<f64>| {
        let mut m = m.clone();
        m.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
        m
    };
    let (xw, bw) = (weighed(&gram.x), weighed(b));
    let mut inner = bw.transpose() * b;
    (0..inner.nrows()).for_each(|k| inner[(k, k)] += 1.0);
    let factor = inner.cholesky()?;
    let u = factor.l().solve_lower_triangular(&(bw.transpose() * &gram.x))?;
    ld += 2.0 * factor.l().diagonal().iter().map(|v| v.ln()).sum::<f64>();
    let whole = xw.transpose() * &gram.x - u.transpose() * u;
    Some((whole, ld)).filter(|(m, ld)| ld.is_finite() && m.iter().all(|v| v.is_finite()))
}

/// Weight of each residual's square, z over its variance; 0 where a coefficient is not compared.
fn weights(parts: &[Part], z: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(parts.len(), parts.iter().zip(z.iter()).map(|(p, z)| 1.0 / p.variance(*z)))
}

impl Evidence {
    pub(super) fn grams(&self, seen: &[Seen]) -> Vec<Gram> {
        let parameters = seen.first().map_or(0, |s| s.j.ncols());
        // Parameters in units in which they all matter alike.
        let size: Vec<f64> = (0..parameters)
            .map(|k| seen.iter().zip(&self.records).map(|(s, r)| s.j.column(k).norm_squared() / r.size.iter().sum::<f64>()).sum::<f64>())
            .map(|s| if s > 0.0 && s.is_finite() { s.sqrt() } else { 1.0 })
            .collect();
        let of = |(record, s): (&Record, &Seen)| {
            let mut j = s.j.clone();
            j.column_iter_mut().zip(&size).for_each(|(mut c, size)| c /= *size);
            let r = DMatrix::from_column_slice(s.r.len(), 1, s.r.as_slice());
            Gram { x: beside(&r, &j), b: beside(&beside(&record.instruments, &s.strengths), &s.bends) }
        };
        self.records.iter().zip(seen).map(of).collect()
    }

    /// `l_z` of the residuals, the prior of the variances with it.
    pub fn likelihood(&self, seen: &[Seen], counts: &Counts, v: &Variances) -> f64 {
        let mut sum = self.prior(counts, v);
        for (t, (record, s)) in self.records.iter().zip(seen).enumerate() {
            let parts = record.parts(v.kappa, &v.own_errors(t, record));
            let gram = Gram { x: DMatrix::from_column_slice(s.r.len(), 1, s.r.as_slice()), b: DMatrix::zeros(0, 0) };
            let Some((inner, ld)) = information(&gram, &record.shared(s, v.omega), &parts, &counts.z[t]) else { return f64::NEG_INFINITY };
            sum -= 0.5 * (ld + inner[(0, 0)]);
        }
        sum
    }
}

impl Evidence {
    /// `r'V^-1 r` over all tests.
    pub fn squares(&self, seen: &[Seen], counts: &Counts, v: &Variances) -> f64 {
        let of = |t: usize| {
            let (record, s) = (&self.records[t], &seen[t]);
            let parts = record.parts(v.kappa, &v.own_errors(t, record));
            let gram = Gram { x: DMatrix::from_column_slice(s.r.len(), 1, s.r.as_slice()), b: DMatrix::zeros(0, 0) };
            information(&gram, &record.shared(s, v.omega), &parts, &counts.z[t]).map_or(0.0, |(inner, _)| inner[(0, 0)])
        };
        (0..self.records.len()).map(of).sum()
    }

    /// Root mean square of the residuals in units of their noise, instruments within tolerance and strengths that scatter granted.
    pub fn over_noise(&self, seen: &[Seen], v: &Variances) -> f64 {
        let counts = self.independent();
        let of = |t: usize| {
            let (record, s) = (&self.records[t], &seen[t]);
            let parts = record.parts(v.kappa.max(0.0), &vec![0.0; record.channels.len()]);
            let parts: Vec<Part> = parts.into_iter().map(|p| Part { colour: 1.0, ..p }).collect();
            let gram = Gram { x: DMatrix::from_column_slice(s.r.len(), 1, s.r.as_slice()), b: DMatrix::zeros(0, 0) };
            information(&gram, &record.shared(s, v.omega), &parts, &counts.z[t]).map_or(f64::INFINITY, |(inner, _)| inner[(0, 0)])
        };
        ((0..self.records.len()).map(of).sum::<f64>() / counts.n.max(1.0)).sqrt()
    }
}

/// The restricted likelihood: the parameters integrated out to first order.
pub(super) fn restricted(e: &Evidence, grams: &[Gram], seen: &[Seen], counts: &Counts, v: &Variances) -> Option<f64> {
    let p = grams.first()?.x.ncols();
    let (mut whole, mut ld) = (DMatrix::zeros(p, p), 0.0);
    for (t, (record, gram)) in e.records.iter().zip(grams).enumerate() {
        let parts = record.parts(v.kappa, &v.own_errors(t, record));
        let mut b = gram.b.clone();
        let (scattering, bending) = (seen[t].strengths.ncols(), seen[t].bends.ncols());
        let from = b.ncols() - scattering - bending;
        b.columns_mut(from, scattering).scale_mut(v.omega.exp());
        b.columns_mut(from + scattering, bending).scale_mut((2.0 * v.omega).exp() * std::f64::consts::FRAC_1_SQRT_2);
        let (inner, own) = information(gram, &b, &parts, &counts.z[t])?;
        (whole, ld) = (whole + inner, ld + own);
    }
    let mut k = whole.view((1, 1), (p - 1, p - 1)).into_owned();
    let ridge = e.settings.ridge;
    (0..p - 1).for_each(|i| k[(i, i)] += ridge * (k[(i, i)] + ridge));
    let restricted = if p > 1 { k.cholesky()?.l().diagonal().iter().map(|v| v.ln()).sum::<f64>() } else { 0.0 };
    Some(-0.5 * (ld + whole[(0, 0)]) - restricted).filter(|l| l.is_finite())
}

impl Evidence {
    /// Nats by which a model's likelihood would rise with a step of its parameters, to first order in these: `1/2 g'H^-1 g` with `g = J'V^-1 r`,
    /// `H = J'V^-1 J`, their priors `(parameter, value, mean, sigma)` with both. None where `H` is singular.
    pub fn within_a_step(&self, seen: &[Seen], counts: &Counts, v: &Variances, priors: &[(usize, f64, f64, f64)]) -> Option<f64> {
        let n = seen.first()?.j.ncols();
        let mut whole = DMatrix::zeros(n + 1, n + 1);
        for (t, (record, s)) in self.records.iter().zip(seen).enumerate() {
            let r = DMatrix::from_column_slice(s.r.len(), 1, s.r.as_slice());
            let gram = Gram { x: beside(&r, &s.j), b: DMatrix::zeros(0, 0) };
            whole += information(&gram, &record.shared(s, v.omega), &record.parts(v.kappa, &v.own_errors(t, record)), &counts.z[t])?.0;
        }
        for (k, value, mean, sigma) in priors {
            whole[(k + 1, k + 1)] += sigma.powi(-2);
            whole[(k + 1, 0)] += (value - mean) / sigma.powi(2);
        }
        let size: Vec<f64> = (1..=n).map(|k| whole[(k, k)].sqrt()).map(|s| if s > 0.0 { s } else { 1.0 }).collect();
        let g = DVector::from_fn(n, |k, _| whole[(k + 1, 0)] / size[k]);
        let mut h = DMatrix::from_fn(n, n, |i, k| whole[(i + 1, k + 1)] / (size[i] * size[k]));
        (0..n).for_each(|k| h[(k, k)] += self.settings.ridge);
        Some(0.5 * g.dot(&h.cholesky()?.solve(&g)))
    }
}

/// What is left of a residual without what its coefficients share, `D V^-1 r`.
pub(super) fn cleaned(record: &Record, seen: &Seen, parts: &[Part], z: &DVector<f64>, omega: f64) -> DVector<f64> {
    let b = record.shared(seen, omega);
    let w = weights(parts, z);
    let mut bw = b.clone();
    bw.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
    let mut inner = bw.transpose() * &b;
    (0..inner.nrows()).for_each(|k| inner[(k, k)] += 1.0);
    let Some(factor) = inner.cholesky() else { return seen.r.clone() };
    &seen.r - &b * factor.solve(&(bw.transpose() * &seen.r))
}
