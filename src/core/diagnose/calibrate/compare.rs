//! A model as it stands against its tests.

use crate::data::TestKind;
use crate::model::System;
use crate::parallel::{self, Watch};
use crate::residual::test_error;
use crate::response::{BlockKind, Computed, Plan};

use super::case::Case;
use super::damping::{constant_damping, fitted_ratio};
use super::factors::factors;
use super::mode_energy::modes;
use crate::diagnose::DiagnoseError;
use crate::diagnose::results::*;

/// Holds the tests of the given splits against a system. What is told of them beyond that and asks for more evaluations is left out once `watch` has ended.
pub fn compare(case: &Case, system: &System, splits: &[SplitName], watch: &Watch) -> Result<Vec<TestResult>, DiagnoseError> {
    let wanted: Vec<&(Plan, SplitName)> = case.plans.iter().filter(|(_, split)| splits.contains(split)).collect();
    let ratio = fitted_ratio(case);
    let one = |(plan, split): &&(Plan, SplitName)| {
        let computed = plan.evaluate(system, &[], false)?;
        let constant_damping = constant_damping(plan, *split, &computed, ratio, case.search.settings.telling.standard_errors);
        Ok(TestResult {
            constant_damping,
            modes: modes(plan, system, &case.search.settings.telling),
            factors: parallel::watched(watch, || factors(plan, system, &computed, &case.search.settings.telling)),
            ..test_result(plan, *split, &computed)
        })
    };
    parallel::map(&wanted, one).into_iter().collect()
}

/// One test against a system: its errors and curves, without what asks for further evaluations (factors, constant damping).
pub fn glance(plan: &Plan, split: SplitName, system: &System) -> Result<TestResult, DiagnoseError> {
    Ok(test_result(plan, split, &plan.evaluate(system, &[], false)?))
}

fn test_result(plan: &Plan, split: SplitName, computed: &Computed) -> TestResult {
    let e = test_error(plan, &computed.values);
    let block = &plan.blocks[e.worst.1];
    let within = e.worst.0 - block.range.start;
    let axis = match block.kind {
        BlockKind::Frf => {
            format!("{:.4} Hz, {}", block.abscissa[within / 2], if within.is_multiple_of(2) { "real" } else { "imaginary" })
        }
        BlockKind::Loop => format!("{:.0} deg of the cycle", block.abscissa[within].to_degrees()),
        BlockKind::Record => format!("{:.4} s", block.abscissa[within]),
        BlockKind::Table if plan.kind == TestKind::Modal => format!("mode {}", block.abscissa[within]),
        BlockKind::Table => match &block.amplitude_unit {
            Some(unit) => format!("an amplitude of {}", unit.print_difference(block.abscissa[within])),
            None => format!("{} Hz", block.abscissa[within]),
        },
    };
    let curves: Vec<Curve> = plan
        .blocks
        .iter()
        .map(|b| Curve {
            label: b.label.clone(),
            unit: b.unit.clone(),
            kind: b.kind,
            abscissa: b.abscissa.clone(),
            x: b.x.clone(),
            v: b.v.clone(),
            measured: plan.measured[b.range.clone()].iter().map(|v| plain(b.kind, *v)).collect(),
            computed: computed.values[b.range.clone()].iter().map(|v| plain(b.kind, *v)).collect(),
            sigma: b.range.clone().map(|i| plan.sigma[i] * if b.kind == BlockKind::Table { plan.measured[i].exp() } else { 1.0 }).collect(),
        })
        .collect();
    TestResult {
        id: plan.id.clone(),
        kind: plan.kind.word().into(),
        split,
        error: e.error,
        floor: e.floor,
        whitened_rms: e.whitened_rms,
        worst: Worst {
            place: format!("{} at {axis}", block.label),
            measured: plain(block.kind, plan.measured[e.worst.0]),
            computed: plain(block.kind, computed.values[e.worst.0]),
            unit: block.stated.clone(),
        },
        n: plan.len(),
        largest_difference: curves.iter().map(difference).collect(),
        factors: vec![],
        modes: vec![],
        constant_damping: None,
        curves,
    }
}

fn difference(c: &Curve) -> LargestDifference {
    let over = match c.kind {
        BlockKind::Loop | BlockKind::Record => "range",
        BlockKind::Frf => "range of magnitude",
        BlockKind::Table => "value",
    };
    LargestDifference { channel: c.label.clone(), over, fraction: c.largest_difference() }
}

/// A value as it was measured: tables are compared by their logarithms.
fn plain(kind: BlockKind, value: f64) -> f64 {
    if kind == BlockKind::Table { value.exp() } else { value }
}
