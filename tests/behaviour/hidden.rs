//! Chains whose truth is a closed form: a mass that a body carries, a loss at one of several equal springs, a record sampled coarsely.

use std::fmt::Write;
use std::path::Path;

use nalgebra::{Complex, Matrix3, Vector3};
use serde_json::Value;

use super::rig::{chain, misfit, noise};

fn study(folder: &Path, dataset: &str, study: &str) {
    std::fs::create_dir(folder.join("data")).unwrap();
    std::fs::write(folder.join("data/dataset.toml"), format!("schema = 1\n{dataset}")).unwrap();
    std::fs::write(folder.join("study.toml"), format!("schema = 1\ndataset = \"data\"\n{study}")).unwrap();
}

fn json(verb: &str, folder: &Path) -> Value {
    misfit(&[verb, "--json", &folder.display().to_string()]).json()
}

/// Three masses on springs and dampers, `carried` [kg] on the second of them, and between the last two a loss modulus `lossy` [N/m] that
/// stores nothing at 70 Hz and, as causality demands, (2/pi) ln(f/70 Hz) of it elsewhere: receptance of body `to` under a force on body
/// `from` [m/N].
fn receptance(hz: f64, from: usize, to: usize, (carried, lossy): (f64, f64)) -> Complex<f64> {
    let w = std::f64::consts::TAU * hz;
    let z = Complex::new(100e3, 30.0 * w);
    let last = z + lossy * Complex::new(std::f64::consts::FRAC_2_PI * (hz / 70.0).ln(), 1.0);
    let m = [0.4, 0.4 + carried, 0.4].map(|m| Complex::new(-w * w * m, 0.0));
    let o = Complex::new(0.0, 0.0);
    let dynamic = Matrix3::new(z + z + m[0], -z, o, -z, z + last + m[1], -last, o, -last, last + m[2]);
    let mut load = Vector3::repeat(o);
    load[from] = Complex::new(1.0, 0.0);
    dynamic.lu().solve(&load).unwrap()[to]
}

/// A ladder on three receptances of the chain. `search`: a line of study.toml.
fn ladder_of(truth: (f64, f64), search: &str) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let (mut dataset, mut state) = (String::new(), 7);
    let mut files = vec![];
    for (id, from, to) in [("a", 0, 2), ("b", 2, 2), ("c", 1, 1)] {
        let mut csv = String::from("f,re,im\n");
        for line in 0..200 {
            let hz = 10.0 + line as f64;
            let h = receptance(hz, from, to, truth);
            let sigma = 0.01 * h.norm() / 2f64.sqrt();
            writeln!(csv, "{hz},{},{}", h.re + sigma * noise(&mut state), h.im + sigma * noise(&mut state)).unwrap();
        }
        files.push((format!("{id}.csv"), csv));
        write!(
            dataset,
            "[[test]]\nid = \"{id}\"\nkind = \"frf\"\nfile = \"{id}.csv\"\nexcite = \"m{}.x\"\nrespond = \"m{}.x\"\nquantity = \"receptance\"\n\
             channels = [{{ role = \"frequency\", column = \"f\", unit = \"Hz\" }}, {{ role = \"real\", column = \"re\", unit = \"m/N\", \
             sigma = \"0.7 %\" }}, {{ role = \"imag\", column = \"im\", unit = \"m/N\", sigma = \"0.7 %\" }}]\n",
            from + 1,
            to + 1
        )
        .unwrap();
    }
    let effects = r#"
[[effect]]
effect = "linear_stiffness"
at = "base.x"
k = { start = "90 N/mm", min = "0 N/mm" }
[[effect]]
effect = "linear_stiffness"
at = "c1-2.x"
k = { start = "110 N/mm", min = "0 N/mm" }
[[effect]]
effect = "viscous"
at = "base.x"
c = { start = "0.02 N s/mm", min = "0 N s/mm" }
[[effect]]
effect = "viscous"
at = "c1-2.x"
c = { start = "0.02 N s/mm", min = "0 N s/mm" }
"#;
    let text = format!("split = {{ select = [\"b\"], held_out = [\"c\"] }}\n{search}{}{effects}", chain(3, "0.4 kg"));
    study(folder.path(), &dataset, &text);
    files.iter().for_each(|(name, csv)| std::fs::write(folder.path().join("data").join(name), csv).unwrap());
    json("ladder", folder.path())
}

