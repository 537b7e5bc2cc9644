//! Long work: one thread a job, its progress for everybody who listens, stopped by a flag.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::sync::broadcast;

use crate::identify::Monitor;
use crate::model::{FreeParam, System};
use crate::work::Failure;

/// Lines of progress that are kept of a job.
const LINES: usize = 400;
/// Least time between two states of a fit that are told: curves cannot be drawn more often.
const BETWEEN: Duration = Duration::from_millis(150);

/// Where events go: every page that listens has its own queue.
pub type Events = broadcast::Sender<Arc<str>>;

/// A job.
pub struct Job {
    /// Number within the process.
    pub id: u64,
    /// Verb.
    pub verb: String,
    /// Model it began from.
    pub model: String,
    /// Command line that does the same.
    pub command: String,
    cancel: Arc<AtomicBool>,
    started: Instant,
    events: Events,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    lines: Vec<String>,
    cost: Vec<f64>,
    ended: Option<Value>,
    told: Option<Instant>,
    trial: Option<System>,
    /// Name of the folder of its run.
    run: Option<String>,
}

impl Job {
    /// A job that begins now.
    pub fn new(id: u64, verb: &str, model: &str, command: String, events: Events) -> Job {
        let (verb, model) = (verb.to_string(), model.to_string());
        Job { id, verb, model, command, cancel: Arc::default(), started: Instant::now(), events, state: Mutex::default() }
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        // The state is a list of what was said: it is whole also where a thread died beside it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, mut event: Value) {
        event["job"] = self.id.into();
        // Nobody may be listening.
        let _ = self.events.send(event.to_string().into());
    }

    /// A step of the work, in words.
    pub fn say(&self, line: &str) {
        let line = format!("{:.1} s: {}", self.started.elapsed().as_secs_f64(), line.trim());
        self.tell(json!({ "type": "line", "line": line }));
        let mut state = self.state();
        if state.lines.len() < LINES {
            state.lines.push(line);
        }
    }

    /// The folder it writes into.
    pub fn writes(&self, folder: &Path) {
        self.state().run = folder.file_name().map(|n| n.to_string_lossy().into_owned());
    }

    /// Name of that folder.
    pub fn run(&self) -> Option<String> {
        self.state().run.clone()
    }

    /// Stops it with the best state.
    pub fn stop(&self) {
        self.cancel.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked to stop.
    pub fn stopped(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }

    /// Watches a fit of `system`: stops it, tells its cost, keeps where it stands.
    pub fn monitor<'a>(&'a self, system: System) -> Monitor<'a> {
        let free = system.free();
        let cost = |p: &crate::identify::Progress| {
            let mut state = self.state();
            if state.cost.len() >= 4 * LINES {
                state.cost.drain(..2 * LINES);
            }
            state.cost.push(p.cost);
            drop(state);
            self.tell(json!({ "type": "cost", "iteration": p.iteration, "cost": p.cost }));
        };
        let point = move |p: &[f64]| self.at(&system, &free, p);
        Monitor::default().cancel(self.cancel.clone()).on_iteration(cost).on_point(point)
    }

    fn at(&self, system: &System, free: &[FreeParam], p: &[f64]) {
        let mut state = self.state();
        if p.len() != free.len() || state.told.is_some_and(|t| t.elapsed() < BETWEEN) {
            return;
        }
        (state.told, state.trial) = (Some(Instant::now()), Some(system.at_variables(free, p)));
        drop(state);
        self.tell(json!({ "type": "point" }));
    }

    /// The model as its fit stood last.
    pub fn trial(&self) -> Option<System> {
        self.state().trial.clone()
    }

    /// Its end.
    pub fn end(&self, result: Result<Value, Failure>) {
        let mut ended = match result {
            Ok(value) => json!({ "status": if self.stopped() { "stopped" } else { "done" }, "result": value }),
            Err(failure) => json!({ "status": "failed", "error": failure.json()["error"] }),
        };
        ended["seconds"] = self.started.elapsed().as_secs_f64().into();
        let mut state = self.state();
        (state.ended, state.trial) = (Some(ended.clone()), None);
        drop(state);
        self.tell(json!({ "type": "end", "ended": ended }));
    }

    /// Whether it is over.
    pub fn over(&self) -> bool {
        self.state().ended.is_some()
    }

    /// All that is known of it.
    pub fn json(&self) -> Value {
        let state = self.state();
        json!({
            "id": self.id, "verb": self.verb, "model": self.model, "command": self.command,
            "lines": state.lines, "cost": state.cost, "ended": state.ended,
        })
    }
}
