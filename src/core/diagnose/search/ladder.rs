//! The ladder: score, weigh, add, take out, exchange, until nothing gains more than it costs; then the held-out tests have the last word.

use crate::effect::Dim;
use crate::identify::Monitor;
use crate::model::System;
use crate::parallel;
use crate::response::Plan;

use super::candidates::Name;
use super::climb::Climb;
use super::held_out::HeldOutTests;
use super::righted::{drifting, phased, righted, unclipped};
use super::step::Step;
use super::unexplained::unexplained;
use super::verdict::{Grounds, Judged, judged};
use crate::diagnose::calibrate::case::Case;
use crate::diagnose::calibrate::compare::compare;
use crate::diagnose::calibrate::findings::{findings, unsettled};
use crate::diagnose::calibrate::fit::{Began, begin, effects, fit, parameters};
use crate::diagnose::calibrate::weigh::Weighed;
use crate::diagnose::results::*;
use crate::diagnose::{DiagnoseError, trace};

type Watch<'a> = &'a (dyn Fn(&str) + Sync);

const SEEN: [SplitName; 2] = [SplitName::Fit, SplitName::Select];

/// Fits, finds where the model fails, and weighs what could be missing.
pub fn diagnose(case: &Case, monitor: &Monitor, watch: Watch) -> Result<(FitResult, Diagnosis), DiagnoseError> {
    let started = std::time::Instant::now();
    let (case, fitted, result) = fit(case, &SEEN, monitor)?;
    let mut climb = Climb::new(&case, &fitted, monitor, watch)?;
    let step = parallel::watched(&monitor.watch(), || {
        let mut step = climb.step()?;
        if climb.slacken(&step) {
            step = climb.step()?;
        }
        if let Some(taken) = &step.taken {
            climb.add(taken, &step);
        }
        Ok::<_, DiagnoseError>(step)
    });
    let step = match step {
        Err(_) if trace::stopped(monitor) => Step::default(),
        found => found?,
    };
    let stopped = trace::stopped(monitor);
    let verdict = match climb.grounds(None, stopped) {
        _ if step.taken.is_some() => Verdict::Missing,
        grounds => judged(&grounds, &climb.settings).verdict,
    };
    let missing = climb.added.iter().map(|a| EffectAt::from(&a.name)).collect();
    let would = if verdict == Verdict::NothingMissing { detectable(&case, &fitted.system, &step.visible) } else { vec![] };
    let formula = if verdict == Verdict::Unexplained { climb.suggestion(&climb.first) } else { None };
    let (next_test, no_next_test) = climb.next_test(started);
    Ok((
        result,
        Diagnosis {
            findings: all_findings(&case, &fitted.system, &monitor.watch())?,
            candidates: step.candidates,
            second_opinion: step.second_opinion,
            verdict,
            missing,
            next_test,
            no_next_test,
            unexplained: formula,
            would_have_been_seen: would,
        },
    ))
}

/// The strength of each candidate that would have been seen, in its unit.
fn detectable(case: &Case, system: &System, visible: &[(Name, f64)]) -> Vec<String> {
    let line = |(n, v): &(Name, f64)| {
        let (unit, factor) = strength_unit(case, system, n);
        format!("{} at {}: {:.2e} {unit}", n.effect, n.at, v / factor)
    };
    visible.iter().map(line).collect()
}

/// Unit of a candidate's strength with its value in SI.
pub(in crate::diagnose) fn strength_unit(case: &Case, system: &System, name: &Name) -> (String, f64) {
    let place = system.model.places_at(&name.at).ok().and_then(|p| p.first().copied());
    let rotational = place.is_some_and(|p| system.model.places[p].axis.rotational());
    let dim = crate::effect::find(name.effect).ok().and_then(|e| e.info().params.first()).map(|p| p.dim);
    let channel = || {
        let (test, role) = name.at.rsplit_once('.')?;
        let mut blocks = case.plans.iter().filter(|(p, _)| test == "*" || p.id == test).flat_map(|(p, _)| &p.blocks);
        blocks.find(|b| b.role == role).map(|b| (b.stated.symbol.clone(), b.stated.factor))
    };
    match dim {
        Some(Dim::Channel) => channel().unwrap_or((String::new(), 1.0)),
        Some(Dim::ChannelPerTime) => channel().map_or(("1/s".into(), 1.0), |(unit, factor)| (format!("{unit}/s"), factor)),
        Some(dim) => dim.practical(rotational),
        None => (String::new(), 1.0),
    }
}

