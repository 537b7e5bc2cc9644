//! Which candidates are refitted. The score test looks at one candidate at a time, in the linear neighbourhood of a model that may be far
//! from the truth: what it ranks low is looked at as well where something else speaks for it.

use std::collections::BTreeMap;

use crate::effect::Role;

use super::candidates::{Name, Trial};
use super::refit::Refit;
use super::score::Score;
use super::states::Wanted;
use crate::diagnose::settings::Race;
use crate::diagnose::settings::Settings;

/// By the scores, by what the states of the conditions want, by the second opinion, and by what they may gain. `best`: the best score of each candidate
/// that is beyond chance, in order. `bound`: what a score may gain; of a law in series its slope says little.
pub fn first(
    best: &[Score],
    wanted: &[Wanted],
    selected: &[(usize, f64)],
    bound: impl Fn(&Score) -> f64,
    trials: &[Trial],
    settings: &Settings,
) -> Vec<Score> {
    let race = &settings.race;
    let top = best.first().map_or(0.0, |s| s.drop);
    let mut picked: Vec<Score> = best.iter().filter(|s| s.drop >= race.worth * top).take(settings.refits).copied().collect();
    for (candidate, _) in selected.iter().filter(|s| s.1 >= race.carries).take(race.of_opinion) {
        let of = |s: &&Score| trials[s.trial].candidate == *candidate;
        if !picked.iter().any(|s| of(&s)) {
            picked.extend(best.iter().find(of));
        }
    }
    for w in wanted.iter().take(race.of_opinion) {
        let of = |s: &&Score| trials[s.trial].candidate == trials[w.trial].candidate;
        if !picked.iter().any(|s| of(&s)) {
            picked.push(best.iter().find(of).copied().unwrap_or_else(|| w.score()));
        }
    }
    let mut others: Vec<Score> =
        best.iter().filter(|s| !picked.iter().any(|p| trials[p.trial].candidate == trials[s.trial].candidate)).copied().collect();
    others.sort_by(|a, b| bound(b).total_cmp(&bound(a)));
    picked.extend(others.into_iter().take(race.of_bound));
    picked
}

/// A score whose law has a simpler one of its kind at its place, and the candidate that this is.
pub type Richer = (Score, usize);

/// Scores whose laws are the simplest of their kind at their places among `best`, in place of those that were picked of it, and these. Frictions with
/// memory are a kind: all of them stick, slide and turn back as elastic slip does, the richer with a softer knee at twenty times the cost.
pub fn by_kind(picked: &[Score], best: &[Score], names: &[Name], trials: &[Trial]) -> (Vec<Score>, Vec<Richer>) {
    let candidate = |s: &Score| trials[s.trial].candidate;
    let simpler = |s: &Score| {
        let own = names[candidate(s)].params_with_memory()?;
        let there = picked.iter().chain(best).filter(|b| names[candidate(b)].at == names[candidate(s)].at);
        let kin = there.filter_map(|b| Some((*b, names[candidate(b)].params_with_memory()?))).filter(|(_, params)| *params < own);
        kin.min_by_key(|(_, params)| *params).map(|(b, _)| b)
    };
    let (mut simple, mut richer): (Vec<Score>, Vec<Richer>) = (Vec::new(), Vec::new());
    for s in picked {
        let first = simpler(s);
        richer.extend(first.map(|of| (*s, candidate(&of))));
        let goes = first.unwrap_or(*s);
        if !simple.iter().any(|o| candidate(o) == candidate(&goes)) {
            simple.push(goes);
        }
    }
    (simple, richer)
}

/// Of the richer laws those whose simpler kin takes away as much of the cost as a leader does, where one `stands`, or could not be fitted. `unexplained`: the
/// cost without a candidate.
pub fn following(richer: &[Richer], refits: &[Refit], stands: bool, unexplained: f64, race: &Race) -> Vec<Score> {
    let fall = |r: &Refit| r.result.as_ref().map_or(0.0, |p| unexplained - p.fitted.outcome.cost);
    let most = refits.iter().map(fall).fold(0.0, f64::max);
    let leads = |c: usize| refits.iter().any(|r| r.candidate == c && (r.result.is_err() || (stands && fall(r) >= race.leads * most)));
    richer.iter().filter(|(_, of)| leads(*of)).map(|(s, _)| *s).collect()
}

