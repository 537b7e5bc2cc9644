//! Two effects of which none gains alone.

use crate::effect::Role;
use crate::model::System;
use crate::parallel;

use super::candidates::Name;
use super::refit::Bench;
use super::score::Score;
use super::step::{Against, Move, Stood, role};
use crate::diagnose::trace;

/// The pair that gains most, of those that stood best alone and of those that a sparse combination needs together. `singles`: candidates of which it
/// may be made.
pub(in crate::diagnose) fn in_pairs(a: &Against, stood: &[Stood], bench: &Bench, singles: f64, sparse: Option<[Score; 2]>) -> Option<Move> {
    let (scale, s) = (a.scale, &a.scale.settings);
    if !scale.errs(a.base) {
        return None;
    }
    let acts = |n: &Name| matches!(role(n), Some(Role::Force | Role::Series)) && n.of.is_none();
    let alone: Vec<&Stood> = stood.iter().filter(|q| acts(&q.name)).take(s.pair_of).collect();
    let tried = (0.5 * singles * (singles - 1.0)).max(1.0);
    let above = |q: &Stood| (q.weighed.likelihood - a.base.likelihood).max(0.0);
    let price = |sizes: usize| 0.5 * (sizes as f64 - 2.0 * a.base.size() as f64) * scale.counts.n.ln() + (tried / a.odds()).ln();
    let mut pairs: Vec<([Name; 2], System)> = Vec::new();
    for (k, first) in alone.iter().enumerate() {
        for second in &alone[k + 1..] {
            let promises = s.promise_pair * (above(first) + above(second)) >= price(first.weighed.size() + second.weighed.size()) - s.tie;
            pairs.extend(
                together(first, second, s.pair_part).filter(|_| promises).map(|system| ([first.name.clone(), second.name.clone()], system)),
            );
        }
    }
    let named = |s: &Score| bench.names[bench.trials[s.trial].candidate].clone();
    if let Some(both) = sparse.filter(|both| both.iter().all(|s| acts(&named(s)))) {
        let names = [named(&both[0]), named(&both[1])];
        pairs.extend(bench.together(&both).ok().map(|secant| (names, secant.system)));
    }
    if pairs.is_empty() || trace::stopped(a.monitor) {
        return None;
    }
    (a.watch)(&format!("weighing {} pairs", pairs.len()));
    let weigh = |(names, system): &([Name; 2], System)| {
        let weighed = scale.weigh(system, &a.base.v, a.monitor).ok()?;
        let gain = scale.gain(&weighed, a.base, tried / a.odds());
        Some(Move { names: names.to_vec(), weighed, gain })
    };
    let found = parallel::map(&pairs, weigh);
    let best = found.into_iter().flatten().max_by(|a, b| a.gain.total_cmp(&b.gain));
    best.filter(|m| scale.better(m.gain, &m.weighed, a.base, a.monitor).yes)
}

/// The first as it was fitted with the second beside it, each at this part of its strength.
fn together(first: &Stood, second: &Stood, part: f64) -> Option<System> {
    let mut system = first.weighed.fitted.system.clone();
    system.instances.push(second.weighed.fitted.system.instances.last()?.clone());
    let from = system.instances.len() - 2;
    system.instances[from..].iter_mut().for_each(|i| i.params[0].value *= part);
    Some(system)
}
