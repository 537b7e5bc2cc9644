//! Every command of the handbook is run, chapter by chapter, or is marked `sh,not-run` with its reason beside it.

use std::path::{Path, PathBuf};

use super::rig::loop_csv;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn chapters() -> Vec<PathBuf> {
    let summary = std::fs::read_to_string(root().join("docs/src/SUMMARY.md")).unwrap();
    let named = summary.lines().filter_map(|l| Some(l.split_once("](")?.1.trim_end_matches(')').to_string()));
    named.map(|n| root().join("docs/src").join(n)).collect()
}

/// Blocks of code with their marks.
fn blocks(text: &str) -> Vec<(String, String)> {
    let mut parts = text.split("```");
    parts.next();
    let mut all = Vec::new();
    while let Some(inside) = parts.next() {
        let (mark, code) = inside.split_once('\n').unwrap_or(("", ""));
        all.push((mark.trim().to_string(), code.to_string()));
        parts.next();
    }
    all
}

pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        match path.is_dir() {
            true if path.ends_with("runs") => {}
            true => copy(&path, &target),
            false => drop(std::fs::copy(&path, &target).unwrap()),
        }
    }
}

/// What a chapter finds: files of a bench with a stiffening spring, and the small studies.
fn bench(folder: &Path) {
    std::fs::create_dir(folder.join("bench")).unwrap();
    for f in [1, 2] {
        let text = loop_csv(f64::from(f), |x, _| 8.0 * x * x * x).replacen("t,x,F", "t [s],x [mm],F [N]", 1);
        std::fs::write(folder.join(format!("bench/loop-{f}Hz.csv")), text).unwrap();
    }
    for study in ["04-interference", "08-two-effects"] {
        copy(&root().join("studies").join(study), &folder.join("studies").join(study));
    }
}

#[test]
fn every_chapter_is_there_and_says_why_a_command_is_not_run() {
    let all = chapters();
    assert!(all.len() >= 9);
    for chapter in all {
        let text = std::fs::read_to_string(&chapter).unwrap();
        let marked = text.matches("```sh,not-run").count();
        assert!(text.matches("Not run by the tests of this handbook:").count() >= marked, "{}", chapter.display());
        for (mark, code) in blocks(&text) {
            assert!(mark.starts_with("sh") || !code.lines().any(|l| l.starts_with("misfit ")), "{}: {code}", chapter.display());
        }
    }
}

#[test]
fn every_command_runs() {
    let program = Path::new(env!("CARGO_BIN_EXE_misfit")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut ran = 0;
    for chapter in chapters() {
        let folder = tempfile::tempdir().unwrap();
        bench(folder.path());
        let text = std::fs::read_to_string(&chapter).unwrap();
        // The prediction that a chapter shows is one of study 04.
        for (_, code) in blocks(&text).iter().filter(|(mark, code)| mark == "toml" && code.starts_with("[[prediction]]")) {
            let study = folder.path().join("studies/04-interference/study.toml");
            std::fs::write(&study, std::fs::read_to_string(&study).unwrap() + code).unwrap();
        }
        for (_, code) in blocks(&text).into_iter().filter(|(mark, _)| mark == "sh") {
            for line in code.lines().filter(|l| !l.trim().is_empty()) {
                let output =
                    std::process::Command::new("sh").args(["-c", line]).current_dir(folder.path()).env("PATH", &path).output().unwrap();
                // A fit that is given no time is stopped, and says so.
                let expected = if line.contains("--max-seconds") { 130 } else { 0 };
                let said = String::from_utf8_lossy(&output.stderr);
                assert_eq!(output.status.code(), Some(expected), "{}: {line}\n{said}", chapter.display());
                ran += 1;
            }
        }
    }
    assert!(ran >= 15, "{ran} commands");
}
