//! A function of one variable by its values at Chebyshev points: the full model is computed there, and its largest error is stated on further runs.

/// Interpolant at Chebyshev points of the second kind, evaluated by Clenshaw's recurrence.
#[derive(Clone, Debug, PartialEq)]
pub struct Chebyshev {
    low: f64,
    high: f64,
    coefficients: Vec<f64>,
}

/// `n` points (2 or more) from `low` to `high`; those of 2 n - 1 contain them.
pub fn nodes(low: f64, high: f64, n: usize) -> Vec<f64> {
    let last = (n - 1) as f64;
    (0..n).map(|k| 0.5 * (low + high) - 0.5 * (high - low) * (std::f64::consts::PI * k as f64 / last).cos()).collect()
}

impl Chebyshev {
    /// From the values at [`nodes`].
    pub fn new(low: f64, high: f64, values: &[f64]) -> Chebyshev {
        let m = values.len() - 1;
        let half = |k: usize| if k == 0 || k == m { 0.5 } else { 1.0 };
        let angle = |j: usize, k: usize| (std::f64::consts::PI * (j * (m - k)) as f64 / m as f64).cos();
        let coefficient = |j: usize| {
            let sum: f64 = (0..=m).map(|k| half(k) * values[k] * angle(j, k)).sum();
            half(j) * 2.0 / m as f64 * sum
        };
        Chebyshev { low, high, coefficients: (0..=m).map(coefficient).collect() }
    }

    /// The domain.
    pub fn domain(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Value at `x`, kept within the domain.
    pub fn value(&self, x: f64) -> f64 {
        let x = ((2.0 * x - self.low - self.high) / (self.high - self.low)).clamp(-1.0, 1.0);
        let (mut b1, mut b2) = (0.0, 0.0);
        for c in self.coefficients.iter().skip(1).rev() {
            (b1, b2) = (c + 2.0 * x * b1 - b2, b1);
        }
        self.coefficients[0] + x * b1 - b2
    }

    /// Slope at `x`, by central differences of the polynomial.
    pub fn slope(&self, x: f64) -> f64 {
        let h = 1e-4 * (self.high - self.low);
        let (a, b) = ((x - h).max(self.low), (x + h).min(self.high));
        if b > a { (self.value(b) - self.value(a)) / (b - a) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_function_is_met_between_its_nodes() {
        let f = |x: f64| (0.7 * x).exp() / (1.0 + x * x);
        let of = |n: usize| Chebyshev::new(-1.0, 2.0, &nodes(-1.0, 2.0, n).into_iter().map(f).collect::<Vec<_>>());
        let worst = |c: &Chebyshev| (0..=300).map(|k| -1.0 + 0.01 * f64::from(k)).map(|x| (c.value(x) - f(x)).abs()).fold(0.0, f64::max);
        assert!(worst(&of(33)) < 1e-7 && worst(&of(5)) > 1e-3, "{} {}", worst(&of(33)), worst(&of(5)));
        let (c, x) = (of(33), 0.3);
        let exact = f(x) * (0.7 - 2.0 * x / (1.0 + x * x));
        assert!((c.slope(x) / exact - 1.0).abs() < 1e-4);
        assert_eq!(c.value(9.0), c.value(2.0));
    }
}
