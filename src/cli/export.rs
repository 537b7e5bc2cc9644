//! `misfit export`: the calibrated set in other formats.

use clap::ValueEnum;
use serde_json::json;

use crate::diagnose;
use crate::diagnose::results::SplitName;
use crate::export::stand_alone;
use crate::work::{Failure, Stand, export};

use super::session::{Common, Session};
use super::{Outcome, fit};

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
    /// Name of the exporter; a study is none.
    fn word(self) -> Option<&'static str> {
        match self {
            Format::Json => Some("json"),
            Format::Csv => Some("csv"),
            Format::Parquet => Some("parquet"),
            Format::Adams => Some("adams"),
            Format::Exudyn => Some("exudyn"),
            Format::Study => None,
        }
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

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let at = Stand::of(&study, args.test.as_deref())?;
    let case = session.case(&study)?;
    session.progress.say("fit");
    let (_, fitted, result) = diagnose::fit(&case, &SplitName::ALL, &session.monitor())?;
    session.progress.end();
    let folder = session.folder(&study, "export")?;
    let formats: Vec<&str> = args.to.iter().filter_map(|f| f.word()).collect();
    let (mut files, notes) = export(&study, &fitted, &result, &at, &formats, &folder)?;
    notes.iter().for_each(|note| session.progress.note(note));
    if args.to.iter().any(|f| matches!(f, Format::Study)) {
        let written = stand_alone(&study, &fitted.system, &folder.path.join("study"))?;
        files.extend(written.iter().map(|f| f.display().to_string()));
    }
    let value = fit::json(&json!({ "files": files, "notes": notes, "test": at.test, "termination": result.termination }), &folder)?;
    folder.result(&value)?;
    let text = files.iter().map(|f| format!("{f}\n")).collect();
    Ok(Outcome { json: value, text, code: fit::code(&result.termination) })
}
