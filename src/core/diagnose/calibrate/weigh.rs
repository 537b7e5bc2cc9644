//! A model weighed: fitted under a covariance whose variances are estimated for it, with its likelihood.

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::evidence::{Counts, Evidence, Seen, Variances};
use crate::identify::{FitOutcome, Monitor, Prior, Termination};
use crate::model::{Instance, System};
use crate::parallel;
use crate::residual::{Common, Memo, Problem};
use crate::response::Plan;

use super::case::{Case, Fitted};
use super::nearby::{Looked, Nearby};
use crate::diagnose::results::SplitName;
use crate::diagnose::settings::Settings;

/// A model with its variances.
#[derive(Clone)]
pub struct Weighed {
    /// The model, fitted under them.
    pub fitted: Fitted,
    /// What it leaves in every test.
    pub seen: Vec<Seen>,
    /// Its variances.
    pub v: Variances,
    /// Its likelihood under the counts it was weighed with, the priors of its parameters and variances with it.
    pub likelihood: f64,
}

impl Weighed {
    /// Free parameters, those of a study's effect that the tests have put to zero among them: that it is not there says as much as that another is, and
    /// what stands in its place is no smaller statement.
    pub fn size(&self) -> usize {
        self.fitted.free.len()
    }

    /// The effect that was put in last.
    pub fn last(&self) -> Option<&Instance> {
        self.fitted.system.instances.last()
    }

    /// Whether the effect that was put in last has a free shape and the tests know every one it has, within their ranges.
    fn knows_its_shape(&self) -> bool {
        let (Some(last), Ok(known)) = (self.fitted.system.instances.len().checked_sub(1), self.fitted.uncertainty()) else { return false };
        let of = self.fitted.free.iter().zip(&known.parameters);
        let mut shapes = of.filter(|(f, _)| f.instance == last && f.param > 0).map(|(_, p)| p.identifiable && !p.at_bound).peekable();
        shapes.peek().is_some() && shapes.all(|known| known)
    }
}

/// What a fit under a model's own variances may come to.
#[derive(Clone)]
pub struct Promised {
    /// The model as it stands.
    pub stands: Weighed,
    /// Nats that a step of its parameters promises.
    pub step: f64,
}

/// How two models are tied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tied {
    /// Each is as good a statement as the other.
    Alike,
    /// The other one needs more parameters, and the tests do not speak against it.
    Larger,
}

/// Where a model stands while it is weighed.
struct Standing {
    system: System,
    seen: Vec<Seen>,
    v: Variances,
    /// That of its residuals alone.
    likelihood: f64,
}

/// What models are weighed on: the fitted tests, and what a coefficient of them counts as.
pub struct Scale {
    /// The case, its fit and select tests as those that are fitted.
    pub case: Case,
    /// The tests.
    pub evidence: Evidence,
    /// The counts.
    pub counts: Counts,
    /// Whether select tests are among them, which `fit` leaves out.
    pub selects: bool,
    /// Constants.
    pub settings: Settings,
    /// Its tests about the models that were weighed last.
    pub nearby: Arc<Nearby>,
}

impl Scale {
    /// On the fit and select tests of a case. `system`: from which the signals are computed that instruments may misread.
    pub fn new(case: &Case, system: &System, settings: &Settings) -> Scale {
        let fitted = |(p, s): &(Plan, SplitName)| (p.clone(), if *s == SplitName::Select { SplitName::Fit } else { *s });
        let selects = case.plans.iter().any(|(_, s)| *s == SplitName::Select);
        let case = Case { plans: Arc::new(case.plans.iter().map(fitted).collect()), ..case.clone() };
        Scale { selects, ..Scale::of_fitted(&case, system, settings) }
    }

    /// On the fit tests alone.
    pub fn of_fitted(case: &Case, system: &System, settings: &Settings) -> Scale {
        let case = case.clone();
        let evidence = Evidence::of_fitted(&case.plans_of(SplitName::Fit), system, &settings.evidence);
        Scale { counts: evidence.independent(), evidence, case, selects: false, settings: settings.clone(), nearby: Arc::default() }
    }

    /// The same once more, for counts of its own.
    pub fn again(&self) -> Scale {
        let (case, evidence, counts, settings) = (self.case.clone(), self.evidence.clone(), self.counts.clone(), self.settings.clone());
        Scale { case, evidence, counts, selects: self.selects, settings, nearby: self.nearby.clone() }
    }

