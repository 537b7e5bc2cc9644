//! What the verbs do, beyond the shape of what they say.

use super::rig::{C, K, Rig, STUDY, misfit};
use super::shapes::with_predictions;

fn parameter(json: &serde_json::Value, name: &str) -> (f64, f64) {
    let p = json["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name} in {json}"));
    (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap())
}

#[test]
fn a_fit_finds_the_truth_and_keeps_its_run() {
    let rig = Rig::new();
    let json = rig.json("fit", &[]);
    assert_eq!(json["termination"], "converged");
    for (name, truth) in [("c1.x.linear_stiffness.k", K * 1e3), ("c1.x.viscous.c", C * 1e3)] {
        let (value, std) = parameter(&json, name);
        assert!((value - truth).abs() < 4.0 * std && std < 0.01 * truth, "{name}: {value} +- {std}, truth {truth}");
    }
    for t in json["tests"].as_array().unwrap() {
        let (error, floor) = (t["error"].as_f64().unwrap(), t["floor"].as_f64().unwrap());
        assert!(error < 1.5 * floor, "{t}");
    }
    let runs = rig.runs();
    assert_eq!(runs.len(), 1, "{runs:?}");
    let name = runs[0].file_name().unwrap().to_string_lossy().into_owned();
    assert!(name.ends_with("-fit"), "{name}");
    let mut files: Vec<String> =
        std::fs::read_dir(&runs[0]).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned()).collect();
    files.sort();
    assert_eq!(files, ["checkpoint.json", "report.html", "residuals.parquet", "result.json", "study.toml"]);
    let kept: serde_json::Value = serde_json::from_slice(&std::fs::read(runs[0].join("result.json")).unwrap()).unwrap();
    assert_eq!(kept, json, "the file and stdout say the same");
    residuals(&runs[0].join("residuals.parquet"), &json);
    // The resolved study starts where the fit ended.
    let again = misfit(&["compare", &runs[0].display().to_string(), "--json"]).json();
    for (a, b) in json["tests"].as_array().unwrap().iter().zip(again["tests"].as_array().unwrap()) {
        let (a, b) = (a["error"].as_f64().unwrap(), b["error"].as_f64().unwrap());
        assert!((a - b).abs() < 1e-9 * a, "{a} {b}");
    }
}

/// The whitened residuals give the cost of the fit.
fn residuals(file: &std::path::Path, json: &serde_json::Value) {
    use polars::prelude::*;
    let frame = ParquetReader::new(std::fs::File::open(file).unwrap()).finish().unwrap();
    let names: Vec<String> = frame.get_column_names().iter().map(|n| n.to_string()).collect();
    assert_eq!(names, ["test", "channel", "abscissa", "part", "measured", "computed", "sigma", "whitened"]);
    let column = |name: &str| -> Vec<f64> { frame.column(name).unwrap().f64().unwrap().into_no_null_iter().collect() };
    let (measured, computed, sigma, whitened) = (column("measured"), column("computed"), column("sigma"), column("whitened"));
    let test = frame.column("test").unwrap().str().unwrap().clone();
    let mut cost = 0.0;
    for k in 0..frame.height() {
        assert!((whitened[k] - (computed[k] - measured[k]) / sigma[k]).abs() < 1e-9);
        if test.get(k) == Some("loop-1Hz") {
            cost += 0.5 * whitened[k].powi(2);
        }
    }
    let said = json["cost"].as_f64().unwrap();
    assert!((cost - said).abs() < 1e-6 * said, "{cost} {said}");
}

#[test]
fn a_comparison_leaves_a_whole_run() {
    let rig = Rig::new();
    let json = rig.json("compare", &[]);
    let run = std::path::PathBuf::from(json["run"].as_str().unwrap());
    for file in ["report.html", "residuals.parquet", "result.json", "study.toml"] {
        assert!(run.join(file).is_file(), "{file}");
    }
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    // plotly's script names addresses in texts of its own; the page loads nothing.
    let loads = ["<script src", "<link ", "<img src=\"http", "<iframe"];
    assert!(page.contains("loop-5Hz"));
    assert!(loads.iter().all(|l| !page.contains(l)), "the page loads from elsewhere");
}

