//! The schemas hold what the program reads and prints, and refuse a misspelt key.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::rig::Rig;

#[allow(dead_code)]
#[path = "../../src/core/study/tests/every_key.rs"]
mod every_key;

fn misfit(args: &[&str]) -> Value {
    let run = Command::new(env!("CARGO_BIN_EXE_misfit")).args(args).arg("--json").output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

/// What of `value` is against `schema`, which may use the keywords that the program writes and no other.
pub fn against(root: &Value, schema: &Value, value: &Value, at: &str) -> Vec<String> {
    let Value::Object(keywords) = schema else {
        return if schema == &Value::Bool(false) { vec![format!("{at}: nothing may stand here")] } else { vec![] };
    };
    let mut wrong = Vec::new();
    let deep = |s: &Value, v: &Value, at: &str| against(root, s, v, at);
    let fits = |s: &Value| deep(s, value, at).is_empty();
    for (keyword, rule) in keywords {
        match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "format" | "default" | "then" => {}
            "$ref" => {
                let path = rule.as_str().unwrap().trim_start_matches('#');
                wrong.extend(deep(root.pointer(path).unwrap(), value, at));
            }
            "type" => {
                let is = |t: &Value| match t.as_str().unwrap() {
                    "string" => value.is_string(),
                    "number" => value.is_number(),
                    "integer" => value.is_i64() || value.is_u64(),
                    "boolean" => value.is_boolean(),
                    "array" => value.is_array(),
                    "object" => value.is_object(),
                    "null" => value.is_null(),
                    other => panic!("type {other}"),
                };
                let fine = if let Value::Array(list) = rule { list.iter().any(is) } else { is(rule) };
                if !fine {
                    wrong.push(format!("{at}: {value} is no {rule}"));
                }
            }
            "enum" if !rule.as_array().unwrap().contains(value) => wrong.push(format!("{at}: {value} is none of {rule}")),
            "const" if rule != value => wrong.push(format!("{at}: {value} is not {rule}")),
            "enum" | "const" => {}
            "minimum" | "maximum" => {
                let (limit, Some(v)) = (rule.as_f64().unwrap(), value.as_f64()) else { continue };
                if (keyword == "minimum" && v < limit) || (keyword == "maximum" && v > limit) {
                    wrong.push(format!("{at}: {v} is beyond {limit}"));
                }
            }
            "minItems" | "maxItems" => {
                let (limit, Some(v)) = (rule.as_u64().unwrap() as usize, value.as_array()) else { continue };
                if (keyword == "minItems" && v.len() < limit) || (keyword == "maxItems" && v.len() > limit) {
                    wrong.push(format!("{at}: {} items", v.len()));
                }
            }
            "prefixItems" => {
                for (k, (s, v)) in rule.as_array().unwrap().iter().zip(value.as_array().into_iter().flatten()).enumerate() {
                    wrong.extend(deep(s, v, &format!("{at}[{k}]")));
                }
            }
            "items" => {
                for (k, v) in value.as_array().into_iter().flatten().enumerate() {
                    wrong.extend(deep(rule, v, &format!("{at}[{k}]")));
                }
            }
            "required" => {
                let missing = rule.as_array().unwrap().iter().filter(|k| value.is_object() && value.get(k.as_str().unwrap()).is_none());
                wrong.extend(missing.map(|k| format!("{at}: no {k}")));
            }
            "properties" => {
                for (key, s) in rule.as_object().unwrap() {
                    wrong.extend(value.get(key).into_iter().flat_map(|v| deep(s, v, &format!("{at}.{key}"))));
                }
            }
            "additionalProperties" => {
                let known = keywords.get("properties").and_then(Value::as_object);
                let more = value.as_object().into_iter().flatten().filter(|(k, _)| known.is_none_or(|p| !p.contains_key(*k)));
                wrong.extend(more.flat_map(|(k, v)| deep(rule, v, &format!("{at}.{k}"))));
            }
            "allOf" => wrong.extend(rule.as_array().unwrap().iter().flat_map(|s| deep(s, value, at))),
            "anyOf" if !rule.as_array().unwrap().iter().any(fits) => wrong.push(format!("{at}: {value} fits none")),
            "oneOf" if rule.as_array().unwrap().iter().filter(|s| fits(s)).count() != 1 => {
                wrong.push(format!("{at}: {value} does not fit one"));
            }
            "anyOf" | "oneOf" => {}
            "if" if fits(rule) => wrong.extend(deep(&schema["then"], value, at)),
            "if" => {}
            other => panic!("keyword {other} at {at}"),
        }
    }
    wrong
}

pub fn json(toml: &str) -> Value {
    serde_json::to_value(toml.parse::<toml::Table>().unwrap()).unwrap()
}

/// Every TOML file below a folder.
fn files(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && path.file_name().is_some_and(|n| n != "runs") {
            files(&path, all);
        } else if path.extension().is_some_and(|e| e == "toml") {
            all.push(path);
        }
    }
}

#[test]
fn every_file_of_the_repository_fits_its_schema() {
    let (study, dataset) = (misfit(&["schema", "study"]), misfit(&["schema", "dataset"]));
    let mut all = Vec::new();
    ["studies", "datasets"].iter().for_each(|f| files(&Path::new(env!("CARGO_MANIFEST_DIR")).join(f), &mut all));
    let (mut studies, mut datasets) = (0, 0);
    for path in all {
        let value = json(&std::fs::read_to_string(&path).unwrap());
        let schema = match (value.get("test").is_some(), value.get("effect").is_some() && value.get("dataset").is_some()) {
            (true, _) => {
                datasets += 1;
                &dataset
            }
            (_, true) => {
                studies += 1;
                &study
            }
            _ => continue,
        };
        let wrong = against(schema, schema, &value, "");
        assert!(wrong.is_empty(), "{}: {wrong:#?}", path.display());
    }
    assert!(studies > 12 && datasets > 8, "{studies} studies and {datasets} datasets");
}

