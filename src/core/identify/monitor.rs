//! Watching, stopping and resuming a fit.

use super::{IdentifyError, Journal};
use crate::parallel::Watch;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What a callback sees after every accepted iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    pub iteration: u64,
    /// 1/2 ||r||^2
    pub cost: f64,
    /// damping
    pub lambda: f64,
    /// ||D d|| / ||D p||, the relative length of the last step
    pub step: f64,
}

/// Called after every accepted iteration, from the thread of the fit.
pub type Callback<'a> = Box<dyn Fn(&Progress) + Sync + 'a>;

/// Called with the variables of the fit after every accepted iteration, from its thread.
pub type PointCallback<'a> = Box<dyn Fn(&[f64]) + Sync + 'a>;

/// Keeps the best state in a file, written whole or not at all.
#[derive(Debug, Clone)]
pub struct CheckpointFile {
    pub path: PathBuf,
    /// continue from the file when it exists
    pub resume: bool,
    /// least time between two writings; the last state is always written
    pub every: Duration,
    /// the members of a multi-start share one file: the least cost written so far
    pub(crate) best: Option<Arc<Mutex<f64>>>,
}

impl CheckpointFile {
    /// Writes `state`, unless another member of the same multi-start has written a better one.
    pub(crate) fn keep(&self, state: &Checkpoint) -> Result<(), IdentifyError> {
        let Some(best) = &self.best else { return state.save(&self.path) };
        // The number is whole even where a thread died with the lock.
        let mut best = best.lock().unwrap_or_else(PoisonError::into_inner);
        if state.cost > *best {
            return Ok(());
        }
        state.save(&self.path)?;
        *best = state.cost;
        Ok(())
    }
}

/// Watches a fit from outside. All of it is optional; [`Monitor::default`] does nothing.
#[derive(Default)]
pub struct Monitor<'a> {
    /// set from anywhere (a signal handler, another thread) to stop with the best state
    pub cancel: Option<Arc<AtomicBool>>,
    /// stop with the best state at this moment
    pub deadline: Option<Instant>,
    pub on_iteration: Option<Callback<'a>>,
    /// called with the variables of the fit after every accepted iteration
    pub on_point: Option<PointCallback<'a>>,
    pub checkpoint: Option<CheckpointFile>,
    /// answers fits that an earlier run has made, and keeps those that end
    pub journal: Option<Arc<Journal>>,
}

impl<'a> Monitor<'a> {
    #[must_use]
    pub fn cancel(mut self, flag: Arc<AtomicBool>) -> Self {
        self.cancel = Some(flag);
        self
    }

    /// Stops `seconds` from now.
    #[must_use]
    pub fn max_seconds(mut self, seconds: f64) -> Self {
        // what no Duration can hold is as good as no limit
        self.deadline = Duration::try_from_secs_f64(seconds.max(0.0)).ok().and_then(|d| Instant::now().checked_add(d));
        self
    }

    #[must_use]
    pub fn on_iteration(mut self, callback: impl Fn(&Progress) + Sync + 'a) -> Self {
        self.on_iteration = Some(Box::new(callback));
        self
    }

    #[must_use]
    pub fn on_point(mut self, callback: impl Fn(&[f64]) + Sync + 'a) -> Self {
        self.on_point = Some(Box::new(callback));
        self
    }

    #[must_use]
    pub fn checkpoint(mut self, path: impl Into<PathBuf>, resume: bool) -> Self {
        self.checkpoint = Some(CheckpointFile { path: path.into(), resume, every: Duration::from_secs(1), best: None });
        self
    }

    #[must_use]
    pub fn journal(mut self, journal: Journal) -> Self {
        self.journal = Some(Arc::new(journal));
        self
    }

    /// The time that earlier runs have taken for what the journal holds.
    pub fn spent(&self) -> Duration {
        self.journal.as_ref().map_or(Duration::ZERO, |journal| journal.spent())
    }

    /// Same flag and deadline, no callback, the checkpoint shared: for the members of a multi-start. `best` is the least cost so far.
    pub(crate) fn member(&self, best: &Arc<Mutex<f64>>) -> Monitor<'static> {
        let shared = |file: &CheckpointFile| CheckpointFile { resume: false, best: Some(best.clone()), ..file.clone() };
        Monitor { checkpoint: self.checkpoint.as_ref().map(shared), ..self.quiet() }
    }

    /// Whether there is a checkpoint to go on from.
    pub fn resumes(&self) -> bool {
        self.checkpoint.as_ref().is_some_and(|file| file.resume && file.path.exists())
    }

    /// Same flag, deadline and journal, neither callback nor checkpoint.
    pub fn quiet(&self) -> Monitor<'static> {
        Monitor { cancel: self.cancel.clone(), deadline: self.deadline, journal: self.journal.clone(), ..Monitor::default() }
    }

    /// The same flag, and a deadline at this share of the time that is left; without a deadline there is none.
    pub fn hurried(&self, share: f64) -> Monitor<'static> {
        let now = Instant::now();
        let sooner = |deadline: Instant| now + deadline.saturating_duration_since(now).mul_f64(share);
        Monitor { deadline: self.deadline.map(sooner), ..self.quiet() }
    }

    /// Flag and deadline, for evaluations that may be given up.
    pub fn watch(&self) -> Watch {
        Watch { cancel: self.cancel.clone(), deadline: self.deadline }
    }

    /// The same for the first evaluation of a fit, which is the state that is kept where it is stopped at once: it is finished whatever the
    /// flag says, and has this much more time.
    pub(crate) fn first_watch(&self) -> Watch {
        const GRACE: Duration = Duration::from_secs(60);
        Watch { cancel: None, deadline: self.deadline.and_then(|d| d.checked_add(GRACE)) }
    }

    /// Whether it is time to stop.
    pub fn stops(&self) -> bool {
        self.stop().is_some()
    }

    /// Whether somebody has stopped it, and not the time.
    pub fn cancelled(&self) -> bool {
        self.cancel.as_ref().is_some_and(|f| f.load(Ordering::Relaxed))
    }

    /// Why to stop now, if at all.
    pub(crate) fn stop(&self) -> Option<&'static str> {
        if self.cancelled() {
            return Some("interrupted");
        }
        self.deadline.filter(|d| Instant::now() >= *d).map(|_| "the time allowed is used up")
    }
}

