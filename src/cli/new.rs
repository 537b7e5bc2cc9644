//! `misfit new`: a study from files of a test bench. Says what it found and writes dataset.toml and study.toml, to be confirmed by eye.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::data::inspect::{FoundFile, FoundFrf, FoundHistory, FoundItem};
use crate::data::modal_fit;
use crate::data::{Estimate, Role};
use crate::work::new::{self, Correction, Scaffold};

use super::Outcome;
use super::table::{percent, significant, table};
use crate::work::Failure;

#[derive(clap::Args)]
pub(super) struct Args {
    /// Folder of the new study; it must not be there, or be empty
    pub dir: PathBuf,
    /// Files from the test bench: .csv .txt .tsv .dat .asc .parquet .uff .unv .mat
    #[arg(long, required = true, num_args = 1.., value_name = "FILES")]
    pub from: Vec<PathBuf>,
    /// Samples for each second of the files without a column of time, in Hz
    #[arg(long, value_name = "HZ", value_parser = rate)]
    pub rate: Option<f64>,
    /// Corrections of what is found, as JSON: a list of { file, item, columns = { NAME: { role, unit } }, start_up, control, quantity, respond, excite,
    /// averages }; the workbench writes it
    #[arg(long, value_name = "JSON", value_parser = corrections)]
    pub correct: Option<Corrections>,
    /// One JSON object on stdout, everything else on stderr
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone)]
pub(super) struct Corrections(Vec<Correction>);

fn rate(text: &str) -> Result<f64, String> {
    match text.trim().trim_end_matches("Hz").trim_end().parse::<f64>() {
        // A year between two samples, and a sample in a femtosecond, are no rates.
        Ok(hz) if (1e-8..=1e15).contains(&hz) => Ok(hz),
        _ => Err("samples for each second above 0, such as 610.35".into()),
    }
}

fn corrections(text: &str) -> Result<Corrections, String> {
    let list = serde_json::from_str(text).map(Corrections);
    list.map_err(|e| {
        format!("{e}; such as [{{\"file\": \"loop.csv\", \"item\": 0, \"columns\": {{\"F\": {{\"unit\": \"kN\"}}}}, \"start_up\": 2}}]")
    })
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    new::free(&args.dir)?;
    let names = new::names(&args.from)?;
    // Every file is read before anything is written.
    let new::Looked { found, files, left, scaffold } = new::look(&args.from, args.rate, args.correct.as_ref().map_or(&[], |c| &c.0))?;
    let Some(scaffold) = scaffold else {
        let inside: String = found.iter().flat_map(|f| &f.items).take(20).map(described).collect();
        let message = format!(
            "the files hold no test: neither a history with a channel that drives and one that answers, nor an FRF, nor modes\n{inside}"
        );
        return Err(Failure::new(
            "data",
            names.join(", "),
            message.trim_end(),
            "files with histories of force and displacement, or with FRFs",
        ));
    };
    let (problem, modes) = new::create(&args.dir, &files, &scaffold)?;
    let shown = |name: &str| args.dir.join(name).display().to_string();
    let items: Vec<Value> = found.iter().flat_map(|f| f.items.iter().map(|i| new::item(&f.path.display().to_string(), i))).collect();
    let value = json!({
        "dataset": shown("data/dataset.toml"),
        "study": shown("study.toml"),
        "found": items,
        "to_confirm": scaffold.to_confirm,
        "left_out": left.iter().map(Failure::problem).collect::<Vec<_>>(),
        "problem": problem.as_ref().map(Failure::problem),
        "modes": modes.as_ref().and_then(|m| m.as_ref().ok()).map(new::modes_json),
        "no_modes": modes.as_ref().and_then(|m| m.as_ref().err()),
    });
    Ok(Outcome { json: value, text: told(&found, &left, &scaffold, problem.as_ref(), modes.as_ref(), args), code: 0 })
}

