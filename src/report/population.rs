//! The page of `misfit tolerance`: distributions of the cases against the band and the table, contributions, tolerances before and after the synthesis.

use serde_json::json;

use crate::predict::population::{Distribution, Kept, Population};
use crate::study::Banded;

use super::chart::{Chart, Charts, GREY, INK, LAST, OTHERS, bars, dashed, line, linear, marker, ratios, scatter};
use super::page::{CONTENTS, Page, SCRIPT};
use super::text::esc;

/// Unit of a quantity as the page shows it: symbol and its SI value.
pub type Shown<'a> = &'a dyn Fn(Banded) -> (String, f64);

/// One self-contained HTML page; `first` is the answer in one sentence.
pub fn population(title: &str, first: &str, found: &Population, bands: &[crate::study::Band], shown: Shown) -> String {
    let mut charts = Charts::default();
    let mut page = Page::new(title);
    page.section(
        "",
        "",
        format!("<header>misfit tolerance</header>\n<h1>{}</h1>\n<p>{}</p>\n{SCRIPT}\n{CONTENTS}\n", esc(title), esc(first)),
    );
    let quantities = quantities(found.distributions.iter().map(|d| d.quantity));
    let figures: String = quantities.iter().map(|q| cases(found, *q, bands, shown, &mut charts)).collect();
    page.section("cases", "Distributions of the cases", format!("<div class=\"figures\">{figures}</div>\n"));
    page.section("contributions", "What the spread comes from", contributions(found, &mut charts));
    page.section("synthesis", "The loosest tolerances", synthesis(found, &mut charts));
    let notes: String = found.notes.iter().map(|n| format!("<li>{}</li>\n", esc(n))).collect();
    page.section("notes", "What to know of the numbers", format!("<ul>\n{notes}</ul>\n"));
    page.finish()
}

/// Every quantity once, in the order of their first appearance.
fn quantities(all: impl Iterator<Item = Banded>) -> Vec<Banded> {
    let mut once = Vec::new();
    all.for_each(|q| {
        if !once.contains(&q) {
            once.push(q);
        }
    });
    once
}

/// Mean and 95 % of every case, worst case, the table's value, the band.
fn cases(found: &Population, quantity: Banded, bands: &[crate::study::Band], shown: Shown, charts: &mut Charts) -> String {
    let all: Vec<&Distribution> = found.distributions.iter().filter(|d| d.quantity == quantity).collect();
    if all.is_empty() {
        return String::new();
    }
    let (symbol, factor) = shown(quantity);
    let names: Vec<String> = all.iter().map(|d| format!("case {}", d.case)).collect();
    let values = |of: &dyn Fn(&Distribution) -> f64| all.iter().map(|d| of(d) / factor).collect::<Vec<f64>>();
    let mut plot = Chart::new(&linear("case"), &linear(&format!("{} [{symbol}]", quantity.name())));
    let around = |low: &dyn Fn(&Distribution) -> f64, high: &dyn Fn(&Distribution) -> f64, colour: &str, thickness: f64| {
        let up = values(&|d| high(d) - d.mean);
        let down = values(&|d| d.mean - low(d));
        json!({ "type": "data", "symmetric": false, "array": up, "arrayminus": down, "color": colour, "thickness": thickness, "width": 4 })
    };
    let dots = |y: Vec<f64>, name: &str, colour: &str, symbol: &str| {
        scatter(names.clone(), y, name, "markers").set("marker", json!({ "color": colour, "size": 8, "symbol": symbol }))
    };
    plot.add(dots(values(&|d| d.mean), "worst case", GREY, "circle").set("error_y", around(&|d| d.worst.0, &|d| d.worst.1, GREY, 1.0)));
    plot.add(
        dots(values(&|d| d.mean), "mean and 95 %", LAST, "circle").set("error_y", around(&|d| d.interval.0, &|d| d.interval.1, LAST, 3.0)),
    );
    if all.iter().any(|d| d.printed.is_some()) {
        plot.add(dots(values(&|d| d.printed.unwrap_or(f64::NAN)), "table", INK, "diamond"));
    }
    for limit in bands.iter().filter(|b| b.quantity == quantity).flat_map(|b| [b.limits.0, b.limits.1]).filter(|l| l.is_finite()) {
        plot.add(dashed(vec![], vec![], "band").set("x", names.clone()).set("y", vec![limit / factor; names.len()]));
    }
    let caption =
        "Mean over the assemblies with 95 % of them (parameters and model error included), worst case, the table's value, and the band.";
    charts.figure(plot, 360, caption, "wide")
}

