//! A study in a temporary folder, and the program run on it.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// One connector, three loops of a spring and a damper (and what is hidden), from the closed form.
pub struct Rig {
    folder: tempfile::TempDir,
}

/// What a run of the program gave.
pub struct Ran {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Ran {
    /// The one JSON object on stdout.
    pub fn json(&self) -> Value {
        let mut objects = serde_json::Deserializer::from_str(&self.stdout).into_iter::<Value>();
        let first = objects
            .next()
            .unwrap_or_else(|| panic!("no JSON on stdout; stderr: {}", self.stderr))
            .unwrap_or_else(|e| panic!("{e}: {}", self.stdout));
        assert!(objects.next().is_none(), "more than one JSON object on stdout: {}", self.stdout);
        assert!(first.is_object(), "{first}");
        first
    }

    /// The error object, with the exit code that belongs to it.
    pub fn error(&self) -> [String; 4] {
        assert_eq!(self.code, 1, "stdout {} stderr {}", self.stdout, self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        let json = self.json();
        assert_eq!(keys(&json), ["error"]);
        assert_eq!(keys(&json["error"]), ["accepted", "message", "stage", "where"]);
        ["stage", "where", "message", "accepted"].map(|k| json["error"][k].as_str().unwrap().to_string())
    }
}

/// Sorted keys of an object.
pub fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().unwrap_or_else(|| panic!("no object: {value}")).keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

pub const STUDY: &str = r#"schema = 1
dataset = "data"
split = { select = ["loop-2Hz"], held_out = ["loop-5Hz"] }
[[body]]
name = "ground"
fixed = true
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
c = { start = "0.3 N s/mm", min = "0 N s/mm" }
"#;

/// A study of one body of 1 kg on one connector, without its effects.
pub const ONE_BODY: &str = r#"schema = 1
dataset = "data"
[[body]]
name = "m"
mass = "1 kg"
free = ["x"]
[[connector]]
name = "c1"
from = "ground"
to = "m"
"#;

/// Truth of the rig [N/mm, N s/mm].
pub const K: f64 = 20.0;
pub const C: f64 = 0.1;

/// Standard normal numbers from a congruential generator and the sum of twelve: shares nothing with the program.
pub fn noise(state: &mut u64) -> f64 {
    (0..12)
        .map(|_| {
            *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (*state >> 11) as f64 / (1u64 << 53) as f64
        })
        .sum::<f64>()
        - 6.0
}

/// `t,x,F` in s, mm, N over eight cycles: F = K x + C v + hidden(x, v) + noise.
pub fn loop_csv(frequency: f64, hidden: impl Fn(f64, f64) -> f64) -> String {
    let n = 100;
    let mut state = frequency.to_bits();
    let mut text = String::from("t,x,F\n");
    for k in 0..=8 * n {
        let t = k as f64 / (n as f64 * frequency);
        let w = std::f64::consts::TAU * frequency;
        let (x, v) = (0.5 * (w * t).sin(), 0.5 * w * (w * t).cos());
        let force = K * x + C * v + hidden(x, v) + 0.05 * noise(&mut state);
        writeln!(text, "{t:.12},{x:.12},{force:.12}").unwrap();
    }
    text
}

pub fn test_toml(frequency: u32) -> String {
    format!(
        r#"[[test]]
id = "loop-{frequency}Hz"
kind = "cycle"
file = "loop{frequency}.csv"
control = "displacement"
conditions = {{ frequency = "{frequency} Hz", i = "0.3 mm" }}
discard_cycles = 2
channels = [
 {{ role="time", column="t", unit="s" }},
 {{ role="displacement", at="c1.x", column="x", unit="mm" }},
 {{ role="force", at="c1.x", column="F", unit="N", sigma="0.05 N" }}]
"#
    )
}

impl Rig {
    pub fn new() -> Rig {
        Rig::hiding(|_, _| 0.0)
    }

    pub fn hiding(hidden: impl Fn(f64, f64) -> f64) -> Rig {
        let rig = Rig { folder: tempfile::tempdir().unwrap() };
        std::fs::create_dir(rig.path("data")).unwrap();
        let mut dataset = String::from("schema = 1\n");
        for f in [1, 2, 5] {
            rig.write(&format!("data/loop{f}.csv"), &loop_csv(f64::from(f), &hidden));
            dataset += &test_toml(f);
        }
        rig.write("data/dataset.toml", &dataset);
        rig.write("study.toml", STUDY);
        rig
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }
    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    /// Replaces what stands exactly once in a file.
    pub fn change(&self, name: &str, old: &str, new: &str) -> &Self {
        let text = self.read(name);
        assert_eq!(text.matches(old).count(), 1, "`{old}` in {name}:\n{text}");
        self.write(name, &text.replace(old, new));
        self
    }

    /// `misfit <verb> <study> ...`
    pub fn run(&self, verb: &str, more: &[&str]) -> Ran {
        let mut arguments = vec![verb.to_string(), self.folder.path().display().to_string()];
        arguments.extend(more.iter().map(|s| s.to_string()));
        misfit(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    }

    pub fn json(&self, verb: &str, more: &[&str]) -> Value {
        let ran = self.run(verb, &[more, &["--json"]].concat());
        assert_eq!(ran.code, 0, "{verb}: {} {}", ran.stdout, ran.stderr);
        ran.json()
    }

    /// Folders of the runs.
    pub fn runs(&self) -> Vec<PathBuf> {
        let Ok(entries) = std::fs::read_dir(self.path("runs")) else { return vec![] };
        entries.map(|e| e.unwrap().path()).collect()
    }
}

pub fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_misfit"))
}

pub fn misfit(arguments: &[&str]) -> Ran {
    let output = program().args(arguments).output().unwrap();
    Ran {
        code: output.status.code().unwrap_or(-1),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// The tables of a study for `count` bodies m1, m2, ... in a row along x: a connector `base` from the ground, `c1`, `c2`, ... between them.
pub fn chain(count: usize, mass: &str) -> String {
    format!(
        r#"[[body]]
name = "m"
count = {count}
mass = "{mass}"
free = ["x"]
[[connector]]
name = "base"
from = "ground"
to = "m1"
[[connector]]
name = "c"
chain = "m"
"#
    )
}
