//! A verb called from a program: the words of the command line in, its JSON and text out.
//!
//! The Python package goes through here, so that it runs the very code that the command line runs and gets the same results.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Parser;
use serde_json::Value;

use crate::diagnose::results::TestResult;
use crate::identify::Progress;
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
}

/// The watcher among the options of a verb; none on the command line.
#[derive(Clone, Default)]
pub(super) struct Watched(pub Option<Arc<dyn Watcher>>);

impl Watched {
    pub fn cancel(&self) -> Option<Arc<AtomicBool>> {
        self.0.as_ref().map(|w| w.cancel())
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
/// What the verb could not do; wrong words, as stage `cli`; the verbs `serve`, `campaign` and `trial`, which watch signals of their process.
pub fn call<S: AsRef<str>>(words: &[S], watcher: Arc<dyn Watcher>) -> Result<Called, Failure> {
    let words = std::iter::once("misfit").chain(words.iter().map(AsRef::as_ref));
    let mut verb = Cli::try_parse_from(words).map_err(|e| wrong(&e))?.verb;
    if let Verb::Serve(_) | Verb::Campaign(_) | Verb::Trial(_) = verb {
        let accepted = "the program `misfit`, or another verb";
        return Err(Failure::new("cli", "verb", "`serve`, `campaign` and `trial` run from the command line alone", accepted));
    }
    let mut threads = None;
    if let Some(common) = verb.common() {
        common.json = true;
        common.watcher = Watched(Some(watcher));
        threads = common.threads.take();
    }
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
