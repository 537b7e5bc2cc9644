//! Progress on stderr: a line that moves on a terminal, a plain line now and then elsewhere, also where a step takes long.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::identify;
use crate::work::terminal::say;

use super::call::Watched;

/// Nothing is shown of what takes less than this.
const QUIET: Duration = Duration::from_secs(1);
/// What a line says of a part of the work that came to nothing.
const FAILED: &str = " failed: ";
/// Between plain lines.
const BETWEEN: Duration = Duration::from_secs(5);

pub(super) struct Progress {
    bar: ProgressBar,
    terminal: bool,
    started: Instant,
    deadline: Option<Instant>,
    state: Arc<Mutex<State>>,
    watcher: Watched,
    /// Repeats what is being done when nothing new is said of it for long.
    beat: Option<(Sender<()>, JoinHandle<()>)>,
}

#[derive(Default)]
struct State {
    step: String,
    /// What was said last; empty at the end.
    text: String,
    last: Option<Instant>,
}

impl Progress {
    pub fn new(json: bool, deadline: Option<Instant>, watcher: Watched) -> Self {
        use std::io::IsTerminal;
        let called = watcher.0.is_some();
        let terminal = !json && !called && std::io::stderr().is_terminal();
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        // A template of constants; were it refused, the default would do.
        if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {wide_msg}") {
            bar.set_style(style);
        }
        let (started, state) = (Instant::now(), Arc::new(Mutex::new(State::default())));
        let beat = (!terminal && !called).then(|| beat(started, state.clone()));
        Progress { bar, terminal, started, deadline, state, watcher, beat }
    }

    /// A step of the work, in words.
    pub fn say(&self, step: &str) {
        self.tell(step, Duration::ZERO);
    }

    /// How far the work has come, of many steps alike: a plain line now and then.
    pub fn count(&self, steps: &str) {
        self.tell(steps, BETWEEN);
    }

    fn tell(&self, step: &str, between: Duration) {
        if let Some(w) = &self.watcher.0 {
            return w.step(step.trim());
        }
        let Ok(mut state) = self.state.lock() else { return };
        // What failed stays to be read, however short the run.
        if step.contains(FAILED) {
            self.bar.suspend(|| say(&format!("misfit: {:.0} s: {}", self.started.elapsed().as_secs_f64(), step.trim())));
            return;
        }
        state.step = step.to_string();
        let due = self.started.elapsed() >= QUIET && state.last.is_none_or(|t| t.elapsed() >= between);
        let plain = !self.terminal && due;
        self.show(step.to_string(), &mut state, plain);
    }

    /// What stays to be read when all is done.
    pub fn note(&self, text: &str) {
        match &self.watcher.0 {
            Some(w) => w.step(text),
            None => say(text),
        }
    }

    /// An iteration of a fit.
    pub fn iteration(&self, p: &identify::Progress) {
        if let Some(w) = &self.watcher.0 {
            return w.iteration(p);
        }
        let Ok(mut state) = self.state.lock() else { return };
        let text = format!("{}: iteration {}, cost {:.6e}, step {:.1e}{}", state.step, p.iteration, p.cost, p.step, self.left());
        let due = self.started.elapsed() >= QUIET && state.last.is_none_or(|t| t.elapsed() >= BETWEEN);
        self.show(text, &mut state, !self.terminal && due);
    }

    fn left(&self) -> String {
        self.deadline.map_or(String::new(), |d| format!(", {:.0} s left", d.saturating_duration_since(Instant::now()).as_secs_f64()))
    }

    fn show(&self, text: String, state: &mut State, plain: bool) {
        if self.terminal && self.bar.is_hidden() && self.started.elapsed() >= QUIET {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
            self.bar.enable_steady_tick(Duration::from_millis(200));
        }
        if plain {
            say(&format!("misfit: {:.0} s: {text}", self.started.elapsed().as_secs_f64()));
            state.last = Some(Instant::now());
        }
        state.text.clone_from(&text);
        self.bar.set_message(text);
    }

    /// Takes the moving line away.
    pub fn end(&self) {
        if let Ok(mut state) = self.state.lock() {
            state.text.clear();
        }
        self.bar.finish_and_clear();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.end();
        if let Some((stop, thread)) = self.beat.take() {
            // A thread that has ended needs no word, and its line was the last of it.
            let _ = stop.send(());
            let _ = thread.join();
        }
    }
}

/// A thread that says every [`BETWEEN`] what is still being done, unless something else was said.
fn beat(started: Instant, state: Arc<Mutex<State>>) -> (Sender<()>, JoinHandle<()>) {
    let (stop, stopped) = channel();
    let thread = std::thread::spawn(move || {
        while stopped.recv_timeout(QUIET) == Err(RecvTimeoutError::Timeout) {
            let Ok(mut state) = state.lock() else { return };
            if !state.text.is_empty() && state.last.unwrap_or(started).elapsed() >= BETWEEN {
                say(&format!("misfit: {:.0} s: still {}", started.elapsed().as_secs_f64(), state.text.trim()));
                state.last = Some(Instant::now());
            }
        }
    });
    (stop, thread)
}
