//! One step of the search: score everything, refit the best, say what earned its place.

use crate::identify::Monitor;
use crate::model::System;

use super::accept::{earns_its_place, improvement, tied, verdict_cost};
use super::candidates::{Name, Scene, Trial, candidates};
use super::case::{Case, Fitted};
use super::refit::{Proof, Refit, Whitened, best_per_candidate, cost, cross_validated, pooled_error, refit_all, whitened};
use super::results::{Candidate, SplitName};
use super::score::{Score, score};
use super::{DiagnoseError, trace};

/// Candidates refitted in full per step.
const REFITS: usize = 8;
/// A candidate is refitted when its predicted drop is at least this part of the best.
const WORTH: f64 = 0.05;
/// Part of the cost that an effect must take away where no select test can decide.
const WORTH_ALONE: f64 = 0.1;
/// Level of the score test that counts as a sign of something missing.
pub const LEVEL: f64 = 0.01;

/// What one step found.
pub struct Step {
    /// Every candidate that was weighed, best first.
    pub candidates: Vec<Candidate>,
    /// The accepted one with its proof, and what it is tied with.
    pub accepted: Option<(Name, Proof, Vec<Name>)>,
    /// Systems of the tied candidates, for the next test.
    pub tied_systems: Vec<(Name, System)>,
    /// p-value of the best score.
    pub p_value: f64,
    /// Name and visible strength of each candidate.
    pub visible: Vec<(Name, f64)>,
}

