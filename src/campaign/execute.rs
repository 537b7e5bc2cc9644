//! The work list of a campaign, done on this machine or through Slurm, and what came of it.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::parallel;

use super::folder::{Lock, begin, leftovers, odd, strangers};
use super::table::Columns;
use super::{CampaignError, Record, Runner, Spec, Task, looks, page, refits, slurm, tasks, whole};

/// Where the tasks run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum On {
    /// On the cores of this machine
    Local,
    /// As a job array of Slurm
    Slurm,
}

/// How a campaign is run.
#[derive(Clone, Copy, Debug)]
pub struct How<'a> {
    /// Where.
    pub on: On,
    /// Whether to go on with what an earlier run has left in the folder: what is done is not done again, what failed is tried again.
    pub resume: bool,
    /// The words that start this program, before those of a verb.
    pub program: &'a [OsString],
}

/// Whether the campaign is to stop.
pub type Stopped<'a> = &'a (dyn Fn() -> bool + Sync);
/// Hears how far it has come.
pub type Say<'a> = &'a (dyn Fn(&str) + Sync);

/// What came of a campaign.
#[derive(Clone, Debug)]
pub struct Done {
    /// Its tasks, in order.
    pub tasks: Vec<Task>,
    /// Their records; none of a task that ended without one, or was not tried.
    pub records: Vec<Option<Record>>,
    /// Tasks that were not done before.
    pub computed: usize,
    /// Records in the folder that are of other inputs, or of another list.
    pub others: usize,
    /// Whether it was stopped.
    pub stopped: bool,
    /// The table.
    pub table: PathBuf,
    /// The page.
    pub report: PathBuf,
}

impl Done {
    /// Tasks that have a result.
    pub fn done(&self) -> usize {
        self.records.iter().flatten().filter(|r| r.reason.is_none()).count()
    }

    /// Tasks that failed, and why. Of a campaign that was stopped, what is left has not failed.
    pub fn failed(&self) -> Vec<(&Task, String)> {
        let lost = |r: &Option<Record>| match r {
            Some(r) => r.reason.clone(),
            None => (!self.stopped).then(|| "the task ended without a result".into()),
        };
        self.tasks.iter().zip(&self.records).filter_map(|(t, r)| Some((t, lost(r)?))).collect()
    }
}

const TABLE: &str = "table.parquet";
const REPORT: &str = "report.html";
const LIST: &str = "list.json";
const JOB: &str = "job";
/// Between two looks whether the campaign is to stop.
const LOOK: Duration = Duration::from_millis(50);

