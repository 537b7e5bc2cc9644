//! `misfit simulate`: the virtual rig, `crate::simulate`, into a folder.

use serde_json::json;

use crate::simulate::{Rig, Settings};
use crate::study::Study;
use crate::study::run::RunFolder;
use crate::units::Dimension;
use crate::work::Failure;

use super::session::{Common, Session};
use super::table::table;
use super::{Outcome, fit};

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

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    session.progress.say("computing every test");
    let settings = Settings { noise: args.noise, cycles: args.cycles, seed: args.common.seed };
    let rig = session.watched(|| Rig::new(&study, settings.seed))?;
    let folder = target(&session, &study)?;
    let written = session.watched(|| rig.write(&settings, &folder));
    session.progress.end();
    let tests = written?;
    let rows: Vec<Vec<String>> = tests.iter().map(|t| vec![t.id.clone(), t.kind.clone(), t.file.clone().unwrap_or("-".into())]).collect();
    // Studies name it relative to themselves, or in full.
    let shown = folder.path.canonicalize().unwrap_or_else(|_| folder.path.clone()).display().to_string();
    let text = format!("{}\nDataset: {shown}\nNext: a study with dataset = \"{shown}\".\n", table(&["test", "kind", "file"], &rows));
    let value = fit::json(&json!({ "dataset": shown, "tests": tests, "noise": args.noise, "seed": args.common.seed }), &folder)?;
    if args.common.out.is_none()
        && let Some(run) = folder.path.parent()
    {
        RunFolder::at(run).result(&value)?;
    }
    Ok(Outcome { json: value, text, code: 0 })
}

/// `--out`, or `data` in the folder of the run.
fn target(session: &Session, study: &Study) -> Result<RunFolder, Failure> {
    let path = match &session.common.out {
        Some(out) => out.clone(),
        None => session.folder(study, "simulate")?.path.join("data"),
    };
    Ok(RunFolder::at(path))
}
