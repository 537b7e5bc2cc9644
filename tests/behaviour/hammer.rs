//! A hammer's blows on two bodies, recorded in time by accelerometers; data from another integrator in steps of 5 us.

use std::fmt::Write;

use super::rig::{Rig, chain, noise};

/// Truth: kg, N/m, N s/m, N/m3.
const MASS: f64 = 0.6;
const STIFFNESS: [f64; 2] = [40e3, 25e3];
const DAMPING: f64 = 3.0;
const CUBIC: f64 = 8e10;

/// Blow of 2 ms.
fn force(t: f64, peak: f64) -> f64 {
    if t < 2e-3 { peak * (std::f64::consts::PI * t / 2e-3).sin().powi(2) } else { 0.0 }
}

/// Velocities and accelerations of ground - m1 - m2 under a force on m2.
fn rate([x1, x2, v1, v2]: [f64; 4], force: f64, cubic: f64) -> [f64; 4] {
    let (r, rv) = (x2 - x1, v2 - v1);
    let between = STIFFNESS[1] * r + DAMPING * rv + cubic * r * r * r;
    let base = STIFFNESS[0] * x1 + DAMPING * v1;
    [v1, v2, (between - base) / MASS, (force - between) / MASS]
}

/// t [s], F [N], accelerations of both bodies [g], velocity of m2 against m1 [mm/s], by the classical Runge-Kutta method.
fn record(peak: f64, cubic: f64, seed: u64) -> String {
    let (h, every) = (5e-6, 50);
    let (mut y, mut state) = ([0.0; 4], seed);
    let mut text = String::from("t,F,a1,a2,v\n");
    for k in 0..1000 * every {
        let t = h * f64::from(k);
        if k % every == 0 {
            let a = rate(y, force(t, peak), cubic);
            let mut noisy = |value: f64, sigma: f64| value + sigma * noise(&mut state);
            let size = peak / 60.0;
            let [a1, a2] = [noisy(a[2] / 9.80665, 0.01 * size), noisy(a[3] / 9.80665, 0.03 * size)];
            let v = noisy(1e3 * (y[3] - y[2]), 0.5 * size);
            writeln!(text, "{t:.6},{:.6},{a1:.6},{a2:.6},{v:.6}", force(t, peak)).unwrap();
        }
        let along = |y: [f64; 4], k: [f64; 4], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
        let k1 = rate(y, force(t, peak), cubic);
        let k2 = rate(along(y, k1, 0.5 * h), force(t + 0.5 * h, peak), cubic);
        let k3 = rate(along(y, k2, 0.5 * h), force(t + 0.5 * h, peak), cubic);
        let k4 = rate(along(y, k3, h), force(t + h, peak), cubic);
        y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    text
}

fn study(cubic: f64, starts: [&str; 2], channels: &str) -> Rig {
    let rig = Rig::new();
    let mut tests = String::from("schema = 1\n");
    for (name, peak, seed) in [("soft", 60.0, 1), ("middle", 120.0, 2), ("hard", 200.0, 3)] {
        rig.write(&format!("data/{name}.csv"), &record(peak, cubic, seed));
        write!(
            tests,
            r#"[[test]]
id = "{name}"
kind = "transient"
file = "{name}.csv"
control = "force"
channels = [
 {{ role="time", column="t", unit="s" }},
 {{ role="force", at="m2.x", column="F", unit="N" }},
 {channels}]
"#
        )
        .unwrap();
    }
    rig.write("data/dataset.toml", &tests);
    let effects = format!(
        r#"[[effect]]
effect = "linear_stiffness"
at = "base.x"
k = {{ start = "{}", min = "0 N/mm" }}
[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = {{ start = "{}", min = "0 N/mm" }}
[[effect]]
effect = "viscous"
at = ["base.x", "c1.x"]
c = {{ start = "0.001 N s/mm", min = "0 N s/mm" }}
"#,
        starts[0], starts[1]
    );
    let split = "split = { select = [\"middle\"] }";
    rig.write("study.toml", &format!("schema = 1\ndataset = \"data\"\n{split}\n{}{effects}", chain(2, "0.6 kg")));
    rig
}

const CHANNELS: &str = r#"{ role="acceleration", at="m1.x", column="a1", unit="g" },
 { role="acceleration", at="m2.x", column="a2", unit="g" },
 { role="velocity", at="c1.x", column="v", unit="mm/s" }"#;

/// The computed motion is out of phase after half a cycle, in some of them before the first is over.
#[test]
fn stiffnesses_off_by_factors_are_found_from_records_of_accelerometers() {
    for starts in [["30 N/mm", "30 N/mm"], ["110 N/mm", "9 N/mm"], ["13 N/mm", "70 N/mm"]] {
        let fit = study(0.0, starts, CHANNELS).json("fit", &[]);
        println!("{starts:?}: {} {}", fit["termination"], fit["cost"]);
        for (k, truth) in [STIFFNESS[0], STIFFNESS[1], DAMPING].into_iter().enumerate() {
            // The blow is known at its eight samples alone, which is what the last thousandths rest on.
            let value = fit["parameters"][k]["value"].as_f64().unwrap();
            assert!((value - truth).abs() < 5e-3 * truth, "from {starts:?}: {value} instead of {truth}");
        }
    }
}

/// A model without the cubic spring is out of step with the records after a few cycles.
#[test]
fn a_cubic_spring_is_found_in_records_that_the_model_cannot_follow() {
    let rig = study(CUBIC, ["30 N/mm", "30 N/mm"], CHANNELS);
    let ladder = rig.json("ladder", &[]);
    let errors: Vec<f64> = ladder["rungs"][0]["tests"].as_array().unwrap().iter().map(|t| t["error"].as_f64().unwrap()).collect();
    assert!(errors.iter().any(|e| *e > 0.5), "{errors:?}");
    let missing = &ladder["missing"];
    println!("{missing} {}", ladder["ended"]);
    assert!(missing[0]["effect"] == "cubic_stiffness" && missing[0]["at"] == "c1.x" && missing.as_array().unwrap().len() == 1, "{missing}");
    for test in ladder["rungs"][1]["tests"].as_array().unwrap() {
        let ratio = test["error"].as_f64().unwrap() / test["floor"].as_f64().unwrap();
        assert!((0.8..1.2).contains(&ratio), "{test}");
    }
}

/// The velocity of what is driven is the drive once more.
#[test]
fn a_record_of_nothing_but_its_drive_is_an_error() {
    let rig = study(0.0, ["30 N/mm", "30 N/mm"], CHANNELS);
    let channels = r#"{ role="displacement", at="m2.x", column="v", unit="mm" },
 { role="velocity", at="m2.x", column="a1", unit="mm/s" }"#;
    let tests = rig.read("data/dataset.toml").replace(CHANNELS, channels).replace("control = \"force\"", "control = \"displacement\"");
    let force = "{ role=\"force\", at=\"m2.x\", column=\"F\", unit=\"N\" },\n";
    rig.write("data/dataset.toml", &tests.replace(force, ""));
    let [stage, place, message, accepted] = rig.run("fit", &["--json"]).error();
    assert_eq!((stage.as_str(), place.as_str()), ("response", "soft"));
    assert!(message.contains("nothing in it is compared") && accepted.contains("answers the drive"), "{message} {accepted}");
}
