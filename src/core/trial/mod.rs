//! Known-truth recovery: random models and tests with hidden effects, and how often the search finds them.
//!
//! The truth comes from laws, integrators and a frequency-domain solution of this module's own (`law`, `connector`, `chain`); what
//! the search gets is a study folder, read as any other. Every case follows from seed and index alone.

mod bench;
mod chain;
mod connector;
mod curve;
mod draw;
mod error;
mod generate;
mod judge;
mod kept;
mod law;
mod life;
mod lived;
mod write;

#[cfg(test)]
mod tests;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde::{Deserialize, Serialize};

use crate::diagnose::results::{LadderResult, NextTest};
use crate::diagnose::{self, Case};
use crate::identify::Monitor;
use crate::study::Study;

use bench::{Drive, Planted, Test};
use generate::{Generated, generate};

pub use curve::{Bin, NullRow, OfStructure, Realistic, Share};
pub use error::TrialError;
pub use generate::NONCENTRALITY;
pub use judge::{CaseResult, Confusion, Counts, Followed, Table, table};
pub use kept::Kept;
pub use life::{Imperfection, SETTINGS, Settings};
pub use lived::Lived;

/// What is hidden in a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, schemars::JsonSchema, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// One effect of the library.
    One,
    /// Two.
    Two,
    /// Nothing.
    None,
    /// A law the library does not have.
    Outside,
    /// An error of an instrument beyond its tolerance.
    Instrument,
}

impl Kind {
    /// Every kind by its word.
    pub const WORDS: [(&'static str, Kind); 5] =
        [("one", Kind::One), ("two", Kind::Two), ("none", Kind::None), ("outside", Kind::Outside), ("instrument", Kind::Instrument)];

    /// Its word.
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|w| w.1 == self).map_or("", |w| w.0)
    }
}

/// What is tested.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, schemars::JsonSchema, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Structure {
    /// One massless connector, loops under displacement control.
    Connector,
    /// The same under loops at one frequency: what goes with the rate ties with what does not, and a next test is asked for.
    Sparse,
    /// Chains of 3 to 8 bodies, one in ten of 22; loops under force control, frequency responses, both.
    Chain,
    /// Seven connectors to three chains.
    #[default]
    Both,
}

/// What the data of a case are like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, schemars::JsonSchema, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Data {
    /// The base right but for what is hidden, white noise.
    #[default]
    Clean,
    /// As life is: [`Imperfection`].
    Realistic,
}

/// What is drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, schemars::JsonSchema, Deserialize)]
pub struct Options {
    /// Seed of all draws.
    pub seed: u64,
    /// Kinds in turn; empty: of ten cases five with one effect, one with two, two with none, one outside, one instrument.
    pub kinds: Vec<Kind>,
    /// What is tested.
    pub structure: Structure,
    /// What the data are like.
    #[serde(default)]
    pub data: Data,
    /// Of realistic data, the imperfections that each case has alone, in turn; empty: all at once.
    #[serde(default)]
    pub only: Vec<Imperfection>,
}

impl Options {
    /// Kind of case `index`.
    pub fn kind(&self, index: usize) -> Kind {
        use Kind::*;
        const MIX: [Kind; 10] = [One, None, One, Two, One, Outside, One, Instrument, One, None];
        let list: &[Kind] = if self.kinds.is_empty() { &MIX } else { &self.kinds };
        list[index % list.len()]
    }

    /// The imperfection that case `index` has alone; none: all.
    pub fn only(&self, index: usize) -> Option<Imperfection> {
        let turn = index / self.kinds.len().max(1);
        (!self.only.is_empty()).then(|| self.only[turn % self.only.len()])
    }
}

impl Generated {
    /// Name of the place of a hidden effect.
    fn place(&self, p: &Planted) -> String {
        match (self.bench.bodies, p.place) {
            (0, _) => "c1.x".into(),
            (_, 0) => "base.x".into(),
            (_, j) => format!("c{j}.x"),
        }
    }

    /// Whether its laws have a response about this mean.
    fn runs_about(&self, mean: f64) -> bool {
        mean == 0.0 || self.planted.iter().all(Planted::has_mean)
    }

    /// Stated over true standard deviation of the noise of test `at`; none where it is not stated, as in clean cases.
    fn stated(&self, at: usize) -> Option<f64> {
        self.life.as_ref()?.tests.get(at)?.stated
    }

    /// Adds a proposed test to those that are fitted, and has the search look among these effects alone; not what the bench cannot run.
    fn add(&mut self, next: &NextTest, among: &[String]) -> bool {
        let Some(base) = self.tests.iter().find(|t| t.id == next.test).cloned() else { return false };
        let Drive::Loop { discard, bodies, .. } = base.drive.clone() else { return false };
        if next.kind != "cycle" || !next.conditions.is_empty() || !self.runs_about(next.mean) {
            return false;
        }
        let drive = Drive::Loop { frequency: next.frequency, amplitude: next.amplitude, mean: next.mean, discard, bodies };
        self.tests.push(Test { id: "next".into(), drive, split: "fit", ..base });
        // It is run as the test that it varies was.
        let before = self.tests.iter().position(|t| t.id == next.test);
        if let (Some(life), Some(at)) = (&mut self.life, before) {
            life.tests.extend(life.tests.get(at).cloned());
        }
        let effects: Vec<String> = among.iter().map(|n| format!("\"{}\"", n.split(" at ").next().unwrap_or(n))).collect();
        self.search = Some(format!("search = {{ effects = [{}] }}\n", effects.join(", ")));
        true
    }

