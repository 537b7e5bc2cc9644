//! Every field of study.toml and dataset.toml: left out, misspelt, of the wrong type, of the wrong unit, not finite, empty.
//!
//! The two files below use every key there is ([`every_key_is_used`] holds them to that); each of their fields is damaged in each way.

use super::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use toml::{Table, Value};

const DATASET: &str = r#"
schema = 1
folder = "."
title = "every key"
source = "a bench"
licence = "CC-BY-4.0"
assumptions = ["room temperature"]
[[test]]
id = "loop"
kind = "cycle"
description = "a loop"
file = "loop-1.csv"
control = "displacement"
discard_cycles = 1
noise = "1 %"
conditions = { frequency = "1 Hz", i = "0.1 mm +- 0.01 mm", load = "80 N", temperature = "20 degC", pressure = "1 bar" }
channels = [
 { role = "time", column = "t", unit = "s" },
 { role = "displacement", at = "c1.x", column = "x", unit = "mm", input = true },
 { role = "force", at = "c1.x", column = "F", unit = "N", sigma = "0.5 N" }]
[[test]]
id = "whole"
kind = "transient"
file = "loop-2.csv"
control = "displacement"
noise = "1 %"
conditions = { i = { value = "0.3 mm", sigma = "0.01 mm" } }
channels = [
 { role = "time", column = "t", unit = "s" },
 { role = "displacement", at = "c1.x", column = "x", unit = "mm", input = true },
 { role = "force", at = "c1.x", column = "F", unit = "N", sigma = "2 %" }]
[[test]]
id = "hammer"
kind = "frf"
file = "frf.csv"
excite = "end.x"
respond = "end.x"
quantity = "accelerance"
excitation = "0.1 N"
noise = "1 %"
conditions = { i = "0.5 mm" }
channels = [
 { role = "frequency", column = "f", unit = "Hz" },
 { role = "real", column = "re", unit = "m/s2/N" },
 { role = "imag", column = "im", unit = "m/s2/N" },
 { role = "coherence", column = "coh", averages = 20 }]
[[test]]
id = "energies"
kind = "energy"
at = "c1.x"
control = "force"
force_min = "21.6 N"
force_max = "138.3 N"
W_s_reading = "slope"
noise = "3 %"
conditions = { i = "0.5 mm" }
rows = [{ case = "slow", frequency = "1 Hz", W_D = "1.04 mJ", W_s = "249.07 mJ", D = 0.5, sigma_frequency = "0.1 Hz", sigma_W_D = "0.03 mJ", sigma_W_s = "0.7 mJ", sigma_D = 0.01, conditions = { i = "0.1 mm" } }]
[[test]]
id = "energies-x"
kind = "energy"
at = "c1.x"
control = "displacement"
displacement_min = "-1 mm"
displacement_max = "1 mm"
conditions = { i = "0.5 mm", frequency = "1 Hz" }
rows = [{ W_D = "1.04 mJ" }]
[[test]]
id = "energies-file"
kind = "energy"
at = "c1.x"
control = "displacement"
amplitude = "1 mm"
mean = "0.1 mm"
conditions = { i = "0.5 mm" }
file = "energies.csv"
channels = [
 { role = "frequency", column = "f", unit = "Hz" },
 { role = "W_D", column = "wd", unit = "mJ", sigma_column = "s" }]
[[test]]
id = "modes"
kind = "modal"
noise = "1 %"
conditions = { i = "0.5 mm" }
rows = [{ mode = 1, frequency = "290 Hz", sigma_frequency = "1 Hz", damping = "5.3 %", sigma_damping = "0.2 %", family = "bending", description = "first" }]
[[test]]
id = "modes-file"
kind = "modal"
conditions = { i = "0.5 mm" }
file = "modes.csv"
channels = [
 { role = "mode", column = "n" },
 { role = "frequency", column = "f", unit = "Hz" },
 { role = "family", column = "family" }]
"#;

