//! Tolerance cases: energies of the table and of every rung of the model as bars with intervals, over the two tolerances as cuts of the surface, case by
//! case in a table, and what was found.

use serde_json::json;

use crate::tolerance::{LawOutcome, Outcome, Prediction, Quantity, Surface};

use super::chart::{Chart, Charts, FIRST, GREY, INK, LAST, bars, dashed, line, linear, points, stage_colour};
use super::text::{esc, plain};

/// The section.
pub fn section(outcome: &Outcome, charts: &mut Charts) -> String {
    let findings: String = outcome.findings.iter().map(|f| format!("<li>{}</li>\n", esc(&f.claim))).collect();
    let mut html = format!("<ul>\n{findings}</ul>\n");
    html += &bars_of_cases(outcome, charts);
    html += &outcome.surface.as_ref().map(|s| cuts(s, outcome, charts)).unwrap_or_default();
    html + &outcome.laws.as_ref().map_or_else(|| tables(outcome), of_law)
}

fn picked(list: &[Prediction], quantity: Quantity) -> Vec<&Prediction> {
    list.iter().filter(|p| p.quantity == quantity).collect()
}

/// Bars of one quantity: the table's, every rung's, the last with its interval.
fn bars_of_cases(outcome: &Outcome, charts: &mut Charts) -> String {
    let mut html = String::new();
    if let Some(laws) = &outcome.laws {
        let (caption, last) = (
            "Energy of every case over that of the reference case: printed; the model under its own laws in the interference; the law of its strengths through the model, predicted without the case, with the 95 % interval of the fold.",
            "law, case left out",
        );
        let own = outcome.rungs.last().and_then(|r| r.cycles.first()).map(|c| picked(&c.predictions, Quantity::Ratio)).unwrap_or_default();
        let all = picked(&laws.predictions, Quantity::Ratio);
        let mut plot = Chart::new(&linear("case"), &linear("W_D over the reference case"));
        let names = |l: &[&Prediction]| l.iter().map(|p| format!("case {}", p.case)).collect::<Vec<_>>();
        plot.add(bars(names(&all), all.iter().filter_map(|p| p.reference).collect(), "printed", INK));
        plot.add(bars(names(&own), own.iter().map(|p| p.value).collect(), "eqs. 7 and 8 alone", FIRST));
        let left: Vec<f64> = all.iter().map(|p| p.left_out.unwrap_or(f64::NAN)).collect();
        plot.add(with_intervals(bars(names(&all), left.clone(), last, LAST), &left, &all, 1.0));
        html += &charts.figure(plot, 380, caption, "wide");
        return html;
    }
    let Some(last) = outcome.rungs.last() else { return html };
    for (k, cycle) in last.cycles.iter().enumerate() {
        for (quantity, word) in
            [(Quantity::Dissipated, "Dissipated energy W<sub>D</sub>"), (Quantity::Stored, "Equivalent elastic energy W<sub>s</sub>")]
        {
            let all = picked(&cycle.predictions, quantity);
            // The stored energies hardly differ: one figure of them says nothing that the table does not.
            if all.is_empty() || (quantity == Quantity::Stored && k > 0) {
                continue;
            }
            let mut plot = Chart::new(&linear("case"), &linear(&format!("{} [mJ]", quantity.word())));
            let names: Vec<String> = all.iter().map(|p| format!("case {}", p.case)).collect();
            plot.add(bars(names.clone(), all.iter().map(|p| p.reference.unwrap_or(f64::NAN) * 1e3).collect(), "table, held out", INK));
            for (n, rung) in outcome.rungs.iter().enumerate() {
                let Some(c) = rung.cycles.get(k) else { continue };
                let of = picked(&c.predictions, quantity);
                let heights: Vec<f64> = of.iter().map(|p| p.value * 1e3).collect();
                let trace = bars(names.clone(), heights.clone(), &rung.title, stage_colour(n, outcome.rungs.len()));
                plot.add(with_intervals(trace, &heights, &of, 1e3));
            }
            let caption = format!(
                "{word} of the tolerance cases, {}: {}; bars with their 95 % intervals. Nothing was fitted to the table.",
                esc(&cycle.test),
                esc(&cycle.words)
            );
            html += &charts.figure(plot, 380, &caption, "wide");
        }
    }
    html
}

/// A trace of bars with 95 % intervals.
fn with_intervals(trace: super::chart::Attributes, heights: &[f64], all: &[&Prediction], factor: f64) -> super::chart::Attributes {
    let up: Vec<f64> = all.iter().zip(heights).map(|(p, h)| p.interval.map_or(0.0, |i| i.1 * factor - h)).collect();
    let down: Vec<f64> = all.iter().zip(heights).map(|(p, h)| p.interval.map_or(0.0, |i| h - i.0 * factor)).collect();
    trace.set(
        "error_y",
        json!({ "type": "data", "symmetric": false, "array": up, "arrayminus": down, "color": GREY, "thickness": 1.5, "width": 4 }),
    )
}

