//! Studies with changed numbers and text, data files with changed bytes: the program answers or refuses. A panic, an abort, more than
//! ten seconds of processor time, more memory than a gigabyte and ten times the file, and an error without a place or without what would
//! be accepted are failures.
//!
//! A sample of fixed seed runs with the tests. More, of any seed:
//! `MISFIT_HOSTILE=10000 MISFIT_HOSTILE_SEED=7 cargo test --release --test behaviour hostile -- --nocapture`;
//! `MISFIT_HOSTILE_ONLY="spatial diagnose"` runs of the studies only those that begin with this seed and end with this verb;
//! `MISFIT_HOSTILE_KEEP=DIR` keeps the folders that failed, `MISFIT_HOSTILE_SEEDS=DIR` adds data files to begin with.

mod cases;
mod formats;
mod hands;
mod kills;
pub mod mutate;
mod studies;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use formats::DataSeed;
use mutate::{Random, change_bytes, change_numbers, change_text};
use serde_json::Value;
use studies::Seed;

/// Processor time of one run [s].
const SECONDS: u64 = 10;
/// Address space beyond the memory that is allowed: code, stacks and arenas [kB].
const OVERHEAD: u64 = 400_000;

/// What a run may not do.
#[derive(Debug)]
#[allow(dead_code)] // Read through Debug alone.
struct Failed {
    seed: String,
    verb: &'static str,
    why: String,
    folder: Option<PathBuf>,
}

/// Runs under limits of processor time and address space.
fn limited(arguments: &[&str], file: u64) -> Command {
    let kilobytes = 1_048_576 + 10 * file / 1024 + OVERHEAD;
    let mut command = Command::new("sh");
    let script = format!("ulimit -t {SECONDS}; ulimit -v {kilobytes}; exec \"$0\" \"$@\"");
    command.args(["-c", &script, env!("CARGO_BIN_EXE_misfit")]).args(arguments).env("RAYON_NUM_THREADS", "1").env("RUST_BACKTRACE", "0");
    command
}

/// The exit code, stdout and stderr; none where it waited ten minutes for something without end.
fn finish(mut command: Command, folder: &Path) -> Option<(Option<i32>, String, String)> {
    let (out, err) = (folder.join("stdout"), folder.join("stderr"));
    command.stdin(Stdio::null()).stdout(std::fs::File::create(&out).unwrap()).stderr(std::fs::File::create(&err).unwrap());
    let mut child = command.spawn().unwrap();
    for _ in 0..60_000 {
        if let Some(status) = child.try_wait().unwrap() {
            let read = |p: &Path| String::from_utf8_lossy(&std::fs::read(p).unwrap()).into_owned();
            return Some((status.code(), read(&out), read(&err)));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    None
}

/// What is wrong with how a run ended; `names`: what every error of the run has to name.
fn wrong(ended: Option<(Option<i32>, String, String)>, names: Option<&str>) -> Option<String> {
    let Some((code, stdout, stderr)) = ended else { return Some("hangs".into()) };
    let last = || stderr.lines().rev().take(4).collect::<Vec<_>>().join(" | ");
    if stderr.contains("panicked") {
        return Some(format!("panics: {}", stderr.lines().skip_while(|l| !l.contains("panicked")).take(2).collect::<Vec<_>>().join(" | ")));
    }
    let code = match code {
        None if stderr.contains("memory allocation") => return Some(format!("takes too much memory: {}", last())),
        None => return Some(format!("is killed (time, or a signal): {}", last())),
        Some(code @ (0 | 1 | 130)) => code,
        Some(code) => return Some(format!("exit {code}: {}", last())),
    };
    let Ok(json) = serde_json::from_str::<Value>(&stdout) else { return Some(format!("no JSON object: {stdout} {stderr}")) };
    let mut errors = vec![];
    if let Some(error) = json.get("error") {
        errors.push(error);
    }
    errors.extend(json.get("problems").and_then(Value::as_array).into_iter().flatten());
    // A fit that has failed says why in its notes and parameters.
    if code == 1 && errors.is_empty() && json["termination"] != "failed" {
        return Some(format!("exit 1 without an error: {stdout}"));
    }
    let text = |e: &Value, key: &str| e[key].as_str().unwrap_or("").trim().to_string();
    for e in errors {
        if ["stage", "where", "message", "accepted"].iter().any(|k| text(e, k).is_empty()) {
            return Some(format!("says no place, or not what is accepted: {e}"));
        }
        if names.is_some_and(|n| !text(e, "where").contains(n) && !text(e, "message").contains(n)) {
            return Some(format!("does not name the file: {e}"));
        }
    }
    None
}

/// Number of cases and the seed they begin with.
fn asked(sample: usize, seed: u64) -> (usize, u64) {
    let number = |name: &str| std::env::var(name).ok().and_then(|v| v.parse::<u64>().ok());
    (number("MISFIT_HOSTILE").map_or(sample, |n| n as usize), number("MISFIT_HOSTILE_SEED").unwrap_or(seed))
}

/// Runs `one` for every case on two threads and tells what failed.
fn all(cases: usize, seed: u64, one: impl Fn(u64, &Path) -> Vec<Failed> + Sync) {
    let (next, failed) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let keep = std::env::var_os("MISFIT_HOSTILE_KEEP").map(PathBuf::from);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    if k >= cases {
                        break;
                    }
                    let folder = tempfile::tempdir().unwrap();
                    let mut bad = one(seed.wrapping_mul(1_000_003).wrapping_add(k as u64), folder.path());
                    if let (false, Some(keep)) = (bad.is_empty(), &keep) {
                        let kept = keep.join(format!("{seed}-{k}"));
                        copy(folder.path(), &kept);
                        bad.iter_mut().for_each(|f| f.folder = Some(kept.clone()));
                    }
                    for f in &bad {
                        eprintln!("{f:?}");
                    }
                    failed.lock().unwrap().extend(bad);
                }
            });
        }
    });
    let failed = failed.into_inner().unwrap();
    assert!(failed.is_empty(), "{} of {cases} cases failed: {failed:#?}", failed.len());
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() { copy(&path, &target) } else { drop(std::fs::copy(&path, &target)) }
    }
}

