//! What was found in files, with the curves by which an engineer confirms it.

use std::path::Path;

use serde_json::{Value, json};

use crate::data::Role;
use crate::data::inspect::{FoundColumn, FoundFrf, FoundHistory, FoundItem};
use crate::report::chart::{pick, thin};
use crate::work::Failure;
use crate::work::new::{self, Looked, named};

/// Points of a curve at most.
const POINTS: usize = 800;
/// Columns that are drawn at most.
const COLUMNS: usize = 16;

/// Files with the things in them, what is to be confirmed, and what is still wrong.
pub fn told(looked: &Looked, folder: &Path) -> Value {
    let files: Vec<Value> = looked
        .found
        .iter()
        .map(|f| {
            let name = named(&f.path);
            let items: Vec<Value> = f.items.iter().map(|i| with_plot(&name, i)).collect();
            json!({ "name": name, "items": items })
        })
        .collect();
    let scaffold = looked.scaffold.as_ref();
    json!({
        "files": files,
        "left_out": looked.left.iter().map(|f| inside(f, folder).problem()).collect::<Vec<_>>(),
        "to_confirm": scaffold.map(|s| s.to_confirm.iter().map(|l| shortened(l, folder)).collect::<Vec<_>>()),
        "problem": scaffold.and_then(|s| new::trouble(s, folder)).map(|p| p.problem()),
        "dataset": scaffold.map(|s| &s.dataset), "study": scaffold.map(|s| &s.study),
    })
}

/// Text without the folder that the files lie in for the moment.
fn shortened(text: &str, folder: &Path) -> String {
    text.replace(&format!("{}{}", folder.display(), std::path::MAIN_SEPARATOR), "")
}

/// A failure as the reader knows the file.
pub fn inside(f: &Failure, folder: &Path) -> Failure {
    let problem = f.problem();
    let stage = problem["stage"].as_str().unwrap_or("data");
    Failure::new(stage, shortened(f.place(), folder), shortened(f.message(), folder), f.accepted())
}

fn with_plot(name: &str, item: &FoundItem) -> Value {
    let mut value = new::item(name, item);
    value["plot"] = match item {
        FoundItem::History(h) => history(h),
        FoundItem::Frf(f) => frf(f),
        FoundItem::Modes(_) | FoundItem::Backbone(_) | FoundItem::Other(_) => Value::Null,
    };
    value
}

/// Every column over the time, with the extent of cycles and start-up, and the settled loop.
fn history(h: &FoundHistory) -> Value {
    let time = h.columns.iter().find(|c| c.role == Some(Role::Time)).or(h.columns.first());
    let Some(time) = time else { return Value::Null };
    let curve = |c: &FoundColumn| {
        let n = c.values.len().min(time.values.len());
        let at = thin(&c.values[..n], POINTS);
        json!({ "column": c.column, "x": pick(&time.values, &at), "y": pick(&c.values, &at) })
    };
    let curves: Vec<Value> = h.columns.iter().filter(|c| c.column != time.column).take(COLUMNS).map(curve).collect();
    let cyclic = h.cyclic.as_ref();
    let settled = cyclic.and_then(|c| {
        let of = |role: Role| c.settled.channels.iter().find(|k| k.role == role);
        let (x, f) = of(Role::Displacement).zip(of(Role::Force))?;
        let at = thin(&x.mean, POINTS);
        let in_unit = |k: &crate::data::LoopChannel| pick(&k.mean, &at).iter().map(|v| k.unit.from_si(*v)).collect::<Vec<_>>();
        Some(json!({ "x": in_unit(x), "y": in_unit(f), "x_unit": x.unit.symbol, "y_unit": f.unit.symbol, "cycles": c.settled.cycles }))
    });
    // In the unit of the time column: the samples say how much that is of a second.
    let span = time.values.last().zip(time.values.first()).map_or(0.0, |(b, a)| b - a);
    let unit = if h.seconds > 0.0 { span / h.seconds } else { 1.0 };
    let period = cyclic.map(|c| unit / c.frequency);
    json!({ "curves": curves, "time": time.column, "time_unit": time.unit, "from": time.values.first(), "period": period, "loop": settled })
}

fn frf(f: &FoundFrf) -> Value {
    let size: Vec<f64> = f.magnitude.iter().map(|p| p.1).collect();
    let at = thin(&size, POINTS);
    let frequency: Vec<f64> = f.magnitude.iter().map(|p| p.0).collect();
    json!({ "frequency": pick(&frequency, &at), "magnitude": pick(&size, &at) })
}
