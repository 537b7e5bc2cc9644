//! `misfit campaign`: one verb over many variants, on this machine or through Slurm.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::campaign::{self, CampaignError, Record, Runner, Spec, Task, slurm, table::Columns};
use crate::parallel;

use super::call::Watched;
use super::progress::Progress;
use super::table::table;
use super::{INTERRUPTED, Outcome};
use crate::work::Failure;

/// Where the tasks run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum On {
    /// On the cores of this machine
    Local,
    /// As a job array of Slurm
    Slurm,
}

#[derive(clap::Args)]
pub(super) struct Args {
    /// campaign.toml
    file: PathBuf,
    /// One JSON object on stdout, everything else on stderr
    #[arg(long)]
    pub json: bool,
    /// Where the tasks run
    #[arg(long, value_enum, default_value_t = On::Local)]
    on: On,
    /// Go on with what an earlier run has left: what is done is not done again, what failed is tried again
    #[arg(long)]
    resume: bool,
    /// Folder of the results [default: <name of the file>-results beside it]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Tasks at a time on this machine [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Element of a job array that this process is
    #[arg(long, value_name = "K", hide = true)]
    element: Option<usize>,
    /// The program that called the verb, in place of a terminal.
    #[arg(skip)]
    pub watcher: Watched,
}

/// Files of a campaign's folder.
const TABLE: &str = "table.parquet";
const REPORT: &str = "report.html";
const LIST: &str = "list.json";
const LOCK: &str = "lock";
/// Beginning of the names of folders in which tasks work.
const WORK: &str = "work-";
const JOB: &str = "job";
/// Between two looks whether the campaign is to stop.
const LOOK: Duration = Duration::from_millis(50);

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let begun = Instant::now();
    super::session::threads(args.threads)?;
    let flag = args.watcher.cancel()?;
    let stopped = || flag.load(Ordering::Relaxed);
    let spec = Spec::load(&args.file)?;
    let folder = args.out.clone().unwrap_or_else(|| spec.folder());
    let program = args.watcher.program()?;
    if let Some(element) = args.element {
        return one_element(&Runner::new(&program, &spec, &folder), element, &stopped);
    }
    let looks = campaign::looks(&spec)?;
    let listed = if looks.is_empty() { campaign::tasks(&spec)? } else { vec![] };
    begin(&folder, args.resume)?;
    let folder = folder.canonicalize().unwrap_or(folder);
    let _lock = Lock::take(&folder)?;
    // The elements of a job that goes on by itself are nobody's leftovers.
    if earlier(&folder).is_none() {
        leftovers(&folder)?;
    }
    let runner = Runner::new(&program, &spec, &folder);
    let progress = Progress::new(args.json, None, args.watcher.clone());
    if let Some(job) = earlier(&folder).filter(|_| args.on == On::Local) {
        let message = format!("job {job} of this campaign is still queued or running");
        let accepted = format!("--on slurm --resume to go on with it, or `scancel {job}`");
        return Err(Failure::new("campaign", folder.display().to_string(), message, accepted));
    }
    let execute = |tasks: &[Task], left: &[usize]| match args.on {
        On::Local => local(&runner, tasks, left, &progress, &stopped),
        On::Slurm => array(&runner, tasks, left, &progress, &stopped),
    };
    let tasks = if looks.is_empty() {
        listed
    } else {
        execute(&looks, &open(&runner, &looks))?;
        campaign::refits(&spec, &looks, &parallel::map(&looks, |t| runner.record(&t.id)))
    };
    let mut left: Vec<usize> = open(&runner, &tasks);
    // A map that stands for itself was tried as often as asked.
    left.retain(|k| looks.iter().all(|l| l.id != tasks[*k].id));
    let others = strangers(&runner, &tasks, &looks);
    if spec.shares > 1 {
        let shares: Vec<Task> = left.iter().flat_map(|k| tasks[*k].shares(spec.shares)).collect();
        execute(&shares, &open(&runner, &shares))?;
        let whole = together(&runner, &tasks, &left, stopped())?;
        execute(&tasks, &whole)?;
    } else {
        execute(&tasks, &left)?;
    }
    progress.end();
    let records: Vec<Option<Record>> = parallel::map(&tasks, |t| runner.record(&t.id));
    let columns = Columns::new(&tasks, &records);
    columns.write(&folder.join(TABLE))?;
    let page = campaign::page(&spec, &tasks, &records, &columns);
    write(&folder.join(REPORT), page.as_bytes())?;
    let interrupted = stopped();
    let done = records.iter().flatten().filter(|r| r.reason.is_none()).count();
    let lost = |r: &Option<Record>| match r {
        Some(r) => r.reason.clone(),
        // Of an interrupted campaign what is left has not failed.
        None if interrupted => None,
        None => Some("the task ended without a result".into()),
    };
    let failed: Vec<(&Task, String)> = tasks.iter().zip(&records).filter_map(|(t, r)| Some((t, lost(r)?))).collect();
    let shown = |name: &str| folder.join(name).display().to_string();
    let list: Vec<Value> = failed.iter().map(|(t, reason)| json!({ "task": t.label, "reason": reason })).collect();
    let value = json!({
        "tasks": tasks.len(), "done": done, "failed": list, "table": shown(TABLE), "report": shown(REPORT), "computed": left.len(),
        "of_other_inputs": others, "interrupted": interrupted, "wall_s": begun.elapsed().as_secs_f64(),
    });
    let mut text = format!("{}\n\n{done} of {} tasks done, {} failed.\n", spec.title, tasks.len(), failed.len());
    if !failed.is_empty() {
        let rows: Vec<Vec<String>> = failed.iter().take(20).map(|(t, r)| vec![t.label.clone(), r.clone()]).collect();
        text += &format!("\n{}", table(&["task", "reason"], &rows));
    }
    if others > 0 {
        text += &format!("{others} earlier results are of other inputs or another list, and are no part of the table.\n");
    }
    if interrupted {
        text += &format!("Stopped; to go on: misfit campaign {} --resume\n", args.file.display());
    }
    text += &format!("Table: {}\nReport: {}\n", shown(TABLE), shown(REPORT));
    Ok(Outcome { json: value, text, code: if interrupted { INTERRUPTED } else { 0 } })
}

