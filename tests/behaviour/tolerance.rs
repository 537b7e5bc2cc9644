//! Tolerance cases of a damper whose energies have a closed form: `W_D = pi c omega X^2`, `c = c0 exp(a (i - i0))`.

use std::f64::consts::{PI, TAU};
use std::path::Path;

const STUDY: &str = r#"schema = 1
dataset = "data"
[[body]]
name = "end"
free = ["x"]
[[connector]]
name = "c1"
from = "ground"
to = "end"
[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = { start = "15 N/mm", min = "0 N/mm" }
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.2 N s/mm", min = "0 N s/mm" }
[[effect]]
effect = "interference_law"
at = "c1.x"
of = "viscous.c"
condition = "i"
reference = "0.2 mm"
a = { start = "1 1/mm" }
[tolerance]
dataset = "data/cases.toml"
test = "cases"
reference = "1"
conditions = { i = ["i_min", "i_max"] }
[tolerance.cycle]
at = "c1.x"
control = "displacement"
displacement_min = "-0.3 mm"
displacement_max = "0.3 mm"
frequency = "3 Hz"
"#;

/// Put in: stiffness [N/m], damping [N s/m] at 0.2 mm, exponent [1/m].
const TRUTH: (f64, f64, f64) = (20e3, 300.0, 4e3);

fn damping(i: f64) -> f64 {
    TRUTH.1 * (TRUTH.2 * (i - 0.2e-3)).exp()
}

/// The study with loops at these interferences [mm], and with cases of these.
pub fn folder(tested: &[f64], cases: &[f64]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    std::fs::create_dir(&data).unwrap();
    let mut toml = "schema = 1\n".to_string();
    for (k, i) in tested.iter().enumerate() {
        let hz = [2.0, 5.0, 3.0][k % 3];
        let row = |n: usize| {
            let (t, x) = (n as f64 * 0.01 / hz, 0.4e-3);
            let (s, c) = (TAU * n as f64 * 0.01).sin_cos();
            let force = TRUTH.0 * x * s + damping(i * 1e-3) * x * TAU * hz * c;
            format!("{t:.6},{:.8},{force:.8}\n", 1e3 * x * s)
        };
        let csv = "t,x,F\n".to_string() + &(0..400).map(row).collect::<String>();
        std::fs::write(data.join(format!("loop-{k}.csv")), csv).unwrap();
        toml += &format!(
            "[[test]]\nid = \"loop-{k}\"\nkind = \"cycle\"\nfile = \"loop-{k}.csv\"\ncontrol = \"displacement\"\nconditions = {{ frequency = \"{hz} Hz\", i = \
             \"{i} mm\" }}\nchannels = [{{ role=\"time\", column=\"t\", unit=\"s\" }}, {{ role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\" }}, \
             {{ role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\", sigma=\"0.02 N\" }}]\n"
        );
    }
    std::fs::write(data.join("dataset.toml"), toml).unwrap();
    let row = |(k, i): (usize, &f64)| {
        let energy = 1e3 * PI * damping(i * 1e-3) * TAU * 3.0 * 0.3e-3 * 0.3e-3;
        format!(
            "{{ case = \"{}\", W_D = \"{energy:.6} mJ\", conditions = {{ i_min = \"{} mm\", i_max = \"{} mm\" }} }}",
            k + 1,
            i - 0.01,
            i + 0.01
        )
    };
    let rows: Vec<String> = cases.iter().enumerate().map(row).collect();
    let table = format!(
        "schema = 1\n[[test]]\nid = \"cases\"\nkind = \"energy\"\nat = \"c1.x\"\ncontrol = \"displacement\"\nrows = [{}]\n",
        rows.join(",\n")
    );
    std::fs::write(data.join("cases.toml"), table).unwrap();
    std::fs::write(dir.path().join("study.toml"), STUDY).unwrap();
    dir
}

fn predict(study: &Path) -> serde_json::Value {
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_misfit")).args(["predict", "--json"]).arg(study).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

fn of<'a>(result: &'a serde_json::Value, case: &str, quantity: &str) -> &'a serde_json::Value {
    result["predictions"].as_array().unwrap().iter().find(|p| p["case"] == case && p["quantity"] == quantity).unwrap()
}

fn claims(result: &serde_json::Value) -> Vec<String> {
    result["tolerance"]["findings"].as_array().unwrap().iter().map(|f| f["claim"].as_str().unwrap().to_string()).collect()
}

/// The energies by the closed form; a case beyond the tests is predicted and says how far beyond.
#[test]
fn a_case_outside_what_was_tested_is_said_with_how_far() {
    let dir = folder(&[0.1, 0.2, 0.3], &[0.2, 0.25, 0.5]);
    let result = predict(dir.path());
    for (case, i) in [("1", 0.2e-3), ("2", 0.25e-3), ("3", 0.5e-3)] {
        let exact = PI * damping(i) * TAU * 3.0 * 0.3e-3 * 0.3e-3;
        let p = of(&result, case, "W_D");
        let value = p["value"].as_f64().unwrap();
        assert!((value / exact - 1.0).abs() < 2e-3, "case {case}: {value} for {exact}");
        let ratio = of(&result, case, "W_D_ratio")["value"].as_f64().unwrap();
        assert!((ratio / (damping(i) / damping(0.2e-3)) - 1.0).abs() < 2e-3, "case {case}: {ratio}");
        let beyond = p["extrapolated"].as_str().unwrap_or_default();
        assert_eq!(beyond.is_empty(), case != "3", "case {case}: {beyond}");
        if case == "3" {
            assert!(beyond.contains("0.2 mm outside 0.1 mm to 0.3 mm"), "{beyond}");
        }
    }
    assert!(claims(&result).iter().all(|c| !c.contains("no two tests differ")), "{:?}", claims(&result));
}

/// Where all tests were made at one interference, the exponent is nobody's: that is a finding, not a number without a word.
#[test]
fn a_law_over_a_condition_that_no_test_varies_is_a_finding() {
    let dir = folder(&[0.2, 0.2, 0.2], &[0.2, 0.25]);
    let result = predict(dir.path());
    let said = claims(&result);
    assert!(said.iter().any(|c| c.contains("law over i") && c.contains("no two tests differ in i")), "{said:?}");
    let parameters = result["fit"]["parameters"].as_array().unwrap();
    let law = parameters.iter().find(|p| p["name"].as_str().unwrap().contains("interference_law")).unwrap();
    assert_eq!(law["identifiable"], false, "{law}");
}
