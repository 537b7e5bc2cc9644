//! The likelihood of a model's residuals, and the restricted one by which variances are estimated.

use std::ops::Range;

use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};

use super::common::Common;
use super::record::{Alike, LogSum, Part, Varied};
use super::{Counts, Evidence, Record, Seen, Variances, beside};
use crate::parallel;

/// A test with its columns `A = [X, B]`, `X = [r, J / ||J||]`. What varies alike has the same weight `w` under all variances, and of such a lot `w A'A` needs no row:
/// its squares are formed once, where it has more rows than a few.
pub struct Gram {
    /// Columns of X and of B.
    columns: (usize, usize),
    lots: Vec<Lot>,
    /// Rows of the lots that have few, one lot after the other.
    rows: DMatrix<f64>,
    alike: Vec<Alike>,
}

/// What of a lot stands in a [`Gram`].
enum Lot {
    /// `A'A`.
    Squares(DMatrix<f64>),
    /// Its rows.
    Rows(Range<usize>),
}

/// Rows of a lot up to which these are multiplied anew each time: a product of matrices does as many operations a second as several sums of them.
const FEW: usize = 8;

impl Gram {
    /// Numbers that are added up when it is weighed, roughly.
    fn size(&self) -> usize {
        (self.columns.0 + self.columns.1).pow(2) * (self.lots.len() + self.rows.nrows())
    }

    fn of(record: &Record, z: &DVector<f64>, x: &DMatrix<f64>, b: &DMatrix<f64>) -> Gram {
        let (all, alike) = (beside(x, b), record.alike(z));
        let (mut lots, mut few) = (Vec::new(), Vec::new());
        for lot in &alike {
            if lot.members.len() > FEW {
                lots.push(Lot::Squares(squared(&all.select_rows(&lot.members))));
            } else {
                lots.push(Lot::Rows(few.len()..few.len() + lot.members.len()));
                few.extend(&lot.members);
            }
        }
        Gram { columns: (x.ncols(), b.ncols()), lots, rows: all.select_rows(&few), alike }
    }

    /// Squares and level of its coefficients under the variances that each of them has by itself.
    fn weighed(&self, channels: &[Varied], errors: &[f64]) -> Squares {
        let n = self.columns.0 + self.columns.1;
        let (mut squares, mut rows, mut ld, mut logs) = (DMatrix::zeros(n, n), self.rows.clone(), 0.0, LogSum::default());
        for (alike, lot) in self.alike.iter().zip(&self.lots) {
            let part = alike.part(channels, errors[alike.channel]);
            let w = 1.0 / part.variance(alike.z);
            ld += alike.level(&part, channels, &mut logs);
            match lot {
                Lot::Squares(own) => (0..n).for_each(|k| {
                    squares.view_mut((k, k), (n - k, 1)).zip_apply(&own.view((k, k), (n - k, 1)), |sum, own| *sum += w * own)
                }),
                Lot::Rows(range) => rows.rows_mut(range.start, range.len()).scale_mut(w.sqrt()),
            }
        }
        if rows.nrows() > 0 {
            squares += squared(&rows);
        }
        Squares { columns: self.columns, squares, ld: ld + logs.total() }
    }
}

/// `work` for every test, on all threads where it is long enough for them to be woken.
fn spread<T: Send>(size: usize, tests: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    if size < WORTH_A_THREAD { (0..tests).map(work).collect() } else { parallel::over(tests, work) }
}

/// Numbers to be added up that take as long as it takes to wake a thread, some tens of microseconds.
const WORTH_A_THREAD: usize = 200_000;

/// The lower triangle of `A'A`.
fn squared(a: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.ncols();
    let mut squares = DMatrix::zeros(n, n);
    let rows = MatRef::from_column_major_slice(a.as_slice(), a.nrows(), n);
    let lower = MatMut::from_column_major_slice_mut(squares.as_mut_slice(), n, n);
    let (triangle, whole) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    matmul(lower, triangle, Accum::Replace, rows.transpose(), whole, rows, whole, 1.0, Par::Seq);
    squares
}

