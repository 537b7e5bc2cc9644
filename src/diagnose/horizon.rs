//! A step of the search where the model is out of step with a record: what is missing is looked for in as many of the first cycles as the
//! model can follow, and what was found there is judged once more on the whole record, if it brings the model into step with that.

use crate::identify::Monitor;
use crate::parallel;

use super::DiagnoseError;
use super::accept::{tied, verdict_cost};
use super::approach::{approached, in_step, out_of_step};
use super::candidates::Name;
use super::case::{Case, Fitted};
use super::refit::{Proof, prove};
use super::search::{Step, step};

/// A step on the case with its instruments granted their tolerance, and that case.
///
/// # Errors
/// As [`step`] and [`approached`].
pub fn searched(case: &Case, fitted: &Fitted, monitor: &Monitor, watch: &(dyn Fn(&str) + Sync)) -> Result<(Case, Step), DiagnoseError> {
    let whole = case.with_instruments(&fitted.system);
    let near = in_step(&case.at(&fitted.system), monitor)?;
    let Some(near) = near else {
        let step = step(&whole, fitted, monitor, watch)?;
        return Ok((whole, step));
    };
    let points = |case: &Case| case.plans.iter().map(|(p, _)| p.len()).sum::<usize>();
    watch(&format!("out of step with a record: looking at {} of {} points, where the model can follow", points(&near), points(&whole)));
    let near = near.with_instruments(&near.system);
    let from = Fitted { system: near.system.clone(), ..fitted.clone() };
    let mut found = step(&near, &from, monitor, watch)?;
    found.near = true;
    if let Some((name, proof, ties)) = found.accepted.take() {
        let others = found.tied.iter().map(|(n, f)| (n.clone(), f.system.clone()));
        let rivals = found.rivals.iter().filter(|(n, _)| !ties.contains(n)).map(|(n, instance)| {
            let mut system = found.base.system.clone();
            system.instances.push(instance.clone());
            (n.clone(), system)
        });
        let all: Vec<_> = std::iter::once((name.clone(), proof.fitted.system.clone())).chain(others).chain(rivals).collect();
        watch(&format!("following the whole record with {}", all.len()));
        let follow = parallel::map(&all, |(n, system)| Some((n.clone(), followed(&whole, system, monitor)?)));
        let mut follow: Vec<(Name, Proof)> = follow.into_iter().flatten().collect();
        follow.sort_by(|a, b| verdict_cost(&a.1).total_cmp(&verdict_cost(&b.1)));
        let mut follow = follow.into_iter();
        if let Some((best, proof)) = follow.next() {
            found.tied = follow.filter(|(_, p)| tied(&proof, p)).map(|(n, p)| (n, p.fitted)).collect();
            let ties = found.tied.iter().map(|(n, _)| n.clone()).collect();
            found.accepted = Some((best, proof, ties));
        } else {
            found.accepted = Some((name, proof, ties));
        }
    }
    Ok((whole, found))
}

/// The system fitted to whole records, where that brings it into step with them.
fn followed(case: &Case, system: &crate::model::System, monitor: &Monitor) -> Option<Proof> {
    let case = case.at(system);
    let nearer = approached(&case, monitor).ok()?;
    let proof = prove(&case, nearer.as_ref().unwrap_or(system), monitor).ok()?;
    (!out_of_step(&case, &proof.fitted.system)).then_some(proof)
}