#[test]
fn a_report_leaves_a_whole_run_with_the_fitted_study() {
    let rig = Rig::new();
    let json = rig.json("report", &[]);
    let run = std::path::PathBuf::from(json["run"].as_str().unwrap());
    for file in ["report.html", "residuals.parquet", "result.json", "study.toml"] {
        assert!(run.join(file).is_file(), "{file}");
    }
    let kept: serde_json::Value = serde_json::from_slice(&std::fs::read(run.join("result.json")).unwrap()).unwrap();
    let again = misfit(&["compare", &run.display().to_string(), "--json"]).json();
    let errors = |v: &serde_json::Value| v["tests"].as_array().unwrap().iter().map(|t| t["error"].as_f64().unwrap()).collect::<Vec<_>>();
    for (a, b) in errors(&kept["fit"]).iter().zip(errors(&again)) {
        assert!((a - b).abs() < 1e-9 * a, "{a} {b}");
    }
    // The page speaks of parameters in the engineer's units and names a whole command.
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert_eq!(page.matches("misfit export").count(), page.matches("--to json").count());
    let interval = kept["fit"]["parameters"][0]["printed_interval"].as_str().unwrap();
    assert!(interval.ends_with(" N/mm") && page.contains(interval), "{interval}");
    let (low, high) = interval.trim_end_matches(" N/mm").split_once(" to ").unwrap();
    for (printed, si) in [low, high].iter().zip(kept["fit"]["parameters"][0]["interval"].as_array().unwrap()) {
        assert!((printed.parse::<f64>().unwrap() * 1e3 / si.as_f64().unwrap() - 1.0).abs() < 1e-3, "{interval}");
    }
}

#[test]
fn a_run_can_be_moved_with_its_study() {
    let rig = Rig::new();
    let run = std::path::PathBuf::from(rig.json("fit", &[])["run"].as_str().unwrap());
    assert!(std::fs::read_to_string(run.join("study.toml")).unwrap().contains("dataset = \"../../data\""));
    let elsewhere = tempfile::tempdir().unwrap();
    let moved = elsewhere.path().join("study");
    std::fs::rename(rig.folder(), &moved).unwrap();
    let again = misfit(&["compare", &moved.join("runs").join(run.file_name().unwrap()).display().to_string(), "--json"]);
    std::fs::rename(&moved, rig.folder()).unwrap();
    assert_eq!(again.code, 0, "{}", again.stderr);
}

#[test]
fn out_is_taken_exactly_and_a_study_is_not_written_over() {
    let rig = Rig::new();
    let out = rig.path("here");
    rig.json("fit", &["--out", &out.display().to_string()]);
    assert!(out.join("result.json").is_file() && rig.runs().is_empty());
    // Into the folder of an earlier run: yes. Into that of a study: no.
    rig.json("fit", &["--out", &out.display().to_string()]);
    let ran = rig.run("fit", &["--json", "--out", &rig.folder().display().to_string()]);
    assert!(ran.error()[2].contains("write over"), "{}", ran.stdout);
    assert_eq!(rig.read("study.toml"), STUDY);
}

