//! Which candidates are refitted. The score test looks at one candidate at a time, in the linear neighbourhood of a model that may be far
//! from the truth: what it ranks low is looked at as well where something else speaks for it.

use std::collections::BTreeMap;

use crate::effect::Role;

use super::candidates::{Name, Trial};
use super::refit::Refit;
use super::score::Score;

/// A candidate is refitted for its score when its predicted drop is at least this part of the best.
const WORTH: f64 = 0.05;
/// Part of the sparse combination from which its members are refitted, and how many.
const CARRIES: f64 = 0.1;
const OF_OPINION: usize = 3;
/// Leaders whose effects are tried at other places, the part of the greatest fall of the cost that makes one, and the places tried for both
/// together.
const LEADERS: usize = 2;
const LEADS: f64 = 0.5;
const ELSEWHERE: usize = 6;
/// Candidates refitted at the leader's place, with those that already are, and the part of the leader's predicted drop that they promise.
const AT_PLACE: usize = 6;
const RIVALS: f64 = 0.2;

/// By the scores, and by the second opinion. `best`: the best score of each candidate that is beyond chance, in order.
pub fn first(best: &[Score], selected: &[(usize, f64)], trials: &[Trial], refits: usize) -> Vec<Score> {
    let top = best.first().map_or(0.0, |s| s.drop);
    let mut picked: Vec<Score> = best.iter().filter(|s| s.drop >= WORTH * top).take(refits).copied().collect();
    for (candidate, _) in selected.iter().filter(|s| s.1 >= CARRIES).take(OF_OPINION) {
        let of = |s: &&Score| trials[s.trial].candidate == *candidate;
        if !picked.iter().any(|s| of(&s)) {
            picked.extend(best.iter().find(of));
        }
    }
    picked
}

/// By the refits, the cheapest first: other effects where the leader acts, which it may have crowded out of the list; and, unless the
/// leader already explains everything, the effects of the leaders at other places. `unexplained`: the cost without a candidate.
pub fn second(best: &[Score], refits: &[Refit], explained: bool, unexplained: f64, names: &[Name], trials: &[Trial]) -> Vec<Score> {
    let candidate = |s: &Score| trials[s.trial].candidate;
    let done = |s: &Score| refits.iter().any(|r| r.candidate == candidate(s));
    let acts = |c: usize| {
        let law = crate::effect::find(names[c].effect).is_ok_and(|e| matches!(e.info().role, Role::Force | Role::Series));
        law && names[c].of.is_none()
    };
    let fall = |r: &Refit| r.result.as_ref().map_or(0.0, |p| unexplained - p.fitted.outcome.cost);
    let most = refits.iter().map(fall).fold(0.0, f64::max);
    let lead = refits.iter().filter(|r| r.result.is_ok() && acts(r.candidate) && fall(r) >= LEADS * most);
    let leaders: Vec<usize> = lead.map(|r| r.candidate).take(LEADERS).collect();
    let Some(leader) = leaders.first() else { return vec![] };
    let promised = refits.iter().find(|r| r.candidate == *leader).map_or(0.0, |r| r.score.drop);
    let there = |c: usize| names[c].at == names[*leader].at;
    let at_place = AT_PLACE.saturating_sub(refits.iter().filter(|r| there(r.candidate)).count());
    let rivals = best.iter().filter(|s| !done(s) && there(candidate(s)) && acts(candidate(s)) && s.drop >= RIVALS * promised);
    let mut picked: BTreeMap<usize, Score> = rivals.take(at_place).map(|s| (candidate(s), *s)).collect();
    if !explained {
        let same = |s: &&Score| leaders.iter().any(|l| names[*l].effect == names[candidate(s)].effect);
        picked.extend(best.iter().filter(|s| !done(s)).filter(same).take(ELSEWHERE).map(|s| (candidate(s), *s)));
    }
    picked.into_values().collect()
}

/// Two that the second opinion needs together, at unlike places where it names such.
pub fn pair(best: &[Score], selected: &[(usize, f64)], names: &[Name], trials: &[Trial]) -> Option<[Score; 2]> {
    let of = |c: usize| best.iter().find(|s| trials[s.trial].candidate == c).copied();
    let mut carry = selected.iter().filter(|s| s.1 >= CARRIES).map(|s| s.0);
    let first = carry.next()?;
    let others: Vec<usize> = carry.collect();
    let second = others.iter().find(|c| names[**c].at != names[first].at).or(others.first())?;
    Some([of(first)?, of(*second)?])
}
