//! `misfit diagnose`: where the model fails, which effects explain it, how sure that is.

use serde_json::json;

use crate::diagnose::results::{Candidate, Diagnosis, FitResult, SplitName, Verdict};
use crate::diagnose::{self, Case, Unexplained};

use super::session::{Common, Session};
use super::table::{percent, significant, table};
use super::{INTERRUPTED, Outcome, fit, report, text};
use crate::study::Study;
use crate::work::{self, Failure, Scored};

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// The score test alone: every effect at every place with the fall of the cost that it predicts; nothing is refitted and nothing concluded
    #[arg(long)]
    scores: bool,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    session.progress.say("fit");
    if args.scores {
        return scores(&session, &study, &case);
    }
    let done = call(&session, &case);
    session.progress.end();
    let (result, diagnosis) = done?;
    let folder = session.folder(&study, "diagnose")?;
    let system = fit::at_values(&case.system, &result.parameters);
    folder.study(&study, &system)?;
    folder.residuals(&result.tests)?;
    session.show(&result.tests);
    report::write(&folder, &study, &system, Some(&result), Some(&diagnosis), None)?;
    let mut value = fit::json(&diagnosis, &folder)?;
    value["fit"] = fit::plain(&result)?;
    folder.result(&value)?;
    let shown = args.common.study.display().to_string();
    let text = format!(
        "{}\n\n{}\n{}\nRun: {}\n",
        study.title,
        text::tests(&result.tests, text::Sealed::default()),
        told(&diagnosis, &shown),
        folder.path.display()
    );
    Ok(Outcome { json: value, text, code: if session.interrupted() { INTERRUPTED } else { 0 } })
}

/// Fit and score map.
fn scores(session: &Session, study: &Study, case: &Case) -> Result<Outcome, Failure> {
    let splits = [SplitName::Fit, SplitName::Select];
    let monitor = session.monitor();
    let done = diagnose::fit(case, &splits, &monitor).and_then(|(case, fitted, result)| {
        let marks = diagnose::map(&case, &fitted, &monitor, &|step: &str| session.progress.say(step))?;
        Ok((fitted.system, result, marks))
    });
    session.progress.end();
    let (system, result, marks) = done?;
    let scored = work::scored(study, &system, &marks);
    let folder = session.folder(study, "diagnose")?;
    folder.study(study, &system)?;
    let value = fit::json(&json!({ "scores": fit::plain(&scored)?, "fit": fit::plain(&result)? }), &folder)?;
    folder.result(&value)?;
    let row = |s: &Scored| {
        let at = s.of.as_ref().map_or(s.at.clone(), |of| format!("{} ({of})", s.at));
        let promises = if s.promises { "yes" } else { "no" };
        let drop = percent(s.predicted_drop);
        vec![s.effect.clone(), at, drop, significant(s.nats, 3), significant(s.price, 3), promises.into(), s.tied_with.join("; ")]
    };
    let header = ["effect", "at", "predicted drop", "nats at most", "price", "worth a refit", "cannot be told from"];
    let rows: Vec<Vec<String>> = scored.iter().take(SHOWN).map(row).collect();
    let rest = scored.len().saturating_sub(SHOWN);
    let more = if rest > 0 { format!("and {rest} more, in {}\n", folder.path.join("result.json").display()) } else { String::new() };
    let text = format!("{}\n\n{}{more}Run: {}\n", study.title, table(&header, &rows), folder.path.display());
    Ok(Outcome { json: value, text, code: if session.interrupted() { INTERRUPTED } else { 0 } })
}

/// Candidates of the score map that are printed.
const SHOWN: usize = 40;

/// Fit and diagnosis under the session's watch.
pub(super) fn call(session: &Session, case: &Case) -> Result<(FitResult, Diagnosis), Failure> {
    Ok(diagnose::diagnose(case, &session.monitor(), &|step: &str| session.progress.say(step))?)
}