#[test]
fn a_table_for_people() {
    let ran = Rig::new().run("fit", &[]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    for word in ["loop-1Hz", "held out", "N/mm", "c1.x.viscous.c", "error/floor", "within the noise", "Next:"] {
        assert!(ran.stdout.contains(word), "`{word}` in\n{}", ran.stdout);
    }
    assert!(serde_json::from_str::<serde_json::Value>(&ran.stdout).is_err());
}

/// What is held out is for the last word on a model: the terminal shows it where it is asked for, the JSON always.
#[test]
fn held_out_tests_are_sealed_until_they_are_asked_for() {
    let rig = Rig::new();
    let held_out = |json: &serde_json::Value| {
        let of = |t: &serde_json::Value| t["split"] == "held_out" && t["error"].as_f64().is_some();
        json["tests"].as_array().unwrap().iter().filter(|t| of(t)).count()
    };
    for (verb, more) in [("fit", vec![]), ("compare", vec![]), ("add", vec!["cubic_stiffness", "--at", "c1.x", "--keep-study"])] {
        let sealed = rig.run(verb, &more);
        assert_eq!(sealed.code, 0, "{}", sealed.stderr);
        assert!(
            sealed.stdout.contains("held out, not shown: loop-5Hz (--held-out") && sealed.stdout.contains("On the fit tests"),
            "{}",
            sealed.stdout
        );
        assert!(!sealed.stdout.contains("On the held out tests"), "{}", sealed.stdout);
        let row = |text: &str| text.lines().any(|l| l.trim_start().starts_with("loop-5Hz"));
        assert!(!row(&sealed.stdout), "{}", sealed.stdout);
        let open = rig.run(verb, &[&more[..], &["--held-out"]].concat());
        assert!(
            row(&open.stdout) && open.stdout.contains("On the held out tests") && !open.stdout.contains("not shown"),
            "{}",
            open.stdout
        );
    }
    assert!(held_out(&rig.json("fit", &[])) == 1 && held_out(&rig.json("compare", &[])) == 1);
}

#[test]
fn what_is_simulated_gives_its_truth_back() {
    let rig = Rig::new();
    let out = rig.path("virtual");
    let json = rig.json("simulate", &["--noise", "0.5 %", "--seed", "7", "--out", &out.display().to_string()]);
    assert_eq!(json["dataset"].as_str().unwrap(), out.canonicalize().unwrap().display().to_string());
    rig.change("study.toml", "dataset = \"data\"", "dataset = \"virtual\"");
    rig.change("study.toml", "15 N/mm", "30 N/mm");
    let fit = rig.json("fit", &[]);
    for (name, truth) in [("c1.x.linear_stiffness.k", 15e3), ("c1.x.viscous.c", 300.0)] {
        let (value, std) = parameter(&fit, name);
        assert!((value - truth).abs() < 4.0 * std && std < 0.01 * truth, "{name}: {value} +- {std}, truth {truth}");
    }
    // The same seed gives the same files, another seed others.
    let file = |seed: &str, name: &str| {
        rig.change("study.toml", "dataset = \"virtual\"", "dataset = \"data\"");
        let out = rig.path(name);
        rig.json("simulate", &["--seed", seed, "--out", &out.display().to_string()]);
        rig.change("study.toml", "dataset = \"data\"", "dataset = \"virtual\"");
        std::fs::read_to_string(out.join("loop-1Hz.csv")).unwrap()
    };
    let (a, b, c) = (file("3", "a"), file("3", "b"), file("4", "c"));
    assert!(a == b && a != c);
    // A fit that compares 40 points of a loop leaves what is simulated as it is.
    rig.change("study.toml", "schema = 1\n", "schema = 1\nfit = { points = 40 }\n");
    assert_eq!(file("3", "d").lines().count(), a.lines().count());
    // Measurements are never written over.
    let ran = rig.run("simulate", &["--json", "--out", &rig.path("data").display().to_string()]);
    assert!(ran.error()[2].contains("never written over"));
}

#[test]
fn add_writes_the_effect_once_the_refit_has_worked() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    let json = rig.json("add", &["coulomb", "--at", "c1.x"]);
    let text = rig.read("study.toml");
    assert!(text.starts_with(STUDY), "what stood there stays byte for byte");
    assert_eq!(text.matches("effect = \"coulomb\"").count(), 1);
    let (force, std) = parameter(&json["after"], "c1.x.coulomb.f");
    assert!((force - 1.5).abs() < 0.05, "{force} +- {std}");
    assert_eq!(rig.json("check", &[])["ok"], true);
}

#[test]
fn an_effect_that_cannot_be_added_leaves_the_study_alone() {
    let rig = Rig::new();
    for (effect, at, word) in
        [("coulom", "c1.x", "coulomb"), ("coulomb", "c2.x", "c2"), ("coulomb", "c1.y", "c1.x"), ("gain", "loop-9Hz.force", "loop-9Hz")]
    {
        let ran = rig.run("add", &[effect, "--at", at, "--json"]);
        let [_, place, message, accepted] = ran.error();
        assert!([place, message, accepted].concat().contains(word), "{effect} at {at}: {}", ran.stdout);
    }
    assert_eq!(rig.read("study.toml"), STUDY);
}

