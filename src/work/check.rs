//! What is wrong with a study, its data, units and model, and whether a fit may begin. Every problem that can be found is told, not the first.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::data::toml_strict::{TomlError, TomlFile, TomlProblem};
use crate::data::{Dataset, frf_doubts};
use crate::diagnose::results::SplitName;
use crate::diagnose::{Case, approached, odd_units};
use crate::identify::{GateReport, Monitor, gate};
use crate::parallel;
use crate::residual::Problem;
use crate::response::Plan;
use crate::study::{Study, StudyError};
use crate::units::significant;

use super::{Failure, started};

/// What a check finds.
#[derive(Clone, Debug, Default)]
pub struct Checked {
    /// What a fit could not be done with.
    pub problems: Vec<Failure>,
    /// What to know of the tests.
    pub notes: Vec<String>,
    /// The gate before a fit; none where the study does not get so far.
    pub gate: Option<GateReport>,
}

/// Checks the study at `path`, with its raw files in `data` and other starts than its own; `say` hears what is being done.
pub fn check(path: &Path, data: Option<&Path>, starts: &[(String, String)], seed: u64, monitor: &Monitor, say: &dyn Fn(&str)) -> Checked {
    say("reading the study and its measurements");
    let mut found = Checked::default();
    let study = match Study::load(path, data) {
        Err(first) => return Checked { problems: all_of(first, path, data), ..found },
        Ok(study) => match started(&study, starts) {
            Ok(system) => Study { system, ..study },
            Err(failure) => return Checked { problems: vec![failure], ..found },
        },
    };
    for plan in parallel::map(&study.dataset.tests, |t| Plan::new(t, &study.system.model)) {
        match plan {
            Ok(plan) => found.notes.extend(plan.notes.iter().map(|n| format!("{}: {n}", plan.id))),
            Err(e) => found.problems.push(e.into()),
        }
    }
    for doubt in frf_doubts(&study.dataset.tests) {
        if doubt.refused {
            found.problems.push(doubt.error().into());
        } else {
            found.notes.push(format!("{}: {}; accepted: {}", doubt.test, doubt.claim, doubt.accepted));
        }
    }
    if found.problems.is_empty() {
        say("the gate: does every parameter move the residual, and does a short fit reach the data");
        // A formula that has no value or gives energy back is found here.
        match Case::from_study(&study, seed).map_err(Failure::from).and_then(|case| at_gate(&case, monitor)) {
            Ok((report, notes)) => {
                found.problems.extend(refused(&report));
                found.notes.extend(notes);
                found.gate = Some(report);
            }
            Err(failure) => found.problems.push(failure),
        }
    }
    found
}

/// What the gate says, and what the model says of the units of the frequency responses: as the study has it and, where its free parameters do not take that up,
/// from where a fit would begin.
fn at_gate(case: &Case, monitor: &Monitor) -> Result<(GateReport, Vec<String>), Failure> {
    let nearer = approached(case, monitor)?;
    let mut notes = odd_units(case, &case.system);
    let test = |note: &str| note.split(':').next().map(str::to_string);
    for note in nearer.iter().flat_map(|system| odd_units(case, system)) {
        if !notes.iter().any(|n| test(n) == test(&note)) {
            notes.push(note);
        }
    }
    let system = nearer.unwrap_or_else(|| case.system.clone());
    let problem = Problem::new(case.plans_of(SplitName::Fit), system);
    let rows = problem.plans.iter().map(|p| p.len()).sum();
    let options = case.options(&problem.system, rows).map_err(Failure::from)?;
    Ok((gate(&problem, &problem.variables(), &options, monitor)?, notes))
}

const ACCEPTED_FAR: &str = "wider bounds or priors, starting values nearer to the data (`misfit compare` shows where they miss), or data in the units they are said to have";

/// What the gate holds against a fit.
fn refused(report: &GateReport) -> Vec<Failure> {
    let still = report.free.iter().filter(|p| !p.moves_residual).map(|p| {
        let message = format!("`{}` moves no residual of the fitted tests", p.name);
        Failure::new("identify", &p.name, message, "fixed = true, or a test that excites it")
    });
    let far = (!report.reachable).then(|| {
        let labels: Vec<&str> = report.blocking.iter().map(|b| b.label.as_str()).collect();
        let message = format!(
            "a fit from these starting values ends {} sigma from the data, held by {}",
            significant(report.best_rms, 3),
            labels.join("; ")
        );
        Failure::new("identify", labels.join("; "), message, ACCEPTED_FAR)
    });
    still.chain(far).collect()
}

