//! The list of tasks: what is crossed, what is listed beside it, and the refits that a score map proposes.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::Value;
use xxhash_rust::xxh3::Xxh3;

use super::task::{Part, Record, Task};
use super::variant::Contents;
use super::{CampaignError, Spec};

/// The verb that takes an effect, and writes it into its study; and the axis that names it.
pub(super) const ADD: &str = "add";
pub(super) const EFFECT: &str = "effect";

pub(super) fn value(text: &str) -> toml::Value {
    let parsed = format!("v = {text}").parse::<toml::Table>().ok().and_then(|mut t| t.remove("v"));
    parsed.unwrap_or_else(|| toml::Value::String(text.into()))
}

/// As a person would write it: text without quotes.
fn plain(text: &str) -> String {
    value(text).as_str().map_or_else(|| text.to_string(), str::to_string)
}

/// Every task of the list, named by its inputs.
pub(super) fn list(spec: &Spec) -> Result<Vec<Task>, CampaignError> {
    let mut contents = Contents::default();
    let mut studies: BTreeMap<PathBuf, u128> = BTreeMap::new();
    let mut all: Vec<Task> = Vec::new();
    let none = [String::new()];
    let named: &[String] = if spec.verb == "trial" { &none } else { &spec.studies };
    if spec.crossed() {
        for study in named {
            let mut at = vec![0; spec.grid.len()];
            loop {
                let values = spec.grid.iter().zip(&at).map(|((key, values), k)| (key.clone(), values[*k].clone()));
                all.push(task(spec, study, values.collect()));
                // The last axis runs fastest.
                let Some(k) = (0..at.len()).rev().find(|k| at[*k] + 1 < spec.grid[*k].1.len()) else { break };
                at[k] += 1;
                at[k + 1..].fill(0);
            }
        }
    }
    for v in &spec.variants {
        let study = v.study.clone().or(named.first().cloned()).unwrap_or_default();
        let mut values = v.set.clone();
        values.extend(v.seed.map(|s| ("seed".to_string(), s.to_string())));
        let mut task = task(spec, &study, values);
        task.arguments.extend(v.arguments.clone());
        task.axes.insert(0, ("variant".into(), v.name.clone()));
        task.label = v.name.clone();
        all.push(task);
    }
    let mut seen: BTreeMap<String, String> = BTreeMap::new();
    for task in &mut all {
        let content = task.study.as_ref().map_or(0, |s| *studies.entry(s.clone()).or_insert_with(|| contents.study(s)));
        task.id = id(task, content);
        if spec.shares > 1 {
            if !task.draws() {
                return Err(CampaignError::Folder {
                    path: spec.file.clone(),
                    message: format!("`{}` draws nothing that could be divided into shares", task.label),
                    accepted: "fit with --bootstrap or --profile, predict with --bootstrap, trial; or no `shares`".into(),
                });
            }
            task.part = Part::Joined;
        }
        if let Some(first) = seen.insert(task.id.clone(), task.label.clone()) {
            return Err(CampaignError::Folder {
                path: spec.file.clone(),
                message: format!("`{first}` and `{}` are one and the same task", task.label),
                accepted: "tasks that differ in study, values, seed or arguments".into(),
            });
        }
    }
    Ok(all)
}

/// A task without its id.
fn task(spec: &Spec, study: &str, values: Vec<(String, String)>) -> Task {
    let trial = spec.verb == "trial";
    let mut task = Task {
        id: String::new(),
        label: String::new(),
        verb: spec.verb.clone(),
        study: (!trial).then(|| spec.path(study)),
        seed: 1,
        axes: if trial { vec![] } else { vec![("study".into(), study.to_string())] },
        set: vec![],
        arguments: spec.arguments.clone(),
        part: Part::Whole,
    };
    for (key, text) in values {
        let shown = plain(&text);
        match key.as_str() {
            "seed" => task.seed = shown.parse().unwrap_or(1),
            EFFECT if spec.verb == ADD => task.arguments.insert(0, shown.clone()),
            option if option.starts_with("--") => task.arguments.extend([key.clone(), shown.clone()]),
            _ => task.set.push((key.clone(), text)),
        }
        task.axes.push((key, shown));
    }
    let words = task.axes.iter().map(|(k, v)| if k == "study" { v.clone() } else { format!("{k}={v}") });
    task.label = words.collect::<Vec<_>>().join(" ");
    if task.label.is_empty() {
        task.label = format!("seed={}", task.seed);
    }
    task
}

