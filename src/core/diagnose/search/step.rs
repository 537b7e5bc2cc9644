//! One step of the search: score everything, refit the best, weigh them, take what gains most.

use crate::effect::{Role, find};
use crate::evidence::Variances;
use crate::identify::Monitor;
use crate::model::System;
use crate::parallel;

use super::candidates::{Name, Scene, Trial, candidates};
use super::listed::{Listed, Raced, visible};
use super::pairs::in_pairs;
use super::picks;
use super::refit::{Bench, Leader, Refit, best_per_candidate};
use super::score::{Score, Scores, in_time, score};
use super::states::{self, Wanted};
use super::survivors::{Held, Survivors};
use crate::diagnose::calibrate::case::Case;
use crate::diagnose::calibrate::weigh::{Scale, Weighed};
use crate::diagnose::results::Reason;
use crate::diagnose::results::{Candidate, Effort, SecondOpinion, SplitName};
use crate::diagnose::{DiagnoseError, trace};

/// A candidate that was weighed.
pub struct Stood {
    /// Its name.
    pub name: Name,
    /// The model with it.
    pub weighed: Weighed,
    /// Nats that it gains beyond its price.
    pub gain: f64,
    /// Whether it may be taken.
    pub admissible: bool,
}

/// What is added.
#[derive(Clone)]
pub struct Move {
    /// One effect or two.
    pub names: Vec<Name>,
    /// The model with them.
    pub weighed: Weighed,
    /// Nats beyond their price.
    pub gain: f64,
}

/// What one step found.
#[derive(Default)]
pub struct Step {
    /// Every candidate, best first.
    pub candidates: Vec<Candidate>,
    /// What all candidates at once say.
    pub second_opinion: SecondOpinion,
    /// Those that were weighed, the most worth first.
    pub stood: Vec<Stood>,
    /// What gains most, if anything does.
    pub taken: Option<Move>,
    /// What it took.
    pub effort: Effort,
    /// Name and visible strength of each candidate.
    pub visible: Vec<(Name, f64)>,
    /// Nats that each candidate may add at most, by its score.
    pub promises: Vec<(Name, f64)>,
    /// Independent candidates that it tried.
    pub tried: f64,
    /// Whether the time for refits ended before they did: what was not found says nothing then.
    pub cut: bool,
}

/// What a step weighs against.
pub struct Against<'a> {
    /// The tests and what they count as.
    pub scale: &'a Scale,
    /// The model without a candidate.
    pub base: &'a Weighed,
    /// Nats that a candidate must gain on that to be of interest, where that is not its price: what stands in its place gains so much.
    pub need: Option<f64>,
    /// Nats beyond that which it must gain to come up with what else there is.
    pub beyond: f64,
    /// What stands in its place, and the model with it, its effect the last.
    pub stands: Option<(&'a Name, &'a System)>,
    /// Nats that something else than a candidate gains here: where the simplest candidates gain less by a tie, no others are refitted.
    pub rival: Option<f64>,
    /// Where else its own parameters may stand when a candidate begins.
    pub elsewhere: &'a [System],
    /// What was added: no law acts twice, and one friction with memory at a place.
    pub added: Vec<&'a Name>,
    /// Watch over the fits.
    pub monitor: &'a Monitor<'a>,
    /// Lines of progress.
    pub watch: &'a (dyn Fn(&str) + Sync),
}

impl Against<'_> {
    /// Odds, before any test is read, that there is something to be found.
    pub fn odds(&self) -> f64 {
        if self.need.is_none() { self.scale.odds(self.added.len(), self.base) } else { 1.0 }
    }
}

