//! The z-domain model and its poles, order by order.

use super::{FrfSet, of_pole};
use crate::parallel;
use nalgebra::{Complex, DMatrix, Schur};
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};

/// The band covers this part of the unit circle; the rest keeps its two ends apart.
const CIRCLE: f64 = 0.92;

/// A pole of one order.
#[derive(Debug, Clone, PartialEq)]
pub struct StablePole {
    pub order: usize,
    /// Hz
    pub frequency: f64,
    pub damping: f64,
    /// Frequency within 1 %, damping within 10 % (absolutely 0.002) and shape (MAC 0.9) of a pole of the order before.
    pub stable: bool,
    pub pole: Complex64,
    pub(super) shape: Vec<Complex64>,
}

type Matrix = DMatrix<Complex<f64>>;

/// Sums over the lines of w^2 g e^{i p theta} for p = -n..=n, of every product that the normal equations need.
struct Lags {
    n: usize,
    /// [output]: of 1.
    one: Vec<Vec<Complex64>>,
    /// [output][input]: of H.
    first: Vec<Vec<Vec<Complex64>>>,
    /// [input][input]: of conj(H_i) H_j, summed over the outputs.
    second: Vec<Vec<Vec<Complex64>>>,
}

fn lags(set: &FrfSet, theta: &[f64], n: usize) -> Lags {
    let (no, ni) = (set.outputs, set.inputs);
    let step: Vec<Complex64> = theta.iter().map(|t| Complex64::from_polar(1.0, *t)).collect();
    let sum = |g: &dyn Fn(usize) -> Complex64| {
        let mut out = vec![Complex64::default(); 2 * n + 1];
        for (k, z) in step.iter().enumerate() {
            let value = g(k);
            let (mut up, mut down) = (value, value);
            out[n] += value;
            for p in 1..=n {
                up *= z;
                down *= z.conj();
                out[n + p] += up;
                out[n - p] += down;
            }
        }
        out
    };
    // One weight per output and line: the pooled sigma of its FRFs.
    let weight = |o: usize, k: usize| ni as f64 / (0..ni).map(|i| set.sigma[o * ni + i][k].powi(2)).sum::<f64>();
    let h = |o: usize, i: usize, k: usize| set.h[o * ni + i][k];
    let one = parallel::over(no, |o| sum(&|k| Complex64::from(weight(o, k))));
    let first = parallel::over(no, |o| (0..ni).map(|i| sum(&|k| h(o, i, k) * weight(o, k))).collect());
    let product = |i: usize, j: usize| sum(&|k| (0..no).map(|o| h(o, i, k).conj() * h(o, j, k) * weight(o, k)).sum());
    let second = parallel::over(ni, |i| (0..ni).map(|j| product(i, j)).collect());
    Lags { n, one, first, second }
}

/// Poles of all orders up to `highest`, with those marked that agree with the order before.
pub(super) fn diagram(set: &FrfSet, highest: usize) -> Vec<StablePole> {
    let (f1, f2) = (set.frequency[0], set.frequency[set.frequency.len() - 1]);
    let theta: Vec<f64> = set.frequency.iter().map(|f| TAU * CIRCLE * (f - f1) / (f2 - f1)).collect();
    let lags = lags(set, &theta, highest);
    let by_order: Vec<Vec<StablePole>> = parallel::over(highest.saturating_sub(1), |k| poles(set, &lags, k + 2).unwrap_or_default());
    let mut all: Vec<StablePole> = Vec::new();
    let mut before: &[StablePole] = &[];
    for order in &by_order {
        for p in order {
            let same = |q: &StablePole| {
                (q.frequency / p.frequency - 1.0).abs() < 0.01
                    && (q.damping - p.damping).abs() < (0.1 * p.damping).max(0.002)
                    && super::mac(&q.shape, &p.shape) > 0.9
            };
            all.push(StablePole { stable: before.iter().any(same), ..p.clone() });
        }
        before = order;
    }
    all
}