/// The tasks that are not done.
fn open(runner: &Runner, tasks: &[Task]) -> Vec<usize> {
    let done = parallel::map(tasks, |t| runner.is_done(t));
    (0..tasks.len()).filter(|k| !done[*k]).collect()
}

/// Those of the tasks that are left whose shares are all done; of the others a record says which share failed, unless they were not tried.
fn together(runner: &Runner, tasks: &[Task], left: &[usize], stopped: bool) -> Result<Vec<usize>, CampaignError> {
    let mut whole = Vec::new();
    for k in left {
        let missing: Vec<Task> = tasks[*k].shares(runner.spec.shares).filter(|s| !runner.is_done(s)).collect();
        match missing.first() {
            None => whole.push(*k),
            Some(_) if stopped => {}
            Some(first) => {
                let why = runner.record(&first.id).and_then(|r| r.reason).unwrap_or_else(|| "it ended without a result".into());
                let reason = format!("{} of {} shares failed; {}: {why}", missing.len(), runner.spec.shares, first.label);
                let id = tasks[*k].id.clone();
                runner.keep(&Record { id, reason: Some(reason), attempts: 0, wall_s: 0.0, result: Value::Null })?;
            }
        }
    }
    Ok(whole)
}

/// Every task that is left, as many at a time as there are threads.
fn local(runner: &Runner, tasks: &[Task], left: &[usize], progress: &Progress, stopped: &(dyn Fn() -> bool + Sync)) -> Result<(), Failure> {
    let (begun, count) = (Instant::now(), AtomicUsize::new(0));
    let one = |k: &usize| -> Result<(), CampaignError> {
        runner.run(&tasks[*k], stopped)?;
        let n = count.fetch_add(1, Ordering::Relaxed) + 1;
        let rest = begun.elapsed().as_secs_f64() / n as f64 * (left.len() - n) as f64;
        progress.count(&format!("{n} of {} tasks, about {rest:.0} s left", left.len()));
        Ok(())
    };
    // Whoever stops the campaign may not reach the processes of its tasks, as Ctrl-C on a terminal does: they are told.
    let (ended, end) = std::sync::mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            while end.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if stopped() {
                    return runner.interrupt();
                }
            }
        });
        let all = parallel::map(left, one);
        drop(ended);
        Ok(all.into_iter().collect::<Result<(), _>>()?)
    })
}