/// Scores, refits, weighs.
pub fn step(a: &Against) -> Result<Step, DiagnoseError> {
    let (scale, base, watch) = (a.scale, a.base, a.watch);
    let system = &base.fitted.system;
    let Survey { loose, squares, race, names, trials, scores, mut effort } = survey(a)?;
    let under = |near: Scale| near.under(&base.seen, &loose, &scale.evidence.independent());
    let near = scale.about(system).map(|near| Case { worth: race.worth, ..under(near) });
    let best = best_per_candidate(&scores.list, &trials);
    let price = Price::new(a, &names, squares, &scores);
    let (hopeful, wanted, picked) = picked(a, &price, (&best, &trials, &scores), near.as_ref().unwrap_or(&race));
    let hurried = a.monitor.hurried(scale.settings.race.share);
    let (gains, least) = (|candidate: usize, nats: f64| price.factor(candidate) * nats, |candidate: usize| price.least(candidate));
    let rough = if picked.is_empty() { None } else { race.coarser(near.clone()) };
    let bench = Bench {
        case: &race,
        rough: rough.as_ref(),
        near: near.as_ref(),
        stands: a.stands,
        base: system,
        names: &names,
        trials: &trials,
        scores: &scores,
        wanted: &wanted,
        elsewhere: a.elsewhere,
        squares,
        tie: scale.settings.tie,
        bound: &gains,
        least: &least,
        monitor: &hurried,
    };
    let started = std::time::Instant::now();
    let cost = bench.unexplained();
    let held = Held { against: a, names: &names, price: &price, cost, from: &loose };
    // What could stand in the place of an effect is looked for among everything there.
    let stands = |refits: &[Refit]| a.need.is_some() || Survivors { held: &held, refits }.any_may_gain();
    let refits = parallel::watched(&hurried.watch(), || refitted(&bench, &hopeful, &picked, cost, &|r| held.beaten(r), &stands, watch));
    // What stands is known already: in the race it is what others are held against.
    let refits: Vec<Refit> = refits.into_iter().filter(|r| a.stands.is_none_or(|(name, _)| names[r.candidate] != *name)).collect();
    let cut = trace::stopped(&hurried);
    (effort.refits, effort.refits_s) = (refits.len(), started.elapsed().as_secs_f64());
    watch(&format!("weighing {} refits", refits.len()));
    let (stood, mut reasons) = Survivors { held: &held, refits: &refits }.weighed(cut);
    let mut because = |of: &[Name], reason: Reason| {
        refits.iter().zip(&mut reasons).filter(|(r, _)| of.contains(&names[r.candidate])).for_each(|(_, w)| *w = reason.clone());
    };
    let mut taken = alone(a, &stood, &mut because);
    // That none gains alone is not known of a race that was cut.
    if taken.is_none() && a.need.is_none() && !cut {
        taken = in_pairs(a, &stood, &bench, price.physics, picks::pair(&hopeful, &scores.selected, &names, &trials, bench.race()));
        if let Some(pair) = &taken {
            because(&pair.names, Reason::InPair { nats: pair.gain });
        }
    }
    let listed = Listed { names: &names, trials: &trials, selected: &scores.selected, error: error_of(scale, base) };
    let raced = Raced { refits: &refits, reasons: &reasons, stood: &stood, taken: taken.as_ref() };
    let (candidates, second_opinion) = listed.all(&raced, &best, scale, &price);
    let visible = visible(&scores.list, &names, &trials);
    let promise = |s: &Score| (names[trials[s.trial].candidate].clone(), price.bound(trials[s.trial].candidate, s.drop));
    let promises = best.iter().map(promise).collect();
    Ok(Step { candidates, second_opinion, stood, taken, effort, visible, promises, tried: price.all, cut })
}