/// One run of a verb on the study in `folder/study`.
fn run(folder: &Path, seed: &str, verb: &'static str, more: &[&str], names: Option<&str>) -> Option<Failed> {
    let study = folder.join("study").display().to_string();
    let arguments = [&[verb, study.as_str(), "--json", "--threads", "1"], more].concat();
    let why = wrong(finish(limited(&arguments, 100_000), folder), names)?;
    Some(Failed { seed: seed.into(), verb, why, folder: None })
}

fn seeds() -> Vec<Seed> {
    studies::all().into_iter().chain([cases::seed()]).collect()
}

fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn mutated_study(seeds: &[Seed], seed: u64, folder: &Path) -> Vec<Failed> {
    let mut random = Random(seed);
    let from = &seeds[random.below(seeds.len())];
    let study = folder.join("study");
    from.write(&study);
    let tables = from.files.iter().filter(|f| f.0.ends_with(".toml")).map(|(name, bytes)| (format!("data/{name}"), text_of(bytes)));
    let texts: Vec<(String, String)> =
        [("study.toml".into(), from.study.clone()), ("data/dataset.toml".into(), from.dataset.clone())].into_iter().chain(tables).collect();
    let (file, text) = &texts[random.below(texts.len())];
    let changed = match random.below(3) {
        0 => change_text(text, &mut random),
        _ => change_numbers(text, &mut random),
    };
    std::fs::write(study.join(file), changed).unwrap();
    let time = ["--max-seconds", "3"];
    let other = match from.name {
        "cases" => ["fit", "predict", "predict", "tolerance"][random.below(4)],
        _ => ["fit", "fit", "fit", "compare", "predict", "export", "diagnose", "simulate", "ladder"][random.below(9)],
    };
    if std::env::var("MISFIT_HOSTILE_ONLY").is_ok_and(|only| only != format!("{} {other}", from.name)) {
        return vec![];
    }
    let more = if other == "export" { vec!["--to", "json,csv,parquet,adams,exudyn,study"] } else { vec![] };
    let verbs = [run(folder, from.name, "check", &time, None), run(folder, from.name, other, &[&time[..], &more].concat(), None)];
    verbs.into_iter().flatten().collect()
}

