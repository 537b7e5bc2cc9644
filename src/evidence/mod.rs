//! What the tests say of a model: a likelihood in which everything that is not the model is a covariance, and in which a model's own error
//! counts as the few facts that it is.
//!
//! With `y_t` the coefficients of test t ([`crate::response::Coefficients`]) and `f_t(theta)` what the model computes there:
//!
//! ```text
//! y_t - f_t ~ N(0, V_t),  V_t = diag(d) + B B',  d_i = kappa^2 nu_i + tau_b^2 rho_i,  tau_b = max(tau e^(g_b), tau_min)
//! nu      noise: spectrum of the scatter between cycles, coherence, or as stated; kappa its unknown scale
//! tau_b   relative error of the model itself in block b (a channel of a test); rho_i what an error of 1 is in coefficient i
//! B       one column each: instruments within tolerance; omega s_k df_t/ds_k, a strength that differs a little from test to test
//! z_i     1 - p_i (1 - z0), p_i = tau_b^2 rho_i / d_i: a coefficient that the model's error dominates counts as z0 facts (the coarsened
//!         posterior of Miller and Dunson, J. Am. Stat. Assoc. 114, 2019), so that the error of a channel over all tests counts as few
//! l_z     -1/2 [ sum z ln d + ln|I + B'(Z/D)B| + r'(D/Z + BB')^-1 r ] + ln prior(kappa, tau, omega, g)
//! ```
//!
//! The variances `kappa, tau, omega, g` are estimated for every model anew, by the restricted likelihood (Patterson and Thompson, Biometrika
//! 58, 1971: the model's parameters integrated out to first order). Where noise rules, z = 1 and l_z is the ordinary likelihood. Two models
//! are compared under the z of the smaller one: `l_z(M1) - l_z(M0) - 1/2 dk ln n - ln(tried)` with `n` the facts there are.

mod facts;
mod likelihood;
mod record;
mod settings;
mod variances;

pub use facts::Counts;
pub use record::{Record, Seen};
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

    /// The covariance of each test under these variances and counts. `seen`: the model whose strengths scatter.
    pub fn covariances(&self, seen: &[Seen], v: &Variances, counts: &Counts) -> Vec<Covariance> {
        let of = |t: usize| {
            let (record, z) = (&self.records[t], &counts.z[t]);
            let d = record.variance(v.kappa, &v.own_errors(t, &self.settings));
            let counted: Vec<f64> = d.iter().zip(z.iter()).map(|(d, z)| if *z > 0.0 { d / z } else { f64::INFINITY }).collect();
            Covariance::new(record.coefficients.clone(), &counted, &record.shared(&seen[t], v.omega))
        };
        (0..self.records.len()).map(of).collect()
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
