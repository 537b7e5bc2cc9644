//! The folder of a campaign: who may work in it, and what a killed run has left there.

use std::io::{Read, Write};
use std::path::Path;

use super::{CampaignError, Runner, Task};

/// Locked for as long as a campaign is at work.
const LOCK: &str = "lock";
/// Beginning of the names of folders in which tasks work.
pub(super) const WORK: &str = "work-";

/// What is wrong with the folder.
pub(super) fn odd(folder: &Path, message: impl Into<String>, accepted: impl Into<String>) -> CampaignError {
    CampaignError::Folder { path: folder.to_path_buf(), message: message.into(), accepted: accepted.into() }
}

/// Makes the folder; refuses one in which a campaign was begun, unless it is resumed.
pub(super) fn begin(folder: &Path, resume: bool) -> Result<(), CampaignError> {
    let tasks = folder.join("tasks");
    if tasks.exists() && !resume {
        let message = "a campaign has been begun here";
        return Err(odd(folder, message, "--resume to go on, or --out with another folder"));
    }
    let fail = |e: std::io::Error| odd(folder, e.to_string(), "a folder that can be written");
    std::fs::create_dir_all(&tasks).and_then(|()| std::fs::create_dir_all(folder.join("runs"))).map_err(fail)
}

/// Ends and removes what a killed run has left.
pub(super) fn leftovers(folder: &Path) -> Result<(), CampaignError> {
    orphans(folder);
    let fail = |e: std::io::Error| odd(folder, e.to_string(), "a folder that can be written");
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
pub(super) fn strangers(runner: &Runner, tasks: &[Task], looks: &[Task]) -> usize {
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

/// Keeps a second campaign out of a folder for as long as this one runs.
pub(super) struct Lock {
    /// Locked as long as this process lives, whoever waits for its end.
    _file: std::fs::File,
}

impl Lock {
    pub fn take(folder: &Path) -> Result<Lock, CampaignError> {
        let path = folder.join(LOCK);
        let failed = |e: std::io::Error| CampaignError::file(&path, e);
        let mut file = std::fs::OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(std::fs::TryLockError::WouldBlock) => {
                let mut pid = String::new();
                file.read_to_string(&mut pid).map_err(failed)?;
                let message = format!("another campaign is at work here (process {})", pid.trim());
                return Err(odd(folder, message, "its end, or --out with another folder"));
            }
            // Some file systems of clusters have no locks; there the last one to come wins, and every result is written whole.
            Err(std::fs::TryLockError::Error(e)) if e.kind() == std::io::ErrorKind::Unsupported => {}
            Err(std::fs::TryLockError::Error(e)) => return Err(failed(e)),
        }
        file.set_len(0).and_then(|()| file.write_all(std::process::id().to_string().as_bytes())).map_err(failed)?;
        Ok(Lock { _file: file })
    }
}