pub(super) const STUDY: &str = r#"
schema = 1
title = "every key"
dataset = "data"
folder = "data"
assumptions = ["rigid"]
[split]
select = ["whole"]
held_out = ["hammer"]
[fit]
loss = "huber"
width = 1.345
max_iterations = 50
starts = 2
[search]
effects = ["film"]
places = ["c1.x"]
max_added = 2
[[body]]
name = "ground"
fixed = true
[[body]]
name = "end"
free = ["x"]
mass = "1 kg"
[[body]]
name = "m"
free = ["x", "psi"]
mass = "1 kg"
inertia = "1 kg m2"
count = 2
[[connector]]
name = "c1"
from = "ground"
to = "end"
[[connector]]
name = "d"
chain = "m"
[[connector]]
name = "base"
from = "end"
to = "m1"
[[effect]]
effect = "linear_stiffness"
at = ["c1.x", "d1.x", "base.x"]
k = { start = "20 N/mm", min = "1 N/mm", max = "90 N/mm", prior = { mean = "20 N/mm", sigma = "2 N/mm" }, fixed = false }
[[effect]]
effect = "linear_stiffness"
at = ["d1.psi", "base.psi"]
k = "3 N m/rad"
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.1 N s/mm", min = "0 N s/mm" }
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.3 N s/mm", min = "0 N s/mm" }
[[effect]]
effect = "coulomb"
at = "c1.x"
f = "1 N"
vr = { start = "1 mm/s", free = true }
[[effect]]
effect = "interference_law"
at = "c1.x"
of = "viscous.c"
condition = "i"
reference = "0.3 mm"
a = "0.2 1/mm"
[[effect]]
effect = "delay"
at = "*.force"
tau = "1 ms"
[[order]]
order = ["c1.x.viscous.c", "c1.x.viscous#2.c"]
gap = "0.01 N s/mm"
[[prediction]]
case = "a"
quantity = "W_s"
W_s_reading = "product"
at = "c1.x"
control = "force"
force_min = "1 N"
force_max = "9 N"
conditions = { frequency = "1 Hz", i = "0.3 mm" }
reference = "74 mJ"
[[prediction]]
case = "b"
quantity = "W_D"
at = "c1.x"
control = "displacement"
displacement_min = "-1 mm"
displacement_max = "1 mm"
conditions = { frequency = "1 Hz", i = "0.3 mm" }
[[prediction]]
case = "c"
quantity = "force_range"
at = "c1.x"
control = "displacement"
amplitude = "1 mm"
mean = "0.1 mm"
conditions = { frequency = "1 Hz", i = "0.3 mm" }
[[prediction]]
case = "d"
quantity = "natural_frequency"
mode = 1
[[prediction]]
case = "e"
quantity = "receptance"
excite = "end.x"
respond = "m2.x"
frequency = "120 Hz"
excitation = "0.1 N"
"#;

/// Fields that may be left out.
const OPTIONAL: &[&str] = &[
    // dataset.toml
    "folder",
    "title",
    "source",
    "licence",
    "assumptions",
    "test.description",
    "test.noise",
    "test.discard_cycles",
    "test.excitation",
    "test.W_s_reading",
    "test.mean",
    "test.conditions",
    "test.conditions.i",
    "test.conditions.frequency",
    "test.conditions.load",
    "test.conditions.temperature",
    "test.conditions.pressure",
    "test.conditions.i.sigma",
    "test.channels.sigma",
    "test.channels.sigma_column",
    "test.channels.input",
    "test.rows.case",
    "test.rows.frequency",
    "test.rows.W_D",
    "test.rows.W_s",
    "test.rows.D",
    "test.rows.damping",
    "test.rows.sigma_frequency",
    "test.rows.sigma_damping",
    "test.rows.sigma_W_D",
    "test.rows.sigma_W_s",
    "test.rows.sigma_D",
    "test.rows.family",
    "test.rows.description",
    "test.rows.conditions",
    "test.rows.conditions.i",
    // `input = true` says as much.
    "test.control",
    // Without limits the table can be read, though not computed.
    "test.amplitude",
    // study.toml
    "split",
    "split.select",
    "split.held_out",
    "fit",
    "fit.loss",
    "fit.width",
    "fit.max_iterations",
    "fit.starts",
    "search",
    "search.effects",
    "search.places",
    "search.max_added",
    "body.mass",
    "body.inertia",
    "effect.k.min",
    "effect.k.max",
    "effect.k.prior",
    "effect.k.fixed",
    "effect.c.min",
    "effect.vr",
    "effect.vr.free",
    "order",
    "order.gap",
    "prediction",
    "prediction.W_s_reading",
    "prediction.reference",
    "prediction.mean",
    "prediction.excitation",
    "prediction.conditions",
    "prediction.conditions.i",
];

/// A field: its path with indices as errors print it, the path without them, and how to reach it.
#[derive(Clone, Debug)]
struct Field {
    path: String,
    plain: String,
    steps: Vec<Step>,
}

#[derive(Clone, Debug)]
enum Step {
    Key(String),
    Index(usize),
}