    /// The same once more, what instruments may misread computed from this system.
    pub fn renewed(&self, system: &System) -> Scale {
        let evidence = Evidence::of_fitted(&self.case.plans_of(SplitName::Fit), system, &self.settings.evidence);
        Scale { evidence, ..self.again() }
    }

    /// The case under the covariance that a weighed model has.
    pub fn under(&self, seen: &[Seen], v: &Variances, counts: &Counts) -> Case {
        let mut covariances = self.evidence.covariances(seen, v, counts).into_iter();
        let covered = |(p, s): &(Plan, SplitName)| {
            let covariance = if *s == SplitName::Fit { covariances.next().map(Arc::new) } else { None };
            (p.under(covariance), *s)
        };
        Case { plans: Arc::new(self.case.plans.iter().map(covered).collect()), ..self.case.clone() }
    }

    /// The same with what its tests have in common: the covariance under which a model is likeliest.
    fn jointly(&self, seen: &[Seen], v: &Variances) -> Case {
        let mut joint = self.evidence.joint_covariances(seen, v, &self.counts).into_iter().peekable();
        let mut columns = Vec::new();
        let covered = |(p, s): &(Plan, SplitName)| {
            let own = joint.next_if(|_| *s == SplitName::Fit).map(|(covariance, common)| {
                let mut rows = DMatrix::zeros(p.len(), common.ncols());
                covariance.whiten_coefficients(common, &mut rows.as_view_mut());
                columns.push(rows);
                Arc::new(covariance)
            });
            (p.under(own), *s)
        };
        let plans = self.case.plans.iter().map(covered).collect();
        let (rows, count) = (columns.iter().map(|c| c.nrows()).sum(), columns.first().map_or(0, |c| c.ncols()));
        let (mut all, mut row) = (DMatrix::zeros(rows, count), 0);
        for own in columns {
            all.rows_mut(row, own.nrows()).copy_from(&own);
            row += own.nrows();
        }
        Case { plans: Arc::new(plans), common: Common::new(all).map(Arc::new), ..self.case.clone() }
    }

    /// A system in the fitted tests.
    pub fn see(&self, system: &System) -> Result<Vec<Seen>, String> {
        self.see_again(system, &Memo::default())
    }

    /// The same, computed unless it is known.
    fn see_again(&self, system: &System, memo: &Memo) -> Result<Vec<Seen>, String> {
        let (plans, free) = (self.case.plans_of(SplitName::Fit), system.free());
        let compute = || {
            let computed = match memo.find(system, &free) {
                Some(known) => known,
                None => {
                    let one = |p: &&Plan| p.evaluate(system, &free, true).map_err(|e| e.to_string());
                    Arc::new(parallel::map(&plans, one).into_iter().collect::<Result<Vec<_>, _>>()?)
                }
            };
            let of = |t: usize| {
                let finite = computed[t].values.iter().chain(&computed[t].slopes).all(|v| v.is_finite());
                if finite {
                    Ok(self.evidence.records[t].see(plans[t], &computed[t], system, &free))
                } else {
                    Err("its response is not finite".into())
                }
            };
            let seen = parallel::over(plans.len(), of).into_iter().collect::<Result<Vec<_>, String>>()?;
            Ok(Looked { computed, seen: Arc::new(seen) })
        };
        let Looked { computed, seen } = self.nearby.look((&self.case.plans, system, &free), compute)?;
        if memo.find(system, &free).is_none() {
            memo.keep(system, &free, computed);
        }
        Ok(seen.as_ref().clone())
    }

    /// Fits the system and estimates its variances in turn, from these variances on, until they move the likelihood by no more than fits leave
    /// unfound. The covariance of a fit stands still, and where strengths scatter along records it is another one where the fit ends: as far as the
    /// likelihood is less there, the fit is taken back. Tests that are cheaper about one system ([`Case::expanded`]) are computed about where the
    /// fit begins, and where it ends once more, so that the likelihood is that of the tests themselves.
    pub fn weigh(&self, system: &System, start: &Variances, monitor: &Monitor) -> Result<Weighed, String> {
        let Some(mut near) = self.about(system) else { return self.weigh_in_full(system, start, monitor) };
        let mut now = near.weigh_in_full(system, start, monitor)?;
        let mut round = 0;
        loop {
            let (system, v) = (&now.fitted.system, &now.v);
            let Some(there) = self.about(system) else { return self.weigh_in_full(system, v, monitor) };
            near = there;
            let Promised { mut stands, step } = near.promised(system, v, monitor)?;
            stands.fitted.outcome.termination = now.fitted.outcome.termination.clone();
            if step <= self.settings.settled || round == self.settings.rounds || crate::diagnose::trace::stopped(monitor) {
                return Ok(stands);
            }
            now = near.weigh_in_full(system, v, monitor)?;
            round += 1;
        }
    }