const STUDY: &str = "schema = 1\ndataset = \"data\"\n[[body]]\nname = \"end\"\nfree = [\"x\"]\n[[connector]]\nname = \"c1\"\nfrom = \"ground\"\nto = \"end\"\n\
    [[effect]]\neffect = \"linear_stiffness\"\nat = \"c1.x\"\nk = { start = \"15 N/mm\", min = \"0 N/mm\" }\n\
    [[effect]]\neffect = \"viscous\"\nat = \"c1.x\"\nc = { start = \"0.3 N s/mm\", min = \"0 N s/mm\" }\n";

fn mutated_data(seeds: &[DataSeed], seed: u64, folder: &Path) -> Vec<Failed> {
    let mut random = Random(seed);
    let from = &seeds[random.below(seeds.len())];
    let changed = change_bytes(&from.bytes, &mut random);
    let size = changed.len() as u64;
    let study = folder.join("study");
    std::fs::create_dir_all(study.join("data")).unwrap();
    let file = study.join("data").join(&from.file);
    std::fs::write(&file, &changed).unwrap();
    let (new, path) = (folder.join("new").display().to_string(), file.display().to_string());
    let mut failed = Vec::new();
    let mut ran = |verb: &'static str, arguments: &[&str], names: Option<&str>| {
        let ended = finish(limited(arguments, size), folder);
        let done = matches!(ended, Some((Some(0), ..)));
        failed.extend(wrong(ended, names).map(|why| Failed { seed: from.file.clone(), verb, why, folder: None }));
        done
    };
    // What `new` has written of the file is read or refused as any study is.
    if ran("new", &["new", &new, "--json", "--from", &path], Some(&from.file)) && Path::new(&new).join("study.toml").is_file() {
        ran("fit of new", &["fit", &new, "--json", "--threads", "1", "--max-seconds", "3"], None);
    }
    if let Some(dataset) = formats::dataset(from) {
        std::fs::write(study.join("data/dataset.toml"), dataset).unwrap();
        std::fs::write(study.join("study.toml"), STUDY).unwrap();
        let verb = ["check", "fit"][random.below(2)];
        failed.extend(run(folder, &from.file, verb, &["--max-seconds", "3"], None));
    }
    failed
}

/// What the mutations begin with is sound: every seed passes, or is refused for what it is meant to be refused for.
#[test]
fn seeds_are_sound() {
    let mut unsound = Vec::new();
    for seed in seeds() {
        let folder = tempfile::tempdir().unwrap();
        let study = folder.path().join("study");
        seed.write(&study);
        let (code, stdout, stderr) =
            finish(limited(&["fit", &study.display().to_string(), "--json", "--max-seconds", "5"], 0), folder.path()).unwrap();
        if !matches!(code, Some(0 | 130)) {
            unsound.push(format!("{}: {code:?} {stdout} {stderr}", seed.name));
        }
    }
    for seed in formats::all() {
        let folder = tempfile::tempdir().unwrap();
        let (file, new) = (folder.path().join(&seed.file), folder.path().join("new"));
        std::fs::write(&file, &seed.bytes).unwrap();
        let arguments = ["new", &new.display().to_string(), "--json", "--from", &file.display().to_string()].map(String::from);
        let (code, stdout, stderr) = finish(limited(&arguments.each_ref().map(String::as_str), 0), folder.path()).unwrap();
        if code != Some(0) {
            unsound.push(format!("{}: {code:?} {stdout} {stderr}", seed.file));
        }
    }
    assert!(unsound.is_empty(), "{}", unsound.join("\n"));
}

#[test]
fn mutated_studies_are_read_or_refused() {
    let (cases, seed) = asked(120, 20_261_124);
    let seeds = seeds();
    all(cases, seed, |k, folder| mutated_study(&seeds, k, folder));
}

#[test]
fn mutated_data_files_are_read_or_refused() {
    let (cases, seed) = asked(200, 20_261_125);
    let seeds = formats::all();
    all(cases, seed, |k, folder| mutated_data(&seeds, k, folder));
}
