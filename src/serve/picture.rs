//! The structure as it is drawn: bodies, connectors, what acts where.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::model::{Instance, Model, Site, System};
use crate::report::outline;

/// Bodies with their places on the page, connectors between them, and the effects of the model.
pub fn structure(system: &System) -> Value {
    let system = &*system.shaped();
    let model = &system.model;
    let at = positions(model);
    let ends: BTreeMap<usize, [(f64, f64); 2]> = outline(model).into_iter().collect();
    let body = |b: usize| {
        let body = &model.bodies[b];
        let mass = model.space.as_ref().and_then(|s| s.parts.get(b)).map_or(body.mass, |p| p.mass);
        let free: Vec<&str> = body.free.iter().map(|a| a.name()).collect();
        json!({ "name": body.name, "x": at[b].0, "y": at[b].1, "fixed": body.free.is_empty(), "mass": mass, "free": free,
                "ends": ends.get(&b).map(|e| [[e[0].0, e[0].1], [e[1].0, e[1].1]]) })
    };
    let connector = |c: usize| {
        let k = &model.connectors[c];
        let places = (0..model.places.len()).filter(|p| model.places[*p].connector == c);
        json!({ "name": k.name, "from": k.from, "to": k.to, "own": c >= model.declared, "places": places.map(|p| model.place_name(p)).collect::<Vec<_>>() })
    };
    json!({
        "spatial": model.space.is_some(),
        "bodies": (0..model.bodies.len()).map(body).collect::<Vec<_>>(),
        "connectors": (0..model.connectors.len()).map(connector).collect::<Vec<_>>(),
        "effects": system.instances.iter().map(|i| effect(model, i)).collect::<Vec<_>>(),
    })
}

/// An effect with its places and values.
fn effect(model: &Model, i: &Instance) -> Value {
    let params: Vec<String> =
        i.effect.info().params.iter().zip(&i.params).map(|(p, v)| format!("{} = {}", p.name, printed(v.value, &v.unit))).collect();
    json!({ "effect": i.name(), "at": i.at, "places": places(model, i), "values": params, "equation": i.effect.info().equation })
}

/// Names of the places of an effect; none of one that acts on a channel or on the geometry.
pub fn places(model: &Model, i: &Instance) -> Vec<String> {
    match &i.site {
        Site::Places(list) => list.iter().map(|p| model.place_name(*p)).collect(),
        Site::Channel(_) | Site::Outline(_) => vec![],
    }
}

/// A value in the unit it is printed in.
pub fn printed(value: f64, unit: &(String, f64)) -> String {
    let scaled = if unit.1 != 0.0 && !unit.0.is_empty() { value / unit.1 } else { value };
    let text = if scaled != 0.0 && !(1e-3..1e6).contains(&scaled.abs()) { format!("{scaled:.4e}") } else { trimmed(scaled) };
    format!("{text} {}", unit.0).trim_end().to_string()
}

/// Five significant digits without zeros at the end.
fn trimmed(value: f64) -> String {
    let decimals = if value == 0.0 { 0 } else { (4 - value.abs().log10().floor() as i32).clamp(0, 8) as usize };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}

/// Where each body stands: by the connectors between it and what is held, branches below each other; a spatial part where it is.
fn positions(model: &Model) -> Vec<(f64, f64)> {
    let n = model.bodies.len();
    let mut depth = vec![usize::MAX; n];
    let mut row = vec![0usize; n];
    let mut rows = 0;
    let held: Vec<usize> = (0..n).filter(|b| model.bodies[*b].free.is_empty()).collect();
    let next = |b: usize| {
        let ends = model.connectors[..model.declared].iter().filter_map(move |c| match (c.from == b, c.to == b) {
            (true, false) => Some(c.to),
            (false, true) => Some(c.from),
            _ => None,
        });
        ends.collect::<Vec<_>>()
    };
    let starts: Vec<usize> = held.iter().copied().chain(0..n).collect();
    for start in starts {
        if depth[start] != usize::MAX {
            continue;
        }
        (depth[start], row[start]) = (0, rows);
        let mut stack = vec![start];
        let mut fresh = true;
        while let Some(b) = stack.pop() {
            let beyond: Vec<usize> = next(b).into_iter().filter(|o| depth[*o] == usize::MAX).collect();
            for (k, o) in beyond.iter().enumerate() {
                if k > 0 || !fresh && stack.is_empty() && depth[b] == 0 {
                    rows += 1;
                }
                (depth[*o], row[*o]) = (depth[b] + 1, if k == 0 { row[b] } else { rows });
                stack.push(*o);
            }
            fresh = false;
        }
        rows += 1;
    }
    let mut at: Vec<(f64, f64)> = (0..n).map(|b| (depth[b] as f64, row[b] as f64)).collect();
    for (part, [a, b]) in outline(model) {
        at[part] = (0.5 * (a.0 + b.0), 0.5 * (a.1 + b.1));
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Axis, Body, Connector};

    #[test]
    fn a_chain_lies_in_a_row_and_a_branch_below_it() {
        let body = |name: &str, free: Vec<Axis>| Body { name: name.into(), mass: 1.0, inertia: 0.0, free };
        let bodies = vec![body("ground", vec![]), body("a", vec![Axis::X]), body("b", vec![Axis::X]), body("c", vec![Axis::X])];
        let link = |name: &str, from, to| Connector { name: name.into(), from, to };
        let model = Model::new(bodies, vec![link("1", 0, 1), link("2", 1, 2), link("3", 1, 3)]).unwrap();
        let at = positions(&model);
        assert_eq!(&at[..3], [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]);
        assert_eq!(at[3].0, 2.0);
        assert!(at[3].1 > 0.0, "{at:?}");
    }

    #[test]
    fn values_are_printed_in_their_unit() {
        assert_eq!(printed(310_010.0, &("N/mm".into(), 1000.0)), "310.01 N/mm");
        assert_eq!(printed(0.0, &(String::new(), 1.0)), "0");
        assert_eq!(printed(2.5e-9, &("m".into(), 1.0)), "2.5000e-9 m");
    }
}
