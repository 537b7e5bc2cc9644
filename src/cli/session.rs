//! What every verb on a study shares: options, the study, time and interruption.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Args;

use crate::diagnose::Case;
use crate::diagnose::results::TestResult;
use crate::identify::Monitor;
use crate::parallel;
use crate::study::Study;
use crate::study::run::RunFolder;

use super::call::Watched;
use super::progress::Progress;
use crate::work::{self, Failure};

/// Options of every verb on a study.
#[derive(Args, Clone)]
pub(super) struct Common {
    /// Folder with study.toml, or that file
    pub study: PathBuf,
    /// One JSON object on stdout, everything else on stderr
    #[arg(long)]
    pub json: bool,
    /// Folder of the run, instead of runs/<time>-<verb> in the study
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Stop after this time with the best state
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub max_seconds: Option<f64>,
    /// Folder of the raw measurement files
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Start a parameter at this value instead of the study's, such as c1.x.viscous.c="120 N s/m"; may be given again
    #[arg(long, value_name = "NAME=VALUE", value_parser = pair)]
    pub start: Vec<(String, String)>,
    /// The program that called the verb, in place of a terminal.
    #[arg(skip)]
    pub watcher: Watched,
}

/// A time limit.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if s.is_finite() && s > 0.0 => Ok(s),
        _ => Err("a number of seconds above 0, such as 60".into()),
    }
}

/// `NAME=VALUE`; a name may hold an equals sign, `c1.x.viscous[A=2 mm].c`, a value none.
pub(super) fn pair(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.rsplit_once('=').ok_or("NAME=VALUE, such as v0=\"1 mm/s\"")?;
    Ok((name.trim().to_string(), value.trim().to_string()))
}

/// Threads of everything parallel.
pub(super) fn threads(n: Option<u16>) -> Result<(), Failure> {
    let Some(n) = n else { return Ok(()) };
    rayon::ThreadPoolBuilder::new().num_threads(n.into()).build_global().map_err(|e| no_threads(&e))
}

/// Threads of one call.
pub(super) fn pool(n: u16) -> Result<rayon::ThreadPool, Failure> {
    rayon::ThreadPoolBuilder::new().num_threads(n.into()).build().map_err(|e| no_threads(&e))
}

fn no_threads(e: &rayon::ThreadPoolBuildError) -> Failure {
    Failure::new("cli", "--threads", e.to_string(), "a number of threads the machine can start")
}

/// A verb at work.
pub(super) struct Session<'a> {
    pub common: &'a Common,
    pub progress: Progress,
    flag: Arc<AtomicBool>,
    deadline: Option<Instant>,
}

impl<'a> Session<'a> {
    /// Sets threads and the handler of Ctrl-C.
    pub fn begin(common: &'a Common) -> Result<Self, Failure> {
        threads(common.threads)?;
        let flag = common.watcher.cancel()?;
        // What no Duration can hold is as good as no limit.
        let limit = common.max_seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
        let deadline = limit.and_then(|d| Instant::now().checked_add(d));
        Ok(Session { common, progress: Progress::new(common.json, deadline, common.watcher.clone()), flag, deadline })
    }

    pub fn study(&self) -> Result<Study, Failure> {
        self.progress.say("reading the study and its measurements");
        let study = Study::load(&self.common.study, self.common.data.as_deref())?;
        let system = work::started(&study, &self.common.start)?;
        Ok(Study { system, ..study })
    }

    pub fn case(&self, study: &Study) -> Result<Case, Failure> {
        Ok(Case::from_study(study, self.common.seed)?)
    }

    pub fn folder(&self, study: &Study, verb: &str) -> Result<RunFolder, Failure> {
        Ok(RunFolder::create(study, verb, self.common.out.as_deref())?)
    }

    /// Stops on Ctrl-C and at `--max-seconds`, and shows the iterations.
    pub fn monitor(&self) -> Monitor<'_> {
        let mut monitor = Monitor::default().cancel(self.flag.clone()).on_iteration(|p| self.progress.iteration(p));
        monitor.deadline = self.deadline;
        monitor
    }

    /// `work` that gives up at Ctrl-C and at `--max-seconds`, within an evaluation of the model too.
    pub fn watched<T>(&self, work: impl FnOnce() -> T) -> T {
        parallel::watched(&self.monitor().watch(), work)
    }

    /// Shows the curves of the result to the program that called.
    pub fn show(&self, tests: &[TestResult]) {
        if let Some(w) = &self.common.watcher.0 {
            w.tests(tests);
        }
    }

    /// Whether a signal came or the time is used up.
    pub fn interrupted(&self) -> bool {
        self.flag.load(Ordering::Relaxed) || self.deadline.is_some_and(|d| Instant::now() >= d)
    }
}
