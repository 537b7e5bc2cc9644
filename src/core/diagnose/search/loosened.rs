//! Slack as a move: given to what the study ties or fixes where that gains more than any effect, and taken back where the effects that were
//! found beside it do its work.

use super::candidates::Name;
use super::climb::{Added, Climb};
use super::fault::of_channel;
use super::step::{Move, Step};
use crate::diagnose::DiagnoseError;
use crate::diagnose::calibrate::case::Case;
use crate::diagnose::calibrate::fit::led;
use crate::diagnose::calibrate::slack::{self, Slack};
use crate::diagnose::calibrate::weigh::{Scale, Weighed};
use crate::diagnose::results::{Correction, Rung};
use crate::diagnose::trace;
use crate::model::System;
use crate::parallel;

/// A climb before slack was taken back.
struct Former {
    case: Case,
    base: usize,
    slack: Slack,
    added: Vec<Added>,
    order: Vec<usize>,
    now: Weighed,
    scale: Scale,
}

/// Slack that a model may be given.
pub struct Offer {
    /// Nats that it gains.
    pub gain: f64,
    slack: Slack,
    scale: Scale,
    weighed: Weighed,
}

/// What a step found beside slack when that was given instead.
pub struct Beside {
    /// The additions that stood then, effect and place.
    added: Vec<Name>,
    /// What it would have added.
    taken: Option<Move>,
    tried: f64,
}