#[test]
fn predictions_against_the_closed_form() {
    let rig = Rig::new();
    let json = with_predictions(&rig).json("predict", &[]);
    let p = json["predictions"].as_array().unwrap();
    // W_D = pi w c A^2; both readings of W_s and the slope of a spring with a damper: k, k and with the range of F = A sqrt(k^2 + w^2 c^2).
    let (k, c, a, w) = (K * 1e3, C * 1e3, 1e-3, std::f64::consts::TAU);
    let range = 2.0 * a * k.hypot(w * c);
    let wanted = [std::f64::consts::PI * w * c * a * a, range.powi(2) / (2.0 * k), 0.5 * range * 2.0 * a, k];
    for (p, wanted) in p.iter().zip(wanted) {
        let (value, std) = (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap());
        assert!((value - wanted).abs() < 4.0 * std + 1e-4 * wanted, "{p}: {wanted}");
        assert!(std > 0.0 && std < 0.02 * wanted, "{p}");
    }
    assert!(p[0]["relative_error"].as_f64().unwrap().abs() < 0.01 && p[1]["reference"].is_null());
}

#[test]
fn a_prediction_stopped_in_its_bootstrap_goes_on() {
    let rig = Rig::new();
    with_predictions(&rig);
    let run =
        |name: &str, more: &[&str]| rig.json("predict", &[&["--out", &rig.path(name).display().to_string(), "--seed", "3"], more].concat());
    let whole = run("whole", &["--bootstrap", "8"]);
    run("half", &["--bootstrap", "5"]);
    let half = rig.path("half").display().to_string();
    let on = run("on", &["--bootstrap", "8", "--resume", &half]);
    let width = |v: &serde_json::Value| {
        let interval = &v["predictions"][0]["bootstrap"]["interval"];
        interval[1].as_f64().unwrap() - interval[0].as_f64().unwrap()
    };
    assert!((width(&on) / width(&whole) - 1.0).abs() < 1e-3, "{} {}", width(&on), width(&whole));
    let replicates = rig.read("on/bootstrap.jsonl");
    assert!(replicates.starts_with(&rig.read("half/bootstrap.jsonl")) && replicates.lines().count() == 9);
}

#[test]
fn a_model_without_losses_dissipates_nothing() {
    let rig = Rig::new();
    let study = rig.read("study.toml");
    let (springs, _) = study.split_once("[[effect]]\neffect = \"viscous\"").unwrap();
    rig.write("study.toml", springs);
    let json = with_predictions(&rig).json("predict", &[]);
    assert_eq!((&json["predictions"][0]["quantity"], json["predictions"][0]["value"].as_f64()), (&"W_D".into(), Some(0.0)));
    let said = rig.run("predict", &[]).stdout;
    let row = said.lines().find(|l| l.contains("W_D")).unwrap();
    assert!(row.split_whitespace().any(|w| w == "0") && !row.contains("e-"), "{row}");
}

#[test]
fn exported_files_hold_the_calibrated_set() {
    let rig = Rig::new();
    let out = rig.path("out");
    rig.json("export", &["--to", "json,csv,parquet", "--out", &out.display().to_string()]);
    let set: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("calibrated.json")).unwrap()).unwrap();
    assert!((parameter(&set, "c1.x.linear_stiffness.k").0 - K * 1e3).abs() < 100.0);
    let (std, variance) = (parameter(&set, "c1.x.viscous.c").1, set["covariance"][1][1].as_f64().unwrap());
    assert!((variance.sqrt() - std).abs() < 1e-9 * std, "{variance} {std}");
    assert!(set["study_hash"].as_str().unwrap().starts_with("fnv1a64:"));
    let csv = std::fs::read_to_string(out.join("parameters.csv")).unwrap();
    assert!(csv.starts_with("name,value,unit,std,low_95,high_95,identifiable\nc1.x.linear_stiffness.k,"), "{csv}");
    assert!(out.join("parameters.parquet").is_file() && out.join("covariance.parquet").is_file());
}

