//! The calibrated model over ln of the area: ln W_D and ln W_s at Chebyshev points, with what the fit and the model's own error leave open of them.

use nalgebra::{DMatrix, SymmetricEigen};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::data::Conditions;
use crate::study::ToleranceTable;
use crate::tolerance::{Chebyshev, ModelError, surrogate::nodes};

use super::super::cases::energies;
use super::super::{Calibrated, Found, PredictError};
use super::Asked;

/// Energies over ln of the area [J].
pub(super) trait Values {
    fn lost(&self, x: f64) -> f64;
    fn stored(&self, x: f64) -> f64;
}

/// Energies that are what they are.
pub(super) struct Constant {
    pub lost: f64,
    pub stored: f64,
}

impl Values for Constant {
    fn lost(&self, _: f64) -> f64 {
        self.lost
    }
    fn stored(&self, _: f64) -> f64 {
        self.stored
    }
}

/// How a surrogate was made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fit {
    /// Points at which the model was computed.
    pub nodes: usize,
    /// Exact runs it was held against.
    pub exact: usize,
    /// Largest relative error of W_D there.
    pub lost: f64,
    /// Largest relative error of W_s there.
    pub stored: f64,
    /// Whether a parameter that matters is not identified.
    pub open: bool,
}

impl Fit {
    /// The worse of two.
    pub(super) fn worse(self, other: Fit) -> Fit {
        Fit {
            nodes: self.nodes.max(other.nodes),
            exact: self.exact + other.exact,
            lost: self.lost.max(other.lost),
            stored: self.stored.max(other.stored),
            open: self.open || other.open,
        }
    }
}

/// Both energies of one group of cases.
pub(super) struct Surrogate {
    pair: [Chebyshev; 2],
    /// At the points: ln of the energy, and its slopes in independent standard normal variables, model error last.
    at: [Vec<(f64, Vec<f64>)>; 2],
    pub open: bool,
}

impl Values for [Chebyshev; 2] {
    fn lost(&self, x: f64) -> f64 {
        self[0].value(x).exp()
    }
    fn stored(&self, x: f64) -> f64 {
        self[1].value(x).exp()
    }
}

impl Values for Surrogate {
    fn lost(&self, x: f64) -> f64 {
        self.pair.lost(x)
    }
    fn stored(&self, x: f64) -> f64 {
        self.pair.stored(x)
    }
}

/// Points tried, until the error on the exact runs is small enough.
const SIZES: [usize; 3] = [9, 17, 33];
/// Relative error that is small enough.
const SMALL: f64 = 1e-3;

