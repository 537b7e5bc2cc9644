//! The ladder: diagnose, add, refit, prune until nothing earns its place.

use crate::identify::Monitor;
use crate::model::System;
use crate::response::Plan;

use super::case::{Case, Fitted, compare, effects, fit, parameters};
use super::findings::{findings, unsettled};
use super::refit::{cost, prove, whitened};
use super::results::*;
use super::search::{LEVEL, Step, step};
use super::simplify::simplify;
use super::{DiagnoseError, trace};

/// Effects added at most where the study does not say.
const MAX_ADDED: usize = 6;
/// Fall of the cost that an effect must be worth, per parameter, to stay.
const WORTH_KEEPING: f64 = 4.0;
/// Root mean square of whitened residuals up to which a model is at the floor.
const AT_FLOOR: f64 = 1.1;

type Watch<'a> = &'a (dyn Fn(&str) + Sync);

/// Fits, finds where the model fails, and weighs what could be missing.
pub fn diagnose(case: &Case, monitor: &Monitor, watch: Watch) -> Result<(FitResult, Diagnosis), DiagnoseError> {
    let (case, fitted, result) = fit(case, &[SplitName::Fit, SplitName::Select], monitor)?;
    let case = &case;
    let step = step(case, &fitted, monitor, watch)?;
    let verdict = verdict(&step, whitened_rms(case, &fitted), trace::stopped(monitor));
    let missing = step.accepted.iter().map(|(n, ..)| EffectAt { effect: n.effect.into(), at: n.at.clone() }).collect();
    let would = if verdict == Verdict::NothingMissing {
        let unit = |at: &str, effect: &str| strength_unit(&fitted.system, effect, at);
        step.visible.iter().map(|(n, v)| format!("{} at {}: {v:.3e} {}", n.effect, n.at, unit(&n.at, n.effect))).collect()
    } else {
        vec![]
    };
    let next_test = next_test(case, &step);
    Ok((
        result,
        Diagnosis {
            findings: all_findings(case, &fitted.system)?,
            candidates: step.candidates,
            verdict,
            missing,
            next_test,
            would_have_been_seen: would,
        },
    ))
}

fn strength_unit(system: &System, effect: &str, at: &str) -> String {
    let rotational =
        system.model.places_at(at).ok().and_then(|p| p.first().copied()).is_some_and(|p| system.model.places[p].axis.rotational());
    crate::effect::find(effect).ok().and_then(|e| e.info().params.first()).map(|p| p.dim.si(rotational)).unwrap_or_default()
}

fn verdict(step: &Step, rms: f64, stopped: bool) -> Verdict {
    if step.accepted.is_some() {
        Verdict::Missing
    } else if stopped {
        Verdict::Interrupted
    } else if step.p_value > LEVEL && rms < AT_FLOOR {
        Verdict::NothingMissing
    } else {
        Verdict::Unexplained
    }
}

fn whitened_rms(case: &Case, fitted: &Fitted) -> f64 {
    let plans = case.plans_of(SplitName::Fit);
    let n: usize = plans.iter().map(|p| p.len()).sum();
    whitened(&plans, &fitted.system).map_or(f64::INFINITY, |w| (2.0 * cost(&w) / n.max(1) as f64).sqrt())
}

