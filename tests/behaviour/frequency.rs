//! Frequency responses that cannot be what they are said to be: a turned sign, another quantity, another unit; and models that run away from them.

use std::f64::consts::TAU;
use std::fmt::Write;

use super::rig::{ONE_BODY, Ran, Rig, noise};

/// A body of 1 kg on a spring of 20 kN/m, 22.5 Hz, with 2 % of damping; the accelerance by real and imaginary part is what is measured.
const EFFECTS: &str = r#"[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = { start = "18 N/mm", min = "0 N/mm" }
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "4 N s/m", min = "0 N s/m" }
"#;

/// `f,re,im`: the accelerance times `factor`, over `power` times i w, with half a per cent of noise.
fn frf(factor: f64, integrals: i32) -> String {
    let (m, k, c) = (1.0, 20e3, 5.66);
    let (mut text, mut state) = ("f,re,im\n".to_string(), 7);
    for n in 10..160 {
        let f = f64::from(n) * 0.5;
        let w = TAU * f;
        // -w2 / (k - m w2 + i c w)
        let (re, im) = (k - m * w * w, c * w);
        let size = factor * -w * w / (re * re + im * im);
        let (mut re, mut im) = (size * re, -size * im);
        for _ in 0..integrals {
            (re, im) = (im / w, -re / w);
        }
        let far = 0.005 * re.hypot(im);
        writeln!(text, "{f},{:e},{:e}", re + far * noise(&mut state), im + far * noise(&mut state)).unwrap();
    }
    text
}

/// A study of one driving point: what was measured, and what it is said to be.
fn study(file: &str, quantity: &str, unit: &str) -> Rig {
    let rig = Rig::new();
    let dataset = format!(
        "schema = 1\n[[test]]\nid = \"frf-a\"\nkind = \"frf\"\nfile = \"frf.csv\"\nexcite = \"m.x\"\nrespond = \"m.x\"\nquantity = \"{quantity}\"\nnoise = \"0.5 %\"\n\
         channels = [\n {{ role=\"frequency\", column=\"f\", unit=\"Hz\" }},\n {{ role=\"real\", column=\"re\", unit=\"{unit}\" }},\n \
         {{ role=\"imag\", column=\"im\", unit=\"{unit}\" }}]\n"
    );
    rig.write("data/frf.csv", file);
    rig.write("data/dataset.toml", &dataset);
    rig.write("study.toml", &format!("{ONE_BODY}{EFFECTS}"));
    rig
}

fn accelerance(factor: f64) -> Rig {
    study(&frf(factor, 0), "accelerance", "m/s2/N")
}

/// What check holds against a study, and its notes.
fn checked(rig: &Rig) -> (Vec<String>, String) {
    let ran = rig.run("check", &["--json"]);
    let json = ran.json();
    let problems = json["problems"].as_array().unwrap().iter().map(|p| p["message"].as_str().unwrap().to_string()).collect();
    (problems, json["findings"].to_string())
}

#[test]
fn what_check_refuses_no_fit_begins_with() {
    let right = accelerance(1.0);
    assert!(checked(&right).0.is_empty(), "{:?}", checked(&right));
    let rig = accelerance(-1.0);
    let (problems, _) = checked(&rig);
    assert!(problems.len() == 1 && problems[0].contains("the sign of the force or of the response is turned"), "{problems:?}");
    let refused = |ran: Ran| {
        let [stage, place, message, accepted] = ran.error();
        assert!(stage == "data" && place.ends_with("frf.csv, test frf-a"), "{stage} {place}");
        assert!(accepted.contains("of an accelerance between 0 and 180"), "{accepted}");
        message
    };
    assert_eq!(refused(rig.run("fit", &["--json"])), problems[0]);
    let added = rig.run("add", &["cubic_stiffness", "--at", "c1.x", "--json"]);
    assert_eq!(refused(added), problems[0]);
    // A search turns a response back where a model says so too, and names the channel.
    let ladder = rig.json("ladder", &[]);
    let named = ladder["instruments"][0].clone();
    assert!(named["at"] == "frf-a.response" && named["why"].as_str().unwrap().contains("turned back"), "{named}");
    // Another of the three quantities is no turned channel.
    let rig = study(&frf(1.0, 1), "accelerance", "m/s2/N");
    let (problems, _) = checked(&rig);
    assert!(problems.len() == 1 && problems[0].contains("its phase is that of the mobility"), "{problems:?}");
    for verb in ["fit", "diagnose", "ladder"] {
        assert_eq!(refused(rig.run(verb, &["--json"])), problems[0], "{verb}");
    }
}

