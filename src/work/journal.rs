//! The journal of a ladder, in the folder of its run: every fit that has ended, a line each, so that a ladder that was stopped or killed is climbed again in
//! little time to where it was cut off, and ends as an undisturbed one does ([`crate::identify::Journal`]).
//!
//! A line is the hash of its text and the text, JSON. The first line says which ladder it is. A line that was cut short or damaged is passed over, and its
//! fit made again.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

use crate::diagnose::Case;
use crate::identify::{Journal, Kept};
use crate::limits;
use crate::study::run::RunFolder;

use super::Failure;

/// Bytes of a journal at most; what ends after that is not kept. The longest ladder of our studies writes a hundredth of it.
const MOST: usize = 64 << 20;

/// The first line: the ladder that the fits are of.
#[derive(Serialize, Deserialize, Clone, PartialEq)]
struct Head {
    /// Version of the program: another one may fit otherwise.
    misfit: String,
    study: String,
    seed: u64,
    /// Hash of the model and the data that it began with.
    began: u64,
}

impl Head {
    fn of(case: &Case) -> Head {
        let mut began = Xxh3::new();
        for i in &case.system.instances {
            began.update(format!("{} {} {:?}", i.name(), i.at, i.params).as_bytes());
        }
        for (plan, split) in case.plans.iter() {
            began.update(format!("{} {split:?}", plan.id).as_bytes());
            plan.measured.iter().chain(&plan.sigma).for_each(|v| began.update(&v.to_bits().to_le_bytes()));
        }
        Head { misfit: env!("CARGO_PKG_VERSION").into(), study: case.name.clone(), seed: case.seed, began: began.digest() }
    }

    /// What tells these two ladders apart so far that no fit of one is one of the other.
    fn unlike(&self, other: &Head) -> Option<String> {
        let pairs = [
            ("version of misfit", &self.misfit, &other.misfit),
            ("study", &self.study, &other.study),
            ("seed", &self.seed.to_string(), &other.seed.to_string()),
        ];
        let odd = pairs.into_iter().find(|(_, own, other)| own != other);
        odd.map(|(what, own, other)| format!("its {what} is `{own}`, that of this ladder `{other}`"))
    }
}

/// A fit that has ended.
#[derive(Serialize, Deserialize)]
struct Line {
    /// Seconds since the ladder began.
    at: f64,
    fit: Kept,
}

/// A line of the file: the hash of its text, and the text.
fn line(value: &impl Serialize) -> Option<String> {
    let text = serde_json::to_string(value).ok()?;
    Some(format!("{:016x} {text}\n", xxh3_64(text.as_bytes())))
}

/// The text of a line whose hash is right.
fn whole(line: &[u8]) -> Option<&str> {
    let (hash, text) = std::str::from_utf8(line).ok()?.split_once(' ')?;
    (hash.len() == 16 && u64::from_str_radix(hash, 16).ok()? == xxh3_64(text.as_bytes())).then_some(text)
}

/// What a journal holds.
struct Read {
    head: Head,
    lines: Vec<Line>,
    /// Lines that are not whole; the last one may have been cut short by the end of the run and is none of them.
    damaged: usize,
}

/// Reads the journal in the folder of a run.
fn read(run: &Path) -> Result<Read, Failure> {
    let file = RunFolder::at(run).journal();
    let refused =
        |message: String| Failure::new("study", file.display().to_string(), message, "the folder of a `ladder` that was stopped or killed");
    let bytes = limits::bytes(&file, MOST as u64).map_err(|e| refused(format!("no fits of an earlier ladder to go on with: {e}")))?;
    let mut parts = bytes.split(|b| *b == b'\n');
    let head = parts.next().and_then(whole).and_then(|text| serde_json::from_str::<Head>(text).ok());
    let head = head.ok_or_else(|| refused("no fits of an earlier ladder to go on with: its first line is damaged".into()))?;
    // Behind the last line end there is nothing, or a line that was cut short.
    let parts: Vec<&[u8]> = parts.collect();
    let ended = parts.len().saturating_sub(1);
    let parsed = |part: &&[u8]| whole(part).and_then(|text| serde_json::from_str::<Line>(text).ok());
    let lines: Vec<Line> = parts[..ended].iter().filter_map(parsed).collect();
    Ok(Read { head, damaged: ended - lines.len(), lines })
}

/// The journal of a ladder of `case` in the folder of its run, which begins with the fits of the ladder in `from` where that is gone on with.
///
/// # Errors
/// No journal in `from`, one of another study, seed or version, a file that cannot be written.
pub(super) fn open(folder: &RunFolder, case: &Case, from: Option<&Path>, say: &(dyn Fn(&str) + Sync)) -> Result<Journal, Failure> {
    let head = Head::of(case);
    let mut known = vec![];
    if let Some(run) = from {
        let old = read(run)?;
        if let Some(unlike) = old.head.unlike(&head) {
            let accepted = "the folder of a ladder of the same study, seed and version, or `ladder` without --resume";
            return Err(Failure::new("study", run.display().to_string(), unlike, accepted));
        }
        if old.head.began != head.began {
            say("the study or its data are not as they were when the earlier ladder began: what that changes is fitted anew");
        }
        if old.damaged > 0 {
            say(&format!("{} lines of the journal are damaged: their fits are made again", old.damaged));
        }
        say(&format!("going on with {} fits of the earlier ladder", old.lines.len()));
        known = old.lines;
    }
    // A file that somebody has put together may say anything; a ladder takes no year.
    let spent = known.iter().map(|l| l.at).filter(|at| (0.0..3e7).contains(at)).fold(0.0, f64::max);
    let mut text = line(&head).unwrap_or_default();
    text.extend(known.iter().filter_map(line));
    let path = folder.begin_journal(text.as_bytes())?;
    let fail = |e: std::io::Error| Failure::new("study", path.display().to_string(), e.to_string(), "a file that can be written");
    let file = OpenOptions::new().append(true).open(&path).map_err(fail)?;
    let (open, began) = (Mutex::new((Some(file), text.len())), Instant::now());
    let keep = move |fit: &Kept| {
        let Ok(mut open) = open.lock() else { return };
        let Some(text) = line(&Line { at: spent + began.elapsed().as_secs_f64(), fit: fit.clone() }) else { return };
        let (file, length) = &mut *open;
        *length += text.len();
        // A disk that is full stops no ladder: its journal ends there.
        let written = file.as_mut().is_some_and(|file| *length <= MOST && file.write_all(text.as_bytes()).is_ok());
        if !written {
            *file = None;
        }
    };
    Ok(Journal::new(known.into_iter().map(|l| l.fit).collect(), Duration::from_secs_f64(spent), keep))
}
