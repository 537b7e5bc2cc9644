//! Tasks: their list, one process each, a record of each written once and whole.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Output, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use xxhash_rust::xxh3::Xxh3;

use crate::limits;

use super::list::{self, ADD};
use super::{CampaignError, Share, Spec, variant};

/// One run of the verb.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Name by the content of its inputs: 32 hexadecimal digits.
    pub id: String,
    /// Name for people: what it differs in.
    pub label: String,
    /// The verb.
    pub verb: String,
    /// The study; none for trials.
    pub study: Option<PathBuf>,
    /// Seed.
    pub seed: u64,
    /// What it differs in, for the table: name and value.
    pub axes: Vec<(String, String)>,
    /// Values of the study that are replaced, as TOML.
    pub set: Vec<(String, String)>,
    /// Arguments of the verb.
    pub arguments: Vec<String>,
    /// What of the run it is.
    pub part: Part,
}

/// What of a run a task is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Part {
    /// All of it.
    #[default]
    Whole,
    /// A share of what the task `of` draws.
    Share {
        /// Id of that task.
        of: String,
        /// Which share.
        share: Share,
    },
    /// What its shares have drawn, put together.
    Joined,
}

impl Task {
    /// The tasks among which what this one draws is divided by `n`.
    pub fn shares(&self, n: usize) -> impl Iterator<Item = Task> {
        let one = |share: Share| {
            let mut hash = Xxh3::new();
            hash.update(format!("{} {share}", self.id).as_bytes());
            Task {
                id: format!("{:032x}", hash.digest128()),
                label: format!("{} share {share}", self.label),
                part: Part::Share { of: self.id.clone(), share },
                ..self.clone()
            }
        };
        Share::all(n).map(one)
    }

    /// Whether its verb draws what can be divided.
    pub(super) fn draws(&self) -> bool {
        let asks = |options: &[&str]| self.arguments.iter().any(|a| options.iter().any(|o| a == o || a.starts_with(&format!("{o}="))));
        match self.verb.as_str() {
            "fit" => asks(&["--bootstrap", "--profile"]),
            "predict" => asks(&["--bootstrap"]),
            verb => verb == "trial",
        }
    }
}

/// What came of a task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Id of the task.
    pub id: String,
    /// Why it failed; none where it did not.
    pub reason: Option<String>,
    /// Attempts.
    pub attempts: usize,
    /// Wall time of the last attempt [s].
    pub wall_s: f64,
    /// What the verb printed.
    pub result: Value,
}

/// Runs tasks of a campaign into its folder.
pub struct Runner<'a> {
    /// The words that start the program, before those of a verb.
    pub program: &'a [OsString],
    /// The campaign.
    pub spec: &'a Spec,
    /// Folder of the results.
    pub folder: &'a Path,
    /// Processes that are at work and were not told to stop.
    running: Mutex<BTreeSet<u32>>,
}

/// Exit code of a run that was interrupted.
const INTERRUPTED: i32 = 130;

