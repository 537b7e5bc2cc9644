//! `misfit trial`: known-truth recovery on generated hidden effects.

use std::path::PathBuf;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::campaign;
use crate::identify::Monitor;
use crate::trial::{self, CaseResult, Counts, Data, Imperfection, Kept, Kind, NONCENTRALITY, Options, Structure, TrialError};

use super::call::Watched;
use super::progress::Progress;
use super::share::Shared;
use super::table::{significant, table};
use super::{INTERRUPTED, Outcome};
use crate::work::Failure;

#[derive(clap::Args)]
pub(super) struct Args {
    /// Cases
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..))]
    pub cases: u32,
    /// Seed of models, tests, hidden effects and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// What is hidden: one, two, none, outside, instrument; these in turn [default: a mix of all]
    #[arg(long, value_name = "KINDS", value_delimiter = ',', value_parser = kind)]
    pub kinds: Vec<Kind>,
    /// connector: one, under loops; sparse: the same at one frequency; chain: under loops and frequency responses; both: connector and chain
    #[arg(long, value_name = "WHAT", default_value = "both", value_parser = structure)]
    pub models: Structure,
    /// clean: the base right but for what is hidden, white noise; realistic: the base wrong elsewhere too, coloured noise, scatter between tests,
    /// wrong or no sigma, sensors and gains within tolerance, unequal records, hidden effects of 2 to 30 standard deviations
    #[arg(long, value_name = "KIND", default_value = "clean", default_value_if("only", clap::builder::ArgPredicate::IsPresent, "realistic"), value_parser = data)]
    pub data: Data,
    /// Realistic data with one imperfection alone, these in turn: white (none), noise, cycles, scatter, sensor, sigma, gains, base, records; with
    /// --kinds none each is a null row: `misfit trial --kinds none --only scatter,sensor`
    #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = imperfection)]
    pub only: Vec<Imperfection>,
    /// Folder of the finished cases [default: runs/trial-SEED]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Goes on with the trial in DIR, with its seed and kinds
    #[arg(long, value_name = "DIR", conflicts_with_all = ["out", "seed", "kinds", "models", "data", "only"])]
    pub resume: Option<PathBuf>,
    /// Writes every case that was not found into DIR, as a study with its truth
    #[arg(long, value_name = "DIR")]
    pub write: Option<PathBuf>,
    /// Writes case N alone, found or not, and runs none
    #[arg(long, value_name = "N", requires = "write", conflicts_with = "resume")]
    pub case: Option<u32>,
    /// One JSON object on stdout, everything else on stderr
    #[arg(long)]
    pub json: bool,
    /// Threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Stop after this time with the cases done
    #[arg(long, value_name = "S", value_parser = super::session::seconds)]
    pub max_seconds: Option<f64>,
    #[command(flatten)]
    shared: Shared,
    /// The program that called the verb, in place of a terminal.
    #[arg(skip)]
    pub watcher: Watched,
}

fn kind(text: &str) -> Result<Kind, String> {
    let words: Vec<&str> = Kind::WORDS.iter().map(|w| w.0).collect();
    Kind::WORDS.iter().find(|w| w.0 == text).map(|w| w.1).ok_or_else(|| format!("one of {}", words.join(", ")))
}

fn data(text: &str) -> Result<Data, String> {
    match text {
        "clean" => Ok(Data::Clean),
        "realistic" => Ok(Data::Realistic),
        _ => Err("clean or realistic".into()),
    }
}

fn imperfection(text: &str) -> Result<Imperfection, String> {
    let words: Vec<&str> = Imperfection::WORDS.iter().map(|w| w.0).collect();
    Imperfection::WORDS.iter().find(|w| w.0 == text).map(|w| w.1).ok_or_else(|| format!("one of {}", words.join(", ")))
}

fn structure(text: &str) -> Result<Structure, String> {
    match text {
        "connector" => Ok(Structure::Connector),
        "sparse" => Ok(Structure::Sparse),
        "chain" => Ok(Structure::Chain),
        "both" => Ok(Structure::Both),
        _ => Err("connector, sparse, chain or both".into()),
    }
}

