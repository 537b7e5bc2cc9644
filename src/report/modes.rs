//! Natural modes: measured (stated in a table, or identified from FRFs) beside the model's, and pictures of the model's shapes.

use std::collections::BTreeMap;

use num_complex::Complex64;

use crate::data::modal_fit::{ModalFit, mac};
use crate::data::{Record, Test};
use crate::diagnose::results::words;
use crate::diagnose::{Telling, mode_energies};
use crate::engine::modal::{Mode, Range, modes};
use crate::explain::Explain;
use crate::model::{Bound, System};
use crate::response::{Family, Plan};

use super::ReportInput;
use super::chart::{self, Chart, Charts};
use super::identified::{self, Group};
use super::shapes;
use super::text::{digits, esc, percent, table};

/// Tables and diagrams at most, each at its own conditions.
const MOST: usize = 6;
/// Modes that are drawn.
const DRAWN: usize = 6;
/// 95 % of a normal distribution lie within this many standard deviations.
const WITHIN: f64 = 1.96;

/// What is drawn of one set of conditions.
struct Drawn {
    conditions: String,
    modes: Vec<Mode>,
    families: Vec<Family>,
    /// Measured frequency of a mode [Hz].
    measured: Vec<Option<f64>>,
}

/// Tables, diagrams and pictures; empty where nothing measured speaks of modes.
pub fn section(input: &ReportInput, charts: &mut Charts) -> String {
    let system = &*input.system.unwrap_or(&input.study.system).shaped();
    let tests = &input.study.dataset.tests;
    let (mut out, mut drawn) = (String::new(), vec![]);
    for t in tests.iter().filter(|t| matches!(t.record, Record::Modal(_))).take(MOST) {
        out += &stated(system, t, &mut drawn, charts);
    }
    let groups = identified::groups(&input.study.dataset);
    for group in groups.iter().take(MOST) {
        out += &from_frfs(system, group, &mut drawn, charts);
    }
    if groups.len() > MOST {
        out += &format!("<p class=\"soft\">The first {MOST} of {} groups of FRFs.</p>", groups.len());
    }
    if out.is_empty() {
        return out;
    }
    // The middle one: of three loads the mean.
    let pictures = drawn.get(drawn.len() / 2).map(|d| pictures(system, d, charts)).unwrap_or_default();
    format!("{out}{pictures}")
}

fn heading(t: &Test) -> String {
    let at = identified::conditions(t);
    if at.is_empty() { String::new() } else { format!(" at {at}") }
}

/// `1.2 %` with its sign.
fn deviation(computed: f64, measured: f64) -> String {
    let d = computed / measured - 1.0;
    if d.is_finite() { format!("{}{}", if d < 0.0 { "−" } else { "+" }, percent(d.abs())) } else { "-".into() }
}

/// A modal test: its rows with the modes they are paired with.
fn stated(system: &System, t: &Test, drawn: &mut Vec<Drawn>, charts: &mut Charts) -> String {
    let title = format!("<h3>{}{}: stated in a table</h3>", esc(&t.id), heading(t));
    let plan = match Plan::new(t, &system.model) {
        Ok(plan) => plan,
        Err(e) => return format!("{title}<p>{}</p>", esc(&e.to_string())),
    };
    let found = match plan.modes(system) {
        Ok(Some(found)) => found,
        Ok(None) => return String::new(),
        Err(e) => {
            return format!(
                "{title}<p>The model's modes cannot be held against it: {}; accepted: {}</p>",
                esc(&e.to_string()),
                esc(&e.accepted())
            );
        }
    };
    let value = |row: usize| (plan.measured[row].exp(), plan.sigma[row]);
    let (Some(frequencies), damping) = (plan.blocks.first(), plan.blocks.get(1)) else { return String::new() };
    let (mut rows, mut pairs) = (vec![], vec![]);
    let mut measured = vec![None; found.found.len()];
    for (k, &m) in found.rows.iter().enumerate() {
        let (mode, number) = (&found.found[m], frequencies.abscissa[k]);
        let (f, sigma) = value(frequencies.range.start + k);
        measured[m] = Some(f);
        let at = damping.and_then(|d| Some(d.range.start + d.abscissa.iter().position(|a| *a == number)?)).map(value);
        pairs.push((format!("{number}"), f, mode.frequency_hz));
        rows.push(vec![
            format!("{number}"),
            found.families[m].word().into(),
            format!("{} ± {}", digits(f, 5), digits(WITHIN * sigma * f, 2)),
            digits(mode.frequency_hz, 5),
            deviation(mode.frequency_hz, f),
            at.map_or("-".into(), |(d, s)| format!("{} ± {}", percent(d), percent(WITHIN * s * d))),
            percent(mode.damping),
        ]);
    }
    let header = ["Mode", "Family", "Measured [Hz], 95 %", "Computed [Hz]", "Deviation", "Damping measured", "Damping computed"];
    let bars = bars(&pairs, charts, &format!("Natural frequencies{}", heading(t)));
    drawn.push(Drawn { conditions: heading(t), modes: found.found, families: found.families, measured });
    let energy = energies(&plan, system);
    format!("{title}{}<div class=\"figures\">{bars}</div>{energy}", table("", &header, &[2, 3, 4, 5, 6], &rows))
}

