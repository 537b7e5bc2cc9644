//! The tolerance cases in words and tables.

use crate::study::ToleranceSpec;
use crate::tolerance::{LawOutcome, Outcome, Prediction, Quantity, Rung, energies};
use crate::units::Unit;

use super::super::table::{percent, significant, table};

/// The tables for people: first what can be predicted, then the cases, then how it was found.
pub(super) fn text(outcome: &Outcome, spec: &ToleranceSpec) -> String {
    let mut text = format!("Tolerance cases of {}\n\n", spec.file().display());
    if let Some(first) = outcome.findings.first() {
        text += &format!("{}.\n\n", first.claim);
    }
    let unit = &outcome.cases.energy_unit;
    match &outcome.laws {
        Some(laws) => text += &law(outcome, laws, unit),
        None => text += &rungs(&outcome.rungs, unit),
    }
    if let Some((c, _)) = &outcome.constant {
        let off: Vec<String> =
            c.largest.iter().map(|(name, off, case)| format!("{name} within {:.4} mm (case {case})", off * 1e3)).collect();
        text += &format!("\nOne constant, interference times area = {:.4} mm3: {}.\n", c.value * 1e9, off.join(", "));
    }
    outcome.findings.iter().skip(1).fold(text + "\n", |t, f| t + &format!("finding: {}\n", f.claim))
}

fn interval(p: &Prediction, shown: &dyn Fn(f64) -> String) -> String {
    p.interval.map_or("-".into(), |(low, high)| format!("{} to {}", shown(low), shown(high)))
}

/// A table a cycle: the table's value, every rung's, the interval of the last.
fn rungs(all: &[Rung], unit: &Unit) -> String {
    let mut text = String::new();
    let Some(last) = all.last() else { return text };
    for (k, cycle) in last.cycles.iter().enumerate() {
        let mut header = vec!["case".to_string(), "quantity".into(), "table".into()];
        for (n, _) in all.iter().enumerate() {
            let name = if n + 1 == all.len() && n > 0 {
                "after"
            } else if n == 0 && all.len() > 1 {
                "before"
            } else {
                "model"
            };
            header.extend([name.to_string(), "error".into()]);
        }
        header.extend(["95 %".into(), String::new()]);
        let rows: Vec<Vec<String>> = cycle
            .predictions
            .iter()
            .enumerate()
            .map(|(row, p)| {
                let shown = |v: f64| significant(if p.quantity == Quantity::Ratio { v } else { unit.from_si(v) }, 4);
                let mut cells = vec![p.case.clone(), p.quantity.word().into(), p.reference.map_or("-".into(), &shown)];
                for r in all {
                    let of = r.cycles.get(k).and_then(|c| c.predictions.get(row));
                    cells.push(of.map_or("-".into(), |p| shown(p.value)));
                    cells.push(of.and_then(Prediction::relative_error).map_or("-".into(), percent));
                }
                cells.push(interval(p, &shown));
                cells.push(p.outside.clone().unwrap_or_default());
                cells
            })
            .collect();
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        text += &format!("{} ({}), energies in {}\n\n{}\n", cycle.test, cycle.words, unit.symbol, table(&header, &rows));
        text += &errors(all, k);
    }
    if let Some(e) = last.model_error {
        text += &format!(
            "Intervals: of the parameters, and of the model's own error on {} measured loops (loss ratio W_D/W_s off by {:.4}, W_s by {}).\n",
            e.tests,
            e.loss_ratio,
            percent(e.stored)
        );
    }
    text
}

/// Root mean square of the errors, quantity by quantity, rung by rung.
fn errors(all: &[Rung], k: usize) -> String {
    let of = |quantity: Quantity| -> Option<String> {
        let each: Option<Vec<String>> =
            all.iter().map(|r| Some(percent(energies::rms(&r.cycles.get(k)?.predictions, quantity)?))).collect();
        Some(format!("{} {}", quantity.word(), each?.join(" -> ")))
    };
    let list: Vec<String> = [Quantity::Ratio, Quantity::Dissipated, Quantity::Stored].into_iter().filter_map(of).collect();
    format!("Root mean square error: {}.\n\n", list.join(", "))
}

fn law(outcome: &Outcome, laws: &LawOutcome, unit: &Unit) -> String {
    let of = |quantity: Quantity| laws.predictions.iter().filter(move |p| p.quantity == quantity);
    let base = outcome.rungs.last().and_then(|r| r.cycles.first()).map(|c| c.predictions.as_slice()).unwrap_or_default();
    let own = |case: &str| base.iter().find(|p| p.quantity == Quantity::Ratio && p.case == case).map(|p| p.value);
    let rows: Vec<Vec<String>> = of(Quantity::Ratio)
        .zip(of(Quantity::Dissipated))
        .zip(&laws.strengths)
        .map(|((ratio, energy), u)| {
            let shown = |v: f64| significant(v, 4);
            let left = ratio.left_out.unwrap_or(f64::NAN);
            vec![
                ratio.case.clone(),
                ratio.reference.map_or("-".into(), shown),
                own(&ratio.case).map_or("-".into(), shown),
                shown(left),
                ratio.reference.map_or("-".into(), |r| percent(left / r - 1.0)),
                interval(ratio, &shown),
                shown(ratio.value),
                significant(u.exp(), 3),
                shown(unit.from_si(energy.value)),
                energy.reference.map_or("-".into(), |r| shown(unit.from_si(r))),
                ratio.outside.clone().unwrap_or_default(),
            ]
        })
        .collect();
    let printed = format!("table {}", unit.symbol);
    let scaled = format!("with the scale {}", unit.symbol);
    let header =
        ["case", "printed ratio", "eqs. 7, 8", "left out", "error", "95 % of the fold", "law on all", "strengths x", &scaled, &printed, ""];
    let mut text = table(&header, &rows);
    let compared: Vec<Vec<String>> = laws
        .compared
        .iter()
        .map(|c| vec![c.library.clone(), c.laws.to_string(), percent(c.through), percent(c.regression), percent(c.p_value)])
        .collect();
    let header =
        ["library of terms, searched inside every fold", "laws", "left out, through the model", "without a model", "permuted as well"];
    text += &format!("\n{}", table(&header, &compared));
    text += &format!("no law {}; eqs. 7 and 8 alone {}\n", percent(laws.no_law), percent(laws.own_laws));
    for (scale, error) in &laws.scales {
        text += &format!("at a scale of {scale} instead of {}: all libraries together {}\n", laws.scale, percent(*error));
    }
    text + &format!("Law taken on all cases: ln(strengths) = {}\n", equation(&laws.found.words, &laws.law().coefficients))
}

/// `b0 + b1 (term) + ...`; quantities are over their means.
fn equation(words: &str, coefficients: &[f64]) -> String {
    let mut text = significant(coefficients.first().copied().unwrap_or(0.0), 4);
    for (word, b) in words.split(" + ").zip(coefficients.iter().skip(1)) {
        text += &format!(" {} {} ({word})", if *b < 0.0 { "-" } else { "+" }, significant(b.abs(), 4));
    }
    text + ", each quantity over its mean"
}
