//! Two candidates beside each other, modes, profiles, and runs that are gone on with.

use std::process::Stdio;

use serde_json::{Value, json};

use super::browser::{click, press};
use super::client::Served;
use super::devtools::Browser;
use crate::rig::{K, Rig, program};

fn hiding() -> Rig {
    Rig::hiding(|_, v| 1.5 * v.signum())
}

#[test]
fn two_candidates_are_refitted_and_seen_beside_each_other() {
    let rig = hiding();
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    click(&mut browser, "#do-score");
    browser.until("document.querySelectorAll('.candidate').length > 5", 60);
    browser.eval("document.querySelector('.place[aria-label^=c1]').dispatchEvent(new MouseEvent('click', { bubbles: true }))");
    browser.until("document.querySelector('#view-structure .large-head h2').textContent === 'At c1.x'", 5);
    let row = |effect: &str| format!("[...document.querySelectorAll('.candidate')].find(c => c.textContent.startsWith('{effect}'))");
    browser.eval(&format!("{}.click()", row("coulomb")));
    assert_eq!(browser.eval("document.querySelectorAll('.candidate[aria-expanded=true]').length"), 1);
    press(&mut browser, "Set beside another");
    assert_eq!(
        browser.eval("document.querySelectorAll('button[aria-pressed=true]').length"),
        1,
        "a reader of the screen hears that it is chosen"
    );
    browser.eval(&format!("{}.click()", row("cubic stiffness")));
    press(&mut browser, "Refit coulomb and cubic_stiffness");
    browser.until("document.querySelectorAll('#view-compare .pair-head').length === 2", 90);
    assert_eq!(browser.eval("document.getElementById('view-compare').hidden"), false);
    let heads = browser.eval("[...document.querySelectorAll('.pair-head h2')].map(h => h.textContent).join('|')");
    assert_eq!(heads, "+ coulomb at c1.x|+ cubic_stiffness at c1.x");
    // Each test stands there twice, its curves those of its own model, the measured ones the same.
    let curves =
        |class: &str| format!("[...document.querySelectorAll('.pairs .card:not(.sealed) .{class}')].map(p => p.getAttribute('d'))");
    assert_eq!(browser.eval(&format!("{}.length", curves("computed"))), 4);
    assert_eq!(browser.eval(&format!("(([a, b]) => a !== b)({})", curves("computed"))), true, "two models, two curves");
    assert_eq!(browser.eval(&format!("(([a, b]) => a === b)({})", curves("measured"))), true, "one measurement in one frame");
    let state = served.state();
    let errors: Vec<f64> = ["coulomb", "cubic_stiffness"]
        .iter()
        .map(|e| {
            state["models"].as_array().unwrap().iter().find(|m| m["added"]["effect"] == *e).unwrap()["errors"]["fit"]["error"]
                .as_f64()
                .unwrap()
        })
        .collect();
    assert!(errors[0] < 0.5 * errors[1], "{errors:?}");
    // The choice outlives a reload, and ends with it.
    browser.call("Page.reload", json!({}));
    browser.until("document.querySelectorAll('#view-compare .pair-head').length === 2", 20);
    browser.eval("{ const s = document.querySelector('#view-compare select'); s.value = ''; s.dispatchEvent(new Event('change')); }");
    browser.until("document.querySelectorAll('#view-compare .pair-head').length === 0 && document.querySelectorAll('#view-compare .card').length === 3", 10);
}

/// A mass of 2 kg on a spring of 15 N/mm.
fn with_mass() -> Rig {
    let rig = Rig::new();
    rig.change("study.toml", "name = \"end\"", "name = \"end\"\nmass = \"2 kg\"");
    rig.change("study.toml", "start = \"0.3 N s/mm\"", "start = \"0.01 N s/mm\"");
    rig
}

