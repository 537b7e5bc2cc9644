//! From a study to a case that can be fitted, and the folder that keeps a run.
//!
//! Every file of a run is written whole or not at all: a temporary file beside it takes its name when it is complete.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use crate::parallel;
use polars::prelude::{Column, DataFrame};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::data::{FrfDoubt, OUT_OF_FAMILY, frf_doubts, out_of_family, written};
use crate::diagnose::results::{Finding, SplitName, TestResult};
use crate::diagnose::{Case, DiagnoseError, Search};
use crate::effect::formula::Motion;
use crate::explain::Explain;
use crate::identify::Tolerances;
use crate::model::{Instance, Site, System};
use crate::response::{self, BlockKind, Plan};

use super::{LeaveOut, Study, StudyError, formula};

/// What the dataset's instruments may err by.
fn tolerances(stated: &crate::data::Instruments) -> response::Tolerances {
    let good = response::Tolerances::GOOD;
    response::Tolerances {
        gain: stated.gain.unwrap_or(good.gain),
        calibration: stated.gain.unwrap_or(good.calibration),
        offset: stated.offset.unwrap_or(good.offset),
        linearity: stated.linearity.unwrap_or(good.linearity),
        delay_time: stated.delay,
        ..good
    }
}

impl Case {
    /// Plans every test of the study and takes over its split, orders, loss, settings of fit and search.
    pub fn from_study(study: &Study, seed: u64) -> Result<Case, DiagnoseError> {
        let plan = |test: &crate::data::Test| -> Result<(Plan, SplitName), DiagnoseError> {
            let mut plan = Plan::new(test, &study.system.model)?;
            for left in study.leave_out.iter().filter(|l| l.test == test.id) {
                plan.leave_out(left.quantity, f64::from(left.mode), &left.why);
            }
            for shift in study.shifts.iter().filter(|s| s.test == test.id) {
                let Some(other) = study.dataset.test(&shift.against) else { continue };
                // What the other test has left out says nothing of a shift.
                let out = |mode: f64| {
                    let of = |l: &LeaveOut| l.test == shift.against && l.quantity == "natural_frequency" && f64::from(l.mode) == mode;
                    study.leave_out.iter().any(of)
                };
                plan = plan.shifted_against(&Plan::new(other, &study.system.model)?, shift.sigma, |mode| !out(mode));
            }
            plan.tolerances = tolerances(&study.dataset.instruments);
            if let Some(points) = study.fit.points {
                plan = plan.thinned(points);
            }
            if let Some(part) = study.fit.frf_tolerance {
                plan = plan.tolerant(part);
            }
            Ok((plan, split_of(study, &test.id)))
        };
        let plans = parallel::map(&study.dataset.tests, plan).into_iter().collect::<Result<Vec<_>, _>>()?;
        let motions = |instance: &Instance| plans.iter().flat_map(|(p, _)| motions(p, &study.system, instance)).collect();
        formula::examine(&study.system, motions).map_err(|(i, e)| formula::located(&study.system.instances[i], &e))?;
        Ok(Case {
            refused: frf_doubts(&study.dataset.tests).into_iter().filter(|d| d.refused).collect(),
            of_data: of_data(study),
            orders: study.orders.iter().map(|o| (o.below.clone(), o.above.clone(), o.gap)).collect(),
            loss: study.fit.loss,
            max_iterations: study.fit.max_iterations.map_or(Tolerances::default().max_iterations, |n| n as u64),
            starts: study.fit.starts,
            search: Search {
                effects: study.search.effects.clone(),
                places: study.search.places.clone(),
                settings: study.search.constants.clone(),
                slack: study.search.slack,
                mass_slack: study.graph.mass_slack(),
                rig: study.dataset.rig,
            },
            ..Case::new(study.title.clone(), study.system.clone(), plans, seed)
        })
    }
}