/// Of the best scores of candidates those that may come to their price, what states of the conditions want of laws over them, and which of both are refitted first.
fn picked(
    a: &Against,
    price: &Price,
    (best, trials, scores): (&[Score], &[Trial], &Scores),
    race: &Case,
) -> (Vec<Score>, Vec<Wanted>, Vec<Score>) {
    let off = price.slopes_are_off(best, trials);
    let hopes = |trial: usize, drop: f64| {
        let candidate = trials[trial].candidate;
        off * price.bound(candidate, drop) >= price.least(candidate)
    };
    let hopeful: Vec<Score> = best.iter().filter(|s| hopes(s.trial, s.drop)).copied().collect();
    let wanted = states::wanted(a.scale, race, a.base, trials, a.monitor);
    let wanted: Vec<Wanted> = wanted.into_iter().filter(|w| hopes(w.trial, w.drop)).collect();
    if trace::stopped(a.monitor) {
        return (hopeful, wanted, vec![]);
    }
    let bound = |s: &Score| price.bound(trials[s.trial].candidate, s.drop);
    let first = picks::first(&hopeful, &wanted, &scores.selected, bound, trials, &a.scale.settings);
    (hopeful, wanted, first)
}

/// Which of these, each with its gain and its parameters, is taken: what gains most, or the smallest at its place that gains as much within a tie. A larger law
/// may be at the end of its range, where it says what a smaller one does.
fn choice(offers: &[(&Name, f64, usize)], tie: f64) -> Option<usize> {
    let (most, gain, _) = offers.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let alike = |o: &(&Name, f64, usize)| (&o.0.at, &o.0.of) == (&most.at, &most.of) && o.1 >= gain - tie && (o.1 > 0.0 || o.1 == *gain);
    let order = |a: &usize, b: &usize| offers[*a].2.cmp(&offers[*b].2).then(offers[*b].1.total_cmp(&offers[*a].1));
    (0..offers.len()).filter(|k| alike(&offers[*k])).min_by(order)
}

/// What [`choice`] takes of the candidates, if the fitted tests in turn bear it out where it gains little.
fn alone(a: &Against, stood: &[Stood], because: &mut impl FnMut(&[Name], Reason)) -> Option<Move> {
    let able: Vec<&Stood> = stood.iter().filter(|s| s.admissible && a.need.is_none()).collect();
    let offers: Vec<(&Name, f64, usize)> = able.iter().map(|s| (&s.name, s.gain, s.weighed.size())).collect();
    let best = able[choice(&offers, a.scale.settings.tie)?];
    let (names, better) = (vec![best.name.clone()], a.scale.better(best.gain, &best.weighed, a.base, a.monitor));
    if let Some(turns) = better.turns {
        because(&names, Reason::InTurn { nats: best.gain, turns });
    }
    better.yes.then(|| Move { names, weighed: best.weighed.clone(), gain: best.gain })
}

/// Every candidate with its score.
pub(in crate::diagnose) struct Survey {
    /// Variances of the model without them where strengths do not scatter.
    loose: Variances,
    /// Its squares under these.
    pub squares: f64,
    /// The case under them, every coefficient a datum.
    race: Case,
    /// Candidates.
    pub names: Vec<Name>,
    /// Their shapes.
    pub trials: Vec<Trial>,
    /// What these score.
    pub scores: Scores,
    effort: Effort,
}

/// Scores every candidate.
pub(in crate::diagnose) fn survey(a: &Against) -> Result<Survey, DiagnoseError> {
    let (scale, base) = (a.scale, a.base);
    in_time()?;
    // Refits race under the variances of the model without them where strengths do not scatter, every coefficient a datum.
    let loose = scale.evidence.estimate_without_scatter(&base.seen, &scale.counts, &base.v);
    let squares = scale.evidence.squares(&base.seen, &scale.counts, &loose);
    let independent = scale.evidence.independent();
    // A datum is a part of a fact here, and the cost is counted in data.
    let worth = scale.settings.settled * scale.evidence.independent_facts(&independent, &loose) / scale.counts.n;
    let race = Case { worth: Some(worth), ..scale.under(&base.seen, &loose, &independent) };
    let plans = race.plans_of(SplitName::Fit);
    let system = &base.fitted.system;
    let all = candidates(&race, system, &plans, &Scene::new(&plans, system));
    in_time()?;
    let (names, trials) = once(all, &a.added);
    (a.watch)(&format!("scoring {} effects at places, {} shapes", names.len(), trials.len()));
    let started = std::time::Instant::now();
    let scores = scored(&race, base, &trials)?;
    (a.watch)(&format!("these effects are as much of a choice as {:.0} that have nothing in common", scores.independent));
    let effort = Effort { trials: trials.len(), score_s: started.elapsed().as_secs_f64(), ..Effort::default() };
    Ok(Survey { loose, squares, race, names, trials, scores, effort })
}

