//! `misfit effects`: the library.

use serde_json::{Value, json};

use crate::effect::{self, Dim, Info, Kind, LIBRARY, Param};

use super::Outcome;
use super::failure::Failure;
use super::table::table;

#[derive(clap::Args)]
pub(super) struct Args {
    /// Name of one effect; without it, all
    name: Option<String>,
    /// One JSON object on stdout
    #[arg(long)]
    pub json: bool,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let infos: Vec<&Info> = match &args.name {
        Some(name) => vec![effect::find(name)?.info()],
        None => LIBRARY.iter().map(|e| e.info()).collect(),
    };
    let text = match (&args.name, infos.first()) {
        (Some(_), Some(info)) => one(info),
        _ => list(&infos),
    };
    Ok(Outcome { json: json!({ "effects": infos.iter().map(|i| value(i)).collect::<Vec<_>>() }), text, code: 0 })
}

fn unit(p: &Param) -> String {
    match p.dim {
        Dim::One => "-".into(),
        dim => dim.si(false),
    }
}

fn kind(p: &Param) -> &'static str {
    match p.kind {
        Kind::Strength => "strength",
        Kind::Shape => "shape",
        Kind::Setting => "setting",
    }
}

fn value(info: &Info) -> Value {
    let parameter = |p: &Param| {
        json!({ "name": p.name, "unit": unit(p), "unit_about_a_rotation": p.dim.si(true), "sign": p.sign.word(), "bounds": p.bounds(), "kind": kind(p),
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

fn list(infos: &[&Info]) -> String {
    let row = |i: &&Info| {
        let parameters: Vec<String> = i.params.iter().map(|p| format!("{} [{}]", p.name, unit(p))).collect();
        vec![i.name.into(), i.role.word().into(), parameters.join(", "), i.claim.into()]
    };
    let rows: Vec<Vec<String>> = infos.iter().map(row).collect();
    table(&["effect", "role", "parameters", "claim"], &rows) + "`misfit effects NAME` shows one with equation, signs, source and range.\n"
}

fn one(info: &Info) -> String {
    let row = |p: &Param| vec![p.name.into(), unit(p), p.dim.si(true), p.bounds(), kind(p).into(), p.doc.into()];
    let rows: Vec<Vec<String>> = info.params.iter().map(row).collect();
    format!(
        "{} ({}, {})\n  {}\n\n  {}\n  F is the force on `to` that holds it there, x = q_to - q_from\n\n{}\n  source: {}\n  range:  {}\n",
        info.name,
        info.role.word(),
        info.family,
        info.claim,
        info.equation,
        table(&["parameter", "along", "about", "bounds", "kind", "what it is"], &rows),
        info.source,
        info.range
    )
}
