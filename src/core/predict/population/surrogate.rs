//! The calibrated model over ln of the area: ln W_D, ln W_s and ln of the natural frequencies at Chebyshev points, with what the fit and the model's own error
//! leave open of them.

use nalgebra::{DMatrix, SymmetricEigen};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::data::Conditions;
use crate::model::{FreeParam, System};
use crate::parallel;
use crate::study::ToleranceTable;
use crate::tolerance::{Chebyshev, ModelError, surrogate::nodes};

use super::super::cases::{Answer, energies};
use super::super::value::frequencies;
use super::super::{Calibrated, Found, PredictError};
use super::Asked;

/// Place of W_D among the values; W_s and the natural frequencies follow.
pub(super) const LOST: usize = 0;
/// Place of W_s.
pub(super) const STORED: usize = 1;
/// Place of the first natural frequency.
pub(super) const MODES: usize = 2;

/// W_D, W_s [J] and natural frequencies [Hz] over ln of the area.
pub(super) trait Values {
    fn at(&self, which: usize, x: f64) -> f64;
}

/// Values that are what they are.
pub(super) struct Constant(pub Vec<f64>);

impl Values for Constant {
    fn at(&self, which: usize, _: f64) -> f64 {
        self.0[which]
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
    /// Largest relative error of a natural frequency there; 0 where none is asked for.
    pub frequency: f64,
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
            frequency: self.frequency.max(other.frequency),
            open: self.open || other.open,
        }
    }
}

/// All values of one group of cases.
pub(super) struct Surrogate {
    all: Vec<Chebyshev>,
    /// At the points: ln of the value, and its slopes in independent standard normal variables, model error last.
    at: Vec<Vec<(f64, Vec<f64>)>>,
    pub open: bool,
}

impl Values for Vec<Chebyshev> {
    fn at(&self, which: usize, x: f64) -> f64 {
        self[which].value(x).exp()
    }
}

impl Values for Surrogate {
    fn at(&self, which: usize, x: f64) -> f64 {
        self.all.at(which, x)
    }
}

/// W_D, W_s and natural frequencies by the model itself at conditions, one row each.
pub(super) fn exact(
    table: &ToleranceTable,
    modes: &[u32],
    system: &System,
    free: &[FreeParam],
    rows: Vec<(String, Conditions)>,
) -> Result<Vec<Vec<Found>>, PredictError> {
    let reading = table.stored.unwrap_or(crate::data::StoredEnergy::Slope);
    let tones = parallel::map(&rows, |(_, c)| frequencies(modes, c.clone(), system, free));
    let found = energies(&table.cycle.quantity, reading, rows, system, free)?;
    let one = |(a, tones): (Answer, Result<Vec<Found>, PredictError>)| Ok([vec![a.dissipated, a.stored], tones?].concat());
    found.into_iter().zip(tones).map(one).collect()
}

/// Points tried, until the error on the exact runs is small enough.
const SIZES: [usize; 3] = [9, 17, 33];
/// Relative error that is small enough.
const SMALL: f64 = 1e-3;

impl Surrogate {
    /// Over `domain`, held against exact runs at some of `drawn`; `at` gives the conditions at ln of the area.
    pub fn new(
        table: &ToleranceTable,
        modes: &[u32],
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
        let run = |xs: &[f64], slopes: bool| {
            let rows = xs.iter().map(|x| (format!("at {:.4}", x.exp()), at(*x))).collect();
            let found = exact(table, modes, model.system, if slopes { model.free } else { &[] }, rows)?;
            let odd = found.iter().position(|a| !(a[LOST].value > 0.0 && a[STORED].value > 0.0));
            match odd {
                None => Ok(found),
                Some(k) => {
                    let set: Vec<String> = at(xs[k]).iter().map(|(n, c)| format!("{n} = {}", c.quantity())).collect();
                    let message = format!("the model dissipates {} J and stores {} J", found[k][LOST].value, found[k][STORED].value);
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
        let held = run(&probes, false)?;
        let mut fit = Fit { exact: how.exact, ..Fit::default() };
        for n in SIZES {
            let xs = nodes(domain.0, domain.1, n);
            let found = run(&xs, false)?;
            let of = |q: usize| Chebyshev::new(domain.0, domain.1, &found.iter().map(|f| f[q].value.ln()).collect::<Vec<_>>());
            let all: Vec<Chebyshev> = (0..MODES + modes.len()).map(of).collect();
            let off = |q: usize| (0..probes.len()).map(|k| (all.at(q, probes[k]) / held[k][q].value - 1.0).abs()).fold(0.0, f64::max);
            (fit.lost, fit.stored, fit.nodes) = (off(LOST), off(STORED), n);
            fit.frequency = (MODES..all.len()).map(off).fold(0.0, f64::max);
            if fit.lost.max(fit.stored).max(fit.frequency) < SMALL {
                break;
            }
        }
        let xs = nodes(domain.0, domain.1, fit.nodes);
        let found = run(&xs, true)?;
        let factor = factor(model);
        fit.open = found.iter().any(|a| a[LOST].deviation(model.covariance, model.p).is_none());
        let slopes = |f: &Found, own: f64| -> (f64, Vec<f64>) {
            let along = |row: &Vec<f64>| row.iter().zip(&f.slopes).map(|(r, s)| r * s).sum::<f64>() / f.value;
            (f.value.ln(), factor.iter().map(along).chain([own]).collect())
        };
        // The model's own error of W_D is one of the loss ratio.
        let own = |q: usize, a: &[Found]| match (q, error) {
            (LOST, Some(e)) => e.loss_ratio * a[STORED].value / a[LOST].value,
            (STORED, Some(e)) => e.stored,
            // The loops say nothing of the model's own error of a frequency.
            _ => 0.0,
        };
        let of = |q: usize| found.iter().map(|a| slopes(&a[q], own(q, a))).collect();
        let at: Vec<Vec<(f64, Vec<f64>)>> = (0..MODES + modes.len()).map(of).collect();
        let plain = |v: &Vec<(f64, Vec<f64>)>| Chebyshev::new(domain.0, domain.1, &v.iter().map(|v| v.0).collect::<Vec<_>>());
        Ok((Surrogate { all: at.iter().map(plain).collect(), at, open: fit.open }, fit))
    }

    /// Slope of ln of a value, for the synthesis.
    pub fn slope(&self, which: usize, x: f64) -> f64 {
        self.all[which].slope(x)
    }

    /// Surrogates with parameters and model error drawn.
    pub fn replicates(&self, n: usize, seed: u64) -> Vec<Vec<Chebyshev>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x9a);
        let normal = Normal::standard();
        let variables = self.at[0].first().map_or(0, |v| v.1.len());
        let mut draw = || normal.inverse_cdf(rng.random_range(1e-12..1.0));
        let (low, high) = self.all[LOST].domain();
        let one = |_| {
            let z: Vec<f64> = (0..variables).map(|_| draw()).collect();
            // The model's errors of W_D and of W_s are errors of their own.
            let own = draw();
            let replicate = |q: usize| {
                let value = |(v, slopes): &(f64, Vec<f64>)| {
                    let last = slopes.len() - 1;
                    let shared: f64 = slopes[..last].iter().zip(&z).map(|(s, z)| s * z).sum();
                    v + shared + slopes[last] * if q == LOST { z[last] } else { own }
                };
                Chebyshev::new(low, high, &self.at[q].iter().map(value).collect::<Vec<_>>())
            };
            (0..self.at.len()).map(replicate).collect()
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