    /// The same scale with its tests computed about this system; `None` where none of them is cheaper so.
    pub fn about(&self, system: &System) -> Option<Scale> {
        Some(Scale { case: self.nearby.about(&self.case, system)?, ..self.again() })
    }

    /// The same with every test computed as it is in this scale.
    pub(in crate::diagnose) fn weigh_in_full(&self, system: &System, start: &Variances, monitor: &Monitor) -> Result<Weighed, String> {
        let memo = Arc::new(Memo::default());
        let here = self.standing(system, start, &memo)?;
        let (own, mut now, mut last) = (here.v.clone(), Standing { v: start.clone(), ..here }, None);
        for round in 0..self.settings.rounds.max(1) {
            if round > 0 && crate::diagnose::trace::stopped(monitor) {
                break;
            }
            let fitted = self.fitted(&now, self.settings.iterations, &memo, monitor)?;
            let Some((fitted, next)) = self.ascended(&now, fitted, &memo, monitor)? else { break };
            let before = self.evidence.likelihood(&next.seen, &self.counts, &now.v);
            let settled = (next.likelihood - before).abs() <= self.settings.settled;
            now = next;
            now.system = self.case.deviations.widened(&fitted, &self.settings);
            last = Some(fitted);
            if self.case.deviations.is_empty() && settled {
                break;
            }
        }
        let fitted = match last {
            Some(fitted) => fitted,
            None => {
                now.v = own;
                let fitted = self.fitted(&now, 0, &memo, monitor)?;
                let outcome = FitOutcome { termination: Termination::Stalled, ..fitted.outcome };
                Fitted { outcome, ..fitted }
            }
        };
        let likelihood = now.likelihood - 0.5 * prior_squares(&fitted) - self.case.deviations.price(&fitted);
        Ok(Weighed { fitted, seen: now.seen, v: now.v, likelihood })
    }

    /// A system in the tests, its variances estimated from these on.
    fn standing(&self, system: &System, from: &Variances, memo: &Memo) -> Result<Standing, String> {
        let seen = self.see_again(system, memo)?;
        let v = self.evidence.estimate(&seen, &self.counts, from);
        let likelihood = self.evidence.likelihood(&seen, &self.counts, &v);
        Ok(Standing { system: system.clone(), seen, v, likelihood })
    }

    /// The system fitted under the covariance that it has where it stands.
    fn fitted(&self, from: &Standing, iterations: u64, memo: &Arc<Memo>, monitor: &Monitor) -> Result<Fitted, String> {
        let jointly = self.jointly(&from.seen, &from.v);
        let case = Case { worth: Some(self.settings.settled), memo: Some(memo.clone()), ..jointly };
        let fitted = case.coarsely(iterations).fit_system(&from.system, case.plans_of(SplitName::Fit), &monitor.quiet());
        let fitted = fitted.map_err(|e| e.to_string())?;
        match &fitted.outcome.termination {
            Termination::Failed(reason) => Err(reason.clone()),
            _ => Ok(fitted),
        }
    }

    /// Where a fit leads from here without loss: to its end, or part of the way there; none where every part of it loses.
    fn ascended(&self, now: &Standing, fitted: Fitted, memo: &Arc<Memo>, monitor: &Monitor) -> Result<Option<(Fitted, Standing)>, String> {
        let squares = |p: &[f64]| -> f64 {
            let square = |prior: &Prior| ((p[prior.index] - prior.mean) / prior.sigma).powi(2);
            fitted.options.priors.iter().map(square).sum()
        };
        let problem = Problem::new(self.case.plans_of(SplitName::Fit), now.system.clone());
        let (begun, end) = (problem.variables(), &fitted.outcome.p);
        let least = now.likelihood - 0.5 * squares(&begun) - self.settings.settled;
        let there = self.standing(&fitted.system, &now.v, memo);
        if there.as_ref().is_ok_and(|t| t.likelihood - 0.5 * squares(end) >= least) {
            return Ok(Some((fitted, there?)));
        }
        for part in self.settings.parts_of_a_fit {
            let p: Vec<f64> = begun.iter().zip(end).map(|(from, to)| from + part * (to - from)).collect();
            let Ok(there) = self.standing(&problem.system_at(&p), &now.v, memo) else { continue };
            if there.likelihood - 0.5 * squares(&p) >= least {
                return Ok(Some((self.fitted(&there, 0, memo, monitor)?, there)));
            }
        }
        Ok(None)
    }