/// What stands out in the tests that were seen, largest first. Whether a loop has settled by the model asks for a march from rest of its own, which is left out once
/// `watch` has ended.
fn all_findings(case: &Case, system: &System, watch: &parallel::Watch) -> Result<Vec<Finding>, DiagnoseError> {
    let found = |(plan, _): &&(Plan, SplitName)| -> Result<Vec<Finding>, DiagnoseError> {
        let told = &case.search.settings.telling;
        let mut list = findings(plan, &plan.evaluate(system, &[], false)?.values, told);
        list.extend(parallel::watched(watch, || unsettled(plan, system, told.transient)));
        Ok(list)
    };
    let seen: Vec<&(Plan, SplitName)> = case.plans.iter().filter(|(_, split)| *split != SplitName::HeldOut).collect();
    let mut list: Vec<Finding> = parallel::map(&seen, found).into_iter().collect::<Result<Vec<_>, _>>()?.concat();
    list.extend(case.of_data.iter().cloned());
    list.sort_by(|a, b| b.number.abs().total_cmp(&a.number.abs()));
    Ok(list)
}

/// Root mean square over held-out tests.
fn pooled(tests: &[TestResult], pick: impl Fn(&TestResult) -> f64) -> Option<f64> {
    let held: Vec<f64> = tests.iter().filter(|t| t.split == SplitName::HeldOut).map(pick).collect();
    (!held.is_empty()).then(|| (held.iter().map(|e| e * e).sum::<f64>() / held.len() as f64).sqrt())
}

/// Why a climb ends.
enum End {
    /// Nothing gains more than it costs.
    NothingGains,
    /// As many effects as may be added.
    Full,
    /// It was stopped.
    Stopped,
    /// The next step cannot be computed.
    Cannot(String),
}

impl End {
    fn describe(&self, climb: &Climb) -> String {
        match self {
            End::NothingGains => "no candidate gains more than its parameters and the search for it cost".into(),
            End::Full => format!("{} effects were added, and {} is the limit", climb.effects(), climb.settings.max_added),
            End::Stopped if climb.added.is_empty() => "it was interrupted before an effect was added; more may be missing".into(),
            End::Stopped => "it was interrupted after these effects were added; more may be missing".into(),
            End::Cannot(why) => format!("what else is missing could not be looked for: {why}"),
        }
    }
}

/// Climbs. The held-out tests are computed once, at the end, for the first and the last model. With a journal in the monitor every fit that has ended is
/// kept, and one that an earlier climb has made is answered from it, so that a climb that was stopped or killed is climbed again to where it was cut off in
/// little time and ends as an undisturbed one does.
pub fn ladder(case: &Case, monitor: &Monitor, watch: Watch) -> Result<(LadderResult, System), DiagnoseError> {
    // What is given a share of the time spent so far counts that of the earlier climb.
    let now = std::time::Instant::now();
    let started = now.checked_sub(monitor.spent()).unwrap_or(now);
    let (mut climb, mut rungs) = at_the_foot(case, monitor, watch)?;
    let mut visible = Vec::new();
    let end = loop {
        if trace::stopped(monitor) {
            break End::Stopped;
        }
        if climb.effects() >= climb.settings.max_added || rungs.len() > 2 * climb.settings.max_added {
            climb.exchange(&mut rungs)?;
            break End::Full;
        }
        watch(&format!("rung {}", rungs.len()));
        let step = match parallel::watched(&monitor.watch(), || climb.step()) {
            Err(_) if trace::stopped(monitor) => break End::Stopped,
            Err(why) if !climb.added.is_empty() => break End::Cannot(why.to_string()),
            found => found?,
        };
        if std::mem::take(&mut climb.freed) {
            climb.refresh(&mut rungs)?;
        }
        if let Some(last) = rungs.last_mut() {
            (last.candidates, last.second_opinion, last.effort) = (step.candidates.clone(), step.second_opinion.clone(), step.effort);
        }
        if climb.loosen(&step, &mut rungs)? {
            continue;
        }
        let Some(taken) = &step.taken else {
            visible = step.visible;
            if climb.exchange(&mut rungs)? {
                continue;
            }
            if let Some(tight) = parallel::watched(&monitor.watch(), || climb.tighten(true)) {
                rungs.extend(tight);
                continue;
            }
            break if step.cut || trace::stopped(monitor) { End::Stopped } else { End::NothingGains };
        };
        if climb.exchange_first(taken, &step, &mut rungs)? {
            continue;
        }
        // Whether what stands should be another is not known where the time ended before it was held against what could stand in its place, or before all
        // candidates beside it were refitted: what it leaves may be its own.
        if !climb.added.is_empty() && (step.cut || trace::stopped(monitor)) {
            break End::Stopped;
        }
        rungs.push(climb.taken(taken, &step)?);
        rungs.extend(parallel::watched(&monitor.watch(), || climb.tighten(false)).unwrap_or_default());
    };
    climb.finish(rungs, &end, visible, started)
}