impl Climb<'_> {
    /// What slack for what the study ties or fixes would gain: a move like any other, whose price is that of its widths. None where it stands already, is
    /// not wanted, or there is nothing that has any.
    pub fn offer(&self) -> Option<Offer> {
        let s = &self.settings;
        if self.loosened || !self.slack.is_empty() || self.case.search.slack == Some(false) || trace::stopped(self.monitor) {
            return None;
        }
        let present = &self.now.fitted.system;
        let study = System { instances: present.instances[..self.base].to_vec(), ..present.clone() };
        let (given, slack) = slack::given(&self.case, &study, true, s);
        if slack.is_empty() {
            return None;
        }
        (self.watch)(&format!("weighing {} deviations of what the study ties or fixes", slack.len()));
        let offer = |given: &System, slack: Slack| {
            let system = present.with(self.base, given.instances[self.base..].to_vec());
            let scale = Scale { case: Case { deviations: slack.clone(), ..self.scale.case.clone() }, ..self.scale.again() };
            let loose = Case { worth: Some(s.settled), ..self.case.at(&system) };
            let weighed = self.loose(&scale, &loose)?;
            // Its parameters are paid for by their widths.
            let gain = weighed.likelihood - self.now.likelihood + self.scale.odds(self.added.len(), &self.now).ln();
            Some(Offer { gain, slack, scale, weighed })
        };
        // Mass between the nodes is an oscillator at every spring and every node: it is part of slack where that gains by it.
        let Some((fewer, lumped)) = slack.lumped(&given, s) else { return offer(&given, slack) };
        let small = offer(&fewer, lumped);
        if small.as_ref().is_some_and(|o| !self.scale.errs(&o.weighed)) {
            return small;
        }
        let least = small.as_ref().map_or(f64::NEG_INFINITY, |o| o.gain + s.tie);
        offer(&given, slack).filter(|whole| whole.gain > least).or(small)
    }

    /// Gives slack where that gains more than what a step has found, by a tie: an effect is the smaller statement. It then stands in every model that
    /// follows. Whether it was given.
    pub fn slacken(&mut self, step: &Step) -> bool {
        let than = step.taken.as_ref().map_or(0.0, |t| t.gain);
        // What strengths scatter between tests may hide the error of a model, and an effect is believed beside what a structure has anyway.
        if step.taken.is_none() && !self.scale.errs(&self.now) {
            return false;
        }
        let Some(Offer { gain, slack, scale, weighed }) = self.offered.take().or_else(|| self.offer()) else { return false };
        if gain <= than.max(0.0) + self.settings.tie {
            return false;
        }
        (self.watch)(&format!("what the study ties or fixes has slack: {gain:.1} nats"));
        self.case.deviations = slack.clone();
        (self.base, self.scale, self.slack, self.now) = (self.base + slack.instances(), scale, slack, weighed);
        self.loosened = true;
        self.beside =
            Some(Beside { added: self.added.iter().map(|a| a.name.clone()).collect(), taken: step.taken.clone(), tried: step.tried });
        self.forget();
        true
    }

    /// The model with slack, weighed from where it stands and from its plain fit: across resonances that are displaced only the plain fit leads, and
    /// where strengths scatter between tests it leads astray, since it takes the scatter for deviations of parts.
    fn loose(&self, scale: &Scale, loose: &Case) -> Option<Weighed> {
        let most = loose.max_iterations.min(self.settings.race.iterations);
        let plain = led(&Case { max_iterations: most, ..loose.clone() }, &self.monitor.quiet()).ok().map(|(fitted, _)| fitted.system);
        let starts: Vec<&System> = std::iter::once(&loose.system).chain(&plain).collect();
        let weighed = parallel::map(&starts, |start| scale.weigh(start, &self.now.v, self.monitor).ok());
        let best = weighed.into_iter().flatten().max_by(|a, b| a.likelihood.total_cmp(&b.likelihood))?;
        scale.finished(best, self.monitor).ok()
    }

    /// Takes slack that a move has given back where the model without it, its effects exchanged once for what does their work there, is within a
    /// tie of it, or one with more effects is better by a tie: what slack took up before an effect was found may have bent the effect to a neighbour's law. `searched`: what is missing without
    /// slack is looked for as well, since slack may have been taken for two effects of which the first alone gained less than it. The rungs of the
    /// model without it.
    pub fn tighten(&mut self, searched: bool) -> Option<Vec<Rung>> {
        if !self.loosened || self.slack.is_empty() || (self.added.is_empty() && !searched) || trace::stopped(self.monitor) {
            return None;
        }
        let study = self.base - self.slack.instances();
        let mut system = self.now.fitted.system.clone();
        for k in (study..self.base).rev() {
            system = system.without(k)?;
        }
        let loose = Case { deviations: self.slack.clone(), ..self.scale.case.clone() };
        let mut scale = Scale { case: Case { deviations: Slack::default(), ..loose.clone() }, ..self.scale.again() };
        let small = scale.weigh(&system, &self.now.v, self.monitor).ok()?;
        let small = scale.tempered(&small, self.monitor).ok()?;
        let former = Former {
            case: self.case.clone(),
            base: self.base,
            slack: self.slack.clone(),
            added: self.added.clone(),
            order: self.order.clone(),
            now: self.now.clone(),
            scale: std::mem::replace(&mut self.scale, scale),
        };
        self.case.deviations = Slack::default();
        (self.base, self.slack, self.now) = (study, Slack::default(), small);
        self.forget();
        let rungs = self.exchanged(searched, &former, &loose);
        let gain = self.slack_above(&former, &loose);
        // Within a tie the smaller statement stands: with as many effects the model without slack, with more effects slack, which every structure has.
        let most = if self.added.len() > former.added.len() { -self.settings.tie } else { self.settings.tie };
        // What is interrupted decides nothing.
        if gain > most || rungs.is_err() || trace::stopped(self.monitor) {
            (self.case, self.base, self.slack, self.added) = (former.case, former.base, former.slack, former.added);
            (self.order, self.now, self.scale) = (former.order, former.now, former.scale);
            return None;
        }
        (self.watch)(&format!("what the study ties or fixes has no slack beside these effects: it would gain {gain:.1} nats"));
        self.list_ties();
        rungs.ok()
    }

    /// Nats by which the model with slack is above the present one, under the counts of that. Deviations have paid by their widths; what was looked
    /// for was paid for when it was found.
    fn slack_above(&self, former: &Former, loose: &Case) -> f64 {
        let scale = Scale { case: loose.clone(), ..self.scale.again() };
        let whole = scale.weigh(&former.now.fitted.system, &former.now.v, self.monitor);
        let found = self.added.len() as f64 - former.added.len() as f64;
        let extra = 0.5 * former.slack.len() as f64 * self.scale.counts.n.ln() + found * self.tried.max(1.0).ln();
        // A model that cannot be weighed once more stays as it is.
        let above = whole.ok().map(|w| self.scale.worth(&w) + extra - self.scale.worth(&self.now));
        above.filter(|gain| gain.is_finite()).unwrap_or(f64::INFINITY)
    }

    /// The effects exchanged for what does their work now, and what else is missing looked for: as many effects as slack may have been taken for, the last of
    /// which has to make up for all that is left. What was found here is exchanged where that may decide between it and slack.
    fn exchanged(&mut self, searched: bool, former: &Former, loose: &Case) -> Result<Vec<Rung>, DiagnoseError> {
        let mut rungs = Vec::new();
        loop {
            let open = rungs.is_empty() || self.slack_above(former, loose) <= self.settings.tie + self.settings.decisive;
            let (added, removed) = if self.added.is_empty() || !open { None } else { self.replace(None) }.unzip();
            if added.is_some() || rungs.is_empty() {
                rungs.push(self.rung(added, removed.into_iter().collect())?);
            }
            let found = self.added.len().saturating_sub(former.added.len());
            let most = self.effects() >= self.settings.max_added || rungs.len() > 2 * self.settings.max_added;
            if !searched || found >= self.settings.for_slack || most {
                return Ok(rungs);
            }
            let last = found + 1 == self.settings.for_slack;
            let beyond = if last { self.slack_above(former, loose).max(0.0) } else { 0.0 };
            let step = self.step_without_slack(beyond)?;
            let Some(taken) = &step.taken else { return Ok(rungs) };
            rungs.push(self.taken(taken, &step)?);
        }
    }

    /// A step for what gains so many nats beyond its price; where the additions are those beside which slack was given, what was found then.
    fn step_without_slack(&mut self, beyond: f64) -> Result<Step, DiagnoseError> {
        let same = |b: &Beside| b.added.iter().eq(self.added.iter().map(|a| &a.name));
        match self.beside.take().filter(same) {
            Some(Beside { taken, tried, .. }) => {
                self.tried = tried.max(1.0);
                Ok(Step { taken, tried, ..Step::default() })
            }
            None => self.step_beyond(beyond),
        }
    }

    /// What an addition corrects, where it says no more than slack grants.
    fn corrects(&self, k: usize) -> Option<Correction> {
        slack::correction(&self.case, &self.now.fitted, self.base, self.base + k, &self.settings)
    }

    /// Whether an addition is an effect: no fault of an instrument, and no correction of what the study says.
    pub(in crate::diagnose) fn is_physics(&self, k: usize) -> bool {
        !self.now.fitted.system.instances.get(self.base + k).is_some_and(of_channel) && self.corrects(k).is_none()
    }

    /// What deviates from what the study says, by slack and by what was added.
    pub(in crate::diagnose) fn corrections(&self) -> Vec<Correction> {
        let mut told = self.slack.corrections(&self.now.fitted, &self.settings);
        told.extend((0..self.added.len()).filter_map(|k| self.corrects(k)));
        told
    }
}
