//! Base slack: a chain whose springs are not all alike is no missing physics. The data are a dense complex solve in the test, not the program's own.

use std::f64::consts::PI;
use std::path::Path;

use nalgebra::{Complex, DMatrix, DVector};

use crate::rig::noise;

const N: usize = 6;
/// Put in, relative: base spring and the five of the group; masses.
const SPRINGS: [f64; N] = [0.01, 0.02, -0.015, -0.15, 0.012, 0.02];
const MASSES: [f64; N] = [0.004, -0.006, 0.003, 0.0, 0.005, -0.004];

const STUDY: &str = r#"schema = 1
dataset = "data"
split = { select = ["frf-3-2"], held_out = ["frf-6-4"] }
[[body]]
name = "m"
count = 6
mass = "0.1 kg"
free = ["x"]
[[connector]]
name = "base"
from = "ground"
to = "m1"
[[connector]]
name = "c"
chain = "m"
[[effect]]
effect = "linear_stiffness"
at = "base.x"
k = { start = "150 N/mm", min = "0 N/mm" }
[[effect]]
effect = "linear_stiffness"
at = "c1-5.x"
k = { start = "100 N/mm", min = "0 N/mm" }
[[effect]]
effect = "viscous"
at = "base.x"
c = { start = "0.004 N s/mm", min = "0 N s/mm" }
[[effect]]
effect = "viscous"
at = "c1-5.x"
c = { start = "0.003 N s/mm", min = "0 N s/mm" }
"#;

fn folder(study: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let (mut k, mut c) = (DMatrix::<f64>::zeros(N, N), DMatrix::<f64>::zeros(N, N));
    for j in 0..N {
        let mut e = DVector::zeros(N);
        e[j] = 1.0;
        if j > 0 {
            e[j - 1] = -1.0;
        }
        let (stiffness, damping) = if j == 0 { (150e3, 4.0) } else { (100e3, 3.0) };
        k += &e * e.transpose() * (stiffness * (1.0 + SPRINGS[j]));
        c += &e * e.transpose() * damping;
    }
    let m = DMatrix::from_diagonal(&DVector::from_iterator(N, MASSES.iter().map(|d| 0.1 * (1.0 + d))));
    let mut state = 12345u64;
    let mut toml = "schema = 1\n".to_string();
    for (from, to) in [(1, 6), (6, 6), (3, 2), (6, 4), (1, 1)] {
        let mut csv = "f,re,im,coh\n".to_string();
        for line in 0..400 {
            let hz = 20.0 + 0.9 * f64::from(line);
            let w = 2.0 * PI * hz;
            let dynamic = DMatrix::from_fn(N, N, |i, j| Complex::new(k[(i, j)] - w * w * m[(i, j)], w * c[(i, j)]));
            let mut force = DVector::from_element(N, Complex::new(0.0, 0.0));
            force[from - 1] = Complex::new(1.0, 0.0);
            let h = dynamic.lu().solve(&force).unwrap()[to - 1] * (-w * w);
            let sigma = 0.01 * h.norm() / 2f64.sqrt();
            csv += &format!("{hz:.4},{:.8e},{:.8e},0.99\n", h.re + sigma * noise(&mut state), h.im + sigma * noise(&mut state));
        }
        std::fs::write(data.join(format!("frf-{from}-{to}.csv")), csv).unwrap();
        toml += &format!(
            "[[test]]\nid = \"frf-{from}-{to}\"\nkind = \"frf\"\nfile = \"frf-{from}-{to}.csv\"\nexcite = \"m{from}.x\"\nrespond = \"m{to}.x\"\n\
             quantity = \"accelerance\"\nchannels = [{{ role=\"frequency\", column=\"f\", unit=\"Hz\" }}, {{ role=\"real\", column=\"re\", \
             unit=\"m/s2/N\" }}, {{ role=\"imag\", column=\"im\", unit=\"m/s2/N\" }}, {{ role=\"coherence\", column=\"coh\", averages=50 }}]\n"
        );
    }
    std::fs::write(data.join("dataset.toml"), toml).unwrap();
    std::fs::write(dir.path().join("study.toml"), study).unwrap();
    dir
}

fn misfit(verb: &str, study: &Path) -> (bool, serde_json::Value) {
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_misfit")).args([verb, "--json"]).arg(study).output().unwrap();
    (run.status.success(), serde_json::from_slice(&run.stdout).unwrap())
}

