//! `misfit compare`: the model as it stands against the measurements.

use serde_json::json;

use crate::diagnose::results::{EffectAt, FitResult, SplitName, TestResult};
use crate::diagnose::{self, Case};

use super::failure::Failure;
use super::session::{Common, Session};
use super::{Outcome, fit, report, text};

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    let case = session.case(&study)?;
    session.progress.say("computing every test");
    let case = case.refined(&case.system).unwrap_or(case);
    let tests = diagnose::compare(&case, &case.system, &fit::ALL)?;
    session.progress.end();
    let folder = session.folder(&study, "compare")?;
    folder.study(&study, &case.system)?;
    folder.residuals(&tests)?;
    report::write(&folder, &study, &case.system, Some(&as_it_stands(&case, &tests)), None, None)?;
    let value = fit::json(&json!({ "study": study.title, "tests": fit::plain(&tests)? }), &folder)?;
    folder.result(&value)?;
    let shown = args.common.study.display().to_string();
    let text = format!(
        "{} at the values of its study.toml\n\n{}\n{}{}Run: {}\n",
        study.title,
        text::tests(&tests),
        text::notes(&case.notes()),
        text::verdict(&tests, &shown),
        folder.path.display()
    );
    Ok(Outcome { json: value, text, code: 0 })
}

/// The comparison in the form the report draws: no iteration was made and no parameter was identified.
fn as_it_stands(case: &Case, tests: &[TestResult]) -> FitResult {
    let fitted = || tests.iter().filter(|t| t.split == SplitName::Fit);
    FitResult {
        study: case.name.clone(),
        termination: "not fitted".into(),
        cost: fitted().map(|t| 0.5 * t.whitened_rms.powi(2) * t.n as f64).sum(),
        n_residuals: fitted().map(|t| t.n).sum(),
        n_free: case.system.free().len(),
        wall_s: 0.0,
        iterations: 0,
        tests: tests.to_vec(),
        parameters: vec![],
        model_error: vec![],
        scatter: vec![],
        noise: 1.0,
        unidentifiable: vec![],
        effects: case.system.instances.iter().map(|i| EffectAt { effect: i.name().into(), at: i.at.clone() }).collect(),
        notes: std::iter::once("the model at the values of study.toml, not fitted".to_string()).chain(case.notes()).collect(),
    }
}