/// Runs what is left of a campaign into its folder, and writes table and page of all its results.
///
/// # Errors
/// A folder in which a campaign was begun, or another one is at work; a scheduler that refuses; a file that cannot be written. A task that fails is
/// none: its record says why.
pub fn run(spec: &Spec, folder: &Path, how: How, stopped: Stopped, say: Say) -> Result<Done, CampaignError> {
    let looks = looks(spec)?;
    let listed = if looks.is_empty() { tasks(spec)? } else { vec![] };
    begin(folder, how.resume)?;
    let folder = &folder.canonicalize().unwrap_or(folder.to_path_buf());
    let _lock = Lock::take(folder)?;
    // The elements of a job that goes on by itself are nobody's leftovers.
    if earlier(folder).is_none() {
        leftovers(folder)?;
    }
    let runner = Runner::new(how.program, spec, folder);
    if let Some(job) = earlier(folder).filter(|_| how.on == On::Local) {
        let message = format!("job {job} of this campaign is still queued or running");
        let accepted = format!("--on slurm --resume to go on with it, or `scancel {job}`");
        return Err(odd(folder, message, accepted));
    }
    let execute = |tasks: &[Task], left: &[usize]| match how.on {
        On::Local => local(&runner, tasks, left, (stopped, say)),
        On::Slurm => array(&runner, tasks, left, (stopped, say)),
    };
    let tasks = if looks.is_empty() {
        listed
    } else {
        execute(&looks, &open(&runner, &looks))?;
        refits(spec, &looks, &parallel::map(&looks, |t| runner.record(&t.id)))
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
    let records: Vec<Option<Record>> = parallel::map(&tasks, |t| runner.record(&t.id));
    let columns = Columns::new(&tasks, &records);
    columns.write(&folder.join(TABLE))?;
    let page = page(spec, &tasks, &records, &columns);
    whole(&folder.join(REPORT), page.as_bytes())?;
    let shown = |name: &str| folder.join(name);
    Ok(Done { tasks, records, computed: left.len(), others, stopped: stopped(), table: shown(TABLE), report: shown(REPORT) })
}

/// The tasks that are not done.
fn open(runner: &Runner, tasks: &[Task]) -> Vec<usize> {
    let done = parallel::map(tasks, |t| runner.is_done(t));
    (0..tasks.len()).filter(|k| !done[*k]).collect()
}

/// Those of the tasks that are left whose shares are all done; of the others a record says which share failed, unless they were not tried.
fn together(runner: &Runner, tasks: &[Task], left: &[usize], stopped: bool) -> Result<Vec<usize>, CampaignError> {
    let mut all = Vec::new();
    for k in left {
        let missing: Vec<Task> = tasks[*k].shares(runner.spec.shares).filter(|s| !runner.is_done(s)).collect();
        match missing.first() {
            None => all.push(*k),
            Some(_) if stopped => {}
            Some(first) => {
                let why = runner.record(&first.id).and_then(|r| r.reason).unwrap_or_else(|| "it ended without a result".into());
                let reason = format!("{} of {} shares failed; {}: {why}", missing.len(), runner.spec.shares, first.label);
                let id = tasks[*k].id.clone();
                runner.keep(&Record { id, reason: Some(reason), attempts: 0, wall_s: 0.0, result: Value::Null })?;
            }
        }
    }
    Ok(all)
}

/// Every task that is left, as many at a time as there are threads.
fn local(runner: &Runner, tasks: &[Task], left: &[usize], (stopped, say): (Stopped, Say)) -> Result<(), CampaignError> {
    let (begun, count) = (Instant::now(), AtomicUsize::new(0));
    let one = |k: &usize| -> Result<(), CampaignError> {
        // A task that was told to stop is not one of those that are through.
        if runner.run(&tasks[*k], stopped)?.is_none() {
            return Ok(());
        }
        let n = count.fetch_add(1, Ordering::Relaxed) + 1;
        let rest = begun.elapsed().as_secs_f64() / n as f64 * (left.len() - n) as f64;
        say(&format!("{n} of {} tasks, about {rest:.0} s left", left.len()));
        Ok(())
    };
    if !left.is_empty() {
        say(&format!("0 of {} tasks", left.len()));
    }
    // Whoever stops the campaign may not reach the processes of its tasks, as Ctrl-C on a terminal does: they are told.
    let (ended, end) = std::sync::mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            while end.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                // More than once: a task may have been about to start its process.
                if stopped() {
                    runner.interrupt();
                }
            }
        });
        let all = parallel::map(left, one);
        drop(ended);
        all.into_iter().collect()
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
fn array(runner: &Runner, tasks: &[Task], left: &[usize], (stopped, say): (Stopped, Say)) -> Result<(), CampaignError> {
    let mut left = left.to_vec();
    // A job whose submitter was killed goes on by itself: it is waited for, not queued twice.
    if let Some(job) = earlier(runner.folder) {
        let mut look = |waits: &str| say(&format!("job {job} of an earlier run{}", because(waits)));
        slurm::wait(&job, stopped, &mut look)?;
        left.retain(|k| !runner.is_done(&tasks[*k]));
    }
    // What failed before says nothing of the elements that try it again: one that is lost leaves no record.
    left.iter().try_for_each(|k| runner.forget(&tasks[*k].id))?;
    let mut lost: Vec<(usize, usize)> = vec![];
    for _ in 0..=runner.spec.retries {
        if left.is_empty() || stopped() {
            break;
        }
        let elements = slurm::elements(left.len());
        let packed: Vec<Vec<&Task>> = (0..elements).map(|e| left.iter().skip(e).step_by(elements).map(|k| &tasks[*k]).collect()).collect();
        let list = runner.folder.join(LIST);
        whole(&list, &serde_json::to_vec(&packed).map_err(|e| CampaignError::file(&list, e))?)?;
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
        whole(&runner.folder.join(JOB), job.as_bytes())?;
        let all = left.len();
        let mut look = |waits: &str| {
            let n = left.iter().filter(|k| runner.file(&tasks[**k].id).exists()).count();
            say(&format!("job {job}: {n} of {all} tasks{}", because(waits)));
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

/// Does the work of one element of a job array: its tasks, one after the other. Returns how many it has done, and whether it was stopped.
///
/// # Errors
/// A list that is none, or has no such element; a record that cannot be written.
pub fn element(runner: &Runner, element: usize, stopped: Stopped) -> Result<(usize, bool), CampaignError> {
    let path = runner.folder.join(LIST);
    let odd = |reason: String| odd(&path, reason, "the list that `misfit campaign --on slurm` writes");
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
            return Ok((done, true));
        }
        done += 1;
    }
    Ok((done, false))
}
