//! Candidates of a step as they are told.

use crate::identify::Termination;

use super::candidates::{Name, Trial};
use super::refit::Refit;
use super::score::Score;
use super::step::{Move, Price, Stood};
use crate::diagnose::calibrate::weigh::Scale;
use crate::diagnose::results::Reason;
use crate::diagnose::results::{Candidate, SecondOpinion, Share};

/// Candidates as they are told.
pub(in crate::diagnose) struct Listed<'a> {
    pub names: &'a [Name],
    pub trials: &'a [Trial],
    /// The second opinion.
    pub selected: &'a [(usize, f64)],
    /// Pooled error before.
    pub error: f64,
}

/// What a race has come to.
pub(in crate::diagnose) struct Raced<'a> {
    pub refits: &'a [Refit],
    /// What was decided of each of them.
    pub reasons: &'a [Reason],
    /// Those that were weighed.
    pub stood: &'a [Stood],
    /// What was taken.
    pub taken: Option<&'a Move>,
}

impl Listed<'_> {
    /// Every candidate, the refitted ones first, and what all of them at once say. `best`: the best score of each.
    pub fn all(&self, raced: &Raced, best: &[Score], scale: &Scale, price: &Price) -> (Vec<Candidate>, SecondOpinion) {
        let Raced { refits, reasons, stood, taken } = raced;
        let tie = |s: &Stood| {
            let beside = |t: &Move| t.names.len() == 1 && t.names[0] != s.name && scale.tied(&s.weighed, &t.weighed).is_some();
            taken.is_some_and(beside)
        };
        let tied: Vec<&Name> = stood.iter().filter(|s| s.admissible && tie(s)).map(|s| &s.name).collect();
        let candidate = |s: &Score| self.trials[s.trial].candidate;
        let refitted = refits.iter().zip(*reasons).map(|(r, reason)| self.weighed(r, reason, stood, *taken, &tied));
        let rest = best.iter().filter(|s| !refits.iter().any(|r| r.candidate == candidate(s))).take(scale.settings.refits);
        let list = refitted.chain(rest.map(|s| self.blank(s, &price.left_out(candidate(s), s.drop)))).collect();
        let position = |n: &Name| self.names.iter().position(|own| own == n);
        let first = taken.and_then(|t| position(&t.names[0])).or(best.first().map(candidate));
        let positions: Vec<usize> = tied.iter().filter_map(|t| position(t)).collect();
        (list, self.second_opinion(first, &positions))
    }

    fn blank(&self, s: &Score, reason: &Reason) -> Candidate {
        let name = &self.names[self.trials[s.trial].candidate];
        Candidate {
            effect: name.effect.into(),
            at: name.at.clone(),
            of: name.of.clone(),
            predicted_drop: s.drop,
            error_before: self.error,
            error_after: None,
            accepted: false,
            tied_with: vec![],
            p_value: s.p_value,
            selected: self.selected.iter().find(|c| c.0 == self.trials[s.trial].candidate).map(|c| c.1),
            nats: None,
            reason: reason.clone(),
            remark: reason.describe(),
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

    fn weighed(&self, refit: &Refit, reason: &Reason, stood: &[Stood], taken: Option<&Move>, tied: &[&Name]) -> Candidate {
        let mut c = self.blank(&refit.score, reason);
        let name = &self.names[refit.candidate];
        let label = |n: &Name| format!("{} at {}", n.effect, n.at);
        c.error_after = refit.result.as_ref().ok().map(|p| p.error);
        if let Some(own) = stood.iter().find(|s| s.name == *name) {
            c.nats = Some(own.gain);
            if own.weighed.fitted.outcome.termination == Termination::MaxIterations {
                c.remark += ", not converged";
            }
        }
        let Some(taken) = taken else { return c };
        c.accepted = taken.names.contains(name);
        if c.accepted && taken.names.len() == 1 {
            c.tied_with = tied.iter().map(|t| label(t)).collect();
        } else if tied.contains(&name) {
            c.tied_with = vec![label(&taken.names[0])];
        }
        c
    }
}

/// Name and visible strength of each candidate.
pub(in crate::diagnose) fn visible(scores: &[Score], names: &[Name], trials: &[Trial]) -> Vec<(Name, f64)> {
    // The most visible shape of each candidate.
    let mut best: Vec<Option<f64>> = vec![None; names.len()];
    for s in scores {
        let slot = &mut best[trials[s.trial].candidate];
        *slot = Some(slot.map_or(s.visible, |v: f64| v.min(s.visible)));
    }
    names.iter().zip(best).filter_map(|(n, v)| Some((n.clone(), v?))).collect()
}