/// What the tables of the dataset say of each other.
fn of_data(study: &Study) -> Vec<Finding> {
    let finding = |odd: crate::data::OutOfFamily| Finding {
        claim: odd.claim(),
        number: odd.number(),
        threshold: OUT_OF_FAMILY,
        power: Normal::standard().cdf(0.1 / odd.sigma - OUT_OF_FAMILY),
        test: odd.test,
    };
    let of_frf =
        |doubt: FrfDoubt| Finding { test: doubt.test, claim: doubt.claim, number: doubt.number, threshold: doubt.threshold, power: 1.0 };
    let tables = out_of_family(&study.dataset.tests).into_iter().map(finding);
    tables.chain(frf_doubts(&study.dataset.tests).into_iter().map(of_frf)).collect()
}

/// The motion a test shows at the places of an instance; that of its drive where the model cannot be computed yet.
fn motions(plan: &Plan, system: &System, instance: &Instance) -> Vec<Motion> {
    let Site::Places(places) = &instance.site else { return vec![] };
    if let Ok(Some(all)) = plan.amplitudes(system) {
        return places.iter().filter_map(|p| all.get(*p)).map(|a| Motion { x: a.x, v: a.v }).collect();
    }
    let half = |u: &[f64]| {
        let (low, high) = u.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        0.5 * (high - low)
    };
    plan.blocks.iter().filter(|b| !b.x.is_empty() && !b.v.is_empty()).map(|b| Motion { x: half(&b.x), v: half(&b.v) }).collect()
}

/// The split a test serves in.
pub fn split_of(study: &Study, test: &str) -> SplitName {
    match study.split.word(test) {
        "select" => SplitName::Select,
        "held_out" => SplitName::HeldOut,
        _ => SplitName::Fit,
    }
}

/// What can go wrong with a run folder.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A file or folder that cannot be written.
    #[error("{} cannot be written: {reason}", .path.display())]
    Write {
        /// File or folder.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// `--out` names a folder with a study that is no run.
    #[error("{} holds a study that is no run, and a run would write over it", .path.display())]
    Occupied {
        /// Folder.
        path: PathBuf,
    },
    /// The resolved study.
    #[error(transparent)]
    Study(#[from] StudyError),
}

impl Explain for RunError {
    fn stage(&self) -> &'static str {
        "study"
    }
    fn place(&self) -> String {
        match self {
            RunError::Write { path, .. } | RunError::Occupied { path } => path.display().to_string(),
            RunError::Study(e) => e.place(),
        }
    }
    fn accepted(&self) -> String {
        match self {
            RunError::Write { .. } => "a folder that can be written; --out DIR names another".into(),
            RunError::Occupied { .. } => "--out with a new folder, or with the folder of an earlier run".into(),
            RunError::Study(e) => e.accepted(),
        }
    }
}

/// The folder of one run.
#[derive(Debug, Clone)]
pub struct RunFolder {
    /// Where it is.
    pub path: PathBuf,
    origin: Origin,
}

/// What a run was made from, as its result says it.
#[derive(Debug, Clone, Default)]
struct Origin {
    /// File of the study, where that is not `study.toml`: several studies of one folder share `runs/`.
    file: Option<String>,
    /// The run whose model it began from.
    run: Option<String>,
}

fn name(path: &Path) -> Option<String> {
    path.file_name().map(|n| n.to_string_lossy().into_owned())
}

/// The run that a folder is, and the folder of `runs/` as the reader wrote it, where that names it.
fn as_run(folder: &Path) -> Option<(String, PathBuf)> {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    let run = name(&whole).filter(|n| is_run(n))?;
    let runs = whole.parent().filter(|runs| name(runs).is_some_and(|n| n == RUNS))?;
    let written = folder.parent().filter(|p| p.canonicalize().is_ok_and(|p| p == runs));
    Some((run, written.unwrap_or(runs).to_path_buf()))
}

/// Where the runs on a study of this folder stand: in its `runs/`, and those on a run beside it.
pub fn runs_of(folder: &Path) -> PathBuf {
    as_run(folder).map_or_else(|| folder.join(RUNS), |(_, runs)| runs)
}

impl Origin {
    fn of(study: &Study) -> Origin {
        let Some((run, _)) = as_run(&study.folder) else {
            return Origin { file: name(&study.file).filter(|n| n != "study.toml"), run: None };
        };
        let bytes = crate::limits::bytes(&study.folder.join(RESULT), crate::limits::DATA_BYTES).ok();
        let result: Option<serde_json::Value> = bytes.and_then(|b| serde_json::from_slice(&b).ok());
        Origin { file: result.and_then(|r| Some(r.get(STUDY_FILE)?.as_str()?.to_string())), run: Some(run) }
    }
}

