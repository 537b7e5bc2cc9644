//! The variances of a model in its tests, and their estimate.

use crate::data::TestKind;

use super::common::Common;
use super::likelihood::{Squares, restricted};
use super::record::{Alike, Channel, LogSum};
use super::{Counts, Evidence, Record, Seen, Settings};

/// Kinds of test.
const KINDS: usize = TestKind::WORDS.len();

/// Variances, as logarithms of standard deviations.
#[derive(Clone, Debug, PartialEq)]
pub struct Variances {
    /// True noise over that seen.
    pub kappa: f64,
    /// Relative error of the model.
    pub tau: f64,
    /// Relative scatter of strengths between tests, what all kinds of test have in common.
    pub omega: f64,
    /// That of tests of a kind over the common one, in the order of [`TestKind::WORDS`].
    pub apart: [f64; KINDS],
    /// Error of the model in each channel of each test over the common one.
    pub own: Vec<Vec<f64>>,
}

impl Variances {
    /// Where an estimate begins that knows nothing: what models leave in these tests is all their error.
    pub fn start(evidence: &Evidence, seen: &[Seen]) -> Variances {
        let s = &evidence.settings;
        let own = evidence.records.iter().map(|r| vec![0.0; r.channels.len()]).collect();
        let (mut left, mut size) = (0.0, 0.0);
        for (record, seen) in evidence.records.iter().zip(seen) {
            let compared = (0..record.noise.len()).filter(|i| record.noise[*i].is_finite());
            compared.for_each(|i| (left, size) = (left + seen.r[i] * seen.r[i], size + record.size[i]));
        }
        let tau = if left > 0.0 && size > 0.0 { 0.5 * (left / size).ln() } else { s.least().ln() };
        Variances { kappa: 0.0, tau, omega: s.curved_over.ln(), apart: [0.0; KINDS], own }.bounded(s)
    }

    /// Logarithm of the relative scatter of strengths in a test, `omega + a_kind`.
    pub fn scatter(&self, record: &Record) -> f64 {
        self.omega + self.apart[record.kind as usize]
    }

    /// Relative error of the model in each channel of a test.
    pub fn own_errors(&self, test: usize, record: &Record) -> Vec<f64> {
        self.own[test].iter().zip(&record.channels).map(|(g, c)| (self.tau + g).exp().max(c.least)).collect()
    }

    /// Root mean square of the model's relative error over channels and tests, beyond what a study allows it there.
    pub fn model_error(&self, evidence: &Evidence) -> f64 {
        let of = |(t, record): (usize, &Record)| -> Vec<f64> {
            let errors = self.own_errors(t, record).into_iter().zip(&record.channels);
            errors.map(|(e, c)| (e * e - c.allowed * c.allowed).max(0.0)).collect()
        };
        let squares: Vec<f64> = evidence.records.iter().enumerate().flat_map(of).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }

    /// The same in other tests: a channel errs there as channels of its name and kind do where the model was fitted, or, where there is none, as all do.
    /// A model that is right to 1 % on loops need not be so on FRFs.
    pub fn carried(&self, from: &Evidence, to: &Evidence) -> Variances {
        let known: Vec<(&Channel, f64)> =
            from.records.iter().zip(&self.own).flat_map(|(r, own)| r.channels.iter().zip(own.iter().copied())).collect();
        let mean = |alike: &dyn Fn(&Channel) -> bool| {
            let of: Vec<f64> = known.iter().filter(|(c, _)| alike(c)).map(|(_, g)| *g).collect();
            (!of.is_empty()).then(|| of.iter().sum::<f64>() / of.len() as f64)
        };
        let of = |c: &Channel| mean(&|o| o.kind == c.kind && o.label == c.label).or_else(|| mean(&|_| true)).unwrap_or(0.0);
        Variances { own: to.records.iter().map(|r| r.channels.iter().map(of).collect()).collect(), ..self.clone() }
    }

    /// Logarithm of the prior density, each channel's own error where it stands.
    fn prior(&self, s: &Settings) -> f64 {
        let own: f64 = self.own.iter().flatten().map(|g| g * g).sum();
        let apart: f64 = self.apart.iter().map(|a| a * a).sum();
        -0.5 * (self.kappa / s.noise_spread).powi(2)
            - 0.5 * apart / (s.scatter_spread * s.scatter_spread)
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
            let by = (self.tau + mean).clamp(s.least().ln(), s.model_error_most) - self.tau;
            self.tau += by;
            self.own.iter_mut().flatten().for_each(|g| *g -= by);
        }
        self
    }

    fn bounded(mut self, s: &Settings) -> Variances {
        let most = s.noise_most.ln();
        self.kappa = self.kappa.clamp(-most, most);
        self.tau = self.tau.clamp(s.least().ln(), s.model_error_most);
        let most = s.scatter_most.ln();
        let least = s.no_scatter.min(most);
        self.omega = self.omega.clamp(least, most);
        self.apart.iter_mut().for_each(|a| *a = a.clamp(least - self.omega, most - self.omega));
        self
    }

    fn moved(&self, step: &Step, part: f64) -> Variances {
        let mut moved = self.clone();
        moved.kappa += part * step.common[0];
        moved.tau += part * step.common[1];
        moved.omega += part * step.common[2];
        if let Some(kind) = step.kind {
            moved.apart[kind] += part * step.apart;
        }
        moved
    }
}

/// A direction of the pattern search.
struct Step {
    /// Along kappa, tau, omega.
    common: [f64; 3],
    /// Along the scatter of one kind of test.
    kind: Option<usize>,
    apart: f64,
}

