//! `misfit fit`: identifies the study as it stands.

use std::path::{Path, PathBuf};

use crate::diagnose::results::{FitResult, SplitName};
use crate::diagnose::{self, Case, Fitted};
use crate::identify::Monitor;
use crate::study::run::RunFolder;

use super::session::{Common, Session};
use super::share::Shared;
use super::{INTERRUPTED, NOT_DONE, Outcome, scatter, text};
use crate::work::Failure;

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Go on from the best state of an interrupted fit, kept in the folder of its run (of several starts: from the best)
    #[arg(long, value_name = "RUNDIR")]
    resume: Option<PathBuf>,
    /// Profile likelihood of these free parameters, each refitted with all others; `all` for every one
    #[arg(long, value_name = "PARAM", num_args = 1.., value_delimiter = ',')]
    profile: Vec<String>,
    /// Bootstrap: refits to this many measurements made of the residuals
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    bootstrap: Option<u32>,
    #[command(flatten)]
    shared: Shared,
    #[command(flatten)]
    sealed: text::Sealed,
}

use crate::work::{profiles, replicates, take_over};

pub(super) use crate::work::{at_values, json, keep, plain};

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    let (folder, share) = (session.folder(&study, "fit")?, args.shared.share);
    args.shared.join(&folder)?;
    let done = fitted(&session, &case, &folder, args.resume.as_deref()).and_then(|(case, fitted, result)| {
        keep(&study, &fitted.system, &folder, &result)?;
        session.show(&result.tests);
        Ok((case, fitted, result))
    });
    let (case, fitted, result) = done.inspect_err(|_| folder.discard())?;
    let mut text = text::fit(&result, &args.common.study.display().to_string(), args.sealed);
    let mut value = json(&result, &folder)?;
    if !args.profile.is_empty() {
        let every = || fitted.free.iter().map(|f| f.name.clone()).collect();
        let names: Vec<String> = if args.profile.iter().any(|n| n == "all") { every() } else { args.profile.clone() };
        let names: Vec<String> = share.of(names.len()).map(|k| names[k].clone()).collect();
        let all = profiles(&case, &fitted, &folder, &names, &session.monitor(), &|step: &str| session.progress.say(step))?;
        text += &format!("\n{}", scatter::profile_table(&all));
        value["profiles"] = plain(&all)?;
    }
    if let Some(n) = args.bootstrap {
        let all = replicates(&case, &fitted, &folder, (n as usize, share), &session.monitor(), &|step: &str| session.progress.say(step))?;
        let (told, table) = scatter::told(&fitted, &all, n as usize);
        text += &format!("\n{table}");
        value["bootstrap"] = told;
    }
    session.progress.end();
    folder.result(&value)?;
    let stopped = session.interrupted() && (args.bootstrap.is_some() || !args.profile.is_empty());
    if stopped {
        text += &format!("Stopped; to go on: --resume {}\n", folder.path.display());
        value["termination"] = "interrupted".into();
    }
    text += &format!("Run: {}\n", folder.path.display());
    Ok(Outcome { json: value, text, code: if stopped { INTERRUPTED } else { code(&result.termination) } })
}

/// Exit code of a fit that ended this way.
pub(super) fn code(termination: &str) -> u8 {
    match termination {
        "interrupted" => INTERRUPTED,
        "failed" => NOT_DONE,
        _ => 0,
    }
}

/// Fits into a folder of a run, from the best state of an earlier one where it is resumed.
pub(super) fn fitted(
    session: &Session,
    case: &Case,
    folder: &RunFolder,
    resume: Option<&Path>,
) -> Result<(Case, Fitted, FitResult), Failure> {
    if let Some(old) = resume {
        take_over(old, folder)?;
    }
    session.progress.say("fit");
    let monitor: Monitor = session.monitor().checkpoint(folder.checkpoint(), resume.is_some());
    let result = diagnose::fit(case, &SplitName::ALL, &monitor);
    session.progress.end();
    let (finer, fitted, mut result) = result?;
    // Of several starts the best may have converged before the others were stopped: the search as a whole was not done.
    if case.starts > 1 && session.interrupted() {
        result.termination = "interrupted".into();
    }
    if case.starts > 1 && resume.is_some() {
        result.notes.push("fit: went on from the best state of the earlier run; starts not tried there were not tried here".into());
    }
    Ok((finer, fitted, result))
}
