//! Progress on stderr: a line that moves on a terminal, a plain line now and then elsewhere.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::identify;

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
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    step: String,
    last: Option<Instant>,
}

impl Progress {
    pub fn new(json: bool, deadline: Option<Instant>) -> Self {
        use std::io::IsTerminal;
        let terminal = !json && std::io::stderr().is_terminal();
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        // A template of constants; were it refused, the default would do.
        if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {wide_msg}") {
            bar.set_style(style);
        }
        Progress { bar, terminal, started: Instant::now(), deadline, state: Mutex::new(State::default()) }
    }

    /// A step of the work, in words.
    pub fn say(&self, step: &str) {
        let Ok(mut state) = self.state.lock() else { return };
        // What failed stays to be read, however short the run.
        if step.contains(FAILED) {
            self.bar.suspend(|| eprintln!("misfit: {:.0} s: {}", self.started.elapsed().as_secs_f64(), step.trim()));
            return;
        }
        state.step = step.to_string();
        let plain = !self.terminal && self.started.elapsed() >= QUIET;
        self.show(step.to_string(), &mut state, plain);
    }

    /// An iteration of a fit.
    pub fn iteration(&self, p: &identify::Progress) {
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
            eprintln!("misfit: {:.0} s: {text}", self.started.elapsed().as_secs_f64());
            state.last = Some(Instant::now());
        }
        self.bar.set_message(text);
    }

    /// Takes the moving line away.
    pub fn end(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.end();
    }
}