/// `20261124-112100-ladder`, `20261124-112100-add-2`.
pub fn is_run(name: &str) -> bool {
    let b = name.as_bytes();
    let digits = |r: std::ops::Range<usize>| b.get(r).is_some_and(|s| s.iter().all(u8::is_ascii_digit));
    b.len() > 16
        && b.len() < 80
        && digits(0..8)
        && b[8] == b'-'
        && digits(9..15)
        && b[15] == b'-'
        && b[16..].iter().all(|c| c.is_ascii_alphanumeric() || *c == b'-')
}

/// Folder of the runs, in that of their study.
const RUNS: &str = "runs";
/// Key of a result: the file of its study, where that is not `study.toml`.
pub const STUDY_FILE: &str = "study_file";
/// Key of a result: the run whose model it began from.
pub const FROM_RUN: &str = "from_run";

const RESULT: &str = "result.json";

impl RunFolder {
    /// A folder that is there.
    pub fn at(path: impl Into<PathBuf>) -> RunFolder {
        RunFolder { path: path.into(), origin: Origin::default() }
    }

    /// Makes `runs/<time>-<verb>` in the study's folder, or exactly `out`. A run on the model of a run stands beside that.
    pub fn create(study: &Study, verb: &str, out: Option<&Path>) -> Result<RunFolder, RunError> {
        let origin = Origin::of(study);
        let fail = |path: &Path, e: std::io::Error| RunError::Write { path: path.to_path_buf(), reason: e.to_string() };
        if let Some(out) = out {
            let known = [RESULT, CHECKPOINT, JOURNAL].iter().any(|f| out.join(f).exists());
            if out.join("study.toml").exists() && !known {
                return Err(RunError::Occupied { path: out.to_path_buf() });
            }
            std::fs::create_dir_all(out).map_err(|e| fail(out, e))?;
            return Ok(RunFolder { path: out.to_path_buf(), origin });
        }
        let runs = runs_of(&study.folder);
        std::fs::create_dir_all(&runs).map_err(|e| fail(&runs, e))?;
        let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
        let name = format!("{}-{verb}", utc(now));
        // Two runs within one second get different folders.
        for k in 1..1000 {
            let path = runs.join(if k == 1 { name.clone() } else { format!("{name}-{k}") });
            match std::fs::create_dir(&path) {
                Ok(()) => return Ok(RunFolder { path, origin }),
                Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(fail(&path, e)),
            }
        }
        Err(RunError::Write { path: runs.join(name), reason: "a thousand runs bear this time".into() })
    }

    /// The file of the best state of a fit.
    pub fn checkpoint(&self) -> PathBuf {
        self.path.join(CHECKPOINT)
    }

