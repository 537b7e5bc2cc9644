//! Exit codes, interruption, resumption.

use super::rig::{Rig, misfit, program};

#[test]
fn wrong_usage_is_two() {
    let rig = Rig::new();
    let study = rig.folder().display().to_string();
    for arguments in [
        vec!["fitt", &study],
        vec!["fit"],
        vec!["fit", &study, "--max-seconds", "-1"],
        vec!["fit", &study, "--threads", "0"],
        vec!["fit", &study, "--seed", "x"],
        vec!["export", &study, "--to", "xlsx"],
        vec!["add", &study, "coulomb"],
        vec!["simulate", &study, "--noise", "2 mm"],
    ] {
        let ran = misfit(&arguments);
        assert_eq!(ran.code, 2, "{arguments:?}: {}", ran.stderr);
        assert!(ran.stdout.is_empty() && ran.stderr.contains("error"), "{}", ran.stderr);
    }
    let ran = misfit(&["fit", &study, "--json", "--sed", "1"]);
    assert_eq!(ran.code, 2);
    assert!(ran.json()["error"]["message"].as_str().unwrap().contains("--sed"), "{}", ran.stdout);
    assert_eq!(misfit(&["--help"]).code, 0);
    assert_eq!(misfit(&["--version"]).code, 0);
}

#[test]
fn what_cannot_be_done_is_one() {
    let ran = misfit(&["fit", "/no/such/study", "--json"]);
    let [_, place, _, _] = ran.error();
    assert!(place.contains("/no/such/study"), "{place}");
    let ran = misfit(&["fit", "/no/such/study"]);
    assert_eq!(ran.code, 1);
    assert!(ran.stdout.is_empty() && ran.stderr.contains("/no/such/study") && ran.stderr.contains("accepted"), "{}", ran.stderr);
}

#[test]
fn out_of_time_saves_the_best_state_and_resumes() {
    let rig = Rig::new();
    let (first, second) = (rig.path("first"), rig.path("second"));
    let ran = rig.run("fit", &["--json", "--max-seconds", "1e-9", "--out", &first.display().to_string()]);
    assert_eq!(ran.code, 130, "{} {}", ran.stdout, ran.stderr);
    assert_eq!(ran.json()["termination"], "interrupted");
    assert!(first.join("checkpoint.json").is_file() && first.join("study.toml").is_file() && first.join("result.json").is_file());
    let ran = rig.run("fit", &["--json", "--resume", &first.display().to_string(), "--out", &second.display().to_string()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let (resumed, whole) = (ran.json(), rig.json("fit", &[]));
    let cost = |v: &serde_json::Value| v["cost"].as_f64().unwrap();
    assert!((cost(&resumed) - cost(&whole)).abs() < 1e-9 * cost(&whole));
    let ran = rig.run("fit", &["--json", "--resume", &rig.path("data").display().to_string()]);
    assert!(ran.error()[2].contains("no best state"), "{}", ran.stdout);
    assert_eq!(rig.runs().len(), 1, "a run that came to nothing leaves no folder");
}

#[test]
fn a_ladder_that_was_stopped_says_so() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let ran = rig.run("ladder", &["--json", "--max-seconds", "1e-9"]);
    assert_eq!(ran.code, 130, "{}", ran.stderr);
    let json = ran.json();
    assert_eq!((&json["verdict"], &json["interrupted"]), (&"unexplained".into(), &true.into()));
    assert!(json["ended"].as_str().unwrap().contains("interrupted") && json["missing"].as_array().unwrap().is_empty());
    let ran = rig.run("ladder", &["--max-seconds", "1e-9"]);
    assert!(ran.stdout.contains("interrupted before it had found anything") && !ran.stdout.contains("library"), "{}", ran.stdout);
    let ran = rig.run("diagnose", &["--json", "--max-seconds", "1e-9"]);
    assert_eq!((ran.code, &ran.json()["verdict"]), (130, &"unexplained".into()));
    assert_eq!(rig.json("ladder", &[])["interrupted"], false);
}

/// The answer comes first: where the time is over, the rungs on the way to it are left out and that is said, and every case is predicted.
#[test]
fn a_prediction_out_of_time_leaves_out_the_way_to_the_answer() {
    let study = super::tolerance::folder(&[0.1, 0.2, 0.3], &[0.2, 0.25, 0.3]);
    let file = study.path().join("study.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    for rung in ["first", "second"] {
        std::fs::create_dir(study.path().join(rung)).unwrap();
        std::fs::write(study.path().join(rung).join("study.toml"), text.replace("\"data", "\"../data")).unwrap();
    }
    std::fs::write(&file, text.replacen("dataset = \"data\"", "dataset = \"data\"\nrungs = [\"first\", \"second\"]", 1)).unwrap();
    let predicted = |more: &[&str]| misfit(&[&["predict", &study.path().display().to_string(), "--json"], more].concat());
    let whole = predicted(&[]).json();
    assert_eq!(whole["tolerance"]["rungs"].as_array().unwrap().len(), 2);
    let ran = predicted(&["--max-seconds", "1e-9"]);
    assert_eq!(ran.code, 130, "{}", ran.stderr);
    let json = ran.json();
    assert_eq!(json["tolerance"]["rungs"].as_array().unwrap().len(), 1);
    let told = json["tolerance"]["findings"].as_array().unwrap().iter().any(|f| f["claim"].as_str().unwrap().contains("the time was over"));
    let energies = json["predictions"].as_array().unwrap().iter().filter(|p| p["quantity"] == "W_D").count();
    assert!(told && energies == 3, "{}", json["tolerance"]["findings"]);
    assert!(!ran.stderr.contains("fit of rung"), "{}", ran.stderr);
}

/// A long fit: many starts of a law with memory.
#[cfg(unix)]
#[test]
fn ctrl_c_keeps_the_best_state() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    rig.write(
        "study.toml",
        &(rig.read("study.toml") + "[[effect]]\neffect = \"elastic_slip\"\nat = \"c1.x\"\nf = \"1 N\"\nd = \"0.05 mm\"\n"),
    );
    rig.change("study.toml", "[[body]]\nname = \"ground\"", "fit = { starts = 5000 }\n[[body]]\nname = \"ground\"");
    let out = rig.path("out");
    let child = program()
        .args(["fit", &rig.folder().display().to_string(), "--json", "--out", &out.display().to_string()])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let sent = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success(), "the fit was over before the signal");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["termination"], "interrupted");
    assert!(out.join("study.toml").is_file() && out.join("result.json").is_file());
    // The best of all starts is kept, and gone on from with one.
    let kept: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("checkpoint.json")).unwrap()).unwrap();
    let cost = |v: &serde_json::Value| v["cost"].as_f64().unwrap();
    assert!(cost(&kept) <= cost(&json) * (1.0 + 1e-12), "{kept} {json}");
    let ran = rig.run("fit", &["--json", "--resume", &out.display().to_string()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let resumed = ran.json();
    // Finer time steps may move the cost a little.
    assert!(cost(&resumed) <= cost(&kept) * 1.01, "{resumed}");
    assert!(resumed["notes"].to_string().contains("starts not tried"), "{}", resumed["notes"]);
}
