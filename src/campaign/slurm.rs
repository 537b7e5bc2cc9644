//! The work list as a job array of Slurm: `sbatch` queues, places and requeues; this program packs tasks into elements, asks at a bounded rate, and collects.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use super::CampaignError;
use crate::limits;

/// Most elements of one array: Slurm's default `MaxArraySize` is 1001.
pub const ELEMENTS: usize = 1000;
/// Time between two questions to the scheduler.
const EVERY: Duration = Duration::from_secs(1);

fn call(command: &mut Command) -> Result<String, CampaignError> {
    let words =
        format!("{} {}", command.get_program().display(), command.get_args().map(|a| a.to_string_lossy()).collect::<Vec<_>>().join(" "));
    let short: String = words.chars().take(200).collect();
    let done = command.output().map_err(|e| CampaignError::Scheduler { command: short.clone(), reason: e.to_string() })?;
    if done.status.success() {
        return Ok(String::from_utf8_lossy(&done.stdout).trim().to_string());
    }
    let said = String::from_utf8_lossy(&done.stderr).trim().to_string();
    Err(CampaignError::Scheduler { command: short, reason: if said.is_empty() { done.status.to_string() } else { said } })
}

/// Processors of the cluster; none where the scheduler does not say.
fn processors() -> Option<usize> {
    // allocated/idle/other/total, a line a partition.
    let told = call(Command::new("sinfo").args(["--noheader", "--format", "%C"])).ok()?;
    told.lines().filter_map(|l| l.trim().rsplit('/').next()?.parse::<usize>().ok()).max()
}

/// Elements for so many tasks: two for every processor, so that short tasks are packed and long ones are still spread evenly.
pub fn elements(tasks: usize) -> usize {
    tasks.min(processors().map_or(ELEMENTS, |n| 2 * n.max(1))).clamp(1, ELEMENTS)
}

/// Folder of what the elements of a job say.
const LOGS: &str = "slurm";

/// What an element that left no result said last: of a node without the program or the data, with a full disk.
pub fn last_words(folder: &Path, element: usize) -> String {
    let said = limits::text(&folder.join(LOGS).join(format!("{element}.log"))).unwrap_or_default();
    let Some(last) = said.lines().rev().map(str::trim).find(|l| !l.is_empty()) else {
        return format!("element {element} of the job array ended without a result and without a word");
    };
    let error = serde_json::from_str::<serde_json::Value>(last).ok();
    let message = error.as_ref().and_then(|e| e["error"]["message"].as_str());
    format!("element {element} of the job array ended without a result: {}", message.unwrap_or(last))
}

/// Queues an array of `elements`, each of which runs `script` with its index in `SLURM_ARRAY_TASK_ID`; gives the id of the job.
pub fn submit(name: &str, elements: usize, threads: usize, folder: &Path, script: &str) -> Result<String, CampaignError> {
    let logs = folder.join(LOGS);
    std::fs::create_dir_all(&logs).map_err(|e| CampaignError::file(&logs, e))?;
    let mut command = Command::new("sbatch");
    command.args(["--parsable", "--job-name", name, "--open-mode=append"]);
    command.arg(format!("--array=0-{}", elements.max(1) - 1)).arg(format!("--cpus-per-task={threads}"));
    command.arg(format!("--output={}", logs.join("%a.log").display())).arg("--wrap").arg(script);
    let id = call(&mut command)?;
    // `id;cluster` where there are several clusters.
    Ok(id.split(';').next().unwrap_or_default().to_string())
}

/// What a job that has not ended waits for; none where it has. A scheduler that does not answer is asked again, for as long as `patience`.
pub fn busy(job: &str, patience: Duration) -> Result<Option<String>, CampaignError> {
    let begun = Instant::now();
    loop {
        match call(Command::new("squeue").args(["--noheader", "--jobs", job, "--format", "%T %r"])) {
            Ok(states) => return Ok((!states.is_empty()).then(|| waits(&states))),
            // A job that ended is forgotten after a while.
            Err(CampaignError::Scheduler { reason, .. }) if reason.contains("Invalid job id") => return Ok(None),
            Err(e) if begun.elapsed() > patience => return Err(e),
            Err(_) => std::thread::sleep(EVERY),
        }
    }
}

/// Why nothing of a job runs, from the state and the reason of each of its elements; empty where something does, or where it waits for its turn alone.
fn waits(states: &str) -> String {
    let turn = ["", "None", "Resources", "Priority"];
    let mut reasons: Vec<&str> = Vec::new();
    for (state, reason) in states.lines().map(|l| l.trim().split_once(' ').unwrap_or((l.trim(), ""))) {
        if state != "PENDING" || turn.contains(&reason.trim()) {
            return String::new();
        }
        if !reasons.contains(&reason.trim()) {
            reasons.push(reason.trim());
        }
    }
    reasons.join("; ")
}

/// Waits until a job has ended, or `stopped` says so: then it is cancelled. `look` is told what it waits for.
pub fn wait(job: &str, stopped: &dyn Fn() -> bool, look: &mut dyn FnMut(&str)) -> Result<(), CampaignError> {
    loop {
        if stopped() {
            return call(Command::new("scancel").arg(job)).map(drop);
        }
        let Some(waits) = busy(job, Duration::from_secs(300))? else { return Ok(()) };
        look(&waits);
        std::thread::sleep(EVERY);
    }
}

#[cfg(test)]
mod tests {
    use super::waits;

    #[test]
    fn a_job_that_cannot_run_says_why() {
        let drained = "Nodes required for job are DOWN, DRAINED or reserved for jobs in higher priority partitions";
        assert_eq!(waits(&format!("PENDING {drained}\nPENDING JobHeldUser\nPENDING JobHeldUser")), format!("{drained}; JobHeldUser"));
        // One element that runs, or waits for its turn, is enough to go on.
        for states in ["RUNNING None", "PENDING JobHeldUser\nRUNNING None", "PENDING Resources\nPENDING JobHeldUser", "RUNNING"] {
            assert_eq!(waits(states), "", "{states}");
        }
    }
}
