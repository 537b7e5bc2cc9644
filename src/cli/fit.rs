//! `misfit fit`: identifies the study as it stands.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::diagnose::results::{FitResult, ParameterResult, SplitName};
use crate::diagnose::{self, Case, Fitted};
use crate::identify::Monitor;
use crate::model::System;
use crate::study::Study;
use crate::study::run::RunFolder;

use super::failure::Failure;
use super::session::{Common, Session};
use super::{INTERRUPTED, NOT_DONE, Outcome, report, text};

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Go on from the best state of an interrupted fit, kept in the folder of its run (of several starts: from the best)
    #[arg(long, value_name = "RUNDIR")]
    resume: Option<PathBuf>,
}

pub(super) const ALL: [SplitName; 3] = [SplitName::Fit, SplitName::Select, SplitName::HeldOut];

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    let folder = session.folder(&study, "fit")?;
    let done = fitted(&session, &case, &folder, args.resume.as_deref()).and_then(|(fitted, result)| {
        keep(&study, &fitted.system, &folder, &result)?;
        Ok(result)
    });
    let result = done.inspect_err(|_| folder.discard())?;
    let mut text = text::fit(&result, &args.common.study.display().to_string());
    text += &format!("Run: {}\n", folder.path.display());
    Ok(Outcome { json: json(&result, &folder)?, text, code: code(&result.termination) })
}

/// Exit code of a fit that ended this way.
pub(super) fn code(termination: &str) -> u8 {
    match termination {
        "interrupted" => INTERRUPTED,
        "failed" => NOT_DONE,
        _ => 0,
    }
}

fn fitted(session: &Session, case: &Case, folder: &RunFolder, resume: Option<&Path>) -> Result<(Fitted, FitResult), Failure> {
    if let Some(old) = resume {
        take_over(old, folder)?;
    }
    session.progress.say("fit");
    let monitor: Monitor = session.monitor().checkpoint(folder.checkpoint(), resume.is_some());
    let result = diagnose::fit(case, &ALL, &monitor);
    session.progress.end();
    let (_, fitted, mut result) = result?;
    // Of several starts the best may have converged before the others were stopped: the search as a whole was not done.
    if case.starts > 1 && session.interrupted() {
        result.termination = "interrupted".into();
    }
    if case.starts > 1 && resume.is_some() {
        result.notes.push("fit: went on from the best state of the earlier run; starts not tried there were not tried here".into());
    }
    Ok((fitted, result))
}

/// Copies the checkpoint of an earlier run, so that its folder stays as it was.
fn take_over(old: &Path, folder: &RunFolder) -> Result<(), Failure> {
    let file = if old.is_file() { old.to_path_buf() } else { RunFolder { path: old.to_path_buf() }.checkpoint() };
    let bytes = std::fs::read(&file).map_err(|e| {
        let accepted = "the folder of a `fit`, which keeps checkpoint.json";
        Failure::new("identify", file.display().to_string(), format!("no best state to go on from: {e}"), accepted)
    })?;
    folder.write("checkpoint.json", &bytes)?;
    Ok(())
}

/// Writes study, result, residuals and report of a fit.
pub(super) fn keep(study: &Study, system: &System, folder: &RunFolder, result: &FitResult) -> Result<(), Failure> {
    folder.study(study, system)?;
    folder.residuals(&result.tests)?;
    report::write(folder, study, system, Some(result), None, None)?;
    folder.result(&json(result, folder)?)?;
    Ok(())
}

/// The system with the fitted values of its free parameters.
pub(super) fn at_values(system: &System, parameters: &[ParameterResult]) -> System {
    let mut fitted = system.clone();
    for f in system.free() {
        if let Some(p) = parameters.iter().find(|p| p.name == f.name) {
            fitted.instances[f.instance].params[f.param].value = p.value;
        }
    }
    fitted
}

/// A result as JSON, with the folder of its run. Numbers that are not finite are null.
pub(super) fn json(result: &impl serde::Serialize, folder: &RunFolder) -> Result<Value, Failure> {
    let mut value = plain(result)?;
    if let Value::Object(map) = &mut value {
        map.insert("run".into(), folder.path.display().to_string().into());
    }
    Ok(value)
}

pub(super) fn plain(result: &impl serde::Serialize) -> Result<Value, Failure> {
    serde_json::to_value(result).map_err(|e| Failure::new("cli", "result", e.to_string(), "a result that is valid JSON"))
}
