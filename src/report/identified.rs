//! Modal parameters identified from the measured FRFs, for every group of FRF tests at the same conditions.

use std::collections::BTreeMap;

use crate::data::modal_fit::{FrfSet, ModalFit, Settings, fit};
use crate::data::{Condition, Dataset, Frf, Record, Test};

use super::chart::{self, Chart, Charts};
use super::text::{esc, plain};

/// FRF tests at the same conditions over the same lines.
pub struct Group<'a> {
    pub tests: Vec<&'a Test>,
    pub frfs: Vec<&'a Frf>,
}

/// Groups of the FRF tests that are of small signal, in the order of the dataset.
pub fn groups(dataset: &Dataset) -> Vec<Group<'_>> {
    let key = |t: &Test| -> BTreeMap<String, u64> { t.conditions.iter().map(|(k, c)| (k.clone(), c.value.to_bits())).collect() };
    let mut groups: Vec<(BTreeMap<String, u64>, Group)> = vec![];
    for t in &dataset.tests {
        let Record::Frf(f) = &t.record else { continue };
        if f.excitation.is_some() {
            continue;
        }
        let k = key(t);
        let known = groups.iter_mut().find(|g| {
            // Each pair of places once, all over the same lines.
            let new = g.1.frfs.iter().all(|o| (&o.respond, &o.excite) != (&f.respond, &f.excite));
            g.0 == k && new && g.1.frfs.first().is_some_and(|o| o.frequency == f.frequency)
        });
        match known {
            Some((_, group)) => {
                group.tests.push(t);
                group.frfs.push(f);
            }
            None => groups.push((k, Group { tests: vec![t], frfs: vec![f] })),
        }
    }
    groups.into_iter().flat_map(|g| complete(g.1)).collect()
}

/// The group where every response was measured over every force; else one group for each force.
fn complete<'a>(group: Group<'a>) -> Vec<Group<'a>> {
    let different = |pick: fn(&'a Frf) -> &'a str| {
        let mut all: Vec<&str> = vec![];
        for f in &group.frfs {
            if !all.contains(&pick(f)) {
                all.push(pick(f));
            }
        }
        all
    };
    let excites = different(|f| &f.excite);
    if group.frfs.len() == excites.len() * different(|f| &f.respond).len() {
        return vec![group];
    }
    let of = |excite: &str| {
        let mine = || (0..group.frfs.len()).filter(|k| group.frfs[*k].excite == excite);
        Group { tests: mine().map(|k| group.tests[k]).collect(), frfs: mine().map(|k| group.frfs[k]).collect() }
    };
    excites.into_iter().map(of).collect()
}

/// Conditions as they are printed.
pub fn conditions(t: &Test) -> String {
    let print = |(name, c): (&String, &Condition)| {
        format!("{} {}", esc(name), format!("{} {}", plain(c.unit.from_si(c.value), 4), esc(&c.unit.symbol)).trim_end())
    };
    t.conditions.iter().map(print).collect::<Vec<_>>().join(", ")
}

/// Modes of a group; `Err` says why there are none.
pub fn identify(group: &Group) -> Result<ModalFit, String> {
    let say = |e: crate::data::modal_fit::ModalFitError| format!("{e}; accepted: {}", e.accepted());
    let set = FrfSet::from_frfs(&group.frfs).map_err(say)?;
    fit(&set, &Settings::default()).map_err(say)
}

/// Poles over the order of the fit with the sum of the FRFs behind them.
pub fn diagram(group: &Group, found: &ModalFit, charts: &mut Charts, caption: &str) -> String {
    let Some(first) = group.frfs.first() else { return String::new() };
    let second = chart::axis(&chart::decades("sum of magnitudes")).set("overlaying", "y").set("side", "right").set("showgrid", false);
    let mut plot = Chart::new(&chart::linear("frequency [Hz]"), &chart::linear("order")).with("yaxis2", second);
    let from = first.frequency.iter().take_while(|f| **f <= 0.0).count();
    let x = first.frequency[from..].to_vec();
    let sum: Vec<f64> = (from..first.frequency.len()).map(|k| group.frfs.iter().map(|f| f.measured[k].norm()).sum()).collect();
    let keep = chart::thin(&sum, 500);
    let (low, high) = (x.first().copied().unwrap_or(0.0), x.last().copied().unwrap_or(1.0));
    let behind = chart::scatter(chart::pick(&x, &keep), chart::pick(&sum, &keep), "sum of magnitudes", "lines");
    plot.add(behind.set("line", chart::stroke("#c9c9c9", 1.5)).set("yaxis", "y2"));
    for (stable, name, colour, size, symbol) in
        [(false, "pole", "#b5b5b5", 4, "circle-open"), (true, "stable pole", chart::LAST, 6, "circle")]
    {
        let here = found.diagram.iter().filter(|p| p.stable == stable && p.frequency >= low && p.frequency <= high);
        let (f, order): (Vec<f64>, Vec<f64>) = here.map(|p| (p.frequency, p.order as f64)).unzip();
        plot.add(chart::points(f, order, name, colour, size).set("marker", chart::marker(colour, size, symbol)));
    }
    let highest = found.diagram.iter().map(|p| p.order).max().unwrap_or(1) as f64;
    for (k, mode) in found.modes.iter().enumerate() {
        let picked = chart::dashed(vec![mode.frequency; 2], vec![0.0, highest], "picked");
        plot.add(picked.set("showlegend", k == 0));
    }
    charts.figure(plot, 360, caption, "wide")
}
