//! Sines at the samples of a cycle.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::DMatrix;

use super::shelf::Shelf;

/// Samples of `1, cos t, sin t, cos 2t, ...` over a cycle.
pub(super) struct Basis {
    pub samples: usize,
    /// Coefficients of a series, `1 + 2 harmonics`.
    pub width: usize,
    pub value: Vec<f64>,
    /// Derivative with respect to the phase.
    pub rate: Vec<f64>,
    /// Increment from the sample before.
    pub step: Vec<f64>,
    /// The same values and rates with one column per coefficient.
    pub values: DMatrix<f64>,
    pub rates: DMatrix<f64>,
    /// Values with the weights that take samples back to coefficients.
    pub back: DMatrix<f64>,
}

impl Basis {
    /// That of these sizes.
    pub fn of(harmonics: usize, samples: usize) -> Arc<Basis> {
        static SHELF: Shelf<Basis> = Shelf::new();
        SHELF.of((harmonics, samples), || Basis::new(harmonics, samples))
    }

    fn new(harmonics: usize, samples: usize) -> Self {
        let width = 1 + 2 * harmonics;
        let (mut value, mut rate) = (vec![0.0; samples * width], vec![0.0; samples * width]);
        for n in 0..samples {
            value[n * width] = 1.0;
            for k in 1..=harmonics {
                // The product is reduced first, so that every sample is a correctly rounded sine of an exact phase.
                let (s, c) = (TAU * ((k * n) % samples) as f64 / samples as f64).sin_cos();
                let at = n * width + 2 * k - 1;
                (value[at], value[at + 1]) = (c, s);
                (rate[at], rate[at + 1]) = (-(k as f64) * s, k as f64 * c);
            }
        }
        let step = (0..samples * width).map(|i| value[i] - value[(i + (samples - 1) * width) % (samples * width)]).collect();
        let values = DMatrix::from_row_slice(samples, width, &value);
        let rates = DMatrix::from_row_slice(samples, width, &rate);
        let mut back = &values * (2.0 / samples as f64);
        back.column_mut(0).fill(1.0 / samples as f64);
        Basis { samples, width, value, rate, step, values, rates, back }
    }

    /// Rows `1, cos t, sin t, cos 2t, ...`, a column for each of equal samples of a cycle.
    pub fn waves(harmonics: usize, samples: usize) -> Arc<DMatrix<f64>> {
        static SHELF: Shelf<DMatrix<f64>> = Shelf::new();
        SHELF.of((harmonics, samples), || Basis::made_waves(harmonics, samples))
    }

    fn made_waves(harmonics: usize, samples: usize) -> DMatrix<f64> {
        let circle: Vec<(f64, f64)> = (0..samples).map(|n| (TAU * n as f64 / samples as f64).sin_cos()).collect();
        DMatrix::from_fn(1 + 2 * harmonics, samples, |c, n| {
            let (sin, cos) = circle[(c.div_ceil(2) * n) % samples];
            if c % 2 == 0 && c > 0 { sin } else { cos }
        })
    }

    /// The row of a sample.
    pub fn row<'a>(&self, of: &'a [f64], n: usize) -> &'a [f64] {
        &of[n * self.width..(n + 1) * self.width]
    }
}
