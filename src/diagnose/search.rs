//! One step of the search: score everything, refit the best, say what earned its place.

use crate::identify::{Monitor, Termination};
use crate::model::Instance;

use super::accept::{DECISIVE, at_floor, improved, rms, tied, verdict_cost};
use super::candidates::{Name, Scene, Trial, candidates};
use super::case::{COARSE, Case, Fitted};
use super::exchange::RIVALS;
use super::judge::Judge;
use super::picks::{self, REFITS};
use super::refit::{Bench, Leader, Proof, Refit, best_per_candidate, cost, proof};
use super::results::{Candidate, Effort, SecondOpinion, Share, SplitName};
use super::score::{Score, score};
use super::{DiagnoseError, trace};

/// Candidates tied with the best that are named at most.
const TIES: usize = 3;
/// Level of the score test at which candidates are refitted.
pub const LEVEL: f64 = 0.01;

/// Level below which something is missing even where no candidate earned its place.
pub const SURE: f64 = 1e-3;
/// Times a decisive difference of cost by which a candidate takes the place of one that has earned it.
const SURELY: f64 = 2.0;

/// What one step found.
pub struct Step {
    /// Every candidate that was weighed, best first.
    pub candidates: Vec<Candidate>,
    /// What all candidates at once say.
    pub second_opinion: SecondOpinion,
    /// The accepted one with its proof, and what it is tied with.
    pub accepted: Option<(Name, Proof, Vec<Name>)>,
    /// The tied candidates refitted, for the next test.
    pub tied: Vec<(Name, Fitted)>,
    /// What came closest to the accepted one, as it was fitted, the cheapest first.
    pub rivals: Vec<(Name, Instance)>,
    /// p-value of the best score.
    pub p_value: f64,
    /// Root mean square of the whitened residuals on the fit and select tests before the step, and their number.
    pub left: (f64, usize),
    /// The model before the step, fitted under the covariance that the candidates are.
    pub base: Fitted,
    /// What it took.
    pub effort: Effort,
    /// Whether the model was out of step with a record, and no more than its first cycles were looked at.
    pub near: bool,
    /// Name and visible strength of each candidate.
    pub visible: Vec<(Name, f64)>,
}

