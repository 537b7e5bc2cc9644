//! A fit whose stiffnesses start so far off that no computed peak overlaps a measured one.

use std::f64::consts::TAU;
use std::fmt::Write;

use super::rig::{Rig, chain};

/// Truth [kg, N/mm, N s/mm].
const MASS: f64 = 0.1;
const STIFFNESS: [f64; 2] = [40.0, 25.0];
const DAMPING: f64 = 0.01;

type Complex = num_complex::Complex<f64>;

/// Accelerance [m/s2/N] at both bodies of ground - m1 - m2 under a force on m2, by Cramer's rule.
fn accelerance(f: f64) -> [Complex; 2] {
    let w = TAU * f;
    let [base, between] = STIFFNESS.map(|k| Complex::new(1e3 * k, 1e3 * DAMPING * w));
    let first = base + between - MASS * w * w;
    let second = between - MASS * w * w;
    let determinant = first * second - between * between;
    [between, first].map(|numerator| -w * w * numerator / determinant)
}

fn study(base: &str, between: &str, damping: &str) -> Rig {
    let rig = Rig::new();
    let mut tests = String::from("schema = 1\n");
    for body in 1..=2 {
        let mut csv = String::from("f,re,im,coh\n");
        for k in 0..240 {
            let f = 10.0 + f64::from(k);
            let h = accelerance(f)[body - 1];
            writeln!(csv, "{f},{},{},0.999", h.re, h.im).unwrap();
        }
        rig.write(&format!("data/m{body}.csv"), &csv);
        write!(
            tests,
            r#"[[test]]
id = "m{body}"
kind = "frf"
file = "m{body}.csv"
excite = "m2.x"
respond = "m{body}.x"
quantity = "accelerance"
channels = [
 {{ role="frequency", column="f", unit="Hz" }},
 {{ role="real", column="re", unit="m/s2/N" }},
 {{ role="imag", column="im", unit="m/s2/N" }},
 {{ role="coherence", column="coh", averages=20 }}]
"#
        )
        .unwrap();
    }
    rig.write("data/dataset.toml", &tests);
    let effects = format!(
        r#"[[effect]]
effect = "linear_stiffness"
at = "base.x"
k = {{ start = "{base}", min = "0 N/mm" }}
[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = {{ start = "{between}", min = "0 N/mm" }}
[[effect]]
effect = "viscous"
at = ["base.x", "c1.x"]
c = {{ start = "{damping}", min = "0 N s/mm" }}
"#
    );
    rig.write("study.toml", &format!("schema = 1\ndataset = \"data\"\nsplit = {{}}\n{}{effects}", chain(2, "0.1 kg")));
    rig
}

/// From the last of these the sum of squares alone leads to a damper that holds everything still; from the others it takes twice as many steps.
#[test]
fn stiffnesses_off_by_factors_are_found_from_frfs_alone() {
    for (base, between, damping) in
        [("7 N/mm", "4 N/mm", "0.01 N s/mm"), ("200 N/mm", "5 N/mm", "0.05 N s/mm"), ("250 N/mm", "150 N/mm", "0.002 N s/mm")]
    {
        let rig = study(base, between, damping);
        let fit = rig.json("fit", &[]);
        println!("{base} {between} {damping}: {} {}", fit["termination"], fit["cost"]);
        let value = |k: usize| fit["parameters"][k]["value"].as_f64().unwrap();
        for (k, truth) in [1e3 * STIFFNESS[0], 1e3 * STIFFNESS[1], 1e3 * DAMPING].into_iter().enumerate() {
            assert!(
                (value(k) - truth).abs() < 1e-3 * truth,
                "from {base}, {between}, {damping}: {} instead of {truth}",
                fit["parameters"][k]
            );
        }
        // The gate before the fit takes the same way, and finds nothing in it.
        let check = rig.json("check", &[]);
        assert_eq!(check["ok"], true, "{check}");
    }
}
