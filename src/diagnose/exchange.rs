//! An effect that was added while another was still missing may stand where the two blur into one: a damper one connector off, a spring
//! for the friction that the other hid. Once the other is there, what the effect competed with is held against it again.

use crate::identify::Monitor;
use crate::model::{Instance, System};
use crate::parallel;

use super::accept::{DECISIVE, far, tied, verdict_cost};
use super::candidates::Name;
use super::case::{Case, Fitted};
use super::refit::{Proof, looked, prove};
use super::results::{EffectAt, Missing};

/// Rivals of an added effect that are held against it again.
pub const RIVALS: usize = 4;

/// Part of the cost that an exchange must take away where the model is far from the noise. There it is the place that may be wrong: laws at
/// one place then differ by what none of them has.
const WORTH_FAR: f64 = 0.1;

/// What an added effect was weighed against, the cheapest first.
pub struct Rivals {
    /// The effect that was added.
    pub of: EffectAt,
    /// The others as they were fitted in its place.
    pub list: Vec<(Name, Instance)>,
}

/// A candidate as it was fitted, with those that the tests do not tell from it.
pub struct Tied {
    /// The candidate.
    pub name: Name,
    /// Its fit.
    pub best: Fitted,
    /// The others.
    pub rivals: Vec<(Name, Fitted)>,
}

/// What took the place of what.
pub struct Swap {
    /// The new law.
    pub added: EffectAt,
    /// The old one.
    pub removed: EffectAt,
    /// The new one, fitted, and what is tied with it.
    pub tied: Option<Tied>,
}

/// Holds the effects that were added before the last (instances from `base` on, named by `missing` in their order) against their rivals,
/// with all the others in place, and makes the exchange that lowers the cost on fit and select most: by [`DECISIVE`] at least; where the
/// model is far from the noise by a tenth, and only rivals at other places are tried.
pub fn exchange(
    case: &Case,
    fitted: &mut Fitted,
    base: usize,
    missing: &mut [Missing],
    rivals: &[Rivals],
    monitor: &Monitor,
    watch: &(dyn Fn(&str) + Sync),
) -> Option<Swap> {
    let system = &fitted.system;
    let targeted = |k: usize| system.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.instances.contains(&k)));
    let own = |k: usize| rivals.iter().find(|r| r.of.effect == missing[k].effect && r.of.at == missing[k].at);
    let stands = |n: &Name| system.instances.iter().any(|i| i.name() == n.effect && i.at == n.at);
    let earlier = (0..missing.len().saturating_sub(1)).filter(|k| !targeted(base + k));
    let trials: Vec<(usize, &Name, &Instance)> = earlier
        .filter_map(|k| Some((k, own(k)?)))
        .flat_map(|(k, r)| r.list.iter().map(move |(n, i)| (k, n, i)))
        .filter(|t| !stands(t.1))
        .collect();
    let n = fitted.outcome.n_residuals.max(1);
    let far = far((2.0 * fitted.outcome.cost / n as f64).sqrt());
    let trials: Vec<_> = trials.into_iter().filter(|(k, name, _)| !far || name.at != missing[*k].at).collect();
    if trials.is_empty() || monitor.stops() {
        return None;
    }
    watch(&format!("holding {} rivals of earlier effects against them again", trials.len()));
    // Which can be better shows after some steps, and in coarser ones.
    let rough = case.coarser();
    let rough = rough.as_ref().unwrap_or(case);
    let here = looked(rough, system, monitor)?;
    let look = |(k, _, instance): &(usize, &Name, &Instance)| -> Option<System> {
        let mut system = here.system.clone();
        system.instances[base + k] = (*instance).clone();
        let found = looked(rough, &system, monitor)?;
        (found.outcome.cost < here.outcome.cost).then_some(found.system)
    };
    let better = parallel::map(&trials, look);
    if better.iter().all(Option::is_none) {
        return None;
    }
    let now = prove(case, system, monitor).ok()?;
    let proofs: Vec<Option<Proof>> = parallel::map_into(better, |_, system| prove(case, &system?, monitor).ok());
    let costs: Vec<f64> = proofs.iter().map(|p| p.as_ref().map_or(f64::INFINITY, verdict_cost)).collect();
    let before = verdict_cost(&now);
    let worth = if far { (WORTH_FAR * before).max(DECISIVE) } else { DECISIVE };
    let best = (0..trials.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).filter(|b| costs[*b] < before - worth)?;
    let (k, name, _) = trials[best];
    let proof = proofs[best].as_ref()?;
    let others = (0..trials.len()).filter(|t| *t != best && trials[*t].0 == k);
    let ties: Vec<(Name, Fitted)> =
        others.filter_map(|t| Some((trials[t].1.clone(), proofs[t].as_ref().filter(|p| tied(proof, p))?.fitted.clone()))).collect();
    let swap = Swap {
        added: EffectAt { effect: name.effect.into(), at: name.at.clone() },
        removed: EffectAt { effect: missing[k].effect.clone(), at: missing[k].at.clone() },
        tied: Some(Tied { name: name.clone(), best: proof.fitted.clone(), rivals: ties.clone() }),
    };
    watch(&format!(
        "{} at {} takes the place of {} at {}, now that {} at {} is there",
        swap.added.effect,
        swap.added.at,
        swap.removed.effect,
        swap.removed.at,
        missing[missing.len() - 1].effect,
        missing[missing.len() - 1].at
    ));
    missing[k] = Missing {
        effect: swap.added.effect.clone(),
        at: swap.added.at.clone(),
        of: name.of.clone(),
        tied_with: ties.iter().map(|(n, _)| format!("{} at {}", n.effect, n.at)).collect(),
    };
    *fitted = proof.fitted.clone();
    Some(swap)
}
