//! The command line: one verb per file, people on the terminal, scripts with `--json`.
//!
//! Exit codes: 0 done; 1 could not be done; 2 wrong usage; 130 interrupted (a signal, or `--max-seconds` used up) with the best state
//! saved.

mod add;
mod call;
mod campaign;
mod check;
mod compare;
mod diagnose;
mod effects;
mod export;
mod fit;
mod ladder;
mod new;
mod predict;
mod progress;
mod report;
mod scatter;
mod schema;
mod serve;
mod session;
mod share;
mod simulate;
mod table;
mod text;
mod tolerance;
mod trial;
mod trial_realistic;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use serde_json::Value;

use crate::work::Failure;
use crate::work::terminal::plain;

pub use call::{Called, Watcher, call};

/// Calibrates models of assembled flexible mechanical systems and finds out what physics they are missing.
#[derive(Parser)]
#[command(name = "misfit", version, about)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Makes a study from files of a test bench, and says what is in them
    New(new::Args),
    /// Validates data, units and model: the gate before a fit
    Check(check::Args),
    /// Virtual rig: writes the dataset the study's model would have given
    Simulate(simulate::Args),
    /// Identifies the study as it stands
    Fit(fit::Args),
    /// Holds the model as it stands against the measurements
    Compare(compare::Args),
    /// Says where the model fails, which effects explain it, and how sure that is
    Diagnose(diagnose::Args),
    /// Writes an effect into study.toml and refits
    Add(add::Args),
    /// Diagnoses, adds, refits and prunes until nothing earns its place
    Ladder(ladder::Args),
    /// Fits, then computes the study's predictions with their deviations
    Predict(predict::Args),
    /// Tolerances of parts to distributions of energies: yields, contributions, the loosest tolerances that keep a yield
    Tolerance(tolerance::Args),
    /// Fits, then writes the calibrated set in other formats
    Export(export::Args),
    /// Writes one HTML file that opens offline
    Report(report::Args),
    /// Opens the workbench: a page in the browser to compare, localise, add and fit
    Serve(serve::Args),
    /// Known-truth recovery: how often generated hidden effects are found
    Trial(trial::Args),
    /// One verb over many variants, on this machine or through Slurm
    Campaign(campaign::Args),
    /// Lists the library of effects, or shows one
    Effects(effects::Args),
    /// JSON Schema of study.toml, dataset.toml and of what the verbs print
    Schema(schema::Args),
}

impl Verb {
    fn run(&self) -> Result<Outcome, Failure> {
        match self {
            Verb::New(a) => new::run(a),
            Verb::Check(a) => check::run(a),
            Verb::Simulate(a) => simulate::run(a),
            Verb::Fit(a) => fit::run(a),
            Verb::Compare(a) => compare::run(a),
            Verb::Diagnose(a) => diagnose::run(a),
            Verb::Add(a) => add::run(a),
            Verb::Ladder(a) => ladder::run(a),
            Verb::Predict(a) => predict::run(a),
            Verb::Tolerance(a) => tolerance::run(a),
            Verb::Export(a) => export::run(a),
            Verb::Report(a) => report::run(a),
            Verb::Serve(a) => serve::run(a),
            Verb::Trial(a) => trial::run(a),
            Verb::Campaign(a) => campaign::run(a),
            Verb::Effects(a) => effects::run(a),
            Verb::Schema(a) => schema::run(a),
        }
    }

    /// Puts the caller in the place of the terminal; gives the number of threads that the words ask for.
    fn called(&mut self, by: call::Watched) -> Option<u16> {
        let (json, watcher, threads) = match self {
            Verb::Trial(a) => (&mut a.json, &mut a.watcher, &mut a.threads),
            Verb::Campaign(a) => (&mut a.json, &mut a.watcher, &mut a.threads),
            other => {
                let common = other.common()?;
                (&mut common.json, &mut common.watcher, &mut common.threads)
            }
        };
        (*json, *watcher) = (true, by);
        threads.take()
    }

