//! `misfit trial`, small: hidden effects are found, and a trial that was killed goes on to the same table.

use serde_json::Value;

use super::rig::misfit;

fn trial(options: &[&str]) -> Value {
    misfit(&[&["trial", "--json"], options].concat()).json()
}

#[test]
fn a_small_trial_finds_what_is_hidden_and_goes_on_where_it_was_killed() {
    let folder = tempfile::tempdir().unwrap();
    let (out, failures) = (folder.path().join("out").display().to_string(), folder.path().join("failures"));
    let options = ["--cases", "6", "--seed", "3", "--models", "connector", "--kinds", "one,one,none"];
    let whole = trial(&[&options[..], &["--out", &out, "--write", &failures.display().to_string()]].concat());
    let count = |key: &str| whole[key].as_u64().unwrap();
    assert_eq!(count("cases"), 6);
    let told: u64 = whole["confusion"].as_array().unwrap().iter().map(|c| c["count"].as_u64().unwrap()).sum();
    assert_eq!(told, 6, "{whole}");
    // Four of six as measured on 2026-11-21: offsets within tolerance keep two effects from earning their place. The number may only rise.
    assert!(count("strict") <= count("with_ties") && count("with_ties") >= 4 && count("failed") == 0, "{whole}");
    assert_eq!(count("false_alarms"), 0, "{whole}");
    // Every failure, and nothing else, can be looked at.
    let written = std::fs::read_dir(&failures).map_or(0, Iterator::count);
    assert_eq!(written as u64, 6 - count("with_ties"));
    // Killed in the middle of the last line.
    let file = folder.path().join("out/cases.jsonl");
    let text = std::fs::read_to_string(&file).unwrap();
    let keep = text.match_indices('\n').nth(4).unwrap().0 + 20;
    std::fs::write(&file, &text[..keep]).unwrap();
    let again = trial(&["--resume", &out, "--cases", "6"]);
    for key in ["cases", "strict", "with_ties", "missed", "false_alarms", "confusion", "by_kind", "seed"] {
        assert_eq!(again[key], whole[key], "{key}");
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap().lines().count(), 7);
}

#[test]
fn a_trial_is_not_written_over_and_unknown_kinds_are_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cases.jsonl"), "").unwrap();
    let out = folder.path().display().to_string();
    let run = misfit(&["trial", "--json", "--cases", "1", "--out", &out]);
    let error = run.json();
    assert_eq!(error["error"]["stage"], "trial");
    assert!(error["error"]["accepted"].as_str().unwrap().contains("--resume"), "{error}");
    assert_eq!(std::fs::read_to_string(folder.path().join("cases.jsonl")).unwrap(), "");
    let usage = misfit(&["trial", "--json", "--kinds", "three"]).json();
    assert!(usage["error"]["message"].as_str().unwrap().contains("three"), "{usage}");
}
