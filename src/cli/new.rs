//! `misfit new`: a study from files of a test bench. Says what it found and writes dataset.toml and study.toml, to be confirmed by eye.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::data::inspect::{Cyclic, FoundFile, FoundFrf, FoundHistory, FoundItem, inspect};
use crate::data::modal_fit::{self, FrfSet, ModalFit};
use crate::data::{Dataset, Estimate, Record, Role};

use super::Outcome;
use super::table::{percent, significant, table};
use crate::work::Failure;

mod scaffold;

#[derive(clap::Args)]
pub(super) struct Args {
    /// Folder of the new study; it must not be there, or be empty
    pub dir: PathBuf,
    /// Files from the test bench: .csv .txt .tsv .dat .asc .parquet .uff .unv .mat
    #[arg(long, required = true, num_args = 1.., value_name = "FILES")]
    pub from: Vec<PathBuf>,
    /// One JSON object on stdout, everything else on stderr
    #[arg(long)]
    pub json: bool,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    free(&args.dir)?;
    let mut names: Vec<String> = Vec::new();
    for file in &args.from {
        let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if names.contains(&name) {
            return Err(Failure::new(
                "data",
                file.display().to_string(),
                format!("two files are named `{name}`"),
                "files of different names",
            ));
        }
        names.push(name);
    }
    // Every file is read before anything is written.
    let (mut found, mut files, mut left): (Vec<FoundFile>, Vec<PathBuf>, Vec<Failure>) = (vec![], vec![], vec![]);
    for file in &args.from {
        match inspect(file) {
            Ok(one) => {
                found.push(one);
                files.push(file.clone());
            }
            Err(e) => left.push(Failure::from(e)),
        }
    }
    if found.is_empty()
        && let Some(first) = left.drain(..).next()
    {
        return Err(first);
    }
    let scaffold = scaffold::write(&found);
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
    let (problem, modes) = create(&args.dir, &files, &scaffold)?;
    let shown = |name: &str| args.dir.join(name).display().to_string();
    let items: Vec<Value> = found.iter().flat_map(|f| f.items.iter().map(|i| item(f, i))).collect();
    let value = json!({
        "dataset": shown("data/dataset.toml"),
        "study": shown("study.toml"),
        "found": items,
        "to_confirm": scaffold.to_confirm,
        "left_out": left.iter().map(Failure::problem).collect::<Vec<_>>(),
        "problem": problem.as_ref().map(Failure::problem),
        "modes": modes.as_ref().map(modes_json),
    });
    Ok(Outcome { json: value, text: told(&found, &left, &scaffold, problem.as_ref(), modes.as_ref(), args), code: 0 })
}

fn free(dir: &Path) -> Result<(), Failure> {
    let taken = match fs::read_dir(dir) {
        Ok(mut entries) => entries.next().is_some(),
        Err(e) => e.kind() != io::ErrorKind::NotFound,
    };
    if taken {
        return Err(Failure::new(
            "study",
            dir.display().to_string(),
            "something is there already, and nothing is written over",
            "a new folder, or an empty one",
        ));
    }
    Ok(())
}

/// Writes everything beside the target and moves it there in one step: whole, or not at all. Reads the new dataset once for what is still wrong with it.
fn create(dir: &Path, files: &[PathBuf], scaffold: &scaffold::Scaffold) -> Result<(Option<Failure>, Option<ModalFit>), Failure> {
    let fail = |e: io::Error| {
        Failure::new("study", dir.display().to_string(), format!("the study cannot be written: {e}"), "a folder that can be written to")
    };
    let parent = dir.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(parent).map_err(fail)?;
    let temporary = tempfile::Builder::new().prefix(".misfit-new-").tempdir_in(parent).map_err(fail)?;
    let data = temporary.path().join("data");
    fs::create_dir(&data).map_err(fail)?;
    for file in files {
        if let Some(name) = file.file_name() {
            fs::copy(file, data.join(name)).map_err(fail)?;
        }
    }
    fs::write(data.join("dataset.toml"), &scaffold.dataset).map_err(fail)?;
    fs::write(temporary.path().join("study.toml"), &scaffold.study).map_err(fail)?;
    let (problem, modes) = match Dataset::load(&data, None) {
        Ok(dataset) => (None, modes(&dataset)),
        Err(e) => {
            let f = Failure::from(e);
            let place = f.place().replace(&temporary.path().display().to_string(), &dir.display().to_string());
            (Some(Failure::new("data", place, f.message(), f.accepted())), None)
        }
    };
    if dir.is_dir() {
        // Empty, as `free` has seen; if it is not any more, this fails and nothing is lost.
        fs::remove_dir(dir).map_err(fail)?;
    }
    fs::rename(temporary.path(), dir).map_err(fail)?;
    // What the guard would delete has moved.
    let _ = temporary.keep();
    Ok((problem, modes))
}

/// Values of FRFs up to which modes are looked for.
const VALUES: usize = 200_000;

