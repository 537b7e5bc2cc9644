//! Work on a thread of its own, without the interpreter lock, while the calling thread serves Python: progress, Ctrl-C, errors of laws.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Duration;

use pyo3::prelude::*;

use crate::error::refuse;
use crate::law;

/// Between two looks for Ctrl-C and for the error of a law [s: 0.05].
const BETWEEN: Duration = Duration::from_millis(50);

/// What the work says while it runs.
pub struct Event {
    /// A step in words; none where it is an iteration.
    pub words: Option<String>,
    /// Iteration and cost of the fit under way.
    pub fit: Option<(u64, f64)>,
}

/// Runs `work`; `tell` gets what it says. Ctrl-C and an exception of `tell` or of a law set `flag`, upon which the work ends with what it has.
///
/// Returns what the work gave and, where there was one, the exception that ended it.
///
/// # Errors
/// A panic of the work, as `misfit.Error` of stage `panic`; as [`law::turn`].
pub fn run<T: Send>(
    py: Python<'_>,
    flag: &Arc<AtomicBool>,
    events: Receiver<Event>,
    tell: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce() -> T + Send,
) -> PyResult<(T, Option<PyErr>)> {
    let _turn = law::turn(py)?;
    law::clear();
    let mut ended = None;
    let done = std::thread::scope(|scope| {
        let thread = scope.spawn(|| catch_unwind(AssertUnwindSafe(work)));
        let mut events = events;
        loop {
            let lent = &mut events;
            let event = py.detach(move || lent.recv_timeout(BETWEEN));
            let told = match (&event, tell) {
                (Ok(e), Some(tell)) => tell.call1((e.words.clone(), e.fit)).map(drop),
                _ => Ok(()),
            };
            if let Err(e) = told.and_then(|()| py.check_signals()) {
                flag.store(true, Ordering::Relaxed);
                ended.get_or_insert(e);
            }
            if law::raised() {
                flag.store(true, Ordering::Relaxed);
            }
            match event {
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) if thread.is_finished() => break,
                _ => {}
            }
        }
        py.detach(|| thread.join())
    });
    match done {
        Ok(Ok(value)) => Ok((value, law::take().or(ended))),
        Ok(Err(panic)) | Err(panic) => Err(of_panic(py, &*panic)),
    }
}

/// Runs `work` that takes a moment on the calling thread, without the interpreter lock. Ctrl-C is heard when it is done.
///
/// # Errors
/// As [`run`].
pub fn short<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<(T, Option<PyErr>)> {
    let _turn = law::turn(py)?;
    law::clear();
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(value) => Ok((value, law::take().or(py.check_signals().err()))),
        Err(panic) => Err(of_panic(py, &*panic)),
    }
}

/// The exception of a panic.
fn of_panic(py: Python<'_>, panic: &(dyn Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<&str>().map(ToString::to_string).or_else(|| panic.downcast_ref::<String>().cloned());
    let message = text.unwrap_or_else(|| "the computation ended unexpectedly".into());
    refuse(py, "panic", "", message, "nothing: this is a fault of misfit; the study that shows it helps to find it")
}
