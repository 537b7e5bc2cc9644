//! Strengths of records where each record has them.

use crate::evidence::{Counts, Evidence, Seen, Variances};
use crate::model::{FreeParam, System};
use crate::parallel;
use crate::response::{Plan, Stray};
use std::sync::Arc;

use super::settings::Settings;

/// Computes the records at the strengths at which they are likeliest (Gauss and Newton, a step halved where it leads nowhere), until that makes them likelier
/// by no more than fits leave unfound; whether any moved.
pub fn astray(
    (evidence, counts, v): (&Evidence, &Counts, &Variances),
    plans: &[&Plan],
    (system, free): (&System, &[FreeParam]),
    seen: &mut [Seen],
    settings: &Settings,
) -> bool {
    let one = |t: usize| {
        let mut best = seen[t].clone();
        // Where strengths do not scatter there is nothing to look for.
        if !evidence.adds_up(t) || v.omega <= evidence.settings.no_scatter {
            return None;
        }
        let mut cost = evidence.cost_at_strays(t, &best, counts, v);
        let mut moved = false;
        for _ in 0..settings.strays {
            let Some(wanted) = evidence.likeliest_strays(t, &best, counts, v) else { break };
            let at = |part: f64| -> Option<Seen> {
                let by = best.strays.iter().zip(wanted.iter()).map(|((n, d), w)| (n.clone(), d + part * (w - d)));
                let plan = plans[t].strayed(Some(Arc::new(Stray { by: by.collect(), ahead: vec![] })));
                let c = plan.evaluate(system, free, true).ok()?;
                let finite = c.values.iter().chain(&c.slopes).all(|v| v.is_finite());
                finite.then(|| evidence.records[t].see(&plan, &c, system, free))
            };
            let nearer = [1.0, 0.5, 0.25].iter().find_map(|part| {
                let there = at(*part)?;
                let left = evidence.cost_at_strays(t, &there, counts, v);
                (left < cost).then_some((there, left))
            });
            let Some((there, left)) = nearer else { break };
            let gained = cost - left;
            (best, cost, moved) = (there, left, true);
            if gained <= settings.settled {
                break;
            }
        }
        moved.then_some(best)
    };
    let found = parallel::over(plans.len(), one);
    let mut moved = false;
    for (seen, found) in seen.iter_mut().zip(found) {
        if let Some(found) = found {
            (*seen, moved) = (found, true);
        }
    }
    moved
}
