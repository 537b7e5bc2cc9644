//! The dissipated energy of the calibrated model as a function of the strengths that carry its loss: ln W = g(u), u = ln s the logarithm of one
//! factor on all of them. A law of the strengths in the quantities of a table then acts on the energies through the model.
//!
//! g is interpolated between nodes that the model computed, by the monotone cubic of Fritsch and Carlson (SIAM J. Numer. Anal. 17, 1980, 238), and
//! continued below the first node with the slope there. It rises up to the strength at which what slides begins to stick; no energy beyond that
//! one can be reached at these limits of the cycle, whatever the law.

use super::ToleranceError;

/// ln W over ln s, rising.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// ln s
    u: Vec<f64>,
    /// ln W
    w: Vec<f64>,
    /// Slopes at the nodes.
    slopes: Vec<f64>,
}

impl Link {
    /// No model: the law is one of the energies themselves, g(u) = u.
    pub fn identity() -> Link {
        Link { u: vec![-1.0, 1.0], w: vec![-1.0, 1.0], slopes: vec![1.0, 1.0] }
    }

    /// From strength factors, rising, and the energies [J] at them: the part that rises.
    pub fn new(factors: &[f64], energies: &[f64]) -> Result<Link, ToleranceError> {
        let nodes: Vec<(f64, f64)> = factors.iter().zip(energies).map(|(s, w)| (s.ln(), w.ln())).collect();
        let rising = nodes.windows(2).take_while(|n| n[1].1 > n[0].1 && n[1].0 > n[0].0).count();
        if rising < 2 || nodes.iter().any(|n| !n.0.is_finite() || !n.1.is_finite()) {
            let what = "energies that rise with the strengths that carry the loss".to_string();
            return Err(ToleranceError::TooFew { what, found: rising + 1, needed: 3 });
        }
        let (u, w): (Vec<f64>, Vec<f64>) = nodes[..=rising].iter().copied().unzip();
        let secant = |n: &[(f64, f64)]| (n[1].1 - n[0].1) / (n[1].0 - n[0].0);
        let secants: Vec<f64> = nodes[..=rising].windows(2).map(secant).collect();
        // At the last node that rises the parabola through it and its neighbours, where there is one beyond it.
        let end = nodes.get(rising + 1).map_or(secants[rising - 1], |beyond| {
            let (a, b) = (u[rising] - u[rising - 1], beyond.0 - u[rising]);
            ((b * secants[rising - 1] + a * (beyond.1 - w[rising]) / b) / (a + b)).max(0.0)
        });
        let inner = |k: usize| {
            let (a, b) = (u[k] - u[k - 1], u[k + 1] - u[k]);
            // Weighted harmonic mean of the secants on both sides (Fritsch and Butland 1984).
            3.0 * (a + b) / ((2.0 * b + a) / secants[k - 1] + (b + 2.0 * a) / secants[k])
        };
        let slopes = (0..=rising)
            .map(|k| {
                if k == 0 {
                    secants[0]
                } else if k == rising {
                    end
                } else {
                    inner(k)
                }
            })
            .collect();
        Ok(Link { u, w, slopes })
    }

    /// Greatest ln W that the model reaches; none without a model.
    pub fn greatest(&self) -> Option<f64> {
        (self.u.len() > 2).then(|| self.w[self.w.len() - 1])
    }

    /// g(u): beyond the last node the last energy.
    pub fn energy(&self, u: f64) -> f64 {
        self.at(u).0
    }

    /// g'(u).
    pub fn slope(&self, u: f64) -> f64 {
        self.at(u).1
    }

    fn at(&self, u: f64) -> (f64, f64) {
        let (first, last) = (self.u[0], self.u[self.u.len() - 1]);
        if u <= first || self.u.len() == 2 {
            return (self.w[0] + self.slopes[0] * (u - first), self.slopes[0]);
        }
        if u >= last {
            return (self.w[self.w.len() - 1], 0.0);
        }
        let k = self.u.partition_point(|v| *v <= u) - 1;
        let h = self.u[k + 1] - self.u[k];
        let t = (u - self.u[k]) / h;
        let (a, b) = (self.w[k], self.w[k + 1]);
        let (da, db) = (h * self.slopes[k], h * self.slopes[k + 1]);
        let value = a * (2.0 * t.powi(3) - 3.0 * t * t + 1.0)
            + da * (t.powi(3) - 2.0 * t * t + t)
            + b * (3.0 * t * t - 2.0 * t.powi(3))
            + db * (t.powi(3) - t * t);
        let slope = (6.0 * (a - b) * (t * t - t) + da * (3.0 * t * t - 4.0 * t + 1.0) + db * (3.0 * t * t - 2.0 * t)) / h;
        (value, slope)
    }

    /// u at which g(u) is `w`, by bisection; the last node where the model does not reach it.
    pub fn strength(&self, w: f64) -> f64 {
        if w <= self.w[0] || self.u.len() == 2 {
            return self.u[0] + (w - self.w[0]) / self.slopes[0];
        }
        let (mut low, mut high) = (self.u[0], self.u[self.u.len() - 1]);
        if w >= self.w[self.w.len() - 1] {
            return high;
        }
        while high - low > 1e-12 * (1.0 + high.abs()) {
            let middle = 0.5 * (low + high);
            if self.energy(middle) < w {
                low = middle
            } else {
                high = middle
            }
            if middle == low && middle == high {
                break;
            }
        }
        0.5 * (low + high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W = s / (1 + s^2) rises to s = 1 and falls beyond it.
    #[test]
    fn the_energy_rises_to_the_strength_at_which_it_sticks() {
        let factors: Vec<f64> = (0..12).map(|k| 0.05 * 1.5f64.powi(k)).collect();
        let w = |s: f64| s / (1.0 + s * s);
        let link = Link::new(&factors, &factors.iter().map(|s| w(*s)).collect::<Vec<f64>>()).unwrap();
        for s in [0.06f64, 0.2, 0.33, 0.7] {
            let off = link.energy(s.ln()) - w(s).ln();
            assert!(off.abs() < 3e-3, "{s}: {off}");
            assert!((link.strength(link.energy(s.ln())) - s.ln()).abs() < 1e-9);
            let slope = (link.energy(s.ln() + 1e-6) - link.energy(s.ln() - 1e-6)) / 2e-6;
            assert!((link.slope(s.ln()) - slope).abs() < 1e-5);
        }
        // Below the first node W goes with s; beyond the last that rises there is no more energy.
        assert!((link.slope(-9.0) - 1.0).abs() < 0.01);
        assert_eq!(link.energy(5.0), link.greatest().unwrap());
        assert_eq!(link.strength(0.0), link.strength(link.greatest().unwrap()));
        assert!(Link::new(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]).is_err());
        assert_eq!(Link::identity().strength(0.7), 0.7);
    }
}
