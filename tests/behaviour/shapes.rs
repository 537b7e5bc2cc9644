//! The JSON of every verb, key by key as contract.md has it (more may stand beside).

use serde_json::Value;

use super::rig::{Rig, misfit};

/// Holds the keys of `wanted` against `value`; a list holds every element against its one example; strings in `wanted` name types.
fn holds(value: &Value, wanted: &Value, path: &str) {
    match wanted {
        Value::Object(map) => {
            for (key, inner) in map {
                let there = value.get(key).unwrap_or_else(|| panic!("{path}.{key} is missing in {value}"));
                holds(there, inner, &format!("{path}.{key}"));
            }
        }
        Value::Array(one) => {
            let list = value.as_array().unwrap_or_else(|| panic!("{path} is no list: {value}"));
            list.iter().enumerate().for_each(|(k, v)| holds(v, &one[0], &format!("{path}[{k}]")));
        }
        Value::String(kind) => {
            let fits = |kind: &str| match kind {
                "text" => value.is_string(),
                "number" => value.is_number(),
                "bool" => value.is_boolean(),
                "null" => value.is_null(),
                word => value.as_str() == Some(word),
            };
            assert!(kind.split('|').any(fits), "{path} is {value}, not {kind}");
        }
        other => panic!("{other}"),
    }
}

fn shape(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

const TESTS: &str = r#"[{"id":"text","kind":"cycle|frf|transient|modal|energy","split":"fit|select|held_out","error":"number","floor":"number","whitened_rms":"number"}]"#;

fn fit_shape() -> String {
    format!(
        r#"{{"study":"text","termination":"converged|stalled|max_iterations|interrupted|failed","cost":"number","n_residuals":"number",
        "n_free":"number","wall_s":"number","tests":{TESTS},
        "parameters":[{{"name":"text","value":"number","unit":"text","std":"number|null","identifiable":"bool","at_bound":"bool"}}],
        "effects":[{{"effect":"text","at":"text"}}],
        "model_error":[{{"kind":"text","channel":"text","relative":"number"}}],"scatter":[{{"parameter":"text","relative":"number"}}]}}"#
    )
}

#[test]
fn fit() {
    let rig = Rig::new();
    let json = rig.json("fit", &[]);
    holds(&json, &shape(&fit_shape()), "fit");
    assert_eq!(json["tests"].as_array().unwrap().len(), 3);
    assert_eq!(json["parameters"].as_array().unwrap().len(), 2);
    let splits: Vec<&str> = json["tests"].as_array().unwrap().iter().map(|t| t["split"].as_str().unwrap()).collect();
    assert_eq!(splits, ["fit", "select", "held_out"]);
}