#[test]
fn exported_mechanisms_hold_the_identified_coefficients_and_name_what_they_cannot() {
    let rig = Rig::new();
    let study = rig.read("study.toml");
    rig.write(
        "study.toml",
        &(study + "[[effect]]\neffect = \"support_compliance\"\nat = \"c1.x\"\ns = { start = \"1e-6 mm/N\", fixed = true }\n"),
    );
    let out = rig.path("out");
    let ran = rig.run("export", &["--to", "adams,exudyn", "--test", "loop-2Hz", "--json", "--out", &out.display().to_string()]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    for format in ["adams", "exudyn"] {
        assert!(ran.stderr.contains(&format!("{format}: support_compliance at c1.x")), "{}", ran.stderr);
    }
    assert_eq!(ran.json()["test"], "loop-2Hz");
    let adams = std::fs::read_to_string(out.join("mechanism.cmd")).unwrap();
    let after = adams.split("c1_x_linear_stiffness_k").nth(1).unwrap();
    let value: f64 = after.split("real_value = ").nth(1).unwrap().split_whitespace().next().unwrap().parse().unwrap();
    assert!((value / K - 1.0).abs() < 0.01, "{value} N/mm");
    assert!(adams.contains("general_force_name = .misfit.c1"));
    let script = std::fs::read_to_string(out.join("mechanism.py")).unwrap();
    assert!(script.contains("(\"c1.x\", None, \"end.x\", ") && script.contains("support_compliance at c1.x"), "{script}");
    let error = rig.run("export", &["--to", "adams", "--test", "loop-9Hz", "--json"]).error();
    assert!(error[2].contains("no test `loop-9Hz`") && error[3].contains("loop-5Hz"), "{error:?}");
}

#[test]
fn check_tells_every_problem() {
    let rig = Rig::new();
    rig.change("data/dataset.toml", "file = \"loop2.csv\"", "file = \"loop3.csv\"");
    let csv = rig.read("data/loop5.csv").replacen("t,x,F", "t,x,f", 1);
    rig.write("data/loop5.csv", &csv);
    rig.change("study.toml", "effect = \"viscous\"", "effect = \"viscos\"");
    rig.change("study.toml", "k = { start = \"15 N/mm\"", "k = { start = \"15 mm\"");
    let ran = rig.run("check", &["--json"]);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    let json = ran.json();
    assert_eq!(json["ok"], false);
    let text: Vec<String> = json["problems"].as_array().unwrap().iter().map(|p| format!("{} {}", p["where"], p["message"])).collect();
    for word in ["loop3.csv", "column `F`", "viscos", "15 mm"] {
        assert_eq!(text.iter().filter(|t| t.contains(word)).count(), 1, "{word}: {text:#?}");
    }
    assert_eq!(text.len(), 4, "{text:#?}");
}

#[test]
fn check_names_what_moves_nothing() {
    let rig = Rig::new();
    let study = rig.read("study.toml");
    // A second connector that no test moves.
    let more = "[[body]]\nname = \"other\"\nmass = \"1 kg\"\nfree = [\"x\"]\n[[connector]]\nname = \"c2\"\nfrom = \"ground\"\nto = \"other\"\n\
                [[effect]]\neffect = \"linear_stiffness\"\nat = \"c2.x\"\nk = { start = \"5 N/mm\", min = \"0 N/mm\" }\n";
    rig.write("study.toml", &(study + more));
    let ran = rig.run("check", &["--json"]);
    assert_eq!(ran.code, 1, "{}", ran.stderr);
    let json = ran.json();
    let free = json["free"].as_array().unwrap();
    let moves = |name: &str| free.iter().find(|f| f["name"] == name).unwrap()["moves_residual"].as_bool().unwrap();
    assert!(moves("c1.x.linear_stiffness.k") && !moves("c2.x.linear_stiffness.k"), "{json}");
    assert!(json["problems"].to_string().contains("c2.x.linear_stiffness.k"));
}

/// An effect that is added speaks the units of the study's own effects and channels.
#[test]
fn an_added_effect_is_written_in_the_units_of_the_data() {
    let rig = Rig::hiding(|_, v| 1.5 * v.signum());
    for (file, unit) in
        [("data/dataset.toml", "unit=\"N\""), ("data/dataset.toml", "0.05 N"), ("study.toml", "15 N/"), ("study.toml", "0.3 N ")]
    {
        rig.write(file, &rig.read(file).replace(unit, &unit.replace('N', "kN")));
    }
    rig.write("study.toml", &rig.read("study.toml").replace("\"0 N", "\"0 kN"));
    let ran = rig.run("add", &["coulomb", "--at", "c1.x", "--json"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    let text = rig.read("study.toml");
    let strength = text.lines().find(|l| l.starts_with("f = ")).unwrap_or_else(|| panic!("{text}"));
    assert!(strength.contains(" kN\""), "{strength}");
}