/// The study's own model fitted to its tests, channels turned back and clipped samples left out: the first rung.
fn at_the_foot<'a>(case: &Case, monitor: &'a Monitor<'a>, watch: Watch<'a>) -> Result<(Climb<'a>, Vec<Rung>), DiagnoseError> {
    watch("fitting the study as it stands");
    let (case, clipped) = unclipped(case);
    let (case, mut turned) = righted(&case);
    let (case, opposite) = phased(&case, monitor);
    turned.extend(clipped.into_iter().chain(opposite).chain(drifting(&case)));
    // Its model is weighed next, which fits it once more: it need not come closer than that.
    let Began { case, fitted, .. } = begin(&Case { worth: Some(case.search.settings.settled), ..case }, monitor)?;
    let mut climb = Climb::new(&Case { worth: None, ..case }, &fitted, monitor, watch)?;
    climb.turned = turned;
    let rungs = vec![climb.rung(None, vec![])?];
    Ok((climb, rungs))
}

impl Climb<'_> {
    /// Exchanges an addition for what does its work better. What was added first may stand for two: where nothing gains beside it, or nothing more may be
    /// added, every addition is held against what could stand in its place now. Whether one was exchanged.
    fn exchange(&mut self, rungs: &mut Vec<Rung>) -> Result<bool, DiagnoseError> {
        if (0..self.added.len()).all(|k| self.added[k].held || self.is_fault(k)) {
            return Ok(false);
        }
        let Some((added, removed)) = parallel::watched(&self.monitor.watch(), || self.swap()) else { return Ok(false) };
        rungs.push(self.rung(Some(added), vec![removed])?);
        Ok(true)
    }

    /// Exchanges an addition before anything is added beside it, where that comes to no less: a law that does nearly what is missing leaves a rest that
    /// another one, elsewhere, can take up. Whether one was exchanged.
    fn exchange_first(&mut self, taken: &super::step::Move, step: &Step, rungs: &mut Vec<Rung>) -> Result<bool, DiagnoseError> {
        let watch = self.monitor.watch();
        let exchanged = if self.added.is_empty() { None } else { parallel::watched(&watch, || self.replace(Some((&taken.weighed, step)))) };
        let Some((added, removed)) = exchanged else { return Ok(false) };
        rungs.push(self.rung(Some(added), vec![removed])?);
        Ok(true)
    }

    /// Adds what a step has found, takes out what it has made superfluous, and says how the model then stands.
    pub(in crate::diagnose) fn taken(&mut self, taken: &super::step::Move, step: &Step) -> Result<Rung, DiagnoseError> {
        let watch = self.monitor.watch();
        parallel::watched(&watch, || self.add(taken, step));
        for n in &taken.names {
            (self.watch)(&format!("added {n}: {:.1} nats", taken.gain));
        }
        let before = self.added.len() - taken.names.len();
        let removed = parallel::watched(&watch, || self.remove(before));
        Ok(Rung { nats: Some(taken.gain), ..self.rung(taken.names.last().map(EffectAt::from), removed)? })
    }

    pub(in crate::diagnose) fn rung(&self, added: Option<EffectAt>, removed: Vec<EffectAt>) -> Result<Rung, DiagnoseError> {
        let told = self.scale.told(&self.now, self.monitor);
        let fitted = &told.fitted;
        // Deviations are told as corrections; what the study itself lets deviate is a parameter like any other.
        let deviates = |name: &str| fitted.free.iter().any(|f| f.name == name && self.slack.has(f.instance));
        Ok(Rung {
            added,
            nats: None,
            removed,
            tests: compare(&self.case, &fitted.system, &SEEN, &self.monitor.watch())?,
            parameters: parameters(&self.case, fitted)?.0.into_iter().filter(|p| !deviates(&p.name)).collect(),
            effects: effects(&fitted.system).into_iter().enumerate().filter(|(k, _)| !self.slack.has(*k)).map(|e| e.1).collect(),
            candidates: vec![],
            second_opinion: SecondOpinion::default(),
            effort: Effort::default(),
            termination: fitted.outcome.termination.name().into(),
            cost: fitted.outcome.cost,
            readings: self.scale.readings(&self.now),
        })
    }

    /// The last rung with the present model's values: what was added has been fitted on, or stands beside slack now.
    pub(in crate::diagnose) fn refresh(&self, rungs: &mut Vec<Rung>) -> Result<(), DiagnoseError> {
        let Some(last) = rungs.pop() else { return Ok(()) };
        let now = self.rung(last.added, last.removed)?;
        rungs.push(Rung { candidates: last.candidates, second_opinion: last.second_opinion, effort: last.effort, nats: last.nats, ..now });
        Ok(())
    }

    /// What the verdict rests on.
    fn grounds(&self, held_out: Option<(super::held_out::Word, f64, f64)>, stopped: bool) -> Grounds {
        let any = |of: &dyn Fn(usize) -> bool| (0..self.added.len()).any(of);
        let tests = self.case.plans_of(SplitName::HeldOut);
        let floors: Vec<f64> = (0..self.scale.evidence.records.len()).map(|t| self.scale.noise(t)).collect();
        Grounds {
            added: any(&|k| self.is_physics(k)),
            faults: any(&|k| self.is_fault(k)),
            gain: self.added.iter().map(|a| a.gain).sum(),
            held_out,
            borne_out: true,
            tests_held_out: !tests.is_empty(),
            floor: (floors.iter().map(|f| f * f).sum::<f64>() / floors.len().max(1) as f64).sqrt(),
            model_error: self.now.v.model_error(&self.scale.evidence),
            stopped,
        }
    }

    /// The formula for what no candidate explains.
    fn suggestion(&self, base: &Weighed) -> Option<Unexplained> {
        if trace::stopped(self.monitor) {
            return None;
        }
        (self.watch)("fitting a formula to what is unexplained");
        let case = self.scale.under(&base.seen, &base.v, &self.scale.evidence.independent());
        unexplained(&case, &base.fitted, self.monitor)
    }

    /// The test that separates what is tied, or why there is none; the search for it takes a share of the time since `started`.
    fn next_test(&self, started: std::time::Instant) -> (Option<NextTest>, Option<String>) {
        let tie = self.added.iter().enumerate().find(|(k, a)| a.alike().next().is_some() && self.is_physics(*k)).map(|(_, a)| a);
        let Some(added) = tie.filter(|_| !trace::stopped(self.monitor)) else { return (None, None) };
        (self.watch)("looking for the test that separates what is tied");
        let case = self.scale.under(&self.now.seen, &self.now.v, &self.scale.evidence.independent());
        let rivals: Vec<(&Name, &System)> = added.alike().take(self.settings.next.rivals).map(|(_, n, w)| (n, &w.fitted.system)).collect();
        match super::next::separating(&case, &self.now.fitted.system, &rivals, started.elapsed(), self.monitor) {
            Ok(test) => (Some(test), None),
            Err(why) => (None, Some(format!("{} is in a tie, and {why}", added.name))),
        }
    }

    /// The result of the climb.
    fn finish(
        &mut self,
        mut rungs: Vec<Rung>,
        end: &End,
        visible: Vec<(Name, f64)>,
        started: std::time::Instant,
    ) -> Result<(LadderResult, System), DiagnoseError> {
        let stopped = matches!(end, End::Stopped);
        if !stopped {
            self.veto(&mut rungs)?;
        }
        // The model without additions is still that of its rung.
        if !self.added.is_empty() {
            self.refresh(&mut rungs)?;
        }
        let LastWord { before, after, held_out, missing, remainder, seen, judged, ended } = self.last_word(&mut rungs, end)?;
        let (next_test, no_next_test) = self.next_test(started);
        // What was added is no part of the answer where it leaves most of the question.
        let of = if judged.remainder.is_some_and(|r| r > self.settings.remainder) { &self.first } else { &self.now };
        let formula = if judged.verdict == Verdict::Unexplained && judged.open { self.suggestion(of) } else { None };
        let system = &self.now.fitted.system;
        let would = if judged.verdict == Verdict::NothingMissing { detectable(&self.case, system, &visible) } else { vec![] };
        if rungs.len() > 1
            && let Some(rung) = rungs.first_mut()
        {
            rung.tests.extend(before);
        }
        if let Some(rung) = rungs.last_mut() {
            rung.tests.extend(after);
        }
        let result = LadderResult {
            study: self.case.name.clone(),
            began_with: vec![],
            findings: all_findings(&self.case, system, &self.monitor.watch())?,
            rungs,
            verdict: judged.verdict,
            proven: judged.proven,
            why: judged.why,
            missing,
            instruments: self.instruments(),
            corrections: self.corrections(),
            remainder,
            model_error: self.scale.model_error(&self.now),
            scatter: self.scale.scatter(&self.now),
            noise: self.now.v.kappa.exp(),
            settings: self.settings.clone(),
            held_out,
            unexplained_remainder: seen,
            unexplained: formula,
            whitened_rms: (!stopped).then(|| self.scale.evidence.over_noise(&self.now.seen, &self.now.v)),
            would_have_been_seen: would,
            next_test,
            no_next_test,
            ended,
            interrupted: stopped,
            wall_s: started.elapsed().as_secs_f64(),
            result_study: None,
        };
        Ok((result, self.slack.held(system)))
    }

    /// What the held-out tests say, and the verdict that follows; what they do not bear out at all is withdrawn.
    fn last_word(&mut self, rungs: &mut Vec<Rung>, end: &End) -> Result<LastWord, DiagnoseError> {
        // Whoever stops it before anything was added has nothing to hold against them, and they stay unseen.
        let unseen = self.monitor.cancelled() && self.added.is_empty();
        let read = |w: &Weighed| if unseen { Ok(vec![]) } else { self.held_out(w) };
        let (before, after) = (read(&self.first)?, read(&self.now));
        let mut ended = end.describe(self);
        let mut after = after.unwrap_or_else(|why| {
            ended += &format!("; the held-out tests cannot be computed: {why}");
            vec![]
        });
        let (word, mut missing) = self.word();
        let errors = |after: &[TestResult]| HeldOut {
            before: pooled(&before, |t| t.error),
            after: pooled(after, |t| t.error),
            floor: pooled(&before, |t| t.floor),
        };
        let mut held_out = errors(&after);
        let heard = word.zip(held_out.before).zip(held_out.after).map(|((w, b), a)| (w, b, a));
        // An effect on which laws act is not taken out by itself, and nothing is said of it alone.
        let borne_out = missing.is_empty() || missing.iter().any(|m| m.proven != Some(false));
        let grounds = Grounds { borne_out, ..self.grounds(heard, matches!(end, End::Stopped)) };
        let judged = judged(&grounds, &self.settings);
        if judged.withdrawn {
            rungs.push(self.withdraw()?);
            (missing, after) = (vec![], before.clone());
            held_out = errors(&after);
        }
        let remainder = word.map_or(grounds.model_error, |w| w.left.1);
        let seen = grounds.seen(remainder, &self.settings);
        Ok(LastWord { before, after, held_out, missing, remainder, seen, judged, ended })
    }

    /// What the held-out tests say of the first and of the last model, and of every effect that was added.
    fn word(&self) -> (Option<super::held_out::Word>, Vec<Missing>) {
        let held = HeldOutTests::new(self.case.plans_of(SplitName::HeldOut), &self.scale.evidence, &self.first, &self.now, &self.settings);
        let last = held.as_ref().and_then(|h| h.look(&self.now));
        // Where nothing was added and nothing given slack, they are one model.
        let same = self.added.is_empty() && self.first.fitted.system.instances.len() == self.now.fitted.system.instances.len();
        let first = held.as_ref().filter(|_| !same).and_then(|h| h.look(&self.first));
        let word = held.as_ref().zip(last.as_ref()).and_then(|(h, last)| match &first {
            _ if same => Some(h.word(last, last)),
            first => Some(h.word(first.as_ref()?, last)),
        });
        let missing = self.missing(held.as_ref().zip(last.as_ref()));
        (word, missing)
    }

    /// Takes back all that was added; the rung on which the study's own model stands again.
    fn withdraw(&mut self) -> Result<Rung, DiagnoseError> {
        let gone = self.added.drain(..).map(|a| EffectAt::from(&a.name)).collect();
        (self.watch)("withdrawing what the held-out tests do not bear out");
        self.now = self.first.clone();
        // Slack that was given on the way goes with the rest; what the study states is in its own model.
        if self.base > self.now.fitted.system.instances.len() {
            self.base = self.now.fitted.system.instances.len();
            (self.slack, self.case.deviations) = Default::default();
        }
        self.order.clear();
        self.rung(None, gone)
    }

    fn held_out(&self, w: &Weighed) -> Result<Vec<TestResult>, DiagnoseError> {
        compare(&self.case, &w.fitted.system, &[SplitName::HeldOut], &self.monitor.watch())
    }
}

/// What the held-out tests say of a climb.
struct LastWord {
    /// Held-out tests with the first and with the last model.
    before: Vec<TestResult>,
    after: Vec<TestResult>,
    held_out: HeldOut,
    missing: Vec<Missing>,
    /// Model error that is left, and whether it is seen beside the noise.
    remainder: f64,
    seen: bool,
    judged: Judged,
    /// Why the climb ended, in words.
    ended: String,
}
