//! `misfit campaign`: one verb over many variants, on this machine or through Slurm.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Instant;

use serde_json::{Value, json};

use crate::campaign::{self, How, On, Runner, Spec};
use crate::work::Failure;

use super::call::Watched;
use super::progress::Progress;
use super::table::table;
use super::{INTERRUPTED, Outcome};

#[derive(clap::Args)]
pub(super) struct Args {
    /// campaign.toml
    file: PathBuf,
    /// One JSON object on stdout, everything else on stderr
    #[arg(long)]
    pub json: bool,
    /// Where the tasks run
    #[arg(long, value_enum, default_value_t = On::Local)]
    on: On,
    /// Go on with what an earlier run has left: what is done is not done again, what failed is tried again
    #[arg(long)]
    resume: bool,
    /// Folder of the results [default: <name of the file>-results beside it]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Tasks at a time on this machine [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Element of a job array that this process is
    #[arg(long, value_name = "K", hide = true)]
    element: Option<usize>,
    /// The program that called the verb, in place of a terminal.
    #[arg(skip)]
    pub watcher: Watched,
}

pub(super) fn run(args: &Args) -> Result<Outcome, Failure> {
    let begun = Instant::now();
    super::session::threads(args.threads)?;
    let flag = args.watcher.cancel()?;
    let stopped = || flag.load(Ordering::Relaxed);
    let spec = Spec::load(&args.file)?;
    let folder = args.out.clone().unwrap_or_else(|| spec.folder());
    let program = args.watcher.program()?;
    if let Some(element) = args.element {
        let (done, stopped) = campaign::element(&Runner::new(&program, &spec, &folder), element, &stopped)?;
        let code = if stopped { INTERRUPTED } else { 0 };
        return Ok(Outcome { json: json!({ "element": element, "done": done }), text: format!("{done} tasks\n"), code });
    }
    let progress = Progress::new(args.json, None, args.watcher.clone());
    let how = How { on: args.on, resume: args.resume, program: &program };
    let found = campaign::run(&spec, &folder, how, &stopped, &|steps: &str| progress.count(steps));
    progress.end();
    let found = found?;
    let (done, failed) = (found.done(), found.failed());
    let (of_table, of_report) = (found.table.display(), found.report.display());
    let list: Vec<Value> = failed.iter().map(|(t, reason)| json!({ "task": t.label, "reason": reason })).collect();
    let value = json!({
        "tasks": found.tasks.len(), "done": done, "failed": list, "table": of_table.to_string(), "report": of_report.to_string(),
        "computed": found.computed, "of_other_inputs": found.others, "interrupted": found.stopped, "wall_s": begun.elapsed().as_secs_f64(),
    });
    let mut text = format!("{}\n\n{done} of {} tasks done, {} failed.\n", spec.title, found.tasks.len(), failed.len());
    if !failed.is_empty() {
        let rows: Vec<Vec<String>> = failed.iter().take(20).map(|(t, r)| vec![t.label.clone(), r.clone()]).collect();
        text += &format!("\n{}", table(&["task", "reason"], &rows));
    }
    if found.others > 0 {
        text += &format!("{} earlier results are of other inputs or another list, and are no part of the table.\n", found.others);
    }
    if found.stopped {
        text += &format!("Stopped; to go on: misfit campaign {} --resume\n", args.file.display());
    }
    text += &format!("Table: {of_table}\nReport: {of_report}\n");
    Ok(Outcome { json: value, text, code: if found.stopped { INTERRUPTED } else { 0 } })
}
