//! Verbs: the words of the command line in, JSON, text, curves and tables out.

use std::ffi::OsString;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use misfit::cli::{self, Watcher};
use misfit::diagnose::results::TestResult;
use misfit::identify::Progress;
use misfit::study::run::residuals;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::curve::Curve;
use crate::error::{raise, refuse};
use crate::table::Table;
use crate::watch::{self, Event};

/// Between two iterations that are told.
const BETWEEN: Duration = Duration::from_millis(50);

/// What a verb gave.
#[pyclass(frozen, module = "misfit._native")]
pub struct Called {
    /// The object that `--json` prints.
    #[pyo3(get)]
    json: String,
    /// The text that the command line prints.
    #[pyo3(get)]
    text: String,
    /// Whether it was stopped and this is the best state.
    #[pyo3(get)]
    interrupted: bool,
    /// Every channel of every test against the result.
    #[pyo3(get)]
    curves: Vec<Py<Curve>>,
    /// The same as a table.
    #[pyo3(get)]
    residuals: Py<Table>,
}

/// Passes on what a verb says.
struct Passing {
    program: Vec<OsString>,
    flag: Arc<AtomicBool>,
    events: Mutex<Sender<Event>>,
    last: Mutex<Option<Instant>>,
    tests: Mutex<Vec<TestResult>>,
}

impl Passing {
    fn send(&self, event: Event) {
        // Where nobody listens any more there is nobody to tell.
        let _ = self.events.lock().unwrap_or_else(PoisonError::into_inner).send(event);
    }
}

impl Watcher for Passing {
    fn cancel(&self) -> Arc<AtomicBool> {
        self.flag.clone()
    }
    fn step(&self, words: &str) {
        self.send(Event { words: Some(words.into()), fit: None });
    }
    fn iteration(&self, p: &Progress) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_none_or(|t| t.elapsed() >= BETWEEN) {
            *last = Some(Instant::now());
            self.send(Event { words: None, fit: Some((p.iteration, p.cost)) });
        }
    }
    fn tests(&self, tests: &[TestResult]) {
        *self.tests.lock().unwrap_or_else(PoisonError::into_inner) = tests.to_vec();
    }
    fn program(&self) -> Option<Vec<OsString>> {
        Some(self.program.clone())
    }
}

/// Runs a verb: `words` as on the command line. `tell(words, (iteration, cost))` gets the progress.
///
/// The interpreter lock is released while it computes. Ctrl-C ends it with the best state; where there is none to keep, KeyboardInterrupt is raised.
#[pyfunction]
#[pyo3(signature = (words, tell=None))]
pub fn call(py: Python<'_>, words: Vec<String>, tell: Option<&Bound<'_, PyAny>>) -> PyResult<Called> {
    let flag = Arc::new(AtomicBool::new(false));
    let (events, heard) = channel();
    let tests = Arc::new(Mutex::new(vec![]));
    let kept = tests.clone();
    let own = flag.clone();
    let program = vec![py.import("sys")?.getattr("executable")?.extract()?, "-m".into(), "misfit".into()];
    let work = move || {
        let passing = Arc::new(Passing { program, flag: own, events: Mutex::new(events), last: Mutex::default(), tests: Mutex::default() });
        let done = cli::call(&words, passing.clone());
        *kept.lock().unwrap_or_else(PoisonError::into_inner) =
            std::mem::take(&mut *passing.tests.lock().unwrap_or_else(PoisonError::into_inner));
        done
    };
    let (done, ended) = watch::run(py, &flag, heard, tell, work)?;
    let stopped = match ended {
        // Of Ctrl-C the best state is the answer, where the verb has one.
        Some(e) if e.is_instance_of::<PyKeyboardInterrupt>(py) && done.is_ok() => true,
        Some(e) => return Err(e),
        None => flag.load(Ordering::Relaxed),
    };
    let done = done.map_err(|e| raise(py, &crate::law::explained(e)))?;
    let tests = std::mem::take(&mut *tests.lock().unwrap_or_else(PoisonError::into_inner));
    let frame = residuals(&tests).map_err(|e| refuse(py, "result", "residuals", e.to_string(), ""))?;
    let curves = tests.into_iter().flat_map(|t| t.curves.into_iter().map(move |c| (t.id.clone(), c)));
    Ok(Called {
        json: done.json.to_string(),
        text: done.text,
        interrupted: stopped || done.code == 130,
        curves: curves.map(|(test, c)| Py::new(py, Curve::new(py, test, c))).collect::<PyResult<_>>()?,
        residuals: Py::new(py, Table::new(frame))?,
    })
}

/// The program `misfit`: `words` as on the command line. Gives the exit code.
#[pyfunction]
pub fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| cli::main_of(std::iter::once("misfit".into()).chain(words)))
}

/// Panics where a verb would compute. The tests of the package hold what comes of it to `misfit.Error`.
#[pyfunction]
pub fn panic(py: Python<'_>, message: String) -> PyResult<()> {
    let (events, heard) = channel::<Event>();
    let work = move || {
        drop(events);
        std::panic::panic_any(message)
    };
    watch::run(py, &Arc::new(AtomicBool::new(false)), heard, None, work).map(|((), _)| ())
}
