//! A step of the search where the model is out of step with a record: what is missing is looked for in as many of the first cycles as the
//! model can follow, and what was found there is weighed once more on the whole record, if it brings the model into step with that.

use crate::identify::Monitor;
use crate::parallel;

use super::candidates::Name;
use super::step::{Against, Move, Step, Stood, step};
use crate::diagnose::DiagnoseError;
use crate::diagnose::calibrate::approach::{approached, out_of_step};
use crate::diagnose::calibrate::case::Case;
use crate::diagnose::calibrate::weigh::{Scale, Weighed};

/// A step on the beginnings `near`, taken on the whole; beside what was added, and where it gains so many nats beyond its price.
///
/// # Errors
/// As [`step`].
pub fn near(
    whole: &Scale,
    near: &Case,
    now: &Weighed,
    (added, beyond): (Vec<&Name>, f64),
    monitor: &Monitor,
    watch: &(dyn Fn(&str) + Sync),
) -> Result<Step, DiagnoseError> {
    let points = |case: &Case| case.plans.iter().map(|(p, _)| p.len()).sum::<usize>();
    watch(&format!("out of step with a record: looking at {} of {} points, where the model can follow", points(near), points(&whole.case)));
    let mut scale = Scale::new(near, &near.system, &whole.settings);
    let base = scale.begin(&near.system, monitor).map_err(DiagnoseError::start_fails)?;
    let against =
        Against { scale: &scale, base: &base, need: None, beyond, stands: None, rival: None, elsewhere: &[], added, monitor, watch };
    let (odds, mut found) = (against.odds(), step(&against)?);
    let Some(taken) = found.taken.take() else { return Ok(found) };
    let pair = (taken.names.len() > 1).then(|| (taken.names.clone(), taken.weighed.fitted.system.clone()));
    let alone = found.stood.iter().filter(|s| s.admissible).map(|s| (vec![s.name.clone()], s.weighed.fitted.system.clone()));
    let all: Vec<_> = pair.into_iter().chain(alone).take(whole.settings.race.followed).collect();
    watch(&format!("following the whole record with {}", all.len()));
    let tried = found.tried.max(1.0) / odds;
    let follow = |(names, system): &(Vec<Name>, crate::model::System)| -> Option<Move> {
        let case = whole.case.at(system);
        let nearer = approached(&case, monitor).ok()?;
        let weighed = whole.weigh(nearer.as_ref().unwrap_or(system), &now.v, monitor).ok()?;
        let follows = !out_of_step(&case, &weighed.fitted.system);
        let gain = whole.gain(&weighed, now, tried);
        follows.then(|| Move { names: names.clone(), weighed, gain })
    };
    let mut moves: Vec<Move> = parallel::map(&all, follow).into_iter().flatten().collect();
    moves.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found.stood = moves
        .iter()
        .filter(|m| m.names.len() == 1)
        .map(|m| Stood { name: m.names[0].clone(), weighed: m.weighed.clone(), gain: m.gain, admissible: true })
        .collect();
    found.taken = moves.into_iter().next().filter(|m| m.gain > 0.0);
    for c in &mut found.candidates {
        c.accepted = found.taken.as_ref().is_some_and(|t| t.names.iter().any(|n| n.effect == c.effect && n.at == c.at));
    }
    Ok(found)
}
