//! The page of a campaign: what was done, what failed and why, what differs between the variants.

use crate::report::escaped;

use super::table::Columns;
use super::{Record, Spec, Task};

/// Columns and rows that are shown; the table has them all.
const COLUMNS: usize = 40;
const ROWS: usize = 2000;

/// One self-contained HTML page.
pub fn page(spec: &Spec, tasks: &[Task], records: &[Option<Record>], columns: &Columns) -> String {
    let done = records.iter().flatten().filter(|r| r.reason.is_none()).count();
    let failed: Vec<(&Task, &str)> = tasks.iter().zip(records).filter_map(|(t, r)| Some((t, r.as_ref()?.reason.as_deref()?))).collect();
    let missing = tasks.len() - done - failed.len();
    let seconds: f64 = records.iter().flatten().map(|r| r.wall_s).sum();
    let mut body =
        format!("<h1>{}</h1>\n<p>{} of {} tasks of <code>misfit {}</code> done", escaped(&spec.title), done, tasks.len(), spec.verb);
    body += &format!(", {} failed", failed.len());
    if missing > 0 {
        body += &format!(", {missing} not run yet");
    }
    body += &format!("; {seconds:.1} s of computing.</p>\n");
    if !failed.is_empty() {
        body += "<h2>Failed</h2>\n<table><tr><th>task</th><th>reason</th></tr>\n";
        for (task, reason) in failed.iter().take(ROWS) {
            body += &format!("<tr><td>{}</td><td>{}</td></tr>\n", escaped(&task.label), escaped(reason));
        }
        body += "</table>\n";
    }
    let shown: Vec<_> = columns.differing().filter(|c| c.0 != "reason").take(COLUMNS).collect();
    if !shown.is_empty() {
        body += "<h2>What differs</h2>\n<div class=\"wide\"><table><tr>";
        body += &shown.iter().map(|c| format!("<th>{}</th>", escaped(&c.0))).collect::<String>();
        body += "</tr>\n";
        for row in 0..tasks.len().min(ROWS) {
            body += "<tr>";
            body += &shown.iter().map(|c| format!("<td>{}</td>", escaped(&cell(&c.1[row])))).collect::<String>();
            body += "</tr>\n";
        }
        body += "</table></div>\n";
        let all = columns.differing().count() - usize::from(columns.differing().any(|c| c.0 == "reason"));
        if all > shown.len() || tasks.len() > ROWS {
            body += &format!(
                "<p>{} of {all} columns and {} of {} rows; table.parquet has all.</p>\n",
                shown.len(),
                tasks.len().min(ROWS),
                tasks.len()
            );
        }
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{} - misfit campaign</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         {body}</body>\n</html>\n",
        escaped(&spec.title)
    )
}

fn cell(c: &super::table::Cell) -> String {
    match c {
        super::table::Cell::Number(v) if *v != 0.0 && !(1e-3..1e6).contains(&v.abs()) => format!("{v:.4e}"),
        super::table::Cell::Number(v) => {
            let digits = (4 - v.abs().max(1e-300).log10().floor() as i32).clamp(0, 8) as usize;
            format!("{v:.digits$}")
        }
        other => other.shown(),
    }
}

const STYLE: &str = "body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem; color: #222; }\n\
table { border-collapse: collapse; font-size: 13px; }\nth, td { border: 1px solid #ccc; padding: 3px 7px; text-align: left; white-space: nowrap; }\n\
th { background: #f3f3f3; }\n.wide { overflow-x: auto; }\n";
