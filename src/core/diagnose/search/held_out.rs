//! The last word: tests that nothing was fitted to.

use crate::evidence::{Counts, Evidence, Seen, Variances};
use crate::model::System;
use crate::parallel;
use crate::residual::mean_square;
use crate::response::Plan;

use crate::diagnose::calibrate::weigh::{Scale, Weighed};
use crate::diagnose::results::SplitName;
use crate::diagnose::settings::Settings;

/// The held-out tests beside two models.
pub struct HeldOutTests<'a> {
    plans: Vec<&'a Plan>,
    evidence: Evidence,
    /// The tests to which models were fitted.
    fitted: &'a Evidence,
    counts: Counts,
    /// Scale of the noise as the last model has it: noise is the tests', and no model is better for having another.
    kappa: f64,
    settings: &'a Settings,
}

/// A model in the held-out tests.
pub struct Look<'w> {
    of: &'w Weighed,
    seen: Vec<Seen>,
    /// What it computes at the points of every test.
    values: Vec<Vec<f64>>,
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
    /// Fall of the mean square error of the tests from the first to the last model, relative to the response, and its standard error over
    /// pieces of the tests.
    pub fall: (f64, f64),
}

impl Word {
    /// Whether the tests bear out what the last model has beyond the first: they are likelier by more than `held_out_nats`, and closer by more than a standard
    /// error.
    pub fn bears_out(&self, s: &Settings) -> bool {
        self.nats > s.held_out_nats && self.fall.0 > self.fall.1
    }
}

impl<'a> HeldOutTests<'a> {
    /// `first`: the model whose error says what a coefficient counts as.
    pub fn new(plans: Vec<&'a Plan>, fitted: &'a Evidence, first: &Weighed, last: &Weighed, settings: &'a Settings) -> Option<Self> {
        if plans.is_empty() {
            return None;
        }
        let evidence = Evidence::new(&plans, &last.fitted.system, &settings.evidence);
        let counts = evidence.least_counts(&first.v.carried(fitted, &evidence));
        Some(HeldOutTests { plans, evidence, fitted, counts, kappa: last.v.kappa, settings })
    }

    /// Fitted tests that were left out of a fit, as they are seen and counted beside the others: what a model misses of a mode or of a loop it misses in all of
    /// them, and each by itself would count for as many facts as all do.
    pub fn left_out(left: &'a Scale, fitted: &'a Evidence, kappa: f64) -> Self {
        let plans = left.case.plans_of(SplitName::Fit);
        HeldOutTests { plans, evidence: left.evidence.clone(), fitted, counts: left.counts.clone(), kappa, settings: &left.settings }
    }

    fn see(&self, system: &System) -> Option<(Vec<Seen>, Vec<Vec<f64>>)> {
        let free = system.free();
        let of = |t: usize| {
            let c = self.plans[t].evaluate(system, &free, true).ok()?;
            let finite = c.values.iter().chain(&c.slopes).all(|v| v.is_finite());
            finite.then(|| (self.evidence.records[t].see(self.plans[t], &c, system, &free), c.values))
        };
        parallel::over(self.plans.len(), of).into_iter().collect()
    }

    /// Fall of the mean square relative error and its standard error: every channel of a test is cut into as many pieces as make
    /// [`Settings::held_out_pieces`] of all, and what they say is taken as so many independent draws.
    fn fall(&self, first: &Look, last: &Look) -> (f64, f64) {
        let channels: usize = self.plans.iter().map(|p| p.blocks.len()).sum();
        let pieces = self.settings.held_out_pieces.div_ceil(channels.max(1)).max(1);
        let mut falls = Vec::new();
        for (t, plan) in self.plans.iter().enumerate() {
            for block in &plan.blocks {
                let rows: Vec<usize> = block.range.clone().filter(|row| !plan.left_out.contains(row)).collect();
                let measured: Vec<f64> = rows.iter().map(|i| plan.measured[*i]).collect();
                let size = mean_square(block.kind, &measured);
                for piece in rows.chunks(rows.len().div_ceil(pieces).max(1)) {
                    let of = |look: &Look| piece.iter().map(|i| (look.values[t][*i] - plan.measured[*i]).powi(2)).sum::<f64>();
                    falls.push((of(first) - of(last)) / (size * piece.len() as f64));
                }
            }
        }
        let n = falls.len().max(1) as f64;
        let mean = falls.iter().sum::<f64>() / n;
        let variance = falls.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        (mean, (variance / n).sqrt())
    }

    /// A model in them; none where it cannot be computed there.
    pub fn look<'w>(&self, w: &'w Weighed) -> Option<Look<'w>> {
        let (seen, values) = self.see(&w.fitted.system)?;
        let v = Variances { kappa: self.kappa, ..w.v.carried(self.fitted, &self.evidence) };
        let density = self.evidence.predictive(&seen, &self.counts, &v);
        density.is_finite().then_some(Look { of: w, seen, values, density })
    }

    /// The model error that they show, beside noise and scatter as those of `beside`.
    fn error_left(&self, look: &Look, beside: &Weighed) -> f64 {
        let mut v = beside.v.carried(self.fitted, &self.evidence);
        let (points, span) = (self.settings.telling.held_out_points, self.settings.telling.held_out_span);
        let least = self.settings.evidence.least().ln();
        let at = |k: usize| least + span * k as f64 / (points - 1) as f64;
        let mut density = |k: usize| {
            v.tau = at(k);
            self.evidence.likelihood(&look.seen, &self.counts, &v)
        };
        let all: Vec<f64> = (0..points).map(&mut density).collect();
        let best = (0..points).max_by(|a, b| all[*a].total_cmp(&all[*b]));
        v.tau = at(best.unwrap_or(0));
        if best.is_some() { v.model_error(&self.evidence) } else { f64::INFINITY }
    }

    /// Two models beside each other.
    pub fn word(&self, first: &Look, last: &Look) -> Word {
        let left = (self.error_left(first, last.of), self.error_left(last, last.of));
        Word { nats: last.density - first.density, left, fall: self.fall(first, last) }
    }
}
