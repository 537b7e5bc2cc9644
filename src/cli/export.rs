//! `misfit export`: the calibrated set in other formats.

use std::collections::BTreeMap;

use clap::ValueEnum;
use serde_json::json;

use crate::data::Test;
use crate::diagnose;
use crate::export::{CalibratedSet, EXPORTERS, Exporter, Source, stand_alone};
use crate::identify::uncertainty;
use crate::model::Level;
use crate::study::Study;

use super::session::{Common, Session};
use super::{Outcome, fit};
use crate::work::Failure;

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    Json,
    Csv,
    Parquet,
    Adams,
    Exudyn,
    /// A folder with study and data that stands alone
    Study,
}

impl Format {
    fn exporter(self) -> Option<&'static dyn Exporter> {
        let name = match self {
            Format::Json => "json",
            Format::Csv => "csv",
            Format::Parquet => "parquet",
            Format::Adams => "adams",
            Format::Exudyn => "exudyn",
            Format::Study => return None,
        };
        EXPORTERS.iter().copied().find(|e| e.name() == name)
    }
}

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Formats, separated by commas
    #[arg(long, value_delimiter = ',', required = true, value_enum)]
    to: Vec<Format>,
    /// Test at whose conditions and loads a mechanism is exported [default: the first under a load, else the first]
    #[arg(long, value_name = "TEST")]
    test: Option<String>,
}

/// Id and conditions of the test a mechanism stands at, these in SI and as they are stated.
fn stand(args: &Args, study: &Study) -> Result<(String, BTreeMap<String, f64>, String), Failure> {
    let tests = &study.dataset.tests;
    let conditions = |t: &Test| -> BTreeMap<String, f64> { t.conditions.iter().map(|(k, c)| (k.clone(), c.value)).collect() };
    let loaded = |t: &&Test| {
        let stated = |l: &Level| matches!(l, Level::Condition(name, _) if t.conditions.contains_key(name));
        study.system.model.loads.iter().any(|l| l.path.iter().any(stated))
    };
    let test = match &args.test {
        Some(id) => tests.iter().find(|t| t.id == *id).ok_or_else(|| {
            let known: Vec<&str> = tests.iter().map(|t| t.id.as_str()).collect();
            Failure::new("export", "--test", format!("there is no test `{id}`"), known.join(", "))
        })?,
        None => tests.iter().find(loaded).or(tests.first()).ok_or_else(|| {
            Failure::new("export", "--to", "the dataset has no test whose conditions a mechanism could stand at", "at least one [[test]]")
        })?,
    };
    let described: Vec<String> = test.conditions.iter().map(|(k, c)| format!("{k} = {}", c.unit.print(c.value))).collect();
    Ok((test.id.clone(), conditions(test), described.join(", ")))
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let (test, conditions, described) = stand(args, &study)?;
    let case = session.case(&study)?;
    session.progress.say("fit");
    let (_, fitted, result) = diagnose::fit(&case, &fit::ALL, &session.monitor())?;
    session.progress.end();
    let spread = uncertainty(&fitted.outcome, &fitted.options, &fitted.judgement())?;
    let source = crate::limits::bytes(&study.file, crate::limits::CONFIG_BYTES)
        .map_err(|e| Failure::new("study", study.file.display().to_string(), e.to_string(), "a study.toml that can be read"))?;
    let set = CalibratedSet::new(&source, &result, &fitted, &spread.covariance);
    let folder = session.folder(&study, "export")?;
    folder.study(&study, &fitted.system)?;
    let (mut files, mut notes): (Vec<String>, Vec<String>) = (vec![], vec![]);
    let of = Source { set: &set, system: &fitted.system, test: &test, conditions: &conditions, described: &described };
    for exporter in args.to.iter().filter_map(|f| f.exporter()) {
        let exported = exporter.files(&of)?;
        for (name, bytes) in exported.files {
            files.push(folder.write(&name, &bytes)?.display().to_string());
        }
        for note in exported.notes {
            eprintln!("{}: {note}", exporter.name());
            notes.push(format!("{}: {note}", exporter.name()));
        }
    }
    if args.to.iter().any(|f| matches!(f, Format::Study)) {
        let written = stand_alone(&study, &fitted.system, &folder.path.join("study"))?;
        files.extend(written.iter().map(|f| f.display().to_string()));
    }
    let value = fit::json(&json!({ "files": files, "notes": notes, "test": test, "termination": result.termination }), &folder)?;
    folder.result(&value)?;
    let text = files.iter().map(|f| format!("{f}\n")).collect();
    Ok(Outcome { json: value, text, code: fit::code(&result.termination) })
}
