//! Test by test: loops, FRFs, records and tables of every stage over the measurement, and the whitened residuals.

use crate::data::{Condition, Record};
use crate::diagnose::results::{Curve, Factor};
use crate::response::BlockKind;
use crate::study::Study;

use super::ReportInput;
use super::chart::{self, Along, Chart, Charts, decades, frequencies, line, linear, pick, points, shown, stage_colour, thin};
use super::stage::{Stage, ids, over_floor, split_words, test};
use super::summary::difference_words;
use super::text::{digits, esc, percent, plain, ratio, table};

/// Points per trace at most.
const POINTS: usize = 800;
/// Points per trace at least; where even these are too many, the tests that fit best are not drawn.
const FEWEST: usize = 60;
/// Points on the page: some 20 bytes each, beside the 1.1 MB of the script.
const BUDGET: usize = 130_000;
/// Rows of a table shown.
const ROWS: usize = 60;
/// Tests of each kind unfolded from the start.
const OPEN: usize = 4;

/// Every test with its curves.
pub fn section(input: &ReportInput, stages: &[Stage], charts: &mut Charts) -> String {
    let ids = ids(stages);
    let count = |id: &str| stages.iter().find_map(|s| test(s, id)).map_or(0, |t| t.curves.len());
    // Traces of one curve: measured, band and every stage, twice for an FRF, and residuals.
    let weight = 10 + 2 * stages.len();
    let (drawn, curves) = drawn(stages, &ids, count, BUDGET / (FEWEST * weight));
    let limit = (BUDGET / (weight * curves.max(1))).clamp(FEWEST, POINTS);
    let mut out = String::new();
    if curves > 0 {
        out += "<p class=\"soft\">Measured dark, its noise of two standard deviations as a grey band, computed in colour. Click a name to show or hide it; drag to zoom, \
                double click to go back. \
                Whitened residual: measured less computed, over the standard deviation of the noise; in a model that fits, 95 % lie \
                within ±2.</p>\n";
    }
    if drawn.iter().any(|d| !d) {
        let n = drawn.iter().filter(|d| !**d).count();
        out += &format!("<p>To keep the page small, the curves of the {n} tests that fit best are not drawn.</p>\n");
    }
    let mut shown: std::collections::HashMap<&str, usize> = std::collections::HashMap::new();
    for (k, id) in ids.iter().enumerate() {
        let kind = stages.iter().find_map(|s| test(s, id)).map_or("", |t| t.kind.as_str());
        let count = shown.entry(kind).or_insert(0);
        *count += 1;
        let open = if *count <= OPEN { " open" } else { "" };
        let figures = if drawn[k] { figures(input, stages, id, limit, charts) } else { String::new() };
        out += &format!(
            "<details id=\"test-{k}\"{open}><summary>{} <span class=\"soft\">{}</span></summary>\n{}{}{figures}</details>\n",
            esc(id),
            about(input, stages, id),
            description(input, id),
            errors(stages, id)
        );
    }
    out
}

/// Which tests are drawn, the worst first until `most` curves, and the number of curves.
fn drawn(stages: &[Stage], ids: &[&str], count: impl Fn(&str) -> usize, most: usize) -> (Vec<bool>, usize) {
    let badness = |id: &str| {
        let over = stages.iter().filter_map(|s| test(s, id)).map(|t| over_floor(t.error, t.floor));
        over.filter(|r| !r.is_nan()).fold(0.0, f64::max)
    };
    let mut order: Vec<usize> = (0..ids.len()).collect();
    order.sort_by(|a, b| badness(ids[*b]).total_cmp(&badness(ids[*a])));
    let (mut drawn, mut curves) = (vec![false; ids.len()], 0);
    for k in order {
        let more = count(ids[k]);
        if curves + more <= most {
            drawn[k] = true;
            curves += more;
        }
    }
    (drawn, curves)
}