/// Modal parameters of the FRFs, where they make one set.
fn modes(dataset: &Dataset) -> Option<ModalFit> {
    let frfs: Vec<_> = dataset.tests.iter().filter_map(|t| if let Record::Frf(f) = &t.record { Some(f.as_ref()) } else { None }).collect();
    let set = FrfSet::from_frfs(&frfs).ok()?;
    // A look, not a study: large sets would take minutes.
    if set.h.len() * set.frequency.len() > VALUES {
        return None;
    }
    modal_fit::fit(&set, &modal_fit::Settings::default()).ok()
}

fn modes_json(fit: &ModalFit) -> Value {
    let mode = |m: &modal_fit::Mode| {
        json!({ "frequency_hz": m.frequency, "frequency_std": m.frequency_sigma, "damping": m.damping, "damping_std": m.damping_sigma, "complexity": m.complexity,
                "shape": m.shape.iter().map(|s| [s.re, s.im]).collect::<Vec<_>>() })
    };
    Value::from(fit.modes.iter().map(mode).collect::<Vec<_>>())
}

fn item(file: &FoundFile, item: &FoundItem) -> Value {
    let path = file.path.display().to_string();
    match item {
        FoundItem::History(h) => {
            let channel = |c: &crate::data::inspect::FoundColumn| {
                let (low, high) = c.values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
                json!({ "column": c.column, "role": c.role.map(|r| r.word()), "unit": c.unit, "min": low, "max": high })
            };
            let cyclic = h.cyclic.as_ref();
            json!({ "file": path, "what": if cyclic.is_some() { "cycle" } else { "transient" }, "channels": h.columns.iter().map(channel).collect::<Vec<_>>(),
                    "samples": h.samples, "rate_hz": h.rate, "seconds": h.seconds, "frequency_hz": cyclic.map(|c| c.frequency), "cycles": cyclic.map(|c| c.cycles),
                    "start_up_cycles": cyclic.map(|c| c.start_up), "control": cyclic.map(|c| c.control.role().word()),
                    "control_recognised": cyclic.map(|c| c.recognised), "loop": cyclic.and_then(measured),
                    "findings": h.findings.iter().map(|n| format!("{}: {}", n.about, n.text)).collect::<Vec<_>>() })
        }
        FoundItem::Frf(f) => {
            let place = |p: Option<(i64, &str, bool)>| p.map(|(n, axis, against)| format!("{n}:{}{axis}", if against { "-" } else { "+" }));
            json!({ "file": path, "what": "frf", "record": f.record, "respond": place(f.respond), "excite": place(f.excite), "quantity": f.quantity.map(|q| q.word()),
                    "channels": f.columns.iter().map(|(r, c, u)| json!({ "column": c, "role": r.word(), "unit": u })).collect::<Vec<_>>(),
                    "lines": f.lines, "from_hz": f.band.0, "to_hz": f.band.1, "findings": f.findings })
        }
        FoundItem::Modes(m) => {
            let mode = |(f, z): &(f64, Option<f64>)| json!({ "frequency_hz": f, "damping": z });
            json!({ "file": path, "what": "modal", "modes": m.modes.iter().map(mode).collect::<Vec<_>>() })
        }
        FoundItem::Other(text) => json!({ "file": path, "what": "other", "text": text }),
    }
}

/// The settled loop in SI: amplitudes, energies with their deviations.
fn measured(c: &Cyclic) -> Option<Value> {
    let e = c.settled.energy(None)?;
    let pair = |e: Estimate| json!({ "value": e.value, "std": e.sigma });
    let noise = |role: Role| c.settled.channels.iter().find(|c| c.role == role).map(|c| c.sigma_sample);
    Some(
        json!({ "cycles_averaged": c.settled.cycles, "points": c.settled.n, "displacement_amplitude": 0.5 * e.travel.value, "force_amplitude": 0.5 * e.force_range.value,
                 "displacement_noise": noise(Role::Displacement), "force_noise": noise(Role::Force), "W_D": pair(e.dissipated),
                 "W_s_slope": e.stored_slope.map(pair), "W_s_product": pair(e.stored_product), "D": pair(e.loss_ratio) }),
    )
}

fn told(
    found: &[FoundFile],
    left: &[Failure],
    scaffold: &scaffold::Scaffold,
    problem: Option<&Failure>,
    modes: Option<&ModalFit>,
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
    if let Some(fit) = modes.filter(|m| !m.modes.is_empty()) {
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
        FoundItem::Other(what) => format!("  {what}\n"),
    }
}

fn history(h: &FoundHistory) -> String {
    let mut text = format!("  history: {} samples, {} Hz, {} s\n", h.samples, significant(h.rate, 6), significant(h.seconds, 5));
    for c in &h.columns {
        let role = c.role.map_or("not used", |r| r.word());
        text += &format!("    {}: {role}, unit {}\n", c.column, c.unit.as_deref().unwrap_or("not given"));
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
            text +=
                &format!("    settled loop: W_D {} J, D {}, over {} cycles\n", pair(e.dissipated), pair(e.loss_ratio), c.settled.cycles);
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
        if f.columns.len() > 3 { ", with coherence" } else { "" }
    );
    f.findings.iter().for_each(|n| text += &format!("    finding: {n}\n"));
    text
}
