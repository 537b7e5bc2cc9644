//! A law that ends at the edge of its shapes says that a simpler one does its work: a power law of velocity whose exponent falls to its
//! bound is Coulomb friction. The simpler law takes its place where that costs less than the parameters it saves are worth.

use crate::effect::{Effect, Kind, LIBRARY, Role};
use crate::identify::Monitor;
use crate::response::Plan;

use super::Search;
use super::candidates::{Scene, candidates};
use super::case::{Case, Fitted};
use super::exchange::Swap;
use super::refit::{Bench, best_per_candidate, cost, whitened};
use super::results::{EffectAt, Missing, SplitName};
use super::score::score;

/// Simpler laws that are refitted for each that ends at a bound.
const REFITS: usize = 3;

/// Looks at the effects from index `base` on, which the search has added (`missing`, in their order); the first that a simpler law replaces at a rise of the cost
/// below `worth` per parameter saved is replaced.
pub fn simplify(
    case: &Case,
    fitted: &mut Fitted,
    base: usize,
    missing: &mut Vec<Missing>,
    worth: f64,
    monitor: &Monitor,
    watch: &(dyn Fn(&str) + Sync),
) -> Option<Swap> {
    let fits = case.plans_of(SplitName::Fit);
    let all: Vec<&Plan> = fits.iter().copied().chain(case.plans_of(SplitName::Select)).collect();
    let Ok(now) = whitened(&all, &fitted.system).map(|w| cost(&w)) else { return None };
    let bound = fitted.options.constraints.at_bound(&fitted.outcome.p);
    for k in base..fitted.system.instances.len() {
        let old = &fitted.system.instances[k];
        let info = old.effect.info();
        let shape_at_bound = bound.iter().any(|(i, _)| {
            let f = &fitted.free[*i];
            f.instance == k && info.params[f.param].kind == Kind::Shape
        });
        let targeted = fitted.system.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.instances.iter().any(|i| *i >= k)));
        if info.role != Role::Force || !shape_at_bound || targeted {
            continue;
        }
        let fitted_params = |e: &Effect| e.info().params.iter().filter(|p| p.kind != Kind::Setting).count();
        let size = old.params.iter().filter(|p| p.free).count();
        let simpler = LIBRARY.iter().filter(|e| e.info().role == Role::Force && fitted_params(e) < size);
        let search = Search {
            effects: Some(simpler.map(|e| e.info().name.to_string()).collect()),
            places: Some(vec![old.at.clone()]),
            max_added: None,
        };
        let narrow = Case { search, ..case.clone() };
        let mut without = fitted.system.clone();
        without.instances.remove(k);
        let scene = Scene::new(&fits, &without);
        let (names, trials) = candidates(&narrow, &without, &fits, &scene);
        let free = without.free().len();
        // A model that cannot be computed without it has nothing simpler.
        let Ok(scores) = score(&fits, &without, &trials, &vec![false; free], &[], case.seed) else { continue };
        let picked: Vec<_> = best_per_candidate(&scores.list, &trials).into_iter().take(REFITS).collect();
        let bench = Bench { case: &narrow, base: &without, names: &names, trials: &trials, scores: &scores, monitor };
        let refits = bench.refit_all(&picked, None, watch);
        let rise = |r: &super::refit::Refit| r.result.as_ref().map_or(f64::INFINITY, |p| cost(&p.fit) + cost(&p.select) - now);
        let Some(best) = refits.into_iter().min_by(|a, b| rise(a).total_cmp(&rise(b))) else { continue };
        let (rise, name) = (rise(&best), &names[best.candidate]);
        let Ok(proof) = best.result else { continue };
        if rise >= worth * (size - (proof.fitted.free.len() - free)) as f64 {
            continue;
        }
        let swap = Swap {
            added: EffectAt { effect: name.effect.into(), at: name.at.clone() },
            removed: EffectAt { effect: info.name.into(), at: old.at.clone() },
            tied: None,
        };
        watch(&format!("{} at {} takes the place of {}, which ended at a bound", swap.added.effect, swap.added.at, swap.removed.effect));
        missing.remove(k - base);
        // What the old law was tied with was weighed before the effects that came after it.
        let tied_with = if swap.added == swap.removed { vec![] } else { vec![format!("{} at {}", swap.removed.effect, swap.removed.at)] };
        missing.push(Missing { effect: swap.added.effect.clone(), at: swap.added.at.clone(), of: name.of.clone(), tied_with });
        *fitted = proof.fitted;
        return Some(swap);
    }
    None
}