/// Kind, split and conditions.
fn about(input: &ReportInput, stages: &[Stage], id: &str) -> String {
    let Some(t) = stages.iter().find_map(|s| test(s, id)) else { return String::new() };
    let print = |(name, c): (&String, &Condition)| {
        format!("{} {}", esc(name), format!("{} {}", plain(c.unit.from_si(c.value), 4), esc(&c.unit.symbol)).trim_end())
    };
    let conditions = input.study.dataset.test(id).map(|t| t.conditions.iter().map(print).collect::<Vec<_>>());
    let parts = [vec![esc(&t.kind), split_words(t.split).into()], conditions.unwrap_or_default()];
    parts.concat().join(", ")
}

/// What the dataset says of a test, and what was found in its record.
fn description(input: &ReportInput, id: &str) -> String {
    let test = input.study.dataset.test(id);
    let text = test.and_then(|t| t.description.as_deref()).map(|t| format!("<p>{}</p>", esc(t))).unwrap_or_default();
    let found = test.map_or(vec![], |t| match &t.record {
        Record::Cycle(r) => r.findings().unwrap_or_default(),
        Record::Frf(f) => f.notes.clone(),
        _ => vec![],
    });
    let items: String = found.iter().map(|n| format!("<li>{}: {}</li>", esc(&n.about), esc(&n.text))).collect();
    if items.is_empty() { text } else { format!("{text}<p><b>Found in the record</b></p><ul>{items}</ul>") }
}

/// Errors of one test on every stage.
fn errors(stages: &[Stage], id: &str) -> String {
    let row = |s: &Stage| {
        let t = test(s, id)?;
        let over = ratio(over_floor(t.error, t.floor));
        let (rms, largest) = (digits(t.whitened_rms, 3), difference_words(t));
        Some(vec![esc(&s.name), percent(t.error), percent(t.floor), over, largest, rms, esc(&t.worst.words())])
    };
    let rows: Vec<Vec<String>> = stages.iter().filter_map(row).collect();
    let errors = table(
        "",
        &["Model", "Error", "Noise floor", "Error / floor", "Largest / range", "Whitened rms", "Farthest point"],
        &[1, 2, 3, 4, 5],
        &rows,
    );
    let factor = |s: &Stage| -> Vec<Vec<String>> {
        let factors = test(s, id).map_or(&[][..], |t| &t.factors);
        let best = |f: &Factor| match &f.strength {
            Some(one) => format!("{}, over {}", digits(one.best, 4), esc(&one.parameter)),
            None => "-".into(),
        };
        factors.iter().map(|f| vec![esc(&s.name), esc(&f.channel), digits(f.largest, 4), best(f)]).collect()
    };
    let damping = |s: &Stage| Some(format!("<p>{}, {}.</p>", esc(&s.name), esc(&test(s, id)?.constant_damping.as_ref()?.words())));
    let damping: String = stages.iter().filter_map(damping).collect();
    let factors: Vec<Vec<String>> = stages.iter().flat_map(factor).collect();
    if factors.is_empty() {
        return errors + &damping;
    }
    let header = ["Model", "Energy", "Largest factor", "Least that its one strength can reach"];
    errors + &table("", &header, &[2], &factors)
}

/// A curve of one channel on the stages where it was computed.
struct Series<'a> {
    on: Vec<(usize, &'a str, &'a Curve)>,
    stages: usize,
    limit: usize,
    /// What the loop is drawn over.
    driven: &'static str,
}

impl<'a> Series<'a> {
    fn any(&self) -> &'a Curve {
        self.on[0].2
    }
    /// The stages whose residuals are drawn: first and last.
    fn ends(&self) -> Vec<&(usize, &'a str, &'a Curve)> {
        let mut ends = vec![&self.on[0]];
        ends.extend(self.on.last().filter(|_| self.on.len() > 1));
        ends
    }
}

