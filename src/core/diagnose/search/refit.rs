//! Full refits of the best candidates: what the score predicts is proved here.

use std::sync::OnceLock;

use crate::parallel;

use crate::effect::{Grid, Kind, Role, Sign};
use crate::identify::{FitOutcome, Monitor, Termination};
use crate::model::System;
use crate::residual::test_error;
use crate::response::Plan;

use super::candidates::{Name, Trial};
use super::score::{Score, Scores};
use super::secant::Secant;
use super::states::Wanted;
use super::step::promised;
use crate::diagnose::DiagnoseError;
use crate::diagnose::calibrate::case::{Case, Fitted};
use crate::diagnose::calibrate::weigh::Promised;
use crate::diagnose::results::SplitName;
use crate::diagnose::settings::Race;
use crate::diagnose::settings::Settings;

/// Residuals of one test, whitened.
pub type Whitened = Vec<Vec<f64>>;

/// A refitted candidate.
pub struct Refit {
    /// Index of the candidate.
    pub candidate: usize,
    /// Its best score.
    pub score: Score,
    /// The refitted system, or why there is none.
    pub result: Result<Proof, String>,
}

/// What a refit gave.
pub struct Proof {
    /// The fitted system.
    pub fitted: Fitted,
    /// Whitened residuals on the fit tests.
    pub fit: Whitened,
    /// Pooled relative error on the fit tests.
    pub error: f64,
    /// What it may come to under variances of its own, once that was looked at.
    pub stands: OnceLock<Result<Promised, String>>,
}

/// Best score of each candidate, in order.
pub fn best_per_candidate(scores: &[Score], trials: &[Trial]) -> Vec<Score> {
    let mut seen = std::collections::HashSet::new();
    scores.iter().filter(|s| s.drop > 0.0 && seen.insert(trials[s.trial].candidate)).copied().collect()
}

/// The candidate's instance with a start for its strength, everything of it free that is not fitted last, its shapes within reach of where they begin.
pub fn started(trial: &Trial, strength: f64, settings: &Settings) -> crate::model::Instance {
    let mut instance = trial.instance.clone();
    instance.follower = false;
    let info = instance.effect.info();
    for (value, p) in instance.params.iter_mut().zip(info.params) {
        // A setting that was tried as a start is fitted as well.
        let begun = matches!(p.grid, Grid::Elastic(_) if value.value > 0.0) || matches!(p.grid, Grid::Starts(_));
        if (p.kind == Kind::Shape && !p.grid.fitted_last(value.value)) || begun {
            value.free = true;
            (value.min, value.max) = (p.min.max(value.min), p.max.min(value.max));
            // Where a shape goes to in the end is no place to begin another fit's range about: from fit to fit a film's speed went to 1e-41 rad/s, a friction
            // that grows with the logarithm of speed.
            if p.sign == Sign::Positive && value.value > 0.0 {
                let reach = settings.race.shape_reach;
                (value.min, value.max) = (value.min.max(value.value / reach), value.max.min(value.value * reach));
            }
        }
    }
    let start = info.params[0].default + strength;
    // A gain must stay positive; other strengths with a sign were scored one-sided.
    instance.params[0].value = if info.role == Role::Channel && info.params[0].default == 1.0 {
        start.clamp(settings.race.gain_begins[0], settings.race.gain_begins[1])
    } else {
        start
    };
    instance
}

/// Whitened residuals of the given tests.
pub fn whitened(plans: &[&Plan], system: &System) -> Result<Whitened, String> {
    Ok(against(plans, system)?.0)
}

/// Whitened residuals of the given tests, and their pooled relative error.
fn against(plans: &[&Plan], system: &System) -> Result<(Whitened, f64), String> {
    let each = |plan: &&Plan| -> Result<(Vec<f64>, f64), String> {
        let values = plan.evaluate(system, &[], false).map_err(|e| e.to_string())?.values;
        Ok((plan.whitened(&values).as_slice().to_vec(), test_error(plan, &values).error))
    };
    let (rows, errors): (Whitened, Vec<f64>) = parallel::map(plans, each).into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    Ok((rows, (errors.iter().map(|e| e * e).sum::<f64>() / plans.len().max(1) as f64).sqrt()))
}

