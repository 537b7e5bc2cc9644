//! The library of effects as JSON: what `misfit effects` prints and the workbench shows.

use serde_json::{Value, json};

use crate::effect::{Dim, Info, Kind, Param};

use super::Demonstration;

/// The curves of a demonstration for scripts.
pub fn curves_json(d: &Demonstration) -> serde_json::Map<String, Value> {
    let parts = |h: &[num_complex::Complex64]| h.iter().map(|h| [h.re, h.im]).collect::<Vec<_>>();
    let parameters: serde_json::Map<String, Value> = d.parameters.iter().map(|(name, v)| (name.to_string(), json!(v))).collect();
    let loops = json!({ "of": d.of, "parameters": parameters, "x": d.x, "without": d.without, "with": d.with });
    let frf = json!({ "omega": d.omega, "without": parts(&d.h0), "with": parts(&d.h) });
    [("loop".to_string(), loops), ("frf".to_string(), frf)].into_iter().collect()
}

/// SI unit of a parameter at a translational place; `-` where it has none.
pub fn parameter_unit(p: &Param) -> String {
    match p.dim {
        Dim::One => "-".into(),
        dim => dim.si(false),
    }
}

/// Kind of a parameter in one word.
pub fn parameter_kind(p: &Param) -> &'static str {
    match p.kind {
        Kind::Strength => "strength",
        Kind::Shape => "shape",
        Kind::Setting => "setting",
    }
}

/// One effect of the library.
pub fn effect_json(info: &Info) -> Value {
    let parameter = |p: &Param| {
        json!({ "name": p.name, "unit": parameter_unit(p), "unit_about_a_rotation": p.dim.si(true), "sign": p.sign.word(), "bounds": p.bounds(), "kind": parameter_kind(p),
                "default": (p.kind != Kind::Shape).then_some(p.default), "doc": p.doc })
    };
    json!({
        "effect": info.name,
        "role": info.role.word(),
        "claim": info.claim,
        "equation": info.equation,
        "parameters": info.params.iter().map(parameter).collect::<Vec<_>>(),
        "family": info.family,
        "states": info.states,
        "source": info.source,
        "range": info.range,
    })
}
