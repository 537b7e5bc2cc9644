//! Natural frequency and damping over amplitude, taken cycle by cycle from free decays that an integrator of this file computes: what is hidden in them is found.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

use super::rig::{ONE_BODY, Rig, misfit, noise};

/// A body of 1 kg on a spring and a damper [N/m, N s/m].
const K: f64 = 10e3;
const C: f64 = 1.6;
/// Hidden friction [N].
const F: f64 = 0.2;
/// Deviations of a frequency and of a damping ratio, parts of their values.
const SIGMA: [f64; 2] = [2e-4, 1e-2];

/// One cycle of a decay: first harmonic of the displacement [m], frequency [Hz].
type Cycle = (f64, f64);

/// Cycles of the motion after a release at `x0`, by the classical Runge-Kutta method in steps of 10 us: from each upward passage through zero to the next.
fn cycles(x0: f64, hidden: impl Fn(f64, f64) -> f64, count: usize) -> Vec<Cycle> {
    let h = 1e-5;
    let rate = |[x, v]: [f64; 2]| [v, -K * x - C * v - hidden(x, v)];
    let along = |y: [f64; 2], k: [f64; 2], h: f64| [y[0] + h * k[0], y[1] + h * k[1]];
    let (mut y, mut t, mut found, mut began) = ([x0, 0.0], 0.0, Vec::new(), None);
    let mut samples: Vec<(f64, f64)> = Vec::new();
    while found.len() < count {
        assert!(t < 20.0, "the body sticks after {} cycles", found.len());
        let k1 = rate(y);
        let k2 = rate(along(y, k1, 0.5 * h));
        let k3 = rate(along(y, k2, 0.5 * h));
        let k4 = rate(along(y, k3, h));
        let next: [f64; 2] = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        if y[0] < 0.0 && next[0] >= 0.0 {
            let crossed = t + h * y[0] / (y[0] - next[0]);
            if let Some(start) = began.replace(crossed) {
                let period = crossed - start;
                let part =
                    |f: fn(f64) -> f64| samples.iter().map(|(t, x)| x * f(TAU * (t - start) / period)).sum::<f64>() * 2.0 * h / period;
                found.push((part(f64::cos).hypot(part(f64::sin)), period.recip()));
            }
            samples.clear();
        }
        (y, t) = (next, t + h);
        samples.push((t, y[0]));
    }
    found
}

/// Rows `X,f,zeta` in mm, Hz, % in rising amplitude, ten of a decay or one in three cycles, with noise.
fn table(cycles: &[Cycle], seed: u64) -> String {
    let (mut text, mut state) = ("X,f,zeta\n".to_string(), seed);
    let mut noisy = |value: f64, sigma: f64| value * (1.0 + sigma * noise(&mut state));
    for k in (1..cycles.len() - 1).rev().step_by((cycles.len() / 10).max(3)) {
        let decrement = 0.5 * (cycles[k - 1].0 / cycles[k + 1].0).ln();
        let damping = decrement / (TAU * TAU + decrement * decrement).sqrt();
        let frequency = cycles[k].1 / (1.0 - damping * damping).sqrt();
        let [frequency, damping] = [noisy(frequency, SIGMA[0]), noisy(damping, SIGMA[1])];
        writeln!(text, "{:.6},{frequency:.6},{:.6}", 1e3 * cycles[k].0, 100.0 * damping).unwrap();
    }
    text
}

/// Three decays from 3, 4 and 5 mm, the last of which is held out, against a spring and a damper.
fn study(hidden: impl Fn(f64, f64) -> f64 + Copy, count: usize) -> Rig {
    let rig = Rig::new();
    let mut dataset = "schema = 1\n".to_string();
    for (name, x0, seed) in [("small", 3e-3, 1), ("middle", 4e-3, 2), ("large", 5e-3, 3)] {
        rig.write(&format!("data/{name}.csv"), &table(&cycles(x0, hidden, count), seed));
        write!(
            dataset,
            "[[test]]\nid = \"{name}\"\nkind = \"backbone\"\nat = \"m.x\"\nmode = 1\nfile = \"{name}.csv\"\nchannels = [\n \
             {{ role=\"amplitude\", column=\"X\", unit=\"mm\" }},\n {{ role=\"frequency\", column=\"f\", unit=\"Hz\", sigma=\"{} Hz\" }},\n \
             {{ role=\"damping\", column=\"zeta\", unit=\"%\", sigma=\"{} %\" }}]\n",
            16.0 * SIGMA[0],
            100.0 * 0.01 * SIGMA[1],
        )
        .unwrap();
    }
    rig.write("data/dataset.toml", &dataset);
    let effects = "[[effect]]\neffect = \"linear_stiffness\"\nat = \"c1.x\"\nk = { start = \"9 N/mm\", min = \"0 N/mm\" }\n\
                   [[effect]]\neffect = \"viscous\"\nat = \"c1.x\"\nc = { start = \"0.003 N s/mm\", min = \"0 N s/mm\" }\n";
    let split = "dataset = \"data\"\nsplit = { select = [\"middle\"], held_out = [\"large\"] }\n";
    rig.write("study.toml", &format!("{}{effects}", ONE_BODY.replace("dataset = \"data\"\n", split)));
    rig
}