/// What the command line asks for.
fn options(args: &Args) -> Result<Options, Failure> {
    if !args.only.is_empty() && args.data == Data::Clean {
        let said = "clean data have none of the imperfections of --only";
        return Err(Failure::new("cli", "--only", said, "--only with --data realistic, or without --data"));
    }
    let (kinds, only) = (args.kinds.clone(), args.only.clone());
    Ok(Options { seed: args.seed, kinds, structure: args.models, data: args.data, only })
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let drawn = options(args)?;
    if let (Some(index), Some(dir)) = (args.case, &args.write) {
        let folder = dir.join(format!("case-{index}"));
        trial::write_case(&drawn, index as usize, None, &folder)?;
        let text = format!("Case {index} of seed {}: {}\n", drawn.seed, folder.display());
        return Ok(Outcome { json: json!({ "case": index, "seed": drawn.seed, "folder": folder.display().to_string() }), text, code: 0 });
    }
    super::session::threads(args.threads)?;
    let flag = args.watcher.cancel()?;
    let limit = args.max_seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
    let mut monitor = Monitor::default().cancel(flag);
    monitor.deadline = limit.and_then(|d| Instant::now().checked_add(d));
    let (folder, kept, options, done) = match &args.resume {
        Some(folder) => {
            let (kept, options, done) = Kept::resume(folder)?;
            (folder.clone(), kept, options, done)
        }
        None => {
            let folder = args.out.clone().unwrap_or_else(|| format!("runs/trial-{}", args.seed).into());
            match &args.shared.joined {
                Some(joined) => {
                    Kept::join(&folder, &campaign::shares(joined)?)?;
                    let (kept, options, done) = Kept::resume(&folder)?;
                    (folder, kept, options, done)
                }
                None => (folder.clone(), Kept::create(&folder, &drawn)?, drawn, vec![]),
            }
        }
    };
    let asked: Vec<usize> = args.shared.share.of(args.cases as usize).collect();
    let cases = asked.len();
    let before = done.iter().filter(|d| asked.contains(&d.index)).count();
    let progress = Progress::new(args.json, monitor.deadline, args.watcher.clone());
    progress.say(&format!("{} cases", cases - before));
    let (started, tally) = (Instant::now(), Mutex::new((0usize, 0usize)));
    let each = |r: &CaseResult| -> Result<(), TrialError> {
        kept.add(r)?;
        if let (Some(dir), true) = (&args.write, r.failed()) {
            trial::write_case(&options, r.index, r.next_test.as_ref(), &dir.join(format!("case-{}", r.index)))?;
        }
        if let Ok(mut tally) = tally.lock() {
            tally.0 += 1;
            tally.1 += usize::from(r.with_ties);
            let left = started.elapsed().as_secs_f64() / tally.0 as f64 * (cases - before - tally.0) as f64;
            progress.count(&format!("{} of {cases} cases, {} of {} found, about {left:.0} s left", before + tally.0, tally.1, tally.0));
        }
        Ok(())
    };
    let ran = trial::run(&options, &asked, &done, &monitor, &each);
    progress.end();
    let results = ran?;
    let told = trial::table(&results);
    let mut value: Value =
        serde_json::to_value(&told).map_err(|e| Failure::new("cli", "trial", e.to_string(), "a result that can be written as JSON"))?;
    let interrupted = results.len() < cases;
    value["seed"] = json!(options.seed);
    value["least_noncentrality"] = json!(NONCENTRALITY);
    value["not_strict"] = json!(results.iter().filter(|r| !r.strict).collect::<Vec<_>>());
    value["interrupted"] = json!(interrupted);
    value["folder"] = json!(folder.display().to_string());
    let rest = if interrupted {
        format!("Stopped after {} of {cases} cases: misfit trial --resume {} --cases {cases}\n", results.len(), folder.display())
    } else {
        format!("Cases: {}\n", folder.join("cases.jsonl").display())
    };
    if options.data == Data::Realistic {
        value["settings"] = json!(trial::SETTINGS);
    }
    let text = tell(&options, &told, &results) + &rest;
    Ok(Outcome { json: value, text, code: if interrupted { INTERRUPTED } else { 0 } })
}

fn tell(options: &Options, told: &trial::Table, results: &[CaseResult]) -> String {
    let row = |name: &str, c: &Counts| {
        let mut row = vec![name.to_string()];
        row.extend(
            [c.cases, c.strict, c.with_ties, c.missed, c.false_alarms, c.with_extra, c.failed, c.weighed, c.next_tests, c.ties_broken]
                .map(|n| n.to_string()),
        );
        row
    };
    let mut rows: Vec<Vec<String>> = told.by_kind.iter().map(|(name, c)| row(name, c)).collect();
    rows.push(row("all", &told.all));
    let mut text = format!("Trial of {} cases, seed {}\n\n", results.len(), options.seed);
    text += &table(
        &[
            "hidden",
            "cases",
            "strict",
            "with ties",
            "missed",
            "false alarms",
            "more named",
            "failed",
            "refitted",
            "next tests",
            "ties broken",
        ],
        &rows,
    );
    text += "\n";
    let rows: Vec<Vec<String>> = told.confusion.iter().map(|c| vec![c.truth.clone(), c.said.clone(), c.count.to_string()]).collect();
    text += &table(&["truth", "said", "count"], &rows);
    if let Some(ratio) = told.held_out_over_floor {
        text += &format!("\nHeld-out error over floor, median: {}\n", significant(ratio, 3));
    }
    if let Some(realistic) = &told.realistic {
        text += &super::trial_realistic::tell(realistic);
    }
    for r in results.iter().filter(|r| r.failed()) {
        text += &format!("case {}: {} -> {}; {}\n", r.index, r.truth.join(" + "), r.said.join(" + "), r.ended);
        if let Some(next) = r.next_test.as_ref().filter(|n| !n.broken) {
            text += &format!("  its next test did not break the tie: {}; then named: {}\n", next.test.describe, next.said.join(" + "));
        }
    }
    text
}
