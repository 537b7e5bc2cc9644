//! Slack as a move: given to what the study ties or fixes where that gains more than any effect, and taken back where the effects that were
//! found beside it do its work.

use super::case::{Case, begin};
use super::climb::Climb;
use super::results::EffectAt;
use super::slack::{self, Slack};
use super::trace;
use super::weigh::Scale;
use crate::model::System;

/// Slack was taken back.
pub struct Tightened {
    /// The effect that took the place of another without it.
    pub exchanged: Option<(EffectAt, EffectAt)>,
}

impl Climb<'_> {
    /// Gives slack to what the study ties or fixes where that gains more than what a step has found: a move like any other, whose price is that
    /// of its widths. It then stands in every model that follows. Whether it was given.
    pub fn slacken(&mut self, than: f64) -> bool {
        let (s, e) = (&self.settings, &self.settings.evidence);
        let seen = self.now.v.model_error(&self.scale.evidence) >= s.pairs_from * e.model_error_least;
        if !seen || self.loosened || !self.slack.is_empty() || self.case.search.slack == Some(false) || trace::stopped(self.monitor) {
            return false;
        }
        let present = &self.now.fitted.system;
        let study = System { instances: present.instances[..self.base].to_vec(), ..present.clone() };
        let (given, slack) = slack::given(&self.case, &study, true, s);
        if slack.is_empty() {
            return false;
        }
        (self.watch)(&format!("weighing {} deviations of what the study ties or fixes", slack.len()));
        let system = present.with(self.base, given.instances[self.base..].to_vec());
        let scale = Scale { case: Case { deviations: slack.clone(), ..self.scale.case.clone() }, ..self.scale.again() };
        let loose = Case { worth: Some(s.settled), ..self.case.at(&system) };
        let Ok(began) = begin(&loose, &self.monitor.quiet()) else { return false };
        let Ok(weighed) = scale.weigh(&began.fitted.system, &self.now.v, self.monitor) else { return false };
        // Its parameters are paid for by their widths.
        let gain = weighed.likelihood - self.now.likelihood;
        if gain <= than.max(0.0) {
            return false;
        }
        (self.watch)(&format!("what the study ties or fixes has slack: {gain:.1} nats"));
        self.case.deviations = slack.clone();
        (self.base, self.scale, self.slack, self.now) = (self.base + slack.len(), scale, slack, weighed);
        self.loosened = true;
        self.forget();
        true
    }

    /// Takes slack that a move has given back where the model without it, its effects exchanged once for what does their work there, is within a
    /// tie of it: what slack took up before an effect was found may have bent the effect to a neighbour's law.
    pub fn tighten(&mut self) -> Option<Tightened> {
        if !self.loosened || self.slack.is_empty() || self.added.is_empty() || trace::stopped(self.monitor) {
            return None;
        }
        let study = self.base - self.slack.len();
        let mut system = self.now.fitted.system.clone();
        for k in (study..self.base).rev() {
            system = system.without(k)?;
        }
        let loose = Case { deviations: self.slack.clone(), ..self.scale.case.clone() };
        let mut scale = Scale { case: Case { deviations: Slack::default(), ..loose.clone() }, ..self.scale.again() };
        let small = scale.weigh(&system, &self.now.v, self.monitor).ok()?;
        let small = scale.tempered(&small, self.monitor).ok()?;
        let before = (self.base, self.slack.clone(), self.added.clone(), self.order.clone(), self.now.clone());
        let former = std::mem::replace(&mut self.scale, scale);
        self.case.deviations = Slack::default();
        (self.base, self.slack, self.now) = (study, Slack::default(), small);
        self.forget();
        let exchanged = self.swap();
        let whole = Scale { case: loose, ..self.scale.again() }.weigh(&before.4.fitted.system, &before.4.v, self.monitor);
        // Deviations have paid by their widths.
        let extra = 0.5 * before.1.len() as f64 * self.scale.counts.n.ln();
        let gain = whole.map_or(f64::INFINITY, |w| self.scale.worth(&w) + extra - self.scale.worth(&self.now));
        // What is interrupted decides nothing.
        if gain > self.settings.tie || trace::stopped(self.monitor) {
            (self.base, self.slack, self.added, self.order, self.now) = before;
            self.scale = former;
            self.case.deviations = self.slack.clone();
            return None;
        }
        (self.watch)(&format!("what the study ties or fixes has no slack beside these effects: it would gain {gain:.1} nats"));
        Some(Tightened { exchanged })
    }
}
