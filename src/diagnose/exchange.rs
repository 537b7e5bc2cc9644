//! An effect that was added while another was still missing may stand where the two blur into one: a damper one connector off, a spring
//! for the friction that the other hid. Once the other is there, what the effect competed with is held against it again.

use crate::identify::Monitor;
use crate::model::Instance;
use crate::parallel;

use super::accept::{DECISIVE, tied, verdict_cost};
use super::candidates::Name;
use super::case::{Case, Fitted};
use super::refit::{Proof, prove};
use super::results::{EffectAt, Missing};

/// Rivals of an added effect that are held against it again.
pub const RIVALS: usize = 4;

/// What an added effect was weighed against, the cheapest first.
pub struct Rivals {
    /// The effect that was added.
    pub of: EffectAt,
    /// The others as they were fitted in its place.
    pub list: Vec<(Name, Instance)>,
}

/// What took the place of what.
pub struct Swap {
    /// The new law.
    pub added: EffectAt,
    /// The old one.
    pub removed: EffectAt,
    /// The new one, fitted, and what is tied with it.
    pub tied: Option<(Name, Fitted, Vec<(Name, Fitted)>)>,
}

/// Holds the effects that were added before the last (instances from `base` on, named by `missing` in their order) against their rivals,
/// with all the others in place, and makes the exchange that lowers the cost on fit and select most, by [`DECISIVE`] at least.
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
    let targeted = |k: usize| system.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.instance == k));
    let own = |k: usize| rivals.iter().find(|r| r.of.effect == missing[k].effect && r.of.at == missing[k].at);
    let stands = |n: &Name| system.instances.iter().any(|i| i.name() == n.effect && i.at == n.at);
    let earlier = (0..missing.len().saturating_sub(1)).filter(|k| !targeted(base + k));
    let trials: Vec<(usize, &Name, &Instance)> =
        earlier.filter_map(|k| Some((k, own(k)?))).flat_map(|(k, r)| r.list.iter().map(move |(n, i)| (k, n, i))).filter(|t| !stands(t.1)).collect();
    if trials.is_empty() || monitor.stops() {
        return None;
    }
    watch(&format!("holding {} rivals of earlier effects against them again", trials.len()));
    let now = prove(case, system, monitor).ok()?;
    let tried = |(k, _, instance): &(usize, &Name, &Instance)| -> Option<Proof> {
        let mut system = now.fitted.system.clone();
        system.instances[base + k] = (*instance).clone();
        prove(case, &system, monitor).ok()
    };
    let proofs = parallel::map(&trials, tried);
    let costs: Vec<f64> = proofs.iter().map(|p| p.as_ref().map_or(f64::INFINITY, verdict_cost)).collect();
    let best = (0..trials.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).filter(|b| costs[*b] < verdict_cost(&now) - DECISIVE)?;
    let (k, name, _) = trials[best];
    let proof = proofs[best].as_ref()?;
    let others = (0..trials.len()).filter(|t| *t != best && trials[*t].0 == k);
    let ties: Vec<(Name, Fitted)> = others
        .filter_map(|t| Some((trials[t].1.clone(), proofs[t].as_ref().filter(|p| tied(proof, p))?.fitted.clone())))
        .collect();
    let swap = Swap {
        added: EffectAt { effect: name.effect.into(), at: name.at.clone() },
        removed: EffectAt { effect: missing[k].effect.clone(), at: missing[k].at.clone() },
        tied: Some((name.clone(), proof.fitted.clone(), ties.clone())),
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
        tied_with: ties.iter().map(|(n, _)| format!("{} at {}", n.effect, n.at)).collect(),
    };
    *fitted = proof.fitted.clone();
    Some(swap)
}