fn told(
    found: &[FoundFile],
    left: &[Failure],
    scaffold: &Scaffold,
    problem: Option<&Failure>,
    modes: Option<&new::Modes>,
    args: &Args,
) -> String {
    let mut text = String::new();
    for file in found {
        text += &format!("{}\n", file.path.display());
        for item in &file.items {
            text += &described(item);
        }
    }
    for file in left {
        text += &format!("{}\n  left out: {}\n  accepted: {}\n", file.place(), file.message(), file.accepted());
    }
    if let Some(Err(why)) = modes {
        text += &format!("\nNo modes of the FRFs: {why}.\n");
    }
    if let Some(Ok(fit)) = modes {
        let row = |m: &modal_fit::Mode| {
            vec![
                format!("{} +- {}", significant(m.frequency, 6), significant(m.frequency_sigma, 2)),
                format!("{} +- {}", percent(m.damping), percent(m.damping_sigma)),
                significant(m.complexity, 2),
            ]
        };
        text += &format!("\n{}", table(&["mode, Hz", "damping", "complexity"], &fit.modes.iter().map(row).collect::<Vec<_>>()));
    }
    text += &format!("\nWritten: {}, {}\n", args.dir.join("data/dataset.toml").display(), args.dir.join("study.toml").display());
    for line in &scaffold.to_confirm {
        text += &format!("confirm: {line}\n");
    }
    match problem {
        Some(p) => text += &format!("still wrong: {}\n  where: {}\n  accepted: {}\n", p.message(), p.place(), p.accepted()),
        None => text += &format!("Next: read both files, then `misfit check {}`.\n", args.dir.display()),
    }
    text
}

fn described(item: &FoundItem) -> String {
    match item {
        FoundItem::History(h) => history(h),
        FoundItem::Frf(f) => frf(f),
        FoundItem::Modes(m) => {
            let (first, last) = (m.modes.first().map_or(0.0, |m| m.0), m.modes.last().map_or(0.0, |m| m.0));
            format!("  table of modes: {} from {} to {} Hz\n", m.modes.len(), significant(first, 6), significant(last, 6))
        }
        FoundItem::Backbone(b) => {
            let mut text = format!("  table of a backbone: {} rows\n", b.rows);
            for c in &b.columns {
                let guessed = c.guess.map_or(String::new(), |g| format!(" (by {g})"));
                let (low, high) = (significant(c.range.0, 5), significant(c.range.1, 5));
                text += &format!(
                    "    {}: {}{guessed}, {low} to {high}, unit {}\n",
                    c.column,
                    c.role.word(),
                    c.unit.as_deref().unwrap_or("not given")
                );
            }
            text
        }
        FoundItem::Other(what) => format!("  {what}\n"),
    }
}

fn history(h: &FoundHistory) -> String {
    let mut text = format!("  history: {} samples, {} Hz, {} s\n", h.samples, significant(h.rate, 6), significant(h.seconds, 5));
    for c in &h.columns {
        let role = c.role.map_or("not used", |r| r.word());
        let guessed = if c.guessed && c.role.is_some() { " (by its letter alone)" } else { "" };
        let place = c.at.map_or(String::new(), |(node, axis, against)| format!(" at {node}:{}{axis}", if against { "-" } else { "+" }));
        text += &format!("    {}: {role}{guessed}{place}, unit {}\n", c.column, c.unit.as_deref().unwrap_or("not given"));
    }
    if let Some(c) = &h.cyclic {
        let sure = if c.recognised { "" } else { " (assumed)" };
        text += &format!(
            "    cycles: {} of {} Hz, {} of them start-up, {} control{sure}\n",
            c.cycles,
            significant(c.frequency, 6),
            c.start_up,
            c.control.role().word()
        );
        if let Some(e) = c.settled.energy(None) {
            let pair = |e: Estimate| format!("{} +- {}", significant(e.value, 4), significant(e.sigma, 2));
            let unit = if h.has_units() { "J" } else { "(J only if what has no unit is SI)" };
            let (energy, ratio) = (pair(e.dissipated), pair(e.loss_ratio));
            text += &format!("    settled loop: W_D {energy} {unit}, D {ratio}, over {} cycles\n", c.settled.cycles);
        }
    }
    h.findings.iter().for_each(|n| text += &format!("    finding: {}: {}\n", n.about, n.text));
    text
}

fn frf(f: &FoundFrf) -> String {
    let record = f.record.as_deref().map_or(String::new(), |r| format!(" {r}"));
    let place = |p: Option<(i64, &str, bool)>| {
        p.map_or("?".to_string(), |(n, axis, against)| format!("{n}:{}{axis}", if against { "-" } else { "+" }))
    };
    let unit = f.columns.get(1).and_then(|c| c.2.clone()).unwrap_or_else(|| "not given".into());
    let mut text = format!(
        "  FRF{record}: {} over {}, {}, unit {unit}, {} lines from {} to {} Hz{}\n",
        place(f.respond),
        place(f.excite),
        f.quantity.map_or("quantity not given", |q| q.word()),
        f.lines,
        significant(f.band.0, 4),
        significant(f.band.1, 6),
        if f.columns.iter().any(|c| c.0 == Role::Coherence) { ", with coherence" } else { "" }
    );
    f.findings.iter().for_each(|n| text += &format!("    finding: {n}\n"));
    text
}