impl<'a> Runner<'a> {
    /// A runner of a campaign's tasks; `program` are the words that start this program.
    pub fn new(program: &'a [OsString], spec: &'a Spec, folder: &'a Path) -> Runner<'a> {
        Runner { program, spec, folder, running: Mutex::default() }
    }

    /// Asks the processes of the tasks that are at work to stop, each once: a second word would end it on the spot.
    pub fn interrupt(&self) {
        let told = std::mem::take(&mut *self.running.lock().unwrap_or_else(PoisonError::into_inner));
        if !told.is_empty() {
            // A process that has just ended needs no word.
            let _ = Command::new("kill").arg("-INT").args(told.iter().map(u32::to_string)).stderr(Stdio::null()).status();
        }
    }

    /// Runs a process to its end.
    fn output(&self, mut command: Command) -> std::io::Result<Output> {
        let running = || self.running.lock().unwrap_or_else(PoisonError::into_inner);
        let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
        let id = child.id();
        running().insert(id);
        let done = child.wait_with_output();
        running().remove(&id);
        done
    }

    /// File of a task's record.
    pub fn file(&self, id: &str) -> PathBuf {
        self.folder.join("tasks").join(format!("{id}.json"))
    }

    /// Where the runs of the shares of a task are kept until they are put together: those of a run that was divided by another number are no part of it.
    fn shared(&self, id: &str) -> PathBuf {
        self.folder.join("shares").join(format!("{id}-{}", self.spec.shares))
    }

    /// Folder of what a share has drawn.
    fn share(&self, of: &str, share: Share) -> PathBuf {
        self.shared(of).join(share.to_string().replace('/', "-of-"))
    }

    /// Whether a task is done: its record says so, and what a share has drawn is there.
    pub fn is_done(&self, task: &Task) -> bool {
        let there = match &task.part {
            Part::Share { of, share } => self.share(of, *share).is_dir(),
            Part::Whole | Part::Joined => true,
        };
        there && self.record(&task.id).is_some_and(|r| r.reason.is_none())
    }

    /// The record of a task; none where it is not there, or is no record.
    pub fn record(&self, id: &str) -> Option<Record> {
        let text = limits::text(&self.file(id)).ok()?;
        serde_json::from_str::<Record>(&text).ok().filter(|r| r.id == id)
    }

    /// Runs a task, as often as asked, and writes its record; none where the run was interrupted.
    pub fn run(&self, task: &Task, stopped: &(dyn Fn() -> bool + Sync)) -> Result<Option<Record>, CampaignError> {
        let mut attempts = 0;
        loop {
            if stopped() {
                return Ok(None);
            }
            attempts += 1;
            let begun = Instant::now();
            let Some(outcome) = self.once(task)? else { return Ok(None) };
            let (reason, result) = match outcome {
                Ok(result) => (None, result),
                // All was told to stop meanwhile. A Python that is still starting dies of that with exit code 1, as if the task had failed by itself; it is
                // computed when the campaign goes on.
                Err(_) if stopped() => return Ok(None),
                Err((reason, result)) => (Some(reason), result),
            };
            if reason.is_some() && attempts <= self.spec.retries {
                continue;
            }
            let record = Record { id: task.id.clone(), reason, attempts, wall_s: begun.elapsed().as_secs_f64(), result };
            self.keep(&record)?;
            if task.part == Part::Joined && record.reason.is_none() {
                // What the shares have drawn stands in the record now.
                let _ = std::fs::remove_dir_all(self.shared(&task.id));
            }
            return Ok(Some(record));
        }
    }

    /// Writes a record, whole.
    pub fn keep(&self, record: &Record) -> Result<(), CampaignError> {
        let file = self.file(&record.id);
        let text = serde_json::to_string(record).map_err(|e| CampaignError::file(&file, e))?;
        whole(&file, text.as_bytes())
    }

    /// Removes a record.
    pub fn forget(&self, id: &str) -> Result<(), CampaignError> {
        let file = self.file(id);
        match std::fs::remove_file(&file) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(CampaignError::file(&file, e)),
            _ => Ok(()),
        }
    }

    /// One attempt: what was printed, or why it failed; none where it was interrupted.
    #[allow(clippy::type_complexity)]
    fn once(&self, task: &Task) -> Result<Option<Result<Value, (String, Value)>>, CampaignError> {
        let work = tempfile::Builder::new()
            .prefix(super::folder::WORK)
            .tempdir_in(self.folder)
            .map_err(|e| CampaignError::file(self.folder, e))?;
        let run = work.path().join("run");
        let mut words = self.program.iter();
        let mut command = Command::new(words.next().map_or(OsStr::new(""), OsString::as_os_str));
        command.args(words).arg(&task.verb);
        if let Some(study) = &task.study {
            if task.set.is_empty() && task.verb != ADD {
                command.arg(study);
            } else {
                match variant_of(study, &task.set) {
                    Ok(text) => {
                        let file = work.path().join("study.toml");
                        std::fs::write(&file, text).map_err(|e| CampaignError::file(&file, e))?;
                        command.arg(file);
                    }
                    Err(reason) => return Ok(Some(Err((reason, Value::Null)))),
                }
            }
        }
        command.args(&task.arguments).arg("--json").arg("--out").arg(&run);
        command.args(["--seed", &task.seed.to_string(), "--threads", &self.spec.threads.to_string()]);
        match &task.part {
            Part::Whole => {}
            Part::Share { share, .. } => drop(command.args(["--share", &share.to_string()])),
            Part::Joined => drop(command.arg("--joined").arg(self.shared(&task.id))),
        }
        let started = PathBuf::from(command.get_program());
        let done = self.output(command).map_err(|e| CampaignError::file(&started, e))?;
        if interrupted(&done.status) {
            return Ok(None);
        }
        let printed = serde_json::from_slice::<Value>(&done.stdout);
        let outcome = match printed {
            Ok(value) if done.status.success() => Ok(value),
            Ok(value) => Err((reason(&value, &done.status.to_string()), value)),
            Err(_) => {
                let said = String::from_utf8_lossy(&done.stderr);
                let last = said.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or("it printed nothing");
                Err((format!("{}: {}", done.status, last.trim()), Value::Null))
            }
        };
        let (kept, outcome) = match &task.part {
            // What it printed is told once more by the whole.
            Part::Share { of, share } => (Some(self.share(of, *share)).filter(|_| outcome.is_ok()), outcome.map(|_| Value::Null)),
            Part::Whole | Part::Joined => (Some(self.folder.join("runs").join(&task.id)).filter(|_| self.spec.keep_runs), outcome),
        };
        if let Some(kept) = kept.filter(|_| run.is_dir()) {
            let _ = std::fs::remove_dir_all(&kept);
            let made = kept.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::rename(&run, &kept));
            made.map_err(|e| CampaignError::file(&kept, e))?;
        }
        Ok(Some(outcome))
    }
}