    /// A model under variances of its own, no fit made under them, its tests computed about itself.
    pub fn promised_about(&self, system: &System, start: &Variances, monitor: &Monitor) -> Result<Promised, String> {
        self.about(system).as_ref().unwrap_or(self).promised(system, start, monitor)
    }

    /// A model under variances of its own, no fit made under them.
    fn promised(&self, system: &System, start: &Variances, monitor: &Monitor) -> Result<Promised, String> {
        let memo = Arc::new(Memo::default());
        let standing = self.standing(system, start, &memo)?;
        let fitted = self.fitted(&standing, 0, &memo, monitor)?;
        let Standing { seen, v, likelihood, .. } = standing;
        let likelihood = likelihood - 0.5 * prior_squares(&fitted) - self.case.deviations.price(&fitted);
        let prior = |p: &Prior| (p.index, fitted.outcome.p[p.index], p.mean, p.sigma);
        let priors: Vec<_> = fitted.options.priors.iter().map(prior).collect();
        let step = self.evidence.within_a_step(&seen, &self.counts, &v, &priors).unwrap_or(f64::INFINITY);
        Ok(Promised { stands: Weighed { fitted, seen, v, likelihood }, step })
    }

    /// A weighed model as it is told: with the slopes of the tests themselves, from which its intervals follow.
    pub fn told(&self, now: &Weighed, monitor: &Monitor) -> Weighed {
        let spatial = now.fitted.system.model.space.is_some();
        let exact = spatial.then(|| self.promised(&now.fitted.system, &now.v, monitor).ok()).flatten();
        let mut told = exact.map_or_else(|| now.clone(), |p| p.stands);
        told.fitted.outcome.termination = now.fitted.outcome.termination.clone();
        told
    }

    /// A fitted model with its variances, not fitted again under them.
    pub fn as_it_stands(&self, fitted: &Fitted) -> Option<Weighed> {
        let seen = self.see(&fitted.system).ok().filter(|s| !s.is_empty())?;
        let once = self.evidence.estimate(&seen, &self.counts, &Variances::start(&self.evidence, &seen));
        let v = self.evidence.estimate(&seen, &self.evidence.counts(&seen, &once), &once);
        let likelihood = self.evidence.likelihood(&seen, &self.counts, &v);
        Some(Weighed { fitted: fitted.clone(), seen, v, likelihood })
    }

    /// The system weighed, the counts set by what its plain fit leaves and then by what it leaves itself. All that the plain fit leaves counts as its error
    /// at first: counted as independent, a thousand lines of an FRF would lead a good fit away from the loops before they are known to be few facts.
    pub fn begin(&mut self, system: &System, monitor: &Monitor) -> Result<Weighed, String> {
        let system = &self.plainly(system, monitor)?;
        parallel::watched(&monitor.watch(), || {
            let plain = self.about(system).as_ref().unwrap_or(self).see(system)?;
            let mut v = Variances::start(&self.evidence, &plain);
            self.counts = self.evidence.counts(&plain, &v);
            for _ in 0..self.settings.estimates {
                v = self.evidence.estimate(&plain, &self.counts, &v);
                self.counts = self.evidence.counts(&plain, &v);
            }
            let mut now = self.weigh(system, &v, monitor)?;
            for _ in 0..self.settings.rounds {
                now = self.tempered(&now, monitor)?;
            }
            self.finished(now, monitor)
        })
    }

    /// The system fitted to all tests it is weighed on, from where it was fitted to those of the fit: where the search begins does not depend on which
    /// of its tests are called select.
    fn plainly(&self, system: &System, monitor: &Monitor) -> Result<System, String> {
        if !self.selects || crate::diagnose::trace::stopped(monitor) {
            return Ok(system.clone());
        }
        let case = Case { starts: 1, ..self.case.clone() };
        // What is led about where it stands is weighed so as well.
        if let Some(there) = case.led_about(system, monitor) {
            return Ok(there);
        }
        let fitted = case.fit_system(system, case.plans_of(SplitName::Fit), &monitor.quiet()).map_err(|e| e.to_string())?;
        match fitted.outcome.termination {
            Termination::Failed(reason) => Err(reason),
            _ => Ok(fitted.system),
        }
    }