#[test]
fn modes_move_over_the_picture_unless_the_reader_wants_no_motion() {
    let rig = with_mass();
    let served = Served::start(rig.folder(), &["--json"]);
    let found = served.post("modes", &json!({ "model": "study" })).json();
    let (k, c, m): (f64, f64, f64) = (15e3, 10.0, 2.0);
    let mode = &found["modes"][0];
    let near = |value: &Value, truth: f64| assert!((value.as_f64().unwrap() / truth - 1.0).abs() < 1e-6, "{value} is not {truth}");
    near(&mode["frequency"], (k / m).sqrt() / std::f64::consts::TAU);
    near(&mode["damping"], c / (2.0 * (k * m).sqrt()));
    assert_eq!(found["modes"].as_array().unwrap().len(), 1, "{found}");
    assert_eq!(served.post("modes", &json!({ "model": "study", "test": "none such" })).status, 400);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    click(&mut browser, "#tab-structure");
    click(&mut browser, "#show-modes");
    browser.until("document.querySelector('#mode')?.selectedOptions[0].textContent.startsWith('1: 13.78 Hz, damping 2.89 %')", 10);
    let place = "[...document.querySelectorAll('.structure g[transform]')].map(g => g.getAttribute('transform')).join()";
    let first = browser.eval(place);
    browser.until(&format!("{place} !== {first}"), 5);
    assert_eq!(browser.eval("document.querySelectorAll('.structure .rest').length"), 1, "where it lies at rest is seen");
    press(&mut browser, "Pause");
    let stands = |browser: &mut Browser| {
        let before = browser.eval(place);
        std::thread::sleep(std::time::Duration::from_millis(300));
        assert_eq!(browser.eval(place), before);
        before
    };
    stands(&mut browser);
    assert_eq!(browser.eval("document.activeElement.id"), "play", "the focus stays where it was");
    // Who wants no motion sees the shape at its largest, and may still let it move.
    browser.call("Emulation.setEmulatedMedia", json!({ "features": [{ "name": "prefers-reduced-motion", "value": "reduce" }] }));
    browser.call("Page.reload", json!({}));
    click(&mut browser, "#show-modes");
    browser.until("document.querySelector('#play')?.textContent === 'Play'", 20);
    let largest = stands(&mut browser);
    assert!(largest.as_str().unwrap().contains("translate(22 "), "{largest}");
    press(&mut browser, "Play");
    browser.until(&format!("{place} !== {largest}"), 5);
}

#[test]
fn a_profile_is_computed_on_demand_and_kept() {
    let rig = Rig::new();
    let served = Served::start(rig.folder(), &["--json"]);
    let k = "c1.x.linear_stiffness.k";
    let refused = served.run(&json!({ "verb": "profile", "model": "study", "parameter": "c1.x.viscous.mu" }));
    assert_eq!(refused["status"], "failed", "{refused}");
    assert!(rig.runs().is_empty(), "what comes to nothing leaves nothing");
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    click(&mut browser, "#tab-parameters");
    click(&mut browser, &format!("button[aria-label='Profile of {k}']"));
    browser.until("document.querySelector('figure.profile')", 60);
    let told = browser.eval("document.querySelector('figure.profile figcaption').textContent").to_string();
    assert!(told.contains(k) && told.contains("95 % interval by profile") && told.contains("N/mm"), "{told}");
    let profile = |served: &Served| {
        let model = served.get(&format!("/api/studies/{}/models/study", served.study)).json();
        model["parameters"].as_array().unwrap().iter().find(|p| p["name"] == k).unwrap()["profile"].clone()
    };
    let found = profile(&served);
    let (low, high) = (found["interval"][0].as_f64().unwrap(), found["interval"][1].as_f64().unwrap());
    assert!(low < K * 1e3 && K * 1e3 < high && high - low < 0.01 * K * 1e3, "{found}");
    // The verb comes to the same, and a server that is started again knows it.
    let verb = rig.json("fit", &["--profile", k]);
    let theirs = &verb["profiles"][0]["interval"];
    assert!((theirs[0].as_f64().unwrap() / low - 1.0).abs() < 1e-6 && (theirs[1].as_f64().unwrap() / high - 1.0).abs() < 1e-6, "{theirs}");
    drop(served);
    let again = Served::start(rig.folder(), &["--json"]);
    assert_eq!(again.state()["models"].as_array().unwrap().len(), 2, "the verb's fit is a model, a profile is none");
    assert_eq!(profile(&again), found);
}

fn unfinished(served: &Served) -> Vec<String> {
    served.state()["unfinished"].as_array().unwrap().iter().map(|u| u["id"].as_str().unwrap().to_string()).collect()
}

