//! `misfit simulate`: the virtual rig. Model and values of the study are the truth, the tests of its dataset the programme.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::data::{Control, Dataset, Frf, Record, Test, TimeRecord};
use crate::diagnose::Case;
use crate::response::BlockKind;
use crate::study::Study;
use crate::study::run::RunFolder;
use crate::units::{Dimension, Unit};

use super::session::{Common, Session};
use super::table::table;
use super::{Outcome, fit};
use crate::work::Failure;

mod noise;
mod tables;
use noise::Noise;

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Standard deviation of the noise: of a channel's range (histories), of each line (FRF), of each value (tables)
    #[arg(long, value_name = "N %", default_value = "1 %", value_parser = fraction)]
    noise: f64,
    /// Cycles of a periodic test
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(2..=1000))]
    cycles: u16,
}

fn fraction(text: &str) -> Result<f64, String> {
    match crate::units::parse(text, Dimension::DIMENSIONLESS) {
        Ok(f) if (0.0..1.0).contains(&f) => Ok(f),
        Ok(_) => Err("0 or above and below 100 %".into()),
        Err(e) => Err(e.to_string()),
    }
}

/// Averages behind the coherence that is written.
const AVERAGES: u32 = 20;

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let mut study = session.study()?;
    // A fit may compare fewer points of a loop; what is written has all that were measured.
    study.fit.points = None;
    let case = session.case(&study)?;
    session.progress.say("computing every test");
    let case = session.watched(|| case.refined(&case.system).unwrap_or(case));
    let folder = target(&session, &study)?;
    let written = session.watched(|| dataset(&study, &case, args, &folder));
    session.progress.end();
    let tests = written?;
    let rows: Vec<Vec<String>> =
        tests.iter().map(|t| ["id", "kind", "file"].iter().map(|k| t[*k].as_str().unwrap_or("-").to_string()).collect()).collect();
    // Studies name it relative to themselves, or in full.
    let shown = folder.path.canonicalize().unwrap_or_else(|_| folder.path.clone()).display().to_string();
    let text = format!("{}\nDataset: {shown}\nNext: a study with dataset = \"{shown}\".\n", table(&["test", "kind", "file"], &rows));
    let value = fit::json(&json!({ "dataset": shown, "tests": tests, "noise": args.noise, "seed": args.common.seed }), &folder)?;
    if args.common.out.is_none()
        && let Some(run) = folder.path.parent()
    {
        RunFolder { path: run.to_path_buf() }.result(&value)?;
    }
    Ok(Outcome { json: value, text, code: 0 })
}

/// `--out`, or `data` in the folder of the run. Never where measurements lie.
fn target(session: &Session, study: &Study) -> Result<RunFolder, Failure> {
    let path = match &session.common.out {
        Some(out) => out.clone(),
        None => session.folder(study, "simulate")?.path.join("data"),
    };
    if path.join("dataset.toml").exists() {
        let message = "a dataset is there already, and measurements are never written over";
        return Err(Failure::new("study", path.display().to_string(), message, "--out with a new folder"));
    }
    std::fs::create_dir_all(&path).map_err(|e| {
        Failure::new("study", path.display().to_string(), format!("the folder cannot be made: {e}"), "a folder that can be written")
    })?;
    Ok(RunFolder { path })
}

