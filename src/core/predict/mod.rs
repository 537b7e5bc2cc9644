//! Predictions of a calibrated model that are more than one number of one test: the energies of tolerance cases with their intervals, and the model's own
//! error of energies, seen on the loops that were measured.

mod answer;
mod cases;
mod error;
mod link;
mod loops;
mod scatter;
mod shifts;
mod sweep;
mod value;
pub mod population;

pub use answer::{case, factors, tolerance};
pub use cases::{Answer, Calibrated, rung};
pub use error::PredictError;
pub use link::link;
pub use loops::model_error;
pub use scatter::{beyond, scattered};
pub use shifts::{Shift, over_none};
pub use sweep::Sweep;
pub use value::{Prediction, evaluate, predictions};

use nalgebra::DMatrix;

/// A value [SI] and its slopes with respect to the fit's variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Value.
    pub value: f64,
    /// One per free parameter.
    pub slopes: Vec<f64>,
}

impl Found {
    /// `f` of a and b with its partial derivatives.
    pub fn of(a: &Found, b: &Found, value: f64, da: f64, db: f64) -> Found {
        Found { value, slopes: a.slopes.iter().zip(&b.slopes).map(|(x, y)| da * x + db * y).collect() }
    }

    /// Standard deviation by the delta method, sqrt(g' C g); none where it depends on a parameter that the data leave open.
    pub fn deviation(&self, covariance: &DMatrix<f64>, p: &[f64]) -> Option<f64> {
        let n = self.slopes.len();
        let open = |k: usize| covariance[(k, k)].is_nan();
        let matters = |k: usize| (self.slopes[k] * p[k].abs().max(f64::MIN_POSITIVE)).abs() > 1e-9 * self.value.abs();
        if (0..n).any(|k| open(k) && matters(k)) {
            return None;
        }
        let known: Vec<usize> = (0..n).filter(|k| !open(*k)).collect();
        let pairs = known.iter().flat_map(|a| known.iter().map(move |b| (a, b)));
        let variance: f64 = pairs.map(|(a, b)| self.slopes[*a] * covariance[(*a, *b)] * self.slopes[*b]).sum();
        (variance.is_finite() && variance >= 0.0).then(|| variance.sqrt() + 0.0)
    }
}
