//! The file of finished cases: a line of options, then a line for each case as it ends. What was killed in the middle goes on from it.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::{CaseResult, Options, TrialError};

/// `cases.jsonl` in the folder of a trial.
pub struct Kept {
    path: PathBuf,
    file: Mutex<File>,
}

const NAME: &str = "cases.jsonl";

impl Kept {
    /// Starts a new file in `folder`, which must not hold one.
    pub fn create(folder: &Path, options: &Options) -> Result<Kept, TrialError> {
        let path = folder.join(NAME);
        let fail = |path: &Path, e: std::io::Error| TrialError::Write { path: path.to_path_buf(), reason: e.to_string() };
        std::fs::create_dir_all(folder).map_err(|e| fail(folder, e))?;
        if path.exists() {
            let accepted = format!("--resume {0} to go on, or --out with another folder", folder.display());
            return Err(TrialError::Resume { path, line: None, reason: "a trial has been begun here".into(), accepted });
        }
        let file = OpenOptions::new().create(true).append(true).open(&path).map_err(|e| fail(&path, e))?;
        let kept = Kept { path, file: Mutex::new(file) };
        kept.line(options)?;
        Ok(kept)
    }

    /// Goes on from the file in `folder`. A last line that was cut short is taken away.
    pub fn resume(folder: &Path) -> Result<(Kept, Options, Vec<CaseResult>), TrialError> {
        let path = folder.join(NAME);
        let accepted = format!("the --out folder of an earlier trial, with its {NAME}");
        let fail =
            |line: Option<usize>, reason: String| TrialError::Resume { path: path.clone(), line, reason, accepted: accepted.clone() };
        let text = std::fs::read_to_string(&path).map_err(|e| fail(None, e.to_string()))?;
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let mut lines = whole.lines().enumerate();
        let (_, head) = lines.next().ok_or_else(|| fail(None, "it is empty".into()))?;
        let options: Options = serde_json::from_str(head).map_err(|e| fail(Some(1), e.to_string()))?;
        let mut done: Vec<CaseResult> = Vec::new();
        for (k, line) in lines {
            let result: CaseResult = serde_json::from_str(line).map_err(|e| fail(Some(k + 1), e.to_string()))?;
            if done.iter().any(|d| d.index == result.index) {
                return Err(fail(Some(k + 1), format!("case {} stands twice", result.index)));
            }
            done.push(result);
        }
        let write = |e: std::io::Error| TrialError::Write { path: path.clone(), reason: e.to_string() };
        let file = OpenOptions::new().append(true).open(&path).map_err(write)?;
        file.set_len(whole.len() as u64).map_err(write)?;
        Ok((Kept { path: path.clone(), file: Mutex::new(file) }, options, done))
    }

    /// Puts the cases of shares of one trial together in the file of `folder`.
    pub fn join(folder: &Path, shares: &[PathBuf]) -> Result<(), TrialError> {
        let mut joined: Option<(Kept, Options)> = None;
        for share in shares {
            let (_, options, done) = Kept::resume(share)?;
            let (kept, of) = match joined.take() {
                Some(joined) => joined,
                None => (Kept::create(folder, &options)?, options.clone()),
            };
            if of != options {
                let (reason, accepted) = ("it is a share of another trial".to_string(), "shares of one trial".to_string());
                return Err(TrialError::Resume { path: share.join(NAME), line: Some(1), reason, accepted });
            }
            done.iter().try_for_each(|case| kept.add(case))?;
            joined = Some((kept, of));
        }
        Ok(())
    }

    /// Appends a finished case.
    pub fn add(&self, result: &CaseResult) -> Result<(), TrialError> {
        self.line(result)
    }

    fn line(&self, value: &impl serde::Serialize) -> Result<(), TrialError> {
        let fail = |reason: String| TrialError::Write { path: self.path.clone(), reason };
        let text = serde_json::to_string(value).map_err(|e| fail(e.to_string()))? + "\n";
        // The file is whole even where a thread died with the lock.
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(text.as_bytes()).map_err(|e| fail(e.to_string()))
    }
}
