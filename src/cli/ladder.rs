//! `misfit ladder`: diagnose, add, refit, prune until nothing earns its place.

use std::path::PathBuf;

use crate::diagnose::results::{LadderResult, Reading, Rung, SplitName, Verdict};

use super::session::{Common, Session};
use super::table::{percent, significant, table};
use super::{INTERRUPTED, Outcome, fit, text};
use crate::work::{self, Failure};

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Go on with a ladder that was stopped or killed, from the folder of its run; it ends as if nothing had happened
    #[arg(long, value_name = "RUNDIR")]
    resume: Option<PathBuf>,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    let folder = session.folder(&study, "ladder")?;
    let done = work::ladder(&study, &case, &folder, args.resume.as_deref(), session.monitor(), &|step: &str| session.progress.say(step));
    session.progress.end();
    let (result, _) = done.inspect_err(|_| folder.discard())?;
    if let Some(last) = result.rungs.last() {
        session.show(&last.tests);
    }
    let value = fit::json(&result, &folder)?;
    folder.result(&value)?;
    let mut text = told(&result) + &format!("The study with these effects and values: {}\n", folder.path.display());
    if result.interrupted {
        text += &format!("Stopped; to go on: --resume {}\n", folder.path.display());
    }
    Ok(Outcome { json: value, text, code: if result.interrupted { INTERRUPTED } else { 0 } })
}

fn told(result: &LadderResult) -> String {
    let row = |(k, rung): (usize, &Rung)| {
        let error =
            |split| text::pooled(&rung.tests, split).map_or(["-".to_string(), "-".into()], |(e, f)| [percent(e), significant(e / f, 3)]);
        let mut row = vec![
            k.to_string(),
            rung.added.as_ref().map_or("-".into(), ToString::to_string),
            rung.removed.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
            rung.nats.map_or("-".into(), |nats| significant(nats, 3)),
        ];
        row.extend(error(SplitName::Fit));
        row.extend(error(SplitName::Select));
        row.extend(error(SplitName::HeldOut));
        row
    };
    let rows: Vec<Vec<String>> = result.rungs.iter().enumerate().map(row).collect();
    let header = ["rung", "added", "removed", "nats", "fit error", "/floor", "select error", "/floor", "held-out error", "/floor"];
    let mut text = format!("{}\n\n{}\n", result.study, table(&header, &rows));
    if let Some(last) = result.rungs.last() {
        text += &text::parameters(&last.parameters);
        text += "\n";
    }
    let missing: Vec<String> = result.missing.iter().map(ToString::to_string).collect();
    text += &super::diagnose::sentence(result.verdict, result.proven, result.undecided(), &missing);
    text += match (result.interrupted, result.verdict) {
        (true, Verdict::NothingMissing) => {
            " The fit is at the noise; the search was interrupted, and effects that are weaker than it were not all looked for.\n"
        }
        (true, _) if !missing.is_empty() => " So far: the search was interrupted.\n",
        _ => "\n",
    };
    for (k, remark) in result.rungs.iter().enumerate().filter_map(|(k, r)| Some((k, r.second_opinion.remark.as_ref()?))) {
        text += &format!("Second opinion on what rung {k} misses: {remark}.\n");
    }
    if result.proven || !(result.missing.is_empty() && result.instruments.is_empty()) {
        text += &format!("{}: {}.\n", super::text::proven(result.proven, result.verdict), result.why);
    }
    for i in &result.instruments {
        text += &format!("Instrument: {} at {}: {}.\n", i.effect, i.at, i.why);
    }
    for c in &result.corrections {
        text += &format!("Correction: {}.\n", c.describe());
    }
    if result.unexplained_remainder && result.verdict == Verdict::Missing {
        text +=
            &format!("They leave a model error of {} beyond the noise that nothing in the library explains.\n", percent(result.remainder));
    }
    text += &text::errors(&result.model_error, &result.scatter, result.noise);
    for (k, rung) in result.rungs.iter().enumerate() {
        text += &Reading::describe(&rung.readings).iter().map(|r| format!("Rung {k}: {r}.\n")).collect::<String>();
    }
    if let Some(u) = &result.unexplained {
        text += &super::diagnose::suggestion(u);
    }
    for m in result.missing.iter().filter(|m| !m.tied_with.is_empty()) {
        text += &format!("{m} cannot be told from {} by these tests.\n", m.tied_with.join(", "));
    }
    if let (Some(before), Some(after), Some(floor)) = (result.held_out.before, result.held_out.after, result.held_out.floor) {
        text += &format!(
            "Held-out error: {} before, {} after, floor {} (ratio {}).\n",
            percent(before),
            percent(after),
            percent(floor),
            significant(after / floor, 3)
        );
        if result.verdict == Verdict::NothingMissing && after > result.settings.fitting.misses * floor {
            text += "It stands above the noise by strengths that differ from test to test, and by what instruments may err by: within these nothing is missing.\n";
        }
    }
    if let Some(next) = &result.next_test {
        text += &format!("A test that would separate the tied: {}\n", next.describe);
    }
    if let Some(why) = &result.no_next_test {
        text += &format!("No test is proposed: {why}.\n");
    }
    text + &format!("It ended because {}.\n", result.ended)
}
