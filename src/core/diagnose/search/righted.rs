//! Channels that say of themselves what is wrong with them: forces that are turned round, by a loop that gives energy where a device can only take it,
//! responses whose phase is opposite to that of a model of all tests, readings that are clipped, and channels that drift.

use std::sync::Arc;

use crate::identify::Monitor;
use crate::model::System;
use crate::response::{BlockKind, Plan};

use crate::diagnose::calibrate::approach::approached;
use crate::diagnose::calibrate::case::Case;
use crate::diagnose::results::{Instrument, SplitName};
use crate::diagnose::settings::Settings;

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

/// Mean over the lines of an FRF of the cosine of the angle between what is measured and what a model computes: 1 where they are in phase whatever their
/// size, -1 where the response is turned round. None of other tests.
fn in_phase(plan: &Plan, system: &System) -> Option<f64> {
    let block = plan.blocks.iter().find(|b| b.kind == BlockKind::Frf)?;
    let computed = plan.evaluate(system, &[], false).ok()?.values;
    let lines = plan.measured[block.range.clone()].chunks_exact(2).zip(computed[block.range.clone()].chunks_exact(2));
    let cosines: Vec<f64> =
        lines.map(|(m, h)| (m[0] * h[0] + m[1] * h[1]) / (m[0].hypot(m[1]) * h[0].hypot(h[1]))).filter(|c| c.is_finite()).collect();
    (!cosines.is_empty()).then(|| cosines.iter().sum::<f64>() / cosines.len() as f64)
}

/// The case with turned responses of FRFs put right, and what was turned. One is turned round where the model that comes nearest to all tests as they are is
/// opposite to it in phase, and the one that comes nearest with it turned back is in phase: a model far from its tests says neither.
pub fn phased(case: &Case, monitor: &Monitor) -> (Case, Vec<Instrument>) {
    let opposite = |k: usize, system: &System, below: f64| in_phase(&case.plans[k].0, system).is_some_and(|c| c < below);
    let suspect: Vec<usize> = (0..case.plans.len()).filter(|k| opposite(*k, &case.system, 0.0)).collect();
    let with = |turned: &[usize]| {
        let right =
            |(k, (p, s)): (usize, &(Plan, SplitName))| (if turned.contains(&k) { p.turned_round("response") } else { p.clone() }, *s);
        Case { plans: Arc::new(case.plans.iter().enumerate().map(right).collect()), ..case.clone() }
    };
    let near = |case: &Case| approached(case, &monitor.quiet()).ok().flatten().unwrap_or_else(|| case.system.clone());
    if suspect.is_empty() {
        return (case.clone(), vec![]);
    }
    let (plain, least) = (near(case), -case.search.settings.turned_phase);
    let suspect: Vec<usize> = suspect.into_iter().filter(|k| opposite(*k, &plain, least)).collect();
    if suspect.is_empty() {
        return (case.clone(), vec![]);
    }
    let system = near(&with(&suspect));
    let turned: Vec<usize> = suspect.into_iter().filter(|k| opposite(*k, &system, least)).collect();
    let told = |k: &usize| {
        let id = &case.plans[*k].0.id;
        let why =
            format!("the phase of {id} is opposite to that of a model of all tests: its response is turned round, and was turned back");
        Instrument { effect: "gain".into(), at: format!("{id}.response"), why, tied_with: vec![] }
    };
    let right = with(&turned);
    let is_right = |test: &str| turned.iter().any(|k| case.plans[*k].0.id == test);
    let refused = right.refused.iter().filter(|d| !is_right(&d.test)).cloned().collect();
    (Case { refused, ..right }, turned.iter().map(told).collect())
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

/// Channels of loops that go from cycle to cycle by more than a gain of one test has to move them, over the whole record and in parts of the rms of their
/// loop. The drift was taken out where the loop was settled, and the mean that is left is granted what it has gone by.
pub fn drifting(case: &Case) -> Vec<Instrument> {
    let least = case.search.settings.fault_gain;
    let of = |(plan, _): &(Plan, SplitName)| -> Vec<Instrument> {
        let blocks = plan.blocks.iter().zip(&plan.scatter).filter(|(b, s)| {
            let read = &plan.measured[b.range.clone()];
            let mean = read.iter().sum::<f64>() / read.len().max(1) as f64;
            let rms = (read.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / read.len().max(1) as f64).sqrt();
            s.crept.abs() > least * rms
        });
        let told = |(b, s): (&crate::response::Block, &crate::response::Scatter)| {
            let (id, role) = (&plan.id, &b.role);
            let why = format!(
                "the {role} of {id} goes by {} over its record, from cycle to cycle, which was taken out",
                b.stated.print_difference(s.crept)
            );
            Instrument { effect: "drift".into(), at: format!("{id}.{role}"), why, tied_with: vec![] }
        };
        blocks.map(told).collect()
    };
    case.plans.iter().flat_map(of).collect()
}