/// The candidates that do not say again what an addition says: the same law at its place, or another friction with memory there, of which any
/// sum of two is one with a softer knee.
fn once((names, trials): (Vec<Name>, Vec<Trial>), added: &[&Name]) -> (Vec<Name>, Vec<Trial>) {
    let remembers = |n: &Name| n.params_with_memory().is_some();
    let said = |n: &Name| added.iter().any(|a| a.at == n.at && a.of == n.of && (a.effect == n.effect || (remembers(a) && remembers(n))));
    let mut kept = vec![None; names.len()];
    let mut left = Vec::new();
    for (k, name) in names.into_iter().enumerate().filter(|(_, n)| !said(n)) {
        kept[k] = Some(left.len());
        left.push(name);
    }
    let trials = trials.into_iter().filter_map(|t| Some(Trial { candidate: kept[t.candidate]?, ..t })).collect();
    (left, trials)
}

fn scored(race: &Case, base: &Weighed, trials: &[Trial]) -> Result<Scores, DiagnoseError> {
    let f = &base.fitted;
    let priors: Vec<_> = f.options.priors.iter().map(|p| (p.index, p.mean, p.sigma)).collect();
    score(&race.plans_of(SplitName::Fit), &f.system, trials, &f.inside(), &priors, race.seed, &race.search.settings.scoring)
}

/// What a candidate has to gain, and what it promises.
pub(in crate::diagnose) struct Price<'a> {
    against: &'a Against<'a>,
    names: &'a [Name],
    /// `r'V^-1 r` of the model without a candidate.
    pub squares: f64,
    physics: f64,
    all: f64,
}

impl<'a> Price<'a> {
    pub fn new(against: &'a Against, names: &'a [Name], squares: f64, scores: &Scores) -> Self {
        let channel = |n: &&Name| role(n) == Some(Role::Channel);
        let physics = names.iter().filter(|n| !channel(n)).count();
        // Candidates that say the same are one choice.
        let count = |names: usize, independent: f64| independent.min(names as f64).max(1.0);
        let (physics, all) = (count(physics, scores.independent_physics), count(names.len(), scores.independent));
        Price { against, names, squares, physics, all }
    }

    /// What was tried where this candidate was, against the odds that there is something to be found. A fault of an instrument counts as more choices, by the
    /// odds against it before any test is read.
    pub fn tried(&self, candidate: usize) -> f64 {
        let fault = role(&self.names[candidate]) == Some(Role::Channel);
        choices(fault, (self.physics, self.all), self.against.scale.settings.fault_odds) / self.against.odds()
    }

    pub fn price(&self, candidate: usize) -> f64 {
        let own = || 0.5 * self.against.scale.counts.n.ln() + self.tried(candidate).ln();
        self.against.need.unwrap_or_else(own) + self.against.beyond
    }

    /// A bound on the gain of what takes this part of the cost away: with the variances as they are, or with a model error that falls with the
    /// residual.
    pub fn bound(&self, candidate: usize, drop: f64) -> f64 {
        self.factor(candidate) * promised(self.squares, drop)
    }

    /// How much more than its slope, or than its race, promises a candidate may gain.
    fn factor(&self, candidate: usize) -> f64 {
        let s = &self.against.scale.settings;
        if role(&self.names[candidate]) == Some(Role::Series) { s.promise_series } else { s.promise }
    }

    /// Nats below which a candidate is not worth a fit.
    fn least(&self, candidate: usize) -> f64 {
        self.price(candidate) - self.against.scale.settings.tie
    }