/// Whether a run was told to stop: it says so, or it was not yet far enough to.
fn interrupted(status: &ExitStatus) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        /// SIGINT.
        const CTRL_C: i32 = 2;
        if status.signal() == Some(CTRL_C) {
            return true;
        }
    }
    status.code() == Some(INTERRUPTED)
}

/// Why a run failed, by what it printed.
fn reason(printed: &Value, status: &str) -> String {
    let text = |key: &str| printed["error"][key].as_str().unwrap_or_default();
    if !text("message").is_empty() {
        let place = text("where");
        return if place.is_empty() { text("message").to_string() } else { format!("{} ({place})", text("message")) };
    }
    if let Some(first) = printed["problems"].get(0).and_then(|p| p["message"].as_str()) {
        return first.to_string();
    }
    match printed["termination"].as_str() {
        Some(word) => format!("the fit ended as {word}"),
        None => status.to_string(),
    }
}

/// The study with values replaced.
fn variant_of(study: &Path, set: &[(String, String)]) -> Result<String, String> {
    let file = if study.is_dir() { study.join("study.toml") } else { study.to_path_buf() };
    let text = limits::text(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    let mut table: toml::Table = text.parse().map_err(|e| format!("{}: {e}", file.display()))?;
    variant::absolute(&mut table, file.parent().unwrap_or(Path::new("")));
    for (key, text) in set {
        variant::set(&mut table, key, &list::value(text))?;
    }
    toml::to_string(&table).map_err(|e| e.to_string())
}

/// Writes a file whole.
pub fn whole(path: &Path, bytes: &[u8]) -> Result<(), CampaignError> {
    limits::replace(path, bytes).map_err(|e| CampaignError::file(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    #[cfg(unix)]
    fn a_task_that_fails_once_all_was_told_to_stop_is_no_failed_task() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("tasks")).unwrap();
        let file = folder.path().join("many.toml");
        std::fs::write(&file, "schema = 1\nverb = \"fit\"\nstudies = [\".\"]\n").unwrap();
        let spec = Spec::load(&file).unwrap();
        // A program that ends as an interrupted interpreter does.
        let program = ["sh", "-c", "echo KeyboardInterrupt >&2; exit 1"].map(OsString::from);
        let runner = Runner::new(&program, &spec, folder.path());
        let task = Task {
            id: "one".into(),
            label: "one".into(),
            verb: "fit".into(),
            study: None,
            seed: 1,
            axes: vec![],
            set: vec![],
            arguments: vec![],
            part: Part::Whole,
        };
        let asked = AtomicUsize::new(0);
        assert!(runner.run(&task, &|| asked.fetch_add(1, Ordering::Relaxed) > 0).unwrap().is_none());
        assert!(runner.record("one").is_none(), "it is computed when the campaign goes on");
        let failed = runner.run(&task, &|| false).unwrap().unwrap();
        assert!(failed.reason.unwrap().contains("KeyboardInterrupt"));
    }
}
