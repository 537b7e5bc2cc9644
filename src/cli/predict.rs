//! `misfit predict`: the study's predictions from the calibrated model, with their standard deviations.

use std::path::PathBuf;

use crate::parallel;
use nalgebra::DMatrix;
use polars::prelude::{Column, DataFrame, ParquetWriter};
use serde_json::{Value, json};

use crate::diagnose::{self, Case, Fitted};
use crate::identify::Replicate;
use crate::predict::{self, Calibrated, Prediction, Sweep};
use crate::report::{ReportInput, html_with};
use crate::study::run::{RunError, RunFolder};
use crate::study::{Predicted, PredictionSpec, Study, ToleranceSpec};
use crate::units::Dimension;

use super::session::{Common, Session};
use super::share::Shared;
use super::table::{percent, significant, table};
use super::{INTERRUPTED, Outcome, fit, report, scatter, text};
use crate::work::Failure;
use shifts::{Shift, over_none};

mod shifts;
mod told;
pub(super) mod tolerance;

/// Relative change of the cost at which the fit of a rung that the program wrote may end.
pub(super) const WRITTEN: f64 = 1e-6;

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
    // A rung that the program wrote stands at its optimum: its fit need only see that it does.
    let near = |case: Case| Case { f_tol: (!way.is_empty()).then_some(WRITTEN), ..case };
    let case = near(session.case(study)?);
    let folder = session.folder(&asked, "predict")?;
    args.shared.join(&folder)?;
    let done = fit::fitted(&session, &case, &folder, args.resume.as_deref());
    let (case, fitted, result) = done.inspect_err(|_| folder.discard())?;
    let replicates = match args.bootstrap {
        Some(n) => scatter::replicates(&session, &case, &fitted, &folder, (n as usize, args.shared.share))?,
        None => vec![],
    };
    let stopped = session.interrupted() && args.bootstrap.is_some_and(|n| replicates.len() < args.shared.share.of(n as usize).count());
    session.progress.say("predictions");
    let listed = listed(study, &fitted, &replicates)?;
    let mut text = format!("{}\n\n", asked.title);
    let outcome = match &study.tolerance {
        Some(spec) => Some(cases(&session, spec, &way, study, &fitted, &fitted.uncertainty()?.covariance)?),
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
    text += &format!("{}\n{}", text::tests(&result.tests), listed.text);
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

/// The tolerance cases by every rung.
fn cases(
    session: &Session,
    spec: &ToleranceSpec,
    way: &[Study],
    study: &Study,
    fitted: &Fitted,
    covariance: &DMatrix<f64>,
) -> Result<crate::tolerance::Outcome, Failure> {
    let earlier = way.len().saturating_sub(1);
    let added = |k: usize, now: &Study| k.checked_sub(1).map_or(vec![], |k| tolerance::added(&way[k].system, &now.system));
    let mut rungs = Vec::new();
    for (k, before) in way[..earlier].iter().enumerate() {
        session.progress.say(&format!("fit of rung {k}"));
        let case = Case { f_tol: Some(WRITTEN), ..session.case(before)? };
        let (_, fitted, _) = diagnose::fit(&case, &fit::ALL, &session.monitor())?;
        let spread = fitted.uncertainty()?;
        let added = added(k, before);
        let own = before.tolerance.as_ref().unwrap_or(spec);
        rungs.push(predict::rung(own, &calibrated(before, &fitted, &spread.covariance), title(k, &added), added)?);
    }
    session.progress.say("tolerance cases");
    let added = added(earlier, study);
    let answer = calibrated(study, fitted, covariance);
    rungs.push(predict::rung(spec, &answer, title(earlier, &added), added)?);
    tolerance::outcome(spec, &answer, rungs, session.common.seed)
}

/// What a rung is called: as it stands, or what was added.
fn title(k: usize, added: &[String]) -> String {
    match (k, added) {
        (0, _) => "as it stands".into(),
        (k, []) => format!("rung {k}"),
        (k, [only]) => format!("rung {k}, with {only}"),
        (k, [first, more @ ..]) => format!("rung {k}, with {first} and {} more", more.len()),
    }
}

/// A fitted study as the predictions see it.
pub(super) fn calibrated<'a>(study: &'a Study, fitted: &'a Fitted, covariance: &'a DMatrix<f64>) -> Calibrated<'a> {
    Calibrated {
        study,
        system: &fitted.system,
        free: &fitted.free,
        covariance,
        p: &fitted.outcome.p,
        variance: fitted.outcome.whitened_rms().powi(2),
    }
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
    for Prediction { spec, found, std, sweep } in predict::predictions(study, fitted)? {
        all.sweeps.extend(sweep);
        let scattered = scattered(spec, study, fitted, replicates);
        let reference = spec.reference.as_ref().map(|q| q.value);
        let relative = reference.filter(|r| *r != 0.0).map(|r| found.value / r - 1.0);
        let unit = si(spec.dimension());
        // The table is in the unit of the reference where there is one, the JSON in SI.
        let (symbol, factor) = spec.reference.as_ref().map_or((unit.clone(), 1.0), |q| (q.unit.symbol.clone(), q.unit.factor));
        let shown = |v: f64| significant(v / factor, 4);
        if let (Predicted::Shift { test, mode, .. }, Some(r)) = (&spec.quantity, reference) {
            all.shifts.push(Shift { test: test.clone(), mode: *mode, measured: r, computed: found.value });
        }
        let beyond = beyond(study, spec);
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
        predict::evaluate(spec, study, &system, &[]).ok().map(|found| found.value).filter(|v| v.is_finite())
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
