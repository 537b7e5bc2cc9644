//! campaign.toml.

use std::path::{Path, PathBuf};

use crate::data::toml_strict::{TableView, TomlError, TomlFile, ValueView};

use super::CampaignError;
use super::list::{ADD, EFFECT};

/// Verbs that a campaign may run.
pub const VERBS: [&str; 9] = ["check", "compare", "fit", "diagnose", "add", "ladder", "predict", "tolerance", "trial"];

/// An axis of the grid: its key and its values as TOML.
pub(super) type Axis = (String, Vec<String>);

/// One task beside the grid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Variant {
    pub name: String,
    pub study: Option<String>,
    pub seed: Option<u64>,
    /// Key and value as TOML.
    pub set: Vec<(String, String)>,
    pub arguments: Vec<String>,
}

/// A campaign as its file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// campaign.toml.
    pub file: PathBuf,
    /// Title.
    pub title: String,
    /// Verb of every task.
    pub verb: String,
    pub(super) studies: Vec<String>,
    pub(super) arguments: Vec<String>,
    /// How often a failed task is tried again.
    pub retries: usize,
    /// Threads of a task.
    pub threads: usize,
    /// Whether the folders of the runs are kept.
    pub keep_runs: bool,
    /// Tasks among which what a run draws is divided.
    pub shares: usize,
    /// Candidates of each study's score map that are refitted; 0 where the list says what is added.
    pub refits: usize,
    pub(super) grid: Vec<Axis>,
    pub(super) variants: Vec<Variant>,
}

/// Most tasks of one campaign.
const MOST: usize = 1_000_000;
/// Most candidates of one score map.
const REFITS: i64 = 10_000;
/// Most shares of one run.
const SHARES: i64 = 10_000;

impl Spec {
    /// Reads campaign.toml.
    pub fn load(file: &Path) -> Result<Spec, CampaignError> {
        let toml = TomlFile::read(file, "campaign")?;
        let root = toml.root();
        root.only(&[
            "schema",
            "title",
            "verb",
            "studies",
            "arguments",
            "retries",
            "threads",
            "keep_runs",
            "shares",
            "refits",
            "grid",
            "variant",
        ])?;
        crate::data::schema(&root)?;
        let words = VERBS.map(|v| (v, v));
        let verb = root.require("verb", "\"fit\"")?.word("verb", &words)?;
        let studies = strings(&root, "studies")?;
        let mut grid: Vec<Axis> = Vec::new();
        if let Some(v) = root.get("grid") {
            for (key, values) in v.table()?.entries() {
                let list = values.list()?;
                if list.is_empty() {
                    return Err(values.refuse("an axis without values", "at least one value").into());
                }
                if key == "seed" {
                    list.iter().try_for_each(|v| seed(v).map(drop))?;
                }
                grid.push((key.to_string(), list.iter().map(ValueView::to_toml).collect()));
            }
        }
        let variants = root.tables("variant")?.iter().map(variant).collect::<Result<Vec<Variant>, TomlError>>()?;
        let crossed = (!grid.is_empty() || variants.is_empty() || studies.len() > 1) && (verb == "trial" || !studies.is_empty());
        let n = if crossed { grid.iter().try_fold(studies.len().max(1), |n, a| n.checked_mul(a.1.len())) } else { Some(0) };
        let n = n.and_then(|n| n.checked_add(variants.len()));
        match n {
            Some(0) => return Err(root.refuse("the campaign has no task", "studies = [...], or [[variant]] with study").into()),
            Some(n) if n <= MOST => {}
            _ => return Err(root.refuse("the campaign has too many tasks", format!("at most {MOST}")).into()),
        }
        if verb != "trial" {
            for (k, table) in root.tables("variant")?.iter().enumerate() {
                if variants[k].study.is_none() && studies.len() != 1 {
                    return Err(table.refuse("the variant names no study", "study = \"...\", or one study for all").into());
                }
            }
        }
        let refits = root.optional("refits", |v| v.integer(1, REFITS))?.map_or(0, |n| n as usize);
        let says = [EFFECT, "--at"].into_iter().find(|key| grid.iter().any(|a| a.0 == *key));
        if refits > 0 && (verb != ADD || says.is_some()) {
            let why = says
                .map_or(format!("`refits` are of `{ADD}`, not of `{verb}`"), |key| format!("`refits` and `{key}` both say what is added"));
            return Err(root.refuse(why, format!("verb = \"{ADD}\" with `refits`, or with `effect` and `--at` under [grid]")).into());
        }
        let named = file.file_stem().map_or("campaign".into(), |n| n.to_string_lossy().into_owned());
        Ok(Spec {
            file: file.to_path_buf(),
            title: root.optional("title", |v| v.string())?.map_or(named, str::to_string),
            verb: verb.to_string(),
            studies,
            arguments: strings(&root, "arguments")?,
            retries: root.optional("retries", |v| v.integer(0, 1000))?.map_or(0, |n| n as usize),
            threads: root.optional("threads", |v| v.integer(1, 1000))?.map_or(1, |n| n as usize),
            keep_runs: root.optional("keep_runs", |v| v.bool())?.unwrap_or(false),
            shares: root.optional("shares", |v| v.integer(1, SHARES))?.map_or(1, |n| n as usize),
            refits,
            grid: if crossed { grid } else { vec![] },
            variants,
        })
    }

    /// Folder of the results where none is named: beside the file.
    pub fn folder(&self) -> PathBuf {
        let stem = self.file.file_stem().map_or("campaign".into(), |n| n.to_string_lossy().into_owned());
        self.file.with_file_name(format!("{stem}-results"))
    }

    /// Whether studies and grid are crossed: not where variants alone are listed, of one study.
    pub(super) fn crossed(&self) -> bool {
        !self.grid.is_empty() || self.variants.is_empty() || self.studies.len() > 1
    }

    /// A study's path.
    pub(super) fn path(&self, study: &str) -> PathBuf {
        self.file.parent().unwrap_or(Path::new("")).join(study)
    }
}

fn seed(v: &ValueView<'_>) -> Result<u64, TomlError> {
    v.integer(0, i64::MAX).map(|n| n as u64)
}

fn strings(table: &TableView<'_>, key: &str) -> Result<Vec<String>, TomlError> {
    Ok(table.optional(key, |v| v.strings())?.unwrap_or_default().into_iter().map(str::to_string).collect())
}

fn variant(table: &TableView<'_>) -> Result<Variant, TomlError> {
    table.only(&["name", "study", "seed", "set", "arguments"])?;
    let set = match table.get("set") {
        Some(v) => v.table()?.entries().map(|(k, v)| (k.to_string(), v.to_toml())).collect(),
        None => vec![],
    };
    Ok(Variant {
        name: table.string("name")?.to_string(),
        study: table.optional("study", |v| v.string())?.map(str::to_string),
        seed: table.optional("seed", |v| seed(&v))?,
        set,
        arguments: strings(table, "arguments")?,
    })
}
