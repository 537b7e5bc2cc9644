//! `[tolerance]`: the energies of the cases by every rung of the study, and what the tolerance stage makes of them.

use polars::prelude::Column;
use serde_json::{Value, json};

use crate::model::System;
use crate::predict::{self, Calibrated};
use crate::study::run::RunFolder;
use crate::study::{Study, ToleranceSpec};
use crate::tolerance::{Constant, Finding, LawOutcome, LawQuestion, Outcome, Prediction, Quantity, Rung, Surface, outcome, through};

use crate::work::Failure;

/// Points of the surface from one case to the next.
const FINER: usize = 8;

/// Effects of `system` that `before` does not have, as `effect at place`.
pub(super) fn added(before: &System, system: &System) -> Vec<String> {
    let same = |a: &crate::model::Instance, b: &crate::model::Instance| a.name() == b.name() && a.at == b.at;
    let over = |i: &crate::model::Instance| i.target.as_ref().map_or(String::new(), |t| format!(" over {}", t.condition));
    let count = |all: &System, i: &crate::model::Instance| all.instances.iter().filter(|o| same(o, i)).count();
    let mut list: Vec<String> = Vec::new();
    for i in &system.instances {
        let words = format!("{}{} at {}", i.name(), over(i), i.at);
        if count(before, i) < count(system, i) && !list.contains(&words) {
            list.push(words);
        }
    }
    list
}

/// Everything that the cases say of the answer and of the rungs before it.
pub(super) fn outcome(spec: &ToleranceSpec, answer: &Calibrated, rungs: Vec<Rung>, seed: u64) -> Result<Outcome, Failure> {
    let cases = &spec.tables[0].cases;
    let reference = crate::tolerance::energies::find(cases, &spec.reference)?;
    let mut findings: Vec<Finding> = Vec::new();
    let laws = if spec.libraries.is_empty() { None } else { Some(law(spec, answer, &rungs, reference, seed)?) };
    findings.extend(laws.iter().flat_map(|l| l.findings.clone()));
    if laws.is_none() {
        findings.extend(outcome::of_rungs(&rungs));
    }
    for c in &spec.conditions {
        let values: Vec<f64> = cases.cases.iter().map(|k| c.of.iter().filter_map(|q| k.values.get(q)).sum()).collect();
        findings.extend(outcome::unlike(cases, &c.name, &values));
    }
    findings.extend(outcome::varies(&spec.conditions.iter().map(|c| c.name.clone()).collect::<Vec<_>>(), &unvaried(spec, answer.study)));
    let constant = match (&spec.housing, spec.pairs.is_empty()) {
        (Some(housing), false) => {
            let constant = Constant::of(cases, &spec.pairs)?;
            let inertia = housing.moment_of_area(constant.value);
            let leaf = (inertia, housing.leaf_thickness(inertia));
            findings.extend(outcome::of_constant(&constant, leaf, housing.thickness));
            Some((constant, leaf))
        }
        _ => None,
    };
    let surface = spec.surface.as_ref().map(|axes| surface(spec, axes, &rungs, laws.as_ref())).transpose()?;
    Ok(Outcome { cases: cases.clone(), reference, constant, rungs, laws, surface, findings })
}

/// Conditions of the cases over which the model has a law though no two tests differ in them.
fn unvaried(spec: &ToleranceSpec, study: &Study) -> Vec<String> {
    let law = |name: &str| {
        study.system.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.condition == name) && i.params.iter().any(|p| p.free))
    };
    let varies = |name: &str| {
        let mut values = study.dataset.tests.iter().filter_map(|t| t.conditions.get(name)).map(|c| c.value);
        let first = values.next();
        values.any(|v| Some(v) != first)
    };
    spec.conditions.iter().map(|c| c.name.clone()).filter(|n| law(n) && !varies(n)).collect()
}

/// The law of the strengths that carry the model's loss, identified from the cases.
pub(in crate::cli) fn law(
    spec: &ToleranceSpec,
    answer: &Calibrated,
    rungs: &[Rung],
    reference: usize,
    seed: u64,
) -> Result<LawOutcome, Failure> {
    let (link, at_link) = predict::link(spec, answer)?;
    let base: Vec<f64> = match rungs.last().and_then(|r| r.cycles.first()) {
        Some(c) => c.predictions.iter().filter(|p| p.quantity == Quantity::Dissipated).map(|p| p.value / spec.scale).collect(),
        None => vec![],
    };
    let ask = LawQuestion {
        cases: &spec.tables[0].cases,
        reference,
        libraries: &spec.libraries,
        scale: spec.scale,
        others: &spec.scales,
        link: &link,
        base: &base,
        at_link,
        permutations: spec.permutations,
        seed,
    };
    Ok(through::answer(&ask)?)
}

fn surface(spec: &ToleranceSpec, axes: &[String; 2], rungs: &[Rung], laws: Option<&LawOutcome>) -> Result<Surface, Failure> {
    let cases = &spec.tables[0].cases;
    let of = |list: &[Prediction]| list.iter().filter(|p| p.quantity == Quantity::Dissipated).map(|p| p.value).collect::<Vec<f64>>();
    let mut known = vec![("table".to_string(), cases.energies())];
    known.extend(rungs.iter().filter_map(|r| Some((r.title.clone(), of(&r.cycles.first()?.predictions)))));
    if let Some(l) = laws {
        known.push(("law through the model".into(), of(&l.predictions)));
    }
    let axes = [axes[0].as_str(), axes[1].as_str()];
    Ok(Surface::of(cases, axes, &known, FINER)?)
}

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