fn cubic(x: f64, _v: f64) -> f64 {
    2e8 * x * x * x
}

fn friction(_x: f64, v: f64) -> f64 {
    F * v / v.hypot(1e-4)
}

#[test]
fn the_decays_lie_on_the_closed_forms() {
    // One harmonic of a cubic spring: w^2 = (k + 3/4 k3 X^2)/m, to a part in a thousand at this amplitude.
    let (x, f) = cycles(3e-3, cubic, 3)[1];
    let omega = (K + 0.75 * 2e8 * x * x).sqrt();
    assert!((TAU * f / omega - 1.0).abs() < 1e-3, "{x} {f}");
    // Friction takes 4 F/k of the amplitude a cycle, beside what the damper takes.
    let slides = cycles(5e-3, friction, 6);
    let zeta = C / (2.0 * K.sqrt()) + 2.0 * F / (PI * K * slides[3].0);
    let decrement = 0.5 * (slides[2].0 / slides[4].0).ln();
    assert!((decrement / TAU / zeta - 1.0).abs() < 0.01, "{} {zeta}", decrement / TAU);
}

#[test]
fn a_hidden_spring_and_a_hidden_friction_are_found_from_frequency_and_damping_over_amplitude() {
    let value = |json: &serde_json::Value, name: &str| {
        let all = json["parameters"].as_array().unwrap();
        all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name}: {json}"))["value"].as_f64().unwrap()
    };
    let rig = study(cubic, 75);
    let check = rig.run("check", &[]);
    assert_eq!(check.code, 0, "{} {}", check.stdout, check.stderr);
    let ladder = rig.run("ladder", &[]);
    println!("{}", ladder.stdout);
    assert!(ladder.code == 0 && ladder.stdout.contains("Missing: cubic_stiffness at c1.x"), "{} {}", ladder.stdout, ladder.stderr);
    assert!(ladder.stdout.contains("Proven: "), "{}", ladder.stdout);
    // The law with the values that are hidden: the fit finds them.
    let law = "[[effect]]\neffect = \"cubic_stiffness\"\nat = \"c1.x\"\nk3 = { start = \"0.1 N/mm^3\", min = \"0 N/mm^3\" }\n";
    rig.write("with.toml", &format!("{}{law}", rig.read("study.toml")));
    let out = rig.path("fit").display().to_string();
    let fit = misfit(&["fit", &rig.path("with.toml").display().to_string(), "--json", "--out", &out]);
    let json = fit.json();
    for (name, truth) in [("linear_stiffness.k", K), ("viscous.c", C), ("cubic_stiffness.k3", 2e8)] {
        let found = value(&json, &format!("c1.x.{name}"));
        assert!((found / truth - 1.0).abs() < 0.01, "{name}: {found} {truth}");
    }
    let report = std::fs::read_to_string(rig.path("fit").join("report.html")).unwrap();
    assert!(report.contains("against amplitude") && report.contains("amplitude [mm]"));
    // The virtual rig writes such tests, and they are read again.
    let data = rig.path("simulated").display().to_string();
    let made = misfit(&["simulate", &rig.path("with.toml").display().to_string(), "--out", &data]);
    assert_eq!(made.code, 0, "{} {}", made.stdout, made.stderr);
    assert!(rig.read("simulated/dataset.toml").contains("kind = \"backbone\""));

    // A friction by one of its laws; which of them these tables do not tell.
    let rig = study(friction, 15);
    let ladder = rig.run("ladder", &[]);
    println!("{}", ladder.stdout);
    let first = ladder.stdout.lines().find(|l| l.starts_with("Missing: ")).unwrap_or_else(|| panic!("{} {}", ladder.stdout, ladder.stderr));
    let names = ["coulomb", "elastic_slip", "smooth_coulomb", "lugre", "stribeck"];
    assert!(names.iter().any(|n| first.contains(n)) && first.contains("at c1.x") && !first.contains(','), "{first}");
}

#[test]
fn rows_of_no_mode_are_refused_with_their_place() {
    let rig = study(cubic, 12);
    let off = rig.read("data/small.csv").lines().take(2).collect::<Vec<_>>().join("\n");
    rig.write("data/small.csv", &format!("{off}\n{}\n", off.lines().last().unwrap()));
    let [_, place, message, accepted] = rig.run("compare", &["--json"]).error();
    assert!(
        place.contains("small.csv") && message.contains("after one of") && accepted.contains("each larger"),
        "{place} {message} {accepted}"
    );
    let rig = study(cubic, 12);
    let dataset = rig.read("data/dataset.toml");
    rig.write("data/dataset.toml", &dataset.replacen("mode = 1", "mode = 2", 1));
    let [_, _, message, accepted] = rig.run("compare", &["--json"]).error();
    assert!(message.contains("mode 2 was asked for, and the model has 1") && !accepted.is_empty(), "{message} {accepted}");
    assert!(message.contains(" mm there is no nonlinear mode") && !message.contains("(SI)"), "{message}");
}