/// The lower triangle of `A'WA` of a test and `-ln|W|`: all that variances of single coefficients, a common noise and the model's own errors, change of its likelihood.
pub(super) struct Squares {
    columns: (usize, usize),
    squares: DMatrix<f64>,
    ld: f64,
}

impl Squares {
    /// Those of all tests.
    pub fn of(e: &Evidence, grams: &[Gram], v: &Variances) -> Vec<Squares> {
        let of = |t: usize| grams[t].weighed(&e.records[t].varied(v.kappa), &v.own_errors(t, &e.records[t]));
        spread(grams.iter().map(Gram::size).sum(), grams.len(), of)
    }

    /// `([X, C]'V^-1[X, C], ln|V|)`, coefficients with the columns of B in common, each times its factor, C what of these the `test` has in common with others.
    fn information(&self, factors: &[f64], common: &Common, test: usize) -> Option<(DMatrix<f64>, f64)> {
        let mut squares = common.squares(test, &self.squares, self.columns.0);
        let n = self.columns.0 + common.count;
        for (k, factor) in factors.iter().enumerate().filter(|(_, factor)| **factor != 1.0) {
            squares.column_mut(n + k).scale_mut(*factor);
            squares.row_mut(n + k).scale_mut(*factor);
        }
        information(&squares, n, self.ld)
    }
}

/// `(X'V^-1X, ln|V|)` from the lower triangle of the squares `A'WA` of `A = [X, B]`, X of `n` columns: `V = W^-1 + BB'`, so that `V^-1 = W - WB (1 + B'WB)^-1 B'W`.
fn information(squares: &DMatrix<f64>, n: usize, mut ld: f64) -> Option<(DMatrix<f64>, f64)> {
    let m = squares.ncols() - n;
    let mut inner = squares.view((n, n), (m, m)).into_owned();
    (0..m).for_each(|k| inner[(k, k)] += 1.0);
    let factor = inner.cholesky()?;
    let u = factor.l().solve_lower_triangular(&squares.view((n, 0), (m, n)))?;
    ld += 2.0 * factor.l().diagonal().iter().map(|v| v.ln()).sum::<f64>();
    let mut whole = squares.view((0, 0), (n, n)) - squared(&u);
    whole.fill_upper_triangle_with_lower_triangle();
    Some((whole, ld)).filter(|(m, ld)| ld.is_finite() && m.iter().all(|v| v.is_finite()))
}

/// The same of a test whose coefficients vary by these parts, counted `z` times.
fn of_parts(x: &DMatrix<f64>, b: &DMatrix<f64>, parts: &[Part], z: &DVector<f64>) -> Option<(DMatrix<f64>, f64)> {
    let ld: f64 = parts.iter().zip(z.iter()).map(|(p, z)| p.level(*z)).sum();
    let (mut all, w) = (beside(x, b), weights(parts, z).map(f64::sqrt));
    all.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
    information(&squared(&all), x.ncols(), ld)
}

/// A residual as a column.
fn column(r: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(r.len(), 1, r.as_slice())
}

/// Weight of each residual's square, z over its variance; 0 where a coefficient is not compared.
fn weights(parts: &[Part], z: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(parts.len(), parts.iter().zip(z.iter()).map(|(p, z)| 1.0 / p.variance(*z)))
}