/// By the refits, the cheapest first: the next in the list for what could not be fitted; where one of them `stands`, other effects where the leader acts, which
/// it may have crowded out of the list; and, unless the leader already explains everything, the effects of the leaders at other places. `unexplained`: the
/// cost without a candidate.
pub fn second(
    best: &[Score],
    refits: &[Refit],
    (stands, explained): (bool, bool),
    unexplained: f64,
    names: &[Name],
    trials: &[Trial],
    race: &Race,
) -> Vec<Score> {
    let candidate = |s: &Score| trials[s.trial].candidate;
    let done = |s: &Score| refits.iter().any(|r| r.candidate == candidate(s));
    let acts = |c: usize| {
        let law = crate::effect::find(names[c].effect).is_ok_and(|e| matches!(e.info().role, Role::Force | Role::Series));
        law && names[c].of.is_none()
    };
    let fall = |r: &Refit| r.result.as_ref().map_or(0.0, |p| unexplained - p.fitted.outcome.cost);
    let most = refits.iter().map(fall).fold(0.0, f64::max);
    // Dry friction has no FRF of small motion: at every place it would take the turns of those that have.
    let failed = refits.iter().filter(|r| r.result.is_err()).count();
    let mut picked: BTreeMap<usize, Score> = best.iter().filter(|s| !done(s)).take(failed).map(|s| (candidate(s), *s)).collect();
    let lead = refits.iter().filter(|r| r.result.is_ok() && acts(r.candidate) && fall(r) >= race.leads * most);
    let leaders: Vec<usize> = lead.map(|r| r.candidate).take(race.leaders).collect();
    let Some(leader) = leaders.first().filter(|_| stands) else { return picked.into_values().collect() };
    let promised = refits.iter().find(|r| r.candidate == *leader).map_or(0.0, |r| r.score.drop);
    let there = |c: usize| names[c].at == names[*leader].at;
    let at_place = race.at_place.saturating_sub(refits.iter().filter(|r| r.result.is_ok() && there(r.candidate)).count());
    let rivals = best.iter().filter(|s| !done(s) && there(candidate(s)) && acts(candidate(s)) && s.drop >= race.rivals * promised);
    picked.extend(rivals.take(at_place).map(|s| (candidate(s), *s)));
    if !explained {
        let same = |s: &&Score| leaders.iter().any(|l| names[*l].effect == names[candidate(s)].effect);
        picked.extend(best.iter().filter(|s| !done(s)).filter(same).take(race.elsewhere).map(|s| (candidate(s), *s)));
    }
    picked.into_values().collect()
}