/// What is refitted, and how it is watched.
pub struct Bench<'a> {
    /// The case.
    pub case: &'a Case,
    /// The same as it is looked at ([`Case::coarser`]), where that is cheaper.
    pub rough: Option<&'a Case>,
    /// The case about the system without a candidate, where that is cheaper: by which a candidate that was no more than looked at is told.
    pub near: Option<&'a Case>,
    /// The fitted system without a candidate.
    pub base: &'a System,
    /// A candidate that stands there already, and the system with it: it begins there.
    pub stands: Option<(&'a Name, &'a System)>,
    /// Names of the candidates.
    pub names: &'a [Name],
    /// Their trials.
    pub trials: &'a [Trial],
    /// What these score.
    pub scores: &'a Scores,
    /// Laws over conditions as the states of these want them.
    pub wanted: &'a [Wanted],
    /// Where else its own parameters may stand when a candidate begins.
    pub elsewhere: &'a [System],
    /// `r'V^-1 r` of the base, by which a fall of the cost is counted in nats.
    pub squares: f64,
    /// Nats of a tie.
    pub tie: f64,
    /// Nats that a candidate may gain at most that has come to so many in the race...
    pub bound: &'a (dyn Fn(usize, f64) -> f64 + Sync),
    /// ...and those below which it is not worth a fit.
    pub least: &'a (dyn Fn(usize) -> f64 + Sync),
    /// Watch over the fits.
    pub monitor: &'a Monitor<'a>,
}

