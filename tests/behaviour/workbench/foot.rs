//! The command at the foot of the page, as a shell runs it; studies that were saved, and runs made on runs.

use serde_json::{Value, json};

use super::browser::{ANSWER, click, press};
use super::client::{Served, error};
use super::devtools::Browser;
use super::errors::friction_that_grows;
use crate::rig::{Rig, misfit};

/// What a shell makes of a command line, with `--json`.
#[cfg(unix)]
fn in_shell(line: &str) -> Value {
    let program = crate::rig::program().get_program().to_os_string();
    let script = format!("misfit() {{ \"$MISFIT\" \"$@\" --json; }}; {line}");
    let done = std::process::Command::new("sh").args(["-c", &script]).env("MISFIT", program).output().unwrap();
    let out = String::from_utf8_lossy(&done.stdout).into_owned();
    serde_json::from_str(&out).unwrap_or_else(|e| panic!("{e}: {line}: {out}{}", String::from_utf8_lossy(&done.stderr)))
}

fn node(served: &Served, id: &str) -> Option<Value> {
    served.state()["models"].as_array().unwrap().iter().find(|m| m["id"] == id).cloned()
}

fn name_of(run: &Value) -> String {
    std::path::Path::new(run["run"].as_str().unwrap()).file_name().unwrap().to_string_lossy().into_owned()
}

#[cfg(unix)]
#[test]
fn the_foot_holds_what_the_sliders_say_and_does_the_same() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let served = Served::start(rig.folder(), &["--json"]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    browser.until("document.querySelectorAll('#view-compare .card').length === 3", 20);
    click(&mut browser, "#tab-parameters");
    browser.until("document.querySelector('#view-parameters input[type=range]')", 10);
    let slide =
        "const s = document.querySelector('#view-parameters input[type=range]'); s.value = 711.3; s.dispatchEvent(new Event('input'));";
    browser.eval(&format!("{{ {slide} }}"));
    let foot = |browser: &mut Browser| browser.eval("document.getElementById('command').textContent").as_str().unwrap().to_string();
    let shown = browser.eval("document.querySelector('#view-parameters input[type=text]').value").as_str().unwrap().to_string();
    let start = format!("--start 'c1.x.linear_stiffness.k={shown} N/mm'");
    assert!(foot(&mut browser).ends_with(&start), "{} {start}", foot(&mut browser));

    // Compared: the curves of the page are those of the command.
    click(&mut browser, "#tab-compare");
    let line = foot(&mut browser);
    assert!(line.starts_with("misfit compare ") && line.ends_with(&start), "{line}");
    let compared = in_shell(&line);
    let k = shown.parse::<f64>().unwrap() * 1e3;
    let of_page = error(&served.compare("study", &json!({ "0.0": k })), "loop-1Hz");
    let own = error(&served.compare("study", &json!({})), "loop-1Hz");
    let of_line = error(compared["tests"].as_array().unwrap(), "loop-1Hz");
    assert!((of_page / of_line - 1.0).abs() < 1e-9 && (of_page / own - 1.0).abs() > 0.01, "{of_page} {of_line} {own}");

    // Fitted from there, as the page says it does.
    click(&mut browser, "#tab-parameters");
    press(&mut browser, "Fit from these values");
    browser.until("document.getElementById('model-name').textContent === 'fit'", 60);
    let model = browser.eval("new URLSearchParams(location.hash.slice(1)).get('model')").as_str().unwrap().to_string();
    let made = node(&served, &model).unwrap();
    assert!(made["command"].as_str().unwrap().ends_with(&start), "{made}");
    let fitted = in_shell(made["command"].as_str().unwrap());
    let (page, line) = (made["cost"].as_f64().unwrap(), fitted["cost"].as_f64().unwrap());
    assert!((page / line - 1.0).abs() < 1e-9, "{page} {line}");

    // Put back, nothing is left of it at the foot.
    browser.until("document.querySelector('#view-parameters input[type=range]')", 10);
    browser.eval(&format!("{{ {slide} }}"));
    assert!(foot(&mut browser).contains("--start"));
    press(&mut browser, "Put back");
    assert!(!foot(&mut browser).contains("--start"), "{}", foot(&mut browser));
}

#[test]
fn a_start_that_is_none_is_refused_by_name() {
    let rig = Rig::new();
    let folder = rig.folder().display().to_string();
    let of = |start: &str, verb: &str| misfit(&[verb, &folder, "--start", start, "--json"]);
    for (start, message, accepted) in [
        ("c1.x.linear_stiffness.c=1 N/mm", "there is no parameter `c1.x.linear_stiffness.c`", "c1.x.linear_stiffness.k"),
        ("c1.x.linear_stiffness.k=1 N s/mm", "", "N/m"),
        ("c1.x.linear_stiffness.k=4", "`4` has no unit", "N/mm"),
        ("c1.x.linear_stiffness.k=-4 N/mm", "-4 N/mm lies outside the bounds", "0 N/mm or more"),
    ] {
        let ran = of(start, "compare");
        assert_eq!(ran.code, 1, "{start}: {}", ran.stdout);
        let e = &ran.json()["error"];
        let told = |key: &str| e[key].as_str().unwrap().to_string();
        assert!(told("message").contains(message) && told("accepted").contains(accepted), "{e}");
        assert!(told("where") == "--start" || told("where") == "c1.x.linear_stiffness.k", "{e}");
    }
    let checked = of("nothing=1 N", "check").json();
    assert!(checked["problems"][0]["message"].as_str().unwrap().contains("no parameter `nothing`"), "{checked}");
    assert_eq!(of("c1.x.linear_stiffness.k", "fit").code, 2, "no value");
}

