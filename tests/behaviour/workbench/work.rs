//! Compare, score, add, undo, save; reload, restart, two readers.

use serde_json::{Value, json};

use super::client::{Served, error};
use crate::rig::{Rig, misfit};

/// A rig that hides a dry friction of 1.5 N.
fn hiding() -> Rig {
    Rig::hiding(|_, v| 1.5 * v.signum())
}

fn candidate<'a>(ended: &'a Value, effect: &str) -> &'a Value {
    let all = ended["result"]["candidates"].as_array().unwrap_or_else(|| panic!("{ended}"));
    all.iter().find(|c| c["effect"] == effect && c["at"] == "c1.x").unwrap_or_else(|| panic!("{effect} is no candidate: {ended}"))
}

#[test]
fn the_missing_effect_is_seen_added_undone_and_saved() {
    let rig = hiding();
    rig.write("study.toml", &("# my own words\n".to_string() + &rig.read("study.toml")));
    let own = rig.read("study.toml");
    let served = Served::start(rig.folder(), &["--json"]);
    let before = served.compare("study", &json!({}));
    let fit = served.run(&json!({ "verb": "fit", "model": "study" }));
    let fitted = fit["result"]["model"].as_str().unwrap_or_else(|| panic!("{fit}")).to_string();
    let tests = served.compare(&fitted, &json!({}));
    assert!(error(&tests, "loop-1Hz") < error(&before, "loop-1Hz"), "a fit comes closer");
    let curve = &tests[0]["curves"][0];
    assert_eq!((curve["unit"].as_str(), curve["x_unit"].as_str()), (Some("N"), Some("mm")), "the units of the data");
    assert_eq!(curve["measured"].as_array().unwrap().len(), curve["computed"].as_array().unwrap().len());

    let scored = served.run(&json!({ "verb": "score", "model": fitted }));
    let best = &scored["result"]["candidates"][0];
    assert_eq!(best["places"], json!(["c1.x"]));
    assert!(best["predicted_drop"].as_f64().unwrap() > 0.7 && best["p_value"].as_f64().unwrap() < 0.01, "{best}");
    let friction = candidate(&scored, "coulomb");
    assert!(friction["predicted_drop"].as_f64().unwrap() > 0.7 && !friction["equation"].as_str().unwrap().is_empty(), "{friction}");

    let order = json!({ "verb": "add", "model": fitted, "effect": "coulomb", "at": "c1.x", "set": friction["set"] });
    let added = served.run(&order);
    let with = added["result"]["model"].as_str().unwrap_or_else(|| panic!("{added}")).to_string();
    let after = served.compare(&with, &json!({}));
    assert!(error(&after, "loop-1Hz") < 0.4 * error(&tests, "loop-1Hz"), "{} {}", error(&after, "loop-1Hz"), error(&tests, "loop-1Hz"));
    assert_eq!(rig.read("study.toml"), own, "the reader's file is as it was");

    // Undo is going back to the model it was made from; both stay in the tree, and a second effect branches there.
    let state = served.state();
    let node = |id: &str| state["models"].as_array().unwrap().iter().find(|m| m["id"] == id).unwrap().clone();
    assert_eq!((node(&with)["parent"].as_str(), node(&fitted)["parent"].as_str()), (Some(&*fitted), Some("study")));
    assert_eq!(node(&with)["added"], json!({ "effect": "coulomb", "at": "c1.x" }));
    assert!((error(&served.compare(&fitted, &json!({})), "loop-1Hz") - error(&tests, "loop-1Hz")).abs() < 1e-9);

    // From the study as it stands an effect is held against the fit, not against the starting values.
    let direct = served.run(&json!({ "verb": "add", "model": "study", "effect": "coulomb", "at": "c1.x" }));
    let direct = direct["result"]["model"].as_str().unwrap_or_else(|| panic!("{direct}")).to_string();
    let was = served.post("compare", &json!({ "model": direct, "before": true })).json();
    let was = was["tests"].as_array().unwrap();
    assert!((error(was, "loop-1Hz") / error(&tests, "loop-1Hz") - 1.0).abs() < 1e-6 && error(was, "loop-1Hz") < error(&before, "loop-1Hz"));

    let saved = served.post("save", &json!({ "model": with, "name": "with-friction" }));
    assert_eq!(saved.status, 200, "{}", String::from_utf8_lossy(&saved.body));
    let text = rig.read("with-friction.toml");
    let lines = own.lines().count();
    let other: Vec<&str> = own.lines().zip(text.lines()).filter(|(a, b)| a != b).map(|(_, b)| b).collect();
    assert!(other.len() == 2 && other[0].starts_with("k = { start = ") && other[1].starts_with("c = { start = "), "{other:?}");
    assert!(other.iter().all(|l| l.contains(", min = \"0 N")), "the rest of the line stays: {other:?}");
    assert!(text.lines().skip(lines).any(|l| l.contains("coulomb")) && text.starts_with("# my own words"), "{text}");
    assert_eq!((&saved.json()["moved"], &saved.json()["kept"]), (&json!(true), &json!([])));
    let ran = misfit(&["compare", &rig.path("with-friction.toml").display().to_string(), "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let its_error = ran.json()["tests"][0]["error"].as_f64().unwrap();
    assert!((its_error / error(&after, "loop-1Hz") - 1.0).abs() < 1e-6, "it stands where the model stood: {its_error}");
    let again = served.post("save", &json!({ "model": with, "name": "with-friction" }));
    assert_eq!((again.status, rig.read("with-friction.toml")), (400, text), "nothing is written over");
    let exported = served.run(&json!({ "verb": "export", "model": with, "to": ["json", "csv"] }));
    let (files, run) =
        (exported["result"]["files"].as_array().unwrap_or_else(|| panic!("{exported}")), exported["result"]["run"].as_str().unwrap());
    assert!(files.len() >= 2 && files.iter().all(|f| std::path::Path::new(f.as_str().unwrap()).is_file()), "{exported}");
    let name = std::path::Path::new(files[0].as_str().unwrap()).file_name().unwrap().to_string_lossy().into_owned();
    assert_eq!(served.get(&format!("/api/studies/{}/runs/{run}/{name}", served.study)).status, 200, "{name} is given to the page");
    assert_eq!(served.run(&json!({ "verb": "export", "model": with, "to": ["xlsx"] }))["status"], "failed");
    std::fs::remove_dir_all(rig.path("runs").join(run)).unwrap();
    // Every run is one that the verbs write.
    for run in rig.runs() {
        for file in ["study.toml", "result.json", "residuals.parquet", "report.html"] {
            assert!(run.join(file).is_file(), "{} {file}", run.display());
        }
    }
}

#[test]
fn a_slider_moves_the_curves_and_nothing_else() {
    let rig = Rig::new();
    let served = Served::start(rig.folder(), &["--json"]);
    let model = served.get(&format!("/api/studies/{}/models/study", served.study)).json();
    let k = model["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "c1.x.linear_stiffness.k").unwrap();
    assert_eq!((k["unit"].as_str(), k["value"].as_f64(), k["free"].as_bool()), (Some("N/mm"), Some(15e3), Some(true)));
    let errors = |v: f64| error(&served.compare("study", &json!({ k["key"].as_str().unwrap(): v })), "loop-1Hz");
    assert!(errors(20e3) < errors(15e3) && errors(20e3) < errors(30e3), "the truth is 20 N/mm");
    for bad in [json!({ "9.9": 1.0 }), json!({ "x": 1.0 }), json!({ k["key"].as_str().unwrap(): -1.0 })] {
        let answer = served.post("compare", &json!({ "model": "study", "values": bad }));
        assert_eq!(answer.status, 400);
        let mut keys: Vec<String> = answer.json()["error"].as_object().unwrap().keys().cloned().collect();
        keys.sort();
        assert_eq!(keys, ["accepted", "message", "stage", "where"]);
    }
    assert!(rig.runs().is_empty(), "looking writes nothing");
}

#[test]
fn held_out_tests_are_sealed_until_they_are_opened_and_that_is_kept() {
    let rig = hiding();
    let served = Served::start(rig.folder(), &["--json"]);
    let fit = served.run(&json!({ "verb": "fit", "model": "study" }));
    let model = fit["result"]["model"].as_str().unwrap().to_string();
    let held = |served: &Served| served.compare(&model, &json!({})).iter().find(|t| t["id"] == "loop-5Hz").unwrap().clone();
    let sealed = held(&served);
    assert_eq!(sealed["sealed"], true);
    assert!(sealed.get("error").is_none() && sealed.get("curves").is_none(), "{sealed}");
    let node = |s: &Value| s["models"].as_array().unwrap().iter().find(|m| m["id"] == model).unwrap().clone();
    assert!(node(&served.state())["errors"]["held_out"].is_null());
    let written: Value = serde_json::from_slice(&std::fs::read(rig.path("runs").join(&model).join("result.json")).unwrap()).unwrap();
    assert!(written["tests"].as_array().unwrap().iter().all(|t| t["split"] != "held_out"), "what is sealed is not computed either");
    assert_eq!(served.post("open", &json!({ "model": model })).status, 200);
    assert!(held(&served)["error"].as_f64().is_some());
    drop(served);
    let again = Served::start(rig.folder(), &["--json"]);
    let state = again.state();
    assert_eq!(state["held_out_opened"][0]["by"], "reader", "{}", state["held_out_opened"]);
    assert!(held(&again)["error"].as_f64().is_some());
}

#[cfg(unix)]
#[test]
fn a_server_that_was_killed_in_the_middle_finds_its_runs() {
    let rig = hiding();
    let mut served = Served::start(rig.folder(), &["--json"]);
    let fit = served.run(&json!({ "verb": "fit", "model": "study" }));
    let model = fit["result"]["model"].as_str().unwrap().to_string();
    assert_eq!(served.post("run", &json!({ "verb": "ladder", "model": model })).status, 200);
    // A second order on the same study waits for nothing: it is refused.
    let busy = served.post("run", &json!({ "verb": "fit", "model": model }));
    assert!(busy.status == 409 || served.state()["jobs"][0]["ended"].is_object(), "{}", busy.status);
    assert_eq!(served.signal("-KILL"), None, "killed, not ended");
    let again = Served::start(rig.folder(), &["--json"]);
    let state = again.state();
    let found: Vec<&str> = state["models"].as_array().unwrap().iter().filter_map(|m| m["id"].as_str()).collect();
    assert!(found.contains(&&*model), "{found:?}");
    assert!(error(&again.compare(&model, &json!({})), "loop-1Hz") > 0.0);
    // And goes on from it.
    let added = again.run(&json!({ "verb": "add", "model": model, "effect": "coulomb", "at": "c1.x" }));
    assert_eq!(added["status"], "done", "{added}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_it_and_a_job_keeps_what_it_has() {
    let rig = hiding();
    let mut idle = Served::start(rig.folder(), &["--json"]);
    assert_eq!(idle.signal("-INT"), Some(0));
    let mut served = Served::start(rig.folder(), &[]);
    assert_eq!(served.post("run", &json!({ "verb": "ladder", "model": "study" })).status, 200);
    std::thread::sleep(std::time::Duration::from_millis(300));
    let code = served.signal("-INT");
    assert!(code == Some(130) || code == Some(0), "{code:?}");
    let results: Vec<_> = rig.runs().into_iter().filter(|r| r.join("result.json").is_file()).collect();
    assert_eq!(results.len(), 1, "the ladder wrote its result");
}

/// Who stops a ladder that has added nothing has not looked at the held-out tests, and has not been told that nothing is missing.
#[test]
fn a_ladder_stopped_with_nothing_added_leaves_the_held_out_tests_sealed() {
    let rig = hiding();
    let served = Served::start(rig.folder(), &["--json"]);
    let begun = served.post("run", &json!({ "verb": "ladder", "model": "study" })).json();
    assert_eq!(served.post("stop", &json!({ "job": begun["job"] })).status, 200);
    let ended = served.wait(&begun["job"]);
    assert_eq!((&ended["status"], &ended["result"]["missing"]), (&json!("stopped"), &json!([])), "{ended}");
    let state = served.state();
    assert_eq!(state["held_out_opened"], json!([]), "{}", state["held_out_opened"]);
    let run: Value = serde_json::from_str(&rig.read(&format!("runs/{}/result.json", ended["result"]["model"].as_str().unwrap()))).unwrap();
    assert!(run["held_out"]["after"].is_null() && run["interrupted"] == true, "{}", run["held_out"]);
    assert!(!state["jobs"][0]["lines"].to_string().contains("failed"), "what was stopped has not failed: {}", state["jobs"][0]["lines"]);
}

#[test]
fn a_ladder_is_watched_stopped_and_its_model_gone_on_with() {
    let rig = hiding();
    let served = Served::start(rig.folder(), &["--json"]);
    let begun = served.post("run", &json!({ "verb": "ladder", "model": "study" })).json();
    assert!(begun["command"].as_str().unwrap().starts_with("misfit ladder "), "{begun}");
    let ended = served.wait(&begun["job"]);
    assert_eq!(ended["status"], "done", "{ended}");
    let model = ended["result"]["model"].as_str().unwrap();
    let state = served.state();
    let job = &state["jobs"][0];
    assert!(job["lines"].as_array().unwrap().len() > 3 && job["cost"].as_array().unwrap().len() > 1, "{job}");
    let node = state["models"].as_array().unwrap().iter().find(|m| m["id"] == model).unwrap();
    assert_eq!(node["verdict"], "missing", "{node}");
    assert_eq!(node["missing"][0]["at"], "c1.x");
    assert_eq!(state["held_out_opened"][0]["by"], "ladder", "a ladder reads the held-out tests");
    assert_eq!(served.post("save", &json!({ "model": model, "name": "found" })).status, 200);
    assert!(rig.read("found.toml").contains("[[effect]]"));
}

#[test]
fn a_folder_of_studies_is_served_and_what_cannot_be_read_is_said() {
    let (one, other) = (Rig::new(), Rig::new());
    let folder = tempfile::tempdir().unwrap();
    for (rig, name) in [(&one, "first one"), (&other, "second")] {
        crate::handbook::copy(rig.folder(), &folder.path().join(name));
    }
    std::fs::write(folder.path().join("second/study.toml"), "schema = 1\ndataset = \"nowhere\"\n").unwrap();
    let served = Served::start(folder.path(), &["--json"]);
    let all = served.get("/api/studies").json();
    let ids: Vec<&str> = all["studies"].as_array().unwrap().iter().map(|s| s["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["first-one", "second"]);
    assert_eq!(served.state()["study"]["tests"].as_array().unwrap().len(), 3);
    let broken = served.get("/api/studies/second");
    assert_eq!((broken.status, broken.json()["error"]["stage"].as_str()), (400, Some("study")));
    let nowhere = folder.path().join("no-such-folder").display().to_string();
    let ran = misfit(&["serve", &nowhere, "--json"]);
    assert!(ran.error()[1].contains(&nowhere));
}

/// Pages ask while a ladder runs: every one is answered.
#[test]
fn twenty_pages_at_once_are_all_answered() {
    let rig = hiding();
    let served = Served::start(rig.folder(), &["--json"]);
    let begun = served.post("run", &json!({ "verb": "ladder", "model": "study" })).json();
    let pages = 20;
    let asked = std::thread::scope(|scope| {
        let page = |_| {
            scope.spawn(|| {
                for _ in 0..5 {
                    assert_eq!(served.get("/page/plotly.js").status, 200);
                    assert_eq!(served.state()["study"]["tests"].as_array().unwrap().len(), 3);
                    assert_eq!(served.compare("study", &json!({ "0.0": 21e3 })).len(), 3);
                }
                15
            })
        };
        let all: Vec<_> = (0..pages).map(page).collect();
        all.into_iter().map(|t| t.join().unwrap()).sum::<usize>()
    });
    assert_eq!(asked, 15 * pages);
    assert_eq!(served.wait(&begun["job"])["status"], "done");
    #[cfg(target_os = "linux")]
    {
        println!("{asked} requests of {pages} pages during a ladder; most memory {:.0} MB", served.memory());
        assert!(served.memory() < 1000.0, "{} MB", served.memory());
    }
}