fn figures(input: &ReportInput, stages: &[Stage], id: &str, limit: usize, charts: &mut Charts) -> String {
    let Some(labels) = stages.iter().find_map(|s| test(s, id)).map(|t| &t.curves) else { return String::new() };
    let mut out = String::new();
    for wanted in labels {
        let on = |(k, s): (usize, &'_ Stage<'_>)| -> Option<(usize, String)> { test(s, id).map(|_| (k, s.name.clone())) };
        let named: Vec<(usize, String)> = stages.iter().enumerate().filter_map(on).collect();
        let found = named.iter().filter_map(|(k, name)| {
            let curve =
                test(&stages[*k], id)?.curves.iter().find(|c| c.label == wanted.label && c.measured.len() == wanted.measured.len())?;
            Some((*k, name.as_str(), curve))
        });
        let series = Series { on: found.collect(), stages: stages.len(), limit, driven: driven(input.study, id) };
        if series.on.is_empty() || wanted.measured.is_empty() {
            continue;
        }
        let print = Units::of(input.study, id, wanted);
        out += &match wanted.kind {
            BlockKind::Loop => loops(&series, &print, charts),
            BlockKind::Frf => frf(&series, &print, charts),
            BlockKind::Record => record(&series, &print, charts),
            BlockKind::Table => rows(&series, &print, charts),
        };
    }
    out
}

/// Units of a curve as the data were written: symbol and SI units in one.
pub struct Units {
    /// Of the drive.
    pub x: (String, f64),
    /// Of the curve.
    pub y: (String, f64),
    /// What the rows of a table lie over: its name, symbol and SI units in one.
    pub over: (&'static str, String, f64),
}

impl Units {
    /// Those of a channel of a test.
    pub fn of(study: &Study, id: &str, curve: &Curve) -> Units {
        let si = (curve.unit.clone(), 1.0);
        let pair = |u: &crate::units::Unit| (u.symbol.clone(), u.difference_to_si(1.0));
        let record = study.dataset.test(id).map(|t| &t.record);
        let over = match record {
            Some(Record::Backbone(b)) => b.rows.first().map(|r| ("amplitude", r.unit.symbol.clone(), r.unit.difference_to_si(1.0))),
            _ => None,
        };
        let (x, y) = match record {
            Some(Record::Cycle(r) | Record::Transient(r)) => {
                let channel = r.channels.iter().find(|c| c.label() == curve.label);
                (r.controlled().map(|c| pair(&c.unit)), channel.map(|c| pair(&c.unit)))
            }
            Some(Record::Frf(f)) => (None, Some(pair(&f.unit))),
            _ => (None, None),
        };
        let usable = |u: &(String, f64)| u.1 > 0.0 && u.1.is_finite();
        Units {
            x: x.filter(usable).unwrap_or(("SI".into(), 1.0)),
            y: y.filter(usable).unwrap_or(si),
            over: over.unwrap_or(("frequency", "Hz".into(), 1.0)),
        }
    }
}

/// What drives a cycle test, in words.
pub fn driven(study: &Study, id: &str) -> &'static str {
    match study.dataset.test(id).map(|t| &t.record) {
        Some(Record::Cycle(r)) if r.control == Some(crate::data::Control::Force) => "driving force",
        _ => "driven displacement",
    }
}

fn scaled(values: &[f64], unit: &(String, f64)) -> Vec<f64> {
    values.iter().map(|v| v / unit.1).collect()
}

/// A title with its unit.
fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() || unit == "1" { name.into() } else { format!("{name} [{unit}]") }
}

/// Measured with its band and computed over an abscissa. A `closed` curve ends where it began.
fn over(series: &Series, x: &[f64], y: &(String, f64), closed: bool, titles: (&Along, &Along), as_line: bool) -> Chart {
    let c = series.any();
    let mut plot = Chart::new(titles.0, titles.1);
    let close = |mut indices: Vec<usize>| {
        if closed && indices.len() > 2 {
            indices.push(indices[0]);
        }
        indices
    };
    let measured = scaled(&c.measured, y);
    let sigma = scaled(&c.sigma, y);
    let at = close(thin(&measured, series.limit));
    let edge = |side: f64| -> Vec<f64> { at.iter().map(|i| measured[*i] + side * 2.0 * sigma[*i]).collect() };
    plot.add(chart::band(&pick(x, &at), &edge(-1.0), &edge(1.0)));
    plot.add(if as_line {
        line(pick(x, &at), pick(&measured, &at), "measured", chart::INK)
    } else {
        points(pick(x, &at), pick(&measured, &at), "measured", chart::INK, 4)
    });
    for (k, name, c) in &series.on {
        let computed = scaled(&c.computed, y);
        let at = close(thin(&computed, series.limit));
        plot.add(shown(line(pick(x, &at), pick(&computed, &at), name, stage_colour(*k, series.stages)), *k, series.stages));
    }
    plot
}