    /// Whether what takes this part of the cost away in the race may be worth a fit under variances of its own.
    pub fn promises(&self, candidate: usize, drop: f64) -> bool {
        self.bound(candidate, drop) >= self.least(candidate)
    }

    /// The factor by which what stands gained more than its slope promises here, where it did: a slope at strength zero says little of a friction
    /// that sticks throughout, and no more of another one in its place.
    fn slopes_are_off(&self, best: &[Score], trials: &[Trial]) -> f64 {
        let stands = |s: &&Score| self.against.stands.is_some_and(|(name, _)| *name == self.names[trials[s.trial].candidate]);
        let bound = best.iter().find(stands).map(|s| (trials[s.trial].candidate, self.bound(trials[s.trial].candidate, s.drop)));
        bound.map_or(1.0, |(own, bound)| off(self.price(own) - self.against.beyond, bound))
    }

    pub fn left_out(&self, candidate: usize, drop: f64) -> Reason {
        if self.promises(candidate, drop) {
            return Reason::NotTried;
        }
        Reason::Hopeless { bound: self.bound(candidate, drop), price: self.price(candidate) }
    }
}

/// Choices that a fault of an instrument stands among, or an effect: independent ones of the physics, and of all that is tried.
fn choices(fault: bool, (physics, all): (f64, f64), fault_odds: f64) -> f64 {
    if fault { all * fault_odds } else { physics }
}

/// By how much more a law gained than its slope promised; 1 where it gained no more.
fn off(gained: f64, promised: f64) -> f64 {
    (gained / promised.max(f64::MIN_POSITIVE)).max(1.0)
}

/// Nats that the fall of a sum of squares `q` by this part is worth at most.
pub(in crate::diagnose) fn promised(q: f64, drop: f64) -> f64 {
    let drop = drop.clamp(0.0, 1.0 - f64::EPSILON);
    0.5 * q * drop.max(-(1.0 - drop).ln())
}

pub(in crate::diagnose) fn role(name: &Name) -> Option<Role> {
    find(name.effect).ok().map(|e| e.info().role)
}

/// Refits of what was picked, of what these suggest, and from where laws of their kind stand; the cheapest first. Of laws of one kind at one place the
/// simplest goes first, and the others follow where it leads and is not `beaten`. A race takes what strengths scatter for error, and something always leads
/// it: where under its own variances none of what was picked may gain (`stands`), it suggests nothing.
fn refitted(
    bench: &Bench,
    hopeful: &[Score],
    picked: &[Score],
    cost: f64,
    beaten: &dyn Fn(&Refit) -> bool,
    stands: &dyn Fn(&[Refit]) -> bool,
    watch: &(dyn Fn(&str) + Sync),
) -> Vec<Refit> {
    if picked.is_empty() {
        return vec![];
    }
    let (simple, richer) = picks::by_kind(picked, hopeful, bench.names, bench.trials);
    watch(&format!("refitting the best {}", simple.len()));
    let mut refits = bench.refit_all(&simple, None, watch);
    sort(&mut refits);
    if refits.first().is_some_and(beaten) {
        return refits;
    }
    let stands = trace::stopped(bench.monitor) || stands(&refits);
    let leads = refits.first().and_then(|r| r.result.as_ref().ok()).map(|p| p.fitted.outcome.cost);
    let leader = leads.map(|cost| Leader { cost, drop: refits[0].score.drop });
    let explained = leads.is_some_and(|c| c < bench.race().explained * cost);
    let mut further = picks::second(hopeful, &refits, (stands, explained), cost, bench.names, bench.trials, bench.race());
    let new = picks::following(&richer, &refits, stands, cost, bench.race());
    further.extend(
        new.into_iter()
            .filter(|s| !further.iter().any(|f| bench.trials[f.trial].candidate == bench.trials[s.trial].candidate))
            .collect::<Vec<_>>(),
    );
    if !(further.is_empty() || trace::stopped(bench.monitor)) {
        watch(&format!("refitting {} more", further.len()));
        // Where the base of what leads is known, its kin needs no other.
        let there = Bench { elsewhere: if stands && leader.is_some() { &[] } else { bench.elsewhere }, ..*bench };
        refits.extend(there.refit_all(&further, leader, watch));
        sort(&mut refits);
    }
    if stands {
        bench.begin_at_kin(&mut refits, cost, watch);
        sort(&mut refits);
    }
    refits
}

