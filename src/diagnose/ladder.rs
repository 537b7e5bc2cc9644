//! The ladder: diagnose, add, refit, prune until nothing earns its place.

use crate::effect::Dim;
use crate::parallel;

use crate::identify::Monitor;
use crate::model::System;
use crate::response::Plan;

use super::accept::{at_floor, far, rms};
use super::candidates::Name;
use super::case::{COARSE, Case, Fitted, compare, effects, fit, parameters};
use super::exchange::{Rivals, exchange};
use super::findings::{findings, unsettled};
use super::horizon;
use super::refit::{Proof, cost, prove, whitened};
use super::results::*;
use super::search::{LEVEL, SURE, Step};
use super::simplify::simplify;
use super::unexplained::{Unexplained, unexplained};
use super::{DiagnoseError, trace};

/// Effects added at most where the study does not say.
const MAX_ADDED: usize = 4;
/// Fall of the cost that an effect must be worth, per parameter, to stay.
const WORTH_KEEPING: f64 = 4.0;
/// Part of the first excess of squares over the noise that may be left unexplained where what was added is still what is missing.
const REMAINDER: f64 = 0.03;
/// Effects after which more than this part of it being left says that the library does not hold what is missing.
const IN_VAIN: usize = 2;
const LEFT: f64 = 0.5;

/// What is looked at again once an effect was added.
enum Turn {
    /// The effects before it.
    Exchange,
    /// Laws at the edge of their shapes.
    Simplify,
}

type Watch<'a> = &'a (dyn Fn(&str) + Sync);

