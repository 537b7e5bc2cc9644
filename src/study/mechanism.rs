//! Parts of the graph that nothing holds.

use crate::effect::Effect;
use crate::model::{Instance, Model, ModelError, Site};

/// Refuses a part that moves without resistance: joined by connectors on which no force acts, or free of mass and tied to nothing.
///
/// Degrees of freedom are grouped by the places at which force effects act. A group that reaches the ground is held. One that does not
/// may float when it has mass and no connector leaves it (a free-free chain); otherwise it is a mechanism. Returns its first degree of
/// freedom with the error.
pub(super) fn check(model: &Model, instances: &[Instance]) -> Result<(), (usize, ModelError)> {
    let n = model.dofs.len();
    let mut acts = vec![false; model.places.len()];
    for instance in instances.iter().filter(|i| matches!(i.effect, Effect::Force(_))) {
        let Site::Places(places) = &instance.site else { continue };
        places.iter().for_each(|p| acts[*p] = true);
    }
    // Node n is the ground.
    let mut group: Vec<usize> = (0..=n).collect();
    fn root(group: &mut [usize], mut i: usize) -> usize {
        while group[i] != i {
            group[i] = group[group[i]];
            i = group[i];
        }
        i
    }
    for (place, _) in model.places.iter().zip(&acts).filter(|(_, acts)| **acts) {
        let (a, b) = (root(&mut group, place.from.unwrap_or(n)), root(&mut group, place.to.unwrap_or(n)));
        group[a] = b;
    }
    let ground = root(&mut group, n);
    let groups: Vec<usize> = (0..n).map(|d| root(&mut group, d)).collect();
    let Some(first) = groups.iter().position(|g| {
        let loose = |p: usize| !acts[p] && [model.places[p].from, model.places[p].to].iter().flatten().any(|d| groups[*d] == *g);
        let mass = || (0..n).filter(|d| groups[*d] == *g).map(|d| model.dofs[d].mass).sum::<f64>();
        *g != ground && ((0..acts.len()).any(loose) || mass() == 0.0)
    }) else {
        return Ok(());
    };
    let members: Vec<String> = (0..n).filter(|d| groups[*d] == groups[first]).map(|d| model.dof_name(d)).collect();
    let leaving =
        |p: &usize| !acts[*p] && [model.places[*p].from, model.places[*p].to].iter().flatten().any(|d| groups[*d] == groups[first]);
    let places: Vec<String> = (0..acts.len()).filter(leaving).map(|p| model.place_name(p)).collect();
    let accepted = if places.is_empty() {
        "a connector to the ground with a force effect, or a mass".to_string()
    } else {
        format!("a force effect at {}, or the axis left out of `free`", short(&places, " or "))
    };
    let message = format!("a mechanism: no force holds {}", short(&members, ", "));
    Err((first, ModelError::invalid(model.dof_name(first), message, accepted)))
}

fn short(names: &[String], join: &str) -> String {
    let shown: Vec<String> = names.iter().take(6).map(|n| format!("`{n}`")).collect();
    if names.len() > 6 { format!("{} and {} more", shown.join(", "), names.len() - 6) } else { shown.join(join) }
}
