//! `misfit new`: from unknown files to a study that `check` and `fit` accept.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use super::rig::misfit;

/// Spring and damper, started from rest; German text with decimal commas.
pub fn loop_text(frequency: f64) -> String {
    let mut text = "Prüfstand 4\n\nZeit [s];Weg [mm];Kraft [N]\n".to_string();
    for i in 0..2000 {
        let t = f64::from(i) / 200.0;
        let up = (t * frequency / 1.5).min(1.0);
        let p = TAU * frequency * t;
        let wobble = f64::from((i * 7919) % 101) / 101.0 - 0.5;
        writeln!(text, "{t:.4};{:.6};{:.6}", up * 2.0 * p.sin() + 0.002 * wobble, up * (40.0 * p.sin() + 8.0 * p.cos()) + 0.05 * wobble)
            .unwrap();
    }
    text.replace('.', ",")
}

fn files(dir: &Path) -> Vec<String> {
    [1.0, 2.0]
        .iter()
        .map(|f| {
            let path = dir.join(format!("loop {f}.txt"));
            std::fs::write(&path, loop_text(*f)).unwrap();
            path.display().to_string()
        })
        .collect()
}

#[test]
fn loops_become_a_fitted_study() {
    let dir = tempfile::tempdir().unwrap();
    let files = files(dir.path());
    let study = dir.path().join("study").display().to_string();
    let ran = misfit(&["new", &study, "--json", "--from", &files[0], &files[1]]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let json = ran.json();
    let found = &json["found"][0];
    assert_eq!(
        (found["what"].as_str(), found["cycles"].as_u64(), found["control"].as_str()),
        (Some("cycle"), Some(10), Some("displacement")),
        "{found}"
    );
    assert!((found["frequency_hz"].as_f64().unwrap() - 1.0).abs() < 1e-3 && (found["rate_hz"].as_f64().unwrap() - 200.0).abs() < 1e-6);
    assert_eq!(found["channels"][2]["unit"].as_str(), Some("N"));
    assert!(json["problem"].is_null(), "{json}");
    assert!(Path::new(json["dataset"].as_str().unwrap()).is_file() && Path::new(json["study"].as_str().unwrap()).is_file());
    let check = misfit(&["check", &study, "--json"]);
    assert_eq!(check.code, 0, "{} {}", check.stdout, check.stderr);
    let fit = misfit(&["fit", &study, "--json"]);
    assert_eq!(fit.code, 0, "{}", fit.stderr);
    let parameters = fit.json()["parameters"].clone();
    let value = |name: &str| {
        parameters.as_array().unwrap().iter().find(|p| p["name"].as_str().unwrap().ends_with(name)).unwrap()["value"].as_f64().unwrap()
    };
    assert!((value(".k") / 20e3 - 1.0).abs() < 0.01, "{parameters}");
    // Nothing is written over.
    let again = misfit(&["new", &study, "--json", "--from", &files[0]]);
    assert!(again.error()[2].contains("nothing is written over"));
}

#[test]
fn a_file_that_cannot_be_read_is_left_out_and_named_and_alone_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let good = files(dir.path()).remove(0);
    let bad = dir.path().join("bad.uff").display().to_string();
    std::fs::write(&bad, "    -1\n    58\nabc\n").unwrap();
    let study = dir.path().join("study");
    let ran = misfit(&["new", &study.display().to_string(), "--json", "--from", &bad]);
    let [stage, place, message, _] = ran.error();
    assert_eq!(stage, "data");
    assert!(place.contains("bad.uff") && message.contains("closing line"), "{place}: {message}");
    assert!(!study.exists());
    let hidden =
        std::fs::read_dir(dir.path()).unwrap().filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().starts_with('.')).count();
    assert_eq!(hidden, 0);
    let json = misfit(&["new", &study.display().to_string(), "--json", "--from", &good, &bad]).json();
    let left = json["left_out"].as_array().unwrap();
    assert!(left.len() == 1 && left[0]["where"].as_str().unwrap().contains("bad.uff"), "{json}");
    assert!(study.join("data/dataset.toml").is_file() && !study.join("data/bad.uff").exists());
}

