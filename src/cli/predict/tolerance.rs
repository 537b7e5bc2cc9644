//! `[tolerance]`: the energies of the cases from the calibrated model, and what the tolerance stage makes of them.

use crate::parallel;
use nalgebra::DMatrix;
use polars::prelude::Column;
use serde_json::{Value, json};

use crate::data::{Condition, StoredEnergy};
use crate::model::{FreeParam, System};
use crate::study::run::RunFolder;
use crate::study::{CycleQuantity, Predicted, PredictionSpec, Study, ToleranceSpec};
use crate::tolerance::{Outcome, Predicted as Energy, Question, Surface, answer};
use crate::units::{Dimension, Unit};

use super::super::failure::Failure;
use super::super::table::{percent, significant, table};
use super::value;

/// Computes the energies of every case at both ends and the middle of its interferences, and answers the rest.
pub(super) fn outcome(
    study: &Study,
    spec: &ToleranceSpec,
    system: &System,
    free: &[FreeParam],
    covariance: &DMatrix<f64>,
    p: &[f64],
    seed: u64,
) -> Result<Outcome, Failure> {
    let ends = |k: usize| {
        let of = spec.pairs.iter().filter_map(|pair| spec.cases.cases[k].values.get(&pair.interference));
        of.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), i| (l.min(*i), h.max(*i)))
    };
    let tested: Vec<f64> = study.dataset.tests.iter().filter_map(|t| t.conditions.get(&spec.condition)).map(|c| c.value).collect();
    let known = tested.iter().fold(spec.range, |(l, h), i| (l.min(*i), h.max(*i)));
    let one = |k: usize| -> Result<Energy, Failure> {
        let (low, high) = ends(k);
        let [a, m, b] = [low, 0.5 * (low + high), high].map(|i| value::evaluate(&at(spec, i), study, system, free));
        let (a, m, b) = (a?, m?, b?);
        let slopes = m.slopes.iter().map(|s| s / m.value).collect();
        Ok(Energy { middle: m.value, ends: (a.value, b.value), slopes, extrapolated: low < known.0 || high > known.1 })
    };
    let predicted = parallel::over(spec.cases.cases.len(), one).into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut product = at(spec, spec.range.0.max(ends(spec.reference).0));
    if let Predicted::Cycle { quantity, .. } = &mut product.quantity {
        *quantity = CycleQuantity::Stored(StoredEnergy::Product);
    }
    let enclosing = 2.0 * value::evaluate(&product, study, system, free)?.value;
    let question = Question {
        cases: &spec.cases,
        reference: spec.reference,
        pairs: &spec.pairs,
        housing: &spec.housing,
        quantities: &spec.quantities,
        terms: spec.terms,
        permutations: spec.permutations,
        surface: &spec.surface,
        seed,
        predicted: &predicted,
        enclosing,
    };
    let deviation = |number: f64, slopes: &[f64]| value::deviation(&value::Found { value: number, slopes: slopes.to_vec() }, covariance, p);
    Ok(answer(&question, deviation)?)
}

/// The cycle at one interference.
fn at(spec: &ToleranceSpec, interference: f64) -> PredictionSpec {
    let condition = |value: f64, dimension: Dimension| Condition { value, unit: Unit::si(dimension), sigma: None, line: spec.line };
    let mut cycle = spec.cycle.clone();
    cycle.conditions.insert(spec.condition.clone(), condition(interference, Dimension::LENGTH));
    if let Predicted::Cycle { frequency, .. } = &cycle.quantity {
        cycle.conditions.insert("frequency".into(), condition(*frequency, Dimension::FREQUENCY));
    }
    cycle
}

/// The cases as predictions of contract.md: ratios, then energies with the one scale.
pub(super) fn predictions(outcome: &Outcome) -> Vec<Value> {
    let ratio = outcome.energies.cases.iter().map(|c| {
        json!({
            "case": c.case, "quantity": "W_D_ratio", "unit": "-", "value": c.ratio, "std": c.std, "interval": c.interval,
            "reference": c.printed, "relative_error": c.ratio / c.printed - 1.0, "extrapolated": c.extrapolated,
        })
    });
    let scaled = outcome.energies.cases.iter().map(|c| {
        json!({
            "case": c.case, "quantity": "W_D", "unit": "J", "value": c.scaled, "std": null, "reference": c.energy,
            "relative_error": c.scaled / c.energy - 1.0, "scale": outcome.energies.scale, "extrapolated": c.extrapolated,
        })
    });
    ratio.chain(scaled).collect()
}

