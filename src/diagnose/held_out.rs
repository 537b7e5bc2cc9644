//! The last word: tests that nothing was fitted to.

use crate::evidence::{Counts, Evidence, Seen, Variances};
use crate::model::System;
use crate::parallel;
use crate::response::Plan;

use super::settings::Settings;
use super::weigh::Weighed;

/// Points of the grid on which the model error of the held-out tests is looked for, and its span from the least one, in logarithms.
const GRID: usize = 40;
const SPAN: f64 = 6.5;

/// The held-out tests beside two models.
pub struct HeldOutTests<'a> {
    plans: Vec<&'a Plan>,
    evidence: Evidence,
    counts: Counts,
    settings: &'a Settings,
}

/// A model in the held-out tests.
pub struct Look<'w> {
    of: &'w Weighed,
    seen: Vec<Seen>,
    /// Logarithm of their density under the model and its variances.
    pub density: f64,
}

/// What they say.
#[derive(Clone, Copy, Debug)]
pub struct Word {
    /// Nats by which the density of the held-out tests is higher with the last model than with the first.
    pub nats: f64,
    /// Model error seen there with the first and with the last model, beside the noise and scatter of the last.
    pub left: (f64, f64),
}

impl<'a> HeldOutTests<'a> {
    /// `first`: the model whose error says what a coefficient counts as.
    pub fn new(plans: Vec<&'a Plan>, first: &Weighed, last: &Weighed, settings: &'a Settings) -> Option<Self> {
        if plans.is_empty() {
            return None;
        }
        let evidence = Evidence::new(&plans, &last.fitted.system, &settings.evidence);
        let mut tests = HeldOutTests { counts: evidence.independent(), plans, evidence, settings };
        tests.counts = tests.evidence.least_counts(&tests.elsewhere(&first.v));
        Some(tests)
    }

    fn see(&self, system: &System) -> Option<Vec<Seen>> {
        let free = system.free();
        let of = |t: usize| {
            let c = self.plans[t].evaluate(system, &free, true).ok()?;
            let finite = c.values.iter().chain(&c.slopes).all(|v| v.is_finite());
            finite.then(|| self.evidence.records[t].see(self.plans[t], &c, system, &free))
        };
        parallel::over(self.plans.len(), of).into_iter().collect()
    }

    /// Variances of a model in tests that it has not seen: those that its tests have in common.
    fn elsewhere(&self, v: &Variances) -> Variances {
        let all: Vec<f64> = v.own.iter().flatten().copied().collect();
        let mean = all.iter().sum::<f64>() / all.len().max(1) as f64;
        let own = self.evidence.records.iter().map(|r| vec![0.0; r.channels.len()]).collect();
        Variances { tau: v.tau + mean, own, ..v.clone() }
    }

    /// A model in them; none where it cannot be computed there.
    pub fn look<'w>(&self, w: &'w Weighed) -> Option<Look<'w>> {
        let (seen, v) = (self.see(&w.fitted.system)?, self.elsewhere(&w.v));
        let density = self.evidence.likelihood(&seen, &self.counts, &v) - v.prior(&self.settings.evidence);
        density.is_finite().then_some(Look { of: w, seen, density })
    }

    /// The model error that they show, beside noise and scatter as those of `beside`.
    fn error_left(&self, look: &Look, beside: &Weighed) -> f64 {
        let mut v = self.elsewhere(&beside.v);
        let least = self.settings.evidence.model_error_least.ln();
        let at = |k: usize| least + SPAN * k as f64 / (GRID - 1) as f64;
        let mut density = |k: usize| {
            v.tau = at(k);
            self.evidence.likelihood(&look.seen, &self.counts, &v)
        };
        let all: Vec<f64> = (0..GRID).map(&mut density).collect();
        (0..GRID).max_by(|a, b| all[*a].total_cmp(&all[*b])).map_or(f64::INFINITY, |k| at(k).exp())
    }

    /// Two models beside each other.
    pub fn word(&self, first: &Look, last: &Look) -> Word {
        let left = (self.error_left(first, last.of), self.error_left(last, last.of));
        Word { nats: last.density - first.density, left }
    }
}
