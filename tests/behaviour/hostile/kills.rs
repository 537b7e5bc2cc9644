//! `kill -9` at random moments of fit, ladder and add: no file is half written, and a resumed fit or ladder ends where the undisturbed one does.
//!
//! `MISFIT_KILLS=200 cargo test --release --test behaviour kills -- --nocapture` does it so many times; MISFIT_HOSTILE_SEED sets the seed.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::super::rig::{Rig, program};
use super::mutate::Random;

const VERBS: [&str; 3] = ["fit", "ladder", "add"];

/// Files that are not whole. A temporary file that was never renamed is none: it bears no name that anything reads.
fn halves(folder: &Path) -> Vec<String> {
    let mut bad = vec![];
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            bad.extend(halves(&path));
            continue;
        }
        let bytes = std::fs::read(&path).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        let whole = match path.extension().and_then(|e| e.to_str()) {
            _ if name.starts_with(".tmp") => true,
            Some("json") => serde_json::from_slice::<Value>(&bytes).is_ok(),
            Some("toml") => !bytes.is_empty() && text.parse::<toml::Table>().is_ok(),
            Some("parquet") => bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"),
            Some("html") => text.trim_end().ends_with("</html>"),
            _ => true,
        };
        if !whole {
            bad.push(path.display().to_string());
        }
    }
    bad
}

fn command(rig: &Rig, verb: &str, out: &Path) -> std::process::Command {
    let mut command = program();
    command.arg(verb).arg(rig.folder());
    if verb == "add" {
        command.args(["cubic_stiffness", "--at", "c1.x"]);
    }
    command.args(["--json", "--threads", "1", "--out"]).arg(out).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn cost(rig: &Rig, more: &[&str]) -> f64 {
    rig.json("fit", more)["cost"].as_f64().unwrap()
}

/// What a ladder finds, with the cost of every rung.
fn climbed(rig: &Rig, more: &[&str]) -> (Vec<String>, Vec<f64>) {
    let json = rig.json("ladder", more);
    let missing = json["missing"].as_array().unwrap().iter().map(|m| format!("{} at {}", m["effect"], m["at"]));
    let costs = json["rungs"].as_array().unwrap().iter().map(|r| r["cost"].as_f64().unwrap());
    (missing.chain([json["verdict"].to_string(), json["ended"].to_string()]).collect(), costs.collect())
}

#[test]
fn kills_leave_nothing_half_written() {
    let number = |name: &str, or: u64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(or);
    let (kills, mut random) = (number("MISFIT_KILLS", 9), Random(number("MISFIT_HOSTILE_SEED", 20_261_124)));
    let rig = Rig::hiding(|x, v| 2.0 * x * x * x + 0.4 * (v / 0.5).tanh());
    rig.write(
        "study.toml",
        &(rig.read("study.toml") + "[[effect]]\neffect = \"elastic_slip\"\nat = \"c1.x\"\nf = \"1 N\"\nd = \"0.05 mm\"\n"),
    );
    let before = rig.read("study.toml");
    let whole = rig.path("whole").display().to_string();
    let undisturbed = cost(&rig, &["--out", &whole]);
    let found = climbed(&rig, &["--out", &whole]);
    // How long each verb takes; kills fall within 1.1 of it.
    let took = VERBS.map(|verb| {
        let started = Instant::now();
        assert!(command(&rig, verb, &rig.path("timed")).status().unwrap().success(), "{verb}");
        rig.write("study.toml", &before);
        std::fs::remove_dir_all(rig.path("timed")).unwrap();
        started.elapsed().as_secs_f64()
    });
    let (mut resumed, mut climbed_on, mut killed) = (0, 0, 0);
    for k in 0..kills as usize {
        let (verb, out) = (VERBS[k % 3], rig.path("out"));
        let mut child = command(&rig, verb, &out).spawn().unwrap();
        let part = random.below(1 << 20) as f64 / f64::from(1 << 20);
        std::thread::sleep(Duration::from_secs_f64(1.1 * part * took[k % 3]));
        let _ = child.kill();
        killed += usize::from(child.wait().unwrap().code().is_none());
        let bad = halves(rig.folder());
        assert!(bad.is_empty(), "kill {k} of {verb} after {:.3} s: {bad:?}", 1.1 * part * took[k % 3]);
        if verb == "fit" && out.join("checkpoint.json").is_file() {
            let again = rig.path("again").display().to_string();
            let found = cost(&rig, &["--resume", &out.display().to_string(), "--out", &again, "--threads", "1"]);
            assert!((found - undisturbed).abs() <= 1e-6 * undisturbed, "kill {k}: {found} resumed, {undisturbed} undisturbed");
            resumed += 1;
        }
        if verb == "ladder" && out.join("fits.journal").is_file() {
            let again = rig.path("again").display().to_string();
            let (what, costs) = climbed(&rig, &["--resume", &out.display().to_string(), "--out", &again, "--threads", "1"]);
            assert_eq!(what, found.0, "kill {k}");
            assert_eq!(costs.len(), found.1.len(), "kill {k}");
            let off = costs.iter().zip(&found.1).map(|(a, b)| (a - b).abs() / b).fold(0.0, f64::max);
            assert!(off <= 1e-6, "kill {k}: {costs:?} resumed, {:?} undisturbed", found.1);
            climbed_on += 1;
        }
        // A killed `add` leaves the study as it was, or with the whole effect.
        let now = rig.read("study.toml");
        assert!(
            now == before || (verb == "add" && now.starts_with(&before) && now.contains("cubic_stiffness")),
            "kill {k} of {verb}: {now}"
        );
        rig.write("study.toml", &before);
        let _ = std::fs::remove_dir_all(&out);
    }
    println!("{kills} kills, {killed} in time, {resumed} fits and {climbed_on} ladders resumed");
}