/// Candidates as a table.
pub(super) fn candidates(list: &[Candidate]) -> String {
    let row = |c: &Candidate| {
        vec![
            c.effect.clone(),
            c.at.clone(),
            percent(c.predicted_drop),
            significant(c.p_value, 2),
            percent(c.error_before),
            c.error_after.map_or("-".into(), percent),
            if c.accepted { "yes" } else { "no" }.into(),
            c.selected.map_or("-".into(), percent),
            c.tied_with.join("; "),
            c.remark.clone(),
        ]
    };
    let header = [
        "effect",
        "at",
        "predicted drop",
        "p",
        "error before",
        "after",
        "accepted",
        "part of all at once",
        "cannot be told from",
        "remark",
    ];
    table(&header, &list.iter().map(row).collect::<Vec<_>>())
}

/// What would explain the rest, and how to paste it.
pub(super) fn suggestion(u: &Unexplained) -> String {
    let indented: String = u.formula.lines().map(|l| format!("  {l}\n")).collect();
    format!(
        "A force at {} would explain {} of it (error {} before, {} after); as an effect of the study:\n\n{indented}\n",
        u.at,
        percent(u.explains),
        percent(u.error_before),
        percent(u.error_after)
    )
}

/// A verdict in a sentence, `names` of what is missing. `undecided`: see [`crate::diagnose::LadderResult::undecided`].
pub(super) fn sentence(verdict: Verdict, proven: bool, undecided: bool, names: &[String]) -> String {
    match verdict {
        Verdict::Missing => format!("Missing: {}.", names.join(", ")),
        Verdict::NothingMissing => "Nothing is missing: no effect explains more of what is left than it costs.".into(),
        Verdict::Unexplained if proven && !names.is_empty() => {
            format!("Missing in part: {}. The rest of the misfit is unexplained: no effect of the library takes it away.", names.join(", "))
        }
        Verdict::Unexplained if !names.is_empty() => {
            let take = if names.len() == 1 { "takes" } else { "take" };
            let what = if undecided {
                "all of the misfit away that is not noise or scatter between tests, and the held-out tests do not bear it out"
            } else {
                "a part of the misfit away on the fitted tests, and that is not the answer"
            };
            format!("Unexplained: {} {take} {what}.", names.join(", "))
        }
        Verdict::Unexplained => "Something is missing that no effect of the library explains.".into(),
        Verdict::Interrupted => "The search was interrupted before it had found anything; it says nothing about what is missing.".into(),
    }
}

fn told(d: &Diagnosis, study: &str) -> String {
    let mut text = String::new();
    if !d.findings.is_empty() {
        let row = |f: &crate::diagnose::results::Finding| {
            vec![f.test.clone(), f.claim.clone(), significant(f.number, 3), significant(f.threshold, 3), percent(f.power)]
        };
        text += &table(&["test", "finding", "number", "threshold", "power"], &d.findings.iter().map(row).collect::<Vec<_>>());
        text += "\n";
    }
    if !d.candidates.is_empty() {
        text += &candidates(&d.candidates);
        text += "\n";
    }
    if let Some(remark) = &d.second_opinion.remark {
        text += &format!("Second opinion: {remark}.\n");
    }
    let missing: Vec<String> = d.missing.iter().map(ToString::to_string).collect();
    text += &sentence(d.verdict, false, false, &missing);
    text += "\n";
    if let Some(u) = &d.unexplained {
        text += &suggestion(u);
    }
    for seen in &d.would_have_been_seen {
        text += &format!("would have been seen: {seen}\n");
    }
    if let Some(next) = &d.next_test {
        text += &format!("A test that would separate the tied: {}\n", next.describe);
    }
    if let Some(why) = &d.no_next_test {
        text += &format!("No test is proposed: {why}.\n");
    }
    if let (Verdict::Missing, Some(first)) = (d.verdict, d.missing.first()) {
        text += &format!("Next: `misfit add {study} {} --at {}`, or `misfit ladder {study}`.\n", first.effect, first.at);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_leaves_nothing_and_is_not_borne_out_is_told_apart_from_what_leaves_a_part() {
        let said = |undecided| sentence(Verdict::Unexplained, false, undecided, &["film at c1.x".into()]);
        assert!(said(true).contains("film at c1.x takes all of the misfit away that is not noise or scatter between tests"));
        assert!(said(false).contains("film at c1.x takes a part of the misfit away"));
    }
}