/// A reading stops at its first error; here it goes on past it: the block of the file the error stands in (one test, one effect) is
/// blanked, line numbers kept, and the rest read again. Errors that only follow from a blanked block are left out.
fn all_of(first: StudyError, study: &Path, data: Option<&Path>) -> Vec<Failure> {
    let file = if study.is_dir() { study.join("study.toml") } else { study.to_path_buf() };
    let Ok(text) = crate::limits::text(&file) else { return vec![first.into()] };
    let (mut problems, dataset) = match dataset_of(&file, &text) {
        Some((path, folder)) => tests(&path, data.or(folder.as_deref())),
        None => (vec![], None),
    };
    let blanked: BTreeSet<String> = problems.iter().map(|p| p.0.clone()).collect();
    let mut all: Vec<Failure> = problems.drain(..).map(|p| p.1).collect();
    if let Some(dataset) = dataset {
        let follows = |f: &Failure| blanked.iter().any(|t| !t.is_empty() && f.message().contains(&format!("`{t}`")));
        all.extend(effects(&file, text, &dataset, &follows));
    }
    if all.is_empty() { vec![first.into()] } else { all }
}

/// The dataset.toml a study names, and its raw folder.
fn dataset_of(file: &Path, text: &str) -> Option<(PathBuf, Option<PathBuf>)> {
    let toml = TomlFile::parse(file, text.to_string(), "study").ok()?;
    let root = toml.root();
    let beside = file.parent().unwrap_or(Path::new(""));
    let path = beside.join(root.get("dataset")?.string().ok()?);
    let path = Dataset::file_of(&path);
    let folder = root.get("folder").and_then(|v| v.string().ok()).map(|f| beside.join(f));
    path.exists().then_some((path, folder))
}

/// The problems of every test with its id, and the dataset of the tests without any.
fn tests(path: &Path, data: Option<&Path>) -> (Vec<(String, Failure)>, Option<Dataset>) {
    let whole = || Dataset::load(path, data);
    let one = |e: Failure| (vec![(String::new(), e)], None);
    let Ok(text) = crate::limits::text(path) else { return whole().map_or_else(|e| one(e.into()), |d| (vec![], Some(d))) };
    let error = match whole() {
        Ok(dataset) => return (vec![], Some(dataset)),
        Err(e) => Failure::from(e),
    };
    let blocks: Vec<(usize, usize)> = blocks(&text).into_iter().filter(|b| header(&text, b.0) == "test").map(|b| (b.0, b.1)).collect();
    let read = |keep: &dyn Fn(usize) -> bool| {
        let away: Vec<(usize, usize)> = blocks.iter().enumerate().filter(|(k, _)| !keep(*k)).map(|(_, b)| *b).collect();
        let toml = TomlFile::parse(path, blank(&text, &away), "data").map_err(crate::data::DataError::from)?;
        Dataset::from_toml(&toml, data)
    };
    let mut bad = Vec::new();
    let mut problems = Vec::new();
    for (k, block) in blocks.iter().enumerate() {
        if let Err(e) = read(&|j| j == k) {
            let id = id_of(&text, *block).unwrap_or_default();
            bad.push(k);
            problems.push((id, Failure::from(e).counted("test", 0, k)));
        }
    }
    // An error outside the tests turns up in each of them; one that no test has alone (a doubled id) is the whole file's.
    if problems.is_empty() || problems.len() == blocks.len() && problems.iter().all(|p| p.1 == problems[0].1) {
        return one(error);
    }
    let rest = read(&|j| !bad.contains(&j)).ok();
    (problems, rest)
}

