//! `check` of models of many bodies.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::time::Instant;

use super::rig::{Rig, chain};

/// A chain of so many bodies with an FRF of its first one, by the chain's own recurrence of dynamic stiffnesses.
fn study(count: usize) -> Rig {
    let (m, k, c) = (0.1, 100e3, 2.0);
    let mut text = "f,re,im\n".to_string();
    for n in 1..=100 {
        let f = 5.0 * f64::from(n);
        let w = TAU * f;
        let link = (k, c * w);
        let divided = |a: (f64, f64), b: (f64, f64)| {
            let s = b.0 * b.0 + b.1 * b.1;
            ((a.0 * b.0 + a.1 * b.1) / s, (a.1 * b.0 - a.0 * b.1) / s)
        };
        // From the free end on: what stands behind a link is that link in series with it.
        let mut d = (-m * w * w, 0.0);
        for _ in 1..count {
            let product = (link.0 * d.0 - link.1 * d.1, link.0 * d.1 + link.1 * d.0);
            let series = divided(product, (link.0 + d.0, link.1 + d.1));
            d = (series.0 - m * w * w, series.1);
        }
        let (re, im) = divided((1.0, 0.0), (d.0 + link.0, d.1 + link.1));
        writeln!(text, "{f},{re:e},{im:e}").unwrap();
    }
    let rig = Rig::new();
    rig.write("data/frf.csv", &text);
    rig.write(
        "data/dataset.toml",
        "schema = 1\n[[test]]\nid = \"frf-1\"\nkind = \"frf\"\nfile = \"frf.csv\"\nexcite = \"m1.x\"\nrespond = \"m1.x\"\nquantity = \"receptance\"\nnoise = \"1 %\"\n\
         channels = [\n { role=\"frequency\", column=\"f\", unit=\"Hz\" },\n { role=\"real\", column=\"re\", unit=\"m/N\" },\n { role=\"imag\", column=\"im\", unit=\"m/N\" }]\n",
    );
    let effect = |effect: &str, at: &str, value: &str| format!("[[effect]]\neffect = \"{effect}\"\nat = {at}\n{value}\n");
    let places = format!("[\"base.x\", \"c1-{}.x\"]", count - 1);
    rig.write(
        "study.toml",
        &format!(
            "schema = 1\ndataset = \"data\"\n{}{}{}",
            chain(count, "0.1 kg"),
            effect("linear_stiffness", &places, "k = { start = \"90 N/mm\", min = \"0 N/mm\" }"),
            effect("viscous", &places, "c = { start = \"3 N s/m\", min = \"0 N s/m\" }")
        ),
    );
    rig
}

fn checked(count: usize) {
    let rig = study(count);
    let began = Instant::now();
    let found = rig.json("check", &[]);
    println!("check of {count} bodies: {:.2} s", began.elapsed().as_secs_f64());
    assert_eq!(found["ok"], true, "{found}");
    let free = found["free"].as_array().unwrap();
    assert!(free.len() == 2 && free.iter().all(|p| p["moves_residual"] == true), "{found}");
}

#[test]
fn a_model_of_2200_bodies_is_checked() {
    checked(2200);
}

/// A limit of a second and the three that a verb may take beyond it, in processor time of one thread: with matrices of all degrees of freedom a fit took 9 s, `diagnose` 20.
#[cfg(unix)]
#[test]
fn a_verb_on_2000_bodies_ends_in_time() {
    let rig = study(2000);
    for verb in ["fit", "diagnose", "ladder"] {
        let out = rig.path(verb).display().to_string();
        let study = rig.folder().display().to_string();
        let mut command = std::process::Command::new("sh");
        command.args(["-c", "ulimit -t 4; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_misfit")]);
        let ran = command.args([verb, &study, "--json", "--max-seconds", "1", "--threads", "1", "--out", &out]).output().unwrap();
        assert!(matches!(ran.status.code(), Some(0 | 130)), "{verb}: {:?} {}", ran.status, String::from_utf8_lossy(&ran.stderr));
        assert!(serde_json::from_slice::<serde_json::Value>(&ran.stdout).is_ok(), "{verb}");
    }
    // Out of time after the fit, the 36,014 candidates are not listed any more.
    let ran = rig.run("diagnose", &["--json", "--max-seconds", "1e-9", "--threads", "1"]);
    assert!(ran.code == 130 && !ran.stderr.contains("scoring") && ran.json()["verdict"] == "unexplained", "{} {}", ran.stdout, ran.stderr);
}

/// Asked of the release profile: at most 1 s and 10 s. `cargo test --release --test behaviour size -- --ignored --nocapture`.
#[test]
#[ignore = "measures seconds"]
fn seconds_of_a_check() {
    for count in [2200, 22_000] {
        checked(count);
    }
}
