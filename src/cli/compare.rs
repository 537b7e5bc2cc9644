//! `misfit compare`: the model as it stands against the measurements.

use serde_json::json;

use crate::diagnose;
use crate::diagnose::results::SplitName;
use crate::work::{Failure, as_it_stands};

use super::session::{Common, Session};
use super::{Outcome, fit, report, text};

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    sealed: text::Sealed,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    session.progress.say("computing every test");
    let (case, tests) = session.watched(|| {
        let case = case.refined(&case.system).unwrap_or(case);
        diagnose::compare(&case, &case.system, &SplitName::ALL, &session.monitor().watch()).map(|tests| (case, tests))
    })?;
    session.progress.end();
    let folder = session.folder(&study, "compare")?;
    folder.study(&study, &case.system)?;
    folder.residuals(&tests)?;
    session.show(&tests);
    report::write(&folder, &study, &case.system, Some(&as_it_stands(&case, &tests)), None, None)?;
    let value = fit::json(&json!({ "study": study.title, "tests": fit::plain(&tests)? }), &folder)?;
    folder.result(&value)?;
    let shown = args.common.study.display().to_string();
    let text = format!(
        "{} at the values of its study.toml\n\n{}\n{}{}Run: {}\n",
        study.title,
        text::tests(&tests, args.sealed),
        text::notes(&case.notes()),
        text::verdict(&tests, &shown, 0, args.sealed),
        folder.path.display()
    );
    Ok(Outcome { json: value, text, code: 0 })
}