fn all_findings(case: &Case, system: &System) -> Result<Vec<Finding>, DiagnoseError> {
    use rayon::prelude::*;
    let found = |(plan, _): &(Plan, SplitName)| -> Result<Vec<Finding>, DiagnoseError> {
        let mut list = findings(plan, &plan.evaluate(system, &[], false)?.values);
        list.extend(unsettled(plan, system));
        Ok(list)
    };
    let seen = case.plans.par_iter().filter(|(_, split)| *split != SplitName::HeldOut);
    let mut list: Vec<Finding> = seen.map(found).collect::<Result<Vec<_>, _>>()?.concat();
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
    let mut missing: Vec<Missing> = Vec::new();
    let limit = case.search.max_added.unwrap_or(MAX_ADDED);
    let mut next = None;
    let mut stopped;
    let (ended, verdict) = loop {
        let now = rungs.len();
        stopped = trace::stopped(monitor);
        if stopped {
            break interrupted(&missing);
        }
        if missing.len() >= limit {
            break (format!("{limit} effects were added, which is the limit"), Verdict::Missing);
        }
        watch(&format!("rung {now}"));
        let step = step(&case, &fitted, monitor, watch)?;
        if let Some(last) = rungs.last_mut() {
            last.candidates = step.candidates.clone();
        }
        let step_verdict = verdict(&step, whitened_rms(&case, &fitted), trace::stopped(monitor));
        next = next.or_else(|| next_test(&case, &step));
        let Some((name, proof, ties)) = step.accepted else {
            stopped = step_verdict == Verdict::Interrupted;
            if stopped {
                break interrupted(&missing);
            }
            let said = match step_verdict {
                Verdict::NothingMissing => "the residual is at the noise and no candidate scores beyond chance".to_string(),
                _ if step.p_value > LEVEL => "no candidate scores beyond chance, but the residual lies above the noise".to_string(),
                _ => format!("no candidate earned its place {}", judged(&case)),
            };
            let v = match (missing.is_empty(), step_verdict) {
                (true, v) => v,
                (false, _) => Verdict::Missing,
            };
            break (said, v);
        };
        watch(&format!("added {} at {}", name.effect, name.at));
        fitted = proof.fitted;
        // The refit was cut short, and a new effect may ask for finer steps.
        case = case.refined(&fitted.system).unwrap_or(case);
        fitted = case.fit_system(&fitted.system, case.plans_of(SplitName::Fit), monitor)?;
        missing.push(Missing {
            effect: name.effect.into(),
            at: name.at.clone(),
            tied_with: ties.iter().map(|n| format!("{} at {}", n.effect, n.at)).collect(),
        });
        let removed = prune(&case, &mut fitted, base_instances, &mut missing, monitor, watch);
        let tests = compare(&case, &fitted.system, &seen)?;
        let added = EffectAt { effect: name.effect.into(), at: name.at };
        let undone = removed.contains(&added);
        rungs.push(rung(&case, &fitted, Some(added), removed, vec![], tests)?);
        if let Some(swap) = simplify(&case, &mut fitted, base_instances, &mut missing, WORTH_KEEPING, monitor, watch)? {
            let tests = compare(&case, &fitted.system, &seen)?;
            rungs.push(rung(&case, &fitted, Some(swap.added), vec![swap.removed], vec![], tests)?);
        }
        if undone {
            break (
                "the effect added last was pruned again".to_string(),
                if missing.is_empty() { Verdict::Unexplained } else { Verdict::Missing },
            );
        }
    };
    let before = compare(&case, &first_system, &[SplitName::HeldOut])?;
    let after = compare(&case, &fitted.system, &[SplitName::HeldOut])?;
    let held_out = HeldOut { before: pooled(&before, |t| t.error), after: pooled(&after, |t| t.error), floor: pooled(&after, |t| t.floor) };
    if rungs.len() > 1 {
        if let Some(rung) = rungs.first_mut() {
            rung.tests.extend(before);
        }
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
        next_test: next,
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
        (0, _) => "on the fitted tests, each left out in turn",
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
        termination: fitted.outcome.termination.name().into(),
        cost: fitted.outcome.cost,
    })
}

/// Takes away again what the added effects have made superfluous: each added effect whose removal costs less than its parameters are
/// worth on fit and select together.
fn prune(case: &Case, fitted: &mut Fitted, base: usize, missing: &mut Vec<Missing>, monitor: &Monitor, watch: Watch) -> Vec<EffectAt> {
    let mut removed = Vec::new();
    loop {
        let plans: Vec<&Plan> = case.plans_of(SplitName::Fit).into_iter().chain(case.plans_of(SplitName::Select)).collect();
        let Ok(now) = whitened(&plans, &fitted.system).map(|w| cost(&w)) else { return removed };
        let mut best: Option<(usize, f64, super::refit::Proof)> = None;
        // The one added last has just been judged.
        for k in base..fitted.system.instances.len().saturating_sub(1) {
            let mut without = fitted.system.clone();
            let gone = without.instances.remove(k);
            if without.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.instance >= k)) {
                continue;
            }
            let params = gone.params.iter().filter(|p| p.free).count() as f64;
            let Ok(proof) = prove(case, &without, monitor) else { continue };
            let rise = cost(&proof.fit) + cost(&proof.select) - now;
            if rise < WORTH_KEEPING * params && best.as_ref().is_none_or(|b| rise < b.1) {
                best = Some((k, rise, proof));
            }
        }
        let Some((k, _, proof)) = best else { return removed };
        let gone = &fitted.system.instances[k];
        let gone = EffectAt { effect: gone.name().into(), at: gone.at.clone() };
        watch(&format!("pruned {} at {}", gone.effect, gone.at));
        missing.retain(|m| m.effect != gone.effect || m.at != gone.at);
        removed.push(gone);
        *fitted = proof.fitted;
    }
}

/// The test that separates tied candidates: the drive of each fit test at other frequencies and amplitudes is the plan's own business;
/// among the tests that exist, the one where the tied responses differ most is named with its conditions.
fn next_test(case: &Case, step: &Step) -> Option<NextTest> {
    let (_, best, _) = step.accepted.as_ref()?;
    let rivals = &step.tied_systems;
    if rivals.is_empty() {
        return None;
    }
    let plans = [SplitName::Fit, SplitName::Select].map(|s| case.plans_of(s)).concat();
    super::next::separating(&plans, &best.fitted.system, rivals)
}
