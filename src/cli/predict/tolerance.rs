//! The tolerance cases as JSON and as a file of the run.

use polars::prelude::Column;
use serde_json::{Value, json};

use crate::study::run::RunFolder;
use crate::tolerance::{Outcome, Prediction, Quantity, Rung, Surface};
use crate::work::Failure;

fn one(p: &Prediction, cycle: Option<&str>) -> Value {
    let unit = if p.quantity == Quantity::Ratio { "-" } else { "J" };
    let mut value = json!({
        "case": p.case, "quantity": p.quantity.word(), "unit": unit, "value": p.value, "std": p.std, "interval": p.interval,
        "reference": p.reference, "relative_error": p.relative_error(), "left_out": p.left_out, "extrapolated": p.outside,
    });
    if let Some(cycle) = cycle {
        value["cycle"] = cycle.into();
    }
    value
}

fn rung(r: &Rung) -> Value {
    let cycles = r.cycles.iter().map(
        |c| json!({ "test": c.test, "cycle": c.words, "predictions": c.predictions.iter().map(|p| one(p, None)).collect::<Vec<_>>() }),
    );
    let error = r.model_error.map(|e| json!({ "loss_ratio": e.loss_ratio, "W_s": e.stored, "tests": e.tests }));
    json!({ "title": r.title, "added": r.added, "model_error": error, "cycles": cycles.collect::<Vec<_>>() })
}

/// The cases as predictions of contract.md, by the answer.
pub(super) fn predictions(outcome: &Outcome) -> Vec<Value> {
    match (&outcome.laws, outcome.rungs.last()) {
        (Some(laws), _) => laws.predictions.iter().map(|p| one(p, None)).collect(),
        (None, Some(last)) => last.cycles.iter().flat_map(|c| c.predictions.iter().map(|p| one(p, Some(&c.test)))).collect(),
        (None, None) => vec![],
    }
}

/// Everything else as JSON, SI.
pub(super) fn json(outcome: &Outcome) -> Value {
    let findings: Vec<Value> =
        outcome.findings.iter().map(|f| json!({ "claim": f.claim, "number": f.number, "threshold": f.threshold })).collect();
    let constant = outcome.constant.as_ref().map(|(c, leaf)| {
        let largest: Vec<Value> =
            c.largest.iter().map(|(name, off, case)| json!({ "interference": name, "off": off, "case": case })).collect();
        json!({ "value": c.value, "largest": largest, "holds": c.holds(), "leaf_moment_of_area": leaf.0, "leaf_thickness": leaf.1 })
    });
    let laws = outcome.laws.as_ref().map(|l| {
        let compared: Vec<Value> = l
            .compared
            .iter()
            .map(|c| json!({ "library": c.library, "laws": c.laws, "left_out_rms": c.through, "regression_rms": c.regression, "p_value": c.p_value }))
            .collect();
        json!({
            "scale": l.scale, "libraries": compared, "scales": l.scales, "left_out_rms": l.found.relative, "no_law_rms": l.no_law,
            "own_laws_rms": l.own_laws, "law": l.found.words, "coefficients": l.law().coefficients, "permutations": l.found.permutations,
            "p_value": l.found.p_value, "chosen": l.found.cases.iter().map(|c| c.law.clone()).collect::<Vec<_>>(),
            "strength_factors": l.strengths.iter().map(|u| u.exp()).collect::<Vec<f64>>(),
            "left_out_intervals": l.left_out,
        })
    });
    json!({ "constant": constant, "rungs": outcome.rungs.iter().map(rung).collect::<Vec<_>>(), "laws": laws, "findings": findings })
}

/// `surface.parquet`: the two tolerances [m] and the energies [J], one column a layer.
pub(super) fn write_surface(surface: &Surface, folder: &RunFolder) -> Result<(), Failure> {
    let axis = |k: usize| Column::new(surface.axes[k].as_str().into(), surface.points.iter().map(|p| p[k]).collect::<Vec<f64>>());
    let mut columns = vec![axis(0), axis(1)];
    columns.extend(surface.layers.iter().map(|l| Column::new(format!("W_D {}", l.name).into(), l.energy.clone())));
    super::write_columns("surface.parquet", columns, folder)
}