/// Writes the files, then dataset.toml, without which they are no dataset.
fn dataset(study: &Study, case: &Case, args: &Args, folder: &RunFolder) -> Result<Vec<Value>, Failure> {
    let mut toml = String::from("schema = 1\n");
    let truth: Vec<String> = study
        .system
        .instances
        .iter()
        .flat_map(|i| {
            i.effect
                .info()
                .params
                .iter()
                .zip(&i.params)
                .map(move |(p, v)| format!("{} at {}: {} = {:e} (SI)", i.name(), i.at, p.name, v.value))
        })
        .collect();
    let quoted = |s: &str| toml::Value::from(s).to_string();
    let _ = writeln!(toml, "title = {}", quoted(&format!("simulated from {}", study.title)));
    let _ = writeln!(toml, "source = {}", quoted(&format!("misfit simulate, noise {} %, seed {}", 100.0 * args.noise, args.common.seed)));
    let assumptions: Vec<String> = truth.iter().map(|t| quoted(t)).collect();
    let _ = writeln!(toml, "assumptions = [{}]", assumptions.join(", "));
    let mut tests = Vec::new();
    for (k, (plan, _)) in case.plans.iter().enumerate() {
        let Some(test) = study.dataset.test(&plan.id) else { continue };
        let mut computed = plan.evaluate(&case.system, &[], false)?.values;
        // Tables are computed as logarithms.
        for block in plan.blocks.iter().filter(|b| b.kind == BlockKind::Table) {
            computed[block.range.clone()].iter_mut().for_each(|v| *v = v.exp());
        }
        let blocks: Vec<&[f64]> = plan.blocks.iter().map(|b| &computed[b.range.clone()]).collect();
        let mut noise = Noise::new(args.common.seed, k as u64, args.noise);
        let _ = write!(toml, "\n[[test]]\nid = {}\nkind = {}\n", quoted(&test.id), quoted(test.kind().word()));
        conditions(&mut toml, test);
        let file = format!("{}.csv", test.id);
        let csv = match &test.record {
            Record::Cycle(r) => Some(cycle(&mut toml, r, &blocks, args.cycles.into(), &mut noise)?),
            Record::Transient(r) => Some(transient(&mut toml, r, &blocks, &mut noise)),
            Record::Frf(f) => Some(frf(&mut toml, f, blocks.first().copied().unwrap_or(&[]), &mut noise)),
            Record::Energy(e) => {
                tables::energy(&mut toml, e, plan, &computed, &mut noise);
                None
            }
            Record::Modal(m) => {
                tables::modal(&mut toml, m, plan, &computed, &mut noise);
                None
            }
        };
        let file = csv.map(|csv| folder.write(&file, csv.as_bytes()).map(|_| file)).transpose()?;
        tests.push(json!({ "id": test.id, "kind": test.kind().word(), "file": file }));
    }
    let path: PathBuf = folder.write("dataset.toml", toml.as_bytes())?;
    // What was written is read back: a dataset that the program itself would refuse is an error here, not later.
    Dataset::load(Path::new(&path), None)?;
    Ok(tests)
}

fn conditions(toml: &mut String, test: &Test) {
    if !test.conditions.is_empty() {
        let one = |(k, c): (&String, &crate::data::Condition)| format!("{} = \"{}\"", toml::Value::from(k.as_str()), c.quantity());
        let all: Vec<String> = test.conditions.iter().map(one).collect();
        let _ = writeln!(toml, "conditions = {{ {} }}", all.join(", "));
    }
}

fn control(toml: &mut String, control: Option<Control>) {
    if let Some(c) = control {
        let _ = writeln!(toml, "control = \"{}\"", c.role().word());
    }
}

/// Channel lines of a history: the driven one first, as recorded, then those that are compared.
fn channels(toml: &mut String, file: &str, record: &TimeRecord, shown: &[(usize, Option<f64>)]) {
    let _ = writeln!(toml, "file = {}\nchannels = [\n  {{ role = \"time\", column = \"t\", unit = \"s\" }},", toml::Value::from(file));
    for (k, sigma) in shown {
        let c = &record.channels[*k];
        let input = if c.input { ", input = true" } else { "" };
        let sigma = sigma.map_or(String::new(), |s| format!(", sigma = \"{:e} {}\"", c.unit.difference_from_si(s), c.unit.symbol));
        let (role, at, unit) = (c.role.word(), &c.at, &c.unit.symbol);
        let _ = writeln!(toml, "  {{ role = \"{role}\", at = \"{at}\", column = \"y{k}\", unit = \"{unit}\"{input}{sigma} }},");
    }
    toml.push_str("]\n");
}

/// Which channels of a record the blocks of its plan are, in order.
fn compared(record: &TimeRecord) -> Vec<usize> {
    (0..record.channels.len()).filter(|k| record.answers(&record.channels[*k])).collect()
}

fn csv(header: &[String], rows: impl Iterator<Item = Vec<f64>>) -> String {
    let mut text = header.join(",") + "\n";
    for row in rows {
        let cells: Vec<String> = row.iter().map(|v| format!("{v:e}")).collect();
        text += &cells.join(",");
        text.push('\n');
    }
    text
}

