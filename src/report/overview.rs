//! Every test in a table, and its error against the rungs by name.

use super::ReportInput;
use super::chart::{self, Chart, Charts};
use super::stage::{Stage, ids, over_floor, split_words, test};
use super::summary::{difference_words, rung_axis};
use super::text::{esc, label, percent, ratio, table};

/// Table and charts.
pub fn tests(input: &ReportInput, stages: &[Stage], charts: &mut Charts) -> String {
    let (Some(first), Some(last)) = (stages.first(), stages.last()) else { return String::new() };
    let several = stages.len() > 1;
    let rows: Vec<Vec<String>> = ids(stages)
        .iter()
        .enumerate()
        .filter_map(|(k, id)| {
            let now = test(last, id).or_else(|| stages.iter().rev().find_map(|s| test(s, id)))?;
            let then = test(first, id);
            let mut row = vec![
                format!("<a href=\"#test-{k}\">{}</a>", esc(id)),
                format!("<span class=\"nb\">{}, {}</span>", esc(&now.kind), split_words(now.split)),
                now.n.to_string(),
            ];
            if several {
                row.push(then.map_or("-".into(), |t| percent(t.error)));
            }
            row.extend([
                percent(now.error),
                percent(now.floor),
                ratio(over_floor(now.error, now.floor)),
                difference_words(now),
                esc(&now.worst.words()),
            ]);
            Some(row)
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let header: &[&str] = if several {
        &[
            "Test",
            "Kind and use",
            "Values",
            "Error as given",
            "Error now",
            "Noise floor",
            "Error / floor",
            "Largest / range",
            "Farthest point now",
        ]
    } else {
        &["Test", "Kind and use", "Values", "Error", "Noise floor", "Error / floor", "Largest / range", "Farthest point"]
    };
    let right: &[usize] = if several { &[2, 3, 4, 5, 6, 7] } else { &[2, 3, 4, 5, 6] };
    let reading = "<p class=\"soft\">Error: rms of measured less computed, over rms of measured about its mean (complex FRF: about zero). \
                   Noise floor: the same with the standard deviation of the noise in place of the difference. A perfect model \
                   stands at the floor. Largest / range: largest difference over the range of the measured, channel by channel (FRF: of the magnitude; \
                   tables: of the value); it grows with the noise and the number of points.</p>";
    let against = if several { error_over_floor(stages, charts) } else { String::new() };
    let frequency = against_frequency(input, stages, charts);
    let charts = if against.is_empty() && frequency.is_empty() {
        String::new()
    } else {
        format!("<div class=\"figures\">{against}{frequency}</div>")
    };
    format!("{reading}{}{charts}", table("", header, right, &rows))
}

const DASHES: [&str; 3] = ["solid", "dash", "dot"];

fn error_over_floor(stages: &[Stage], charts: &mut Charts) -> String {
    let mut plot = Chart::new(&chart::linear(""), &chart::ratios("error / noise floor")).with("xaxis", rung_axis(stages));
    let colours = [chart::LAST, chart::FIRST].into_iter().chain(chart::OTHERS).collect::<Vec<_>>();
    let ids = ids(stages);
    for (n, id) in ids.iter().enumerate() {
        let over = |(k, s): (usize, &Stage)| test(s, id).map(|t| (k as f64, over_floor(t.error, t.floor)));
        let (x, y): (Vec<f64>, Vec<f64>) = stages.iter().enumerate().filter_map(over).unzip();
        let colour = colours[n % colours.len()];
        let line = chart::stroke(colour, 1.8).set("dash", DASHES[(n / colours.len()) % DASHES.len()]);
        plot.add(chart::scatter(x, y, id, "lines+markers").set("line", line).set("marker", chart::marker(colour, 7, "circle")));
    }
    plot.add(chart::dashed(vec![0.0, (stages.len() - 1) as f64], vec![1.0, 1.0], "noise floor"));
    charts.figure(plot, 300 + 12 * ids.len().min(24), "Error over floor, test by test", "")
}

/// Error over floor of the tests that declare a drive frequency, against it.
fn against_frequency(input: &ReportInput, stages: &[Stage], charts: &mut Charts) -> String {
    let frequency = |id: &str| input.study.dataset.test(id)?.conditions.get("frequency").map(|c| c.value).filter(|f| *f > 0.0);
    let mut plot = Chart::new(&chart::frequencies("drive frequency [Hz]"), &chart::ratios("error / noise floor"));
    let n = stages.len();
    let mut most = 0;
    for (k, stage) in stages.iter().enumerate().filter(|(k, _)| *k == 0 || k + 1 == n) {
        let of = |t: &crate::diagnose::results::TestResult| Some((frequency(&t.id)?, over_floor(t.error, t.floor), label(&t.id)));
        let found: Vec<_> = stage.tests.iter().filter_map(of).collect();
        most = most.max(found.len());
        let (x, y) = found.iter().map(|f| (f.0, f.1)).unzip();
        let names: Vec<String> = found.into_iter().map(|f| f.2).collect();
        plot.add(chart::points(x, y, &stage.name, chart::stage_colour(k, n), 10).set("text", names));
    }
    if most < 2 {
        return String::new();
    }
    charts.figure(plot, 300, "Error over floor <span>against the frequency of the drive</span>", "")
}