/// Scores, refits, compares. `base` is the fitted case without the candidate. `case` should grant its instruments their tolerance
/// ([`Case::with_instruments`]).
pub fn step(case: &Case, base: &Fitted, monitor: &Monitor, watch: &(dyn Fn(&str) + Sync)) -> Result<Step, DiagnoseError> {
    let plans = case.plans_of(SplitName::Fit);
    let judged_on_select = !case.plans_of(SplitName::Select).is_empty();
    // The same model under the covariance that the candidates are fitted with.
    let single = Case { starts: 1, f_tol: Some(COARSE), ..case.clone() };
    let base = &single.fit_system(&base.system, plans.clone(), &monitor.quiet())?;
    let scene = Scene::new(&plans, &base.system);
    let (names, trials) = candidates(case, &base.system, &plans, &scene);
    watch(&format!("scoring {} effects at places, {} shapes", names.len(), trials.len()));
    let bound = base.options.constraints.at_bound(&base.outcome.p);
    let at_bound: Vec<bool> = (0..base.free.len()).map(|k| bound.iter().any(|(i, _)| *i == k)).collect();
    let priors: Vec<_> = base.options.priors.iter().map(|p| (p.index, p.mean, p.sigma)).collect();
    let started = std::time::Instant::now();
    let mut scores = score(&plans, &base.system, &trials, &at_bound, &priors, case.seed)?;
    let least = |list: &[Score]| list.iter().filter(|s| s.drop > 0.0).map(|s| s.p_value).fold(1.0, f64::min);
    if least(&scores.list) > LEVEL && judged_on_select {
        // What the fit tests do not show the select tests may, where they reach further.
        let both = [plans.clone(), case.plans_of(SplitName::Select)].concat();
        let wider = score(&both, &base.system, &trials, &at_bound, &priors, case.seed)?;
        if least(&wider.list) <= SURE {
            scores = wider;
        }
    }
    let mut effort = Effort { trials: trials.len(), score_s: started.elapsed().as_secs_f64(), ..Effort::default() };
    let best = best_per_candidate(&scores.list, &trials);
    let p_value = least(&scores.list);
    let visible = visible(&scores.list, &names, &trials);
    let failed = |reason: String| DiagnoseError::from(crate::identify::IdentifyError::StartFails(crate::identify::EvalError::new(reason)));
    let before = proof(case, base.clone()).map_err(failed)?;
    let left = rms(&[before.fit.as_slice(), &before.select].concat());
    let listed = Listed { names: &names, trials: &trials, before: &before, selected: &scores.selected };
    if p_value > LEVEL || trace::stopped(monitor) {
        let remark = |s: &Score| if s.p_value > LEVEL { "within what chance gives" } else { "not refitted: the search was stopped" };
        let list = best.iter().take(REFITS).map(|s| listed.blank(s, remark(s))).collect();
        let second_opinion = listed.second_opinion(best.first().map(|s| trials[s.trial].candidate), &[]);
        return Ok(Step {
            candidates: list,
            second_opinion,
            accepted: None,
            tied: vec![],
            rivals: vec![],
            p_value,
            left,
            base: base.clone(),
            effort,
            near: false,
            visible,
        });
    }
    let beyond: Vec<Score> = best.iter().filter(|s| s.p_value <= LEVEL).copied().collect();
    let picked = picks::first(&beyond, &scores.selected, &trials);
    watch(&format!("refitting the best {}", picked.len()));
    let bench = Bench { case, base: &base.system, names: &names, trials: &trials, scores: &scores, monitor };
    let started = std::time::Instant::now();
    let mut refits = bench.refit_all(&picked, None, watch);
    sort(&mut refits);
    let leads = refits.first().and_then(|r| r.result.as_ref().ok());
    let explained = leads.is_some_and(|p| at_floor(rms(&p.fit)));
    let leader = leads.map(|p| Leader { cost: p.fitted.outcome.cost, drop: refits[0].score.drop });
    let further = picks::second(&beyond, &refits, explained, cost(&before.fit), &names, &trials);
    if !(further.is_empty() || trace::stopped(monitor)) {
        watch(&format!("refitting {} more", further.len()));
        refits.extend(bench.refit_all(&further, leader, watch));
        sort(&mut refits);
    }
    bench.begin_at_kin(&mut refits, watch);
    sort(&mut refits);
    let pair = bench.pair(&before, &refits, picks::pair(&beyond, &scores.selected, &names, &trials));
    (effort.refits, effort.refits_s) = (refits.len(), started.elapsed().as_secs_f64());
    let rest: Vec<Score> =
        best.iter().filter(|s| !refits.iter().any(|r| r.candidate == trials[s.trial].candidate)).take(REFITS).copied().collect();
    watch(&format!("judging {} refits", refits.len()));
    let Chosen { winner, ties, weighed } = choose(&refits, pair, &Judge::new(case, &before, monitor));
    let mut list: Vec<Candidate> = (0..refits.len()).map(|k| listed.weighed(k, &refits, winner, &ties, &weighed[k])).collect();
    list.extend(rest.iter().map(|s| listed.blank(s, "not refitted: its predicted drop is far below the best")));
    let taken = winner.map(|w| refits[w].candidate).or(best.first().map(|s| trials[s.trial].candidate));
    let second_opinion = listed.second_opinion(taken, &ties.iter().map(|t| refits[*t].candidate).collect::<Vec<_>>());
    let tied_names: Vec<Name> = ties.iter().map(|k| names[refits[*k].candidate].clone()).collect();
    let tied = ties.iter().filter_map(|k| Some((names[refits[*k].candidate].clone(), refits[*k].result.as_ref().ok()?.fitted.clone())));
    let tied = tied.collect();
    let close = refits.iter().enumerate().filter(|(k, _)| winner != Some(*k)).filter_map(|(_, r)| {
        let added = r.result.as_ref().ok()?.fitted.system.instances.last()?;
        added.target.is_none().then(|| (names[r.candidate].clone(), added.clone()))
    });
    let rivals = close.take(RIVALS).collect();
    let accepted = winner.and_then(|w| {
        let r = refits.swap_remove(w);
        Some((names[r.candidate].clone(), r.result.ok()?, tied_names))
    });
    Ok(Step { candidates: list, second_opinion, accepted, tied, rivals, p_value, left, base: base.clone(), effort, near: false, visible })
}

/// Best first by what it costs on fit and select; failures last.
fn sort(refits: &mut [Refit]) {
    refits.sort_by(|a, b| {
        let key = |r: &Refit| r.result.as_ref().map_or(f64::INFINITY, verdict_cost);
        key(a).total_cmp(&key(b)).then(b.score.drop.total_cmp(&a.score.drop))
    });
}

/// What is taken of the refitted candidates.
struct Chosen {
    winner: Option<usize>,
    ties: Vec<usize>,
    /// What was weighed of each, in words.
    weighed: Vec<String>,
}

