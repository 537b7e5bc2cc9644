//! Sensitivities of whole responses, channels included, against central differences.

use std::fmt::Write;
use std::path::Path;

use misfit::identify::LeastSquares;
use misfit::residual::{Approach, Problem};
use misfit::response::Plan;
use misfit::study::Study;

/// Largest difference of the analytic Jacobian from central differences, over the largest entry of its column: of the whitened residuals,
/// and of those that the approach from a distant start goes by.
fn worst(study: &Path) -> f64 {
    let study = Study::load(study, None).unwrap();
    let plans: Vec<Plan> = study.dataset.tests.iter().map(|t| Plan::new(t, &study.system.model).unwrap()).collect();
    let problem = Problem::new(plans.iter().collect(), study.system.clone());
    let p = problem.variables();
    worst_of(&problem, &problem, &p).max(worst_of(&Approach::new(&problem), &problem, &p))
}

fn worst_of(residuals: &impl LeastSquares, problem: &Problem, p: &[f64]) -> f64 {
    let (_, j) = residuals.jacobian(p).unwrap();
    // What moves nothing, as a delay the magnitude of an FRF, does so to rounding.
    let nothing = (1e-6 * j.amax()).max(f64::MIN_POSITIVE);
    let mut worst: f64 = 0.0;
    for k in 0..p.len() {
        // The best of three steps: truncation and rounding pull in opposite directions.
        let gap = [1e-4, 1e-5, 1e-6].map(|h| {
            let at = |sign: f64| {
                let mut q = p.to_vec();
                q[k] += sign * h * q[k].abs().max(1e-3);
                residuals.residuals(&q).unwrap()
            };
            let numeric = (at(1.0) - at(-1.0)) / (2.0 * h * p[k].abs().max(1e-3));
            (&numeric - j.column(k)).amax() / numeric.amax().max(nothing)
        });
        let best = gap.into_iter().fold(f64::INFINITY, f64::min);
        println!("{}: {best:.1e}", problem.free[k].name);
        worst = worst.max(best);
    }
    worst
}

const EFFECTS: &str = r#"
[[effect]]
effect = "linear_stiffness"
at = "base.x"
k = "20 N/mm"
[[effect]]
effect = "linear_stiffness"
at = "c1-2.x"
k = "15 N/mm"
[[effect]]
effect = "viscous"
at = "c1-2.x"
c = "0.01 N s/mm"
[[effect]]
effect = "maxwell"
at = "base.x"
k = "3 N/mm"
tau = "3 ms"
[[effect]]
effect = "elastic_slip"
at = "c1.x"
f = "2 N"
d = "0.1 mm"
[[effect]]
effect = "support_compliance"
at = "c2.x"
s = "0.005 mm/N"
"#;

fn study(dataset: &str, effects: &str, csv: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(
        dir.path().join("study.toml"),
        format!("schema = 1\ndataset = \".\"\n{}{EFFECTS}{effects}", super::rig::chain(3, "0.2 kg")),
    )
    .unwrap();
    std::fs::write(dir.path().join("dataset.toml"), format!("schema = 1\n{dataset}")).unwrap();
    std::fs::write(dir.path().join("data.csv"), csv).unwrap();
    dir
}

#[test]
fn an_frf_with_its_measuring_chain() {
    let mut csv = String::from("f,re,im,coh\n");
    (0..60).for_each(|k| writeln!(csv, "{},{},{},0.99", 5.0 + k as f64, 0.1 + 0.01 * k as f64, -0.02).unwrap());
    let dir = study(
        r#"
[[test]]
id = "frf"
kind = "frf"
file = "data.csv"
excite = "m3.x"
respond = "m1.x"
quantity = "accelerance"
channels = [
 { role="frequency", column="f", unit="Hz" },
 { role="real", column="re", unit="m/s2/N" },
 { role="imag", column="im", unit="m/s2/N" },
 { role="coherence", column="coh", averages=20 }]
"#,
        r#"
[[effect]]
effect = "delay"
at = "frf.response"
tau = "0.2 ms"
[[effect]]
effect = "gain"
at = "frf.force"
g = 1.03
[[effect]]
effect = "moving_mass"
at = "frf.force"
m = "0.02 kg"
[[effect]]
effect = "accelerometer_mass"
at = "frf.response"
m = "0.03 kg"
"#,
        &csv,
    );
    let worst = worst(dir.path());
    assert!(worst < 1e-6, "{worst}");
}

