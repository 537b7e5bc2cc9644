//! `misfit predict`: the study's predictions from the calibrated model, with their standard deviations.

use std::path::PathBuf;

use polars::prelude::{Column, DataFrame};
use serde_json::{Value, json};

use crate::data::written;
use crate::diagnose::Fitted;
use crate::identify::Replicate;
use crate::predict::{self, Prediction, Shift, Sweep, over_none};
use crate::report::{ReportInput, html_with};
use crate::study::Study;
use crate::study::run::{RunError, RunFolder};
use crate::units::Dimension;

use super::session::{Common, Session};
use super::share::Shared;
use super::table::{percent, significant, table};
use super::{INTERRUPTED, Outcome, fit, report, text};
use crate::work::{Failure, replicates};

mod shifts;
mod told;
mod tolerance;

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Intervals from refits to this many measurements made of the residuals, beside the standard deviations
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    bootstrap: Option<u32>,
    /// Go on with the fit and the replicates of an interrupted run, kept in its folder
    #[arg(long, value_name = "RUNDIR")]
    resume: Option<PathBuf>,
    #[command(flatten)]
    shared: Shared,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let asked = session.study()?;
    // The answer is the last rung that the study names, or the study itself.
    let way =
        asked.rungs.iter().map(|path| Ok(Study::load(path, session.common.data.as_deref())?)).collect::<Result<Vec<Study>, Failure>>()?;
    let study = way.last().unwrap_or(&asked);
    if study.predictions.is_empty() && study.tolerance.is_none() {
        return Err(Failure::new(
            "study",
            study.file.display().to_string(),
            "the study asks for no prediction",
            "[[prediction]] with case, quantity, ..., or [tolerance]",
        ));
    }
    let case = predict::case(study, !way.is_empty(), session.common.seed)?;
    let folder = session.folder(&asked, "predict")?;
    args.shared.join(&folder)?;
    let done = fit::fitted(&session, &case, &folder, args.resume.as_deref());
    let (case, fitted, result) = done.inspect_err(|_| folder.discard())?;
    let replicates = match args.bootstrap {
        Some(n) => {
            let say = |step: &str| session.progress.say(step);
            replicates(&case, &fitted, &folder, (n as usize, args.shared.share), &session.monitor(), &say)?
        }
        None => vec![],
    };
    let stopped = session.interrupted() && args.bootstrap.is_some_and(|n| replicates.len() < args.shared.share.of(n as usize).count());
    session.progress.say("predictions");
    let listed = listed(study, &fitted, &replicates)?;
    let mut text = format!("{}\n\n", asked.title);
    let outcome = match &study.tolerance {
        Some(spec) => {
            let answer = (study, &fitted, &fitted.uncertainty()?.covariance);
            let say = |step: &str| session.progress.say(step);
            Some(predict::tolerance(spec, &way, answer, session.common.seed, &session.monitor(), &say)?)
        }
        None => None,
    };
    session.progress.end();
    folder.study(study, &fitted.system)?;
    folder.residuals(&result.tests)?;
    session.show(&result.tests);
    let mut value = json!({ "fit": fit::plain(&result)?, "shift_error_over_none": over_none(listed.shifts.iter()) });
    let mut predictions = Vec::new();
    // The tolerance cases are what a reader asks for first.
    if let (Some(outcome), Some(spec)) = (&outcome, &study.tolerance) {
        predictions.extend(tolerance::predictions(outcome));
        value["tolerance"] = tolerance::json(outcome);
        text += &format!("{}\n", told::text(outcome, spec));
        if let Some(surface) = &outcome.surface {
            tolerance::write_surface(surface, &folder)?;
        }
    }
    predictions.extend(listed.json);
    text += &format!("{}\n{}", text::tests(&result.tests, text::Sealed::OPEN), listed.text);
    if !listed.sweeps.is_empty() {
        write_sweeps(&listed.sweeps, &folder)?;
    }
    let shift = |s: &Shift| json!({ "test": s.test, "mode": s.mode, "measured": s.measured, "computed": s.computed });
    value["shifts"] = listed.shifts.iter().map(shift).collect();
    value["predictions"] = predictions.into();
    let input = ReportInput { study, system: Some(&fitted.system), fit: Some(&result), diagnosis: None, ladder: None };
    folder.write(report::FILE, html_with(&input, outcome.as_ref(), &listed.sweeps)?.as_bytes())?;
    let mut value = fit::json(&value, &folder)?;
    if stopped {
        text += &format!("Stopped; to go on: --resume {}\n", folder.path.display());
        value["termination"] = "interrupted".into();
    }
    folder.result(&value)?;
    text += &format!("Run: {}\n", folder.path.display());
    Ok(Outcome { json: value, text, code: if stopped { INTERRUPTED } else { fit::code(&result.termination) } })
}

