//! A verb called from a program: the words of the command line in, its JSON and text out.
//!
//! The Python package goes through here, so that it runs the very code that the command line runs and gets the same results.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Parser;
use serde_json::Value;

use crate::diagnose::results::TestResult;
use crate::identify::{Progress, interrupt_flag};
use crate::work::Failure;

use super::{Cli, Verb, session};

/// What the calling program is told while a verb runs. The calls come from the thread of the verb.
pub trait Watcher: Send + Sync {
    /// Set from any thread to stop with the best state.
    fn cancel(&self) -> Arc<AtomicBool>;
    /// A step of the work, in words.
    fn step(&self, words: &str);
    /// An iteration of a fit.
    fn iteration(&self, progress: &Progress);
    /// The tests against the result, with their curves; a later call replaces an earlier one.
    fn tests(&self, tests: &[TestResult]);
    /// How a process of this program is started, for the tasks of a campaign: its words before those of the verb. None: the running executable is it.
    fn program(&self) -> Option<Vec<OsString>> {
        None
    }
}

/// The watcher among the options of a verb; none on the command line.
#[derive(Clone, Default)]
pub(super) struct Watched(pub Option<Arc<dyn Watcher>>);

impl Watched {
    /// The flag that stops the verb: the caller's, or that of Ctrl-C and SIGTERM.
    pub fn cancel(&self) -> Result<Arc<AtomicBool>, Failure> {
        let called = self.0.as_ref().map(|w| w.cancel());
        called
            .map_or_else(interrupt_flag, Ok)
            .map_err(|e| Failure::new("cli", "signal", format!("Ctrl-C cannot be watched: {e}"), "a system that allows signal handlers"))
    }

    /// How a process of this program is started.
    pub fn program(&self) -> Result<Vec<OsString>, Failure> {
        if let Some(words) = self.0.as_ref().and_then(|w| w.program()) {
            return Ok(words);
        }
        let own = std::env::current_exe().map_err(|e| {
            Failure::new("campaign", "misfit", format!("the program does not know where it is: {e}"), "/proc, or an installed program")
        })?;
        Ok(vec![own.into()])
    }
}

/// What a verb gave.
#[derive(Clone, Debug)]
pub struct Called {
    /// The object that `--json` prints.
    pub json: Value,
    /// The text that people read.
    pub text: String,
    /// Exit code: 0 done, 1 not done, 130 interrupted with the best state saved.
    pub code: u8,
}

/// Runs a verb: `words` as on the command line, without the name of the program.
///
/// # Errors
/// What the verb could not do; wrong words, as stage `cli`; the verb `serve`, which runs until its process ends.
pub fn call<S: AsRef<str>>(words: &[S], watcher: Arc<dyn Watcher>) -> Result<Called, Failure> {
    let words = std::iter::once("misfit").chain(words.iter().map(AsRef::as_ref));
    let mut verb = Cli::try_parse_from(words).map_err(|e| wrong(&e))?.verb;
    if let Verb::Serve(_) = verb {
        return Err(Failure::new("cli", "verb", "`serve` runs from the command line alone", "the program `misfit`, or another verb"));
    }
    let threads = verb.called(Watched(Some(watcher)));
    // The threads of a program are set once; a call that asks for another number has its own.
    let outcome = match threads {
        None => verb.run(),
        Some(n) => session::pool(n)?.install(|| verb.run()),
    }?;
    Ok(Called { json: outcome.json, text: outcome.text, code: outcome.code })
}

/// What clap says of wrong words, in the form of every other error.
pub(super) fn wrong(e: &clap::Error) -> Failure {
    let text = e.render().to_string();
    let (message, rest) = text.split_once("\n\n").unwrap_or((&text, ""));
    Failure::new("cli", "command line", message.trim_start_matches("error: ").trim(), rest.trim())
}