/// Where the energy of the modes is, and which of them a fixture holds.
fn energies(plan: &Plan, system: &System) -> String {
    let modes = mode_energies(plan, system, &Telling::default());
    let rows: Vec<Vec<String>> = modes.iter().map(|m| vec![m.mode.to_string(), esc(&words(&m.strain)), esc(&words(&m.kinetic))]).collect();
    let findings: String = modes.iter().filter_map(|m| m.finding.as_ref()).map(|f| format!("<p>{}</p>", esc(f))).collect();
    table("Where the energy of the modes is", &["Mode", "Strain energy", "Kinetic energy"], &[], &rows) + &findings
}

/// Measured and computed frequencies side by side, as the paper's Fig. 14.
fn bars(pairs: &[(String, f64, f64)], charts: &mut Charts, caption: &str) -> String {
    if pairs.is_empty() {
        return String::new();
    }
    let mut plot = Chart::new(&chart::linear("mode"), &chart::linear("frequency [Hz]"));
    let names: Vec<String> = pairs.iter().map(|p| format!("mode {}", p.0)).collect();
    plot.add(chart::bars(names.clone(), pairs.iter().map(|p| p.1).collect(), "measured", chart::INK));
    plot.add(chart::bars(names, pairs.iter().map(|p| p.2).collect(), "computed", chart::LAST));
    charts.figure(plot, 280, caption, "")
}

/// Modes identified from FRFs, each with the nearest of the model's.
fn from_frfs(system: &System, group: &Group, drawn: &mut Vec<Drawn>, charts: &mut Charts) -> String {
    let Some(t) = group.tests.first() else { return String::new() };
    let ids: Vec<String> = group.tests.iter().map(|t| esc(&t.id)).collect();
    let title = format!("<h3>FRFs{}: modes identified from {}</h3>", heading(t), ids.join(", "));
    let found = match identified::identify(group) {
        Ok(found) => found,
        Err(e) => return format!("{title}<p>No modal parameters: {}</p>", esc(&e)),
    };
    if found.modes.is_empty() {
        let diagram = identified::diagram(group, &found, charts, "Stabilisation diagram <span>no pole stays over the orders</span>");
        return format!("{title}<p>No pole stays over the orders: no mode is identified.</p><div class=\"figures\">{diagram}</div>");
    }
    let computed = model_modes(system, t, &found);
    let note = match &computed {
        Ok(_) => format!(
            "<p class=\"soft\">Poly-reference least squares, refined to the FRFs with their noise; intervals of 95 %. χ² per degree of freedom {}: \
             at 1 the modes leave noise alone, well above 1 there is more in the FRFs and the intervals are too narrow.</p>",
            digits(found.chi_squared, 3)
        ),
        Err(e) => format!("<p>The model's modes cannot be held against them: {}</p>", esc(e)),
    };
    let none = (vec![], vec![]);
    let (modes, families) = computed.as_ref().unwrap_or(&none);
    let dofs: Vec<Option<usize>> = places(group).iter().map(|p| system.model.dof(p)).collect();
    let mut measured = vec![None; modes.len()];
    let pairs = pair(&found, modes, &dofs);
    let row = |k: usize| {
        let m = &found.modes[k];
        let of = pairs[k].map(|p| (&modes[p.0], families[p.0], p.1));
        vec![
            (k + 1).to_string(),
            of.map_or("-".into(), |o| o.1.word().into()),
            format!("{} ± {}", digits(m.frequency, 5), digits(WITHIN * m.frequency_sigma, 2)),
            of.map_or("-".into(), |o| digits(o.0.frequency_hz, 5)),
            of.map_or("-".into(), |o| deviation(o.0.frequency_hz, m.frequency)),
            format!("{} ± {}", percent(m.damping), percent(WITHIN * m.damping_sigma)),
            of.map_or("-".into(), |o| percent(o.0.damping)),
            of.and_then(|o| o.2).map_or("-".into(), |m| digits(m, 3)),
            digits(m.complexity, 2),
        ]
    };
    let rows: Vec<Vec<String>> = (0..found.modes.len()).map(row).collect();
    for (m, partner) in found.modes.iter().zip(&pairs) {
        if let Some((k, _)) = partner {
            measured[*k] = Some(m.frequency);
        }
    }
    let header = [
        "Mode",
        "Family",
        "Measured [Hz], 95 %",
        "Computed [Hz]",
        "Deviation",
        "Damping measured",
        "Damping computed",
        "MAC",
        "Complexity",
    ];
    let diagram = identified::diagram(group, &found, charts, &format!("Stabilisation diagram{}", heading(t)));
    if !modes.is_empty() {
        drawn.push(Drawn { conditions: heading(t), modes: modes.clone(), families: families.clone(), measured });
    }
    format!("{title}{note}{}<div class=\"figures\">{diagram}</div>", table("", &header, &[2, 3, 4, 5, 6, 7, 8], &rows))
}