/// The surface in cuts: energy over the second tolerance, one colour for each level of the first at which cases lie.
fn cuts(s: &Surface, outcome: &Outcome, charts: &mut Charts) -> String {
    let (mm, mj) = (1e3, 1e3);
    let title = format!("{} [mm]", s.axes[1]);
    let mut plot = Chart::new(&linear(&title), &linear("W_D [mJ]"));
    // Cases lie at every `step`-th row and column of the surface.
    let levels = (outcome.cases.cases.len() as f64).sqrt().round().max(2.0) as usize;
    let step = ((s.shape[0] - 1) / (levels - 1)).max(1);
    let rows: Vec<usize> = (0..s.shape[0]).step_by(step).collect();
    let last = s.layers.len() - 1;
    for (k, row) in rows.iter().enumerate() {
        let cut = row * s.shape[1]..(row + 1) * s.shape[1];
        let x: Vec<f64> = s.points[cut.clone()].iter().map(|p| p[1] * mm).collect();
        let name = format!("{} {} mm", s.axes[0], plain(s.points[cut.start][0] * mm, 3));
        let colour = stage_colour(k, rows.len());
        for (n, layer) in s.layers.iter().enumerate() {
            let y: Vec<f64> = layer.energy[cut.clone()].iter().map(|w| w * mj).collect();
            let label = format!("{}, {name}", layer.name);
            if n == 0 {
                let at = |v: &[f64]| v.iter().copied().step_by(step).collect::<Vec<f64>>();
                plot.add(points(at(&x), at(&y), &label, colour, 9));
            } else if n == last {
                plot.add(line(x.clone(), y, &label, colour));
            } else {
                plot.add(dashed(x.clone(), y, &label));
            }
        }
    }
    let caption = "The surface of the dissipated energy over the two tolerances in cuts: points the table, lines the answer, dashed the model before it.";
    charts.figure(plot, 440, caption, "wide")
}

/// Every number of every rung.
fn tables(outcome: &Outcome) -> String {
    let mut html = String::new();
    let Some(last) = outcome.rungs.last() else { return html };
    for (k, cycle) in last.cycles.iter().enumerate() {
        let head: String = outcome
            .rungs
            .iter()
            .enumerate()
            .map(|(n, _)| format!("<th>{}</th><th>error</th>", if n + 1 == outcome.rungs.len() { "answer" } else { "before" }))
            .collect();
        let rows: String = cycle
            .predictions
            .iter()
            .enumerate()
            .map(|(row, p)| {
                let factor = if p.quantity == Quantity::Ratio { 1.0 } else { 1e3 };
                let cells: String = outcome
                    .rungs
                    .iter()
                    .filter_map(|r| r.cycles.get(k)?.predictions.get(row))
                    .map(|p| {
                        format!(
                            "<td>{:.3}</td><td>{}</td>",
                            p.value * factor,
                            p.relative_error().map_or("-".into(), |e| format!("{:+.1} %", 100.0 * e))
                        )
                    })
                    .collect();
                let interval = p.interval.map_or("-".into(), |(a, b)| format!("{:.3} to {:.3}", a * factor, b * factor));
                let table = p.reference.map_or("-".into(), |r| format!("{:.3}", r * factor));
                let note = p.outside.as_deref().map(esc).unwrap_or_default();
                format!(
                    "<tr><td>{}</td><td>{}</td><td>{table}</td>{cells}<td>{interval}</td><td>{note}</td></tr>\n",
                    esc(&p.case),
                    p.quantity.word()
                )
            })
            .collect();
        html += &format!(
            "<h3>{}: {}</h3>\n<table><thead><tr><th>case</th><th>[mJ, -]</th><th>table</th>{head}<th>95 %</th><th></th></tr></thead><tbody>\n{rows}</tbody></table>\n",
            esc(&cycle.test),
            esc(&cycle.words)
        );
    }
    html
}

/// The cases by the law, and the libraries.
fn of_law(laws: &LawOutcome) -> String {
    let rows: String = picked(&laws.predictions, Quantity::Ratio)
        .iter()
        .zip(picked(&laws.predictions, Quantity::Dissipated))
        .map(|(p, w)| {
            let (low, high) = p.interval.unwrap_or((f64::NAN, f64::NAN));
            format!(
                "<tr><td>{}</td><td>{:.3}</td><td>{:.3}</td><td>{low:.3} to {high:.3}</td><td>{:.3}</td><td>{:.1}</td><td>{:.1}</td></tr>\n",
                esc(&p.case),
                p.reference.unwrap_or(f64::NAN),
                p.left_out.unwrap_or(f64::NAN),
                p.value,
                w.value * 1e3,
                w.reference.unwrap_or(f64::NAN) * 1e3
            )
        })
        .collect();
    let compared: String = laws
        .compared
        .iter()
        .map(|c| {
            format!(
                "<tr><td>{}</td><td>{}</td><td>{:.1} %</td><td>{:.1} %</td><td>{:.1} %</td></tr>\n",
                esc(&c.library),
                c.laws,
                100.0 * c.through,
                100.0 * c.regression,
                100.0 * c.p_value
            )
        })
        .collect();
    format!(
        "<table><thead><tr><th>case</th><th>printed ratio</th><th>left out</th><th>95 % of the fold</th><th>law on all cases</th><th>with the scale {:.3} [mJ]</th>\
         <th>printed [mJ]</th></tr></thead><tbody>\n{rows}</tbody></table>\n<table><thead><tr><th>library, searched inside every fold</th><th>laws</th>\
         <th>left out, through the model</th><th>without a model</th><th>permuted as well</th></tr></thead><tbody>\n{compared}</tbody></table>\n",
        laws.scale
    )
}
