//! Deviations of parts within their tolerances, as distributions in units of the width of the tolerance.
//!
//! A tolerance of width t holds deviations from -t/2 to t/2. With the process capability Cp = t / (6 sigma) and Cpk = (t/2 - |mean|) / (3 sigma) the deviation in
//! units of t is s = (side (Cp - Cpk) 3 + z) / (6 Cp), z a standard normal variable. It does not depend on t: one set of draws serves every width.

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, Normal};

use super::ToleranceError;
use super::sequence;

/// Form of a distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Normal, unbounded: parts beyond the tolerance are delivered.
    Normal,
    /// Normal, cut at the ends of the tolerance: parts beyond it are sorted out.
    Truncated,
    /// Uniform over the tolerance.
    Uniform,
}

impl Shape {
    /// The words of study.toml.
    pub const WORDS: [(&'static str, Shape); 3] = [("normal", Shape::Normal), ("truncated", Shape::Truncated), ("uniform", Shape::Uniform)];
}

/// One tolerance of a part.
#[derive(Clone, Debug, PartialEq)]
pub struct PartTolerance {
    /// Name: a column of the cases.
    pub name: String,
    /// Form of its distribution.
    pub shape: Shape,
    /// Process capability.
    pub cp: f64,
    /// The same with the offset of the mean.
    pub cpk: f64,
    /// Side the mean is off to, 1 or -1.
    pub side: f64,
    /// Cost times width [m]; none: the synthesis leaves the width as it is.
    pub cost: Option<f64>,
    /// Widths the synthesis may choose [m].
    pub range: (f64, f64),
}

impl PartTolerance {
    /// Deviation over the width of the tolerance at the probability `u`.
    pub fn unit(&self, u: f64, normal: &Normal) -> f64 {
        let shift = self.side * 3.0 * (self.cp - self.cpk);
        match self.shape {
            Shape::Uniform => u - 0.5,
            Shape::Normal => (shift + normal.inverse_cdf(u)) / (6.0 * self.cp),
            Shape::Truncated => {
                let (low, high) = (normal.cdf(-3.0 * self.cp - shift), normal.cdf(3.0 * self.cp - shift));
                ((shift + normal.inverse_cdf(low + u * (high - low))) / (6.0 * self.cp)).clamp(-0.5, 0.5)
            }
        }
    }
}

/// Lower triangle of the Cholesky factor of the correlations between `parts`; refuses a matrix that is not positive definite.
pub fn correlated(n: usize, pairs: &[(usize, usize, f64)]) -> Result<DMatrix<f64>, ToleranceError> {
    let mut matrix = DMatrix::identity(n, n);
    for (a, b, r) in pairs {
        (matrix[(*a, *b)], matrix[(*b, *a)]) = (*r, *r);
    }
    let least = matrix.clone().symmetric_eigenvalues().min();
    let wrong = || ToleranceError::Asked {
        key: "correlations".into(),
        message: format!(
            "the correlations contradict each other: their matrix has the eigenvalue {least:.3}, and is not positive definite"
        ),
        accepted: "coefficients nearer to 0".into(),
    };
    matrix.cholesky().map(|c| c.l()).filter(|_| least > 1e-9).ok_or_else(wrong)
}

/// Deviations of `n` assemblies over the widths, one row of `parts` after the other. Correlation is that of a Gaussian copula.
pub fn draws(parts: &[PartTolerance], factor: &DMatrix<f64>, n: usize, seed: u64) -> Vec<f64> {
    let d = parts.len();
    let normal = Normal::standard();
    let points = sequence::points(n, d, seed);
    let independent = (0..d).all(|a| (0..a).all(|b| factor[(a, b)] == 0.0));
    let row = |k: usize| -> Vec<f64> {
        let u = &points[k * d..(k + 1) * d];
        if independent {
            return parts.iter().zip(u).map(|(p, u)| p.unit(*u, &normal)).collect();
        }
        let z: Vec<f64> = u.iter().map(|u| normal.inverse_cdf(*u)).collect();
        let mixed = |a: usize| (0..=a).map(|b| factor[(a, b)] * z[b]).sum::<f64>();
        parts.iter().enumerate().map(|(a, p)| p.unit(normal.cdf(mixed(a)).clamp(1e-12, 1.0 - 1e-12), &normal)).collect()
    };
    const BLOCK: usize = 4096;
    let blocks = crate::parallel::over(n.div_ceil(BLOCK), |b| (b * BLOCK..n.min((b + 1) * BLOCK)).flat_map(row).collect::<Vec<f64>>());
    blocks.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(shape: Shape, cp: f64, cpk: f64) -> PartTolerance {
        PartTolerance { name: "t".into(), shape, cp, cpk, side: 1.0, cost: None, range: (0.0, 1.0) }
    }

    fn moments(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt())
    }

    #[test]
    fn capability_sets_spread_and_offset() {
        let one = DMatrix::identity(1, 1);
        let n = 1 << 14;
        // Cp 1.5: sigma = t / 9; Cpk 1: the mean is off by 0.5 * 3 sigma.
        let (mean, std) = moments(&draws(&[part(Shape::Normal, 1.5, 1.0)], &one, n, 1));
        assert!((std - 1.0 / 9.0).abs() < 1e-4 && (mean - 1.5 / 9.0).abs() < 1e-4, "{mean} {std}");
        let (mean, std) = moments(&draws(&[part(Shape::Uniform, 1.0, 1.0)], &one, n, 1));
        assert!((std - 1.0 / 12f64.sqrt()).abs() < 1e-4 && mean.abs() < 1e-4, "{mean} {std}");
        let all = draws(&[part(Shape::Truncated, 0.5, 0.5)], &one, n, 1);
        // Normal cut at 1.5 sigma: variance 1 - 2 * 1.5 phi(1.5) / (2 Phi(1.5) - 1), sigma = t / 3.
        let cut = (1.0 - 3.0 * 0.129_517_6 / 0.866_385_6f64).sqrt() / 3.0;
        assert!((moments(&all).1 - cut).abs() < 1e-4 && all.iter().all(|s| s.abs() <= 0.5), "{:?} {cut}", moments(&all));
    }

    #[test]
    fn deviations_are_correlated_as_asked_and_impossible_correlations_refused() {
        let parts = [part(Shape::Normal, 1.0, 1.0), part(Shape::Normal, 1.0, 1.0)];
        let factor = correlated(2, &[(0, 1, 0.8)]).unwrap();
        let all = draws(&parts, &factor, 1 << 14, 2);
        let product = all.chunks(2).map(|c| 36.0 * c[0] * c[1]).sum::<f64>() / (1 << 14) as f64;
        assert!((product - 0.8).abs() < 2e-3, "{product}");
        let e = correlated(3, &[(0, 1, 0.9), (1, 2, 0.9), (0, 2, -0.9)]).unwrap_err();
        assert!(e.to_string().contains("not positive definite"), "{e}");
    }
}
