//! The variances of a model in its tests, and their estimate.

use nalgebra::{DMatrix, DVector};

use super::likelihood::{restricted, taken};
use super::{Counts, Evidence, Seen, Settings};

/// Steps of the pattern search at first, in the logarithms of noise, model error and scatter. The last gives the noise what it takes from the model error:
/// where both are white the likelihood has a ridge along it, and steps along the axes alone stop beside its crest.
const STEPS: [[f64; 3]; 4] = [[0.3, 0.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.8], [0.3, -0.6, 0.0]];
/// Part of these steps at which it ends.
const LAST: f64 = 0.08;
/// Grid of the logarithm of a channel's own model error over the common one.
const OWN_REACH: f64 = 2.0;
const OWN_POINTS: usize = 41;
/// Logarithm of a scatter that is none, a fifth of a percent, and of that from which an estimate begins at least: below it the likelihood is flat.
const NO_SCATTER: f64 = -6.2;
const SEARCHED_FROM: f64 = -5.3;
/// Logarithm of the largest relative error of a model.
const MODEL_ERROR_MOST: f64 = 2.3;

/// Variances, as logarithms of standard deviations.
#[derive(Clone, Debug)]
pub struct Variances {
    /// True noise over that seen.
    pub kappa: f64,
    /// Relative error of the model.
    pub tau: f64,
    /// Relative scatter of strengths between tests.
    pub omega: f64,
    /// Error of the model in each channel of each test over the common one.
    pub own: Vec<Vec<f64>>,
    /// Relative error of the single lines of an FRF beside that of its modes; none of channels without modes, whose points all have the error of the
    /// channel.
    pub lines: Vec<Vec<Option<f64>>>,
}

/// Relative errors of the model in the channels of a test.
#[derive(Clone, Debug)]
pub struct Errors {
    /// Of what all points share: the modes of an FRF.
    pub whole: Vec<f64>,
    /// Of every point by itself.
    pub points: Vec<f64>,
}

impl Errors {
    /// A model without error in so many channels.
    pub fn none(channels: usize) -> Errors {
        Errors { whole: vec![0.0; channels], points: vec![0.0; channels] }
    }
}

impl Variances {
    /// Where an estimate begins that knows nothing.
    pub fn start(evidence: &Evidence) -> Variances {
        let own = evidence.records.iter().map(|r| vec![0.0; r.channels.len()]).collect();
        let tau = 0.1f64.ln();
        Variances { kappa: 0.0, tau, omega: (0.25 * evidence.settings.scatter_most).ln(), own, lines: evidence.lines(tau) }
    }

    /// Relative error of the model in each channel of a test.
    pub fn own_errors(&self, test: usize, settings: &Settings) -> Vec<f64> {
        self.own[test].iter().map(|g| (self.tau + g).exp().max(settings.model_error_least)).collect()
    }

    /// The same, apart for what points share and for every point by itself.
    pub fn errors(&self, test: usize, settings: &Settings) -> Errors {
        let whole = self.own_errors(test, settings);
        let of = |(line, own): (&Option<f64>, &f64)| line.map_or(*own, |l| l.exp().max(settings.model_error_least));
        Errors { points: self.lines[test].iter().zip(&whole).map(of).collect(), whole }
    }

    /// Root mean square of the model's relative error over channels and tests.
    pub fn model_error(&self, settings: &Settings) -> f64 {
        let all: Vec<f64> = (0..self.own.len()).flat_map(|t| self.own_errors(t, settings)).collect();
        (all.iter().map(|e| e * e).sum::<f64>() / all.len().max(1) as f64).sqrt()
    }

    /// Logarithm of the prior density.
    pub fn prior(&self, s: &Settings) -> f64 {
        let own: f64 = self.own.iter().flatten().map(|g| g * g).sum();
        -0.5 * (self.kappa / s.noise_spread).powi(2)
            - 0.5 * (self.omega.exp() / s.scatter_prior).powi(2)
            - 0.5 * own / (s.model_error_spread * s.model_error_spread)
    }