fn contributions(found: &Population, charts: &mut Charts) -> String {
    let mut plot = Chart::new(&linear("tolerance"), &linear("part of the variance [%]"));
    // W_s is left out: its parts are those of the stiffness.
    let drawn = quantities(found.shares.iter().map(|s| s.quantity).filter(|q| *q != Banded::Stored));
    for (quantity, colour) in drawn.into_iter().zip([LAST, GREY].into_iter().chain(OTHERS).cycle()) {
        let all: Vec<_> = found.shares.iter().filter(|s| s.quantity == quantity).collect();
        let errors: Vec<f64> = all.iter().map(|s| 100.0 * s.contribution.total_error).collect();
        let heights = all.iter().map(|s| 100.0 * s.contribution.total).collect();
        let trace = bars(all.iter().map(|s| s.tolerance.clone()).collect(), heights, &quantity.name(), colour);
        plot.add(trace.set("error_y", json!({ "type": "data", "array": errors, "color": INK, "thickness": 1.0 })));
    }
    let caption = format!("Total Sobol index of every tolerance in case {}, with its 95 % interval.", found.share_case);
    charts.figure(plot, 320, &caption, "wide")
}

fn synthesis(found: &Population, charts: &mut Charts) -> String {
    let Some(kept) = &found.kept else { return String::new() };
    let mut plot = Chart::new(&linear("tolerance"), &linear("width [mm]"));
    let names: Vec<String> = kept.widths.iter().map(|w| w.name.clone()).collect();
    plot.add(bars(names.clone(), kept.widths.iter().map(|w| 1e3 * w.before).collect(), &format!("case {}", kept.case), GREY));
    plot.add(bars(names, kept.widths.iter().map(|w| 1e3 * w.width).collect(), "synthesis", LAST));
    let said = match &kept.in_the_way {
        Some(why) => format!("Infeasible: {why}."),
        None => format!(
            "Yield {:.2} % asked, {:.3} % reached on draws of their own ({:.3} to {:.3} %), {:.2} % before; cost {:.4} before, {:.4} after.",
            100.0 * kept.asked,
            100.0 * kept.reached.0,
            100.0 * kept.reached.1.0,
            100.0 * kept.reached.1.1,
            100.0 * kept.before,
            kept.cost.0,
            kept.cost.1
        ),
    };
    let widths = charts.figure(plot, 320, "Widths of the tolerances before and after.", "wide");
    format!("<p>{}</p>\n{widths}{}", esc(&said), prices(kept, charts))
}

/// Cost over the part of the assemblies that miss a band, with the case as it stands and the answer.
fn prices(kept: &Kept, charts: &mut Charts) -> String {
    if kept.curve.is_empty() {
        return String::new();
    }
    let missed = |reached: f64| 100.0 * (1.0 - reached);
    let mut plot = Chart::new(&ratios("assemblies outside a band [%]"), &linear("cost, sum of c / width"));
    let (x, y) = kept.curve.iter().map(|p| (missed(p.asked), p.cost)).unzip();
    plot.add(line(x, y, "least cost of a yield", LAST));
    let mut point = |x: f64, y: f64, name: &str, colour: &str| {
        // Where none is outside there is no place on a logarithmic axis.
        if x > 0.0 {
            plot.add(scatter(vec![x], vec![y], name, "markers").set("marker", marker(colour, 10, "diamond")));
        }
    };
    point(missed(kept.before), kept.cost.0, &format!("case {}", kept.case), GREY);
    if kept.in_the_way.is_none() {
        point(missed(kept.reached.0), kept.cost.1, "synthesis", INK);
    }
    let caption = "Cost against yield: the least cost of tolerances that leave this part of the assemblies outside a band, the case as it stands, and the answer.";
    charts.figure(plot, 320, caption, "wide")
}
