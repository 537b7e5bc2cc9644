//! Tests as the page draws them: errors, and curves in the units of the data, thinned to what a screen shows.

use serde_json::{Value, json};

use crate::diagnose::results::{Curve, SplitName, TestResult};
use crate::diagnose::{Case, DiagnoseError, glance};
use crate::model::System;
use crate::parallel;
use crate::report::chart::{pick, thin};
use crate::report::{Units, driven};
use crate::response::{BlockKind, Plan};
use crate::study::Study;

/// Points of a curve at most.
const POINTS: usize = 400;

/// What is asked of a comparison.
pub struct Asked<'a> {
    /// Tests by id; all where there are none.
    pub tests: Option<Vec<&'a str>>,
    /// Measured values and abscissae with the computed ones.
    pub whole: bool,
    /// Whether the held-out tests may be seen.
    pub opened: bool,
}

/// Tests of a case against a system, in the order of the dataset.
pub fn compare(study: &Study, case: &Case, system: &System, asked: &Asked) -> Result<Vec<Value>, DiagnoseError> {
    let wanted = |p: &Plan| asked.tests.as_ref().is_none_or(|list| list.contains(&p.id.as_str()));
    let plans: Vec<&(Plan, SplitName)> = case.plans.iter().filter(|(p, _)| wanted(p)).collect();
    let one = |(plan, split): &&(Plan, SplitName)| {
        if *split == SplitName::HeldOut && !asked.opened {
            return Ok(json!({ "id": plan.id, "kind": plan.kind.word(), "split": split, "sealed": true, "about": about(study, &plan.id) }));
        }
        let result = glance(plan, *split, system)?;
        Ok(test(study, &result, asked.whole))
    };
    parallel::map(&plans, one).into_iter().collect()
}

/// Conditions of a test in words.
fn about(study: &Study, id: &str) -> String {
    let conditions = study.dataset.test(id).map(|t| t.conditions.iter().map(|(k, c)| format!("{k} {}", c.unit.print(c.value))));
    conditions.map(|all| all.collect::<Vec<_>>().join(", ")).unwrap_or_default()
}

fn test(study: &Study, t: &TestResult, whole: bool) -> Value {
    let curves: Vec<Value> = t.curves.iter().map(|c| curve(study, &t.id, c, whole)).collect();
    let mut value = json!({
        "id": t.id, "kind": t.kind, "split": t.split, "error": finite(t.error), "floor": finite(t.floor), "whitened_rms": finite(t.whitened_rms),
        "curves": curves,
    });
    if whole {
        value["worst"] = t.worst.words().into();
        value["about"] = about(study, &t.id).into();
    }
    value
}

/// A number, or nothing.
fn finite(v: f64) -> Value {
    if v.is_finite() { v.into() } else { Value::Null }
}

fn curve(study: &Study, id: &str, c: &Curve, whole: bool) -> Value {
    let units = Units::of(study, id, c);
    let frf = c.kind == BlockKind::Frf;
    let key: Vec<f64> = if frf { c.measured.chunks_exact(2).map(|h| h[0].hypot(h[1])).collect() } else { c.measured.clone() };
    let at = thin(&key, POINTS);
    // Of an FRF two values a line.
    let rows: Vec<usize> = if frf { at.iter().flat_map(|k| [2 * k, 2 * k + 1]).collect() } else { at.clone() };
    let table = c.kind == BlockKind::Table;
    let unit = if table { 1.0 } else { units.y.1 };
    let of = |values: &[f64], rows: &[usize], over: f64| -> Vec<Value> {
        pick(values, rows).into_iter().map(|v| finite(rounded(v / over))).collect()
    };
    let mut value = json!({ "label": c.label, "computed": of(&c.computed, &rows, unit) });
    if whole {
        let kind = match c.kind {
            BlockKind::Loop => "loop",
            BlockKind::Frf => "frf",
            BlockKind::Record => "record",
            BlockKind::Table => "table",
        };
        let abscissa: Vec<f64> = match c.kind {
            BlockKind::Loop => c.abscissa.iter().map(|a| a.to_degrees()).collect(),
            BlockKind::Table => c.abscissa.iter().map(|a| a / units.over.2).collect(),
            _ => c.abscissa.clone(),
        };
        value["kind"] = kind.into();
        value["unit"] = if table { c.unit.clone() } else { units.y.0 }.into();
        value["x_unit"] = units.x.0.into();
        value["over"] = format!("{} [{}]", units.over.0, units.over.1).into();
        value["driven"] = driven(study, id).into();
        value["abscissa"] = of(&abscissa, &at, 1.0).into();
        value["x"] = of(&c.x, &at, units.x.1).into();
        value["v"] = of(&c.v, &at, units.x.1).into();
        value["measured"] = of(&c.measured, &rows, unit).into();
        value["sigma"] = of(&c.sigma, &rows, unit).into();
        value["of"] = c.abscissa.len().max(c.measured.len() / if frf { 2 } else { 1 }).into();
    }
    value
}

/// Five significant digits: a screen shows no more, and they make the answer half as long.
fn rounded(v: f64) -> f64 {
    if v.is_finite() { format!("{v:.4e}").parse().unwrap_or(v) } else { v }
}

/// Pooled error and floor of tests, a split each.
pub fn pooled(tests: &[Value]) -> Value {
    let of = |split: &str| {
        let here: Vec<(f64, f64)> =
            tests.iter().filter(|t| t["split"] == split).filter_map(|t| Some((t["error"].as_f64()?, t["floor"].as_f64()?))).collect();
        let rms = |f: &dyn Fn(&(f64, f64)) -> f64| (here.iter().map(|e| f(e).powi(2)).sum::<f64>() / here.len().max(1) as f64).sqrt();
        if here.is_empty() { Value::Null } else { json!({ "error": rms(&|e| e.0), "floor": rms(&|e| e.1), "tests": here.len() }) }
    };
    json!({ "fit": of("fit"), "select": of("select"), "held_out": of("held_out") })
}