impl Surrogate {
    /// Over `domain`, held against exact runs at some of `drawn`; `at` gives the conditions at ln of the area.
    pub fn new(
        table: &ToleranceTable,
        model: &Calibrated,
        error: Option<ModelError>,
        domain: (f64, f64),
        at: &dyn Fn(f64) -> Conditions,
        drawn: &[f64],
        how: Asked,
    ) -> Result<(Surrogate, Fit), PredictError> {
        // A population without deviations is one point.
        let half = (0.5 * (domain.1 - domain.0)).max(1e-6);
        let domain = (0.5 * (domain.0 + domain.1) - half, 0.5 * (domain.0 + domain.1) + half);
        let reading = table.stored.unwrap_or(crate::data::StoredEnergy::Slope);
        let run = |xs: &[f64], slopes: bool| {
            let rows = xs.iter().map(|x| (format!("at {:.4}", x.exp()), at(*x))).collect();
            let found = energies(&table.cycle.quantity, reading, rows, model.system, if slopes { model.free } else { &[] })?;
            let odd = found.iter().position(|a| !(a.dissipated.value > 0.0 && a.stored.value > 0.0));
            match odd {
                None => Ok(found),
                Some(k) => {
                    let set: Vec<String> = at(xs[k]).iter().map(|(n, c)| format!("{n} = {}", c.quantity())).collect();
                    let message = format!("the model dissipates {} J and stores {} J", found[k].dissipated.value, found[k].stored.value);
                    Err(PredictError::Case {
                        case: set.join(", "),
                        message,
                        accepted: "a model that loses energy there".into(),
                        place: table.test.clone(),
                    })
                }
            }
        };
        let mut rng = ChaCha8Rng::seed_from_u64(how.seed ^ 0x5e);
        let probes: Vec<f64> = (0..how.exact).map(|_| drawn[rng.random_range(0..drawn.len())]).collect();
        let exact = run(&probes, false)?;
        let mut fit = Fit { exact: how.exact, ..Fit::default() };
        for n in SIZES {
            let xs = nodes(domain.0, domain.1, n);
            let found = run(&xs, false)?;
            let of = |pick: &dyn Fn(usize) -> f64| Chebyshev::new(domain.0, domain.1, &(0..n).map(|k| pick(k).ln()).collect::<Vec<_>>());
            let pair = [of(&|k| found[k].dissipated.value), of(&|k| found[k].stored.value)];
            let worst = |pick: &dyn Fn(usize) -> f64| (0..probes.len()).map(pick).fold(0.0, f64::max);
            fit.lost = worst(&|k| (pair.lost(probes[k]) / exact[k].dissipated.value - 1.0).abs());
            fit.stored = worst(&|k| (pair.stored(probes[k]) / exact[k].stored.value - 1.0).abs());
            fit.nodes = n;
            if fit.lost.max(fit.stored) < SMALL {
                break;
            }
        }
        let xs = nodes(domain.0, domain.1, fit.nodes);
        let found = run(&xs, true)?;
        let factor = factor(model);
        fit.open = found.iter().any(|a| a.dissipated.deviation(model.covariance, model.p).is_none());
        let slopes = |f: &Found, own: f64| -> (f64, Vec<f64>) {
            let along = |row: &Vec<f64>| row.iter().zip(&f.slopes).map(|(r, s)| r * s).sum::<f64>() / f.value;
            (f.value.ln(), factor.iter().map(along).chain([own]).collect())
        };
        // The model's own error of W_D is one of the loss ratio.
        let lost = found.iter().map(|a| slopes(&a.dissipated, error.map_or(0.0, |e| e.loss_ratio * a.stored.value / a.dissipated.value)));
        let stored = found.iter().map(|a| slopes(&a.stored, error.map_or(0.0, |e| e.stored)));
        let at: [Vec<(f64, Vec<f64>)>; 2] = [lost.collect(), stored.collect()];
        let plain = |v: &[(f64, Vec<f64>)]| Chebyshev::new(domain.0, domain.1, &v.iter().map(|v| v.0).collect::<Vec<_>>());
        let surrogate = Surrogate { pair: [plain(&at[0]), plain(&at[1])], at, open: fit.open };
        Ok((surrogate, fit))
    }

    /// Slope of ln of an energy times the energy, for the synthesis.
    pub fn slopes(&self, x: f64) -> (f64, f64) {
        (self.pair[0].slope(x), self.pair[1].slope(x))
    }

    /// Surrogates with parameters and model error drawn.
    pub fn replicates(&self, n: usize, seed: u64) -> Vec<[Chebyshev; 2]> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x9a);
        let normal = Normal::standard();
        let variables = self.at[0].first().map_or(0, |v| v.1.len());
        let mut draw = || normal.inverse_cdf(rng.random_range(1e-12..1.0));
        let (low, high) = self.pair[0].domain();
        let one = |_| {
            let z: Vec<f64> = (0..variables).map(|_| draw()).collect();
            // The model's errors of W_D and of W_s are errors of their own.
            let own = draw();
            [0, 1].map(|q| {
                let value = |(v, slopes): &(f64, Vec<f64>)| {
                    let last = slopes.len() - 1;
                    let shared: f64 = slopes[..last].iter().zip(&z).map(|(s, z)| s * z).sum();
                    v + shared + slopes[last] * if q == 0 { z[last] } else { own }
                };
                Chebyshev::new(low, high, &self.at[q].iter().map(value).collect::<Vec<_>>())
            })
        };
        (0..n).map(one).collect()
    }
}

/// Rows r with covariance = sum r r', over the parameters that are identified.
fn factor(model: &Calibrated) -> Vec<Vec<f64>> {
    let n = model.covariance.nrows();
    let known: Vec<usize> = (0..n).filter(|k| !model.covariance[(*k, *k)].is_nan()).collect();
    if known.is_empty() {
        return vec![];
    }
    let inner = DMatrix::from_fn(known.len(), known.len(), |a, b| model.covariance[(known[a], known[b])]);
    let eigen = SymmetricEigen::new(inner);
    let scale = model.variance.max(1.0).sqrt();
    let row = |k: usize| {
        let mut row = vec![0.0; n];
        known.iter().enumerate().for_each(|(a, p)| row[*p] = scale * eigen.eigenvalues[k].max(0.0).sqrt() * eigen.eigenvectors[(a, k)]);
        row
    };
    (0..known.len()).map(row).collect()
}