fn whitened(c: &Curve) -> Vec<f64> {
    c.measured.iter().zip(&c.computed).zip(&c.sigma).map(|((m, y), s)| (m - y) / s).collect()
}

/// Whitened residuals of the first and the last stage over an abscissa, one panel each, as their sizes differ by far.
fn residuals(series: &Series, x: &[f64], title: &Along) -> Chart {
    let ends = series.ends();
    let y = linear("residual / σ");
    let mut plot = Chart::new(title, &y);
    let finite = x.iter().copied().filter(|v| v.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if ends.len() == 2 {
        plot = plot
            .with("xaxis", chart::axis(title).set("anchor", "y2"))
            .with("yaxis", chart::axis(&y).set("domain", [0.56, 1.0]))
            .with("yaxis2", chart::axis(&y).set("domain", [0.0, 0.44]));
    }
    for (panel, (k, name, c)) in ends.iter().enumerate() {
        let axis = if panel == 0 { "y" } else { "y2" };
        let colour = stage_colour(*k, series.stages);
        let within = chart::band(&[low, high], &[-2.0; 2], &[2.0; 2]).set("name", "± 2");
        plot.add(within.set("yaxis", axis).set("showlegend", panel == 0));
        let r = whitened(c);
        if c.kind == BlockKind::Frf {
            for (part, symbol) in [("real", "circle"), ("imaginary", "circle-open")] {
                let r: Vec<f64> = r.iter().skip(usize::from(part == "imaginary")).step_by(2).copied().collect();
                let at = thin(&r, series.limit);
                let trace = points(pick(x, &at), pick(&r, &at), &format!("{name}, {part}"), colour, 4);
                plot.add(trace.set("marker", chart::marker(colour, 4, symbol)).set("yaxis", axis));
            }
        } else {
            let at = thin(&r, series.limit);
            plot.add(points(pick(x, &at), pick(&r, &at), name, colour, 4).set("yaxis", axis));
        }
    }
    plot
}

/// What a driven curve shows over displacement: its titles and the residuals over phase or time and velocity.
fn loops(series: &Series, unit: &Units, charts: &mut Charts) -> String {
    let c = series.any();
    let phase: Vec<f64> = c.abscissa.iter().map(|p| p.to_degrees()).collect();
    let y = linear_title(&c.label, &unit.y.0);
    let mut out = String::new();
    // With residuals over phase and velocity beside it, the loop stands over both rows.
    let (shape, height) = if c.v.is_empty() { ("", 300) } else { ("tall", 600) };
    if c.x.is_empty() {
        let plot = over(series, &phase, &unit.y, false, (&linear("phase in the cycle [deg]"), &linear(&y)), false);
        out += &charts.figure(plot, height, &format!("{} <span>against phase</span>", esc(&c.label)), shape);
    } else {
        let x = with_unit(series.driven, &unit.x.0);
        let plot = over(series, &scaled(&c.x, &unit.x), &unit.y, true, (&linear(&x), &linear(&y)), false);
        out += &charts.figure(plot, height, &format!("{} <span>over the drive: the loop</span>", esc(&c.label)), shape);
    }
    out += &charts.figure(residuals(series, &phase, &linear("phase in the cycle [deg]")), 300, "Residual <span>against phase</span>", "");
    out += &against_velocity(series, unit, charts);
    format!("<div class=\"figures\">{out}</div>\n")
}

fn linear_title(label: &str, unit: &str) -> String {
    with_unit(label, unit)
}

fn against_velocity(series: &Series, unit: &Units, charts: &mut Charts) -> String {
    let c = series.any();
    if c.v.is_empty() {
        return String::new();
    }
    let title = if unit.x.0 == "SI" { "driven velocity [SI]".into() } else { format!("driven velocity [{}/s]", unit.x.0) };
    charts.figure(residuals(series, &scaled(&c.v, &unit.x), &linear(&title)), 300, "Residual <span>against velocity</span>", "")
}

fn record(series: &Series, unit: &Units, charts: &mut Charts) -> String {
    let c = series.any();
    let title = linear_title(&c.label, &unit.y.0);
    let plot = over(series, &c.abscissa, &unit.y, false, (&linear("time [s]"), &linear(&title)), true);
    let mut out = charts.figure(plot, 360, &format!("{} <span>against time</span>", esc(&c.label)), "wide");
    out += &charts.figure(residuals(series, &c.abscissa, &linear("time [s]")), 300, "Residual <span>against time</span>", "");
    out += &against_velocity(series, unit, charts);
    format!("<div class=\"figures\">{out}</div>\n")
}

/// Magnitude and phase [deg] of interleaved real and imaginary parts. The phase follows `like` where it is given, else itself.
fn polar(values: &[f64], like: Option<&[f64]>) -> (Vec<f64>, Vec<f64>) {
    let (mut magnitude, mut phase) = (Vec::new(), Vec::<f64>::new());
    for pair in values.chunks_exact(2) {
        magnitude.push(pair[0].hypot(pair[1]));
        let angle = pair[1].atan2(pair[0]).to_degrees();
        let near = like.map_or_else(|| phase.last().copied(), |l| l.get(phase.len()).copied()).filter(|v| v.is_finite()).unwrap_or(angle);
        phase.push(angle + 360.0 * ((near - angle) / 360.0).round());
    }
    (magnitude, phase)
}

fn frf(series: &Series, unit: &Units, charts: &mut Charts) -> String {
    let c = series.any();
    let f = &c.abscissa;
    let positive = f.iter().copied().filter(|v| *v > 0.0);
    let (low, high) = positive.fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
    let wide = high > 30.0 * low && f.iter().all(|v| *v > 0.0);
    let x = if wide { frequencies("frequency [Hz]") } else { linear("frequency [Hz]") };
    let y = linear_title(&c.label, &unit.y.0);
    let mut plot = Chart::new(&x, &decades(&y))
        .with("xaxis", chart::axis(&x).set("anchor", "y2"))
        .with("yaxis", chart::axis(&decades(&y)).set("domain", [0.42, 1.0]))
        .with("yaxis2", chart::axis(&linear("phase [deg]")).set("domain", [0.0, 0.34]));
    let (m, p) = polar(&scaled(&c.measured, &unit.y), None);
    let sigma: Vec<f64> = scaled(&c.sigma, &unit.y).iter().step_by(2).copied().collect();
    let at = thin(&m, series.limit);
    let part = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { at.iter().map(|i| f(*i)).collect() };
    // A magnitude below a hundredth of the measured one is not drawn: the axis is logarithmic.
    let lower = part(&|i| (m[i] - 2.0 * sigma[i]).max(0.01 * m[i]));
    plot.add(chart::band(&pick(f, &at), &lower, &part(&|i| m[i] + 2.0 * sigma[i])));
    let spread = |i: usize| (2.0 * sigma[i] / m[i]).to_degrees().min(180.0);
    plot.add(
        chart::band(&pick(f, &at), &part(&|i| p[i] - spread(i)), &part(&|i| p[i] + spread(i))).set("yaxis", "y2").set("showlegend", false),
    );
    plot.add(points(pick(f, &at), pick(&m, &at), "measured", chart::INK, 4));
    plot.add(points(pick(f, &at), pick(&p, &at), "measured", chart::INK, 4).set("yaxis", "y2").set("showlegend", false));
    for (k, name, c) in &series.on {
        let (cm, cp) = polar(&scaled(&c.computed, &unit.y), Some(&p));
        let at = thin(&cm, series.limit);
        let trace = |y: &[f64]| {
            let curve = line(pick(f, &at), pick(y, &at), name, stage_colour(*k, series.stages)).set("legendgroup", *name);
            shown(curve, *k, series.stages)
        };
        plot.add(trace(&cm));
        plot.add(trace(&cp).set("yaxis", "y2").set("showlegend", false));
    }
    let mut out = charts.figure(plot, 440, &format!("{} <span>magnitude and phase</span>", esc(&c.label)), "");
    out += &charts.figure(residuals(series, f, &x), 440, "Residual <span>against frequency</span>", "");
    format!("<div class=\"figures\">{out}</div>\n")
}

/// A table of measured and computed values, and their residuals against what its rows lie over: frequency or amplitude.
fn rows(series: &Series, unit: &Units, charts: &mut Charts) -> String {
    let c = series.any();
    let n = c.measured.len();
    let has_abscissa = c.abscissa.len() == n;
    let (name, symbol, one) = &unit.over;
    let title = with_unit(name, symbol);
    let abscissa: Vec<f64> = c.abscissa.iter().map(|a| a / one).collect();
    let capital = title.chars().next().map_or(String::new(), |first| first.to_uppercase().collect::<String>() + &title[first.len_utf8()..]);
    let mut header: Vec<String> = vec![if has_abscissa { esc(&capital) } else { "Row".into() }];
    header.extend([format!("Measured [{}]", esc(&c.unit)), "σ".into()]);
    header.extend(series.on.iter().map(|(_, name, _)| format!("Computed, {}", esc(name))));
    header.push("Computed / measured, last".into());
    let last = series.on.last().map_or(c, |l| l.2);
    let row = |i: usize| {
        let mut row = vec![if has_abscissa { plain(abscissa[i], 4) } else { (i + 1).to_string() }];
        row.extend([digits(c.measured[i], 4), digits(c.sigma[i], 2)]);
        row.extend(series.on.iter().map(|(_, _, c)| digits(c.computed[i], 4)));
        row.push(digits(last.computed[i] / last.measured[i], 3));
        row
    };
    let rows: Vec<Vec<String>> = (0..n.min(ROWS)).map(row).collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let right: Vec<usize> = (0..header.len()).collect();
    let more = if n > ROWS { format!("<p class=\"soft\">The first {ROWS} of {n} rows.</p>") } else { String::new() };
    let mut figures = String::new();
    if has_abscissa && n > 1 {
        let y = with_unit(&c.label, &c.unit);
        let wide = abscissa.iter().all(|f| *f > 0.0);
        let x = if wide { frequencies(&title) } else { linear(&title) };
        let plot = over(series, &abscissa, &(c.unit.clone(), 1.0), false, (&x, &linear(&y)), false);
        figures += &charts.figure(plot, 340, &format!("{} <span>against {name}</span>", esc(&c.label)), "");
        figures += &charts.figure(residuals(series, &abscissa, &x), 340, &format!("Residual <span>against {name}</span>"), "");
    }
    format!("{}{more}<div class=\"figures\">{figures}</div>\n", table(&esc(&c.label), &header, &right, &rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phase_follows_itself_and_the_measured() {
        // 170, 190, 350 degrees: one falling-behind turn, no jump.
        let at = |deg: f64| [deg.to_radians().cos(), deg.to_radians().sin()];
        let values = [at(170.0), at(190.0), at(350.0)].concat();
        let (magnitude, phase) = polar(&values, None);
        approx::assert_relative_eq!(magnitude[..], [1.0; 3][..], epsilon = 1e-12);
        approx::assert_relative_eq!(phase[..], [170.0, 190.0, 350.0][..], epsilon = 1e-9);
        let (_, near) = polar(&at(5.0), Some(&[361.0]));
        approx::assert_relative_eq!(near[0], 365.0, epsilon = 1e-9);
    }
}
