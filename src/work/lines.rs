//! Profiles and bootstrap replicates as they come: files of a run with a line of JSON each, so that what was interrupted can be gone on with.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::diagnose::Fitted;
use crate::study::run::RunFolder;

use super::Failure;

/// Bootstrap replicates of a run.
pub const BOOTSTRAP: &str = "bootstrap.jsonl";
/// Profiles of a run.
pub const PROFILES: &str = "profiles.jsonl";
/// Relative difference up to which a fit has come back to the answer that replicates and profiles are about.
const SAME: f64 = 1e-6;

/// Lines of JSON that are appended as they come; the first says what they are about.
pub struct Lines {
    path: PathBuf,
    file: Mutex<std::fs::File>,
}

/// The first line: the fit that the others are about.
#[derive(Serialize, Deserialize)]
pub struct Head {
    names: Vec<String>,
    p: Vec<f64>,
    seed: u64,
}

impl Lines {
    /// Opens the file of a run and reads what it holds; a last line that was cut short is taken away.
    pub fn open<T: for<'a> Deserialize<'a>>(folder: &RunFolder, name: &str, head: &Head) -> Result<(Lines, Vec<T>), Failure> {
        let path = folder.path.join(name);
        let shown = path.display().to_string();
        let fail = |e: std::io::Error| Failure::new("identify", shown.clone(), e.to_string(), "a file that can be written");
        let other = |message: String| {
            Failure::new(
                "identify",
                shown.clone(),
                message,
                "the folder of a run of the same study, fit and seed, or a new run without --resume",
            )
        };
        let text = if path.exists() { std::fs::read_to_string(&path).map_err(fail)? } else { String::new() };
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        let mut lines = whole.lines();
        let mut done = Vec::new();
        match lines.next() {
            Some(first) => {
                let old: Head = serde_json::from_str(first).map_err(|e| other(format!("line 1: {e}")))?;
                let near = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME * a.abs().max(b.abs());
                if old.names != head.names || old.seed != head.seed || !old.p.iter().zip(&head.p).all(near) {
                    return Err(other("it is about another fit".into()));
                }
                for (k, line) in lines.enumerate() {
                    done.push(serde_json::from_str(line).map_err(|e| other(format!("line {}: {e}", k + 2)))?);
                }
            }
            None => {
                let first = serde_json::to_string(head).map_err(|e| other(e.to_string()))? + "\n";
                std::fs::write(&path, first).map_err(fail)?;
            }
        }
        let file = OpenOptions::new().append(true).open(&path).map_err(fail)?;
        if !whole.is_empty() {
            file.set_len(whole.len() as u64).map_err(fail)?;
        }
        Ok((Lines { path, file: Mutex::new(file) }, done))
    }

    /// Puts the lines of shares of one run together in a file of `folder`; what they are about is that of the first.
    pub fn join(folder: &RunFolder, name: &str, shares: &[PathBuf]) -> Result<(), Failure> {
        let mut text = String::new();
        for path in shares.iter().map(|share| share.join(name)).filter(|path| path.is_file()) {
            let fail = |reason: String| Failure::new("identify", path.display().to_string(), reason, "the lines of a share of this run");
            let own = crate::limits::text(&path).map_err(|e| fail(e.to_string()))?;
            let (head, lines) = own.split_once('\n').ok_or_else(|| fail("it is empty".into()))?;
            match text.split_once('\n') {
                None => text = own,
                Some((first, _)) if first == head => text += lines,
                Some(_) => return Err(fail("it is about another fit than the share before it".into())),
            }
        }
        if !text.is_empty() {
            folder.write(name, text.as_bytes())?;
        }
        Ok(())
    }

    /// Appends a line.
    pub fn add(&self, value: &impl Serialize) -> Result<(), Failure> {
        let fail = |reason: String| Failure::new("identify", self.path.display().to_string(), reason, "a file that can be written");
        let text = serde_json::to_string(value).map_err(|e| fail(e.to_string()))? + "\n";
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(text.as_bytes()).map_err(|e| fail(e.to_string()))
    }
}

/// What the lines of a fit are about.
pub fn head(fitted: &Fitted, seed: u64) -> Head {
    Head { names: fitted.options.names.clone(), p: fitted.outcome.p.clone(), seed }
}