/// Two that the second opinion needs together, at unlike places where it names such.
pub fn pair(best: &[Score], selected: &[(usize, f64)], names: &[Name], trials: &[Trial], race: &Race) -> Option<[Score; 2]> {
    let of = |c: usize| best.iter().find(|s| trials[s.trial].candidate == c).copied();
    let mut carry = selected.iter().filter(|s| s.1 >= race.carries).map(|s| s.0);
    let first = carry.next()?;
    let others: Vec<usize> = carry.collect();
    let second = others.iter().find(|c| names[**c].at != names[first].at).or(others.first())?;
    Some([of(first)?, of(*second)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::find;
    use crate::model::{Instance, ParamValue, Site};

    fn trial(effect: &str, candidate: usize) -> Trial {
        let effect = find(effect).unwrap();
        let params = effect.info().params.iter().map(|p| ParamValue::fixed(p.default)).collect();
        Trial { instance: Instance::new(effect, "c1.x", Site::Places(vec![0]), params), candidate }
    }

    fn score(trial: usize, drop: f64) -> Score {
        Score { trial, z: 3.0, drop, strength: 1.0, p_value: 0.01, visible: 0.0 }
    }

    /// Eight frictions lead by their slope; of a law in series the slope says little, and it is refitted for what it may gain.
    #[test]
    fn what_a_slope_hides_is_refitted_for_its_bound() {
        let settings = Settings::default();
        let laws =
            ["coulomb", "stribeck", "smooth_coulomb", "elastic_slip", "iwan", "bouc_wen", "lugre", "film", "cubic_stiffness", "backlash"];
        let trials: Vec<Trial> = laws.iter().enumerate().map(|(k, law)| trial(law, k)).collect();
        let best: Vec<Score> = (0..laws.len()).map(|k| score(k, 0.9 - 0.05 * k as f64)).collect();
        let bound = |s: &Score| s.drop * if laws[s.trial] == "backlash" { settings.promise_series } else { settings.promise };
        let picked: Vec<usize> = first(&best, &[], &[], bound, &trials, &settings).iter().map(|s| s.trial).collect();
        assert_eq!(picked[..settings.refits], (0..settings.refits).collect::<Vec<_>>());
        assert_eq!(picked[settings.refits..], [9, 8], "the play before the spring that scores higher");
    }

    #[test]
    fn the_second_opinion_is_refitted_whatever_it_scores() {
        let settings = Settings::default();
        let trials: Vec<Trial> = (0..12).map(|k| trial("coulomb", k)).collect();
        let best: Vec<Score> = (0..12).map(|k| score(k, if k == 11 { 1e-6 } else { 0.9 - 0.01 * k as f64 })).collect();
        let picked = first(&best, &[], &[(11, 0.5), (10, 1e-6)], |s| s.drop, &trials, &settings);
        assert!(picked.iter().any(|s| s.trial == 11));
        assert_eq!(picked.len(), settings.refits + 1 + settings.race.of_bound, "10 carries nothing and is picked for its bound alone");
    }

    #[test]
    fn what_cannot_be_fitted_leaves_its_turn_to_the_next() {
        let settings = Settings::default();
        let trials: Vec<Trial> = (0..6).map(|k| trial("coulomb", k)).collect();
        let name = |k: usize| Name { effect: "coulomb", at: format!("c{k}.x"), of: None };
        let best: Vec<Score> = (0..6).map(|k| score(k, 0.9 - 0.1 * k as f64)).collect();
        let failed = |k: usize| Refit { candidate: k, score: best[k], result: Err("no small-amplitude limit".into()) };
        let refits: Vec<Refit> = [0, 1, 2].into_iter().map(failed).collect();
        let names: Vec<Name> = (0..6).map(name).collect();
        let next = second(&best, &refits, (true, false), 1.0, &names, &trials, &settings.race);
        assert_eq!(next.iter().map(|s| s.trial).collect::<Vec<_>>(), [3, 4, 5]);
        let next = second(&best, &refits[..1], (true, false), 1.0, &names, &trials, &settings.race);
        assert_eq!(next.iter().map(|s| s.trial).collect::<Vec<_>>(), [1], "one for one");
    }

    /// Elastic slip goes before Bouc and Wen at its place; they follow where it cannot be fitted, and go first where it does not stand.
    #[test]
    fn of_frictions_with_memory_the_simplest_goes_first() {
        let of = [("bouc_wen", "c1.x"), ("elastic_slip", "c1.x"), ("bouc_wen", "c2.x"), ("maxwell", "c1.x"), ("springpot", "c1.x")];
        let names: Vec<Name> = of.iter().map(|(effect, at)| Name { effect, at: (*at).into(), of: None }).collect();
        let trials: Vec<Trial> = of.iter().enumerate().map(|(k, (law, _))| trial(law, k)).collect();
        let picked: Vec<Score> = (0..of.len()).map(|k| score(k, 0.5)).collect();
        // Bouc and Wen alone were picked: elastic slip goes in their place where it may gain.
        let (alone, follows) = by_kind(&picked[..1], &picked, &names, &trials);
        assert_eq!((alone[0].trial, follows[0].0.trial, alone.len()), (1, 0, 1));
        let (simple, richer) = by_kind(&picked, &picked, &names, &trials);
        assert_eq!(simple.iter().map(|s| s.trial).collect::<Vec<_>>(), [1, 2, 3, 4]);
        assert_eq!(richer.iter().map(|(s, of)| (s.trial, *of)).collect::<Vec<_>>(), [(0, 1)]);
        let failed = Refit { candidate: 1, score: picked[1], result: Err("no steady response".into()) };
        assert_eq!(following(&richer, &[failed], false, 1.0, &Race::default()).len(), 1);
        assert!(following(&richer, &[], true, 1.0, &Race::default()).is_empty());
    }
}
