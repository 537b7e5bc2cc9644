//! `misfit effects`: the library.

mod plot;

use serde_json::{Value, json};

use crate::effect::{self, Effect, Info, LIBRARY, Moves, Param, Role};

use crate::work::{Demonstration, Failure, curves_json, demonstrate, effect_json, parameter_kind, parameter_unit};

use super::Outcome;
use super::table::{significant, table};

use plot::{Curve, plot};

#[derive(clap::Args)]
pub(super) struct Args {
    /// Name of one effect; without it, all
    name: Option<String>,
    /// One JSON object on stdout
    #[arg(long)]
    pub json: bool,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let effects: Vec<&'static Effect> = match &args.name {
        Some(name) => vec![effect::find(name)?],
        None => LIBRARY.iter().collect(),
    };
    let mut values: Vec<Value> = effects.iter().map(|e| effect_json(e.info())).collect();
    let text = match (&args.name, effects.as_slice()) {
        (Some(_), [effect]) => {
            let shown = demonstrate(effect);
            if let (Some(d), Some(value)) = (&shown, values.first_mut().and_then(Value::as_object_mut)) {
                value.extend(curves_json(d));
            }
            one(effect.info()) + &shown.map_or_else(|| example(effect), |d| pictures(&d))
        }
        _ => list(&effects.iter().map(|e| e.info()).collect::<Vec<_>>()),
    };
    Ok(Outcome { json: json!({ "effects": values }), text, code: 0 })
}

/// Loop and frequency response as text.
fn pictures(d: &Demonstration) -> String {
    let values: Vec<String> = d.parameters.iter().map(|(name, v)| format!("{name} = {}", significant(*v, 3))).collect();
    let mut text = format!("\n  Loop at 1 rad/s of {}; {}\n", d.of, values.join(", "));
    let marks = if d.without.is_empty() { "" } else { "; . without, * with" };
    text +=
        &plot(&[Curve { mark: '.', x: &d.x, y: &d.without }, Curve { mark: '*', x: &d.x, y: &d.with }], 57, 15, "x", &format!("F{marks}"));
    text +=
        "\n  Frequency response of a mass 1, spring 1, damper 0.05 under a force of 0.05; . without, * with a mild form of the effect\n";
    if d.h.is_empty() {
        return text + "  (no steady response at this force)\n";
    }
    let log: Vec<f64> = d.omega.iter().map(|w| w.log10()).collect();
    let decibel = |h: &[num_complex::Complex64]| h.iter().map(|h| 20.0 * h.norm().log10()).collect::<Vec<_>>();
    let phase = |h: &[num_complex::Complex64]| {
        h.iter().map(|h| h.arg().to_degrees()).map(|p| if p > 90.0 { p - 360.0 } else { p }).collect::<Vec<_>>()
    };
    for (name, rows, without, with) in [("|x/F| [dB]", 13, decibel(&d.h0), decibel(&d.h)), ("phase [deg]", 7, phase(&d.h0), phase(&d.h))] {
        text += &plot(&[Curve { mark: '.', x: &log, y: &without }, Curve { mark: '*', x: &log, y: &with }], 64, rows, "log10(w)", name);
    }
    text
}

/// What stands in a study for an effect that has no loop of its own: a formula, a law of the geometry.
fn example(effect: &Effect) -> String {
    let info = effect.info();
    if let Effect::Geometry(law) = effect {
        let (at, value) = if law.moves() == Moves::Point { ("P.x", "0 mm") } else { ("b", "0") };
        return format!(
            "\n  [[effect]]\n  effect = \"{}\"\n  at = \"{at}\"{}\n  {} = {{ start = \"{value}\" }}\n",
            info.name,
            if law.moves() == Moves::Point { "" } else { "   # the name of the counted parts" },
            info.params[0].name
        );
    }
    "\n  [[effect]]\n  effect = \"formula\"\n  at = \"c1.x\"\n  expression = \"k*x + f*z\"\n  states = { z = \"(v - abs(v)*z)/d\" }\n  \
     k = { start = \"20 N/mm\", min = \"0 N/mm\", max = \"100 N/mm\" }\n  f = { start = \"5 N\", min = \"0 N\", max = \"50 N\" }\n  \
     d = { start = \"0.1 mm\", fixed = true }\n"
        .into()
}

fn list(infos: &[&Info]) -> String {
    let row = |i: &&Info| {
        let parameters: Vec<String> = i.params.iter().map(|p| format!("{} [{}]", p.name, parameter_unit(p))).collect();
        vec![i.name.into(), i.role.word().into(), parameters.join(", "), i.claim.into()]
    };
    let rows: Vec<Vec<String>> = infos.iter().map(row).collect();
    table(&["effect", "role", "parameters", "claim"], &rows) + "`misfit effects NAME` shows one with equation, signs, source and range.\n"
}

/// What the effects of a channel act on, and in what unit.
const CHANNEL: &str = "  y is what the channel reads: `at = \"loop-1Hz.force\"` is the force of one test, `*.force` that of all tests\n  \
                       unit of the channel: N or N m for a force, m or rad for a displacement, m/s, m/s2 for velocity and acceleration; study.toml may\n  \
                       state it in any unit of that dimension (b = \"0.2 kN\"), results are in SI\n";

fn one(info: &Info) -> String {
    let row = |p: &Param| vec![p.name.into(), parameter_unit(p), p.dim.si(true), p.bounds(), parameter_kind(p).into(), p.doc.into()];
    let rows: Vec<Vec<String>> = info.params.iter().map(row).collect();
    format!(
        "{} ({}, {})\n  {}\n\n  {}\n{}\n{}\n  source: {}\n  range:  {}\n",
        info.name,
        info.role.word(),
        info.family,
        info.claim,
        info.equation,
        match info.role {
            Role::Geometry => "",
            Role::Channel => CHANNEL,
            _ => "  F is the force on `to` that holds it there, x = q_to - q_from\n",
        },
        table(&["parameter", "along", "about", "bounds", "kind", "what it is"], &rows),
        info.source,
        info.range
    )
}
