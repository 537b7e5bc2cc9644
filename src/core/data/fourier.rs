//! The controlled motion as a truncated Fourier series, so that a model is driven without noise.

use std::f64::consts::TAU;

/// x(phi) = mean + sum_k (cos_k cos k phi + sin_k sin k phi), phi = omega t, k = 1, 2, ...
#[derive(Debug, Clone, PartialEq)]
pub struct FourierInput {
    pub mean: f64,
    /// cos[k - 1] belongs to harmonic k.
    pub cos: Vec<f64>,
    pub sin: Vec<f64>,
    /// rad/s
    pub omega: f64,
}

impl FourierInput {
    /// Fits n equidistant phases; keeps the fundamental and the harmonics whose amplitude exceeds 4 standard deviations of a coefficient,
    /// `sigma(k) sqrt(2 / n)`, sigma(k) that of a point by what the noise has at harmonic k: of noise that is correlated along the cycle the low harmonics hold several
    /// times as much as if it were white, and a mass multiplies them by k^2.
    pub fn fit(phase: &[f64], values: &[f64], sigma: impl Fn(usize) -> f64, omega: f64) -> Self {
        let n = values.len().min(phase.len());
        let mean = values.iter().take(n).sum::<f64>() / n.max(1) as f64;
        let (mut cos, mut sin) = (Vec::new(), Vec::new());
        for k in 1..=n.saturating_sub(1) / 2 {
            let (mut a, mut b) = (0.0, 0.0);
            for (p, v) in phase.iter().zip(values) {
                let (s, c) = (k as f64 * p).sin_cos();
                a += v * c;
                b += v * s;
            }
            let (a, b) = (2.0 * a / n as f64, 2.0 * b / n as f64);
            let keep = k == 1 || a.hypot(b) > 4.0 * sigma(k) * (2.0 / n.max(1) as f64).sqrt();
            cos.push(if keep { a } else { 0.0 });
            sin.push(if keep { b } else { 0.0 });
        }
        let last = cos.iter().zip(&sin).rposition(|(a, b)| *a != 0.0 || *b != 0.0).map_or(1, |i| i + 1);
        cos.truncate(last);
        sin.truncate(last);
        Self { mean, cos, sin, omega }
    }

    /// Highest harmonic.
    pub fn harmonics(&self) -> usize {
        self.cos.len()
    }

    /// Value, velocity and acceleration at phase phi.
    pub fn at_phase(&self, phi: f64) -> (f64, f64, f64) {
        // cos(k phi), sin(k phi) by the angle sum, no trigonometry in the loop.
        let (s1, c1) = phi.rem_euclid(TAU).sin_cos();
        let (mut s, mut c) = (s1, c1);
        let (mut x, mut v, mut a) = (self.mean, 0.0, 0.0);
        for (k, (ck, sk)) in self.cos.iter().zip(&self.sin).enumerate() {
            let w = (k + 1) as f64 * self.omega;
            let wave = ck * c + sk * s;
            x += wave;
            v += w * (sk * c - ck * s);
            a -= w * w * wave;
            (s, c) = (s * c1 + c * s1, c * c1 - s * s1);
        }
        (x, v, a)
    }

    /// Value at time t (phase zero at t = 0).
    pub fn value(&self, t: f64) -> f64 {
        self.at_phase(self.omega * t).0
    }

    /// First derivative at time t.
    pub fn velocity(&self, t: f64) -> f64 {
        self.at_phase(self.omega * t).1
    }

    /// Second derivative at time t.
    pub fn acceleration(&self, t: f64) -> f64 {
        self.at_phase(self.omega * t).2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A harmonic is kept where it stands out of what the noise has there: of coloured noise the second and third harmonic hold as much as a motion might.
    #[test]
    fn what_is_kept_stands_out_of_the_noise_at_its_own_harmonic() {
        let n = 200;
        let phase: Vec<f64> = (0..n).map(|k| TAU * f64::from(k) / 200.0).collect();
        let x: Vec<f64> = phase.iter().map(|p| p.sin() + 0.004 * (2.0 * p).cos() + 0.004 * (9.0 * p).sin()).collect();
        let white = FourierInput::fit(&phase, &x, |_| 0.004, 1.0);
        assert!(white.cos[1] != 0.0 && white.harmonics() == 9);
        let coloured = FourierInput::fit(&phase, &x, |k| if k < 5 { 0.02 } else { 0.004 }, 1.0);
        assert!(coloured.cos[1] == 0.0 && coloured.harmonics() == 9 && (coloured.sin[0] - 1.0).abs() < 1e-12);
    }
}