    /// The same model errors with what all channels have in common in `tau`: only the sum of both is in the likelihood, and the prior is highest where the
    /// own errors have the mean 0. Without it an estimate that began at a large common error kept it, and every channel paid for its own way down.
    fn centred(mut self, s: &Settings) -> Variances {
        let all = self.own.iter().flatten();
        let n = all.clone().count();
        if n > 0 {
            let mean = all.sum::<f64>() / n as f64;
            let by = (self.tau + mean).clamp(s.model_error_least.ln(), MODEL_ERROR_MOST) - self.tau;
            self.tau += by;
            self.own.iter_mut().flatten().for_each(|g| *g -= by);
        }
        self
    }

    fn bounded(mut self, s: &Settings) -> Variances {
        let most = s.noise_most.ln();
        self.kappa = self.kappa.clamp(-most, most);
        self.tau = self.tau.clamp(s.model_error_least.ln(), MODEL_ERROR_MOST);
        let most = s.scatter_most.ln();
        self.omega = self.omega.clamp(NO_SCATTER.min(most), most);
        self
    }

    fn moved(&self, step: &[f64; 3], part: f64) -> Variances {
        Variances { kappa: self.kappa + part * step[0], tau: self.tau + part * step[1], omega: self.omega + part * step[2], ..self.clone() }
    }
}

impl Evidence {
    /// Variances by restricted likelihood: the channels' own model errors one by one, the common ones by a pattern search (Hooke and Jeeves,
    /// J. ACM 8, 1961).
    pub fn estimate(&self, seen: &[Seen], counts: &Counts, start: &Variances) -> Variances {
        let start = Variances { omega: start.omega.max(SEARCHED_FROM), ..start.clone() };
        let mut best = self.own_errors(seen, counts, start.bounded(&self.settings));
        let columns = self.columns(seen);
        let value = |v: &Variances| restricted(self, &columns, seen, counts, v).map_or(f64::NEG_INFINITY, |l| l + v.prior(&self.settings));
        let mut here = value(&best);
        let (mut left, mut part) = (self.settings.evaluations, 1.0);
        while part > LAST && left > 0 {
            let mut better = false;
            for step in &STEPS {
                for sign in [1.0, -1.0] {
                    let trial = best.moved(step, sign * part).bounded(&self.settings);
                    let there = value(&trial);
                    left = left.saturating_sub(1);
                    if there > here {
                        (best, here, better) = (trial, there, true);
                        break;
                    }
                }
            }
            if !better {
                part *= 0.5;
            }
        }
        best
    }

    /// The same where strengths do not scatter: what their scatter takes up, such as the frequency at which a late channel is late, may be what
    /// is missing.
    pub fn estimate_without_scatter(&self, seen: &[Seen], counts: &Counts, start: &Variances) -> Variances {
        let mut still = self.clone();
        still.settings.scatter_most = NO_SCATTER.exp();
        still.estimate(seen, counts, start)
    }

    /// For every channel with modes the logarithm of an error of its lines.
    pub fn lines(&self, error: f64) -> Vec<Vec<Option<f64>>> {
        self.records.iter().map(|r| r.channels.iter().map(|c| (c.modal.ncols() > 0).then_some(error)).collect()).collect()
    }