fn fields(value: &Value, at: &Field, all: &mut Vec<Field>) {
    let under = |path: String, plain: String, step: Step| Field { path, plain, steps: [at.steps.clone(), vec![step]].concat() };
    match value {
        Value::Table(table) => {
            for (key, value) in table {
                let dot = if at.path.is_empty() { "" } else { "." };
                let field = under(format!("{}{dot}{key}", at.path), format!("{}{dot}{key}", at.plain), Step::Key(key.clone()));
                all.push(field.clone());
                fields(value, &field, all);
            }
        }
        Value::Array(list) => {
            for (k, value) in list.iter().enumerate() {
                fields(value, &under(format!("{}[{k}]", at.path), at.plain.clone(), Step::Index(k)), all);
            }
        }
        _ => {}
    }
}

fn all_fields(text: &str) -> (Value, Vec<Field>) {
    let whole = Value::Table(text.parse::<Table>().unwrap());
    let mut all = Vec::new();
    fields(&whole, &Field { path: String::new(), plain: String::new(), steps: vec![] }, &mut all);
    (whole, all)
}

/// Puts another value in the place of a field, under its own key or another; none takes it out.
fn with(whole: &Value, field: &Field, key: Option<&str>, value: Option<Value>) -> String {
    let mut whole = whole.clone();
    let (last, before) = field.steps.split_last().unwrap();
    let mut at = &mut whole;
    for step in before {
        at = match step {
            Step::Key(key) => at.get_mut(key.as_str()).unwrap(),
            Step::Index(k) => at.get_mut(*k).unwrap(),
        };
    }
    let (Value::Table(table), Step::Key(own)) = (at, last) else { panic!("{field:?}") };
    let old = table.remove(own).unwrap();
    if let Some(key) = key {
        table.insert(key.to_string(), value.unwrap_or(old));
    }
    toml::to_string(&whole).unwrap()
}

fn value<'a>(whole: &'a Value, field: &Field) -> &'a Value {
    field.steps.iter().fold(whole, |v, step| match step {
        Step::Key(key) => &v[key.as_str()],
        Step::Index(k) => &v[*k],
    })
}

/// A quantity begins with its number.
fn quantity(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit() || c == '-')
}