impl Evidence {
    pub(super) fn grams(&self, seen: &[Seen], counts: &Counts) -> Vec<Gram> {
        let parameters = seen.first().map_or(0, |s| s.j.ncols());
        // Parameters in units in which they all matter alike.
        let size: Vec<f64> = (0..parameters)
            .map(|k| seen.iter().zip(&self.records).map(|(s, r)| s.j.column(k).norm_squared() / r.size.iter().sum::<f64>()).sum::<f64>())
            .map(|s| if s > 0.0 && s.is_finite() { s.sqrt() } else { 1.0 })
            .collect();
        let of = |((record, s), z): ((&Record, &Seen), &DVector<f64>)| {
            let mut j = s.j.clone();
            j.column_iter_mut().zip(&size).for_each(|(mut c, size)| c /= *size);
            let b = beside(&beside(&record.instruments.columns, &s.strengths), &s.bends);
            Gram::of(record, z, &beside(&column(&s.r), &j), &b)
        };
        self.records.iter().zip(seen).zip(&counts.z).map(of).collect()
    }

    /// `l_z` of the residuals, the prior of the variances with it.
    pub fn likelihood(&self, seen: &[Seen], counts: &Counts, v: &Variances) -> f64 {
        let residuals = |s: &Seen| column(&s.r);
        let Some((inner, ld)) = self.together(seen, counts, v, residuals) else { return f64::NEG_INFINITY };
        self.prior(counts, v) - 0.5 * (ld + inner[(0, 0)])
    }

    /// `(X'V^-1X, ln|V|)` of all tests, what they have in common with it.
    fn together(&self, seen: &[Seen], counts: &Counts, v: &Variances, x: impl Fn(&Seen) -> DMatrix<f64>) -> Option<(DMatrix<f64>, f64)> {
        let common = Common::of(self);
        let n = seen.first().map_or(0, |s| x(s).ncols());
        let (mut whole, mut ld) = (DMatrix::zeros(n + common.count, n + common.count), 0.0);
        for (t, (record, s)) in self.records.iter().zip(seen).enumerate() {
            let parts = record.parts(v.kappa, &v.own_errors(t, record));
            let shared = common.own(t, record.shared(s, v.scatter(record)));
            let (inner, own) = of_parts(&beside(&x(s), &common.columns(t, record)), &shared, &parts, &counts.z[t])?;
            (whole, ld) = (whole + inner, ld + own);
        }
        information(&whole, n, ld)
    }
}

impl Evidence {
    /// Logarithm of the density of tests that a model was not fitted to, its variances those of the tests it was: the sum over tests of
    /// `ln of the integral of l_z(v, g) N(g; 0, s^2) dg`, where in such a test the model errs by `e^g` times what it errs by on average: laws fail unevenly, and
    /// a model that foretold a test within twice its error would be held to have failed by hundreds of nats. On the grid of the own errors, and beyond it as far
    /// as the integrand reaches: what every model of a study gets wrong by its own size must not tell the precise one from the rough one by the square of that.
    pub fn predictive(&self, seen: &[Seen], counts: &Counts, v: &Variances) -> f64 {
        let s = &self.settings;
        let of = |(t, (record, seen)): (usize, (&Record, &Seen))| {
            let (x, shared) = (column(&seen.r), record.shared(seen, v.scatter(record)));
            let mut at = v.clone();
            let mut density = |g: f64| {
                at.own[t] = v.own[t].iter().map(|own| own + g).collect();
                let parts = record.parts(v.kappa, &at.own_errors(t, record));
                let fitted = of_parts(&x, &shared, &parts, &counts.z[t]);
                fitted.map_or(f64::NEG_INFINITY, |(inner, ld)| -0.5 * (ld + inner[(0, 0)] + (g / s.model_error_spread).powi(2)))
            };
            let (mut all, mut most, mut last) = (Vec::new(), f64::NEG_INFINITY, f64::NEG_INFINITY);
            for (k, g) in s.endless_grid().enumerate() {
                let next = density(g);
                let reaches = next > last || next > most - s.negligible;
                if k >= s.own_points && !reaches {
                    break;
                }
                all.push(next);
                (most, last) = (most.max(next), next);
            }
            let weight: f64 = s.own_grid().map(|g| (-0.5 * (g / s.model_error_spread).powi(2)).exp()).sum();
            if most.is_finite() { most + (all.iter().map(|l| (l - most).exp()).sum::<f64>() / weight).ln() } else { most }
        };
        self.records.iter().zip(seen).enumerate().map(of).sum()
    }
}

