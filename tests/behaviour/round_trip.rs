//! Every kind of test through the virtual rig and back: the fit of what was simulated finds the truth within its own intervals.

use std::fmt::Write;

use super::rig::{Rig, chain, misfit};

const EFFECTS: &str = r#"[[effect]]
effect = "linear_stiffness"
at = "base.x"
k = { start = "40 N/mm", min = "0 N/mm" }
[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = { start = "25 N/mm", min = "0 N/mm" }
[[effect]]
effect = "viscous"
at = ["base.x", "c1.x"]
c = { start = "0.05 N s/mm", min = "0 N s/mm" }
"#;

/// A chain of two bodies with an FRF, a swept record, a table of energies.
fn rig() -> Rig {
    let rig = Rig::new();
    let mut frf = String::from("f,re,im,coh\n");
    for k in 1..=300 {
        // What is measured does not matter: the simulation puts its own numbers there.
        writeln!(frf, "{},1,0.5,0.9", f64::from(k)).unwrap();
    }
    rig.write("data/frf.csv", &frf);
    let mut sweep = String::from("t,x,F\n");
    for k in 0..2000 {
        let t = f64::from(k) * 1e-3;
        let w = std::f64::consts::TAU * 3.0 * t * t;
        writeln!(sweep, "{t:.6},{:.12},{:.12}", 0.5 * w.sin(), 10.0 * w.sin()).unwrap();
    }
    rig.write("data/sweep.csv", &sweep);
    rig.write(
        "data/dataset.toml",
        r#"schema = 1
[[test]]
id = "frf"
kind = "frf"
file = "frf.csv"
excite = "m2.x"
respond = "m1.x"
quantity = "mobility"
channels = [
 { role="frequency", column="f", unit="Hz" },
 { role="real", column="re", unit="mm/s/N" },
 { role="imag", column="im", unit="mm/s/N" },
 { role="coherence", column="coh", averages=20 }]
[[test]]
id = "sweep"
kind = "transient"
file = "sweep.csv"
control = "displacement"
channels = [
 { role="time", column="t", unit="s" },
 { role="displacement", at="m2.x", column="x", unit="mm" },
 { role="force", at="m2.x", column="F", unit="N", sigma="0.05 N" }]
[[test]]
id = "energies"
kind = "energy"
at = "m2.x"
control = "force"
force_min = "2 N"
force_max = "20 N"
W_s_reading = "slope"
rows = [ { frequency = "1 Hz", W_D = "1 mJ", W_s = "10 mJ" }, { frequency = "5 Hz", W_D = "1 mJ", W_s = "10 mJ" } ]
[[test]]
id = "modes"
kind = "modal"
rows = [ { mode = 1, frequency = "50 Hz", damping = "2 %" }, { mode = 2, frequency = "150 Hz", damping = "2 %" } ]
"#,
    );
    rig.write("study.toml", &format!("schema = 1\ndataset = \"data\"\n{}{EFFECTS}", chain(2, "0.1 kg")));
    rig
}

#[test]
fn frf_transient_energies_and_modes() {
    let rig = rig();
    let out = rig.path("virtual");
    let json = rig.json("simulate", &["--noise", "1 %", "--seed", "11", "--out", &out.display().to_string()]);
    let kinds: Vec<&str> = json["tests"].as_array().unwrap().iter().map(|t| t["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["frf", "transient", "energy", "modal"]);
    rig.change("study.toml", "dataset = \"data\"", "dataset = \"virtual\"");
    rig.change("study.toml", "40 N/mm", "50 N/mm").change("study.toml", "25 N/mm", "20 N/mm").change(
        "study.toml",
        "0.05 N s/mm",
        "0.1 N s/mm",
    );
    let fit = rig.json("fit", &[]);
    assert_eq!(fit["termination"], "converged");
    for (p, truth) in fit["parameters"].as_array().unwrap().iter().zip([40e3, 25e3, 50.0]) {
        let (value, std) = (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap());
        assert!((value - truth).abs() < 4.0 * std && std < 0.02 * truth, "{p}: truth {truth}");
    }
    for t in fit["tests"].as_array().unwrap() {
        // Noise of the coherence, of the range, of the value: what is said is what was put in.
        let rms = t["whitened_rms"].as_f64().unwrap();
        let n = t["n"].as_f64().unwrap();
        assert!((rms - 1.0).abs() < 4.0 / (2.0 * n).sqrt() + 0.1, "{} over {n}: {rms}", t["id"]);
    }
}

/// |H| of one body on a spring and a damper, against the closed form; the deviation against one redone with parameters moved by it.
#[test]
fn a_predicted_line_of_an_frf() {
    let rig = Rig::new();
    rig.change("study.toml", "free = [\"x\"]", "free = [\"x\"]\nmass = \"0.2 kg\"");
    let more =
        "[[prediction]]\ncase = \"line\"\nquantity = \"accelerance\"\nexcite = \"end.x\"\nrespond = \"end.x\"\nfrequency = \"40 Hz\"\n";
    rig.write("study.toml", &(rig.read("study.toml") + more));
    let mode = |quantity: &str| format!("[[prediction]]\ncase = \"first mode\"\nquantity = \"{quantity}\"\nmode = 1\n");
    rig.write("study.toml", &(rig.read("study.toml") + &mode("natural_frequency") + &mode("modal_damping")));
    let json = rig.json("predict", &[]);
    let value = |name: &str| {
        let list = json["fit"]["parameters"].as_array().unwrap();
        let p = list.iter().find(|p| p["name"].as_str().unwrap().contains(name)).unwrap();
        (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap())
    };
    let ((k, sk), (c, sc)) = (value("stiffness"), value("viscous"));
    let w = std::f64::consts::TAU * 40.0;
    let size = |k: f64, c: f64| w * w / (k - 0.2 * w * w).hypot(w * c);
    let p = &json["predictions"][0];
    let (found, std) = (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap());
    assert!((found - size(k, c)).abs() < 1e-9 * found, "{found} {}", size(k, c));
    let of = |k: usize, field: &str| json["predictions"][k][field].as_f64().unwrap();
    let (omega, zeta) = ((k / 0.2).sqrt(), c / (2.0 * (k * 0.2).sqrt()));
    // The frequency of a mode is |s| / 2 pi, the undamped one.
    assert!((of(1, "value") * std::f64::consts::TAU - omega).abs() < 1e-6 * omega, "{json}");
    assert!((of(2, "value") - zeta).abs() < 1e-6 * zeta, "{} {zeta}", of(2, "value"));
    // zeta = c / (2 sqrt(k m)): its deviation is that of c.
    assert!((of(2, "std") / zeta - sc / c).abs() < 0.05 * sc / c);
    // k and c of a settled cycle are all but uncorrelated (displacement and velocity are orthogonal).
    let (dk, dc) = (size(k + sk, c) - size(k, c), size(k, c + sc) - size(k, c));
    assert!((std - dk.hypot(dc)).abs() < 0.05 * std, "{std} {}", dk.hypot(dc));
}

/// One body on a spring and a damper under a force whose frequency rises through resonance, against a Runge-Kutta march of its equation.
#[test]
fn a_predicted_sweep() {
    let rig = Rig::new();
    rig.change("study.toml", "free = [\"x\"]", "free = [\"x\"]\nmass = \"0.2 kg\"");
    let sweep = "[[prediction]]\ncase = \"run-up\"\nquantity = \"sweep_range\"\nat = \"end.x\"\nrespond = \"end.x\"\namplitude = \"3 N\"\n\
                 frequency_from = \"5 Hz\"\nfrequency_to = \"90 Hz\"\nduration = \"0.6 s\"\n";
    rig.write("study.toml", &(rig.read("study.toml") + sweep));
    let json = rig.json("predict", &[]);
    let value = |name: &str| {
        let list = json["fit"]["parameters"].as_array().unwrap();
        list.iter().find(|p| p["name"].as_str().unwrap().contains(name)).unwrap()["value"].as_f64().unwrap()
    };
    let (k, c, m) = (value("stiffness"), value("viscous"), 0.2);
    let force = |t: f64| 3.0 * (std::f64::consts::TAU * (5.0 * t + 0.5 * 85.0 / 0.6 * t * t)).sin();
    let rate = |t: f64, [q, v]: [f64; 2]| [v, (force(t) - c * v - k * q) / m];
    let (mut at, mut low, mut high, h) = ([0.0; 2], 0.0f64, 0.0f64, 1e-5);
    for n in 0..60_000 {
        let t = n as f64 * h;
        let moved = |d: [f64; 2], by: f64| [at[0] + by * d[0], at[1] + by * d[1]];
        let a = rate(t, at);
        let b = rate(t + 0.5 * h, moved(a, 0.5 * h));
        let d = rate(t + 0.5 * h, moved(b, 0.5 * h));
        let e = rate(t + h, moved(d, h));
        at = [0, 1].map(|i| at[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * d[i] + e[i]));
        (low, high) = (low.min(at[0]), high.max(at[0]));
    }
    let p = &json["predictions"][0];
    let (found, std) = (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap());
    // Forty samples a period of the highest frequency miss a peak by 0.3 % at most.
    assert!((found / (high - low) - 1.0).abs() < 0.01, "{found} {}", high - low);
    assert!(std > 0.0 && std < 0.1 * found, "{std}");
    let run = std::path::PathBuf::from(json["run"].as_str().unwrap());
    assert!(run.join("sweeps.parquet").is_file());
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("<h2>Sweeps</h2>") && page.contains("Illustrative: the force is declared in the study, not measured."));
}

/// A body behind the one that a force drives, against the closed form of the two.
#[test]
fn a_predicted_travel_at_another_place() {
    let rig = Rig::new();
    let behind = "[[body]]\nname = \"tail\"\nmass = \"0.1 kg\"\nfree = [\"x\"]\n[[connector]]\nname = \"c2\"\nfrom = \"end\"\nto = \"tail\"\n\
                  [[effect]]\neffect = \"linear_stiffness\"\nat = \"c2.x\"\nk = { start = \"5 N/mm\", fixed = true }\n";
    let travel = "[[prediction]]\ncase = \"lengthening\"\nquantity = \"displacement_range\"\nat = \"end.x\"\nrespond = \"tail.x\"\ncontrol = \"force\"\n\
                  amplitude = \"3 N\"\nmean = \"1 N\"\nconditions = { frequency = \"10 Hz\" }\n";
    rig.write("study.toml", &(rig.read("study.toml") + behind + travel));
    let json = rig.json("predict", &[]);
    let value = |name: &str| {
        let list = json["fit"]["parameters"].as_array().unwrap();
        list.iter().find(|p| p["name"].as_str().unwrap().contains(name)).unwrap()["value"].as_f64().unwrap()
    };
    let (k, c, kt, m, w) = (value("c1.x.linear_stiffness"), value("viscous"), 5e3, 0.1, std::f64::consts::TAU * 10.0);
    // x_t = k_t x_e / (k_t - m w^2); (k + i w c + k_t) x_e - k_t x_t = F.
    let ratio = kt / (kt - m * w * w);
    let want = 2.0 * 3.0 * ratio / (k + kt * (1.0 - ratio)).hypot(w * c);
    let p = &json["predictions"][0];
    let (found, std) = (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap());
    assert!((found / want - 1.0).abs() < 1e-3, "{found} {want}");
    assert!(std > 0.0 && std < 0.1 * found, "{std}");
    // The result study says the same.
    let saved = std::fs::read_to_string(std::path::Path::new(json["run"].as_str().unwrap()).join("study.toml")).unwrap();
    assert!(saved.contains("respond = \"tail.x\""), "{saved}");
}

#[test]
fn raw_files_elsewhere() {
    let rig = Rig::new();
    std::fs::create_dir(rig.path("raw")).unwrap();
    for f in [1, 2, 5] {
        std::fs::rename(rig.path(&format!("data/loop{f}.csv")), rig.path(&format!("raw/loop{f}.csv"))).unwrap();
    }
    assert!(rig.run("fit", &["--json"]).error()[1].contains("loop1.csv"));
    let raw = rig.path("raw").display().to_string();
    let json = rig.json("fit", &["--data", &raw]);
    // The run says where they were.
    let again = misfit(&["compare", json["run"].as_str().unwrap(), "--json"]);
    assert_eq!(again.code, 0, "{}", again.stderr);
}
