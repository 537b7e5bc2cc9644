//! Tolerance cases: energies printed, of the model and of the law, over the two tolerances, and what was found.

use crate::tolerance::Outcome;

use super::chart::{Chart, Charts, dashed, line, linear, points, stage_colour};
use super::text::{esc, plain};

/// The section.
pub fn section(outcome: &Outcome, charts: &mut Charts) -> String {
    let findings: String = outcome.findings.iter().map(|f| format!("<li>{}</li>\n", esc(&f.claim))).collect();
    let mut html = format!("<ul>\n{findings}</ul>\n");
    html += &surface(outcome, charts);
    html + &table(outcome)
}

/// The surface in cuts: energy over the second tolerance, one colour for each level of the first at which cases lie.
fn surface(outcome: &Outcome, charts: &mut Charts) -> String {
    let s = &outcome.surface;
    let (mm, mj) = (1e3, 1e3);
    let title = format!("{} [mm]", s.axes[1]);
    let mut plot = Chart::new(&linear(&title), &linear("W_D [mJ]"));
    // Cases lie at every `step`-th row and column of the surface.
    let levels = (outcome.energies.cases.len() as f64).sqrt().round().max(2.0) as usize;
    let step = ((s.shape[0] - 1) / (levels - 1)).max(1);
    let rows: Vec<usize> = (0..s.shape[0]).step_by(step).collect();
    for (k, row) in rows.iter().enumerate() {
        let cut = &s.points[row * s.shape[1]..(row + 1) * s.shape[1]];
        let (x, name) = (cut.iter().map(|p| p[1] * mm).collect::<Vec<f64>>(), format!("{} {} mm", s.axes[0], plain(cut[0][0] * mm, 3)));
        let colour = stage_colour(k, rows.len());
        let at_cases: Vec<&[f64; 5]> = cut.iter().step_by(step).collect();
        let pick = |list: &[&[f64; 5]], j: usize, f: f64| list.iter().map(|p| p[j] * f).collect::<Vec<f64>>();
        plot.add(points(pick(&at_cases, 1, mm), pick(&at_cases, 2, mj), &format!("printed, {name}"), colour, 9));
        plot.add(line(x.clone(), cut.iter().map(|p| p[4] * mj).collect(), &format!("law, {name}"), colour));
        plot.add(dashed(x, cut.iter().map(|p| p[3] * mj).collect(), &format!("model, one scale, {name}")));
    }
    let caption = "Dissipated energy per cycle over the two tolerances: points printed, lines the law taken on all cases, dashed the model under its laws in the interference, with one scale.";
    charts.figure(plot, 420, caption, "wide")
}

fn table(outcome: &Outcome) -> String {
    let rows: String = outcome
        .energies
        .cases
        .iter()
        .map(|c| {
            format!(
                "<tr><td>{}</td><td>{:.3}</td><td>{:.3} to {:.3}</td><td>{:.3}</td><td>{:.1}</td><td>{:.1}</td></tr>\n",
                esc(&c.case),
                c.ratio,
                c.interval.0,
                c.interval.1,
                c.printed,
                c.scaled * 1e3,
                c.energy * 1e3
            )
        })
        .collect();
    format!(
        "<table><thead><tr><th>case</th><th>W<sub>D</sub> ratio, model</th><th>over the ends of i</th><th>printed</th>\
         <th>model with one scale [mJ]</th><th>printed [mJ]</th></tr></thead><tbody>\n{rows}</tbody></table>\n"
    )
}