#[test]
fn springs_of_a_group_that_are_not_alike_are_corrections_and_no_physics() {
    let dir = folder(STUDY);
    let (_, result) = misfit("ladder", dir.path());
    assert_eq!(result["verdict"], "nothing_missing", "{}", result["missing"]);
    assert!(result["missing"].as_array().unwrap().is_empty() && result["instruments"].as_array().unwrap().is_empty());
    // Noise in proportion to |H| lies on the few lines of a resonance, so that it is counted in its own units.
    let tests = result["rungs"][0]["tests"].as_array().unwrap();
    let held = tests.iter().find(|t| t["split"] == "held_out").unwrap()["whitened_rms"].as_f64().unwrap();
    assert!(held < 1.5, "{held}");
    // The odd spring beside the mean of the four others.
    let first = &result["corrections"][0];
    assert_eq!(
        (first["parameter"].as_str(), first["at"].as_str()),
        (Some("linear_stiffness.k"), Some("c3.x")),
        "{}",
        result["corrections"]
    );
    let put_in = (1.0 + SPRINGS[3]) / (1.0 + (SPRINGS[1] + SPRINGS[2] + SPRINGS[4] + SPRINGS[5]) / 4.0) - 1.0;
    let (relative, std) = (first["relative"].as_f64().unwrap(), first["std"].as_f64().unwrap());
    println!("{relative:.4} +- {std:.4}, put in {put_in:.4}; held-out at {held:.2} sigma");
    assert!((relative - put_in).abs() < 0.01 && std < 0.01, "{relative} +- {std} for {put_in}");
}

/// Without slack the same chain stands far from its noise.
#[test]
fn without_slack_the_chain_does_not_come_to_its_noise() {
    let dir = folder(&STUDY.replacen("[[body]]", "[search]\nslack = false\nmax_added = 0\n[[body]]", 1));
    let (_, result) = misfit("ladder", dir.path());
    assert!(result["corrections"].as_array().unwrap().is_empty());
    let tests = result["rungs"][0]["tests"].as_array().unwrap();
    let held = tests.iter().find(|t| t["split"] == "held_out").unwrap()["whitened_rms"].as_f64().unwrap();
    assert!(held > 5.0, "{held}");
}

#[test]
fn a_slack_that_means_nothing_is_refused() {
    let dir = folder(STUDY);
    let file = dir.path().join("study.toml");
    let refused = |from: &str, to: &str, said: &str, accepted: &str| {
        assert!(STUDY.contains(from));
        std::fs::write(&file, STUDY.replacen(from, to, 1)).unwrap();
        let (done, answer) = misfit("check", dir.path());
        let problem = &answer["problems"][0];
        let of = |key: &str| problem[key].as_str().unwrap_or_default().to_string();
        assert!(!done && of("message").contains(said) && of("accepted").contains(accepted) && of("where").contains("line"), "{answer}");
    };
    let k = "k = { start = \"100 N/mm\", min = \"0 N/mm\" }";
    let with = |slack: &str| k.replace(" }", &format!(", slack = {slack} }}"));
    refused(k, &with("\"0 %\""), "a slack of 0 %", "above 0 and below 100 %");
    refused(k, &with("\"100 %\""), "a slack of 100 %", "or no slack");
    refused(k, &with("\"3 mm\""), "mm", "");
    refused(
        "c = { start = \"0.003 N s/mm\", min = \"0 N s/mm\" }",
        "c = { start = \"0.003 N s/mm\", slack = \"5 %\" }",
        "slack of `viscous`",
        "mass of a body",
    );
    refused("mass = \"0.1 kg\"", "mass = { start = \"0.1 kg\", slack = \"0 %\" }", "a slack of 0 %", "below 100 %");
    refused("mass = \"0.1 kg\"", "mass = { start = \"0.1 kg\", min = \"0.2 kg\" }", "below min", "within");
    refused("mass = \"0.1 kg\"", "mass = { start = \"0 kg\", max = \"0.2 kg\" }", "the mass of body `m` is 0 kg", "above 0");
}

/// A mass that the study leaves open is fitted, within its bounds.
#[test]
fn a_free_mass_is_identified() {
    let dir = folder(&STUDY.replace("mass = \"0.1 kg\"", "mass = { start = \"0.12 kg\", min = \"0.05 kg\", max = \"0.2 kg\" }"));
    let (done, result) = misfit("fit", dir.path());
    assert!(done);
    let parameters = result["parameters"].as_array().unwrap();
    let masses: Vec<f64> = parameters
        .iter()
        .filter(|p| p["name"].as_str().unwrap().contains("mass_deviation"))
        .map(|p| 0.12 + p["value"].as_f64().unwrap() * if p["unit"] == "g" { 1e-3 } else { 1.0 })
        .collect();
    assert_eq!(masses.len(), N);
    // The springs are not alike, which the masses make up for a little: 5 %.
    let mean = masses.iter().sum::<f64>() / N as f64;
    assert!((mean / 0.1 - 1.0).abs() < 0.05, "{masses:?}");
}
