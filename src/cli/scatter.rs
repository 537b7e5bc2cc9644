//! Profile likelihood and bootstrap on demand: `--profile` and `--bootstrap` of `misfit fit`, `--bootstrap` of `misfit predict`.
//!
//! What is done is kept as it comes in the folder of the run, `profiles.jsonl` and `bootstrap.jsonl`, a line each; `--resume` goes on from
//! them.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use crate::parallel;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::diagnose::results::SplitName;
use crate::diagnose::{Case, Fitted, unit_of};
use crate::identify::{IdentifyError, Replicate, bootstrap, profile, quantile};
use crate::residual::Problem;
use crate::study::run::RunFolder;

use super::session::Session;
use super::table::{significant, table};
use crate::work::Failure;

/// Files of a run that a resumed one takes over.
pub(super) const KEPT: [&str; 2] = [BOOTSTRAP, PROFILES];
const BOOTSTRAP: &str = "bootstrap.jsonl";
const PROFILES: &str = "profiles.jsonl";
/// Relative difference up to which a fit has come back to the answer that replicates and profiles are about.
const SAME: f64 = 1e-6;

/// Lines of JSON that are appended as they come; the first says what they are about.
struct Lines {
    path: PathBuf,
    file: Mutex<std::fs::File>,
}

#[derive(Serialize, Deserialize)]
struct Head {
    names: Vec<String>,
    p: Vec<f64>,
    seed: u64,
}

impl Lines {
    /// Opens the file of a run and reads what it holds; a last line that was cut short is taken away.
    fn open<T: for<'a> Deserialize<'a>>(folder: &RunFolder, name: &str, head: &Head) -> Result<(Lines, Vec<T>), Failure> {
        let path = folder.path.join(name);
        let shown = path.display().to_string();
        let fail = |e: std::io::Error| Failure::new("identify", shown.clone(), e.to_string(), "a file that can be written");
        let other = |message: String| {
            Failure::new(
                "identify",
                shown.clone(),
                message,
                "the folder of a run of the same study, fit and seed, or a new run without --resume",
            )
        };
        let text = if path.exists() { std::fs::read_to_string(&path).map_err(fail)? } else { String::new() };
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let mut lines = whole.lines();
        let mut done = Vec::new();
        match lines.next() {
            Some(first) => {
                let old: Head = serde_json::from_str(first).map_err(|e| other(format!("line 1: {e}")))?;
                let near = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME * a.abs().max(b.abs());
                if old.names != head.names || old.seed != head.seed || !old.p.iter().zip(&head.p).all(near) {
                    return Err(other("it is about another fit".into()));
                }
                for (k, line) in lines.enumerate() {
                    done.push(serde_json::from_str(line).map_err(|e| other(format!("line {}: {e}", k + 2)))?);
                }
            }
            None => {
                let first = serde_json::to_string(head).map_err(|e| other(e.to_string()))? + "\n";
                std::fs::write(&path, first).map_err(fail)?;
            }
        }
        let file = OpenOptions::new().append(true).open(&path).map_err(fail)?;
        if !whole.is_empty() {
            file.set_len(whole.len() as u64).map_err(fail)?;
        }
        Ok((Lines { path, file: Mutex::new(file) }, done))
    }

    fn add(&self, value: &impl Serialize) -> Result<(), Failure> {
        let fail = |reason: String| Failure::new("identify", self.path.display().to_string(), reason, "a file that can be written");
        let text = serde_json::to_string(value).map_err(|e| fail(e.to_string()))? + "\n";
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(text.as_bytes()).map_err(|e| fail(e.to_string()))
    }
}

fn head(fitted: &Fitted, seed: u64) -> Head {
    Head { names: fitted.options.names.clone(), p: fitted.outcome.p.clone(), seed }
}