    /// The same weighed on until that gains no more: what a model has not yet found by itself would be the gain of whatever is added to it. A fit may have
    /// converged and its variances not: along records of strengths that scatter they move together, and left up to nine nats.
    pub fn finished(&self, mut now: Weighed, monitor: &Monitor) -> Result<Weighed, String> {
        for _ in 0..self.settings.finish {
            if crate::diagnose::trace::stopped(monitor) {
                break;
            }
            let again = self.weigh(&now.fitted.system, &now.v, monitor)?;
            let gained = again.likelihood - now.likelihood;
            if gained > 0.0 {
                now = again;
            }
            if gained <= self.settings.finish_least {
                break;
            }
        }
        Ok(now)
    }

    /// Sets the counts by what this model leaves, and weighs it under them.
    pub fn tempered(&mut self, now: &Weighed, monitor: &Monitor) -> Result<Weighed, String> {
        self.counts = self.evidence.counts(&now.seen, &now.v);
        self.weigh(&now.fitted.system, &now.v, monitor)
    }

    /// **The criterion**: by how many nats a model is better than a smaller one under whose counts both were weighed, less half the logarithm of
    /// the facts for every parameter (Schwarz, Ann. Statist. 6, 1978) and the logarithm of what was tried.
    pub fn gain(&self, larger: &Weighed, smaller: &Weighed, tried: f64) -> f64 {
        let more = larger.size() as f64 - smaller.size() as f64;
        let price = 0.5 * more * self.counts.n.ln() + tried.ln();
        larger.likelihood - smaller.likelihood - price
    }

    /// Odds, before a further effect is looked for, that a model with so many additions lacks something. One that a study begins with was seen to fail, and so
    /// is one that errs by more than any model does: what its own error stands for has no name yet. Of one that errs by no more nothing is known.
    pub fn odds(&self, added: usize, of: &Weighed) -> f64 {
        if added == 0 || self.errs(of) { self.settings.missing_odds } else { 1.0 }
    }

    /// Whether a model's own error is larger than what every model is granted, by the factor `errs_from`.
    pub fn errs(&self, of: &Weighed) -> bool {
        let (s, e) = (&self.settings, &self.settings.evidence);
        of.v.model_error(&self.evidence) >= s.errs_from * e.model_error_least
    }

    /// What a model is worth beside others of unlike size.
    pub fn worth(&self, w: &Weighed) -> f64 {
        w.likelihood - 0.5 * w.size() as f64 * self.counts.n.ln()
    }

    /// How the tests tell a model from another one that stands in its place; none where they do. What is worth less by a tie alone is as likely. A larger
    /// model that is worth less by its price alone is not refuted: the price says which of two is the smaller statement, and supposes that the tests know
    /// every parameter. One that computes what the smaller one does because its shape is at the end of its range, or may be anything there, is no other
    /// statement. Where its shape is known and lies within its range, the smaller law is one of a family whose others the tests allow as well: a damping by the
    /// power 2.0 +- 0.3 of the speed says more than the square.
    pub fn tied(&self, other: &Weighed, than: &Weighed) -> Option<Tied> {
        let (tie, behind) = (self.settings.tie, self.worth(than) - self.worth(other));
        if behind <= tie {
            return Some(Tied::Alike);
        }
        let price = 0.5 * (other.size() as f64 - than.size() as f64).max(0.0) * self.counts.n.ln();
        let another = || self.apart(&other.seen, than) > self.settings.settled || other.knows_its_shape();
        (behind - price <= tie && another()).then_some(Tied::Larger)
    }

    /// Nats by which the responses of two models are apart, under the variances of the second.
    pub fn apart(&self, a: &[Seen], b: &Weighed) -> f64 {
        let of = |(a, b): (&Seen, &Seen)| Seen { r: &a.r - &b.r, ..b.clone() };
        let apart: Vec<Seen> = a.iter().zip(&b.seen).map(of).collect();
        0.5 * self.evidence.squares(&apart, &self.counts, &b.v)
    }
}

/// Sum of squares of the priors' rows.
fn prior_squares(fitted: &Fitted) -> f64 {
    fitted.options.priors.iter().map(|p| ((fitted.outcome.p[p.index] - p.mean) / p.sigma).powi(2)).sum()
}