    /// The own model error of each channel that makes what is left of its residual, without what coefficients share, likeliest; of an FRF that of
    /// its modes, and then that of its lines.
    fn own_errors(&self, seen: &[Seen], counts: &Counts, mut v: Variances) -> Variances {
        let s = &self.settings;
        let own_grid = || (0..OWN_POINTS).map(|k| OWN_REACH * (2.0 * k as f64 / (OWN_POINTS - 1) as f64 - 1.0));
        let (least, most) = (s.model_error_least.ln(), MODEL_ERROR_MOST);
        let line_grid = || (0..OWN_POINTS).map(|k| least + (most - least) * k as f64 / (OWN_POINTS - 1) as f64);
        for (t, record) in self.records.iter().enumerate() {
            let z = &counts.z[t];
            let errors = v.errors(t, s);
            let (d, b) = (record.variance(v.kappa, &errors), record.shared(&seen[t], v.omega, &errors));
            let share = taken(&seen[t].r, &b, &d, z);
            let left = &seen[t].r - &b * &share;
            for (k, channel) in record.channels.iter().enumerate() {
                let range = channel.range.clone();
                // Of the points by themselves.
                let of_points = |left: &DVector<f64>, tau: f64| {
                    let of = |i: usize| {
                        let d = (2.0 * v.kappa).exp() * record.noise[i] + tau * tau * record.size[i];
                        if d.is_finite() { 0.5 * z[i] * (d.ln() + left[i] * left[i] / d) } else { 0.0 }
                    };
                    range.clone().map(of).sum::<f64>()
                };
                let prior = |g: f64| 0.5 * (g / s.model_error_spread).powi(2);
                let tau = |g: f64| (v.tau + g).exp().max(s.model_error_least);
                if v.lines[t][k].is_none() {
                    v.own[t][k] = least_of(own_grid(), |g| of_points(&left, tau(g)) + prior(g));
                    continue;
                }
                let (from, modes) = (record.modal_from(&seen[t], k), channel.modal.ncols());
                let of_modes = b.columns(from, modes) * share.rows(from, modes);
                let mut rest = (&left + &of_modes).rows(range.start, range.len()).into_owned();
                let spectrum = Spectrum::new(&channel.modal, &rest, &d[range.clone()], &z.as_slice()[range.clone()]);
                v.own[t][k] = least_of(own_grid(), |g| spectrum.cost(tau(g)) + prior(g));
                rest -= spectrum.taken(&channel.modal, tau(v.own[t][k]));
                let mut lines = left.clone();
                lines.rows_mut(range.start, range.len()).copy_from(&rest);
                v.lines[t][k] = Some(least_of(line_grid(), |l| of_points(&lines, l.exp())));
            }
        }
        v.centred(s)
    }
}

/// Where on a grid the cost is least.
fn least_of(grid: impl Iterator<Item = f64>, cost: impl Fn(f64) -> f64) -> f64 {
    let costs = grid.map(|g| (g, cost(g)));
    costs.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |c| c.0)
}

/// The residual of a channel along the columns that its coefficients share, for any size tau of these: with `W = z/d` and `M'WM = U L U'`,
/// `ln|I + tau^2 L|` and `r'Wr - sum tau^2 q^2 / (1 + tau^2 l)`, `q = U'M'Wr`.
struct Spectrum {
    vectors: DMatrix<f64>,
    values: DVector<f64>,
    along: DVector<f64>,
}

impl Spectrum {
    fn new(columns: &DMatrix<f64>, r: &DVector<f64>, d: &[f64], z: &[f64]) -> Spectrum {
        let w = DVector::from_iterator(d.len(), d.iter().zip(z).map(|(d, z)| if d.is_finite() { z / d } else { 0.0 }));
        let mut weighed = columns.clone();
        weighed.column_iter_mut().for_each(|mut c| c.component_mul_assign(&w));
        let eigen = (weighed.transpose() * columns).symmetric_eigen();
        let along = eigen.eigenvectors.transpose() * (weighed.transpose() * r);
        Spectrum { vectors: eigen.eigenvectors, values: eigen.eigenvalues.map(|l| l.max(0.0)), along }
    }

    /// Half of what ln|V| and the squares have of tau.
    fn cost(&self, tau: f64) -> f64 {
        let square = tau * tau;
        let of = |(l, q): (&f64, &f64)| 0.5 * ((1.0 + square * l).ln() - square * q * q / (1.0 + square * l));
        self.values.iter().zip(&self.along).map(of).sum()
    }

    /// What columns of size tau take of the residual.
    fn taken(&self, columns: &DMatrix<f64>, tau: f64) -> DVector<f64> {
        let square = tau * tau;
        let part =
            DVector::from_iterator(self.values.len(), self.values.iter().zip(&self.along).map(|(l, q)| square * q / (1.0 + square * l)));
        columns * (&self.vectors * part)
    }
}