#[test]
fn a_unit_that_is_not_in_the_file_has_to_be_given() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.csv");
    std::fs::write(&path, loop_text(1.0).replace(',', ".").replace(';', ",").replace(" [N]", "")).unwrap();
    let study = dir.path().join("study").display().to_string();
    let ran = misfit(&["new", &study, "--json", "--from", &path.display().to_string()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let json = ran.json();
    assert!(json["to_confirm"].to_string().contains("the unit of `Kraft` is not in the file"), "{json}");
    let problem = json["problem"].to_string();
    assert!(problem.contains("study/data/dataset.toml") && !problem.contains(".misfit-new"), "{problem}");
    // Said on the command line, as the workbench writes it, nothing is open; what is no correction, and what corrects nothing, is refused.
    let second = dir.path().join("second").display().to_string();
    let corrected = |text: &str| misfit(&["new", &second, "--json", "--correct", text, "--from", &path.display().to_string()]);
    for (text, said) in
        [("[{]", "--correct"), (r#"[{ "file": "a.csv", "item": 0, "columns": { "Druck": {} } }]"#, "there is no column `Druck`")]
    {
        let refused = corrected(text);
        assert!(refused.code != 0 && refused.json()["error"].to_string().contains(said), "{}", refused.stdout);
    }
    let ran = corrected(r#"[{ "file": "a.csv", "item": 0, "columns": { "Kraft": { "unit": "kN" } }, "start_up": 3 }]"#);
    let json = ran.json();
    assert!(ran.code == 0 && json["problem"].is_null() && !json["to_confirm"].to_string().contains("the unit of `Kraft`"), "{json}");
    let dataset = std::fs::read_to_string(json["dataset"].as_str().unwrap()).unwrap();
    assert!(dataset.contains("kN") && dataset.contains("discard_cycles = 3"), "{dataset}");
}

/// Set 55: mode shapes of a universal file are a table of modes, and the model that is written has as many degrees of freedom.
#[test]
fn mode_shapes_become_a_modal_test() {
    let dir = tempfile::tempdir().unwrap();
    let shape = |n: usize, f: f64, z: f64| {
        let node = |k: i32| format!("{k:10}\n  1.00000E+00  0.00000E+00  0.00000E+00\n");
        format!(
            "    -1\n    55\nmode\nNONE\nNONE\nNONE\nNONE\n         1         2         2         8         2         3\n         2         4         1{n:10}\n\
             {f:>13.5E}  1.00000E+00{z:>13.5E}  0.00000E+00\n{}{}    -1\n",
            node(7),
            node(9)
        )
    };
    let path = dir.path().join("shapes.unv").display().to_string();
    std::fs::write(&path, shape(2, 76.8, 0.04) + &shape(1, 27.4, 0.014) + &shape(3, 120.0, 0.0)).unwrap();
    let study = dir.path().join("study").display().to_string();
    let ran = misfit(&["new", &study, "--json", "--from", &path]);
    assert_eq!(ran.code, 0, "{}{}", ran.stdout, ran.stderr);
    let json = ran.json();
    assert!(json["problem"].is_null(), "{json}");
    let found = json["found"].as_array().unwrap().iter().find(|f| f["what"] == "modal").unwrap();
    assert_eq!(found["modes"][0]["frequency_hz"], 27.4, "{found}");
    assert!(found["modes"][2]["damping"].is_null(), "{found}");
    let check = misfit(&["check", &study, "--json", "--max-seconds", "5"]).json();
    assert!(check["problems"].as_array().unwrap().iter().all(|p| p["stage"] == "identify"), "{check}");
    let fit = misfit(&["fit", &study, "--json", "--max-seconds", "5"]);
    assert!(matches!(fit.code, 0 | 130), "{}{}", fit.stdout, fit.stderr);
}
