//! What was released and left to itself: a mass on a spring that slides on its support, in closed form.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

use super::rig::{ONE_BODY, Rig, noise};

const K: f64 = 10e3;
const F: f64 = 2.0;

/// Displacement [m] of 1 kg on `K` that slides under the friction `F`, a time after it was let go at `x0`: half turns about `-+F/K`, until it sticks.
fn slides(x0: f64, t: f64) -> f64 {
    let (omega, d) = (K.sqrt(), F / K);
    let (mut x, mut left) = (x0, t * omega);
    loop {
        if x.abs() <= d {
            return x;
        }
        // Friction holds against the motion, which goes to zero from here.
        let centre = d * x.signum();
        if left < PI {
            return centre + (x - centre) * left.cos();
        }
        (x, left) = (2.0 * centre - x, left - PI);
    }
}

const EFFECTS: &str = r#"[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = { start = "9.7 N/mm", min = "0 N/mm" }
[[effect]]
effect = "coulomb"
at = "c1.x"
f = { start = "1 N", min = "0 N" }
vr = "2 mm/s"
"#;

/// Records of `t,x` in s and mm that begin so long after the release.
fn study(begins: &[f64]) -> Rig {
    let rig = Rig::new();
    let mut dataset = "schema = 1\n".to_string();
    for (n, begin) in begins.iter().enumerate() {
        let (mut text, mut state) = ("t,x\n".to_string(), 5 + n as u64);
        for i in 0..800 {
            let t = f64::from(i) * 5e-4;
            writeln!(text, "{t:.4},{:.6}", 1e3 * slides(5e-3, t + begin) + 0.01 * noise(&mut state)).unwrap();
        }
        rig.write(&format!("data/decay{n}.csv"), &text);
        write!(
            dataset,
            "[[test]]\nid = \"decay-{n}\"\nkind = \"transient\"\nfile = \"decay{n}.csv\"\ncontrol = \"free\"\nchannels = [\n \
             {{ role=\"time\", column=\"t\", unit=\"s\" }},\n {{ role=\"displacement\", at=\"m.x\", column=\"x\", unit=\"mm\", sigma=\"0.01 mm\" }}]\n"
        )
        .unwrap();
    }
    rig.write("data/dataset.toml", &dataset);
    rig.write("study.toml", &format!("{ONE_BODY}{EFFECTS}"));
    rig
}

#[test]
fn the_closed_form_loses_four_times_the_slip_a_turn_and_sticks() {
    let (turn, d) = (TAU / K.sqrt(), F / K);
    assert!((slides(5e-3, turn) - (5e-3 - 4.0 * d)).abs() < 1e-12);
    assert!(slides(5e-3, 20.0 * turn).abs() <= d);
}

#[test]
fn a_decay_gives_stiffness_and_friction_from_wherever_it_is_recorded() {
    // Let go at the first sample, and cut in the middle of a swing.
    let rig = study(&[0.0, 0.0123]);
    let json = rig.json("fit", &[]);
    let value = |name: &str| {
        let all = json["parameters"].as_array().unwrap();
        all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name}: {json}"))["value"].as_f64().unwrap()
    };
    assert!(json["termination"] == "converged" || json["termination"] == "stalled", "{}", json["termination"]);
    assert!((value("c1.x.linear_stiffness.k") / K - 1.0).abs() < 2e-3, "{}", json["parameters"]);
    assert!((value("c1.x.coulomb.f") / F - 1.0).abs() < 0.02, "{}", json["parameters"]);
    // Below `vr` the friction of the model creeps, where this one sticks: that is what is left.
    for test in json["tests"].as_array().unwrap() {
        assert!(test["error"].as_f64().unwrap() < 0.02, "{test}");
    }
}
