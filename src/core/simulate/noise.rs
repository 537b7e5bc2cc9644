//! White Gaussian noise with a seed.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Noise of one test.
pub(super) struct Noise {
    rng: ChaCha8Rng,
    fraction: f64,
}

impl Noise {
    /// `stream` tells the tests of a dataset apart.
    pub fn new(seed: u64, stream: u64, fraction: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Noise { rng, fraction }
    }

    pub fn fraction(&self) -> f64 {
        self.fraction
    }

    /// Standard deviation for a channel: the fraction of its range.
    pub fn of_range(&self, values: &[f64]) -> f64 {
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        if high > low { self.fraction * (high - low) } else { 0.0 }
    }

    /// N(0, 1), by Box and Muller.
    pub fn normal(&mut self) -> f64 {
        let (u, v): (f64, f64) = (self.rng.random(), self.rng.random());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_and_seed() {
        let draw = |seed| -> Vec<f64> {
            let mut n = Noise::new(seed, 0, 0.01);
            (0..20_000).map(|_| n.normal()).collect()
        };
        let (a, b) = (draw(1), draw(2));
        let mean = a.iter().sum::<f64>() / a.len() as f64;
        let variance = a.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / a.len() as f64;
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
        assert!(a == draw(1) && a != b);
        assert_eq!(Noise::new(1, 0, 0.01).of_range(&[2.0, -2.0]), 0.04);
    }
}