/// Each way to be wrong with a value.
fn damages(value: &Value) -> Vec<(&'static str, Value)> {
    let mut all: Vec<(&'static str, Value)> = vec![("wrong type", Value::Datetime("2026-11-21".parse().unwrap()))];
    match value {
        Value::String(text) => {
            all.push(("empty", "".into()));
            all.push(("wrong type", true.into()));
            if quantity(text) {
                let unit = text.trim_start_matches(|c: char| c.is_ascii_digit() || ".-".contains(c));
                all.push(("not finite", format!("nan{unit}").into()));
                all.push(("not finite", format!("inf{unit}").into()));
                all.push(("wrong unit", "1 kg3 m7".into()));
                all.push(("unknown unit", "1 wibble".into()));
                all.push(("no number", "much".into()));
            }
        }
        Value::Float(_) => {
            all.push(("not finite", f64::NAN.into()));
            all.push(("not finite", f64::INFINITY.into()));
            all.push(("wrong type", true.into()));
        }
        Value::Integer(_) => {
            all.push(("wrong type", "three".into()));
            all.push(("out of range", (-3).into()));
        }
        Value::Boolean(_) => all.push(("wrong type", "yes".into())),
        Value::Array(_) => all.push(("wrong type", 3.into())),
        Value::Table(_) => all.push(("wrong type", Value::Array(vec![3.into()]))),
        Value::Datetime(_) => {}
    }
    all
}

fn misspelt(key: &str) -> String {
    let last = key.chars().last().unwrap();
    format!("{key}{last}")
}

/// Damages every field and collects what is accepted that should not be, or refused without saying where and what would do.
fn faults(text: &str, load: &dyn Fn(&str, &Field) -> Result<(), StudyError>) -> String {
    let (whole, all) = all_fields(text);
    let mut faults = String::new();
    let mut count = 0;
    let mut judge = |what: String, wanted: &[&str], result: Result<(), StudyError>| {
        count += 1;
        match result {
            Ok(()) => writeln!(faults, "{what}: accepted").unwrap(),
            Err(e) => {
                let said = format!("{} | {e} | {}", e.place(), e.accepted());
                if e.accepted().is_empty() || e.place().is_empty() {
                    writeln!(faults, "{what}: no place, or nothing accepted: {said}").unwrap();
                }
                for word in wanted.iter().filter(|w| !said.contains(**w)) {
                    writeln!(faults, "{what}: `{word}` not in: {said}").unwrap();
                }
            }
        }
    };
    for field in &all {
        let Some(Step::Key(key)) = field.steps.last() else { continue };
        let here = value(&whole, field);
        // Conditions have names of the engineer's own, and any dimension; those with a meaning keep theirs.
        let own_name = field.plain.contains("conditions.") && !field.plain.ends_with(".sigma") && !field.plain.ends_with(".value");
        let own_unit = field.plain.contains("conditions.i");
        if !own_name {
            let wrong = misspelt(key);
            let text = with(&whole, field, Some(&wrong), None);
            judge(format!("{} misspelt", field.path), &[&wrong, &format!("nearest is `{key}`"), "line"], load(&text, field));
        }
        let missing = load(&with(&whole, field, None, None), field);
        if !(missing.is_ok() && OPTIONAL.contains(&field.plain.as_str())) {
            judge(format!("{} left out", field.path), &[key], missing);
        }
        for (what, wrong) in damages(here) {
            if own_unit && what == "wrong unit" {
                continue;
            }
            let text = with(&whole, field, Some(key), Some(wrong.clone()));
            judge(format!("{} {what}: {wrong}", field.path), &[key, "line"], load(&text, field));
        }
    }
    assert!(count > 300, "{count} cases");
    faults
}

/// A folder with both files and the measurements they name.
pub(super) fn folder() -> Folder {
    let folder = Folder::new(STUDY, "");
    let data = folder.path().join("data");
    std::fs::write(data.join("dataset.toml"), DATASET).unwrap();
    std::fs::write(data.join("energies.csv"), "f,wd,s\n1,2.5,0.1\n2,3.5,0.2\n").unwrap();
    std::fs::write(data.join("modes.csv"), "n,f,family\n1,290,bending\n2,810,bending\n").unwrap();
    folder
}

#[test]
fn of_study_toml() {
    let dataset = folder().load().unwrap().dataset;
    // Where the dataset lies is settled before the rest is read.
    let kept = folder();
    let load = |text: &str, field: &Field| {
        if field.path == "dataset" || field.path == "folder" {
            std::fs::write(kept.file(), text).unwrap();
            return kept.load().map(|_| ());
        }
        read(text, &dataset).map(|_| ())
    };
    let faults = faults(STUDY, &load);
    assert!(faults.is_empty(), "\n{faults}");
}

#[test]
fn of_dataset_toml() {
    let folder = folder();
    let file = folder.path().join("data/dataset.toml");
    let whole = folder.load().unwrap().dataset.tests.len();
    assert_eq!(whole, 8);
    let load = |text: &str, field: &Field| {
        // The other tests are no part of it; they are left out, so that their files need not be read.
        let mut table: Table = text.parse().unwrap();
        if let (Some(Step::Index(k)), Some(Value::Array(tests))) = (field.steps.get(1), table.get_mut("test")) {
            *tests = vec![tests.swap_remove(*k)];
        }
        std::fs::write(&file, toml::to_string(&table).unwrap()).unwrap();
        Dataset::load(&file, None)?;
        Ok(())
    };
    let faults = faults(DATASET, &load);
    assert!(faults.is_empty(), "\n{faults}");
}

/// The lists of accepted keys that the errors print name no key that the two files above do not use.
#[test]
fn every_key_is_used() {
    let folder = folder();
    let dataset = folder.load().unwrap().dataset;
    let file = folder.path().join("data/dataset.toml");
    let refused = |text: &str, study: bool| -> String {
        if study {
            return read(text, &dataset).map(|_| ()).unwrap_err().accepted();
        }
        std::fs::write(&file, text).unwrap();
        Dataset::load(&file, None).unwrap_err().accepted()
    };
    let (mut used, mut known): (BTreeMap<String, BTreeSet<String>>, BTreeMap<String, BTreeSet<String>>) = Default::default();
    for (text, study) in [(STUDY, true), (DATASET, false)] {
        let (whole, all) = all_fields(text);
        for field in all.iter().filter(|f| !f.plain.contains("conditions.")) {
            let Some(Step::Key(key)) = field.steps.last() else { continue };
            let table = format!("{study} {}", field.plain.rsplit_once('.').map_or("", |p| p.0));
            used.entry(table.clone()).or_default().insert(key.clone());
            // Where the key decides what the table is, the error is that it is missing; its neighbours show the list.
            let accepted = refused(&with(&whole, field, Some("zzz"), None), study);
            let Some(keys) = accepted.strip_prefix("the keys ") else { continue };
            known.entry(table).or_default().extend(keys.split(", ").map(str::to_string));
        }
    }
    assert!(known.len() >= 15, "{known:#?}");
    for (table, keys) in known {
        let unused: Vec<&String> = keys.difference(&used[&table]).filter(|k| *k != "license").collect();
        assert!(unused.is_empty(), "{table}: {unused:?} stand in no example");
    }
}