    fn title(&self, options: &Options, index: usize) -> String {
        let what = if self.bench.bodies == 0 { "one connector".into() } else { format!("chain of {} bodies", self.bench.bodies) };
        format!("Trial {index} of seed {}: {what}", options.seed)
    }
}

/// Writes case `index` as a study into `folder`, with its truth beside it; with the next test where one was followed.
pub fn write_case(options: &Options, index: usize, followed: Option<&Followed>, folder: &Path) -> Result<(), TrialError> {
    let mut made = generate(options, index);
    if let Some(next) = followed {
        made.add(&next.test, &next.among);
    }
    let title = made.title(options, index);
    write::write(&mut made, &title, folder)
}

/// Makes case `index`, climbs its ladder and judges what it says. `None`: it was interrupted.
pub fn run_case(options: &Options, index: usize, monitor: &Monitor) -> Result<Option<CaseResult>, TrialError> {
    let started = std::time::Instant::now();
    let mut made = generate(options, index);
    let title = made.title(options, index);
    let folder = tempfile::tempdir().map_err(|e| TrialError::Write { path: std::env::temp_dir(), reason: e.to_string() })?;
    write::write(&mut made, &title, folder.path())?;
    let study = Study::load(folder.path(), None)?;
    let climbed = Case::from_study(&study, options.seed.wrapping_add(index as u64))
        .and_then(|case| diagnose::ladder(&case, &monitor.quiet(), &|_| {}))
        .map(|(ladder, _)| ladder);
    if climbed.as_ref().is_ok_and(|l| l.interrupted) {
        return Ok(None);
    }
    let mut result = judge::judge(options.kind(index), index, &made, climbed.as_ref(), started.elapsed().as_secs_f64());
    if let Ok(ladder) = &climbed {
        if made.life.is_some() {
            result.lived = Some(Lived::judge(&made, options.only(index), &result.truth, ladder));
        }
        result.next_test = next_test(options, index, ladder, &result, monitor)?;
    }
    Ok(Some(result))
}

/// Runs the proposed next test on the bench where one hidden effect was found in a tie, and climbs again among what was tied. `None`:
/// there is no tie or no cycle that the bench can run.
fn next_test(
    options: &Options,
    index: usize,
    ladder: &LadderResult,
    result: &CaseResult,
    monitor: &Monitor,
) -> Result<Option<Followed>, TrialError> {
    let (Kind::One, true, Some(next), Some(first), [truth]) =
        (options.kind(index), result.with_ties, &ladder.next_test, ladder.missing.first(), result.truth.as_slice())
    else {
        return Ok(None);
    };
    let mut among = first.tied_with.clone();
    among.push(format!("{} at {}", first.effect, first.at));
    let mut made = generate(options, index);
    if !among.contains(truth) || !made.add(next, &among) {
        return Ok(None);
    }
    let folder = tempfile::tempdir().map_err(|e| TrialError::Write { path: std::env::temp_dir(), reason: e.to_string() })?;
    let title = made.title(options, index);
    write::write(&mut made, &title, folder.path())?;
    // A test that shakes the structure harder than the bench's integrator bears is none that the bench can run.
    let Ok(study) = Study::load(folder.path(), None) else { return Ok(None) };
    let again = Case::from_study(&study, options.seed).and_then(|case| diagnose::ladder(&case, &monitor.quiet(), &|_| {}));
    Ok(again.ok().filter(|(l, _)| !l.interrupted).map(|(l, _)| judge::followed(next, among, &l, truth)))
}

/// Runs the `cases` that are not in `done`, as many at a time as there are threads, and hands each to `each` as it ends. Stops with what there is when the
/// monitor says so.
pub fn run(
    options: &Options,
    cases: &[usize],
    done: &[CaseResult],
    monitor: &Monitor,
    each: &(dyn Fn(&CaseResult) -> Result<(), TrialError> + Sync),
) -> Result<Vec<CaseResult>, TrialError> {
    let left: Vec<usize> = cases.iter().copied().filter(|i| !done.iter().any(|d| d.index == *i)).collect();
    let (quiet, next) = (monitor.quiet(), AtomicUsize::new(0));
    // Each worker has a pool of one thread: in a shared pool, a thread that waits inside one case would begin another on top of it.
    let work = || -> Result<Vec<CaseResult>, TrialError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| TrialError::Threads { reason: e.to_string() })?;
        let mut own = Vec::new();
        while let Some(index) = left.get(next.fetch_add(1, Ordering::Relaxed)).filter(|_| !quiet.stops()) {
            let result = pool.install(|| run_case(options, *index, &quiet));
            match result.and_then(|r| r.as_ref().map_or(Ok(()), each).map(|()| r)) {
                Ok(result) => own.extend(result),
                Err(e) => {
                    next.store(left.len(), Ordering::Relaxed);
                    return Err(e);
                }
            }
        }
        Ok(own)
    };
    let workers = rayon::current_num_threads().min(left.len());
    let fresh = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let joined = threads.into_iter().map(|t| t.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        joined.collect::<Result<Vec<_>, TrialError>>()
    })?;
    let mut all: Vec<CaseResult> = done.iter().filter(|d| cases.contains(&d.index)).cloned().chain(fresh.into_iter().flatten()).collect();
    all.sort_by_key(|r| r.index);
    Ok(all)
}