/// Problems of study.toml, block by block. `follows` tells what only comes from a test that is left out (its place in the split).
fn effects(file: &Path, mut text: String, dataset: &Dataset, follows: &dyn Fn(&Failure) -> bool) -> Vec<Failure> {
    let (mut problems, whole) = (Vec::new(), text.clone());
    let (mut gone, mut cut) = (false, false);
    // Each round blanks a block or a line, so their number bounds the rounds.
    for _ in 0..=text.lines().count() {
        let read = TomlFile::parse(file, text.clone(), "study").map_err(StudyError::from);
        let Err(error) = read.and_then(|t| Study::from_toml(&t, dataset.clone())) else { break };
        let (line, syntax) = match &error {
            StudyError::Toml(TomlError { line, file: at, problem, .. }) if at == file => {
                (*line, matches!(**problem, TomlProblem::Syntax(_)))
            }
            _ => (0, false),
        };
        // A line taken out of the middle of a value: what comes now is of our making.
        if syntax && cut {
            break;
        }
        let failure = Failure::from(error);
        let block = blocks(&text).into_iter().find(|b| b.0 < line && line <= b.1);
        let kind = block.map_or("", |b| header(&text, b.0)).to_string();
        let nth = |text: &str| blocks(text).into_iter().filter(|b| b.1 < line && header(text, b.0) == kind).count();
        let failure = failure.counted(&kind, nth(&text), nth(&whole));
        if follows(&failure) {
            if line == 0 {
                break;
            }
            cut = true;
            text = blank(&text, &[block.unwrap_or((line - 1, line))]);
            continue;
        }
        // An order, a prediction, or the hold of a body may only miss what a blanked effect had.
        let missed = gone && (matches!(kind.as_str(), "order" | "prediction") || failure.message().contains("a mechanism"));
        if !missed {
            problems.push(failure);
        }
        // Without a body or a connector everything at it would be wrong: the reading ends there.
        let (Some(block), "effect" | "order" | "prediction") = (block, kind.as_str()) else { break };
        gone |= kind == "effect";
        text = blank(&text, &[block]);
    }
    problems
}

/// Line ranges (from, to) of the `[[...]]` and `[...]` blocks, counted from 0, the end not included.
fn blocks(text: &str) -> Vec<(usize, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let starts: Vec<usize> = (0..lines.len()).filter(|k| lines[*k].starts_with('[')).collect();
    let ends = starts.iter().skip(1).copied().chain([lines.len()]);
    starts.iter().copied().zip(ends).collect()
}

fn header(text: &str, line: usize) -> &str {
    let line = text.lines().nth(line).unwrap_or("").trim();
    line.split(']').next().unwrap_or("").trim_start_matches('[').trim()
}

fn blank(text: &str, away: &[(usize, usize)]) -> String {
    let gone = |k: usize| away.iter().any(|(from, to)| (*from..*to).contains(&k));
    text.lines().enumerate().map(|(k, line)| if gone(k) { "\n".to_string() } else { format!("{line}\n") }).collect()
}

fn id_of(text: &str, block: (usize, usize)) -> Option<String> {
    let part: String = text.lines().skip(block.0).take(block.1 - block.0).map(|l| format!("{l}\n")).collect();
    let value: toml::Table = part.parse().ok()?;
    Some(value.get("test")?.as_array()?.first()?.get("id")?.as_str()?.to_string())
}

#[cfg(test)]
mod tests_of_blocks {
    use super::*;

    /// A block that is read while others are blanked is named by its own number in the file.
    #[test]
    fn the_second_of_two_tests_is_named_as_the_second() {
        let folder = tempfile::tempdir().unwrap();
        let test = |id: &str, kind: &str| {
            format!("[[test]]\nid = \"{id}\"\nkind = \"{kind}\"\nrows = [{{ mode = 1, natural_frequency = \"2 Hz\" }}]\n")
        };
        let path = folder.path().join("dataset.toml");
        std::fs::write(&path, format!("schema = 1\n{}{}{}", test("a", "modal"), test("b", "nodal"), test("c", "nodal"))).unwrap();
        let (problems, _) = tests(&path, None);
        let places: Vec<&str> = problems.iter().map(|(_, f)| f.place()).collect();
        // The first is at fault for another reason.
        let named = places.iter().enumerate().all(|(k, p)| p.contains(&format!("key test[{k}].")));
        assert!(places.len() == 3 && named, "{places:?}");
    }

    #[test]
    fn blanking_keeps_the_lines() {
        let text = "schema = 1\n[[test]]\nid = \"a\"\n\n[[test]]\nid = \"b\"\nchannels = [\n  1,\n]\n";
        assert_eq!(blocks(text), vec![(1, 4), (4, 9)]);
        assert_eq!(header(text, 4), "test");
        assert_eq!(id_of(text, (4, 9)).as_deref(), Some("b"));
        let left = blank(text, &[(1, 4)]);
        assert_eq!(left.lines().nth(5), Some("id = \"b\""));
        assert!(!left.contains("\"a\""));
    }
}