impl Bench<'_> {
    /// Constants of the race.
    pub(in crate::diagnose) fn race(&self) -> &Race {
        &self.case.search.settings.race
    }

    /// Refits the picked candidates, in parallel; the order of the list is kept. Each begins at the best of its shapes and goes on from the
    /// one that does best; then they race, and what can no longer come up with the best is shown as it is.
    /// `leader`: the best of earlier refits, which sets the measure.
    pub fn refit_all(&self, picked: &[Score], leader: Option<Leader>, watch: &(dyn Fn(&str) + Sync)) -> Vec<Refit> {
        // Which is worth it shows in coarser steps as well.
        let (look, whole) = (self.look(), self.unexplained());
        // By these tests each is told in the end.
        let mut seen = vec![self.case; picked.len()];
        let mut fitted = if self.rough.is_some() {
            // The way is gone where it is cheap; in all its steps, or about where it has led, only the end of it is.
            let unexplained = look.unexplained();
            let leader = leader.map(|l| Leader { cost: l.cost * unexplained / whole, ..l });
            let mut fitted = look.looks(picked, leader, unexplained, watch);
            look.run(picked, &mut fitted, (leader, unexplained), watch);
            look.moved_on(picked, &mut fitted, leader, watch);
            let may = look.may_lead(picked, &fitted, leader, unexplained);
            seen.iter_mut().zip(&may).filter(|(_, may)| !**may).for_each(|(case, _)| *case = self.near.unwrap_or(self.case));
            // What stays in the look has taken the part of the cost that it has taken there.
            let stays = |mut f: Fitted| {
                f.outcome.cost *= whole / unexplained;
                f.outcome.start_cost *= whole / unexplained;
                f
            };
            parallel::map_into(fitted, |k, l| l.and_then(|f| if may[k] { self.in_full(&picked[k], f) } else { Ok(stays(f)) }))
        } else {
            self.looks(picked, leader, whole, watch)
        };
        self.run(picked, &mut fitted, (leader, whole), watch);
        if self.rough.is_none() {
            self.moved_on(picked, &mut fitted, leader, watch);
        }
        parallel::map_into(fitted, |k, fitted| {
            let score = &picked[k];
            let candidate = self.trials[score.trial].candidate;
            let (name, result) = (&self.names[candidate], fitted.and_then(|f| proof(seen[k], f)));
            match &result {
                Ok(p) => watch(&format!("  refit {} at {}: cost {:.4e}", name.effect, name.at, p.fitted.outcome.cost)),
                // What was stopped has not failed.
                Err(_) if self.monitor.stops() => {}
                Err(e) => watch(&format!("  refit {} at {} failed: {e}", name.effect, name.at)),
            }
            Refit { candidate, score: *score, result }
        })
    }

    /// The bench on which candidates are looked at.
    fn look(&self) -> Self {
        Bench { case: self.rough.unwrap_or(self.case), rough: None, ..*self }
    }

    /// Refits from elsewhere, as they are looked at and then in full; none that does not better what stands. `least`: what the best refit leaves of the cost,
    /// with which it has to come up.
    pub fn bettered(&self, score: &Score, stands: &Fitted, start: System, least: f64) -> Option<Fitted> {
        let look = self.look();
        let here = if self.rough.is_some() { look.cost_at(&stands.system)? } else { stands.outcome.cost };
        let whole = look.unexplained().max(f64::MIN_POSITIVE);
        let may = |leg: &FitOutcome| look.may_come_up(score, (leg.start_cost / whole, leg.cost / whole), least);
        let found = look.moved(&start, here, &may).ok().filter(|f| f.outcome.cost < here)?;
        let found = if self.rough.is_some() { self.in_full(score, found).ok()? } else { found };
        (found.outcome.cost < stands.outcome.cost).then_some(found)
    }

    /// Cost of a system; none where it cannot be computed.
    pub fn cost_at(&self, system: &System) -> Option<f64> {
        whitened(&self.case.plans_of(SplitName::Fit), system).ok().map(|w| cost(&w))
    }

    /// A fit from here that goes on after a first look unless it has farther to go to what `stands` than it has come, and as long as it `may`.
    fn moved(&self, start: &System, stands: f64, may: &dyn Fn(&FitOutcome) -> bool) -> Result<Fitted, String> {
        let mut look = self.from(start, self.race().leg)?;
        let o = &look.outcome;
        if o.cost - stands >= o.start_cost - o.cost {
            return Ok(look);
        }
        for _ in 0..self.race().iterations / self.race().leg.max(1) {
            if look.outcome.termination != Termination::MaxIterations || !may(&look.outcome) {
                break;
            }
            look = self.go_on(look, self.race().leg)?;
        }
        Ok(look)
    }

    /// Nats of a refit that leaves this part of the cost.
    pub fn nats(&self, left: f64) -> f64 {
        promised(self.squares, 1.0 - left)
    }

    /// First looks at the picked candidates: each from some of its shapes, of which those go on that are level with its best, and the best of them in the end.
    fn looks(
        &self,
        picked: &[Score],
        leader: Option<Leader>,
        unexplained: f64,
        watch: &(dyn Fn(&str) + Sync),
    ) -> Vec<Result<Fitted, String>> {
        let race = self.race();
        let secants = parallel::map(picked, |best| self.secants(best, unexplained));
        let first = secants.iter().enumerate().flat_map(|(k, s)| s.iter().flatten().map(move |s| (k, &s.system)));
        let first: Vec<(usize, &System)> = first.collect();
        watch(&format!("looking at {} from {} starts", picked.len(), first.len()));
        let begun = parallel::map(&first, |(k, system)| (*k, self.from(system, race.tried)));
        let worth = |fits: &[(usize, Result<Fitted, String>)]| -> Vec<bool> {
            let mut least = vec![f64::INFINITY; picked.len()];
            fits.iter().for_each(|(k, f)| least[*k] = least[*k].min(cost_of(f)));
            let of = |(k, f): &(usize, Result<Fitted, String>)| {
                f.as_ref().is_ok_and(|f| is_level(f.outcome.start_cost, f.outcome.cost, least[*k], unexplained, race.level_with))
            };
            fits.iter().map(of).collect()
        };
        let gone_on = |fits: Vec<(usize, Result<Fitted, String>)>, iterations: u64| -> Vec<(usize, Result<Fitted, String>)> {
            let worth = worth(&fits);
            parallel::map_into(fits, |n, (k, f)| {
                let on = |f: Fitted| {
                    if worth[n] && follows(f.outcome.cost, leader, unexplained, race.following) { self.go_on(f, iterations) } else { Ok(f) }
                };
                (k, f.and_then(on))
            })
        };
        let tried = gone_on(gone_on(begun, race.choice.saturating_sub(race.tried)), race.leg);
        let failed = |s: &Result<Vec<Secant>, String>| Err(s.as_ref().err().cloned().unwrap_or_default());
        let mut looks: Vec<Result<Fitted, String>> = secants.iter().map(failed).collect();
        for (k, look) in tried {
            let better = match (&looks[k], &look) {
                (Ok(a), Ok(b)) => b.outcome.cost < a.outcome.cost,
                (Err(_), _) => true,
                (Ok(_), Err(_)) => false,
            };
            if better {
                looks[k] = look;
            }
        }
        looks
    }

    /// A refit in all its steps, or about where it stands, from where its way in the look has led. What cannot be computed there begins a part of the way
    /// there, and anew from the model itself.
    fn in_full(&self, score: &Score, look: Fitted) -> Result<Fitted, String> {
        let race = self.race();
        let from = |part: &f64| self.from(&self.part_of_the_way(&look.system, *part), race.leg);
        let led = race.parts.iter().map(from).find(|fit| fit.is_ok() || self.monitor.stops());
        let anew = || self.secant(&[*score], 0.0, false).and_then(|s| self.from(&s.system, race.leg));
        led.unwrap_or_else(anew).or(Ok(look))
    }

    /// Goes on with the refits that may yet lead, a leg at a time.
    fn run(
        &self,
        picked: &[Score],
        fitted: &mut [Result<Fitted, String>],
        (leader, unexplained): (Option<Leader>, f64),
        watch: &(dyn Fn(&str) + Sync),
    ) {
        for leg in 0..self.race().legs {
            let may = self.may_lead(picked, fitted, leader, unexplained);
            let open = |k: &usize| may[*k] && fitted[*k].as_ref().is_ok_and(|f| f.outcome.termination == Termination::MaxIterations);
            let open: Vec<usize> = (0..fitted.len()).filter(open).collect();
            if open.is_empty() || self.monitor.stops() {
                return;
            }
            if leg == 0 {
                let least = fitted.iter().map(cost_of).fold(f64::INFINITY, f64::min);
                watch(&format!("refitting {} of {} further: costs from {least:.4e}, {unexplained:.4e} before", open.len(), fitted.len()));
            }
            let further = parallel::map(&open, |k| fitted[*k].clone().and_then(|f| self.go_on(f, self.race().leg)));
            // A refit that fails farther on leaves what it has reached.
            open.into_iter().zip(further).filter(|(_, f)| f.is_ok()).for_each(|(k, f)| fitted[k] = f);
        }
    }

    /// Which refits may come up with the best.
    fn may_lead(&self, picked: &[Score], fitted: &[Result<Fitted, String>], leader: Option<Leader>, unexplained: f64) -> Vec<bool> {
        let whole = unexplained.max(f64::MIN_POSITIVE);
        let least = fitted.iter().map(cost_of).chain(leader.map(|l| l.cost)).fold(f64::INFINITY, f64::min) / whole;
        let of = |(score, f): (&Score, &Result<Fitted, String>)| {
            f.as_ref().is_ok_and(|f| self.may_come_up(score, (f.outcome.start_cost / whole, f.outcome.cost / whole), least))
        };
        picked.iter().zip(fitted).map(of).collect()
    }

    /// Whether a refit may come within a tie of the best, which leaves the part `least` of the cost, and pay for itself, at the rate of its last leg in so many
    /// more ([`Race::ahead`]). The leg led from one part of the cost to the other.
    fn may_come_up(&self, score: &Score, (before, now): (f64, f64), least: f64) -> bool {
        let then = ahead(self.nats(before), self.nats(now), self.race().ahead);
        let candidate = self.trials[score.trial].candidate;
        then >= self.nats(least) - self.tie && (self.bound)(candidate, then) >= (self.least)(candidate)
    }

    /// Fits from the starts of each and puts the best in its place where that lowers the cost by more than this part.
    pub fn exchange(&self, fitted: &mut [Result<Fitted, String>], starts: Vec<Vec<System>>, worth: f64) {
        let starts: Vec<(usize, System)> = starts.into_iter().enumerate().flat_map(|(k, s)| s.into_iter().map(move |s| (k, s))).collect();
        let stands: Vec<f64> = fitted.iter().map(cost_of).collect();
        let moved = parallel::map(&starts, |(k, system)| self.moved(system, stands[*k], &|_| true));
        for ((k, _), moved) in starts.iter().zip(moved) {
            if cost_of(&moved) < (1.0 - worth) * cost_of(&fitted[*k]) {
                fitted[*k] = moved;
            }
        }
    }

    /// The system at this part of the way from the model with its candidate at its null value to where it stands.
    fn part_of_the_way(&self, system: &System, part: f64) -> System {
        let mut there = system.clone();
        let base = self.base.instances.iter();
        let own = there.instances.iter_mut().zip(base).flat_map(|(i, b)| i.params.iter_mut().zip(b.params.iter().map(|p| p.value)));
        own.for_each(|(p, from)| p.value = from + part * (p.value - from));
        for instance in there.instances.iter_mut().skip(self.base.instances.len()) {
            let null = instance.effect.info().params[0].default;
            instance.params[0].value = null + part * (instance.params[0].value - null);
        }
        there
    }

    /// Cost of the model without a candidate.
    pub fn unexplained(&self) -> f64 {
        self.cost_at(self.base).unwrap_or(f64::INFINITY)
    }

    /// A fit from here.
    fn from(&self, system: &System, iterations: u64) -> Result<Fitted, String> {
        fit_some(self.about(system).as_ref().unwrap_or(self.case), system, iterations, self.monitor)
    }

    /// The case about where a refit stands, where one about the base is known: what stays is weighed about where it ends, until that moves it no more.
    fn about(&self, system: &System) -> Option<Case> {
        self.rough.and(self.near).and_then(|_| self.case.expanded(system))
    }

    /// More iterations for what has used up its own.
    fn go_on(&self, fitted: Fitted, iterations: u64) -> Result<Fitted, String> {
        if fitted.outcome.termination != Termination::MaxIterations {
            return Ok(fitted);
        }
        if self.rough.and(self.near).is_some() {
            return self.from(&fitted.system, iterations);
        }
        ended(self.case.coarsely(iterations).go_on(fitted, self.case.plans_of(SplitName::Fit), &self.monitor.quiet()))
    }
}