#[test]
fn compare() {
    let json = Rig::new().json("compare", &[]);
    holds(&json, &shape(&format!(r#"{{"tests":{TESTS}}}"#)), "compare");
    holds(&json, &shape(r#"{"tests":[{"worst":{"where":"text","measured":"number","computed":"number"}}]}"#), "compare");
    // The start of the study is far from the truth, and the comparison does not fit.
    assert!(json["tests"][0]["error"].as_f64().unwrap() > 0.1, "{json}");
}

#[test]
fn check() {
    let json = Rig::new().json("check", &[]);
    holds(
        &json,
        &shape(r#"{"ok":"bool","problems":[{"where":"text","message":"text"}],"free":[{"name":"text","moves_residual":"bool"}]}"#),
        "check",
    );
    assert_eq!(json["ok"], true);
    assert_eq!(json["free"].as_array().unwrap().len(), 2);
}

#[test]
fn diagnose() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let json = rig.json("diagnose", &[]);
    let wanted = r#"{"findings":[{"test":"text","claim":"text","number":"number","threshold":"number","power":"number"}],
        "candidates":[{"effect":"text","at":"text","predicted_drop":"number","error_before":"number","error_after":"number|null","accepted":"bool","tied_with":["text"]}],
        "verdict":"missing|nothing_missing|unexplained","missing":[{"effect":"text","at":"text"}]}"#;
    holds(&json, &shape(wanted), "diagnose");
    assert!(json.get("next_test").is_some(), "{json}");
    assert!(!json["candidates"].as_array().unwrap().is_empty());
}

#[test]
fn ladder() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let before = rig.read("study.toml");
    let json = rig.json("ladder", &[]);
    let wanted = format!(
        r#"{{"rungs":[{{"removed":[{{"effect":"text","at":"text"}}],"tests":{TESTS}}}],"verdict":"missing|nothing_missing|unexplained",
        "proven":"bool","why":"text","missing":[{{"effect":"text","at":"text","tied_with":["text"],"proven":"bool|null"}}],"remainder":"number",
        "instruments":[{{"effect":"text","at":"text","why":"text"}}],
        "corrections":[{{"parameter":"text","at":"text","relative":"number","std":"number"}}],"held_out":{{"before":"number","after":"number","floor":"number"}}}}"#
    );
    holds(&json, &shape(&wanted), "ladder");
    assert!(json["rungs"][0]["added"].is_null());
    assert_eq!(rig.read("study.toml"), before, "the study of the user is never written over");
    // The result is a study of its own, which can be fitted where it lies.
    let result = json["result_study"].as_str().unwrap();
    let again = misfit(&["fit", result, "--json", "--out", &rig.path("again").display().to_string()]);
    assert_eq!(again.code, 0, "{}", again.stderr);
}

#[test]
fn add() {
    let json = Rig::hiding(|_, v| 1.5 * v.signum()).json("add", &["coulomb", "--at", "c1.x"]);
    holds(&json, &shape(&format!(r#"{{"before":{0},"after":{0}}}"#, fit_shape())), "add");
    assert!(json["after"]["cost"].as_f64() < json["before"]["cost"].as_f64());
}

#[test]
fn predict() {
    let rig = Rig::new();
    let json = with_predictions(&rig).json("predict", &[]);
    let wanted = r#"{"predictions":[{"case":"text","quantity":"text","unit":"text","value":"number","std":"number|null","reference":"number|null","relative_error":"number|null"}]}"#;
    holds(&json, &shape(wanted), "predict");
    assert_eq!(json["predictions"].as_array().unwrap().len(), 4);
}

pub fn with_predictions(rig: &Rig) -> &Rig {
    let mut study = rig.read("study.toml");
    for (quantity, more) in [
        ("W_D", "reference = \"1.9739208802178716 mJ\""),
        ("W_s", ""),
        ("W_s", "W_s_reading = \"product\""),
        ("stiffness", "reference = \"20 N/mm\""),
    ] {
        study += &format!(
            "[[prediction]]\ncase = \"1 mm\"\nquantity = \"{quantity}\"\nat = \"c1.x\"\ncontrol = \"displacement\"\namplitude = \"1 mm\"\n\
             conditions = {{ frequency = \"1 Hz\" }}\n{more}\n"
        );
    }
    rig.write("study.toml", &study);
    rig
}

#[test]
fn export() {
    let json = Rig::new().json("export", &["--to", "json,csv,parquet"]);
    holds(&json, &shape(r#"{"files":["text"]}"#), "export");
    assert_eq!(json["files"].as_array().unwrap().len(), 5);
}

#[test]
fn report() {
    let rig = Rig::new();
    let json = rig.json("report", &[]);
    holds(&json, &shape(r#"{"file":"text"}"#), "report");
    let html = std::fs::read_to_string(json["file"].as_str().unwrap()).unwrap();
    assert!(html.contains("<html"), "no page");
}

#[test]
fn simulate() {
    let json = Rig::new().json("simulate", &[]);
    holds(&json, &shape(r#"{"dataset":"text"}"#), "simulate");
    assert_eq!(json["tests"].as_array().unwrap().len(), 3);
}

#[test]
fn effects() {
    let ran = misfit(&["effects", "--json"]);
    assert_eq!(ran.code, 0);
    let json = ran.json();
    let wanted = r#"{"effects":[{"effect":"text","role":"force|series|coefficient|channel|geometry","claim":"text","equation":"text",
        "parameters":[{"name":"text","unit":"text","sign":"text"}],"family":"text"}]}"#;
    holds(&json, &shape(wanted), "effects");
    assert!(json["effects"].as_array().unwrap().len() >= 15);
    let one = misfit(&["effects", "film", "--json"]).json();
    assert_eq!(one["effects"].as_array().unwrap().len(), 1);
    let [stage, _, message, _] = misfit(&["effects", "flim", "--json"]).error();
    assert_eq!(stage, "effect");
    assert!(message.contains("film"), "{message}");
}