impl Evidence {
    /// `r'V^-1 r` over all tests.
    pub fn squares(&self, seen: &[Seen], counts: &Counts, v: &Variances) -> f64 {
        let of = |t: usize| {
            let (record, s) = (&self.records[t], &seen[t]);
            let parts = record.parts(v.kappa, &v.own_errors(t, record));
            of_parts(&column(&s.r), &record.shared(s, v.scatter(record)), &parts, &counts.z[t]).map_or(0.0, |(inner, _)| inner[(0, 0)])
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
            of_parts(&column(&s.r), &record.shared(s, v.scatter(record)), &parts, &counts.z[t])
                .map_or(f64::INFINITY, |(inner, _)| inner[(0, 0)])
        };
        ((0..self.records.len()).map(of).sum::<f64>() / counts.n.max(1.0)).sqrt()
    }
}

/// The restricted likelihood under the variances that the squares stand for and the scatter of `v`: the parameters integrated out to first order.
/// `common`: what tests have in common.
pub(super) fn restricted(e: &Evidence, common: &Common, squares: &[Squares], seen: &[Seen], v: &Variances) -> Option<f64> {
    let p = squares.first()?.columns.0;
    let (mut whole, mut ld) = (DMatrix::zeros(p + common.count, p + common.count), 0.0);
    let of = |t: usize| {
        let (record, own) = (&e.records[t], &squares[t]);
        let (scattering, bending) = (seen[t].strengths.ncols(), seen[t].bends.ncols());
        let (from, w) = (own.columns.1 - scattering - bending, v.scatter(record).exp());
        let mut factors = vec![1.0; from];
        factors.resize(from + scattering, w);
        factors.resize(from + scattering + bending, w * w * std::f64::consts::FRAC_1_SQRT_2);
        own.information(&factors, common, t)
    };
    for own in spread(squares.iter().map(|s| s.squares.len() * s.squares.ncols()).sum(), squares.len(), of) {
        let (inner, own) = own?;
        (whole, ld) = (whole + inner, ld + own);
    }
    let (whole, ld) = information(&whole, p, ld)?;
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
        let (mut whole, _) = self.together(seen, counts, v, |s| beside(&column(&s.r), &s.j))?;
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
    taken(&b, &seen.r, parts, z).map_or_else(|| seen.r.clone(), |x| &seen.r - b * x)
}

/// What each column of B takes of a residual, in standard deviations: `(1 + B'WB)^-1 B'W r`, the mean of x given `r = B x + ...`, x ~ N(0, 1).
fn taken(b: &DMatrix<f64>, r: &DVector<f64>, parts: &[Part], z: &DVector<f64>) -> Option<DVector<f64>> {
    let w = weights(parts, z);
    let mut bw = b.clone();
    bw.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
    let mut inner = bw.tr_mul(b);
    (0..inner.nrows()).for_each(|k| inner[(k, k)] += 1.0);
    Some(inner.cholesky()?.solve(&bw.tr_mul(r)))
}

impl Evidence {
    /// What the instruments of each test read wrong by this model, most likely, in standard deviations of what each may err by, one for each of
    /// [`crate::response::Instruments::of`]. Above 0: they read less than there is.
    pub fn readings(&self, seen: &[Seen], counts: &Counts, v: &Variances) -> Vec<Vec<f64>> {
        let of = |(t, record): (usize, &Record)| {
            let parts = record.parts(v.kappa, &v.own_errors(t, record));
            let all = taken(&record.shared(&seen[t], v.scatter(record)), &seen[t].r, &parts, &counts.z[t]);
            let n = record.instruments.of.len();
            all.map_or_else(|| vec![0.0; n], |x| x.iter().take(n).copied().collect())
        };
        self.records.iter().enumerate().map(of).collect()
    }
}
