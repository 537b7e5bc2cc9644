//! `misfit predict`: the study's predictions from the calibrated model, with their standard deviations.

use serde_json::{Value, json};

use crate::diagnose;
use crate::identify::{UncertaintyOptions, uncertainty};
use crate::units::Dimension;

use super::failure::Failure;
use super::session::{Common, Session};
use super::table::{percent, significant, table};
use super::{Outcome, fit, report, text};

mod value;

#[derive(clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    pub common: Common,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let session = Session::begin(&args.common)?;
    let study = session.study()?;
    if study.predictions.is_empty() {
        return Err(Failure::new(
            "study",
            study.file.display().to_string(),
            "the study asks for no prediction",
            "[[prediction]] with case, quantity, ...",
        ));
    }
    let case = session.case(&study)?;
    session.progress.say("fit");
    let (_, fitted, result) = diagnose::fit(&case, &fit::ALL, &session.monitor())?;
    let spread = uncertainty(&fitted.outcome, &fitted.options, &UncertaintyOptions::default())?;
    session.progress.say("predictions");
    let mut rows = Vec::new();
    let mut predictions: Vec<Value> = Vec::new();
    for spec in &study.predictions {
        let found = value::evaluate(spec, &fitted.system, &fitted.free)?;
        let std = value::deviation(&found, &spread.covariance, &fitted.outcome.p);
        let reference = spec.reference.as_ref().map(|q| q.value);
        let relative = reference.filter(|r| *r != 0.0).map(|r| found.value / r - 1.0);
        let unit = si(spec.dimension());
        // The table is in the unit of the reference where there is one, the JSON in SI.
        let (symbol, factor) = spec.reference.as_ref().map_or((unit.clone(), 1.0), |q| (q.unit.symbol.clone(), q.unit.factor));
        let shown = |v: f64| significant(v / factor, 4);
        rows.push(vec![
            spec.case.clone(),
            spec.quantity.word().to_string(),
            shown(found.value),
            std.map_or("-".into(), |s| significant(s / factor, 2)),
            symbol,
            reference.map_or("-".into(), shown),
            relative.map_or("-".into(), percent),
        ]);
        predictions.push(json!({
            "case": spec.case, "quantity": spec.quantity.word(), "unit": unit, "value": found.value, "std": std,
            "reference": reference, "relative_error": relative,
        }));
    }
    session.progress.end();
    let folder = session.folder(&study, "predict")?;
    folder.study(&study, &fitted.system)?;
    folder.residuals(&result.tests)?;
    report::write(&folder, &study, &fitted.system, Some(&result), None, None)?;
    let value = fit::json(&json!({ "predictions": predictions, "fit": fit::plain(&result)? }), &folder)?;
    folder.result(&value)?;
    let header = ["case", "quantity", "value", "std", "unit", "reference", "error"];
    let text = format!("{}\n\n{}\n{}\nRun: {}\n", study.title, text::tests(&result.tests), table(&header, &rows), folder.path.display());
    Ok(Outcome { json: value, text, code: fit::code(&result.termination) })
}

/// The SI unit as it is printed: an energy in J.
fn si(dimension: Dimension) -> String {
    if dimension == Dimension::ENERGY { "J".into() } else { dimension.si_unit() }
}
