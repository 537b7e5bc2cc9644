//! Profiles and replicates as `misfit fit` and `misfit predict` show them.

use serde_json::Value;

use crate::diagnose::{Fitted, unit_of};
use crate::identify::{Replicate, Spread};
use crate::work::Profiled;

use super::table::{significant, table};

/// Replicates as JSON and as a table.
pub(super) fn told(fitted: &Fitted, all: &[Replicate], asked: usize) -> (Value, String) {
    let good: Vec<&Vec<f64>> = all.iter().filter_map(|r| r.p.as_ref()).collect();
    let mut rows = Vec::new();
    let mut list = Vec::new();
    for (k, f) in fitted.free.iter().enumerate() {
        let value = |v: f64| f.value(v);
        let Some(s) = Spread::of(good.iter().map(|p| value(p[k])).collect()) else { continue };
        let unit = unit_of(&fitted.system, f);
        rows.push(vec![
            f.name.clone(),
            significant(value(fitted.outcome.p[k]), 5),
            significant(s.std, 2),
            format!("{} to {}", significant(s.interval.0, 5), significant(s.interval.1, 5)),
            unit.clone(),
        ]);
        list.push(serde_json::json!({ "name": f.name, "unit": unit, "std": s.std, "interval": [s.interval.0, s.interval.1] }));
    }
    let text = format!(
        "Bootstrap of {} replicates, {} failed\n\n{}",
        all.len(),
        all.len() - good.len(),
        table(&["parameter", "value", "std", "95 %", "unit"], &rows)
    );
    let value = serde_json::json!({ "asked": asked, "replicates": all.len(), "failed": all.len() - good.len(), "parameters": list });
    (value, text)
}

/// Profiles as a table.
pub(super) fn profile_table(all: &[Profiled]) -> String {
    let end = |v: Option<f64>, bound: bool, open: &str| match (v, bound) {
        (Some(v), true) => format!("{} (bound)", significant(v, 5)),
        (Some(v), false) => significant(v, 5),
        (None, _) => open.into(),
    };
    let row = |k: &Profiled| {
        vec![
            k.name.clone(),
            significant(k.value, 5),
            end(k.interval.0, k.at_bound.0, "-inf"),
            end(k.interval.1, k.at_bound.1, "inf"),
            k.unit.clone(),
            k.better.map_or(String::new(), |c| format!("a better answer was met, cost {}", significant(c, 5))),
        ]
    };
    let header = ["parameter", "value", "95 % from", "to", "unit", "remark"];
    format!("Profile likelihood, all other parameters refitted\n\n{}", table(&header, &all.iter().map(row).collect::<Vec<_>>()))
}
