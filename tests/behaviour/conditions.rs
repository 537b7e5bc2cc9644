//! A law over a condition that the study knows nothing of, strong enough that no slope at one value for all states leads to it. The loops are a
//! slider's exact path, computed here.

use std::f64::consts::TAU;

use crate::rig::{Rig, noise};

const K: f64 = 20.0;
const SLIDES_AT: f64 = 0.2;
const LIMIT: f64 = 30.0;
/// Growth of the limit with the contact area about 15 mm2: a quarter of it at 9, two and a half times it at 28.
const GROWTH: f64 = 0.12;
const STATES: [(f64, f64); 6] = [(0.1, 9.0), (0.3, 9.0), (0.5, 12.0), (0.3, 20.0), (0.1, 28.0), (0.5, 28.0)];
const EXPONENT: f64 = 0.8;

const STUDY: &str = r#"schema = 1
dataset = "data"
split = { select = ["a1-0", "a3-1"], held_out = ["a2-1", "a5-0"] }
[search]
effects = ["linear_law", "interference_law", "coulomb", "cubic_stiffness", "maxwell", "iwan"]
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
c = { start = "0.01 N s/mm", min = "0 N s/mm" }
[[effect]]
effect = "elastic_slip"
at = "c1.x"
f = { start = "20 N", min = "0 N" }
d = { start = "0.1 mm" }
[[effect]]
effect = "interference_law"
at = "c1.x"
of = "elastic_slip.f"
condition = "i"
reference = "0.3 mm"
a = { start = "0.3 1/mm", min = "0 1/mm" }
"#;

fn rig() -> Rig {
    let rig = Rig::new();
    let (mut state, mut toml) = (97531u64, "schema = 1\n".to_string());
    for (s, (i, area)) in STATES.iter().enumerate() {
        let limit = LIMIT * (1.0 + GROWTH * (area - 15.0)) * (EXPONENT * (i - 0.3)).exp();
        for (n, most) in [0.5, 1.5].iter().enumerate() {
            let (mut csv, mut slider, mut before) = ("t,x,F\n".to_string(), 0.0f64, 0.0);
            for k in 0..5 * 400 {
                let x = most * (TAU * f64::from(k) / 400.0).sin();
                slider = (slider + limit / SLIDES_AT * (x - before)).clamp(-limit, limit);
                before = x;
                csv += &format!("{:.6},{x:.6},{:.5}\n", f64::from(k) / 400.0, K * x + slider + 0.3 * noise(&mut state));
            }
            rig.write(&format!("data/a{s}-{n}.csv"), &csv);
            toml += &format!(
                "[[test]]\nid = \"a{s}-{n}\"\nkind = \"cycle\"\nfile = \"a{s}-{n}.csv\"\ncontrol = \"displacement\"\nconditions = {{ frequency = \
                 \"1 Hz\", i = \"{i} mm\", A = \"{area} mm2\" }}\ndiscard_cycles = 1\nchannels = [{{ role=\"time\", column=\"t\", unit=\"s\" }}, {{ \
                 role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\" }}, {{ role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\" }}]\n"
            );
        }
    }
    rig.write("data/dataset.toml", &toml);
    rig.write("study.toml", STUDY);
    rig
}

#[test]
fn a_limit_that_grows_tenfold_with_the_contact_area_is_named_alone() {
    let ran = rig().run("ladder", &["--json"]);
    let result = ran.json();
    assert!(
        ran.stderr.contains("added linear_law at c1.x (elastic_slip.f over A): "),
        "a law is told with what it acts on: {}",
        ran.stderr
    );
    let missing = result["missing"].as_array().unwrap();
    assert!(missing.len() == 1 && missing[0]["effect"] == "linear_law" && missing[0]["at"] == "c1.x", "{missing:?}");
    let of = |name: &str| {
        let rungs = result["rungs"].as_array().unwrap();
        let list = rungs.last().unwrap()["parameters"].as_array().unwrap();
        list.iter().find(|p| p["name"].as_str().unwrap().contains(name)).unwrap_or_else(|| panic!("{name} in {list:?}"))["value"]
            .as_f64()
            .unwrap()
    };
    // The slope is relative to the limit at a middle value of the areas, 20 mm2.
    let (a, i) = (of("linear_law"), of("interference_law"));
    let ratio = |x: f64| 1.0 + 1e-6 * a * (x - 20.0);
    let put_in = (1.0 + GROWTH * 13.0) / (1.0 - GROWTH * 6.0);
    println!(
        "limit at 28 over that at 9 mm2: {:.3}, put in {put_in:.3}; exponent {:.4} per mm, put in {EXPONENT}",
        ratio(28.0) / ratio(9.0),
        1e-3 * i
    );
    assert!((ratio(28.0) / ratio(9.0) / put_in - 1.0).abs() < 0.03 && (1e-3 * i / EXPONENT - 1.0).abs() < 0.02);
    assert!(result["held_out"]["after"].as_f64().unwrap() < 1.2 * result["held_out"]["floor"].as_f64().unwrap());
}