/// The stable poles inside the band (and a little beyond) of the model of order n; none where its equations are singular.
fn poles(set: &FrfSet, lags: &Lags, n: usize) -> Option<Vec<StablePole>> {
    let (no, ni) = (set.outputs, set.inputs);
    let size = n + 1;
    let lag = |v: &[Complex64], r: usize, s: usize| v[lags.n + s - r];
    let mut m = Matrix::from_fn(size * ni, size * ni, |a, b| lag(&lags.second[a % ni][b % ni], a / ni, b / ni));
    let mut numerators = Vec::with_capacity(no);
    for o in 0..no {
        let ridge = lags.one[o][lags.n] * 1e-13;
        let r = Matrix::from_fn(size, size, |a, b| lag(&lags.one[o], a, b) + if a == b { ridge } else { Complex64::default() });
        let s = Matrix::from_fn(size, size * ni, |a, b| -lag(&lags.first[o][b % ni], a, b / ni));
        let x = r.cholesky()?.solve(&s);
        m -= s.adjoint() * &x;
        // B_o = -R^-1 S A
        numerators.push(-x);
    }
    // A_0 = I: with the lowest coefficient fixed the poles that only follow the noise turn out unstable (Cauberghe et al., 2005).
    let rest = m.view((ni, ni), (n * ni, n * ni)).into_owned();
    let rhs = -m.view((ni, 0), (n * ni, ni)).into_owned();
    let solved = rest.lu().solve(&rhs)?;
    let mut a = Matrix::zeros(size * ni, ni);
    a.view_mut((0, 0), (ni, ni)).fill_with_identity();
    a.view_mut((ni, 0), (n * ni, ni)).copy_from(&solved);
    // sum_r z^r A_r = 0 as a monic polynomial in y = 1 / z.
    let mut companion = Matrix::zeros(n * ni, n * ni);
    for r in 1..=n {
        companion.view_mut((0, (r - 1) * ni), (ni, ni)).copy_from(&-a.view((r * ni, 0), (ni, ni)));
    }
    for k in ni..n * ni {
        companion[(k, k - ni)] = Complex64::from(1.0);
    }
    let roots = Schur::try_new(companion, 1e-13, 10_000)?.complex_eigenvalues_of_triangle();
    let (f1, f2) = (set.frequency[0], set.frequency[set.frequency.len() - 1]);
    let per = (f2 - f1) / CIRCLE;
    let mut found = Vec::new();
    for y in roots {
        let z = Complex64::from(1.0) / y;
        if !z.is_finite() || z.norm() >= 1.0 || z.norm() < 1e-6 {
            continue;
        }
        // The gap of the circle is shared between the two ends of the band.
        let margin = PI * (1.0 - CIRCLE);
        let angle = (z.arg() + margin).rem_euclid(TAU) - margin;
        let s = Complex64::new(per * z.norm().ln(), TAU * f1 + per * angle);
        let (frequency, damping) = of_pole(s);
        if damping > 0.0 && damping < 0.5 && s.im > 0.0 {
            let shape = shape(&a, &numerators, z, ni);
            found.push(StablePole { order: n, frequency, damping, stable: false, pole: s, shape });
        }
    }
    Some(found)
}

/// The shape B(z) v with A(z) v = 0.
fn shape(a: &Matrix, numerators: &[Matrix], z: Complex64, ni: usize) -> Vec<Complex64> {
    let size = a.nrows() / ni;
    let powers: Vec<Complex64> = std::iter::successors(Some(Complex64::from(1.0)), |p| Some(p * z)).take(size).collect();
    let mut at = Matrix::zeros(ni, ni);
    for (r, p) in powers.iter().enumerate() {
        at += a.view((r * ni, 0), (ni, ni)) * *p;
    }
    let mut v = Matrix::from_element(ni, 1, Complex64::from(1.0));
    if ni > 1
        && let Some(vt) = at.svd(false, true).v_t
    {
        v.copy_from(&vt.row(ni - 1).adjoint());
    }
    let av = a * &v;
    numerators.iter().map(|b| (b * &av).iter().zip(&powers).map(|(b, p)| b * p).sum()).collect()
}

/// Eigenvalues from the triangle of a complex Schur form.
trait Triangle {
    fn complex_eigenvalues_of_triangle(self) -> Vec<Complex64>;
}

impl Triangle for Schur<Complex<f64>, nalgebra::Dyn> {
    fn complex_eigenvalues_of_triangle(self) -> Vec<Complex64> {
        let (_, t) = self.unpack();
        t.diagonal().iter().copied().collect()
    }
}
