//! A ladder that was killed or stopped, and gone on with, ends as one that nobody disturbed.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use xxhash_rust::xxh3::xxh3_64;

use super::rig::{misfit, program};

/// Study 08, its loops of 50 points, with three laws to choose from: two effects are missing, and what is added first is exchanged for one of them later.
/// Begun with the first addition and nothing else of what the search knew, it ends with a law that is not there and three times the error.
pub struct Bench(tempfile::TempDir);

impl Bench {
    pub fn new() -> Bench {
        let bench = Bench(tempfile::tempdir().unwrap());
        super::handbook::copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("studies/08-two-effects"), &bench.study());
        let file = bench.study().join("study.toml");
        let text = std::fs::read_to_string(&file).unwrap().replace("dataset = \"data\"", "dataset = \"data\"\nfit = { points = 50 }");
        std::fs::write(file, text + "\n[search]\neffects = [\"elastic_slip\", \"bouc_wen\", \"maxwell\"]\n").unwrap();
        bench
    }

    /// What the undisturbed ladder comes to, climbed once for all tests.
    fn whole() -> &'static Value {
        static WHOLE: OnceLock<Value> = OnceLock::new();
        WHOLE.get_or_init(|| Bench::new().climbed("whole", None))
    }

    pub fn study(&self) -> PathBuf {
        self.0.path().join("study")
    }

    fn out(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, name: &str, from: Option<&str>) -> Command {
        let mut command = program();
        command.arg("ladder").arg(self.study()).arg("--json").arg("--out").arg(self.out(name));
        if let Some(from) = from {
            command.arg("--resume").arg(self.out(from));
        }
        command
    }

    /// Its result when it has come to its end; it leaves no journal then.
    fn climbed(&self, name: &str, from: Option<&str>) -> Value {
        let output = self.command(name, from).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(!said.contains("panicked"), "{said}");
        assert!(self.out(name).join("study.toml").is_file() && !self.journal(name).exists(), "a journal is kept until the end");
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// A ladder that is sent a signal as soon as its journal has so many lines, of the 82 that it comes to; its exit code.
    #[cfg(unix)]
    fn disturbed(&self, name: &str, from: Option<&str>, lines: usize, signal: &str) -> Option<i32> {
        let mut ladder = self.command(name, from).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        while self.lines(name) < lines {
            assert_eq!(ladder.try_wait().unwrap(), None, "it came to its end");
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        assert!(Command::new("kill").args([signal, &ladder.id().to_string()]).status().unwrap().success());
        ladder.wait().unwrap().code()
    }

    fn lines(&self, name: &str) -> usize {
        std::fs::read_to_string(self.journal(name)).map_or(0, |text| text.lines().count())
    }

    fn journal(&self, name: &str) -> PathBuf {
        self.out(name).join("fits.journal")
    }
}

/// Effects, verdict and the numbers of every rung and of the held-out tests.
fn same(a: &Value, b: &Value) {
    for key in ["verdict", "proven", "why", "ended"] {
        assert_eq!(a[key], b[key], "{key}");
    }
    let names = |r: &Value, of: &str| -> Vec<String> {
        r[of].as_array().unwrap().iter().map(|m| format!("{} at {}, tied with {}", m["effect"], m["at"], m["tied_with"])).collect()
    };
    assert_eq!((names(a, "missing"), names(a, "instruments")), (names(b, "missing"), names(b, "instruments")));
    let rungs = |r: &Value| r["rungs"].as_array().unwrap().clone();
    assert_eq!(rungs(a).len(), rungs(b).len());
    let close = |what: &str, x: &Value, y: &Value| {
        let (x, y) = (x.as_f64().unwrap(), y.as_f64().unwrap());
        assert!((x - y).abs() <= 1e-6 * x.abs(), "{what}: {x} and {y}");
    };
    for (k, (x, y)) in rungs(a).iter().zip(&rungs(b)).enumerate() {
        assert_eq!((&x["added"], &x["removed"]), (&y["added"], &y["removed"]), "rung {k}");
        close("cost", &x["cost"], &y["cost"]);
        for (p, q) in x["parameters"].as_array().unwrap().iter().zip(y["parameters"].as_array().unwrap()) {
            assert_eq!(p["name"], q["name"]);
            close(&p["name"].to_string(), &p["value"], &q["value"]);
        }
    }
    close("held-out error", &a["held_out"]["after"], &b["held_out"]["after"]);
}

#[cfg(unix)]
#[test]
fn a_killed_ladder_ends_as_an_undisturbed_one() {
    let bench = Bench::new();
    let whole = Bench::whole();
    assert_eq!(whole["missing"].as_array().unwrap().len(), 2);
    assert!(whole["rungs"].as_array().unwrap().iter().any(|r| !r["removed"].as_array().unwrap().is_empty()), "one is exchanged on the way");
    // After its first addition.
    assert_eq!(bench.disturbed("killed", None, 45, "-KILL"), None);
    assert!(!bench.out("killed").join("result.json").exists());
    // Gone on with, and killed once more on its way.
    assert_eq!(bench.disturbed("again", Some("killed"), 65, "-KILL"), None);
    same(whole, &bench.climbed("end", Some("again")));
    same(whole, &bench.climbed("killed", Some("killed")));
}

#[cfg(unix)]
#[test]
fn a_stopped_ladder_ends_as_an_undisturbed_one() {
    let bench = Bench::new();
    let whole = Bench::whole();
    assert_eq!(bench.disturbed("stopped", None, 45, "-TERM"), Some(130));
    assert!(bench.out("stopped").join("result.json").is_file() && bench.journal("stopped").is_file());
    same(whole, &bench.climbed("end", Some("stopped")));
    // Stopped by the clock, at whatever moment that is.
    let ran = bench.command("late", None).args(["--max-seconds", "0.7"]).output().unwrap();
    assert_eq!(ran.status.code(), Some(130));
    same(whole, &bench.climbed("end", Some("late")));
    // What has come to its end is not gone on with.
    let ran = bench.command("more", Some("end")).output().unwrap();
    assert_eq!(ran.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&ran.stdout).contains("no fits of an earlier ladder"), "{}", String::from_utf8_lossy(&ran.stdout));
    assert!(!bench.out("more").exists(), "a run that came to nothing leaves no folder");
}