/// The first of a pair that has earned its place, alone or together; else what has in the order of their costs, and of what cannot be
/// told from it, the one with the fewest parameters.
fn choose(refits: &[Refit], pair: Option<([usize; 2], Proof)>, judge: &Judge) -> Chosen {
    let mut weighed = vec![String::new(); refits.len()];
    let earned = |k: usize, weighed: &mut [String]| {
        let Ok(proof) = &refits[k].result else { return false };
        let (earned, text) = judge.earned(proof);
        weighed[k] = text;
        earned
    };
    let of_pair = pair.and_then(|(pair, both)| {
        let alone = pair.into_iter().find(|k| earned(*k, &mut weighed));
        alone.or_else(|| {
            let together = judge.earned(&both).0.then_some(pair[0])?;
            weighed[together] += "; with the other of its pair it earns its place, and brings the fitted tests to the noise";
            Some(together)
        })
    });
    let mut winner = of_pair.or_else(|| (0..refits.len()).find(|k| earned(*k, &mut weighed)));
    // What costs decisively less and improves the tests that decide by no less is the better reason for what the winner has proved.
    let proof = |k: usize| refits[k].result.as_ref().ok();
    if let Some(w) = winner.filter(|_| of_pair.is_none())
        && let Some(best) = proof(w)
    {
        let better =
            |p: &Proof| verdict_cost(p) < verdict_cost(best) - SURELY * DECISIVE && judge.gain(p) >= judge.gain(best).or(Some(0.0));
        if let Some(k) = (0..w).find(|k| proof(*k).is_some_and(better)) {
            weighed[k] += "; decisively cheaper than what has proved itself, and no worse there";
            winner = Some(k);
        }
    }
    let mut ties = vec![];
    if let Some((w, best)) = winner.and_then(|w| Some((w, refits[w].result.as_ref().ok()?))) {
        ties = (0..refits.len()).filter(|k| *k != w && refits[*k].result.as_ref().is_ok_and(|p| tied(best, p))).take(TIES).collect();
        let size = |k: usize| refits[k].result.as_ref().map_or(usize::MAX, |p| p.fitted.free.len());
        let simpler = |t: &usize| size(ties[*t]) < size(w);
        // What stands for one of a pair alone need not stand for it beside the other.
        if let Some(t) = (0..ties.len()).filter(|t| of_pair.is_none() && simpler(t)).find(|t| earned(ties[*t], &mut weighed)) {
            winner = Some(std::mem::replace(&mut ties[t], w));
        }
    }
    Chosen { winner, ties, weighed }
}

/// Candidates as they are told.
struct Listed<'a> {
    names: &'a [Name],
    trials: &'a [Trial],
    before: &'a Proof,
    /// The second opinion.
    selected: &'a [(usize, f64)],
}

impl Listed<'_> {
    fn blank(&self, s: &Score, remark: &str) -> Candidate {
        let name = &self.names[self.trials[s.trial].candidate];
        Candidate {
            effect: name.effect.into(),
            at: name.at.clone(),
            of: name.of.clone(),
            predicted_drop: s.drop,
            error_before: self.before.error,
            error_after: None,
            accepted: false,
            tied_with: vec![],
            p_value: s.p_value,
            selected: self.selected.iter().find(|c| c.0 == self.trials[s.trial].candidate).map(|c| c.1),
            remark: remark.into(),
        }
    }

    /// The sparse combination against the candidate that was taken.
    fn second_opinion(&self, taken: Option<usize>, tied: &[usize]) -> SecondOpinion {
        let share = |(c, part): &(usize, f64)| Share { effect: self.names[*c].effect.into(), at: self.names[*c].at.clone(), part: *part };
        let needs: Vec<Share> = self.selected.iter().map(share).collect();
        let agrees = self.selected.first().map(|s| s.0).is_none_or(|first| taken == Some(first) || tied.contains(&first));
        let remark = needs.first().zip(taken).filter(|_| !agrees).map(|(first, taken)| {
            let (name, own) = (&self.names[taken], self.selected.iter().find(|s| s.0 == taken).map_or(0.0, |s| s.1));
            format!(
                "all candidates at once give {} at {} the largest part ({:.0} %), and {} at {} {}",
                first.effect,
                first.at,
                100.0 * first.part,
                name.effect,
                name.at,
                if own > 0.0 { format!("{:.0} %", 100.0 * own) } else { "none".into() }
            )
        });
        SecondOpinion { needs, agrees, remark }
    }

    fn weighed(&self, k: usize, refits: &[Refit], winner: Option<usize>, ties: &[usize], weighed: &str) -> Candidate {
        let mut c = self.blank(&refits[k].score, "");
        let label = |k: usize| {
            let name = &self.names[refits[k].candidate];
            format!("{} at {}", name.effect, name.at)
        };
        match &refits[k].result {
            Ok(proof) => {
                c.error_after = Some(proof.error);
                c.accepted = winner == Some(k);
                let (mean, error) = improved(self.before, proof);
                c.remark = format!(
                    "improves the mean squared residual by {mean:.3} +- {error:.3}{weighed}, cost {:.5e}{}",
                    verdict_cost(proof),
                    if proof.fitted.outcome.termination == Termination::MaxIterations { ", not converged" } else { "" }
                );
                if winner == Some(k) {
                    c.tied_with = ties.iter().map(|t| label(*t)).collect();
                } else if let Some(w) = winner.filter(|_| ties.contains(&k)) {
                    c.tied_with = vec![label(w)];
                }
            }
            Err(reason) => c.remark = format!("the refit failed: {reason}"),
        }
        c
    }
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