    /// Writes one file.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
        let path = self.path.join(name);
        let fail = |reason: String| RunError::Write { path: path.clone(), reason };
        crate::limits::replace(&path, bytes).map_err(|e| fail(e.to_string()))?;
        Ok(path)
    }

    /// `result.json`, with what the run was made from.
    pub fn result(&self, json: &serde_json::Value) -> Result<PathBuf, RunError> {
        let mut json = json.clone();
        for (key, from) in [(STUDY_FILE, &self.origin.file), (FROM_RUN, &self.origin.run)] {
            if let (Some(from), Some(map)) = (from, json.as_object_mut()) {
                map.insert(key.into(), from.as_str().into());
            }
        }
        let path = self.write(RESULT, format!("{json:#}\n").as_bytes())?;
        // A ladder that has come to its end is not gone on with; where its journal cannot be removed nobody looks for it any more.
        if json.get("interrupted").and_then(serde_json::Value::as_bool) != Some(true) {
            self.forget();
        }
        Ok(path)
    }

    /// `study.toml`: the study with the values and effects of `system`.
    pub fn study(&self, study: &Study, system: &System) -> Result<PathBuf, RunError> {
        Ok(study.save(system, &self.path)?)
    }

    /// The file of the fits that a ladder has made, until it comes to its end.
    pub fn journal(&self) -> PathBuf {
        self.path.join(JOURNAL)
    }

    /// Begins that file with these bytes.
    pub fn begin_journal(&self, bytes: &[u8]) -> Result<PathBuf, RunError> {
        self.write(JOURNAL, bytes)
    }

    /// Removes that file.
    pub fn forget(&self) {
        let _ = std::fs::remove_file(self.journal());
    }

    /// `residuals.parquet`: every measured value with its computed one.
    pub fn residuals(&self, tests: &[TestResult]) -> Result<PathBuf, RunError> {
        let path = self.path.join("residuals.parquet");
        let fail = |e: polars::error::PolarsError| RunError::Write { path: path.clone(), reason: e.to_string() };
        self.write("residuals.parquet", &residuals(tests).and_then(written::parquet).map_err(fail)?)
    }

    /// Removes the folder where a run came to nothing; what somebody else put there stays.
    pub fn discard(&self) {
        // An error here means the folder holds something, which is the reason to keep it.
        let _ = std::fs::remove_dir(&self.path);
    }
}

const CHECKPOINT: &str = "checkpoint.json";
const JOURNAL: &str = "fits.journal";

/// Every measured value with its computed one, as a table.
///
/// Columns test, channel, abscissa, part, measured, computed, sigma, whitened = (computed - measured) / sigma (tables: of the logarithms); SI.
pub fn residuals(tests: &[TestResult]) -> polars::error::PolarsResult<DataFrame> {
    let (mut test, mut channel, mut part) = (vec![], vec![], vec![]);
    let (mut abscissa, mut measured, mut computed, mut sigma, mut whitened) = (vec![], vec![], vec![], vec![], vec![]);
    for t in tests {
        for c in &t.curves {
            let frf = c.kind == BlockKind::Frf;
            for (i, ((m, y), s)) in c.measured.iter().zip(&c.computed).zip(&c.sigma).enumerate() {
                test.push(t.id.as_str());
                channel.push(c.label.as_str());
                part.push(if !frf {
                    "value"
                } else if i % 2 == 0 {
                    "real"
                } else {
                    "imag"
                });
                abscissa.push(c.abscissa.get(if frf { i / 2 } else { i }).copied());
                measured.push(*m);
                computed.push(*y);
                sigma.push(*s);
                // A table is compared by logarithms; its sigma stands in the unit of the value.
                whitened.push(if c.kind == BlockKind::Table { (y / m).ln() * m / s } else { (y - m) / s });
            }
        }
    }
    let rows = test.len();
    DataFrame::new(
        rows,
        vec![
            Column::new("test".into(), test),
            Column::new("channel".into(), channel),
            Column::new("abscissa".into(), abscissa),
            Column::new("part".into(), part),
            Column::new("measured".into(), measured),
            Column::new("computed".into(), computed),
            Column::new("sigma".into(), sigma),
            Column::new("whitened".into(), whitened),
        ],
    )
}

/// `20261121-114203` of seconds since 1970, UTC (days to civil date: Hinnant, chrono-Compatible Low-Level Date Algorithms).
fn utc(seconds: u64) -> String {
    let (days, s) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let (day, month) = (day_of_year - (153 * shifted + 2) / 5 + 1, if shifted < 10 { shifted + 3 } else { shifted - 9 });
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    format!("{year:04}{month:02}{day:02}-{:02}{:02}{:02}", s / 3600, s / 60 % 60, s % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_runs_are_runs() {
        assert!(is_run("20261124-112100-ladder") && is_run("20261124-112100-add-2"));
        for other in ["", "..", "20261124-112100-", "20261124-112100-a/b", "20261124-112100-..", "notes", "20261124_112100-fit"] {
            assert!(!is_run(other), "{other}");
        }
    }

    #[test]
    fn time_of_a_run() {
        assert_eq!(utc(0), "19700101-000000");
        assert_eq!(utc(951_827_696), "20000229-123456");
        assert_eq!(utc(1_795_261_323), "20261121-114203");
    }
}