impl Evidence {
    /// Where the pattern search may go. Each kind of test scatters by itself where there are several.
    fn directions(&self) -> Vec<Step> {
        let s = &self.settings;
        let mut kinds: Vec<usize> = self.records.iter().filter(|r| r.scatters).map(|r| r.kind as usize).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let common = s.steps.iter().map(|common| Step { common: *common, kind: None, apart: 0.0 });
        let apart = kinds.iter().map(|kind| Step { common: [0.0; 3], kind: Some(*kind), apart: s.scatter_step });
        common.chain(apart.filter(|_| kinds.len() > 1)).collect()
    }

    /// Logarithm of the prior density of these variances, the channels' own model errors integrated out about where they stand (Laplace): beside
    /// noise an own error of every channel fits the scatter of that noise's power, and an estimate that fitted them for nothing made a quarter of pure
    /// noise a model's error.
    pub fn prior(&self, counts: &Counts, v: &Variances) -> f64 {
        self.prior_of(v, &self.alike(counts))
    }

    /// Coefficients of every test that vary alike under these counts.
    fn alike(&self, counts: &Counts) -> Vec<Vec<Alike>> {
        self.records.iter().zip(&counts.z).map(|(r, z)| r.alike(z)).collect()
    }

    fn prior_of(&self, v: &Variances, alike: &[Vec<Alike>]) -> f64 {
        let s = &self.settings;
        let of = |(t, record): (usize, &Record)| {
            let (errors, channels, mut known) = (v.own_errors(t, record), record.varied(v.kappa), vec![0.0; record.channels.len()]);
            for lot in &alike[t] {
                known[lot.channel] += lot.members.len() as f64 * lot.part(&channels, errors[lot.channel]).known(lot.z);
            }
            let open = (0..known.len()).filter(|b| (v.tau + v.own[t][*b]).exp() > record.channels[*b].least);
            open.map(|b| 0.5 * (1.0 + s.model_error_spread.powi(2) * known[b]).ln()).sum::<f64>()
        };
        v.prior(s) - self.records.iter().enumerate().map(of).sum::<f64>()
    }

    /// Variances by restricted likelihood: the channels' own model errors one by one, the common ones by a pattern search (Hooke and Jeeves,
    /// J. ACM 8, 1961).
    pub fn estimate(&self, seen: &[Seen], counts: &Counts, start: &Variances) -> Variances {
        let start = Variances { omega: start.omega.max(self.settings.scatter_from), ..start.clone() };
        let (grams, alike, common) = (self.grams(seen, counts), self.alike(counts), Common::of(self));
        let mut best = self.own_errors(seen, counts, start.bounded(&self.settings), &alike);
        let squares = |v: &Variances| Squares::of(self, &grams, v);
        let value = |v: &Variances, squares: &[Squares]| {
            restricted(self, &common, squares, seen, v).map_or(f64::NEG_INFINITY, |l| l + self.prior_of(v, &alike))
        };
        let mut at_best = squares(&best);
        let mut here = value(&best, &at_best);
        let directions = self.directions();
        let (mut left, mut part) = (self.settings.evaluations, 1.0);
        while part > self.settings.last_step && left > 0 {
            let mut better = false;
            for step in &directions {
                for sign in [1.0, -1.0] {
                    let trial = best.moved(step, sign * part).bounded(&self.settings);
                    // At a bound it stays where it is.
                    if trial == best {
                        continue;
                    }
                    // Scatter changes what coefficients have in common, not the variance of one by itself.
                    let moved = ((trial.kappa, trial.tau) != (best.kappa, best.tau)).then(|| squares(&trial));
                    let there = value(&trial, moved.as_ref().unwrap_or(&at_best));
                    left = left.saturating_sub(1);
                    if there > here {
                        at_best = moved.unwrap_or(at_best);
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
        still.settings.scatter_most = self.settings.no_scatter.exp();
        still.estimate(seen, counts, start)
    }

    /// The own model error of each channel that makes what is left of its residual, without what coefficients share, likeliest.
    fn own_errors(&self, seen: &[Seen], counts: &Counts, mut v: Variances, alike: &[Vec<Alike>]) -> Variances {
        let s = &self.settings;
        for (t, record) in self.records.iter().enumerate() {
            let parts = record.parts(v.kappa, &v.own_errors(t, record));
            let left = super::likelihood::cleaned(record, &seen[t], &parts, &counts.z[t], v.scatter(record));
            let channels = record.varied(v.kappa);
            // A lot of coefficients, and the sum of their squares.
            let of = |lot| -> (&Alike, f64) { (lot, lot.members.iter().map(|i| left[*i] * left[*i]).sum()) };
            let lots: Vec<(&Alike, f64)> = alike[t].iter().map(of).collect();
            for (b, channel) in record.channels.iter().enumerate() {
                let cost = |g: f64| {
                    let (tau, mut logs) = ((v.tau + g).exp().max(channel.least), LogSum::default());
                    let of = |(lot, squares): &(&Alike, f64)| {
                        let part = lot.part(&channels, tau);
                        lot.level(&part, &channels, &mut logs) + squares / part.variance(lot.z)
                    };
                    let sum: f64 = lots.iter().filter(|(lot, _)| lot.channel == b).map(of).sum();
                    0.5 * (sum + logs.total() + (g / s.model_error_spread).powi(2))
                };
                let costs: Vec<(f64, f64)> = s.own_grid().map(|g| (g, cost(g))).collect();
                v.own[t][b] = costs.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0.0, |c| c.0);
            }
        }
        v.centred(s)
    }
}