/// The job of an earlier run that is still queued or running.
fn earlier(folder: &Path) -> Option<String> {
    let job = std::fs::read_to_string(folder.join(JOB)).ok()?;
    slurm::busy(&job, Duration::ZERO).ok().flatten().map(|_| job)
}

/// Why nothing of a job runs, where Slurm says so.
fn because(waits: &str) -> String {
    if waits.is_empty() { String::new() } else { format!("; nothing of it runs, and Slurm says: {waits}") }
}

/// The same as a job array. What an element leaves without a record, because it was killed with its node, is queued again as often as asked; then it has failed,
/// for what the element said last.
fn array(runner: &Runner, tasks: &[Task], left: &[usize], progress: &Progress, stopped: &(dyn Fn() -> bool + Sync)) -> Result<(), Failure> {
    let mut left = left.to_vec();
    // A job whose submitter was killed goes on by itself: it is waited for, not queued twice.
    if let Some(job) = earlier(runner.folder) {
        let mut look = |waits: &str| progress.count(&format!("job {job} of an earlier run{}", because(waits)));
        slurm::wait(&job, stopped, &mut look)?;
        left.retain(|k| !runner.is_done(&tasks[*k]));
    }
    let mut lost: Vec<(usize, usize)> = vec![];
    for _ in 0..=runner.spec.retries {
        if left.is_empty() || stopped() {
            break;
        }
        let elements = slurm::elements(left.len());
        let packed: Vec<Vec<&Task>> = (0..elements).map(|e| left.iter().skip(e).step_by(elements).map(|k| &tasks[*k]).collect()).collect();
        let text = serde_json::to_vec(&packed).map_err(|e| CampaignError::Folder {
            path: runner.folder.join(LIST),
            message: e.to_string(),
            accepted: "a list that can be written".into(),
        })?;
        write(&runner.folder.join(LIST), &text)?;
        let quoted = |p: &Path| format!("'{}'", p.display().to_string().replace('\'', "'\\''"));
        let file = runner.spec.file.canonicalize().unwrap_or(runner.spec.file.clone());
        let script = format!(
            "exec {} campaign {} --json --out {} --element \"$SLURM_ARRAY_TASK_ID\"",
            runner.program.iter().map(|w| quoted(Path::new(w))).collect::<Vec<_>>().join(" "),
            quoted(&file),
            quoted(runner.folder)
        );
        let job =
            slurm::submit(&runner.spec.title.replace(char::is_whitespace, "-"), elements, runner.spec.threads, runner.folder, &script)?;
        write(&runner.folder.join(JOB), job.as_bytes())?;
        let all = left.len();
        let mut look = |waits: &str| {
            let n = left.iter().filter(|k| runner.file(&tasks[**k].id).exists()).count();
            progress.count(&format!("job {job}: {n} of {all} tasks{}", because(waits)));
        };
        slurm::wait(&job, stopped, &mut look)?;
        let without = |(place, k): (usize, &usize)| runner.record(&tasks[*k].id).is_none().then_some((*k, place % elements));
        lost = left.iter().enumerate().filter_map(without).collect();
        left = lost.iter().map(|(k, _)| *k).collect();
    }
    for (k, element) in lost.into_iter().filter(|_| !stopped()) {
        let (id, reason) = (tasks[k].id.clone(), slurm::last_words(runner.folder, element));
        runner.keep(&Record { id, reason: Some(reason), attempts: runner.spec.retries + 1, wall_s: 0.0, result: Value::Null })?;
    }
    Ok(())
}

/// One element of a job array: its tasks, one after the other.
fn one_element(runner: &Runner, element: usize, stopped: &(dyn Fn() -> bool + Sync)) -> Result<Outcome, Failure> {
    let path = runner.folder.join(LIST);
    let odd =
        |reason: String| Failure::new("campaign", path.display().to_string(), reason, "the list that `misfit campaign --on slurm` writes");
    let text = crate::limits::bytes(&path, 16 * crate::limits::CONFIG_BYTES).map_err(|e| odd(e.to_string()))?;
    let packed: Vec<Vec<Task>> = serde_json::from_slice(&text).map_err(|e| odd(e.to_string()))?;
    let own = packed.get(element).ok_or_else(|| odd(format!("it has no element {element}")))?;
    let mut done = 0;
    for task in own {
        // A job that was requeued finds what it has done before.
        if runner.is_done(task) {
            continue;
        }
        if runner.run(task, stopped)?.is_none() {
            return Ok(Outcome { json: json!({ "element": element, "done": done }), text: String::new(), code: INTERRUPTED });
        }
        done += 1;
    }
    Ok(Outcome { json: json!({ "element": element, "done": done }), text: format!("{done} tasks\n"), code: 0 })
}

