//! Tests at other values of a condition, as proposals for what separates tied models: other shims, another temperature, another load.

use std::collections::BTreeSet;

use crate::data::TestKind;
use crate::model::{Level, System};
use crate::response::{Plan, Variation};
use crate::units::Unit;

use crate::diagnose::settings::Proposals;

/// Every test and value of a condition that is tried: of each set of channels one test, of each condition on which any of the `systems` depends the
/// middle of what was tested, and values beyond both ends.
pub(crate) fn variations<'a>(plans: &[&'a Plan], systems: &[&System], s: &Proposals) -> Vec<(&'a Plan, Variation)> {
    let acting: BTreeSet<&str> = systems.iter().flat_map(|system| acting(system)).collect();
    let mut list = Vec::new();
    for plan in representative(plans) {
        for (at, (name, own)) in plan.conditions.iter().enumerate().filter(|(_, (name, _))| acting.contains(name.as_str())) {
            let tested = plans.iter().filter_map(|p| p.conditions.get(name)).copied();
            let condition = |level: f64| Variation { condition: Some((at, level)), ..Variation::default() };
            list.extend(levels(tested, s).filter(|level| level != own).map(|level| (plan, condition(level))));
        }
    }
    list
}

/// Conditions over which a law of this system acts, or which a load of it is.
fn acting(system: &System) -> impl Iterator<Item = &str> {
    let over = system.instances.iter().filter_map(|i| Some(i.target.as_ref()?.condition.as_str()));
    let loads = system.model.loads.iter().flat_map(|l| &l.path).filter_map(|level| match level {
        Level::Condition(name, _) => Some(name.as_str()),
        Level::Value(_) => None,
    });
    over.chain(loads)
}

/// One test of each set of channels that can be run at another condition: of cycles the one of the largest amplitude, else the first.
fn representative<'a>(plans: &[&'a Plan]) -> Vec<&'a Plan> {
    let channels = |p: &Plan| (p.kind, p.blocks.iter().map(|b| b.label.clone()).collect::<Vec<_>>());
    let size = |p: &Plan| p.cycle_drive().map_or(0.0, |d| d.amplitude);
    let mut of: Vec<&Plan> = Vec::new();
    for plan in plans.iter().filter(|p| matches!(p.kind, TestKind::Cycle | TestKind::Frf | TestKind::Modal)) {
        match of.iter_mut().find(|other| channels(other) == channels(plan)) {
            Some(other) if size(plan) > size(other) => *other = plan,
            Some(_) => {}
            None => of.push(plan),
        }
    }
    of
}

/// The middle of the values that were tested and one beyond either end by half of their range, or by a part of the value where there is only one. What
/// is above zero in every test stays so.
fn levels(tested: impl Iterator<Item = f64>, s: &Proposals) -> impl Iterator<Item = f64> {
    let (low, high) = tested.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let beyond = if high > low { 0.5 * (high - low) } else { s.beyond * high.abs() };
    let least = if low > 0.0 { low / s.reach } else { f64::NEG_INFINITY };
    let mut levels = vec![(low - beyond).max(least), 0.5 * (low + high), high + beyond];
    levels.dedup();
    levels.into_iter().filter(|v| v.is_finite())
}

/// Name and value of the condition that is changed, for a reader and in SI: four digits, as one would set it.
pub(crate) fn printed(plan: &Plan, at: usize, level: f64) -> Option<(String, String, f64)> {
    let name = plan.conditions.keys().nth(at)?;
    let printed = plan
        .condition_units
        .get(name)
        .map_or_else(|| format!("{level:.4}"), |unit: &Unit| unit.print(unit.to_si(round(unit.from_si(level)))));
    Some((name.clone(), printed, level))
}

fn round(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}
