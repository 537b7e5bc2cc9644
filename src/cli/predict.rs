//! `misfit predict`: the study's predictions from the calibrated model, with their standard deviations.

use std::path::PathBuf;

use crate::parallel;
use polars::prelude::{Column, DataFrame, ParquetWriter};
use serde_json::{Value, json};

use crate::diagnose::Fitted;
use crate::identify::{Replicate, uncertainty};
use crate::report::{ReportInput, Sweep, html_with};
use crate::study::run::{RunError, RunFolder};
use crate::study::{Predicted, PredictionSpec, Study};
use crate::units::Dimension;

use super::failure::Failure;
use super::session::{Common, Session};
use super::table::{percent, significant, table};
use super::{INTERRUPTED, Outcome, fit, report, scatter, text};

mod tolerance;
mod value;

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
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    if study.predictions.is_empty() && study.tolerance.is_none() {
        return Err(Failure::new(
            "study",
            study.file.display().to_string(),
            "the study asks for no prediction",
            "[[prediction]] with case, quantity, ..., or [tolerance]",
        ));
    }
    let case = session.case(&study)?;
    let folder = session.folder(&study, "predict")?;
    let done = fit::fitted(&session, &case, &folder, args.resume.as_deref());
    let (case, fitted, result) = done.inspect_err(|_| folder.discard())?;
    let spread = uncertainty(&fitted.outcome, &fitted.options, &fitted.judgement())?;
    let replicates = match args.bootstrap {
        Some(n) => scatter::replicates(&session, &case, &fitted, &folder, n as usize)?,
        None => vec![],
    };
    let stopped = session.interrupted() && args.bootstrap.is_some_and(|n| replicates.len() < n as usize);
    session.progress.say("predictions");
    let mut rows = Vec::new();
    let mut predictions: Vec<Value> = Vec::new();
    let (mut off, mut all) = (0.0, 0.0);
    let mut sweeps: Vec<Sweep> = Vec::new();
    for spec in &study.predictions {
        let found = match value::sweep(spec, &fitted.system, &fitted.free)? {
            Some((sweep, range)) => {
                sweeps.push(sweep);
                range
            }
            None => value::evaluate(spec, &study, &fitted.system, &fitted.free)?,
        };
        let std = value::deviation(&found, &spread.covariance, &fitted.outcome.p);
        let scattered = scattered(spec, &study, &fitted, &replicates);
        let reference = spec.reference.as_ref().map(|q| q.value);
        let relative = reference.filter(|r| *r != 0.0).map(|r| found.value / r - 1.0);
        let unit = si(spec.dimension());
        // The table is in the unit of the reference where there is one, the JSON in SI.
        let (symbol, factor) = spec.reference.as_ref().map_or((unit.clone(), 1.0), |q| (q.unit.symbol.clone(), q.unit.factor));
        let shown = |v: f64| significant(v / factor, 4);
        if let (Predicted::Shift { .. }, Some(r)) = (&spec.quantity, reference) {
            off += (found.value - r).powi(2);
            all += r * r;
        }
        let beyond = beyond(&study, spec);
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
        predictions.push(json!({
            "case": spec.case, "quantity": spec.quantity.word(), "unit": unit, "value": found.value, "std": std,
            "reference": reference, "relative_error": relative, "extrapolated": beyond,
            "bootstrap": scattered.as_ref().map(|s| json!({ "std": s.std, "interval": [s.interval.0, s.interval.1] })),
        }));
    }
    // What is off over what "no shift" would be off.
    let shifts = (all > 0.0).then(|| (off / all).sqrt());
    let header = ["case", "quantity", "value", "std", "95 % by bootstrap", "unit", "reference", "error", ""];
    let mut text = format!("{}\n\n{}\n", study.title, text::tests(&result.tests));
    if !rows.is_empty() {
        text += &format!("{}\n", table(&header, &rows));
    }
    if let Some(ratio) = shifts {
        text += &format!("Shifts of frequency: root mean square error over that of no shift {}.\n\n", significant(ratio, 3));
    }
    let outcome = match &study.tolerance {
        Some(spec) => {
            session.progress.say("tolerance cases");
            let p = &fitted.outcome.p;
            Some(tolerance::outcome(&study, spec, &fitted.system, &fitted.free, &spread.covariance, p, session.common.seed)?)
        }
        None => None,
    };
    session.progress.end();
    folder.study(&study, &fitted.system)?;
    folder.residuals(&result.tests)?;
    let mut value = json!({ "fit": fit::plain(&result)?, "shift_error_over_none": shifts });
    if let (Some(outcome), Some(spec)) = (&outcome, &study.tolerance) {
        predictions.extend(tolerance::predictions(outcome));
        value["tolerance"] = tolerance::json(outcome);
        text += &tolerance::text(outcome, spec);
        tolerance::write_surface(&outcome.surface, &folder)?;
    }
    if !sweeps.is_empty() {
        write_sweeps(&sweeps, &folder)?;
    }
    value["predictions"] = predictions.into();
    let input = ReportInput { study: &study, system: Some(&fitted.system), fit: Some(&result), diagnosis: None, ladder: None };
    folder.write(report::FILE, html_with(&input, outcome.as_ref(), &sweeps)?.as_bytes())?;
    let mut value = fit::json(&value, &folder)?;
    if stopped {
        text += &format!("Stopped; to go on: --resume {}\n", folder.path.display());
        value["termination"] = "interrupted".into();
    }
    folder.result(&value)?;
    text += &format!("Run: {}\n", folder.path.display());
    Ok(Outcome { json: value, text, code: if stopped { INTERRUPTED } else { fit::code(&result.termination) } })
}