#[test]
fn a_fit_that_was_killed_goes_on_from_its_best_state() {
    let rig = Rig::new();
    let served = Served::start(rig.folder(), &["--json"]);
    let first = served.run(&json!({ "verb": "fit", "model": "study" }));
    let done = rig.path("runs").join(first["result"]["model"].as_str().unwrap());
    // What a fit leaves that was killed before its end.
    let killed = "20260101-000000-fit";
    std::fs::create_dir(rig.path("runs").join(killed)).unwrap();
    std::fs::copy(done.join("checkpoint.json"), rig.path("runs").join(killed).join("checkpoint.json")).unwrap();
    assert_eq!(unfinished(&served), [killed]);
    let order = |run: &str| json!({ "verb": "resume", "model": "study", "resume": run });
    for other in ["../../data", "20260101-000001-fit", "", done.file_name().unwrap().to_str().unwrap()] {
        assert_eq!(served.post("run", &order(other)).status, 400, "{other}");
    }
    // The order of another verb names no run.
    let odd = served.run(&json!({ "verb": "fit", "model": "study", "resume": "../../data" }));
    assert_eq!(odd["status"], "done", "{odd}");
    let begun = served.post("run", &order(killed)).json();
    assert!(begun["command"].as_str().unwrap().contains("--resume "), "{begun}");
    let ended = served.wait(&begun["job"]);
    let run = ended["result"]["model"].as_str().unwrap_or_else(|| panic!("{ended}"));
    let result = |run: &str| -> Value { serde_json::from_str(&rig.read(&format!("runs/{run}/result.json"))).unwrap() };
    assert_eq!(result(run)["workbench"]["resumed"], killed);
    assert!(unfinished(&served).is_empty(), "it was gone on with");
    let whole = result(first["result"]["model"].as_str().unwrap());
    assert!((result(run)["cost"].as_f64().unwrap() / whole["cost"].as_f64().unwrap() - 1.0).abs() < 1e-6);
}