/// Response places of a group, in the order of its shapes.
fn places(group: &Group) -> Vec<String> {
    let mut all: Vec<String> = vec![];
    for f in &group.frfs {
        if !all.contains(&f.respond) {
            all.push(f.respond.clone());
        }
    }
    all
}

/// Modes of the model up to a little above the highest identified one.
fn model_modes(system: &System, t: &Test, found: &ModalFit) -> Result<(Vec<Mode>, Vec<Family>), String> {
    let conditions: BTreeMap<String, f64> = t.conditions.iter().map(|(k, c)| (k.clone(), c.value)).collect();
    let bound = Bound::new(system, &[], &t.id, &conditions).map_err(|e| e.to_string())?;
    let high = 1.3 * found.modes.last().map_or(1.0, |m| m.frequency);
    let mut all = modes(&system.model, &bound, Range::Band(0.0, high), false).map_err(|e| e.to_string())?;
    all.retain(|m| m.frequency_hz > 0.0);
    let families = all.iter().map(|m| Family::of(&system.model, &m.shape)).collect();
    Ok((all, families))
}

/// The model's mode for each identified one: near in frequency, alike in shape where several places were measured. Each once.
fn pair(found: &ModalFit, modes: &[Mode], dofs: &[Option<usize>]) -> Vec<Option<(usize, Option<f64>)>> {
    let known: Option<Vec<usize>> = dofs.iter().copied().collect();
    let likeness = |m: &crate::data::modal_fit::Mode, c: &Mode| -> (f64, Option<f64>) {
        let near = 1.0 / (1.0 + (10.0 * (c.frequency_hz / m.frequency).ln()).powi(2));
        // One point alone, and a mode that no measured point sees, have no shape.
        let of = known.as_ref().filter(|d| d.len() > 1).map(|d| {
            let shape: Vec<Complex64> = d.iter().map(|d| c.shape[*d]).collect();
            let seen = shape.iter().map(|x| x.norm()).fold(0.0, f64::max) > 1e-6 * c.shape.iter().map(|x| x.norm()).fold(0.0, f64::max);
            if seen { mac(&m.shape, &shape) } else { 0.0 }
        });
        (near * of.unwrap_or(1.0), of)
    };
    let mut all: Vec<(f64, usize, usize, Option<f64>)> = vec![];
    for (k, m) in found.modes.iter().enumerate() {
        all.extend(modes.iter().enumerate().map(|(j, c)| {
            let (score, of) = likeness(m, c);
            (score, k, j, of)
        }));
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut pairs, mut taken) = (vec![None; found.modes.len()], vec![false; modes.len()]);
    for (score, k, j, of) in all {
        if score > LIKE && pairs[k].is_none() && !taken[j] {
            (pairs[k], taken[j]) = (Some((j, of)), true);
        }
    }
    pairs
}

/// Likeness below which two modes are not held to be the same.
const LIKE: f64 = 0.1;

fn pictures(system: &System, d: &Drawn, charts: &mut Charts) -> String {
    let figures: String = d
        .modes
        .iter()
        .zip(&d.families)
        .zip(&d.measured)
        .take(DRAWN)
        .enumerate()
        .map(|(k, ((mode, family), measured))| {
            let measured = measured.map_or(String::new(), |f| format!(", measured {} Hz", digits(f, 4)));
            let caption = format!(
                "Mode {}: {} Hz <span>{}, damping {}{measured}</span>",
                k + 1,
                digits(mode.frequency_hz, 4),
                family.word(),
                percent(mode.damping)
            );
            charts.figure(shapes::picture(&system.model, &mode.shape), 280, &caption, "")
        })
        .collect();
    if figures.is_empty() {
        return figures;
    }
    let on = if system.model.space.is_some() { "drawn on the unloaded chain, seen aslant; " } else { "" };
    format!(
        "<h3>Shapes of the model{}</h3><p class=\"soft\">Undeformed grey, deformed blue; {on}amplitudes are scaled to be seen.</p><div class=\"figures\">{figures}</div>",
        d.conditions
    )
}