/// Scores, refits, compares. `base` is the fitted case without the candidate.
pub fn step(case: &Case, base: &Fitted, monitor: &Monitor, watch: &(dyn Fn(&str) + Sync)) -> Result<Step, DiagnoseError> {
    let plans = case.plans_of(SplitName::Fit);
    let selects = case.plans_of(SplitName::Select);
    let scene = Scene::new(&plans, &base.system);
    let (names, trials) = candidates(case, &base.system, &plans, &scene);
    watch(&format!("scoring {} effects at places, {} shapes", names.len(), trials.len()));
    let bound = base.options.constraints.at_bound(&base.outcome.p);
    let at_bound: Vec<bool> = (0..base.free.len()).map(|k| bound.iter().any(|(i, _)| *i == k)).collect();
    let priors: Vec<_> = base.options.priors.iter().map(|p| (p.index, p.mean, p.sigma)).collect();
    let scores = score(&plans, &base.system, &trials, &at_bound, &priors, case.seed)?;
    let best = best_per_candidate(&scores, &trials);
    let p_value = best.iter().map(|s| s.p_value).fold(1.0, f64::min);
    let visible = visible(&scores, &names, &trials);
    let before_fit = whitened(&plans, &base.system).unwrap_or_default();
    let before_select = whitened(&selects, &base.system).unwrap_or_default();
    let judge_select = !selects.is_empty();
    let error_of =
        |fit: &Whitened, select: &Whitened| if judge_select { pooled_error(&selects, select) } else { pooled_error(&plans, fit) };
    let error_before = error_of(&before_fit, &before_select);
    let blank = |s: &Score, remark: &str| {
        let name = &names[trials[s.trial].candidate];
        Candidate {
            effect: name.effect.into(),
            at: name.at.clone(),
            of: name.of.clone(),
            predicted_drop: s.drop,
            error_before,
            error_after: None,
            accepted: false,
            tied_with: vec![],
            p_value: s.p_value,
            remark: remark.into(),
        }
    };
    if p_value > LEVEL || trace::stopped(monitor) {
        let remark = |s: &Score| if s.p_value > LEVEL { "within what chance gives" } else { "not refitted: the search was stopped" };
        let list = best.iter().take(REFITS).map(|s| blank(s, remark(s))).collect();
        return Ok(Step { candidates: list, accepted: None, tied_systems: vec![], p_value, visible });
    }
    let top = best.first().map_or(0.0, |s| s.drop);
    let picked: Vec<Score> = best.iter().filter(|s| s.p_value <= LEVEL && s.drop >= WORTH * top).take(REFITS).copied().collect();
    let rest: Vec<Score> = best.iter().filter(|s| !picked.iter().any(|p| p.trial == s.trial)).take(REFITS).copied().collect();
    watch(&format!("refitting the best {}", picked.len()));
    let mut refits = refit_all(case, &base.system, &names, &trials, &picked, monitor, watch);
    // Best first by what it costs on fit and select; failures last.
    refits.sort_by(|a, b| {
        let key = |r: &Refit| r.result.as_ref().map_or(f64::INFINITY, verdict_cost);
        key(a).total_cmp(&key(b)).then(b.score.drop.total_cmp(&a.score.drop))
    });
    let before_folds = if !judge_select && plans.len() > 1 { cross_validated(case, &base.system, monitor).ok() } else { None };
    // Whether a refit has earned its place, and what was weighed.
    let earned = |proof: &Proof| -> (bool, String) {
        let fit_gain = cost(&before_fit) - cost(&proof.fit);
        let added = (proof.fitted.free.len() - base.free.len()) as f64;
        // On the fit tests the cost must fall by more than its parameters buy by chance; on select the pairs decide. Without select
        // tests each fit test in turn stands for them; with one test alone the fall must be worth the name.
        if judge_select {
            return (fit_gain > 2.0 * added && earns_its_place(&before_select, &proof.select), String::new());
        }
        let n: usize = before_fit.iter().map(Vec::len).sum();
        if fit_gain <= 0.5 * added * (n as f64).ln() + 2.0 {
            return (false, "; less than its parameters gain by chance".into());
        }
        match &before_folds {
            Some(before) => match cross_validated(case, &proof.fitted.system, monitor) {
                Ok(after) => {
                    let (mean, error) = improvement(before, &after);
                    (earns_its_place(before, &after), format!("; on tests it was not fitted to by {mean:.3} +- {error:.3}"))
                }
                Err(reason) => (false, format!("; it could not be cross-validated: {reason}")),
            },
            None => (fit_gain > WORTH_ALONE * cost(&before_fit), String::new()),
        }
    };
    let mut weighed = vec![String::new(); refits.len()];
    let mut winner = refits.iter().zip(&mut weighed).position(|(r, weighed)| {
        let Ok(proof) = &r.result else { return false };
        let (earned, text) = earned(proof);
        *weighed = text;
        earned
    });
    let mut list = Vec::new();
    let mut ties: Vec<usize> = Vec::new();
    if let Some(w) = winner
        && let Ok(best) = &refits[w].result
    {
        ties = (0..refits.len()).filter(|k| *k != w && refits[*k].result.as_ref().is_ok_and(|p| tied(best, p))).take(3).collect();
        // Of what cannot be told apart, the one with the fewest parameters.
        let size = |k: usize| refits[k].result.as_ref().map_or(usize::MAX, |p| p.fitted.free.len());
        let simpler = (0..ties.len()).filter(|t| size(ties[*t]) < size(w)).find(|t| {
            let k = ties[*t];
            let Ok(proof) = &refits[k].result else { return false };
            let (earned, text) = earned(proof);
            weighed[k] = text;
            earned
        });
        if let Some(t) = simpler {
            winner = Some(std::mem::replace(&mut ties[t], w));
        }
    }
    let label = |k: usize| {
        let name = &names[refits[k].candidate];
        format!("{} at {}", name.effect, name.at)
    };
    for (k, r) in refits.iter().enumerate() {
        let mut c = blank(&r.score, "");
        match &r.result {
            Ok(proof) => {
                c.error_after = Some(error_of(&proof.fit, &proof.select));
                c.accepted = winner == Some(k);
                let (mean, error) =
                    if judge_select { improvement(&before_select, &proof.select) } else { improvement(&before_fit, &proof.fit) };
                c.remark = format!(
                    "improves the mean squared residual by {mean:.3} +- {error:.3}{}, cost {:.5e}",
                    weighed[k],
                    verdict_cost(proof)
                );
                if winner == Some(k) {
                    c.tied_with = ties.iter().map(|t| label(*t)).collect();
                } else if let Some(w) = winner.filter(|_| ties.contains(&k)) {
                    c.tied_with = vec![label(w)];
                }
            }
            Err(reason) => c.remark = format!("the refit failed: {reason}"),
        }
        list.push(c);
    }
    list.extend(rest.iter().map(|s| blank(s, "not refitted: its predicted drop is far below the best")));
    let tied_names: Vec<Name> = ties.iter().map(|k| names[refits[*k].candidate].clone()).collect();
    let tied_systems = ties
        .iter()
        .filter_map(|k| Some((names[refits[*k].candidate].clone(), refits[*k].result.as_ref().ok()?.fitted.system.clone())))
        .collect();
    let accepted = winner.and_then(|w| {
        let r = refits.swap_remove(w);
        Some((names[r.candidate].clone(), r.result.ok()?, tied_names))
    });
    Ok(Step { candidates: list, accepted, tied_systems, p_value, visible })
}

fn visible(scores: &[Score], names: &[Name], trials: &[Trial]) -> Vec<(Name, f64)> {
    // The most visible shape of each candidate.
    let mut best: Vec<Option<f64>> = vec![None; names.len()];
    for s in scores {
        let slot = &mut best[trials[s.trial].candidate];
        *slot = Some(slot.map_or(s.visible, |v: f64| v.min(s.visible)));
    }
    names.iter().zip(best).filter_map(|(n, v)| Some((n.clone(), v?))).collect()
}