/// A ladder of the command line that was killed on its way; its run.
#[cfg(unix)]
fn killed_ladder(rig: &Rig) -> std::path::PathBuf {
    // On a busy machine the ladder may come to its end before it is seen.
    for _ in 0..5 {
        let mut ladder = program().args(["ladder", &rig.folder().display().to_string(), "--json"]).stdout(Stdio::null()).spawn().unwrap();
        while ladder.try_wait().unwrap().is_none() {
            let lines = |run: &std::path::Path| std::fs::read_to_string(run.join("fits.journal")).map_or(0, |text| text.lines().count());
            if let Some(run) = rig.runs().into_iter().find(|run| lines(run) > 10) {
                ladder.kill().unwrap();
                ladder.wait().unwrap();
                if !run.join("result.json").exists() {
                    return run;
                }
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
    panic!("no ladder was killed between its first fits and its end");
}

#[cfg(unix)]
#[test]
fn a_ladder_killed_on_the_command_line_goes_on_there_and_on_the_page() {
    let rig = hiding();
    let killed = killed_ladder(&rig);
    let name = killed.file_name().unwrap().to_str().unwrap().to_string();
    let costs = |result: &Value| -> Vec<Value> { result["rungs"].as_array().unwrap().iter().map(|r| r["cost"].clone()).collect() };
    let had = |result: &Value| (costs(result), result["missing"].as_array().unwrap().len(), result["verdict"].clone());
    let wanted = had(&rig.json("ladder", &["--out", &rig.path("whole").display().to_string()]));
    assert!(wanted.1 == 1 && wanted.2 == "missing", "{wanted:?}");
    let run = killed.display().to_string();
    let second = rig.path("second");
    let of_verb = rig.json("ladder", &["--resume", &run, "--out", &second.display().to_string()]);
    assert_eq!(had(&of_verb), wanted);
    assert!(second.join("study.toml").is_file() && !second.join("fits.journal").exists(), "the result takes the place of the journal");
    let served = Served::start(rig.folder(), &["--json"]);
    assert_eq!(unfinished(&served), std::slice::from_ref(&name));
    let begun = served.post("run", &json!({ "verb": "resume", "model": "study", "resume": name })).json();
    assert!(begun["command"].as_str().unwrap().ends_with(&format!("--resume {run}")), "{begun}");
    let ended = served.wait(&begun["job"]);
    let model = ended["result"]["model"].as_str().unwrap_or_else(|| panic!("{ended}"));
    let of_page: Value = serde_json::from_str(&rig.read(&format!("runs/{model}/result.json"))).unwrap();
    assert_eq!(had(&of_page), wanted);
    assert!(unfinished(&served).is_empty());
    // The folder of a killed ladder is a run, and may be written over where it is named; one without a journal cannot be gone on with.
    assert_eq!(rig.json("ladder", &["--out", &run])["missing"][0]["effect"], "coulomb");
    let ran = rig.run("ladder", &["--json", "--resume", &rig.path("data").display().to_string()]);
    assert!(ran.error()[2].contains("no fits of an earlier ladder"), "{}", ran.stdout);
}

/// A ladder that is stopped on the page is climbed again from where it began, with the values that it was ordered with.
#[test]
fn a_ladder_stopped_on_the_page_ends_as_an_undisturbed_one() {
    let rig = hiding();
    let served = Served::start(rig.folder(), &["--json"]);
    let order = json!({ "verb": "ladder", "model": "study", "values": { "0.0": 23e3 } });
    let whole = served.run(&order);
    let begun = served.post("run", &order).json();
    let lines = |run: &std::path::Path| std::fs::read_to_string(run.join("fits.journal")).map_or(0, |text| text.lines().count());
    while !rig.runs().iter().any(|run| lines(run) > 10) {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    assert_eq!(served.post("stop", &json!({ "job": begun["job"] })).status, 200);
    let ended = served.wait(&begun["job"]);
    assert_eq!(ended["status"], "stopped", "{ended}");
    let stopped = ended["result"]["model"].as_str().unwrap();
    let begun = served.post("run", &json!({ "verb": "resume", "model": stopped, "resume": stopped })).json();
    let command = begun["command"].as_str().unwrap();
    assert!(
        command.starts_with(&format!("misfit ladder {} --resume ", rig.folder().display())) && command.contains("--start"),
        "{command}"
    );
    let ended = served.wait(&begun["job"]);
    let result = |ended: &Value| -> Value {
        let model = ended["result"]["model"].as_str().unwrap_or_else(|| panic!("{ended}"));
        serde_json::from_str(&rig.read(&format!("runs/{model}/result.json"))).unwrap()
    };
    let (again, whole) = (result(&ended), result(&whole));
    let told = |r: &Value| (r["missing"].clone(), r["verdict"].clone(), r["rungs"][1]["cost"].clone(), r["rungs"][0]["cost"].clone());
    assert_eq!(told(&again), told(&whole));
    assert_eq!((&again["workbench"]["parent"], &again["workbench"]["resumed"]), (&json!("study"), &json!(stopped)));
}

#[cfg(unix)]
#[test]
fn a_ladder_of_the_page_that_was_killed_goes_on() {
    let rig = hiding();
    let mut served = Served::start(rig.folder(), &["--json"]);
    assert_eq!(served.post("run", &json!({ "verb": "ladder", "model": "study" })).status, 200);
    let order = || rig.runs().into_iter().find(|r| r.join("workbench.json").is_file());
    while order().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    assert!(served.state()["unfinished"].as_array().unwrap().is_empty(), "what runs is not unfinished");
    served.signal("-KILL");
    let Some(killed) = order() else { panic!("the ladder had come to its end") };
    let served = Served::start(rig.folder(), &["--json"]);
    let name = killed.file_name().unwrap().to_str().unwrap().to_string();
    assert_eq!(unfinished(&served), std::slice::from_ref(&name));
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    click(&mut browser, "#tab-models");
    browser.until(&format!("document.querySelector('.unfinished').textContent.includes({name:?})"), 10);
    click(&mut browser, ".unfinished button");
    browser.until("document.getElementById('model-name').textContent.startsWith('ladder: ')", 120);
    click(&mut browser, "#tab-ladder");
    browser.until("document.getElementById('view-ladder').textContent.includes('coulomb at c1.x')", 10);
    assert!(unfinished(&served).is_empty());
    assert_eq!(browser.eval("document.querySelectorAll('.unfinished').length"), 0);
}