/// What comes after `now` in so many more legs at the rate of the one that came from `before`.
fn ahead(before: f64, now: f64, legs: f64) -> f64 {
    now + legs * (now - before)
}

/// Cost of a refit; infinite where there is none.
pub fn cost_of(fitted: &Result<Fitted, String>) -> f64 {
    fitted.as_ref().map_or(f64::INFINITY, |f| f.outcome.cost)
}

/// Whether a start of a candidate whose best start has come to `least` is worth going on with: it has gained nearly as much of what is
/// `unexplained`, or has no farther to go to there than it has come. A start in the right valley may begin above all the others.
fn is_level(start: f64, cost: f64, least: f64, unexplained: f64, level_with: f64) -> bool {
    cost <= least || unexplained - cost >= level_with * (unexplained - least) || cost - least <= start - cost
}

/// What earlier refits have come to.
#[derive(Clone, Copy)]
pub struct Leader {
    /// Cost of the best of them.
    pub cost: f64,
    /// Its predicted drop.
    pub drop: f64,
}

/// Whether a candidate has fallen at all beside the best of earlier refits.
fn follows(cost: f64, leader: Option<Leader>, unexplained: f64, following: f64) -> bool {
    leader.is_none_or(|l| unexplained - cost >= following * (unexplained - l.cost))
}