/// Makes the folder; refuses one in which a campaign was begun, unless it is resumed.
fn begin(folder: &Path, resume: bool) -> Result<(), Failure> {
    let tasks = folder.join("tasks");
    if tasks.exists() && !resume {
        let message = "a campaign has been begun here";
        return Err(Failure::new("campaign", folder.display().to_string(), message, "--resume to go on, or --out with another folder"));
    }
    let fail = |e: std::io::Error| Failure::new("campaign", folder.display().to_string(), e.to_string(), "a folder that can be written");
    std::fs::create_dir_all(&tasks).and_then(|()| std::fs::create_dir_all(folder.join("runs"))).map_err(fail)
}

/// Ends and removes what a killed run has left.
fn leftovers(folder: &Path) -> Result<(), Failure> {
    orphans(folder);
    let fail = |e: std::io::Error| Failure::new("campaign", folder.display().to_string(), e.to_string(), "a folder that can be written");
    let entries = std::fs::read_dir(folder).map_err(fail)?.flatten();
    for left in entries.filter(|e| e.file_name().to_string_lossy().starts_with(WORK)) {
        // What cannot be removed is in nobody's way.
        let _ = std::fs::remove_dir_all(left.path());
    }
    Ok(())
}

/// Ends what a killed campaign has left running: runs of this program whose command line names a folder of work in this campaign's folder. Where the system has no /proc, none is
/// found: they end by themselves, and nobody takes their results.
fn orphans(folder: &Path) {
    let mark = folder.join(WORK).display().to_string();
    let program = std::env::current_exe().ok();
    for process in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
        let command = std::fs::read(process.path().join("cmdline")).unwrap_or_default();
        let name = process.file_name().to_string_lossy().into_owned();
        let ours = std::fs::read_link(process.path().join("exe")).ok() == program;
        if name.bytes().all(|b| b.is_ascii_digit()) && ours && String::from_utf8_lossy(&command).contains(&mark) {
            let _ = std::process::Command::new("kill").args(["-9", &name]).status();
        }
    }
}

/// Records of tasks that are not in the list.
fn strangers(runner: &Runner, tasks: &[Task], looks: &[Task]) -> usize {
    let shares = Some(runner.spec.shares).filter(|n| *n > 1).unwrap_or(0);
    let shared = tasks.iter().flat_map(|t| t.shares(shares)).map(|s| s.id);
    let known: std::collections::HashSet<String> = tasks.iter().chain(looks).map(|t| t.id.clone()).chain(shared).collect();
    let names = std::fs::read_dir(runner.folder.join("tasks"))
        .into_iter()
        .flatten()
        .flatten()
        .map(|e| e.file_name().to_string_lossy().into_owned());
    names.filter(|n| n.strip_suffix(".json").is_some_and(|id| !known.contains(id))).count()
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    Ok(campaign::whole(path, bytes)?)
}

/// Keeps a second campaign out of a folder for as long as this one runs.
struct Lock {
    /// Locked as long as this process lives, whoever waits for its end.
    _file: std::fs::File,
}

impl Lock {
    fn take(folder: &Path) -> Result<Lock, Failure> {
        let path = folder.join(LOCK);
        let failed = |e: std::io::Error| CampaignError::File { path: path.clone(), reason: e.to_string() };
        let mut file = std::fs::OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(std::fs::TryLockError::WouldBlock) => {
                let mut pid = String::new();
                file.read_to_string(&mut pid).map_err(failed)?;
                let message = format!("another campaign is at work here (process {})", pid.trim());
                return Err(Failure::new("campaign", folder.display().to_string(), message, "its end, or --out with another folder"));
            }
            // Some file systems of clusters have no locks; there the last one to come wins, and every result is written whole.
            Err(std::fs::TryLockError::Error(e)) if e.kind() == std::io::ErrorKind::Unsupported => {}
            Err(std::fs::TryLockError::Error(e)) => return Err(failed(e).into()),
        }
        file.set_len(0).and_then(|()| file.write_all(std::process::id().to_string().as_bytes())).map_err(failed)?;
        Ok(Lock { _file: file })
    }
}