/// `effect` must be all that is missing, at its place and with its strength (name, truth, relative deviation admitted).
fn climbs_to(truth: (f64, f64), effect: &str, at: &str, strength: (&str, f64, f64)) {
    let l = ladder_of(truth, "");
    let missing = l["missing"].as_array().unwrap_or_else(|| panic!("{l}"));
    assert_eq!(missing.len(), 1, "{}", l["missing"]);
    assert_eq!((&missing[0]["effect"], &missing[0]["at"]), (&effect.into(), &at.into()));
    let rungs = l["rungs"].as_array().unwrap();
    let list = rungs[rungs.len() - 1]["parameters"].as_array().unwrap();
    let name = format!("{at}.{effect}.{}", strength.0);
    let found = list.iter().find(|p| p["name"] == *name).unwrap_or_else(|| panic!("{name}: {list:?}"));
    approx::assert_relative_eq!(found["value"].as_f64().unwrap(), strength.1, max_relative = strength.2);
    // The seed is fixed, so the interval covers the truth or it does not.
    let end = |k: usize| found["interval"][k].as_f64().unwrap_or_else(|| panic!("{found}"));
    assert!(end(0) < strength.1 && strength.1 < end(1), "{found}");
    assert!(l["held_out"]["after"].as_f64().unwrap() < 1.2 * l["held_out"]["floor"].as_f64().unwrap(), "{}", l["held_out"]);
}

#[test]
fn a_sensors_mass_is_found_at_its_body() {
    climbs_to((0.02, 0.0), "added_mass", "m2.x", ("m", 0.02, 0.03));
}

/// Where nominal masses have slack, a twentieth is what a body may be off: a correction, and no physics.
#[test]
fn a_light_sensor_corrects_the_mass_of_its_body() {
    let l = ladder_of((0.02, 0.0), "search = { slack = true }\n");
    assert!(l["missing"].as_array().unwrap().is_empty() && l["verdict"] == "nothing_missing", "{}", l["missing"]);
    let first = &l["corrections"][0];
    assert_eq!((&first["parameter"], &first["at"]), (&"mass".into(), &"m2".into()), "{}", l["corrections"]);
    let (relative, std) = (first["relative"].as_f64().unwrap(), first["std"].as_f64().unwrap());
    assert!((relative - 0.05).abs() < 4.0 * std && std < 0.01, "{relative} +- {std}");
}

/// The springs share one stiffness: what the loss stores beside it at low and high frequencies must not be taken for another effect.
#[test]
fn a_loss_at_one_of_several_equal_springs_is_found_there() {
    // The data determine it within 7 %.
    climbs_to((0.0, 6e3), "structural_damping", "c2.x", ("h", 6e3, 0.07));
}

/// A mass on a spring, at rest until a sine begins to drive it: 20 samples per period are few for the march, not for the closed form.
#[test]
fn a_record_sampled_coarsely_gives_the_stiffness_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (m, k, c, drive, dt, sigma) = (1.0, 40e3f64, 20.0, 180.0, 1.57e-3, 2e-4);
    let decay = 0.5 * c / m;
    let w = (k / m - decay * decay).sqrt();
    let steady = Complex::new(100.0, 0.0) / Complex::new(k - m * drive * drive, c * drive);
    let forced = |t: f64| steady.norm() * (drive * t + steady.arg()).sin();
    let a = -forced(0.0);
    let b = (decay * a - drive * steady.norm() * steady.arg().cos()) / w;
    let (mut csv, mut state) = (String::from("t,F,x\n"), 3);
    for j in 0..600 {
        let t = f64::from(j) * dt;
        let x = forced(t) + (-decay * t).exp() * (a * (w * t).cos() + b * (w * t).sin());
        writeln!(csv, "{t},{},{}", 100.0 * (drive * t).sin(), x + sigma * noise(&mut state)).unwrap();
    }
    let dataset = r#"[[test]]
id = "burst"
kind = "transient"
file = "burst.csv"
control = "force"
channels = [
 { role = "time", column = "t", unit = "s" },
 { role = "force", at = "m1.x", column = "F", unit = "N" },
 { role = "displacement", at = "m1.x", column = "x", unit = "m", sigma = "2e-4 m" }]
"#;
    let text = r#"[[body]]
name = "ground"
fixed = true
[[body]]
name = "m1"
mass = "1 kg"
free = ["x"]
[[connector]]
name = "c1"
from = "ground"
to = "m1"
[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = { start = "38 N/mm", min = "0 N/mm" }
[[effect]]
effect = "viscous"
at = "c1.x"
c = { start = "0.03 N s/mm", min = "0 N s/mm" }
"#;
    study(folder.path(), dataset, text);
    std::fs::write(folder.path().join("data/burst.csv"), csv).unwrap();
    let f = json("fit", folder.path());
    let p = &f["parameters"][0];
    let (value, std) = (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap());
    assert!((value - k).abs() < 3.0 * std, "{value} +- {std}, {k} is the truth");
}
