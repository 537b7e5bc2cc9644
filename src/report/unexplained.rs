//! What no effect explains: the missing force over displacement, velocity and phase, and the formula fitted to it.

use crate::diagnose::{Missed, Unexplained};

use super::ReportInput;
use super::chart::{Chart, Charts, GREY, INK, LAST, OTHERS, line, linear, points};
use super::text::{esc, percent};

/// Loops drawn at most, those with the largest missing force.
const LOOPS: usize = 4;

/// The section; empty where nothing is unexplained.
pub fn section(input: &ReportInput, charts: &mut Charts) -> String {
    let found = input.ladder.and_then(|l| l.unexplained.as_ref()).or(input.diagnosis.and_then(|d| d.unexplained.as_ref()));
    let Some(u) = found else { return String::new() };
    let measured = u.picture.iter().any(|m| !m.force.is_empty());
    let what = if measured {
        "Points: the force that was measured beyond the model, where the test drives this place itself. Line: the formula."
    } else {
        "No test drives this place itself; drawn is the formula over a cycle of the largest motion that the tests show there."
    };
    let mut out = format!(
        "<p>A force at {} would explain {} of what the fitted tests leave; the error falls from {} to {}. {what}</p>\n",
        esc(&u.at),
        percent(u.explains),
        percent(u.error_before),
        percent(u.error_after)
    );
    let loops = largest(u);
    type Along = fn(&Missed) -> &[f64];
    let axes: [(&str, Along); 3] =
        [("relative displacement [SI]", |m| &m.x), ("relative velocity [SI]", |m| &m.v), ("phase in the cycle [rad]", |m| &m.phase)];
    out += "<div class=\"figures\">\n";
    for (title, along) in axes {
        out += &charts.figure(
            picture(&loops, title, along),
            300,
            &format!("Missing force over {}", title.replace(" [SI]", "").replace(" [rad]", "")),
            "",
        );
    }
    out += "</div>\n";
    out += &format!(
        "<p>As an effect of the study (a suggestion fitted to these data, to be judged by someone who knows the joint):</p>\n<pre>{}</pre>\n",
        esc(&u.formula)
    );
    out
}

/// The loops with the largest missing force.
fn largest(u: &Unexplained) -> Vec<&Missed> {
    let size = |m: &Missed| m.force.iter().chain(&m.formula).fold(0.0f64, |s, f| s.max(f.abs()));
    let mut loops: Vec<&Missed> = u.picture.iter().collect();
    loops.sort_by(|a, b| size(b).total_cmp(&size(a)));
    loops.truncate(LOOPS);
    loops
}

fn picture(loops: &[&Missed], title: &str, along: fn(&Missed) -> &[f64]) -> Chart {
    let mut plot = Chart::new(&linear(title), &linear("force [SI]"));
    for (k, m) in loops.iter().enumerate() {
        let colour = [INK, GREY, OTHERS[0], OTHERS[1]][k % LOOPS];
        if !m.force.is_empty() {
            plot.add(points(along(m).to_vec(), m.force.clone(), &m.test, colour, 3));
        }
        plot.add(line(along(m).to_vec(), m.formula.clone(), "formula", LAST).set("showlegend", k == 0));
    }
    plot
}
