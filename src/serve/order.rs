//! What a page asks to be done, and the command line that does the same.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::study::run::{RunFolder, runs_of};

use super::bench::{Bench, ROOT};

/// What is to be done.
#[derive(Deserialize, Serialize, Debug, Clone, Default)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// One of [`VERBS`].
    pub verb: String,
    /// Model of the tree to begin from.
    pub model: String,
    /// Of `add`: the effect...
    #[serde(default)]
    pub effect: String,
    /// ...and its place.
    #[serde(default)]
    pub at: String,
    /// Of `export`: the formats.
    #[serde(default)]
    pub to: Vec<String>,
    /// Starts with unit.
    #[serde(default)]
    pub set: Vec<(String, String)>,
    /// Of a coefficient: the parameter it scales.
    pub of: Option<String>,
    /// Of a coefficient: the condition.
    pub condition: Option<String>,
    /// Of a coefficient: its reference.
    pub reference: Option<String>,
    /// Values to begin from, `instance.parameter` [SI].
    #[serde(default)]
    pub values: BTreeMap<String, f64>,
    /// Of `add`: another effect that the same model gets, to be seen beside the first.
    #[serde(default)]
    pub other: Option<Box<Order>>,
    /// Of `profile`: the parameter.
    #[serde(default)]
    pub parameter: String,
    /// The file of the study, where that is not study.toml; the server says it.
    #[serde(default)]
    pub study_file: Option<String>,
    /// The run that is gone on with.
    #[serde(default)]
    pub resume: Option<String>,
}

/// File of a run folder that holds the order while the run is under way.
pub const ORDER: &str = "workbench.json";

/// Bytes of it at most, as of a request.
pub const ORDER_BYTES: u64 = 256 << 10;

/// What can be set going.
pub const VERBS: [&str; 7] = ["fit", "add", "score", "ladder", "export", "profile", "resume"];

/// The command line that does the same; `starts` are the values that the order begins from, as `--start` is given them.
pub fn command(bench: &Bench, order: &Order, starts: &[String]) -> String {
    let folder = if bench.path.is_dir() { bench.path.clone() } else { bench.path.parent().map(PathBuf::from).unwrap_or_default() };
    let runs = runs_of(&folder);
    let run = |name: &str| quoted(&runs.join(name).display().to_string());
    let study = if order.model == ROOT { quoted(&bench.path.display().to_string()) } else { run(&order.model) };
    let mut line = match order.verb.as_str() {
        "score" => format!("misfit diagnose {study} --scores"),
        "profile" => format!("misfit fit {study} --profile {}", quoted(&order.parameter)),
        verb => format!("misfit {verb} {study}"),
    };
    if order.verb == "add" {
        // The page changes neither the reader's study.toml nor the record of a run.
        line += &format!(" {} --at {} --keep-study", quoted(&order.effect), quoted(&order.at));
        for (name, value) in &order.set {
            line += &format!(" --set {}", quoted(&format!("{name}={value}")));
        }
        for (option, value) in [("--of", &order.of), ("--condition", &order.condition), ("--reference", &order.reference)] {
            line += &value.as_ref().map_or(String::new(), |v| format!(" {option} {}", quoted(v)));
        }
    }
    if order.verb == "export" {
        line += &format!(" --to {}", order.to.join(","));
    }
    if let Some(resume) = &order.resume {
        let old = RunFolder::at(runs.join(resume));
        // A run that has kept nothing is begun anew.
        let kept = match order.verb.as_str() {
            "fit" => old.checkpoint().is_file(),
            "ladder" => old.journal().is_file(),
            _ => false,
        };
        line += &if kept { format!(" --resume {}", run(resume)) } else { String::new() };
    }
    line += &starts.iter().map(|s| format!(" --start {}", quoted(s))).collect::<String>();
    line += &options(bench);
    let other = order
        .other
        .as_ref()
        .map(|o| command(bench, &Order { verb: order.verb.clone(), model: order.model.clone(), other: None, ..(**o).clone() }, starts));
    other.map_or(line.clone(), |o| format!("{line} && {o}"))
}

/// What every command line on the study ends with: the seed and the folder of the raw files, where the server was given them.
pub fn options(bench: &Bench) -> String {
    let seed = if bench.seed == 1 { String::new() } else { format!(" --seed {}", bench.seed) };
    seed + &bench.data.as_ref().map_or(String::new(), |d| format!(" --data {}", quoted(&d.display().to_string())))
}

/// A word as a shell takes it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=+,@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_words_of_a_shell() {
        assert_eq!(quoted("studies/01"), "studies/01");
        assert_eq!(quoted("a b"), "'a b'");
        assert_eq!(quoted("it's $HOME"), "'it'\\''s $HOME'");
        let bench = Bench::new("a".into(), PathBuf::from("my study/study.toml"), None, 2);
        let set = vec![("d".to_string(), "0.07 mm".to_string())];
        let order = Order {
            verb: "add".into(),
            model: "20261124-112100-fit".into(),
            effect: "coulomb".into(),
            at: "c1.x".into(),
            set,
            ..Order::default()
        };
        assert_eq!(
            command(&bench, &order, &["c1.x.viscous.c=120 N s/m".into()]),
            "misfit add 'my study/runs/20261124-112100-fit' coulomb --at c1.x --keep-study --set 'd=0.07 mm' --start 'c1.x.viscous.c=120 N s/m' --seed 2"
        );
    }
}