/// Best first by its cost; failures last.
fn sort(refits: &mut [Refit]) {
    let key = |r: &Refit| r.result.as_ref().map_or(f64::INFINITY, |p| p.fitted.outcome.cost);
    refits.sort_by(|a, b| key(a).total_cmp(&key(b)).then(b.score.drop.total_cmp(&a.score.drop)));
}

/// Pooled relative error of a model on the fitted tests.
pub fn error_of(scale: &Scale, w: &Weighed) -> f64 {
    let all: Vec<f64> = w.seen.iter().enumerate().map(|(t, s)| scale.error(t, s)).collect();
    (all.iter().map(|e| e * e).sum::<f64>() / all.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_law_is_looked_for_twice() {
        let name = |effect: &'static str, at: &str| Name { effect, at: at.into(), of: None };
        let names = vec![name("coulomb", "c1.x"), name("bouc_wen", "c1.x"), name("bouc_wen", "c2.x"), name("elastic_slip", "c1.x")];
        let (left, trials) = once((names, vec![]), &[&name("elastic_slip", "c1.x")]);
        assert_eq!(left, [name("coulomb", "c1.x"), name("bouc_wen", "c2.x")]);
        assert!(trials.is_empty());
    }

    #[test]
    fn within_a_tie_the_smaller_law_at_a_place_is_taken() {
        let name = |effect: &'static str, at: &str| Name { effect, at: at.into(), of: None };
        let (film, slip, far) = (name("film", "c1.x"), name("elastic_slip", "c1.x"), name("coulomb", "c2.x"));
        // As study 06 has it: a film whose speed has gone to nothing, half a nat ahead of the elastic slip that is hidden.
        assert_eq!(choice(&[(&film, 164.7, 15), (&slip, 164.2, 14), (&far, 164.6, 13)], 1.5), Some(1));
        assert_eq!(choice(&[(&film, 166.7, 15), (&slip, 164.2, 14)], 1.5), Some(0), "beyond a tie the likelier one");
        // What does not pay for itself takes no place, and of what does not at all the first stays the first.
        assert_eq!(choice(&[(&film, 0.5, 15), (&slip, -0.3, 14)], 1.5), Some(0));
        assert_eq!(choice(&[(&film, -0.5, 15), (&slip, -0.7, 14)], 1.5), Some(0));
        assert_eq!(choice(&[], 1.5), None);
    }

    #[test]
    fn a_fault_of_an_instrument_pays_for_everything_that_was_tried_and_for_the_odds_against_it() {
        let independent = (9.0, 12.0);
        let nats = |fault| choices(fault, independent, 20.0).ln();
        approx::assert_relative_eq!(nats(true) - nats(false), (20.0 * 12.0 / 9.0f64).ln(), max_relative = 1e-12);
    }

    #[test]
    fn slopes_are_off_by_what_was_gained_beyond_them() {
        assert_eq!((off(137.0, 33.0), off(20.0, 33.0)), (137.0 / 33.0, 1.0));
        // A slope of zero promises nothing: whatever stands opposite is looked at.
        assert!(off(137.0, 0.0) > 1e100);
    }

    #[test]
    fn a_promise_is_the_larger_of_the_fall_and_of_a_falling_variance() {
        // 16 facts of which 43 % fall: 8 ln(1 / 0.57).
        approx::assert_relative_eq!(promised(16.0, 0.43), -8.0 * 0.57f64.ln(), max_relative = 1e-12);
        assert_eq!(promised(16.0, 0.0), 0.0);
        assert!(promised(16.0, 1.0).is_finite());
    }
}
