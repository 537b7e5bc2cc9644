//! Bootstrap replicates on demand, kept line by line in the folder of their run.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use crate::campaign::Share;
use crate::diagnose::results::SplitName;
use crate::diagnose::{Case, DiagnoseError, Fitted};
use crate::identify::{Monitor, Replicate, bootstrap};
use crate::residual::Problem;
use crate::study::run::RunFolder;

use super::Failure;
use super::lines::{BOOTSTRAP, Lines, head};

/// A share of the first `n` replicates of a fit ([`bootstrap`]), in parallel; those that the folder holds of an earlier run are not drawn again.
/// `say` hears how many there are. Stops with what there is when the monitor says so.
///
/// # Errors
/// A folder with the replicates of another fit, a file that cannot be written, a fit that has no replicates.
pub fn replicates(
    case: &Case,
    fitted: &Fitted,
    folder: &RunFolder,
    (n, share): (usize, Share),
    monitor: &Monitor,
    say: &(dyn Fn(&str) + Sync),
) -> Result<Vec<Replicate>, Failure> {
    let (lines, mut done) = Lines::open::<Replicate>(folder, BOOTSTRAP, &head(fitted, case.seed))?;
    let plans = case.plans_of(SplitName::Fit);
    let ends = plans.iter().scan(0, |row, plan| {
        *row += plan.len();
        Some(*row - plan.len()..*row)
    });
    let tests: Vec<Range<usize>> = ends.collect();
    let problem = Problem::new(plans, fitted.system.clone());
    let all = share.of(n).count();
    let left: Vec<usize> = share.of(n).filter(|k| !done.iter().any(|d| d.index == *k)).collect();
    let state = Mutex::new((all - left.len(), None));
    let each = |r: &Replicate| {
        let kept = lines.add(r);
        let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
        state.0 += 1;
        say(&format!("bootstrap: {} of {all}", state.0));
        state.1 = state.1.take().or(kept.err());
    };
    let fresh = bootstrap(&problem, &fitted.outcome, &fitted.options, &tests, (&left, case.seed), monitor, &each);
    done.extend(fresh.map_err(DiagnoseError::from)?);
    if let Some(e) = state.into_inner().unwrap_or_else(PoisonError::into_inner).1 {
        return Err(e);
    }
    done.retain(|r| r.index < n && share.has(r.index));
    done.sort_by_key(|r| r.index);
    Ok(done)
}