/// The settled cycle, `cycles` times, each with noise of its own: the scatter between cycles is the noise.
fn cycle(toml: &mut String, record: &TimeRecord, blocks: &[&[f64]], cycles: usize, noise: &mut Noise) -> Result<String, Failure> {
    let settled = record.settled()?;
    let outputs = compared(record);
    let driven = record.channels.iter().position(|c| c.input).unwrap_or(0);
    control(toml, record.control);
    let shown: Vec<(usize, Option<f64>)> = std::iter::once(driven).chain(outputs.iter().copied()).map(|k| (k, None)).collect();
    channels(toml, &format!("{}.csv", record.test), record, &shown);
    let header: Vec<String> = std::iter::once("t".to_string()).chain(shown.iter().map(|(k, _)| format!("y{k}"))).collect();
    let sigma: Vec<f64> = blocks.iter().map(|b| noise.of_range(b)).collect();
    // One sample beyond the last cycle closes it.
    let n = settled.n;
    let dt = 1.0 / (settled.frequency * n as f64);
    let mut rows = Vec::with_capacity(cycles * n + 1);
    for k in 0..=cycles * n {
        let j = k % n;
        let mut row = vec![k as f64 * dt, record.channels[driven].unit.from_si(settled.input.at_phase(settled.phase[j]).0)];
        for ((block, sigma), c) in blocks.iter().zip(&sigma).zip(&outputs) {
            row.push(record.channels[*c].unit.from_si(block[j] + sigma * noise.normal()));
        }
        rows.push(row);
    }
    Ok(csv(&header, rows.into_iter()))
}

fn transient(toml: &mut String, record: &TimeRecord, blocks: &[&[f64]], noise: &mut Noise) -> String {
    let outputs = compared(record);
    let sigma: Vec<f64> = blocks.iter().map(|b| noise.of_range(b)).collect();
    control(toml, record.control);
    let inputs: Vec<usize> = (0..record.channels.len()).filter(|k| record.channels[*k].input).collect();
    let mut shown: Vec<(usize, Option<f64>)> = inputs.iter().map(|k| (*k, None)).collect();
    shown.extend(outputs.iter().zip(&sigma).map(|(k, s)| (*k, (*s > 0.0).then_some(*s))));
    channels(toml, &format!("{}.csv", record.test), record, &shown);
    let header: Vec<String> = std::iter::once("t".to_string()).chain(shown.iter().map(|(k, _)| format!("y{k}"))).collect();
    let mut rows = Vec::with_capacity(record.time.len());
    for (i, t) in record.time.iter().enumerate() {
        let mut row = vec![*t];
        row.extend(inputs.iter().map(|k| record.channels[*k].unit.from_si(record.channels[*k].values[i])));
        for ((block, sigma), c) in blocks.iter().zip(&sigma).zip(&outputs) {
            row.push(record.channels[*c].unit.from_si(block[i] + sigma * noise.normal()));
        }
        rows.push(row);
    }
    csv(&header, rows.into_iter())
}

/// Each part of each line gets noise of `e |H|`, and the coherence says so: `sigma = |H| sqrt((1 - g2) / (2 n g2))` gives
/// `g2 = 1 / (1 + 2 n e^2)`.
fn frf(toml: &mut String, frf: &Frf, computed: &[f64], noise: &mut Noise) -> String {
    let quoted = |s: &str| toml::Value::from(s).to_string();
    let (excite, respond) = (quoted(&frf.excite), quoted(&frf.respond));
    let _ = writeln!(
        toml,
        "file = {}\nexcite = {excite}\nrespond = {respond}\nquantity = \"{}\"",
        quoted(&format!("{}.csv", frf.test)),
        frf.quantity.word()
    );
    if let Some(f) = frf.excitation {
        let rotational = frf.excite.rsplit_once('.').and_then(|(_, a)| crate::model::Axis::parse(a).ok()).is_some_and(|a| a.rotational());
        let dimension = if rotational { Dimension::MOMENT } else { Dimension::FORCE };
        let _ = writeln!(toml, "excitation = \"{}\"", Unit::si(dimension).print(f));
    }
    let unit = quoted(&frf.unit.symbol);
    let _ = writeln!(
        toml,
        "channels = [\n  {{ role = \"frequency\", column = \"f\", unit = \"Hz\" }},\n  {{ role = \"real\", column = \"re\", unit = {unit} }},\n  \
         {{ role = \"imag\", column = \"im\", unit = {unit} }},\n  {{ role = \"coherence\", column = \"coh\", averages = {AVERAGES} }},\n]"
    );
    let e = noise.fraction();
    let coherence = 1.0 / (1.0 + 2.0 * f64::from(AVERAGES) * e * e);
    let header = ["f", "re", "im", "coh"].map(str::to_string);
    let mut rows = Vec::with_capacity(frf.frequency.len());
    for (f, h) in frf.frequency.iter().zip(computed.chunks_exact(2)) {
        let sigma = e * h[0].hypot(h[1]);
        let (re, im) = (h[0] + sigma * noise.normal(), h[1] + sigma * noise.normal());
        rows.push(vec![*f, frf.unit.from_si(re), frf.unit.from_si(im), coherence]);
    }
    csv(&header, rows.into_iter())
}
