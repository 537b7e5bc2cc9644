//! Responses whose excitation was not measured: an exact filter of this file shakes a body, and its spring and damper are found.

use std::fmt::Write;

use super::rig::{ONE_BODY, Rig, noise};

/// A body of 1 kg on a spring and a damper [N/m, N s/m].
const K: f64 = 10e3;
const C: f64 = 3.0;
/// Samples per second.
const RATE: f64 = 200.0;

/// `t,v` in s, mm/s: samples of a body under white noise are those of a filter with the poles of the body, exp(s / RATE).
fn record(samples: usize) -> String {
    let (decay, damped) = (-0.5 * C, (K - 0.25 * C * C).sqrt());
    let (a, b) = (2.0 * (decay / RATE).exp() * (damped / RATE).cos(), -(2.0 * decay / RATE).exp());
    let (mut state, mut x) = (7, [0.0; 2]);
    let mut text = "t,v\n".to_string();
    for n in 0..samples + 2000 {
        x = [a * x[0] + b * x[1] + noise(&mut state), x[0]];
        if n >= 2000 {
            writeln!(text, "{:.3},{:.5}", (n - 2000) as f64 / RATE, x[0] + 0.2 * noise(&mut state)).unwrap();
        }
    }
    text
}

#[test]
fn the_spring_and_the_damper_of_a_body_on_the_road_are_found() {
    let rig = Rig::new();
    rig.write("data/road.csv", &record(60_000));
    rig.write(
        "data/dataset.toml",
        "schema = 1\n[[test]]\nid = \"road\"\nkind = \"modal\"\noutput_only = true\nfile = \"road.csv\"\nchannels = [\n \
         { role=\"time\", column=\"t\", unit=\"s\" },\n { role=\"velocity\", at=\"m.x\", column=\"v\", unit=\"mm/s\" }]\n",
    );
    let effects = "[[effect]]\neffect = \"linear_stiffness\"\nat = \"c1.x\"\nk = { start = \"8 N/mm\", min = \"0 N/mm\" }\n\
                   [[effect]]\neffect = \"viscous\"\nat = \"c1.x\"\nc = { start = \"0.01 N s/mm\", min = \"0 N s/mm\" }\n";
    rig.write("study.toml", &format!("{ONE_BODY}{effects}"));
    let check = rig.run("check", &[]);
    assert!(check.code == 0 && check.stdout.contains("1 mode(s) at 15.9"), "{} {}", check.stdout, check.stderr);
    assert!(check.stdout.contains("identified from velocity at m.x without the excitation"), "{}", check.stdout);
    let fit = rig.run("fit", &["--json"]).json();
    let parameters = fit["parameters"].as_array().unwrap();
    for (name, truth, within) in [("linear_stiffness.k", K, 0.005), ("viscous.c", C, 0.2)] {
        let found = parameters.iter().find(|p| p["name"] == format!("c1.x.{name}")).unwrap();
        let (value, std) = (found["value"].as_f64().unwrap(), found["std"].as_f64().unwrap());
        assert!((value / truth - 1.0).abs() < within && (value - truth).abs() < 3.0 * std, "{name}: {found}");
    }
}