/// What `[[prediction]]` asks for.
struct Listed {
    json: Vec<Value>,
    shifts: Vec<Shift>,
    text: String,
    sweeps: Vec<Sweep>,
}

fn listed(study: &Study, fitted: &Fitted, replicates: &[Replicate]) -> Result<Listed, Failure> {
    let mut rows = Vec::new();
    let mut all = Listed { json: vec![], shifts: vec![], text: String::new(), sweeps: vec![] };
    for prediction in predict::predictions(study, fitted)? {
        all.shifts.extend(Shift::of(&prediction));
        let Prediction { spec, found, std, sweep } = prediction;
        all.sweeps.extend(sweep);
        let scattered = predict::scattered(spec, study, fitted, replicates);
        let reference = spec.reference.as_ref().map(|q| q.value);
        let relative = reference.filter(|r| *r != 0.0).map(|r| found.value / r - 1.0);
        let unit = si(spec.dimension());
        // The table is in the unit of the reference where there is one, the JSON in SI.
        let (symbol, factor) = spec.reference.as_ref().map_or((unit.clone(), 1.0), |q| (q.unit.symbol.clone(), q.unit.factor));
        let shown = |v: f64| significant(v / factor, 4);
        let beyond = predict::beyond(study, spec);
        rows.push(vec![
            spec.case.clone(),
            spec.quantity.word().to_string(),
            shown(found.value),
            std.map_or("-".into(), |s| significant(s / factor, 2)),
            scattered.as_ref().map_or("-".into(), |s| format!("{} to {}", shown(s.interval.0), shown(s.interval.1))),
            symbol,
            reference.map_or("-".into(), shown),
            relative.map_or("-".into(), percent),
            beyond.clone().unwrap_or_default(),
        ]);
        all.json.push(json!({
            "case": spec.case, "quantity": spec.quantity.word(), "unit": unit, "value": found.value, "std": std,
            "reference": reference, "relative_error": relative, "extrapolated": beyond,
            "bootstrap": scattered.as_ref().map(|s| json!({ "std": s.std, "interval": [s.interval.0, s.interval.1] })),
        }));
    }
    let header = ["case", "quantity", "value", "std", "95 % by bootstrap", "unit", "reference", "error", ""];
    if !rows.is_empty() {
        all.text += &format!("{}\n", table(&header, &rows));
    }
    all.text += &shifts::text(&all.shifts);
    Ok(all)
}

/// Writes columns of equal length as a Parquet file of the run.
fn write_columns(file: &str, columns: Vec<Column>, folder: &RunFolder) -> Result<(), Failure> {
    let fail = |e: polars::error::PolarsError| RunError::Write { path: folder.path.join(file), reason: e.to_string() };
    let table = DataFrame::new(columns.first().map_or(0, Column::len), columns).map_err(fail)?;
    folder.write(file, &written::parquet(table).map_err(fail)?)?;
    Ok(())
}

/// `sweeps.parquet`: case, time [s], frequency [Hz], displacement [m].
fn write_sweeps(sweeps: &[Sweep], folder: &RunFolder) -> Result<(), Failure> {
    let all = |of: &dyn Fn(&Sweep) -> Vec<f64>| sweeps.iter().flat_map(of).collect::<Vec<f64>>();
    let cases: Vec<&str> = sweeps.iter().flat_map(|s| s.time.iter().map(|_| s.case.as_str())).collect();
    let columns = vec![
        Column::new("case".into(), cases),
        Column::new("time".into(), all(&|s| s.time.clone())),
        Column::new("frequency".into(), all(&|s| s.time.iter().map(|t| s.frequency(*t)).collect())),
        Column::new("displacement".into(), all(&|s| s.displacement.clone())),
    ];
    write_columns("sweeps.parquet", columns, folder)
}

/// The SI unit as it is printed: an energy in J.
fn si(dimension: Dimension) -> String {
    if dimension == Dimension::ENERGY { "J".into() } else { dimension.si_unit() }
}