fn id(task: &Task, content: u128) -> String {
    let mut hash = Xxh3::new();
    let mut add = |text: &str| {
        hash.update(&(text.len() as u64).to_le_bytes());
        hash.update(text.as_bytes());
    };
    add(env!("CARGO_PKG_VERSION"));
    add(&task.verb);
    task.set.iter().for_each(|(k, v)| {
        add(k);
        add(v);
    });
    add("--");
    task.arguments.iter().for_each(|a| add(a));
    hash.update(&task.seed.to_le_bytes());
    hash.update(&content.to_le_bytes());
    format!("{:032x}", hash.digest128())
}

/// The option by which `diagnose` prints the score map.
const SCORES: &str = "--scores";

/// The score maps from which a campaign with `refits` takes its tasks; none for another.
pub(super) fn looks(spec: &Spec) -> Result<Vec<Task>, CampaignError> {
    if spec.refits == 0 {
        return Ok(vec![]);
    }
    let mut maps = Spec { verb: "diagnose".into(), ..spec.clone() };
    maps.arguments.push(SCORES.into());
    list(&maps)
}

/// The best candidates of each score map, one refit a task. A map that failed, or has no candidate, stands for itself.
pub(super) fn refits(spec: &Spec, looks: &[Task], records: &[Option<Record>]) -> Vec<Task> {
    let mut all = Vec::new();
    for (look, record) in looks.iter().zip(records) {
        let scores = record.as_ref().filter(|r| r.reason.is_none()).and_then(|r| r.result["scores"].as_array());
        let tasks: Vec<Task> = scores.into_iter().flatten().take(spec.refits).filter_map(|s| refit(look, s)).collect();
        if tasks.is_empty() { all.push(look.clone()) } else { all.extend(tasks) }
    }
    all
}

/// The refit of one candidate, as `diagnose --scores` prints it, with the arguments of its map. Its shapes are left to `add`, which tries several.
fn refit(look: &Task, scored: &Value) -> Option<Task> {
    let (effect, at) = (scored["effect"].as_str()?, scored["at"].as_str()?);
    let mut arguments = vec![effect.to_string(), "--at".into(), at.to_string()];
    for option in ["of", "condition", "reference"] {
        arguments.extend(scored["target"][option].as_str().into_iter().flat_map(|v| [format!("--{option}"), v.to_string()]));
    }
    arguments.extend(look.arguments.iter().filter(|a| *a != SCORES).cloned());
    let mut task = Task { verb: ADD.into(), arguments, ..look.clone() };
    let of = scored["of"].as_str().map_or(String::new(), |of| format!(" ({of})"));
    task.label = format!("{} {effect} at {at}{of}", look.label);
    task.axes.extend([(EFFECT.to_string(), effect.to_string()), ("--at".into(), format!("{at}{of}"))]);
    // The map stands for all that it was made of.
    task.id = id(&task, u128::from_str_radix(&look.id, 16).ok()?);
    Some(task)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refit_has_the_arguments_of_its_map() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("refits.toml");
        let text = "schema = 1\nverb = \"add\"\nstudies = [\".\"]\nrefits = 2\narguments = [\"--data\", \"raw\"]\n[grid]\n\"--max-seconds\" = [5, 9]\n";
        std::fs::write(&file, text).unwrap();
        let spec = Spec::load(&file).unwrap();
        let looks = looks(&spec).unwrap();
        assert_eq!(looks[1].arguments, ["--data", "raw", "--scores", "--max-seconds", "9"]);
        let target = serde_json::json!({ "of": "viscous.c", "condition": "i", "reference": "0.3 mm" });
        let scored = serde_json::json!({ "effect": "interference_law", "at": "c1.x", "of": "viscous.c over i", "target": target });
        let of = |look: &Task| refit(look, &scored).unwrap();
        let words = ["interference_law", "--at", "c1.x", "--of", "viscous.c", "--condition", "i", "--reference", "0.3 mm"];
        assert_eq!(of(&looks[1]).arguments, [&words[..], &["--data", "raw", "--max-seconds", "9"]].concat());
        assert!(of(&looks[0]).id != of(&looks[1]).id && of(&looks[0]).id != looks[0].id);
    }
}
