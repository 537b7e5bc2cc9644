//! Parts of the graph that nothing holds.

use super::{Instance, Model, ModelError, Site};
use crate::effect::Effect;

/// Refuses a part that moves without resistance: joined by connectors on which no force acts, or free of mass and tied to nothing.
///
/// Degrees of freedom are grouped by the places at which force effects act. A group that reaches the ground is held. One that does not
/// may float when it has mass and no connector leaves it (a free-free chain); otherwise it is a mechanism. Returns its first degree of
/// freedom with the error.
pub fn held(model: &Model, instances: &[Instance]) -> Result<(), (usize, ModelError)> {
    if model.space.is_some() {
        return connected(model, instances);
    }
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
    // Of every group: whether a connector without a force leaves it, and its mass.
    let (mut loose, mut mass) = (vec![false; n + 1], vec![0.0; n + 1]);
    (0..n).for_each(|d| mass[groups[d]] += model.dofs[d].mass);
    for p in (0..acts.len()).filter(|p| !acts[*p] && model.on_connector(*p)) {
        [model.places[p].from, model.places[p].to].iter().flatten().for_each(|d| loose[groups[*d]] = true);
    }
    let Some(first) = groups.iter().position(|g| *g != ground && (loose[*g] || mass[*g] == 0.0)) else {
        return Ok(());
    };
    let members: Vec<String> = (0..n).filter(|d| groups[*d] == groups[first]).map(|d| model.dof_name(d)).collect();
    let leaving = |p: &usize| {
        !acts[*p]
            && model.on_connector(*p)
            && [model.places[*p].from, model.places[*p].to].iter().flatten().any(|d| groups[*d] == groups[first])
    };
    let places: Vec<String> = (0..acts.len()).filter(leaving).map(|p| model.place_name(p)).collect();
    let accepted = if places.is_empty() {
        "a connector to the ground with a force effect, or a mass".to_string()
    } else {
        format!("a force effect at {}, or the axis left out of `free`", short(&places, " or "))
    };
    let message = format!("a mechanism: no force holds {}", short(&members, ", "));
    Err((first, ModelError::invalid(model.dof_name(first), message, accepted)))
}

/// Refuses a spatial model in pieces: parts are joined by connectors on which a force acts, and every piece reaches a part that is held,
/// unless there is but one (a free chain).
fn connected(model: &Model, instances: &[Instance]) -> Result<(), (usize, ModelError)> {
    let mut acts = vec![false; model.connectors.len()];
    for instance in instances.iter().filter(|i| matches!(i.effect, Effect::Force(_))) {
        let Site::Places(places) = &instance.site else { continue };
        places.iter().for_each(|p| acts[model.places[*p].connector] = true);
    }
    let mut piece: Vec<usize> = (0..model.bodies.len()).collect();
    for (connector, _) in model.connectors.iter().zip(&acts).filter(|(_, acts)| **acts) {
        let (old, new) = (piece[connector.from], piece[connector.to]);
        piece.iter_mut().filter(|p| **p == old).for_each(|p| *p = new);
    }
    let moving = |b: usize| !model.bodies[b].free.is_empty();
    let held = |p: usize| (0..piece.len()).any(|b| piece[b] == p && model.bodies[b].free.len() < 6);
    let first = (0..piece.len()).find(|b| moving(*b)).map_or(0, |b| piece[b]);
    let loose = (0..piece.len())
        .find(|b| moving(*b) && !held(piece[*b]) && (piece[*b] != first || (0..piece.len()).any(|o| moving(o) && piece[o] != first)));
    let Some(b) = loose else { return Ok(()) };
    let names: Vec<String> = (0..piece.len()).filter(|o| piece[*o] == piece[b]).map(|o| model.bodies[o].name.clone()).collect();
    let silent = model.connectors[..model.declared]
        .iter()
        .zip(&acts)
        .filter(|(c, acts)| !**acts && (piece[c.from] == piece[b]) != (piece[c.to] == piece[b]));
    let silent: Vec<String> = silent.map(|(c, _)| c.name.clone()).collect();
    let accepted = if silent.is_empty() {
        "a [[connector]] to the rest, or a [[joint]]".to_string()
    } else {
        format!("force effects at the axes of {}", short(&silent, ", "))
    };
    let dof = model.dofs.iter().position(|d| d.body == b).unwrap_or(0);
    let message = format!("the chain is not connected: nothing joins {} to the rest", short(&names, ", "));
    Err((dof, ModelError::invalid(&model.bodies[b].name, message, accepted)))
}

fn short(names: &[String], join: &str) -> String {
    let shown: Vec<String> = names.iter().take(6).map(|n| format!("`{n}`")).collect();
    if names.len() > 6 { format!("{} and {} more", shown.join(", "), names.len() - 6) } else { shown.join(join) }
}