#[test]
fn a_tree_says_what_a_law_acts_on() {
    let rig = friction_that_grows();
    let served = Served::start(rig.folder(), &["--json"]);
    let add = |model: &str, effect: &str, more: Value| {
        let mut order = json!({ "verb": "add", "model": model, "effect": effect, "at": "c1.x" });
        more.as_object().unwrap().iter().for_each(|(k, v)| order[k] = v.clone());
        served.run(&order)["result"]["model"].as_str().unwrap().to_string()
    };
    let friction = add("study", "coulomb", json!({}));
    let law = add(&friction, "linear_law", json!({ "of": "coulomb.f", "condition": "i", "reference": "0.3 mm" }));
    assert_eq!(node(&served, &law).unwrap()["added"], json!({ "effect": "linear_law", "at": "c1.x", "of": "coulomb.f over i" }));
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&served.url);
    let names = "[...document.querySelectorAll('.tree .node b')].map(b => b.textContent).join()";
    browser.until(&format!("{names} === 'the study as it stands,+ coulomb at c1.x,+ linear_law at c1.x (coulomb.f over i)'"), 20);
}

#[test]
fn a_saved_study_can_be_opened_and_has_runs_of_its_own() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let mut served = Served::start(rig.folder(), &["--json"]);
    let own = served.study.clone();
    let first = served.run(&json!({ "verb": "add", "model": "study", "effect": "coulomb", "at": "c1.x" }));
    let first = first["result"]["model"].as_str().unwrap().to_string();
    let saved = served.post("save", &json!({ "model": first, "name": "with-friction" })).json();
    assert_eq!(saved["added"], json!([{ "effect": "coulomb", "at": "c1.x" }]), "{saved}");
    let second = saved["study"].as_str().unwrap_or_else(|| panic!("{saved}")).to_string();
    served.study.clone_from(&second);
    assert_eq!(served.state()["models"].as_array().unwrap().len(), 1, "the runs of the other study are not its own");
    let fitted = served.run(&json!({ "verb": "fit", "model": "study" }));
    let model = fitted["result"]["model"].as_str().unwrap().to_string();
    let on_line = misfit(&["fit", &rig.path("with-friction.toml").display().to_string(), "--json"]).json();
    // On a run, the run stands beside it and, in the tree, below it.
    let on_run = misfit(&["fit", &rig.path("runs").join(&model).display().to_string(), "--json"]).json();
    let on_run = name_of(&on_run);
    assert!(rig.path("runs").join(&on_run).join("result.json").is_file());
    assert!(!rig.path("runs").join(&model).join("runs").exists());
    let ids = |served: &Served| -> Vec<String> {
        served.state()["models"].as_array().unwrap().iter().map(|m| m["id"].as_str().unwrap().to_string()).collect()
    };
    let sorted = |mut all: Vec<String>| {
        all.sort();
        all
    };
    let expected = sorted(vec!["study".into(), model.clone(), name_of(&on_line), on_run.clone()]);
    assert_eq!(sorted(ids(&served)), expected);
    assert_eq!(node(&served, &on_run).unwrap()["parent"], model.as_str());
    served.study.clone_from(&own);
    assert_eq!(sorted(ids(&served)), sorted(vec!["study".into(), first.clone()]));
    // A run that is served by itself shows what is made on it, too.
    let alone = Served::start(&rig.path("runs").join(&first), &["--json"]);
    let again = alone.run(&json!({ "verb": "fit", "model": "study" }))["result"]["model"].as_str().unwrap().to_string();
    assert!(rig.path("runs").join(&again).join("result.json").is_file());
    assert_eq!(node(&alone, &again).unwrap()["verb"], "fit");
    assert_eq!(node(&served, &again).unwrap()["parent"], first.as_str(), "and stands below it where its study is served");

    // A server that is started later knows it too; dataset.toml and other files are none.
    rig.write("notes.toml", "title = \"no study\"\n");
    let again = Served::start(rig.folder(), &["--json"]);
    let all = again.get("/api/studies").json();
    let names: Vec<&str> = all["studies"].as_array().unwrap().iter().map(|s| s["id"].as_str().unwrap()).collect();
    assert_eq!(names, [own.as_str(), second.as_str()]);
    let Some(mut browser) = Browser::start(1024, 768) else { return };
    browser.go(&again.url);
    browser.until("document.querySelectorAll('.tree .node').length === 3", 20);
    click(&mut browser, "#tab-models");
    press(&mut browser, &rig.path("with-friction.toml").display().to_string());
    browser.until("document.querySelectorAll('.tree .node').length === 4", 20);
    assert_eq!(browser.eval("document.getElementById('study').value"), second.as_str());
    browser.until(&format!("{ANSWER}?.includes('on the fit tests')"), 20);
    let foot = browser.eval("document.getElementById('command').textContent").as_str().unwrap().to_string();
    assert!(foot.contains("with-friction.toml"), "{foot}");
    // What is saved stands in the list at once.
    click(&mut browser, "#tab-models");
    browser.until("document.getElementById('save-name')", 10);
    browser.eval("document.getElementById('save-name').value = 'third'");
    press(&mut browser, "Save");
    let third = rig.path("third.toml").display().to_string();
    browser.until(&format!("[...document.querySelectorAll('#view-models li')].some(l => l.textContent === {third:?})"), 10);
}