fn history(samples: usize, dt: f64) -> String {
    let mut csv = String::from("t,x,F\n");
    for k in 0..samples {
        let t = k as f64 * dt;
        writeln!(
            csv,
            "{t},{},{}",
            3.0 * (31.4159265358979 * t).sin(),
            4.0 * (31.4159265358979 * t).sin() + 0.01 * ((k * 7919) % 13) as f64
        )
        .unwrap();
    }
    csv
}

#[test]
fn a_loop_with_its_measuring_chain() {
    let dir = study(
        r#"
[[test]]
id = "loop"
kind = "cycle"
file = "data.csv"
control = "displacement"
conditions = { frequency = "5 Hz" }
channels = [
 { role="time", column="t", unit="s" },
 { role="displacement", at="m3.x", column="x", unit="mm" },
 { role="force", at="m3.x", column="F", unit="N", sigma="0.1 N" }]
"#,
        r#"
[[effect]]
effect = "delay"
at = "loop.force"
tau = "0.7 ms"
[[effect]]
effect = "gain"
at = "loop.force"
g = 1.03
[[effect]]
effect = "offset"
at = "loop.force"
b = "0.4 N"
[[effect]]
effect = "moving_mass"
at = "loop.force"
m = "0.5 kg"
"#,
        &history(1001, 0.001),
    );
    let worst = worst(dir.path());
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn a_transient_record() {
    // From rest: the slopes of a beginning in motion are by differences, and have a test of their own (`response::beginning`).
    // Finely sampled: slopes to springs, dampers and masses are of fourth order in the step (`engine::exact_tests`), all others those of the steps themselves.
    let mut from_rest = String::from("t,x,F\n");
    for k in 0..3001 {
        let rises = 1.0 - (31.4159265358979 * 0.0001 * f64::from(k)).cos();
        writeln!(from_rest, "{},{},{}", 0.0001 * f64::from(k), 3.0 * rises, 4.0 * rises + 0.01 * f64::from((k * 7919) % 13)).unwrap();
    }
    let dir = study(
        r#"
[[test]]
id = "record"
kind = "transient"
file = "data.csv"
control = "displacement"
channels = [
 { role="time", column="t", unit="s" },
 { role="displacement", at="m3.x", column="x", unit="mm" },
 { role="force", at="m3.x", column="F", unit="N", sigma="0.1 N" },
 { role="velocity", at="c1.x", column="x", unit="mm/s", sigma="1 mm/s" },
 { role="acceleration", at="m1.x", column="F", unit="m/s2", sigma="1 m/s2" }]
"#,
        "",
        &from_rest,
    );
    let worst = worst(dir.path());
    assert!(worst < 1e-5, "{worst}");
}

#[test]
fn energies_per_cycle_and_modes() {
    let dir = study(
        r#"
[[test]]
id = "table"
kind = "energy"
at = "m3.x"
control = "force"
force_min = "-2 N"
force_max = "6 N"
W_s_reading = "slope"
rows = [
  { frequency = "1 Hz", W_D = "1.04 mJ", W_s = "2.07 mJ" },
  { frequency = "5 Hz", W_D = "1.77 mJ", W_s = "2.39 mJ" },
]
[[test]]
id = "modes"
kind = "modal"
rows = [
  { mode = 1, frequency = "20 Hz", damping = "2 %" },
  { mode = 2, frequency = "60 Hz", damping = "2 %" },
]
"#,
        "",
        "",
    );
    let worst = worst(dir.path());
    assert!(worst < 1e-5, "{worst}");
}