#[test]
fn a_unit_that_is_off_by_its_prefix_is_named() {
    assert_eq!(checked(&accelerance(1.0)).1, "[]");
    for (factor, said) in
        [(1e3, "a prefix: mm for m, or kN for N?"), (1e-3, "a prefix: mm for m, or kN for N?"), (1.0 / 9.80665, "g for m/s2")]
    {
        let (_, notes) = checked(&accelerance(factor));
        assert!(notes.contains("frf-a: over the whole band it is") && notes.contains(said), "{factor}: {notes}");
    }
    // A mass that is free and begins off by a fifth would take the factor up.
    let rig = accelerance(1e3);
    rig.change("study.toml", "mass = \"1 kg\"", "mass = { start = \"1.2 kg\", min = \"0.0001 kg\" }");
    assert!(checked(&rig).1.contains("a prefix: mm for m, or kN for N?"), "{:?}", checked(&rig));
}

/// The response of a light tip that moves with the body, its sign turned: no driving point, whose phase would say so.
#[test]
fn a_model_that_stands_still_has_run_away() {
    let rig = accelerance(-1.0);
    rig.change("data/dataset.toml", "respond = \"m.x\"", "respond = \"tip.x\"");
    rig.change("study.toml", "mass = \"1 kg\"", "mass = { start = \"1.2 kg\", min = \"0.001 kg\" }");
    let tip = "[[body]]\nname = \"tip\"\nmass = \"1 g\"\nfree = [\"x\"]\n[[connector]]\nname = \"c2\"\nfrom = \"m\"\nto = \"tip\"\n";
    let held = "[[effect]]\neffect = \"linear_stiffness\"\nat = \"c2.x\"\nk = { start = \"5000 N/mm\", fixed = true }\n";
    rig.change("study.toml", "[[connector]]\nname = \"c1\"", &format!("{tip}[[connector]]\nname = \"c1\""));
    let study = rig.read("study.toml");
    rig.write("study.toml", &(study + held));
    let ran = rig.run("fit", &["--json"]);
    let json = ran.json();
    let notes = json["notes"].to_string();
    assert!(ran.code == 1 && json["termination"] == "failed", "{notes} {}", json["parameters"]);
    assert!(notes.contains("m.x.mass_deviation.m` ran away: from 0") && notes.contains("stands still in `frf-a`"), "{notes}");
    // As it was measured the same study is fitted.
    rig.write("data/frf.csv", &frf(1.0, 0));
    assert_eq!(rig.json("fit", &[])["termination"], "converged");
}

/// One harmonic of a hardening spring at a constant response X: k + 3/4 k3 X^2, whatever force that takes.
#[test]
fn lines_that_were_held_at_one_response_give_a_cubic_spring() {
    let (k, k3, c, x) = (20e3, 4e8, 20.0, 2e-3);
    let mut text = "f,re,im\n".to_string();
    let mut forces = vec![];
    for n in 10..100 {
        let w = TAU * 0.5 * f64::from(n);
        let (re, im) = (k + 0.75 * k3 * x * x - w * w, c * w);
        let size = re * re + im * im;
        writeln!(text, "{},{:e},{:e}", 0.5 * f64::from(n), re / size, -im / size).unwrap();
        forces.push(x * size.sqrt());
    }
    let rig = study(&text, "receptance", "m/N");
    rig.change("study.toml", "k = { start = \"18 N/mm\", min = \"0 N/mm\" }", "k = { start = \"20 N/mm\", fixed = true }");
    let study = rig.read("study.toml").replace("4 N s/m", "17 N s/m");
    let cubic = "[[effect]]\neffect = \"cubic_stiffness\"\nat = \"c1.x\"\nk3 = { start = \"0.3 N/mm3\", min = \"0 N/mm3\" }\n";
    rig.write("study.toml", &(study + cubic));
    let found = |rig: &Rig| {
        let fit = rig.json("fit", &[]);
        let all = fit["parameters"].as_array().unwrap();
        all.iter().find(|p| p["name"] == "c1.x.cubic_stiffness.k3").unwrap()["value"].as_f64().unwrap()
    };
    let dataset = rig.read("data/dataset.toml");
    let said = |line: &str| rig.write("data/dataset.toml", &dataset.replace("noise =", &format!("{line}\nnoise =")));
    said("response_amplitude = \"2 mm\"");
    assert!((found(&rig) / k3 - 1.0).abs() < 0.01, "{}", found(&rig));
    // Its force line by line says the same, and one force for all lines does not.
    let mean = forces.iter().sum::<f64>() / forces.len() as f64;
    said(&format!("excitation = \"{mean} N\""));
    assert!((found(&rig) / k3 - 1.0).abs() > 0.5, "{}", found(&rig));
    let mut rows = text.lines();
    let header = format!("{},F\n", rows.next().unwrap());
    let rows = rows.zip(&forces).map(|(row, f)| format!("{row},{f}\n"));
    rig.write("data/frf.csv", &(header + &rows.collect::<String>()));
    let column = "channels = [\n { role=\"excitation\", column=\"F\", unit=\"N\" },";
    rig.write("data/dataset.toml", &dataset.replace("channels = [", column));
    assert!((found(&rig) / k3 - 1.0).abs() < 0.01, "{}", found(&rig));
}