/// Writes columns of equal length as a Parquet file of the run.
fn write_columns(file: &str, columns: Vec<Column>, folder: &RunFolder) -> Result<(), Failure> {
    let fail = |e: polars::error::PolarsError| RunError::Write { path: folder.path.join(file), reason: e.to_string() };
    let mut frame = DataFrame::new(columns.first().map_or(0, Column::len), columns).map_err(fail)?;
    let mut bytes = Vec::new();
    ParquetWriter::new(&mut bytes).finish(&mut frame).map_err(fail)?;
    folder.write(file, &bytes)?;
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

/// A prediction over the replicates; none without them.
fn scattered(spec: &PredictionSpec, study: &Study, fitted: &Fitted, replicates: &[Replicate]) -> Option<scatter::Spread> {
    let at = |r: &Replicate| -> Option<f64> {
        let mut system = fitted.system.clone();
        for (f, v) in fitted.free.iter().zip(r.p.as_ref()?) {
            system.instances[f.instance].params[f.param].value = if f.log { v.exp() } else { *v };
        }
        value::evaluate(spec, study, &system, &[]).ok().map(|found| found.value).filter(|v| v.is_finite())
    };
    scatter::spread(parallel::map(replicates, at).into_iter().flatten().collect())
}

/// In words, where a condition that a law of the model depends on lies outside those of the tests.
fn beyond(study: &Study, spec: &PredictionSpec) -> Option<String> {
    let targets = study.system.instances.iter().filter_map(|i| i.target.as_ref());
    let of_laws = |name: &String| targets.clone().any(|t| t.condition == *name);
    spec.conditions.iter().filter(|(name, _)| of_laws(name)).find_map(|(name, c)| {
        let tested = study.dataset.tests.iter().filter_map(|t| t.conditions.get(name)).map(|c| c.value);
        let (low, high) = tested.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let outside = c.value < low || c.value > high;
        outside.then(|| format!("extrapolated: {name} is {}, the tests have {} to {}", c.quantity(), c.unit.print(low), c.unit.print(high)))
    })
}

/// The SI unit as it is printed: an energy in J.
fn si(dimension: Dimension) -> String {
    if dimension == Dimension::ENERGY { "J".into() } else { dimension.si_unit() }
}
