//! Every field of study.toml and dataset.toml: left out, misspelt, of the wrong type, of the wrong unit, not finite, empty.
//!
//! The two files below use every key there is ([`every_key_is_used`] holds them to that); each of their fields is damaged in each way.

use super::every_key::{DATASET, ELSEWHERE, OPTIONAL, STUDY};
use super::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use toml::{Table, Value};

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
    assert_eq!(whole, 10);
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
            // Parameters of effects share their keys.
            let table = match field.plain.rsplit_once('.').map_or("", |p| p.0) {
                t if study && t.starts_with("effect.") && t.matches('.').count() == 1 => "true effect.parameter".to_string(),
                t => format!("{study} {t}"),
            };
            used.entry(table.clone()).or_default().insert(key.clone());
            // Where the key decides what the table is, the error is that it is missing; its neighbours show the list.
            let accepted = refused(&with(&whole, field, Some("zzz"), None), study);
            let Some(keys) = accepted.strip_prefix("the keys ") else { continue };
            known.entry(table).or_default().extend(keys.split(", ").map(str::to_string));
        }
    }
    assert!(known.len() >= 15, "{known:#?}");
    for (table, keys) in known {
        let unused: Vec<&String> = keys.difference(&used[&table]).filter(|k| !ELSEWHERE.contains(&k.as_str())).collect();
        assert!(unused.is_empty(), "{table}: {unused:?} stand in no example");
    }
}
