//! A channel that creeps from cycle to cycle: its zero, not its loop.
//!
//! The means of the cycles are regressed on their number. What the means scatter by about that line has `cycles - 2` degrees of freedom, one of three cycles, which
//! proves nothing whatever the slope. But noise has a spectrum, and that of the mean of a cycle is about that of the second to fourth harmonic from cycle to
//! cycle (the first holds a force that differs from cycle to cycle). With `s^2` the variance of these, in terms of a mean, for [`NEIGHBOURS`] degrees of freedom,
//!
//! ```text
//! t = slope / sqrt(v / sum (c - c_mean)^2),   v = (NEIGHBOURS s^2 + SSE) / (NEIGHBOURS + cycles - 2)
//! ```
//!
//! is Student's t with the sum of both degrees of freedom: the conjugate prior of a variance (Gelman et al., Bayesian Data Analysis, 2013, ch. 2.6).

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::spectrum::{harmonic_of, harmonics};

/// A drift is believed when chance would give it less often than this.
const SIGNIFICANCE: f64 = 1e-3;
/// Degrees of freedom that the neighbouring harmonics count as: they know the scatter of the means to a third.
const NEIGHBOURS: f64 = 8.0;
/// These harmonics.
const HARMONICS: std::ops::RangeInclusive<usize> = 2..=4;

/// A linear drift common to all phases.
pub struct Drift {
    /// Change per cycle.
    pub slope: f64,
    /// Student's t.
    pub t: f64,
    /// Probability of a larger one by chance.
    pub p: f64,
}

/// The drift of cycles of `n` points, if it is significant; never tested against less than what white noise within the cycles gives, or the `floor` of a sample.
pub fn drift(folded: &[f64], n: usize, cycles: usize, floor: f64) -> Option<Drift> {
    if cycles < 3 {
        return None;
    }
    let means: Vec<f64> = folded.chunks(n).map(|c| c.iter().sum::<f64>() / n as f64).collect();
    let middle = (cycles - 1) as f64 / 2.0;
    let sxx: f64 = (0..cycles).map(|c| (c as f64 - middle).powi(2)).sum();
    let slope = means.iter().enumerate().map(|(c, m)| (c as f64 - middle) * m).sum::<f64>() / sxx;
    let grand = means.iter().sum::<f64>() / cycles as f64;
    let between: f64 = means.iter().enumerate().map(|(c, m)| (m - grand - slope * (c as f64 - middle)).powi(2)).sum();
    let mut within = 0.0;
    for j in 0..n {
        let column = (0..cycles).map(|c| folded[c * n + j] - means[c]);
        let mean = column.clone().sum::<f64>() / cycles as f64;
        within += column.map(|v| (v - mean).powi(2)).sum::<f64>();
    }
    let dof = NEIGHBOURS + (cycles - 2) as f64;
    let pooled = (NEIGHBOURS * neighbours(folded, n, cycles) + between) / dof;
    let variance = pooled.max(within / ((cycles - 1) * (n - 1)) as f64 / n as f64);
    let deviation = (variance / sxx).sqrt().max(floor / (sxx * n as f64).sqrt());
    let t = slope / deviation;
    // Readings of 1e300 overflow in their squares, and say nothing of a drift.
    if t.is_nan() {
        return None;
    }
    let p = 2.0 * (1.0 - StudentsT::new(0.0, 1.0, dof).ok()?.cdf(t.abs()));
    (p < SIGNIFICANCE).then_some(Drift { slope, t, p })
}

/// Variance from cycle to cycle of a coefficient of the second to fourth harmonic ([`harmonics`]) in terms of the mean of a cycle, which is its coefficient over
/// the root of `n`.
fn neighbours(folded: &[f64], n: usize, cycles: usize) -> f64 {
    let basis = harmonics(n);
    let of = |row: usize| {
        let coefficient = |c: usize| -> f64 { basis.row(row).iter().zip(&folded[c * n..(c + 1) * n]).map(|(b, v)| b * v).sum() };
        let all: Vec<f64> = (0..cycles).map(coefficient).collect();
        let mean = all.iter().sum::<f64>() / cycles as f64;
        all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / ((cycles - 1) * n) as f64
    };
    let rows = harmonic_of(n).into_iter().enumerate().filter(|(_, h)| HARMONICS.contains(h));
    let all: Vec<f64> = rows.map(|(row, _)| of(row)).collect();
    all.iter().sum::<f64>() / all.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Cycles of 50 points with white noise of 1, which go by `slope` from one to the next.
    fn cycles(seed: u64, count: usize, slope: f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = |rng: &mut ChaCha8Rng| (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
        (0..50 * count).map(|i| normal(&mut rng) + slope * (i / 50) as f64).collect()
    }

    /// A mean of 50 has a standard deviation of 0.14, the slope over three cycles one of 0.1.
    #[test]
    fn three_cycles_show_a_drift_and_noise_is_none() {
        let seen = (0..200).filter(|seed| drift(&cycles(*seed, 3, 1.0), 50, 3, 0.0).is_some()).count();
        assert!(seen >= 190, "{seen} of 200");
        let none: usize = [3, 4, 8].iter().map(|n| (0..1000).filter(|s| drift(&cycles(*s, *n, 0.0), 50, *n, 0.0).is_some()).count()).sum();
        assert!(none <= 9, "{none} of 3000");
    }
}