/// Takes the path of a key and what misspells it.
type Each<'a> = dyn FnMut(&str, &dyn Fn(&mut Value)) + 'a;

/// Misspells every key of the value in turn, but for names that a user gives.
fn misspelt(value: &Value, at: &str, each: &mut Each) {
    match value {
        Value::Object(map) => {
            for (key, inner) in map {
                let path = format!("{at}/{key}");
                if !at.ends_with("/conditions") && !at.ends_with("/states") {
                    each(&path, &|whole: &mut Value| {
                        let table = whole.pointer_mut(at).unwrap().as_object_mut().unwrap();
                        let old = table.remove(key).unwrap();
                        table.insert(format!("{key}{}", key.chars().last().unwrap()), old);
                    });
                }
                misspelt(inner, &path, each);
            }
        }
        Value::Array(list) => list.iter().enumerate().for_each(|(k, v)| misspelt(v, &format!("{at}/{k}"), each)),
        _ => {}
    }
}

#[test]
fn a_misspelt_key_is_refused_wherever_it_stands() {
    for (name, text) in [("study", every_key::STUDY), ("dataset", every_key::DATASET)] {
        let (schema, whole) = (misfit(&["schema", name]), json(text));
        let wrong = against(&schema, &schema, &whole, "");
        assert!(wrong.is_empty(), "{name}: {wrong:#?}");
        let mut tried = 0;
        misspelt(&whole, "", &mut |path, damage| {
            let mut damaged = whole.clone();
            damage(&mut damaged);
            assert!(!against(&schema, &schema, &damaged, "").is_empty(), "{name}: {path} may be misspelt");
            tried += 1;
        });
        assert!(tried > 100, "{name}: {tried} keys");
    }
}

/// Runs a verb and holds what it prints to its schema.
fn fits(verb: &str, more: &[&str]) -> Value {
    let schema = misfit(&["schema", verb]);
    let printed = misfit(&[&[verb], more].concat());
    let wrong = against(&schema, &schema, &printed, "");
    assert!(wrong.is_empty(), "{verb}: {wrong:#?}");
    // A result of another shape is seen, whichever key is missing.
    for key in schema["required"].as_array().unwrap_or_else(|| panic!("{verb}: {schema}")) {
        let mut less = printed.clone();
        less.as_object_mut().unwrap().remove(key.as_str().unwrap());
        assert!(!against(&schema, &schema, &less, "").is_empty(), "{verb} without {key}");
    }
    printed
}

#[test]
fn what_the_verbs_print_fits_their_schemas() {
    let dir = super::tolerance::folder(&[0.1, 0.2, 0.3], &[0.2, 0.25]);
    let study = dir.path().to_str().unwrap();
    for verb in ["check", "fit", "compare", "predict"] {
        fits(verb, &[study]);
    }
    for args in [&["effects"][..], &["effects", "coulomb"], &["schema"]] {
        let (schema, value) = (misfit(&["schema", args[0]]), misfit(args));
        let wrong = against(&schema, &schema, &value, "");
        assert!(wrong.is_empty(), "{args:?}: {wrong:#?}");
    }
    let run = Command::new(env!("CARGO_BIN_EXE_misfit")).args(["schema", "stduy", "--json"]).output().unwrap();
    assert_eq!(run.status.code(), Some(1));
    let (schema, value) = (misfit(&["schema", "error"]), serde_json::from_slice::<Value>(&run.stdout).unwrap());
    assert!(against(&schema, &schema, &value, "").is_empty(), "{value}");
    assert!(value["error"]["accepted"].as_str().unwrap().contains("study, dataset"), "{value}");
}

/// A friction that the model lacks, so that there is something to diagnose and to add.
#[test]
fn what_the_searching_and_writing_verbs_print_fits_their_schemas() {
    let rig = Rig::hiding(|_, v| 2.0 * (v / 0.05).tanh());
    let study = rig.folder().to_str().unwrap();
    assert!(!fits("diagnose", &[study])["candidates"].as_array().unwrap().is_empty());
    assert!(!fits("ladder", &[study])["missing"].as_array().unwrap().is_empty());
    for options in [&["--to", "json,csv,parquet,adams,exudyn"][..], &["--to", "json"]] {
        fits("export", &[&[study], options].concat());
    }
    fits("report", &[study]);
    fits("simulate", &[study, "--noise", "1 %", "--out", rig.path("rig").to_str().unwrap()]);
    fits("add", &[study, "coulomb", "--at", "c1.x"]);
    let (made, csv) = (rig.path("made"), rig.path("data/loop1.csv"));
    fits("new", &[made.to_str().unwrap(), "--from", csv.to_str().unwrap()]);
    let broken = rig.path("broken.csv");
    std::fs::write(&broken, "t,x,F\n0,1\n").unwrap();
    let some = fits("new", &[rig.path("some").to_str().unwrap(), "--from", csv.to_str().unwrap(), broken.to_str().unwrap()]);
    assert_eq!(some["left_out"].as_array().map(Vec::len), Some(1));
}

#[test]
fn what_trial_prints_fits_its_schema() {
    let dir = tempfile::tempdir().unwrap();
    let out = |name: &str| dir.path().join(name).display().to_string();
    let clean = ["--cases", "2", "--models", "connector", "--kinds", "one,none"];
    assert_eq!(fits("trial", &[&clean[..], &["--out", &out("clean")]].concat())["cases"], 2);
    let real = fits("trial", &["--cases", "2", "--models", "connector", "--kinds", "none", "--only", "white", "--out", &out("real")]);
    assert!(real["realistic"].is_object());
}
