//! Sweeps: the displacement that a prediction computes while the frequency of a declared force rises.

use super::chart::{Chart, Charts, LAST, line, linear, pick, thin};
use super::text::{esc, plain};
use crate::predict::Sweep;

/// Points drawn at most.
const DRAWN: usize = 3_000;

/// The section.
pub fn section(sweeps: &[Sweep], charts: &mut Charts) -> String {
    sweeps.iter().map(|s| figure(s, charts)).collect()
}

fn figure(sweep: &Sweep, charts: &mut Charts) -> String {
    let drawn = thin(&sweep.displacement, DRAWN);
    let mut plot = Chart::new(&linear("time [s]"), &linear(&format!("{} [mm]", sweep.respond)));
    let mm: Vec<f64> = pick(&sweep.displacement, &drawn).iter().map(|x| 1e3 * x).collect();
    plot.add(line(pick(&sweep.time, &drawn), mm, "computed", LAST));
    let largest = (0..sweep.time.len()).max_by(|a, b| sweep.displacement[*a].abs().total_cmp(&sweep.displacement[*b].abs()));
    let at = largest.map_or(String::new(), |k| {
        format!(" Farthest out: {} mm at {} Hz.", plain(1e3 * sweep.displacement[k], 4), plain(sweep.frequency(sweep.time[k]), 3))
    });
    let mean = if sweep.force.0 == 0.0 { String::new() } else { format!("{} N and ", plain(sweep.force.0, 3)) };
    let caption = format!(
        "{}: {} under a force at {} of {mean}&plusmn; {} N whose frequency rises from {} to {} Hz. Illustrative: the force is declared in the study, not measured.{at}",
        esc(&sweep.case),
        esc(&sweep.respond),
        esc(&sweep.at),
        plain(sweep.force.1, 3),
        plain(sweep.frequencies.0, 3),
        plain(sweep.frequencies.1, 3)
    );
    charts.figure(plot, 360, &caption, "wide")
}
