//! Profile likelihood on demand: the interval of a parameter with all others refitted.

use serde::{Deserialize, Serialize};

use crate::diagnose::results::SplitName;
use crate::diagnose::{Case, DiagnoseError, Fitted, unit_of};
use crate::identify::{Monitor, profile};
use crate::parallel;
use crate::residual::Problem;
use crate::study::run::RunFolder;

use super::Failure;
use super::lines::{Lines, PROFILES, head};

/// A profile as it is kept.
#[derive(Serialize, Deserialize, Clone)]
pub struct Profiled {
    /// Parameter.
    pub name: String,
    /// Unit of the values.
    pub unit: String,
    /// The fit's value.
    pub value: f64,
    /// 95 %; an open end is null.
    pub interval: (Option<f64>, Option<f64>),
    /// An end of the interval is the parameter's bound (lower, upper).
    pub at_bound: (bool, bool),
    /// Value and cost.
    pub points: Vec<(f64, f64)>,
    /// Cost of a better answer met on the way.
    pub better: Option<f64>,
}

/// Profiles the named parameters, in parallel; those of an earlier run not again.
pub fn profiles(
    case: &Case,
    fitted: &Fitted,
    folder: &RunFolder,
    names: &[String],
    monitor: &Monitor,
    say: &(dyn Fn(&str) + Sync),
) -> Result<Vec<Profiled>, Failure> {
    let failure = |e: crate::identify::IdentifyError| Failure::from(DiagnoseError::from(e));
    let wanted: Vec<usize> = names
        .iter()
        .map(|n| {
            fitted.free.iter().position(|f| f.name == *n).ok_or_else(|| {
                let all: Vec<&str> = fitted.free.iter().map(|f| f.name.as_str()).collect();
                Failure::new("cli", "--profile", format!("there is no free parameter `{n}`"), all.join(", "))
            })
        })
        .collect::<Result<_, _>>()?;
    let (lines, mut done) = Lines::open::<Profiled>(folder, PROFILES, &head(fitted, case.seed))?;
    let problem = Problem::new(case.plans_of(SplitName::Fit), fitted.system.clone());
    let spread = crate::identify::uncertainty(&fitted.outcome, &fitted.options, &Default::default()).map_err(failure)?;
    let left: Vec<usize> = wanted.into_iter().filter(|k| !done.iter().any(|d| d.name == fitted.free[*k].name)).collect();
    let one = |k: &usize| -> Result<Option<Profiled>, Failure> {
        let f = &fitted.free[*k];
        say(&format!("profile of {}", f.name));
        let found = profile(&problem, &fitted.outcome, *k, spread.parameters[*k].std, &fitted.options, monitor);
        // What was stopped half way is no profile.
        if monitor.stops() {
            return Ok(None);
        }
        let found = found.map_err(failure)?;
        let value = |v: f64| f.value(v);
        let kept = Profiled {
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
    let fresh: Vec<Option<Profiled>> = parallel::map(&left, one).into_iter().collect::<Result<_, Failure>>()?;
    done.extend(fresh.into_iter().flatten());
    done.retain(|d| names.contains(&d.name));
    done.sort_by_key(|d| names.iter().position(|n| *n == d.name));
    Ok(done)
}