/// The first `n` replicates of a fit, those of an earlier run not again.
pub(super) fn replicates(session: &Session, case: &Case, fitted: &Fitted, folder: &RunFolder, n: usize) -> Result<Vec<Replicate>, Failure> {
    let (lines, mut done) = Lines::open::<Replicate>(folder, BOOTSTRAP, &head(fitted, case.seed))?;
    let plans = case.plans_of(SplitName::Fit);
    let mut tests = Vec::new();
    let mut row = 0;
    for plan in &plans {
        tests.push(row..row + plan.len());
        row += plan.len();
    }
    let problem = Problem::new(plans, fitted.system.clone());
    let left: Vec<usize> = (0..n).filter(|k| !done.iter().any(|d| d.index == *k)).collect();
    let (before, trouble) = (n - left.len(), Mutex::new((0usize, None)));
    let each = |r: &Replicate| {
        let kept = lines.add(r);
        if let Ok(mut state) = trouble.lock() {
            state.0 += 1;
            session.progress.say(&format!("bootstrap: {} of {n}", before + state.0));
            state.1 = state.1.take().or(kept.err());
        }
    };
    let fresh = bootstrap(&problem, &fitted.outcome, &fitted.options, &tests, (&left, case.seed), &session.monitor(), &each);
    done.extend(fresh.map_err(failure)?);
    if let Some(e) = trouble.into_inner().unwrap_or_else(PoisonError::into_inner).1 {
        return Err(e);
    }
    done.retain(|r| r.index < n);
    done.sort_by_key(|r| r.index);
    Ok(done)
}

fn failure(e: IdentifyError) -> Failure {
    crate::diagnose::DiagnoseError::from(e).into()
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

/// A profile as it is kept.
#[derive(Serialize, Deserialize, Clone)]
pub(super) struct Kept {
    name: String,
    unit: String,
    value: f64,
    /// 95 %; an open end is null.
    interval: (Option<f64>, Option<f64>),
    at_bound: (bool, bool),
    /// Value and cost.
    points: Vec<(f64, f64)>,
    /// Cost of a better answer met on the way.
    better: Option<f64>,
}

/// Profiles the named parameters, in parallel; those of an earlier run not again.
pub(super) fn profiles(
    session: &Session,
    case: &Case,
    fitted: &Fitted,
    folder: &RunFolder,
    names: &[String],
) -> Result<Vec<Kept>, Failure> {
    let wanted: Vec<usize> = names
        .iter()
        .map(|n| {
            fitted.free.iter().position(|f| f.name == *n).ok_or_else(|| {
                let all: Vec<&str> = fitted.free.iter().map(|f| f.name.as_str()).collect();
                Failure::new("cli", "--profile", format!("there is no free parameter `{n}`"), all.join(", "))
            })
        })
        .collect::<Result<_, _>>()?;
    let (lines, mut done) = Lines::open::<Kept>(folder, PROFILES, &head(fitted, case.seed))?;
    let problem = Problem::new(case.plans_of(SplitName::Fit), fitted.system.clone());
    let spread = crate::identify::uncertainty(&fitted.outcome, &fitted.options, &Default::default()).map_err(failure)?;
    let left: Vec<usize> = wanted.into_iter().filter(|k| !done.iter().any(|d| d.name == fitted.free[*k].name)).collect();
    let one = |k: &usize| -> Result<Option<Kept>, Failure> {
        let f = &fitted.free[*k];
        session.progress.say(&format!("profile of {}", f.name));
        let found = profile(&problem, &fitted.outcome, *k, spread.parameters[*k].std, &fitted.options, &session.monitor());
        // What was stopped half way is no profile.
        if session.interrupted() {
            return Ok(None);
        }
        let found = found.map_err(failure)?;
        let value = |v: f64| if f.log { v.exp() } else { v };
        let kept = Kept {
            name: f.name.clone(),
            unit: unit_of(&fitted.system, f),
            value: value(found.value),
            interval: (found.interval.0.map(value), found.interval.1.map(value)),
            at_bound: found.at_bound,
            points: found.points.iter().map(|(v, c)| (value(*v), *c)).collect(),
            better: found.better.map(|b| b.1),
        };
        lines.add(&kept)?;
        Ok(Some(kept))
    };
    let fresh: Vec<Option<Kept>> = parallel::map(&left, one).into_iter().collect::<Result<_, Failure>>()?;
    done.extend(fresh.into_iter().flatten());
    done.retain(|d| names.contains(&d.name));
    Ok(done)
}

/// Profiles as a table.
pub(super) fn profile_table(all: &[Kept]) -> String {
    let end = |v: Option<f64>, bound: bool, open: &str| match (v, bound) {
        (Some(v), true) => format!("{} (bound)", significant(v, 5)),
        (Some(v), false) => significant(v, 5),
        (None, _) => open.into(),
    };
    let row = |k: &Kept| {
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
