//! `misfit export`: the calibrated set in other formats.

use clap::ValueEnum;
use serde_json::json;

use crate::diagnose;
use crate::export::{CalibratedSet, EXPORTERS, Exporter};
use crate::identify::{UncertaintyOptions, uncertainty};

use super::failure::Failure;
use super::session::{Common, Session};
use super::{Outcome, fit};

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Format {
    Json,
    Csv,
    Parquet,
}

impl Format {
    fn exporter(self) -> Option<&'static dyn Exporter> {
        let name = match self {
            Format::Json => "json",
            Format::Csv => "csv",
            Format::Parquet => "parquet",
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
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    session.progress.say("fit");
    let (_, fitted, result) = diagnose::fit(&case, &fit::ALL, &session.monitor())?;
    session.progress.end();
    let spread = uncertainty(&fitted.outcome, &fitted.options, &UncertaintyOptions::default())?;
    let source = std::fs::read(&study.file)
        .map_err(|e| Failure::new("study", study.file.display().to_string(), e.to_string(), "a study.toml that can be read"))?;
    let set = CalibratedSet::new(&source, &result, &fitted, &spread.covariance);
    let folder = session.folder(&study, "export")?;
    folder.study(&study, &fitted.system)?;
    let mut files: Vec<String> = Vec::new();
    for exporter in args.to.iter().filter_map(|f| f.exporter()) {
        for (name, bytes) in exporter.files(&set)? {
            files.push(folder.write(&name, &bytes)?.display().to_string());
        }
    }
    let value = fit::json(&json!({ "files": files }), &folder)?;
    folder.result(&value)?;
    let text = files.iter().map(|f| format!("{f}\n")).collect();
    Ok(Outcome { json: value, text, code: fit::code(&result.termination) })
}
