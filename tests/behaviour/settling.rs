//! A record that has not settled is said not to have: a mass on a spring, started from rest, from the closed form.

use std::f64::consts::TAU;
use std::fmt::Write;

use super::rig::Rig;

const MASS: f64 = 1.0;
const K: f64 = 2e4;
const DAMPING: f64 = 0.005;
const DRIVE: f64 = 5.0;

/// x(t) of m x'' + c x' + k x = F sin(w t) from rest.
fn motion(t: f64, force: f64) -> f64 {
    let (wn, w) = ((K / MASS).sqrt(), TAU * DRIVE);
    let c = 2.0 * DAMPING * (K * MASS).sqrt();
    let (re, im) = (K - MASS * w * w, c * w);
    let (x, phase) = (force / re.hypot(im), im.atan2(re));
    let (decay, wd) = (DAMPING * wn, wn * (1.0 - DAMPING * DAMPING).sqrt());
    let a = x * phase.sin();
    let b = (decay * a - x * w * phase.cos()) / wd;
    x * (w * t - phase).sin() + (-decay * t).exp() * (a * (wd * t).cos() + b * (wd * t).sin())
}

/// 80 cycles of 100 samples at 5 Hz with noise of 1 um; the transient falls by half every cycle and a half.
fn rig(discarded: usize, last: usize) -> Rig {
    let rig = Rig::new();
    let mut csv = String::from("t,F,x\n");
    let mut state = 7u64;
    for k in 0..=100 * last {
        let t = k as f64 / (100.0 * DRIVE);
        let mut noise = -6.0;
        for _ in 0..12 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            noise += (state >> 11) as f64 / (1u64 << 53) as f64;
        }
        writeln!(csv, "{t:.12},{:.12},{:.12}", 10.0 * (TAU * DRIVE * t).sin(), 1e3 * motion(t, 10.0) + 1e-3 * noise).unwrap();
    }
    rig.write("data/loop1.csv", &csv);
    rig.write(
        "data/dataset.toml",
        &format!(
            "schema = 1\n[[test]]\nid = \"shaken\"\nkind = \"cycle\"\nfile = \"loop1.csv\"\ncontrol = \"force\"\ndiscard_cycles = {discarded}\n\
             conditions = {{ frequency = \"5 Hz\" }}\nchannels = [\n {{ role=\"time\", column=\"t\", unit=\"s\" }},\n \
             {{ role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\" }},\n {{ role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\", sigma=\"0.001 mm\" }}]\n"
        ),
    );
    rig.change("study.toml", "split = { select = [\"loop-2Hz\"], held_out = [\"loop-5Hz\"] }\n", "search = { effects = [\"coulomb\"] }\n");
    rig.change("study.toml", "free = [\"x\"]", "free = [\"x\"]\nmass = \"1 kg\"");
    rig.change("study.toml", "15 N/mm", "19 N/mm");
    rig.change("study.toml", "0.3 N s/mm", "0.0013 N s/mm");
    rig
}

fn claims(rig: &Rig) -> Vec<String> {
    let json = rig.json("diagnose", &[]);
    let all = json["findings"].as_array().unwrap().iter().map(|f| f["claim"].as_str().unwrap().to_string());
    all.filter(|c| c.contains("not settled")).collect()
}

#[test]
fn a_record_that_has_not_settled_is_said_not_to_have() {
    let rig = rig(2, 22);
    let found = claims(&rig);
    assert!(found.iter().any(|c| c.starts_with("displacement at c1.x: not settled")), "the record: {found:#?}");
    assert!(found.iter().any(|c| c.contains("by the model") && c.contains("after 2 discarded")), "the model: {found:#?}");
    // People who only fit are told as well.
    assert!(rig.run("fit", &[]).stdout.contains("not settled"));
}

#[test]
fn a_record_that_has_settled_is_left_alone() {
    let found = claims(&rig(60, 80));
    assert!(found.is_empty(), "{found:#?}");
}
