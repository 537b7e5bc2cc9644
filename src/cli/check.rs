//! `misfit check`: data, units and model, and the gate before a fit (`work::check`).

use std::path::Path;

use serde_json::{Value, json};

use crate::identify::GateReport;
use crate::work::{self, Failure};

use super::session::{Common, Session};
use super::table::{significant, table};
use super::{NOT_DONE, Outcome};

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let Common { study, data, start, seed, .. } = &args.common;
    let found = work::check(study, data.as_deref(), start, *seed, &session.monitor(), &|step: &str| session.progress.say(step));
    session.progress.end();
    let free: Vec<Value> = found
        .gate
        .iter()
        .flat_map(|r| &r.free)
        .map(|p| json!({ "name": p.name, "moves_residual": p.moves_residual, "sensitivity": p.sensitivity, "lowers_cost": p.lowers_cost }))
        .collect();
    let ok = found.problems.is_empty();
    let problems: Vec<Value> = found.problems.iter().map(Failure::problem).collect();
    let value = json!({ "ok": ok, "problems": problems, "free": free, "findings": found.notes });
    let text = super::text::notes(&found.notes) + &told(&found.problems, found.gate.as_ref(), study);
    Ok(Outcome { json: value, text, code: if ok { 0 } else { NOT_DONE } })
}

fn told(problems: &[Failure], report: Option<&GateReport>, study: &Path) -> String {
    let mut text = String::new();
    if let Some(r) = report {
        let yes = |b: bool| if b { "yes" } else { "no" }.to_string();
        let row = |p: &crate::identify::GateParameter| {
            vec![p.name.clone(), yes(p.moves_residual), yes(p.lowers_cost), significant(p.sensitivity, 3)]
        };
        let header = ["free parameter", "moves the residual", "lowers the cost", "sensitivity [sigma per relative change]"];
        text += &table(&header, &r.free.iter().map(row).collect::<Vec<_>>());
        text += &format!("A short fit reaches {} sigma rms.\n\n", significant(r.best_rms, 3));
    }
    for (k, p) in problems.iter().enumerate() {
        text += &format!("{}. {}\n   where: {}\n   accepted: {}\n", k + 1, p.message(), p.place(), p.accepted());
    }
    text += &match problems.len() {
        0 => format!("No problem found. Next: `misfit fit {}`.\n", study.display()),
        1 => "One problem.\n".into(),
        n => format!("{n} problems.\n"),
    };
    text
}
