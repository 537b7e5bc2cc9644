//! Profile likelihood and bootstrap on demand: `--profile` and `--bootstrap` of `misfit fit`, `--bootstrap` of `misfit predict`.
//!
//! What is done is kept as it comes in the folder of the run, `profiles.jsonl` and `bootstrap.jsonl`, a line each; `--resume` goes on from
//! them.

use std::sync::{Mutex, PoisonError};

use serde_json::Value;

use crate::campaign::Share;
use crate::diagnose::results::SplitName;
use crate::diagnose::{Case, Fitted, unit_of};
use crate::identify::{Replicate, bootstrap, quantile};
use crate::residual::Problem;
use crate::study::run::RunFolder;

use super::session::Session;
use super::table::{significant, table};
use crate::work::lines::{BOOTSTRAP, Lines, head};
use crate::work::{Failure, Profiled};

/// A share of the first `n` replicates of a fit, those of an earlier run not again.
pub(super) fn replicates(
    session: &Session,
    case: &Case,
    fitted: &Fitted,
    folder: &RunFolder,
    (n, share): (usize, Share),
) -> Result<Vec<Replicate>, Failure> {
    let (lines, mut done) = Lines::open::<Replicate>(folder, BOOTSTRAP, &head(fitted, case.seed))?;
    let plans = case.plans_of(SplitName::Fit);
    let mut tests = Vec::new();
    let mut row = 0;
    for plan in &plans {
        tests.push(row..row + plan.len());
        row += plan.len();
    }
    let problem = Problem::new(plans, fitted.system.clone());
    let (all, left): (usize, Vec<usize>) = (share.of(n).count(), share.of(n).filter(|k| !done.iter().any(|d| d.index == *k)).collect());
    let (before, trouble) = (all - left.len(), Mutex::new((0usize, None)));
    let each = |r: &Replicate| {
        let kept = lines.add(r);
        if let Ok(mut state) = trouble.lock() {
            state.0 += 1;
            session.progress.say(&format!("bootstrap: {} of {all}", before + state.0));
            state.1 = state.1.take().or(kept.err());
        }
    };
    let fresh = bootstrap(&problem, &fitted.outcome, &fitted.options, &tests, (&left, case.seed), &session.monitor(), &each);
    done.extend(fresh.map_err(crate::diagnose::DiagnoseError::from)?);
    if let Some(e) = trouble.into_inner().unwrap_or_else(PoisonError::into_inner).1 {
        return Err(e);
    }
    done.retain(|r| r.index < n && share.has(r.index));
    done.sort_by_key(|r| r.index);
    Ok(done)
}

/// Mean, deviation and 95 % interval of values.
pub(super) struct Spread {
    pub std: f64,
    pub interval: (f64, f64),
}

/// Of fewer than two values there is none.
pub(super) fn spread(mut values: Vec<f64>) -> Option<Spread> {
    let n = values.len();
    if n < 2 {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let mean = values.iter().sum::<f64>() / n as f64;
    let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1) as f64).sqrt();
    Some(Spread { std, interval: (quantile(&values, 0.025), quantile(&values, 0.975)) })
}

/// Replicates as JSON and as a table.
pub(super) fn told(fitted: &Fitted, all: &[Replicate], asked: usize) -> (Value, String) {
    let good: Vec<&Vec<f64>> = all.iter().filter_map(|r| r.p.as_ref()).collect();
    let mut rows = Vec::new();
    let mut list = Vec::new();
    for (k, f) in fitted.free.iter().enumerate() {
        let value = |v: f64| if f.log { v.exp() } else { v };
        let Some(s) = spread(good.iter().map(|p| value(p[k])).collect()) else { continue };
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