/// Fits, finds where the model fails, and weighs what could be missing.
pub fn diagnose(case: &Case, monitor: &Monitor, watch: Watch) -> Result<(FitResult, Diagnosis), DiagnoseError> {
    let started = std::time::Instant::now();
    let (case, fitted, result) = fit(case, &[SplitName::Fit, SplitName::Select], monitor)?;
    let case = &case;
    let (searched, step) = horizon::searched(case, &fitted, monitor, watch)?;
    let verdict = verdict(&step, trace::stopped(monitor));
    let missing = step.accepted.iter().map(|(n, ..)| EffectAt { effect: n.effect.into(), at: n.at.clone() }).collect();
    let would = if verdict == Verdict::NothingMissing { detectable(case, &fitted.system, &step.visible) } else { vec![] };
    let formula = if verdict == Verdict::Unexplained { suggestion(&searched, &step.base, monitor, watch) } else { None };
    let tie = step.accepted.as_ref().and_then(|(name, best, _)| Tie::new(&searched, name, &best.fitted, &step.tied));
    let (next_test, no_next_test) = next_test(tie.as_ref(), started, monitor, watch);
    Ok((
        result,
        Diagnosis {
            findings: all_findings(case, &fitted.system)?,
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
fn strength_unit(case: &Case, system: &System, name: &Name) -> (String, f64) {
    let place = system.model.places_at(&name.at).ok().and_then(|p| p.first().copied());
    let rotational = place.is_some_and(|p| system.model.places[p].axis.rotational());
    let dim = crate::effect::find(name.effect).ok().and_then(|e| e.info().params.first()).map(|p| p.dim);
    let channel = || {
        let (test, role) = name.at.rsplit_once('.')?;
        let mut blocks = case.plans.iter().filter(|(p, _)| test == "*" || p.id == test).flat_map(|(p, _)| &p.blocks);
        blocks.find(|b| b.role == role).map(|b| b.unit.clone())
    };
    match dim {
        Some(Dim::Channel) => (channel().unwrap_or_default(), 1.0),
        Some(Dim::ChannelPerTime) => (format!("{}/s", channel().unwrap_or_default()), 1.0),
        Some(dim) => dim.practical(rotational),
        None => (String::new(), 1.0),
    }
}

/// The formula for what no candidate explains.
fn suggestion(case: &Case, base: &Fitted, monitor: &Monitor, watch: Watch) -> Option<Unexplained> {
    if trace::stopped(monitor) {
        return None;
    }
    watch("fitting a formula to what is unexplained");
    unexplained(case, base, monitor)
}

fn verdict(step: &Step, stopped: bool) -> Verdict {
    if step.accepted.is_some() {
        Verdict::Missing
    } else if stopped {
        Verdict::Interrupted
    } else if step.p_value > SURE && at_floor(step.left) {
        Verdict::NothingMissing
    } else {
        Verdict::Unexplained
    }
}

/// Root mean square of the whitened residuals of a system on the fit and select tests, and their number.
fn left_by(case: &Case, system: &System) -> (f64, usize) {
    let plans = [SplitName::Fit, SplitName::Select].map(|s| case.plans_of(s)).concat();
    let n: usize = plans.iter().map(|p| p.len()).sum();
    whitened(&plans, system).map_or((f64::INFINITY, n), |w| rms(&w))
}

/// Mean square of whitened residuals above the noise.
fn excess((rms, _): (f64, usize)) -> f64 {
    (rms * rms - 1.0).max(0.0)
}

/// Whether what was added takes most of what the first model failed by.
fn mostly(first: (f64, usize), last: (f64, usize)) -> bool {
    excess(last) <= REMAINDER * excess(first)
}

/// Whether effects have left so much of what the first model failed by that more of them would be a list, and no answer.
fn a_list(first: (f64, usize), last: (f64, usize)) -> bool {
    !at_floor(last) && excess(last) > LEFT * excess(first)
}

/// Why nothing more is worth adding, where that is so.
fn in_vain(case: &Case, system: &System, first: Option<&((f64, usize), Fitted)>, added: usize) -> Option<String> {
    let (before, _) = first.filter(|_| added >= IN_VAIN)?;
    let after = left_by(&case.with_instruments(system), system);
    let part = 100.0 * excess(after) / excess(*before);
    a_list(*before, after).then(|| format!("they leave {part:.0} % of the squared residual above the noise"))
}

fn all_findings(case: &Case, system: &System) -> Result<Vec<Finding>, DiagnoseError> {
    let found = |(plan, _): &&(Plan, SplitName)| -> Result<Vec<Finding>, DiagnoseError> {
        let mut list = findings(plan, &plan.evaluate(system, &[], false)?.values);
        list.extend(unsettled(plan, system));
        Ok(list)
    };
    let seen: Vec<&(Plan, SplitName)> = case.plans.iter().filter(|(_, split)| *split != SplitName::HeldOut).collect();
    let mut list: Vec<Finding> = parallel::map(&seen, found).into_iter().collect::<Result<Vec<_>, _>>()?.concat();
    list.extend(case.of_data.iter().cloned());
    list.sort_by(|a, b| b.number.abs().total_cmp(&a.number.abs()));
    Ok(list)
}

/// The end of a ladder that was stopped: what stands so far, and no verdict on the rest.
fn interrupted(missing: &[Missing]) -> (String, Verdict) {
    let verdict = if missing.is_empty() { Verdict::Interrupted } else { Verdict::Missing };
    let found = if missing.is_empty() { "before an effect was added" } else { "after these effects were added" };
    (format!("it was interrupted {found}; more may be missing"), verdict)
}

/// How a ladder stands that ends with what it has added.
struct Standing {
    /// Root mean square of the whitened residuals.
    left: f64,
    /// Whether that is above the noise.
    remainder: bool,
    formula: Option<Unexplained>,
    verdict: Verdict,
}

impl Standing {
    /// `first`: what the first model left, and that model as the search sees it.
    fn of(case: &Case, system: &System, first: Option<&((f64, usize), Fitted)>, monitor: &Monitor, watch: Watch) -> Standing {
        let searched = case.with_instruments(system);
        let after = left_by(&searched, system);
        let stands = Standing { left: after.0, remainder: !at_floor(after), formula: None, verdict: Verdict::Missing };
        match first {
            Some((before, given)) if stands.remainder && !mostly(*before, after) => {
                Standing { formula: suggestion(&searched, given, monitor, watch), verdict: Verdict::Unexplained, ..stands }
            }
            _ => stands,
        }
    }
}

/// Root mean square over tests.
fn pooled(tests: &[TestResult], pick: impl Fn(&TestResult) -> f64) -> Option<f64> {
    let held: Vec<f64> = tests.iter().filter(|t| t.split == SplitName::HeldOut).map(pick).collect();
    (!held.is_empty()).then(|| (held.iter().map(|e| e * e).sum::<f64>() / held.len() as f64).sqrt())
}

/// Climbs. The held-out tests are computed once, at the end, for the first and the last model.
pub fn ladder(case: &Case, monitor: &Monitor, watch: Watch) -> Result<(LadderResult, System), DiagnoseError> {
    let started = std::time::Instant::now();
    let seen = [SplitName::Fit, SplitName::Select];
    watch("fitting the study as it stands");
    let (mut case, mut fitted, first) = fit(case, &seen, monitor)?;
    let base_instances = fitted.system.instances.len();
    let first_system = fitted.system.clone();
    let mut rungs = vec![rung(&case, &fitted, None, vec![], vec![], first.tests)?];
    // One for each instance that was added, in their order.
    let mut missing: Vec<Missing> = Vec::new();
    let limit = case.search.max_added.unwrap_or(MAX_ADDED);
    let (mut remainder, mut formula, mut left, mut would) = (false, None, None, vec![]);
    let mut ties_left: Vec<Tie> = Vec::new();
    let mut rivals: Vec<Rivals> = Vec::new();
    let mut stopped;
    // What the first model left, and that model as the search sees it.
    let mut first: Option<((f64, usize), Fitted)> = None;
    let (ended, verdict) = loop {
        let now = rungs.len();
        stopped = trace::stopped(monitor);
        if stopped {
            break interrupted(&missing);
        }
        let full = missing.len() >= limit || rungs.len() > 2 * limit;
        let why = if full { Some(format!("{limit} is the limit")) } else { in_vain(&case, &fitted.system, first.as_ref(), missing.len()) };
        if let Some(why) = why {
            let stands = Standing::of(&case, &fitted.system, first.as_ref(), monitor, watch);
            (left, remainder, formula) = (Some(stands.left), stands.remainder, stands.formula);
            break (format!("{} effects were added, and {why}", missing.len()), stands.verdict);
        }
        watch(&format!("rung {now}"));
        let (searched, step) = match horizon::searched(&case, &fitted, monitor, watch) {
            // What was found is not lost with a model in which nothing more can be looked for.
            Err(why) if !missing.is_empty() => {
                let stands = Standing::of(&case, &fitted.system, first.as_ref(), monitor, watch);
                (left, remainder, formula) = (Some(stands.left), stands.remainder, stands.formula);
                break (format!("what else is missing could not be looked for: {why}"), stands.verdict);
            }
            found => found?,
        };
        if let Some(last) = rungs.last_mut() {
            last.candidates = step.candidates.clone();
            last.second_opinion = step.second_opinion.clone();
            last.effort = step.effort;
        }
        let step_verdict = verdict(&step, trace::stopped(monitor));
        let whole = || if step.near { left_by(&searched, &fitted.system) } else { step.left };
        let (first_left, given) = first.get_or_insert_with(|| (whole(), step.base.clone())).clone();
        let Some((name, proof, ties)) = step.accepted else {
            stopped = step_verdict == Verdict::Interrupted;
            left = Some(step.left.0);
            if stopped {
                break interrupted(&missing);
            }
            // Beyond the stated noise, but not beyond what the search grants instruments.
            let granted = !at_floor(left_by(&case, &fitted.system));
            let noise = if granted { "within the noise and what good instruments may err by" } else { "at the noise" };
            let said = match step_verdict {
                Verdict::NothingMissing if step.p_value > LEVEL => {
                    format!("the residual is {noise} and no candidate scores beyond chance")
                }
                Verdict::NothingMissing => format!("the residual is {noise} and no candidate earned its place {}", judged(&case)),
                _ if step.p_value > LEVEL => "no candidate scores beyond chance, but the residual lies above the noise".to_string(),
                _ if at_floor(step.left) => {
                    format!("the residual is no larger than the noise, if not random, and no candidate earned its place {}", judged(&case))
                }
                _ => format!("no candidate earned its place {}", judged(&case)),
            };
            remainder = !(missing.is_empty() || at_floor(step.left));
            match step_verdict {
                Verdict::Unexplained if missing.is_empty() || remainder => {
                    // What was added is no part of the answer where it leaves most of the question.
                    let base = if mostly(first_left, step.left) { &step.base } else { &given };
                    formula = suggestion(&searched, base, monitor, watch);
                }
                Verdict::NothingMissing => would = detectable(&case, &fitted.system, &step.visible),
                _ => {}
            }
            let v = match (missing.is_empty(), step_verdict) {
                (true, v) => v,
                (false, Verdict::Unexplained) if !mostly(first_left, step.left) => Verdict::Unexplained,
                (false, _) => Verdict::Missing,
            };
            break (said, v);
        };
        // Without it, where it has to be withdrawn.
        let stood = missing.clone();
        ties_left.extend(Tie::new(&searched, &name, &proof.fitted, &step.tied));
        rivals.push(Rivals { of: EffectAt { effect: name.effect.into(), at: name.at.clone() }, list: step.rivals });
        watch(&format!("added {} at {}", name.effect, name.at));
        missing.push(Missing {
            effect: name.effect.into(),
            at: name.at.clone(),
            of: name.of.clone(),
            tied_with: ties.iter().map(|n| format!("{} at {}", n.effect, n.at)).collect(),
        });
        // A model above the noise is fitted no closer than that shows; at it the last digits count.
        let left_of_it = rms(&proof.fit);
        let coarse = far(left_of_it.0);
        let as_close_as_it_shows = |case: &Case| Case { f_tol: (!at_floor(left_of_it)).then_some(COARSE), ..case.clone() };
        let mut system = proof.fitted.system;
        let removed = prune(&searched, &mut system, base_instances, &mut missing, monitor, watch);
        // A new effect may ask for finer steps; what is reported takes the stated sigma at its word.
        let finer = case.refined(&system).unwrap_or_else(|| case.clone());
        let closer = as_close_as_it_shows(&finer).fit_system(&system, finer.plans_of(SplitName::Fit), monitor);
        let closer = closer.and_then(|f| compare(&finer, &f.system, &seen).map(|tests| (f, tests)));
        // Far from the noise, what improves the fit in coarse steps alone explains nothing; nor does what cannot be computed in finer ones.
        let explains = |f: &Fitted| !coarse || step.near || !removed.is_empty() || f.outcome.cost < fitted.outcome.cost;
        let (closer, tests) = match closer {
            Ok((closer, tests)) if explains(&closer) || trace::stopped(monitor) => (closer, tests),
            withdrawn => {
                let why = match withdrawn {
                    Ok(_) => "improves the fit in coarse time steps alone".into(),
                    Err(why) => format!("cannot be computed in finer time steps ({why})"),
                };
                watch(&format!("withdrew {} at {}: it {why}", name.effect, name.at));
                missing = stood;
                (left, remainder) = (Some(step.left.0), !missing.is_empty());
                let kept = mostly(first_left, step.left);
                formula = suggestion(&searched, if kept { &step.base } else { &given }, monitor, watch);
                let ended = format!("{} at {} {why}, and nothing else was better", name.effect, name.at);
                break (ended, if kept && !missing.is_empty() { Verdict::Missing } else { Verdict::Unexplained });
            }
        };
        (case, fitted) = (finer, closer);
        let added = EffectAt { effect: name.effect.into(), at: name.at };
        rungs.push(rung(&case, &fitted, Some(added), removed, vec![], tests)?);
        for turn in [Turn::Exchange, Turn::Simplify] {
            let swap = match turn {
                Turn::Exchange => exchange(&searched, &mut fitted, base_instances, &mut missing, &rivals, monitor, watch),
                Turn::Simplify => simplify(&searched, &mut fitted, base_instances, &mut missing, WORTH_KEEPING, monitor, watch),
            };
            let Some(swap) = swap else { continue };
            let mut removed = vec![swap.removed];
            if let Some(tied) = swap.tied {
                ties_left.extend(Tie::new(&searched, &tied.name, &tied.best, &tied.rivals));
                removed.extend(prune(&searched, &mut fitted.system, base_instances, &mut missing, monitor, watch));
            }
            fitted = as_close_as_it_shows(&case).fit_system(&fitted.system, case.plans_of(SplitName::Fit), monitor)?;
            let tests = compare(&case, &fitted.system, &seen)?;
            rungs.push(rung(&case, &fitted, Some(swap.added), removed, vec![], tests)?);
        }
    };
    // Only what still stands is worth a test of its own, and only now is it known how long the search for it took.
    let stands = |tie: &&Tie| missing.iter().any(|m| m.effect == tie.name.effect && m.at == tie.name.at && !m.tied_with.is_empty());
    let (next_test, no_next_test) = next_test(ties_left.iter().find(stands), started, monitor, watch);
    let before = compare(&case, &first_system, &[SplitName::HeldOut])?;
    // A climb is not lost with a held-out test that the last model cannot compute: it says so, and has no error there.
    let (after, ended) = match compare(&case, &fitted.system, &[SplitName::HeldOut]) {
        Ok(after) => (after, ended),
        Err(why) => (vec![], format!("{ended}; the held-out tests cannot be computed: {why}")),
    };
    let held_out = HeldOut { before: pooled(&before, |t| t.error), after: pooled(&after, |t| t.error), floor: pooled(&after, |t| t.floor) };
    if rungs.len() > 1
        && let Some(rung) = rungs.first_mut()
    {
        rung.tests.extend(before);
    }
    if let Some(rung) = rungs.last_mut() {
        rung.tests.extend(after);
    }
    let result = LadderResult {
        study: case.name.clone(),
        findings: all_findings(&case, &fitted.system)?,
        rungs,
        verdict,
        missing,
        held_out,
        unexplained_remainder: remainder,
        unexplained: formula,
        whitened_rms: left,
        would_have_been_seen: would,
        next_test,
        no_next_test,
        ended,
        interrupted: stopped,
        wall_s: started.elapsed().as_secs_f64(),
        result_study: None,
    };
    Ok((result, fitted.system))
}

/// How candidates are judged, for the sentence that says why none was accepted.
fn judged(case: &Case) -> &'static str {
    match (case.plans_of(SplitName::Select).len(), case.plans_of(SplitName::Fit).len()) {
        (0, 0 | 1) => "on the one test that is fitted",
        (0, _) => "on parts of the fitted tests, each left out in turn",
        _ => "on the select tests",
    }
}

fn rung(
    case: &Case,
    fitted: &Fitted,
    added: Option<EffectAt>,
    removed: Vec<EffectAt>,
    candidates: Vec<Candidate>,
    tests: Vec<TestResult>,
) -> Result<Rung, DiagnoseError> {
    Ok(Rung {
        added,
        removed,
        tests,
        parameters: parameters(case, fitted)?.0,
        effects: effects(&fitted.system),
        candidates,
        second_opinion: SecondOpinion::default(),
        effort: Effort::default(),
        termination: fitted.outcome.termination.name().into(),
        cost: fitted.outcome.cost,
    })
}

/// Takes away again what the added effects have made superfluous: each added effect whose removal costs less than its parameters are
/// worth on fit and select together. `missing` names the instances from `base` on.
fn prune(case: &Case, system: &mut System, base: usize, missing: &mut Vec<Missing>, monitor: &Monitor, watch: Watch) -> Vec<EffectAt> {
    let mut removed = Vec::new();
    let whole = |p: &Proof| cost(&p.fit) + cost(&p.select);
    let mut now: Option<f64> = None;
    // The one added last has just been judged.
    while base + 1 < system.instances.len() {
        let Some(before) = now.or_else(|| prove(case, system, monitor).ok().map(|p| whole(&p))) else { break };
        let without = |at: usize| -> Option<(usize, f64, Proof)> {
            let k = base + at;
            let mut without = system.clone();
            let gone = without.instances.remove(k);
            if without.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.instances.iter().any(|i| *i >= k))) {
                return None;
            }
            let params = gone.params.iter().filter(|p| p.free).count() as f64;
            let proof = prove(case, &without, monitor).ok()?;
            let rise = whole(&proof) - before;
            (rise < WORTH_KEEPING * params).then_some((k, rise, proof))
        };
        let superfluous = parallel::over(system.instances.len() - 1 - base, without).into_iter().flatten();
        let Some((k, _, proof)) = superfluous.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        let gone = &system.instances[k];
        let gone = EffectAt { effect: gone.name().into(), at: gone.at.clone() };
        watch(&format!("pruned {} at {}", gone.effect, gone.at));
        missing.remove(k - base);
        removed.push(gone);
        now = Some(whole(&proof));
        *system = proof.fitted.system;
    }
    removed
}

/// A candidate that was accepted, with those that the tests do not tell from it.
struct Tie {
    case: Case,
    name: Name,
    best: Fitted,
    rivals: Vec<(Name, Fitted)>,
}

impl Tie {
    fn new(case: &Case, name: &Name, best: &Fitted, rivals: &[(Name, Fitted)]) -> Option<Tie> {
        let tie = || Tie { case: case.clone(), name: name.clone(), best: best.clone(), rivals: rivals.to_vec() };
        (!rivals.is_empty()).then(tie)
    }
}

/// The test that separates what is tied, or why there is none; the search for it takes a share of the time since `started`.
fn next_test(tie: Option<&Tie>, started: std::time::Instant, monitor: &Monitor, watch: Watch) -> (Option<NextTest>, Option<String>) {
    let Some(tie) = tie.filter(|_| !trace::stopped(monitor)) else { return (None, None) };
    watch("looking for the test that separates what is tied");
    match super::next::separating(&tie.case, &tie.best, &tie.rivals, started.elapsed(), monitor) {
        Ok(test) => (Some(test), None),
        Err(why) => (None, Some(format!("{} at {} is in a tie, and {why}", tie.name.effect, tie.name.at))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_effects_that_leave_half_of_the_excess_are_a_list_and_no_answer() {
        let (first, n) = ((10.0, 400), 400);
        // 99 above the noise; half of it is left at a root mean square of sqrt(50.5).
        assert!(a_list(first, (7.2, n)) && !a_list(first, (7.0, n)));
        // Three effects alike leave a third after two of them; what is at the noise is no list whatever it began with.
        assert!(!a_list(first, (5.8, n)) && !a_list((1.1, n), (1.09, n)));
        assert!(mostly(first, (1.9, n)) && !mostly(first, (2.2, n)));
    }
}
