//! What the tests say of a model: a likelihood in which everything that is not the model is a covariance, and in which a model's own error
//! counts as the few facts that it is.
//!
//! With `y_t` the coefficients of test t ([`crate::response::Coefficients`]) and `f_t(theta)` what the model computes there:
//!
//! ```text
//! y_t - f_t(theta) ~ N(0, V_t),  V_t = noise + model error + B B', between tests of one sensor C C'
//! noise   nu_i, by the spectrum of the scatter between cycles, by coherence, or as stated; kappa^2 its unknown scale in loops and records
//! error   tau_b^2 rho_i, tau_b = max(tau e^(g_b), tau_min) relative in block b (a channel of a test); rho_i what an error of 1 is in coefficient i
//! B       one column each: instruments within tolerance; w s_k df_t/ds_k, a strength that differs a little from test to test,
//!         w = e^(omega + a_kind): an FRF is a mean of many averages, a record one event
//! C       what of the instruments' columns one sensor reads in all of its tests alike (calibration, zero, characteristic)
//! ```
//!
//! The error of a model is few facts, however many coefficients show it. How few, and how it lies in them, goes by the kind of block:
//!
//! ```text
//! FRF     a smooth function along the lines, free in m of n directions (six a mode); there its variance is D = nu + tau^2 rho n / m, elsewhere
//!         the residual is noise. A line adds  (m/n) ln D + (1 - m/n) (ln nu + 1 - nu / D) + r^2 / D  to -2 l
//! others  the error lies anywhere, and a coefficient of which it holds the part p = tau^2 rho / d counts as z = 1 - p (1 - z0) facts, d = kappa^2 nu +
//!         tau^2 rho: the coarsened posterior of Miller and Dunson, J. Am. Stat. Assoc. 114, 2019. It adds  z (ln d + r^2 / d), and what does not
//!         count is noise as it was seen beside that error: (1 - z) (ln kappa^2 + 1 / kappa^2)
//! l_z     -1/2 [ sum of these + ln|I + B'W B| - (B'W r)'(I + B'W B)^-1 (B'W r) ] + ln prior(kappa, tau, omega, a, g),  W = diag(1 / D or z / d)
//! ```
//!
//! The variances `kappa, tau, omega, a, g` are estimated for every model anew, by the restricted likelihood (Patterson and Thompson, Biometrika
//! 58, 1971: the model's parameters integrated out to first order), each channel's own error g_b integrated out about where it stands (Laplace:
//! `-1/2 ln(1 + s^2 I_b)`, I_b its Fisher information): fitted for nothing, own errors would make a quarter of pure noise a model's error. An estimate
//! begins where all that a model leaves is its error: under small z all noise is a summit as well. Where noise rules, l_z is the ordinary likelihood. Two models
//! are compared under the z of the smaller one: `l_z(M1) - l_z(M0) - 1/2 dk ln n - ln(tried)` with `n` the facts there are.

mod common;
mod facts;
mod likelihood;
mod record;
mod settings;
mod variances;

pub use facts::Counts;
pub use record::{Record, Seen, scatters};
pub use settings::Settings;
pub use variances::Variances;

use nalgebra::DMatrix;

use crate::model::System;
use crate::response::{Covariance, Plan};

/// The tests that models are held against, and how.
#[derive(Clone, Debug)]
pub struct Evidence {
    /// One for each test, in the order of the plans.
    pub records: Vec<Record>,
    /// Constants.
    pub settings: Settings,
}

impl Evidence {
    /// Of these tests. `system`: a model from which the signals are computed that instruments may misread; measured ones serve where it
    /// cannot be computed.
    pub fn new(plans: &[&Plan], system: &System, settings: &Settings) -> Evidence {
        Evidence { records: record::records(plans, system, settings), settings: settings.clone() }
    }

    /// The same of the tests that strengths are fitted to: in one alone nothing scatters between tests. Its columns would be those of the parameters, along which the
    /// model could drift as far as scatter is granted.
    pub fn of_fitted(plans: &[&Plan], system: &System, settings: &Settings) -> Evidence {
        let mut evidence = Evidence::new(plans, system, settings);
        if let [alone] = evidence.records.as_mut_slice() {
            alone.scatters = false;
        }
        evidence
    }

    /// The covariance of each test by itself under these variances and counts. `seen`: the model whose strengths scatter.
    pub fn covariances(&self, seen: &[Seen], v: &Variances, counts: &Counts) -> Vec<Covariance> {
        (0..self.records.len()).map(|t| self.covariance(t, v, counts, &self.shared(t, seen, v))).collect()
    }

    /// The same as the covariance that each test has by itself and, beside that, the columns of what all have in common, in the coefficients of each.
    pub fn joint_covariances(&self, seen: &[Seen], v: &Variances, counts: &Counts) -> Vec<(Covariance, DMatrix<f64>)> {
        let common = common::Common::of(self);
        let of = |t: usize| {
            let own = common.own(t, self.shared(t, seen, v));
            (self.covariance(t, v, counts, &own), common.columns(t, &self.records[t]))
        };
        (0..self.records.len()).map(of).collect()
    }

    /// The columns that the coefficients of test t share.
    fn shared(&self, t: usize, seen: &[Seen], v: &Variances) -> DMatrix<f64> {
        self.records[t].shared(&seen[t], v.scatter(&self.records[t]))
    }

    /// The covariance of test t, whose coefficients share these columns.
    fn covariance(&self, t: usize, v: &Variances, counts: &Counts, shared: &DMatrix<f64>) -> Covariance {
        let record = &self.records[t];
        let parts = record.parts(v.kappa, &v.own_errors(t, record));
        let counted: Vec<f64> = parts.iter().zip(counts.z[t].iter()).map(|(p, z)| p.variance(*z)).collect();
        Covariance::new(record.coefficients.clone(), &counted, shared)
    }
}

/// Columns of a and b side by side.
fn beside(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut whole = DMatrix::zeros(a.nrows(), a.ncols() + b.ncols());
    whole.columns_mut(0, a.ncols()).copy_from(a);
    whole.columns_mut(a.ncols(), b.ncols()).copy_from(b);
    whole
}

#[cfg(test)]
mod tests;