/// Files of a backbone as laboratories leave them: with units, with letters alone, without a damping ratio; what is no backbone is none.
#[test]
fn new_recognises_a_table_of_a_backbone_and_marks_what_it_guesses() {
    let dir = tempfile::tempdir().unwrap();
    let rows = |head: &str, row: &dyn Fn(f64) -> String| (1..9).fold(format!("{head}\n"), |text, k| text + &row(f64::from(k)) + "\n");
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let all = |k: f64| format!("{},{},{}", 0.1 * k, 16.0 - 0.02 * k, 0.8 + 0.1 * k);
    let stated = write("stated.csv", &rows("amplitude [mm],frequency [Hz],damping ratio [%]", &all));
    let letters = write("letters.csv", &rows("X,f,zeta", &all));
    let ratio = write("ratio.csv", &rows("amplitude [mm],f,zeta", &|k| format!("{},{},{}", 0.1 * k, 16.0 - 0.02 * k, 0.008 + 0.001 * k)));
    let bare = write("bare.csv", &rows("amplitude [mm],frequency [Hz]", &|k| format!("{},{}", 0.1 * k, 16.0 - 0.02 * k)));
    let study = dir.path().join("study").display().to_string();
    let ran = misfit(&["new", &study, "--json", "--from", &stated, &letters, &ratio, &bare]);
    assert_eq!(ran.code, 0, "{} {}", ran.stdout, ran.stderr);
    let json = ran.json();
    let told = |k: usize| {
        let channels = json["found"][k]["channels"].as_array().unwrap_or_else(|| panic!("{json}"));
        channels
            .iter()
            .map(|c| format!("{}{} {}", c["role"].as_str().unwrap(), if c["guessed"] == true { "?" } else { "" }, c["unit"]))
            .collect::<Vec<_>>()
    };
    assert!((0..4).all(|k| json["found"][k]["what"] == "backbone" && json["found"][k]["rows"] == 8), "{json}");
    assert_eq!(told(0), ["amplitude \"mm\"", "frequency \"Hz\"", "damping \"%\""]);
    assert_eq!(told(1), ["amplitude? null", "frequency? null", "damping? \"%\""]);
    assert_eq!(told(2), ["amplitude \"mm\"", "frequency? null", "damping? null"]);
    assert_eq!(told(3), ["amplitude \"mm\"", "frequency \"Hz\""]);
    let dataset = std::fs::read_to_string(dir.path().join("study/data/dataset.toml")).unwrap();
    let marked = |what: &str| dataset.lines().any(|l| l.contains(what) && l.contains("confirm it"));
    assert!(
        marked("column = \"X\"") && marked("values of 1 and more, read as %") && marked("values below 1, read as a ratio"),
        "{dataset}"
    );
    assert!(marked("at = \"n1.x\"") && !marked("column = \"damping ratio [%]\""), "{dataset}");
    let confirm = json["to_confirm"].to_string();
    assert!(confirm.contains("letters: that `f` is the frequency, by its letter alone") && confirm.contains("no rms"), "{confirm}");
    assert!(confirm.contains("letters: the unit of `X` is not in the file"), "{confirm}");

    // With all units in the file the study is whole, and a compare answers in the unit of the table.
    let study = dir.path().join("whole").display().to_string();
    let ran = misfit(&["new", &study, "--from", &stated]);
    assert!(ran.code == 0 && ran.stdout.contains("table of a backbone: 8 rows"), "{} {}", ran.stdout, ran.stderr);
    let compared = misfit(&["compare", &study, "--json"]);
    let place = compared.json()["tests"][0]["worst"]["where"].as_str().unwrap().to_string();
    assert!(place.ends_with(" mm") && place.contains("at an amplitude of 0."), "{place}");
    // And the table on the terminal has the values there in theirs: this is a damping in %, which the JSON has as a ratio.
    let told = misfit(&["compare", &study]).stdout;
    let values = told.lines().find_map(|l| l.split_once(&format!("{place}: measured "))).map(|(_, values)| values.trim_end().to_string());
    assert!(values.as_ref().is_some_and(|v| v.contains(", computed ") && (v.ends_with('%') || v.ends_with("Hz"))), "{values:?} {told}");

    // Lines of a spectrum rise and fall, and a loop has a force: neither is a backbone.
    let spectrum =
        write("spectrum.csv", &rows("frequency [Hz],amplitude [mm]", &|k| format!("{},{}", 15.0 + k, 1.0 / (1.0 + (k - 4.0).powi(2)))));
    let ran = misfit(&["new", &dir.path().join("none").display().to_string(), "--json", "--from", &spectrum]);
    let [_, _, message, accepted] = ran.error();
    assert!(message.contains("neither a history") && accepted.contains("`damping [%]`"), "{message} {accepted}");
}