fn fit_some(case: &Case, system: &System, iterations: u64, monitor: &Monitor) -> Result<Fitted, String> {
    ended(case.coarsely(iterations).fit_system(system, case.plans_of(SplitName::Fit), &monitor.quiet()))
}

/// A fit that ended without a failure of the model.
fn ended(fitted: Result<Fitted, DiagnoseError>) -> Result<Fitted, String> {
    let fitted = fitted.map_err(|e| e.to_string())?;
    match &fitted.outcome.termination {
        Termination::Failed(reason) => Err(reason.clone()),
        _ => Ok(fitted),
    }
}

/// Fits a system in full.
pub fn prove(case: &Case, system: &System, monitor: &Monitor) -> Result<Proof, String> {
    proof(case, fit_some(case, system, case.search.settings.race.iterations, monitor)?)
}

/// A fitted system held against the fit tests.
pub fn proof(case: &Case, fitted: Fitted) -> Result<Proof, String> {
    let (fit, error) = against(&case.plans_of(SplitName::Fit), &fitted.system)?;
    Ok(Proof { fitted, fit, error, stands: OnceLock::new() })
}

/// Half the sum of squares.
pub fn cost(w: &Whitened) -> f64 {
    0.5 * w.iter().flatten().map(|r| r * r).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_that_falls_from_above_to_the_best_is_gone_on_with() {
        // What study 05 did with a film at its shelf: the start in the right valley began above the model without a film.
        assert!(is_level(4003.0, 3639.0, 3446.0, 3457.0, 0.8) && is_level(4003.0, 3435.0, 3421.0, 3457.0, 0.8));
        assert!(
            !is_level(3700.0, 3639.0, 3446.0, 3457.0, 0.8)
                && is_level(3457.0, 3448.0, 3446.0, 3457.0, 0.8)
                && !is_level(3457.0, 3454.0, 3446.0, 3457.0, 0.8)
        );
    }

    #[test]
    fn a_candidate_has_shapes_within_reach_of_where_they_begin() {
        use crate::effect::find;
        use crate::model::{Instance, ParamValue, Site};
        let film = find("film").unwrap();
        let mut params = [0.0, 0.3, 2e-5].map(ParamValue::fixed).to_vec();
        params[0] = ParamValue::free(0.0, Sign::NonNegative);
        let trial = Trial { instance: Instance::new(film, "c1.x", Site::Places(vec![0]), params), candidate: 0 };
        let settings = Settings::default();
        let begun = started(&trial, 5.0, &settings);
        let reach = settings.race.shape_reach;
        assert_eq!((begun.params[0].value, begun.params[0].min), (5.0, 0.0), "a strength has the bounds of its law");
        assert!(begun.params[1].free);
        assert_eq!((begun.params[1].min, begun.params[1].max), (0.3 / reach, 0.3 * reach));
    }

    #[test]
    fn what_a_leader_has_taken_is_the_measure_of_a_first_look() {
        assert!(follows(900.0, None, 1000.0, 0.05) && follows(900.0, Some(Leader { cost: 100.0, drop: 0.0 }), 1000.0, 0.05));
        assert!(!follows(960.0, Some(Leader { cost: 100.0, drop: 0.0 }), 1000.0, 0.05));
    }
}