/// The line of a journal with its hash made right again.
fn line(text: &str) -> Vec<u8> {
    format!("{:016x} {text}", xxh3_64(text.as_bytes())).into_bytes()
}

#[cfg(unix)]
#[test]
fn a_damaged_journal_is_not_believed() {
    let bench = Bench::new();
    let whole = Bench::whole();
    bench.disturbed("killed", None, 60, "-KILL");
    let bytes = std::fs::read(bench.journal("killed")).unwrap();
    let mut lines: Vec<Vec<u8>> = bytes.split(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    assert!(lines.len() > 30, "{}", lines.len());
    let text = |line: &[u8]| String::from_utf8(line[17..].to_vec()).unwrap();
    // Bytes that are gone, zeros, another digit, lines that ran into each other, one that was cut short at the end.
    lines[2].truncate(60);
    lines[4][40..50].fill(0);
    let digit = lines[6].iter().rposition(u8::is_ascii_digit).unwrap();
    lines[6][digit] = b'0' + (lines[6][digit] - b'0' + 1) % 10;
    lines[8] = [lines[8].clone(), lines[9].clone()].concat();
    let end = lines.len() - 1;
    lines[end] = b"0123456789abcdef {\"at\":1.0,\"fit\":{\"ke".to_vec();
    // Numbers that no fit has found, under a hash that is right.
    for (at, key, value) in [
        (10, "p", "1e308 -1e308 NaN inf 0"),
        (12, "p", "1e308 1e308"),
        (14, "ends", "NaN 1e-5 2 0 0"),
        (16, "ends", "1e-300 1e308 inf -inf -1"),
        (18, "scale", ""),
        (20, "begins", "NaN"),
    ] {
        let mut value_of: Value = serde_json::from_str(&text(&lines[at])).unwrap();
        value_of["fit"][key] = value.into();
        lines[at] = line(&value_of.to_string());
    }
    let mut odd: Value = serde_json::from_str(&text(&lines[22])).unwrap();
    odd["fit"]["held"] = serde_json::json!([u32::MAX]);
    odd["fit"]["active"] = serde_json::json!([{ "Row": 7 }]);
    odd["at"] = 1e300.into();
    lines[22] = line(&odd.to_string());
    // A fit that ended elsewhere than it says: its cost is not the one that was kept.
    let mut moved: Value = serde_json::from_str(&text(&lines[24])).unwrap();
    let p = moved["fit"]["p"].as_str().unwrap().split(' ').map(|v| (1.01 * v.parse::<f64>().unwrap()).to_string());
    moved["fit"]["p"] = p.collect::<Vec<_>>().join(" ").into();
    lines[24] = line(&moved.to_string());
    std::fs::write(bench.journal("killed"), lines.join(&b'\n')).unwrap();
    same(whole, &bench.climbed("end", Some("killed")));

    // What cannot be a journal of this ladder is refused.
    let refused = |bytes: &[u8], wanted: &str| {
        std::fs::write(bench.journal("killed"), bytes).unwrap();
        let [study, run, out] = [bench.study(), bench.out("killed"), bench.out("none")].map(|p| p.display().to_string());
        let ran = misfit(&["ladder", &study, "--json", "--resume", &run, "--out", &out]);
        assert!(ran.error()[2].contains(wanted), "{}", ran.stdout);
        assert!(!bench.out("none").exists());
    };
    refused(b"", "first line is damaged");
    refused(&bytes[..30], "first line is damaged");
    refused(&[0; 4096], "first line is damaged");
    let head = text(bytes.split(|b| *b == b'\n').next().unwrap());
    let other = |old: &str, new: &str| {
        assert!(head.contains(old), "{head}");
        line(&(head.replace(old, new))).into_iter().chain(*b"\n").collect::<Vec<u8>>()
    };
    refused(&other("\"seed\":1", "\"seed\":2"), "its seed is `2`");
    refused(&other("Two effects", "Three effects"), "its study is `Three effects");
    refused(&other(env!("CARGO_PKG_VERSION"), "0.0.0"), "its version of misfit is `0.0.0`");
    std::fs::File::options().write(true).open(bench.journal("killed")).unwrap().set_len(1 << 30).unwrap();
    let ran = bench.command("none", Some("killed")).output().unwrap();
    assert_eq!(ran.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&ran.stdout).contains("longer than 64 MB"), "{}", String::from_utf8_lossy(&ran.stdout));
}
