//! Channels that say of themselves what is wrong with them: forces that are turned round, by a loop that gives energy where a device can only take it, and
//! readings that are clipped.

use std::sync::Arc;

use crate::response::{BlockKind, Plan};

use super::case::Case;
use super::results::{Instrument, SplitName};
use super::settings::Settings;

/// Whether a test's force channel is turned round; none for tests without a driven loop of a force.
fn turned(plan: &Plan, s: &Settings) -> Option<bool> {
    let block = plan.blocks.iter().find(|b| b.kind == BlockKind::Loop && b.role == "force" && !b.x.is_empty() && !b.v.is_empty())?;
    let force = &plan.measured[block.range.clone()];
    let along = |u: &[f64]| {
        let n = u.len().max(1) as f64;
        let (mf, mu) = (force.iter().sum::<f64>() / n, u.iter().sum::<f64>() / n);
        let dot: f64 = force.iter().zip(u).map(|(f, u)| (f - mf) * (u - mu)).sum();
        let size = |v: &[f64], m: f64| v.iter().map(|v| (v - m).powi(2)).sum::<f64>().sqrt();
        dot / (size(force, mf) * size(u, mu)).max(f64::MIN_POSITIVE)
    };
    Some(along(&block.v) < s.turned_gives && along(&block.x) < s.turned_stands)
}

/// The case with turned force channels put right, and what was turned: all of them, or those of single tests where others take energy. Of the
/// held-out tests only the sign is looked at.
pub fn righted(case: &Case) -> (Case, Vec<Instrument>) {
    let loops: Vec<(usize, bool)> =
        case.plans.iter().enumerate().filter_map(|(k, (p, _))| Some((k, turned(p, &case.search.settings)?))).collect();
    let (odd, count) = (loops.iter().filter(|l| l.1).count(), loops.len());
    if odd == 0 || (odd < count && 2 * odd >= count) {
        return (case.clone(), vec![]);
    }
    let named = |at: String, why: String| Instrument { effect: "gain".into(), at, why, tied_with: vec![] };
    let found = if odd == count {
        vec![named("*.force".into(), "every loop gives energy: the force channel is turned round, and was turned back".into())]
    } else {
        let one = |k: usize| {
            let id = &case.plans[k].0.id;
            named(
                format!("{id}.force"),
                format!("the force of {id} gives energy where that of the others takes it: it is turned round, and was turned back"),
            )
        };
        loops.iter().filter(|l| l.1).map(|l| one(l.0)).collect()
    };
    let right = |(k, (p, s)): (usize, &(Plan, SplitName))| {
        let turn = loops.iter().any(|l| l.0 == k && l.1);
        (if turn { p.turned_round("force") } else { p.clone() }, *s)
    };
    (Case { plans: Arc::new(case.plans.iter().enumerate().map(right).collect()), ..case.clone() }, found)
}

/// The case without the tests that have a clipped channel, and what is clipped. Where a channel stands at its extreme in half of its tests or more it is the
/// device that does, as one that slides: these are kept, and so is the last fitted test.
pub fn unclipped(case: &Case) -> (Case, Vec<Instrument>) {
    let reads = |p: &Plan, role: &str| p.blocks.iter().any(|b| b.kind == BlockKind::Loop && b.role == role);
    let all = |role: &str| case.plans.iter().filter(|(p, _)| reads(p, role)).count();
    let odd = |role: &str| case.plans.iter().filter(|(p, _)| p.clipped.iter().any(|c| c.0 == role)).count();
    let faults = |p: &Plan| -> Vec<Instrument> {
        let own = p.clipped.iter().filter(|(role, _)| 2 * odd(role) < all(role));
        own.map(|(role, why)| Instrument {
            effect: "clipping".into(),
            at: format!("{}.{role}", p.id),
            why: format!("{why}; the test is left out"),
            tied_with: vec![],
        })
        .collect()
    };
    let kept: Vec<(Plan, SplitName)> = case.plans.iter().filter(|(p, _)| faults(p).is_empty()).cloned().collect();
    if kept.len() == case.plans.len() || !kept.iter().any(|(_, s)| *s == SplitName::Fit) {
        return (case.clone(), vec![]);
    }
    let found = case.plans.iter().flat_map(|(p, _)| faults(p)).collect();
    (Case { plans: Arc::new(kept), ..case.clone() }, found)
}
