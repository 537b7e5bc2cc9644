//! `misfit report`: one self-contained HTML file.

use serde_json::json;

use super::session::{Common, Session};
use super::{Outcome, fit};
use crate::work::Failure;

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
}

pub(super) use crate::work::{REPORT as FILE, report as write};

/// Fits the study and looks for what is missing, then reports both.
pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    session.progress.say("fit and diagnosis");
    let (result, diagnosis) = super::diagnose::call(&session, &case)?;
    session.progress.end();
    let folder = session.folder(&study, "report")?;
    let system = fit::at_values(&case.system, &result.parameters);
    folder.study(&study, &system)?;
    let file = write(&folder, &study, &system, Some(&result), Some(&diagnosis), None)?;
    folder.residuals(&result.tests)?;
    session.show(&result.tests);
    folder.result(&json!({ "fit": fit::plain(&result)?, "diagnosis": fit::plain(&diagnosis)? }))?;
    let shown = file.display().to_string();
    let text = format!("{shown}\nOpens in any browser, without a network.\n");
    let value = fit::json(&json!({ "file": shown }), &folder)?;
    Ok(Outcome { json: value, text, code: if session.interrupted() { super::INTERRUPTED } else { 0 } })
}