    /// The options of a verb on a study.
    fn common(&mut self) -> Option<&mut session::Common> {
        Some(match self {
            Verb::Check(a) => &mut a.common,
            Verb::Simulate(a) => &mut a.common,
            Verb::Fit(a) => &mut a.common,
            Verb::Compare(a) => &mut a.common,
            Verb::Diagnose(a) => &mut a.common,
            Verb::Add(a) => &mut a.common,
            Verb::Ladder(a) => &mut a.common,
            Verb::Predict(a) => &mut a.common,
            Verb::Tolerance(a) => &mut a.common,
            Verb::Export(a) => &mut a.common,
            Verb::Report(a) => &mut a.common,
            Verb::New(_) | Verb::Serve(_) | Verb::Trial(_) | Verb::Campaign(_) | Verb::Effects(_) | Verb::Schema(_) => return None,
        })
    }

    fn json(&self) -> bool {
        match self {
            Verb::New(a) => a.json,
            Verb::Check(a) => a.common.json,
            Verb::Simulate(a) => a.common.json,
            Verb::Fit(a) => a.common.json,
            Verb::Compare(a) => a.common.json,
            Verb::Diagnose(a) => a.common.json,
            Verb::Add(a) => a.common.json,
            Verb::Ladder(a) => a.common.json,
            Verb::Predict(a) => a.common.json,
            Verb::Tolerance(a) => a.common.json,
            Verb::Export(a) => a.common.json,
            Verb::Report(a) => a.common.json,
            Verb::Serve(a) => a.json,
            Verb::Trial(a) => a.json,
            Verb::Campaign(a) => a.json,
            Verb::Effects(a) => a.json,
            Verb::Schema(a) => a.json,
        }
    }
}

/// What a verb gives: the JSON object, the text for people, the exit code.
struct Outcome {
    json: Value,
    text: String,
    code: u8,
}

const NOT_DONE: u8 = 1;
const USAGE: u8 = 2;
const INTERRUPTED: u8 = 130;

/// Runs the command line of the process.
pub fn main() -> ExitCode {
    ExitCode::from(main_of(std::env::args_os()))
}

/// Runs the command line `words`, the name of the program first, as a process of it does; gives the exit code.
pub fn main_of(words: impl IntoIterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = words.into_iter().collect();
    let cli = match Cli::try_parse_from(&words) {
        Ok(cli) => cli,
        Err(e) => return usage(&e, words.iter().any(|w| w == "--json")),
    };
    let json = cli.verb.json();
    match cli.verb.run() {
        Ok(outcome) => {
            let told = print(json, &outcome.json, &outcome.text);
            told.map_or_else(|failure| untold(&failure), |()| outcome.code)
        }
        Err(failure) => {
            if json {
                let _ = print(true, &failure.json(), "");
            }
            failure.tell();
            NOT_DONE
        }
    }
}

/// Help and version go to stdout with 0; wrong usage to stderr with 2, and as the one JSON object where a script asked for JSON.
fn usage(e: &clap::Error, json: bool) -> u8 {
    // A terminal that is gone is no reason to fail differently.
    let _ = e.print();
    if !e.use_stderr() {
        return 0;
    }
    if json {
        let _ = print(true, &call::wrong(e).json(), "");
    }
    USAGE
}

/// One JSON object, or the text, on stdout; nothing of a verb that has told all there is.
///
/// # Errors
/// What was found cannot be written, as on a full disk. A reader that has closed the pipe has read enough.
fn print(json: bool, value: &Value, text: &str) -> std::io::Result<()> {
    use std::io::{ErrorKind, Write};
    if value.is_null() {
        return Ok(());
    }
    let mut out = std::io::stdout().lock();
    let written = if json { writeln!(out, "{value}") } else { write!(out, "{}", plain(text)) };
    match written.and_then(|()| out.flush()) {
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        told => told,
    }
}

/// What was found, and could not be told.
fn untold(why: &std::io::Error) -> u8 {
    Failure::new("cli", "standard output", format!("what was found cannot be written there: {why}"), "a file or a pipe with room").tell();
    NOT_DONE
}
