//! Small studies that use every table of study.toml and dataset.toml; they are what the mutations begin with.

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;

use super::super::rig::{loop_csv, noise, test_toml};

/// A study, its dataset and the files beside it.
pub struct Seed {
    pub name: &'static str,
    pub study: String,
    pub dataset: String,
    pub files: Vec<(String, Vec<u8>)>,
}

impl Seed {
    pub fn write(&self, folder: &Path) {
        std::fs::create_dir_all(folder.join("data")).unwrap();
        std::fs::write(folder.join("study.toml"), &self.study).unwrap();
        std::fs::write(folder.join("data/dataset.toml"), &self.dataset).unwrap();
        for (name, bytes) in &self.files {
            std::fs::write(folder.join("data").join(name), bytes).unwrap();
        }
    }
}

pub fn all() -> Vec<Seed> {
    vec![loops(), chain(), spatial(), tables()]
}

const ONE: &str = r#"[[body]]
name = "ground"
fixed = true
[[body]]
name = "end"
free = ["x"]
[[connector]]
name = "c1"
from = "ground"
to = "end"
"#;

fn loops() -> Seed {
    let mut dataset = String::from("schema = 1\ntitle = \"loops\"\n");
    let mut files = vec![];
    for f in [1, 2, 5] {
        dataset += &test_toml(f);
        files.push((format!("loop{f}.csv"), loop_csv(f64::from(f), |x, v| 0.5 * x * x * x + 0.3 * v.signum()).into_bytes()));
    }
    let study = format!(
        r#"schema = 1
title = "loops"
dataset = "data"
split = {{ select = ["loop-2Hz"], held_out = ["loop-5Hz"] }}
fit = {{ loss = "huber", width = 2.0, max_iterations = 20, starts = 2, points = 40 }}
search = {{ effects = ["coulomb", "cubic_stiffness"], max_added = 1 }}
{ONE}[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = {{ start = "15 N/mm", min = "0 N/mm", max = "100 N/mm", prior = {{ mean = "20 N/mm", sigma = "5 N/mm" }} }}
[[effect]]
effect = "viscous"
at = "c1.x"
c = {{ start = "0.3 N s/mm", min = "0 N s/mm" }}
[[effect]]
effect = "elastic_slip"
at = "c1.x"
f = {{ start = "1 N", min = "0 N" }}
d = {{ start = "0.05 mm", min = "0.001 mm" }}
[[effect]]
effect = "formula"
at = "c1.x"
expression = "p * x^3 + r * z"
states = {{ z = "(v - abs(v) * z / 0.0001) / 0.0001" }}
p = {{ start = "0.1 N/mm3", min = "0 N/mm3", max = "10 N/mm3" }}
r = {{ start = "0.1 N", min = "0 N", max = "10 N" }}
[[prediction]]
case = "slow"
quantity = "W_D"
at = "c1.x"
control = "displacement"
displacement_min = "-0.3 mm"
displacement_max = "0.3 mm"
reference = "0.2 mJ"
conditions = {{ i = "0.3 mm", frequency = "0.5 Hz" }}
"#
    );
    Seed { name: "loops", study, dataset, files }
}

/// H of the end of three bodies of 0.2 kg on springs of 30 N/mm with dampers of 5 N s/m, by elimination from the end of the row.
fn receptance(f: f64) -> (f64, f64) {
    let w = TAU * f;
    let (k, c, m) = (30e3, 5.0, 0.2);
    // Each step: D = K - w^2 m + j w c seen from the next body, in complex numbers.
    let divide = |(a, b): (f64, f64), (p, q): (f64, f64)| ((a * p + b * q) / (p * p + q * q), (b * p - a * q) / (p * p + q * q));
    let own = |n: f64| (n * k - w * w * m, n * w * c);
    let square = (k * k - w * w * c * c, 2.0 * k * w * c);
    let mut d = own(2.0);
    for n in [2.0, 1.0] {
        let (a, b) = divide(square, d);
        let (p, q) = own(n);
        d = (p - a, q - b);
    }
    divide((1.0, 0.0), d)
}

fn chain() -> Seed {
    let mut frf = String::from("f,re,im,coh\n");
    for k in 0..60 {
        let f = 4.0 + 2.0 * f64::from(k);
        let (re, im) = receptance(f);
        writeln!(frf, "{f},{re:.9e},{im:.9e},0.99").unwrap();
    }
    let (mut record, mut state) = (String::from("t,F,x,a\n"), 7u64);
    for k in 0..200 {
        let t = f64::from(k) * 1e-3;
        let force = 10.0 * (TAU * 20.0 * t).sin();
        writeln!(record, "{t:.4},{force:.6},{:.6},{:.6}", 0.5 * (TAU * 20.0 * t).sin() + 0.01 * noise(&mut state), 0.1 * noise(&mut state))
            .unwrap();
    }
    let dataset = r#"schema = 1
[[test]]
id = "end"
kind = "frf"
file = "frf.csv"
excite = "m3.x"
respond = "m3.x"
quantity = "receptance"
conditions = { load = "20 N" }
channels = [
 { role="frequency", column="f", unit="Hz" },
 { role="real", column="re", unit="m/N" },
 { role="imag", column="im", unit="m/N" },
 { role="coherence", column="coh", averages=20 }]
[[test]]
id = "burst"
kind = "transient"
file = "record.csv"
control = "force"
conditions = { load = "0 N" }
channels = [
 { role="time", column="t", unit="s" },
 { role="force", at="m3.x", column="F", unit="N" },
 { role="acceleration", at="m1.x", column="a", unit="m/s2", sigma="0.2 m/s2" },
 { role="displacement", at="m3.x", column="x", unit="mm", sigma="0.02 mm" }]
[[test]]
id = "modes"
kind = "modal"
conditions = { load = "20 N" }
rows = [
  { mode = 1, frequency = "27.4 Hz", damping = "1.4 %", sigma_frequency = "0.1 Hz" },
  { mode = 2, frequency = "76.8 Hz", damping = "4.0 %" }]
"#;
    let study = r#"schema = 1
dataset = "data"
split = { select = ["modes"] }
fit = { frf_tolerance = 0.02, max_iterations = 10 }
[[leave_out]]
test = "modes"
quantity = "modal_damping"
mode = 2
why = "printed twice"
[[body]]
name = "m"
count = 3
mass = "0.2 kg"
free = ["x"]
[[connector]]
name = "base"
from = "ground"
to = "m1"
[[connector]]
name = "c"
chain = "m"
[[load]]
at = "m3.x"
condition = "load"
via = ["5 N"]
steps = 4
[[effect]]
effect = "linear_stiffness"
at = ["base.x", "c1-2.x"]
k = { start = "25 N/mm", min = "0 N/mm" }
[[effect]]
effect = "viscous"
at = ["base.x", "c1-2.x"]
c = { start = "4 N s/m", min = "0 N s/m" }
[[effect]]
effect = "viscous"
at = "c2.x"
c = { start = "1 N s/m", min = "0 N s/m" }
[[effect]]
effect = "structural_damping"
at = "base.x"
h = { start = "0.1 N/mm", min = "0 N/mm", max = "50 N/mm" }
f_ref = "20 Hz"
[[effect]]
effect = "maxwell"
at = "c1.x"
k = { start = "2 N/mm", min = "0 N/mm" }
tau = { start = "5 ms", min = "0.1 ms", max = "1 s" }
[[effect]]
effect = "cubic_stiffness"
at = "c1.x"
k3 = { start = "1 N/mm3", fixed = true }
[[effect]]
effect = "coulomb"
at = "base.x"
f = { start = "0.1 N", min = "0 N" }
[[effect]]
effect = "added_mass"
at = "m3.x"
m = { start = "0.01 kg", min = "0 kg", max = "1 kg" }
[[order]]
order = ["c2.x.viscous.c", "base.x,c1-2.x.viscous.c"]
gap = "0.1 N s/m"
[[prediction]]
case = "first"
quantity = "natural_frequency"
mode = 1
reference = "27.4 Hz"
"#;
    let files = vec![("frf.csv".into(), frf.into_bytes()), ("record.csv".into(), record.into_bytes())];
    Seed { name: "chain", study: study.into(), dataset: dataset.into(), files }
}

fn spatial() -> Seed {
    let dataset = r#"schema = 1
[[test]]
id = "mean"
kind = "modal"
conditions = { load = "80 N", i = "0.3 mm" }
rows = [
  { mode = 1, frequency = "300 Hz", damping = "5.61 %", family = "xy bending" },
  { mode = 2, frequency = "700 Hz", damping = "5.1 %", family = "xy bending" }]
[[test]]
id = "energies"
kind = "energy"
at = "P.x"
control = "force"
conditions = { i = "0.3 mm" }
force_min = "21.6 N"
force_max = "138.3 N"
W_s_reading = "slope"
rows = [
  { frequency = "1 Hz", W_D = "38.77 mJ", W_s = "248.57 mJ", D = 0.156, sigma_W_D = "1.163 mJ", sigma_W_s = "0.746 mJ" },
  { frequency = "5 Hz", W_D = "73.77 mJ", W_s = "248.39 mJ", sigma_W_D = "2.213 mJ", sigma_W_s = "0.745 mJ" }]
"#;
    let study = r#"schema = 1
dataset = "data"
split = { held_out = ["mean"] }
fit = { max_iterations = 3 }
[[arc]]
radius = "90 mm"
angle = "-26 deg"
heading = "116 deg"
start = ["0 mm", "0 mm"]
[[arc]]
length = "30 mm"
[[part]]
name = "b"
count = 3
section = { width = "18 mm", thickness = "6.35 mm", density = "3200 kg/m3" }
[[point]]
name = "root"
part = "b1"
at = "start"
[[point]]
name = "P"
at = ["-10 mm", "40 mm"]
[[point]]
name = "tip"
part = "b3"
at = "end"
[[connector]]
name = "GF"
chain = "b"
[[connector]]
name = "pin"
from = "ground"
to = "root"
[[connector]]
name = "shelf"
from = "ground"
to = "tip"
[[load]]
at = "P.x"
condition = "load"
factor = 1.0
[[effect]]
effect = "linear_stiffness"
at = ["pin.x", "pin.y", "pin.z", "shelf.z", "shelf.x", "shelf.y"]
k = { start = "1000 N/mm", fixed = true }
[[effect]]
effect = "linear_stiffness"
at = ["pin.theta", "pin.phi", "pin.psi", "shelf.theta", "shelf.phi"]
k = { start = "1E+04 N mm/deg", fixed = true }
[[effect]]
effect = "linear_stiffness"
at = ["GF1-2.x", "GF1-2.y", "GF1-2.z"]
k = { start = "1E+05 N/mm", fixed = true }
[[effect]]
effect = "linear_stiffness"
at = ["GF1-2.theta", "GF1-2.phi", "GF1-2.psi"]
k = { start = "2500 N mm/deg", min = "100 N mm/deg" }
[[effect]]
effect = "viscous"
at = "GF1-2.psi"
c = { start = "0.1 N mm s/deg", min = "0 N mm s/deg" }
[[effect]]
effect = "interference_law"
at = "GF1-2.psi"
of = "viscous.c"
condition = "i"
reference = "0.3 mm"
a = { start = "0.561 1/mm", fixed = true }
"#;
    Seed { name: "spatial", study: study.into(), dataset: dataset.into(), files: vec![] }
}

fn tables() -> Seed {
    let dataset = r#"schema = 1
[[test]]
id = "table"
kind = "energy"
at = "c1.x"
control = "displacement"
displacement_min = "-0.5 mm"
displacement_max = "0.5 mm"
W_s_reading = "slope"
rows = [
  { frequency = "1 Hz", W_D = "0.49 mJ", W_s = "10 mJ", sigma_W_D = "0.01 mJ", conditions = { i = "0.1 mm" } },
  { frequency = "2 Hz", W_D = "0.98 mJ", W_s = "10 mJ", sigma_W_D = "0.02 mJ", conditions = { i = "0.1 mm" } },
  { frequency = "2 Hz", W_D = "1.5 mJ", W_s = "12 mJ", sigma_W_D = "0.02 mJ", conditions = { i = "0.3 mm" } }]
"#;
    let study = format!(
        r#"schema = 1
dataset = "data"
{ONE}[[effect]]
effect = "linear_stiffness"
at = "c1.x"
per = "i"
monotone = "rising"
k = {{ start = "30 N/mm", min = "0 N/mm" }}
[[effect]]
effect = "viscous"
at = "c1.x"
c = {{ start = "0.1 N s/mm", min = "0 N s/mm" }}
"#
    );
    Seed { name: "tables", study, dataset: dataset.into(), files: vec![] }
}