/// Everything else as JSON, SI.
pub(super) fn json(outcome: &Outcome) -> Value {
    let c = &outcome.constant;
    let searches: Vec<Value> = outcome
        .searches
        .iter()
        .map(|s| {
            json!({
                "terms": s.terms, "laws": s.laws, "left_out_rms": s.relative, "left_out_factor": s.factor, "no_law_rms": s.no_law,
                "errors": s.errors.iter().map(|e| e.exp_m1()).collect::<Vec<f64>>(), "chosen": s.chosen,
                "permutations": s.permutations, "p_value": s.p_value, "verdict": verdict(s.verdict),
                "law": s.words, "coefficients": s.law.coefficients,
            })
        })
        .collect();
    let findings: Vec<Value> =
        outcome.findings.iter().map(|f| json!({ "claim": f.claim, "number": f.number, "threshold": f.threshold })).collect();
    let largest: Vec<Value> =
        c.largest.iter().map(|(name, off, case)| json!({ "interference": name, "largest": off, "case": case })).collect();
    let allowed: Vec<Value> = c.allowed.iter().map(|(name, l, h)| json!({ "interference": name, "low": l, "high": h })).collect();
    json!({
        "constant": { "value": c.value, "unit": "m3", "holds": c.holds(), "largest": largest, "allowed": allowed },
        "leaf": { "moment_of_area": outcome.leaf.0, "thickness": outcome.leaf.1 },
        "scale": outcome.energies.scale, "error": outcome.energies.error,
        "span": outcome.energies.span.0, "span_with_ends": outcome.energies.span.1, "printed_span": outcome.energies.printed_span,
        "searches": searches, "findings": findings,
    })
}

fn verdict(verdict: crate::tolerance::Verdict) -> &'static str {
    use crate::tolerance::Verdict;
    match verdict {
        Verdict::CannotTell => "cannot_tell",
        Verdict::SomeLaw => "some_law",
        Verdict::Law => "law",
    }
}

/// The tables for people.
pub(super) fn text(outcome: &Outcome, spec: &ToleranceSpec) -> String {
    let c = &outcome.constant;
    let mut text = format!("Tolerance cases of {}\n\n", spec.file().display());
    let off: Vec<String> = c.largest.iter().map(|(name, off, case)| format!("{name} within {:.4} mm (case {case})", off * 1e3)).collect();
    text += &format!("One constant, interference times area = {:.4} mm3: {}.\n\n", c.value * 1e9, off.join(", "));
    let unit = &spec.cases.energy_unit;
    let rows: Vec<Vec<String>> = outcome
        .energies
        .cases
        .iter()
        .zip(outcome.searches.last().map_or(&[][..], |s| &s.errors))
        .map(|(p, left)| {
            vec![
                p.case.clone(),
                significant(p.ratio, 4),
                p.std.map_or("-".into(), |s| significant(s, 2)),
                format!("{} to {}", significant(p.interval.0, 3), significant(p.interval.1, 3)),
                significant(p.printed, 4),
                percent(p.ratio / p.printed - 1.0),
                significant(unit.from_si(p.scaled), 4),
                significant(unit.from_si(p.energy), 4),
                percent(left.exp_m1()),
                if p.extrapolated { "extrapolated".into() } else { String::new() },
            ]
        })
        .collect();
    let header = ["case", "W_D ratio", "std", "ends of i", "printed", "error", "scaled", &unit.symbol, "law, left out", ""];
    text += &table(&header, &rows);
    text += &format!(
        "\nOne scale of {} on the model's energies; {} off.\n",
        significant(outcome.energies.scale, 4),
        percent(outcome.energies.error)
    );
    if let Some(s) = outcome.searches.last() {
        text += &format!("Law taken on all cases: ln W = {}\n", equation(&s.words, &s.law.coefficients));
    }
    outcome.findings.iter().fold(text, |t, f| t + &format!("finding: {}\n", f.claim))
}

/// `b0 + b1 (term) + ...`; quantities are over their means.
fn equation(words: &str, coefficients: &[f64]) -> String {
    let mut text = significant(coefficients.first().copied().unwrap_or(0.0), 4);
    for (word, b) in words.split(" + ").zip(coefficients.iter().skip(1)) {
        text += &format!(" {} {} ({word})", if *b < 0.0 { "-" } else { "+" }, significant(b.abs(), 4));
    }
    text + ", each quantity over its mean"
}

/// `surface.parquet`: the two tolerances [m] and the energies [J].
pub(super) fn write_surface(surface: &Surface, folder: &RunFolder) -> Result<(), Failure> {
    let column = |name: &str, k: usize| Column::new(name.into(), surface.points.iter().map(|p| p[k]).collect::<Vec<f64>>());
    let columns = vec![
        column(&surface.axes[0], 0),
        column(&surface.axes[1], 1),
        column("W_D_printed", 2),
        column("W_D_model_scaled", 3),
        column("W_D_law", 4),
    ];
    super::write_columns("surface.parquet", columns, folder)
}