/// A flag that Ctrl-C (SIGINT) and SIGTERM set; hand it to [`Monitor::cancel`]. A second signal ends the program at once.
pub fn interrupt_flag() -> std::io::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // order matters: the shutdown looks at the flag before this signal sets it
        signal_hook::flag::register_conditional_shutdown(signal, 130, flag.clone())?;
        signal_hook::flag::register(signal, flag.clone())?;
    }
    Ok(flag)
}

/// The solver's state at the best point: what a resumed fit needs to go on as if nothing had happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    pub schema: u32,
    pub names: Vec<String>,
    pub n_residuals: usize,
    pub iteration: u64,
    pub cost: f64,
    pub p: Vec<f64>,
    pub lambda: f64,
    pub growth: f64,
    pub scale: Vec<f64>,
    /// drop of the cost in the last iteration, None before the first
    pub last_drop: Option<f64>,
}

impl Checkpoint {
    /// Writes beside the target and renames, so that a crash leaves the old file or the new one, never half of one.
    pub fn save(&self, path: &Path) -> Result<(), IdentifyError> {
        let failed = |reason: String| IdentifyError::Checkpoint { path: path.to_path_buf(), reason };
        let bytes = serde_json::to_vec_pretty(self).map_err(|e| failed(e.to_string()))?;
        crate::limits::replace(path, &bytes).map_err(|e| failed(e.to_string()))
    }

    /// Reads a checkpoint and checks that it belongs to this problem.
    pub fn load(path: &Path, names: &[String], n_residuals: usize) -> Result<Self, IdentifyError> {
        let failed = |reason: String| IdentifyError::Checkpoint { path: path.to_path_buf(), reason };
        let text = crate::limits::text(path).map_err(|e| failed(e.to_string()))?;
        let found: Self = serde_json::from_str(&text).map_err(|e| failed(e.to_string()))?;
        if found.schema != 1 {
            return Err(failed(format!("schema {} is unknown", found.schema)));
        }
        if found.names != names {
            return Err(failed(format!("it belongs to the parameters [{}], not [{}]", found.names.join(", "), names.join(", "))));
        }
        if found.n_residuals != n_residuals {
            return Err(failed(format!("it belongs to {} residuals, not {n_residuals}", found.n_residuals)));
        }
        let numbers = found.p.iter().chain(&found.scale).chain([&found.cost, &found.lambda, &found.growth]);
        if found.p.len() != names.len() || found.scale.len() != names.len() || numbers.into_iter().any(|v| !v.is_finite()) {
            return Err(failed("its numbers are incomplete".into()));
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_the_time_is_left_to_others() {
        let monitor = Monitor::default().max_seconds(100.0);
        let left = monitor.hurried(0.75).deadline.unwrap().duration_since(Instant::now()).as_secs_f64();
        assert!((74.0..=75.0).contains(&left), "{left}");
        assert!(Monitor::default().hurried(0.75).deadline.is_none());
        // What is over is over.
        assert!(Monitor::default().max_seconds(0.0).hurried(0.75).watch().ended());
    }

    #[test]
    fn a_signal_sets_the_flag_and_the_monitor_stops() {
        let flag = interrupt_flag().unwrap();
        let monitor = Monitor::default().cancel(flag.clone());
        assert!(monitor.stop().is_none());
        signal_hook::low_level::raise(signal_hook::consts::SIGINT).unwrap();
        assert!(flag.load(Ordering::Relaxed) && monitor.stop().is_some() && monitor.quiet().stop().is_some());
    }

    #[test]
    fn a_checkpoint_comes_back_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("best.json");
        let names = vec!["k".to_string()];
        let (p, scale) = (vec![1.0 / 3.0], vec![7.5]);
        let state = Checkpoint {
            schema: 1,
            names: names.clone(),
            n_residuals: 4,
            iteration: 3,
            cost: 0.5,
            p,
            lambda: 1e-3,
            growth: 2.0,
            scale,
            last_drop: None,
        };
        state.save(&path).unwrap();
        let back = Checkpoint::load(&path, &names, 4).unwrap();
        assert_eq!((back.iteration, back.scale.clone()), (3, vec![7.5]));
        approx::assert_relative_eq!(back.p[0], 1.0 / 3.0, max_relative = 1e-15);
        assert!(matches!(Checkpoint::load(&path, &names, 5), Err(IdentifyError::Checkpoint { .. })));
        assert!(matches!(Checkpoint::load(&folder.path().join("none.json"), &names, 4), Err(IdentifyError::Checkpoint { .. })));
        assert!(state.save(&folder.path().join("no/such/folder/best.json")).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing half-written is left behind");
    }
}
