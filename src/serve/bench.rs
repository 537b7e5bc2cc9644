//! A study that is served: its case, and the tree of its models. A model is a run; the study as it stands is the root.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use serde_json::{Value, json};
use tokio::sync::broadcast;

use crate::diagnose::results::{FitResult, SplitName};
use crate::diagnose::{Case, Fitted};
use crate::model::System;
use crate::study::Study;
use crate::study::run::{FROM_RUN, RunFolder, STUDY_FILE, is_run, runs_of};
use crate::work::{self, Failure};

use super::curves::pooled;
use super::job::{Events, Job};
use super::order::{ORDER, ORDER_BYTES, Order};

/// Name of the root of the tree.
pub const ROOT: &str = "study";
/// Runs that are shown, the latest.
const SHOWN: usize = 200;
/// Bytes of a result that is read for the tree.
const RESULT_BYTES: u64 = 64 << 20;

/// A study of the server.
pub struct Bench {
    /// Name in addresses.
    pub id: String,
    /// study.toml, or its folder.
    pub path: PathBuf,
    /// Folder of the raw files.
    pub data: Option<PathBuf>,
    /// Seed.
    pub seed: u64,
    /// Its events.
    pub events: Events,
    loaded: Mutex<Option<Arc<Loaded>>>,
    jobs: Mutex<Vec<Arc<Job>>>,
}

/// A study that was read.
pub struct Loaded {
    /// The study.
    pub study: Study,
    /// Its case, in as many time steps as its model needs.
    pub case: Case,
    changed: Option<SystemTime>,
    tree: Mutex<Tree>,
}

#[derive(Default)]
struct Tree {
    nodes: BTreeMap<String, Node>,
    /// Runs without a result.
    open: Vec<Unfinished>,
    /// Profiles by the model they are of.
    profiles: BTreeMap<String, Vec<Value>>,
    held_out_opened: Vec<Value>,
    /// Runs whose result is known.
    read: BTreeSet<String>,
    /// Runs that another went on with.
    taken_up: BTreeSet<String>,
}

/// A run without a result: it was killed, or is under way elsewhere.
#[derive(Clone, serde::Serialize)]
pub struct Unfinished {
    /// Name of its folder.
    pub id: String,
    /// Its verb.
    pub verb: String,
    /// Whether something in it lets it be gone on with: the order, or the best state of a fit.
    pub goes_on: bool,
    /// The run that it went on with itself.
    #[serde(skip)]
    resumes: Option<String>,
}

/// A model of the tree.
#[derive(Clone)]
struct Node {
    parent: Option<String>,
    verb: String,
    result: Arc<Value>,
    model: Option<Arc<Model>>,
}

/// What is known of a model in this process.
#[derive(Clone)]
pub struct Model {
    /// The system at its values.
    pub system: System,
    /// The case, in as many time steps as it needs.
    pub case: Case,
    /// Its fit.
    pub fitted: Option<Fitted>,
    /// What that fit came to, for the splits that could be seen then.
    pub result: Option<Arc<FitResult>>,
    /// Its score map.
    pub marks: Option<Arc<Value>>,
}

fn lock<T>(m: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is behind these locks is replaced as a whole; a thread that died left the old.
    m.lock().unwrap_or_else(PoisonError::into_inner)
}

static NEXT: AtomicU64 = AtomicU64::new(1);

impl Bench {
    /// A study that is read when it is first asked for.
    pub fn new(id: String, path: PathBuf, data: Option<PathBuf>, seed: u64) -> Bench {
        let (events, _) = broadcast::channel(512);
        Bench { id, path, data, seed, events, loaded: Mutex::default(), jobs: Mutex::default() }
    }

    /// The study, read again where its file has changed and nothing runs on it.
    pub fn loaded(&self) -> Result<Arc<Loaded>, Failure> {
        let mut slot = lock(&self.loaded);
        let file = if self.path.is_dir() { self.path.join("study.toml") } else { self.path.clone() };
        let changed = std::fs::metadata(&file).and_then(|m| m.modified()).ok();
        if let Some(loaded) = slot.as_ref()
            && (loaded.changed == changed || self.running().is_some())
        {
            return Ok(loaded.clone());
        }
        let study = Study::load(&self.path, self.data.as_deref())?;
        let case = Case::from_study(&study, self.seed)?;
        let case = case.refined(&case.system).unwrap_or(case);
        let root = Model { system: case.system.clone(), case: case.clone(), fitted: None, result: None, marks: None };
        let effects: Vec<Value> = case.system.instances.iter().map(|i| json!({ "effect": i.name(), "at": i.at })).collect();
        let result = Arc::new(json!({ "effects": effects }));
        let root = Node { parent: None, verb: ROOT.into(), result, model: Some(Arc::new(root)) };
        let tree = Tree { nodes: [(ROOT.to_string(), root)].into_iter().collect(), ..Tree::default() };
        let loaded = Arc::new(Loaded { study, case, changed, tree: Mutex::new(tree) });
        *slot = Some(loaded.clone());
        Ok(loaded)
    }

    /// The job that runs.
    pub fn running(&self) -> Option<Arc<Job>> {
        lock(&self.jobs).iter().find(|j| !j.over()).cloned()
    }

    /// A job by its number.
    pub fn job(&self, id: u64) -> Option<Arc<Job>> {
        lock(&self.jobs).iter().find(|j| j.id == id).cloned()
    }

    /// Jobs of this process, the last first.
    pub fn jobs(&self) -> Vec<Value> {
        lock(&self.jobs).iter().rev().take(20).map(|j| j.json()).collect()
    }

    /// Enters a job, unless one runs.
    pub fn enter(&self, verb: &str, model: &str, command: String) -> Result<Arc<Job>, Failure> {
        let mut jobs = lock(&self.jobs);
        if let Some(busy) = jobs.iter().find(|j| !j.over()) {
            let message = format!("`{}` is running on this study", busy.verb);
            return Err(Failure::new("serve", &self.id, message, "to wait for it, or to stop it"));
        }
        let job = Arc::new(Job::new(NEXT.fetch_add(1, Ordering::Relaxed), verb, model, command, self.events.clone()));
        if jobs.len() >= 50 {
            jobs.remove(0);
        }
        jobs.push(job.clone());
        Ok(job)
    }

    /// Tells every page that the tree has changed.
    pub fn changed(&self) {
        // Nobody may be listening.
        let _ = self.events.send(json!({ "type": "tree" }).to_string().into());
    }
}

impl Loaded {
    /// Folder of the runs.
    pub fn runs(&self) -> PathBuf {
        runs_of(&self.study.folder)
    }

    /// The file of the study, where it is not study.toml: several studies of one folder share its runs.
    pub fn study_file(&self) -> Option<String> {
        let name = self.study.file.file_name().map(|n| n.to_string_lossy().into_owned());
        name.filter(|n| n != "study.toml")
    }

    /// Reads runs that were not there before, and forgets those that are gone.
    pub fn refresh(&self) {
        let names = run_names(&self.runs());
        let mut tree = lock(&self.tree);
        tree.nodes.retain(|id, _| id == ROOT || names.contains(id));
        tree.read.retain(|id| names.contains(id));
        let own = self.study_file();
        let fresh: Vec<&String> = names.iter().filter(|n| !tree.read.contains(*n)).collect();
        let mut open = vec![];
        let mut found = vec![];
        for name in fresh {
            let folder = self.runs().join(name);
            let verb = name.get(16..).unwrap_or("").trim_end_matches(|c: char| c.is_ascii_digit() || c == '-').to_string();
            let bytes = crate::limits::bytes(&folder.join("result.json"), RESULT_BYTES).ok();
            let result: Option<Value> = bytes.and_then(|b| serde_json::from_slice(&b).ok());
            match result {
                None => {
                    let order = crate::limits::bytes(&folder.join(ORDER), ORDER_BYTES).ok();
                    let order: Option<Order> = order.and_then(|b| serde_json::from_slice(&b).ok());
                    if order.as_ref().is_some_and(|o| o.study_file != own) {
                        continue;
                    }
                    let folder = RunFolder::at(folder);
                    let goes_on = order.is_some() || folder.checkpoint().is_file() || folder.journal().is_file();
                    open.push(Unfinished { id: name.clone(), verb, goes_on, resumes: order.and_then(|o| o.resume) });
                }
                Some(result) if result[STUDY_FILE].as_str() == own.as_deref() => found.push((name.clone(), verb, result)),
                // Of another study of this folder; it is read once.
                Some(_) => drop(tree.read.insert(name.clone())),
            }
        }
        for (name, verb, result) in found {
            tree.enter(name, verb, result, None);
        }
        tree.open = open;
    }

    /// Enters a run that has just been written.
    pub fn enter(&self, run: &Path, verb: &str, result: Value, model: Model) -> String {
        let name = run.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        lock(&self.tree).enter(name.clone(), verb.into(), result, Some(Arc::new(model)));
        name
    }

    /// A model: as it is known, or read from its run.
    pub fn model(&self, id: &str) -> Result<Arc<Model>, Failure> {
        let known = lock(&self.tree).nodes.get(id).cloned();
        let Some(node) = known else { return Err(Failure::new("serve", id, format!("there is no model `{id}`"), "a model of the tree")) };
        if let Some(model) = node.model {
            return Ok(model);
        }
        let system = work::model(&self.study, &self.runs().join(id).join("study.toml"))?;
        let case = Case { system: system.clone(), ..self.case.clone() };
        let model = Arc::new(Model { system, case, fitted: None, result: None, marks: None });
        self.keep(id, model.clone());
        Ok(model)
    }

    /// A model and its system.
    pub fn own(&self, id: &str) -> Result<(Arc<Model>, System), Failure> {
        let model = self.model(id)?;
        let system = model.system.clone();
        Ok((model, system))
    }

    /// The model that this one was made from, at the values that were fitted to it before an effect was added, where its run has them.
    pub fn before(&self, id: &str) -> Result<(Arc<Model>, System), Failure> {
        let (parent, values) = {
            let tree = lock(&self.tree);
            let node = tree.nodes.get(id);
            let parent = node.and_then(|n| n.parent.clone()).unwrap_or(ROOT.into());
            (parent, node.map_or(Value::Null, |n| n.result["before"]["parameters"].clone()))
        };
        let (model, system) = self.own(&parent)?;
        let fitted =
            |name: &str| values.as_array().and_then(|all| all.iter().find(|p| p["name"] == name)).and_then(|p| p["value"].as_f64());
        Ok((model, system.with_values(fitted)))
    }

    /// Runs without a result.
    pub fn unfinished(&self) -> Vec<Unfinished> {
        lock(&self.tree).open.clone()
    }

    /// Verb of a model whose run was stopped before its end.
    pub fn stopped(&self, id: &str) -> Option<String> {
        let tree = lock(&self.tree);
        let node = tree.nodes.get(id)?;
        interrupted(&node.result).then(|| node.verb.clone())
    }

    /// The model that a run began from, and the order that it was made by where it keeps that.
    pub fn made_by(&self, id: &str) -> (String, Option<Order>) {
        let tree = lock(&self.tree);
        let node = tree.nodes.get(id);
        let order = node.and_then(|n| serde_json::from_value(n.result["workbench"]["order"].clone()).ok());
        (node.and_then(|n| n.parent.clone()).unwrap_or(ROOT.into()), order)
    }

    /// Profiles of the parameters of a model, the latest of each.
    pub fn profiles(&self, id: &str) -> Vec<Value> {
        lock(&self.tree).profiles.get(id).cloned().unwrap_or_default()
    }

    /// Keeps what has become known of a model.
    pub fn keep(&self, id: &str, model: Arc<Model>) {
        if let Some(node) = lock(&self.tree).nodes.get_mut(id) {
            node.model = Some(model);
        }
    }

    /// When and on what the held-out tests were opened; empty: they are sealed.
    pub fn opened(&self) -> Vec<Value> {
        lock(&self.tree).held_out_opened.clone()
    }

    /// Splits that may be seen.
    pub fn splits(&self) -> Vec<SplitName> {
        let mut splits = vec![SplitName::Fit, SplitName::Select];
        if !self.opened().is_empty() {
            splits.push(SplitName::HeldOut);
        }
        splits
    }

    /// Parameters of a model with their intervals, where its run has them.
    pub fn parameters(&self, id: &str) -> Value {
        let tree = lock(&self.tree);
        let Some(node) = tree.nodes.get(id) else { return Value::Null };
        last(&node.result, "parameters").cloned().unwrap_or(Value::Null)
    }

    /// The tree as the page draws it: held-out errors stand in it only where they were opened.
    pub fn tree(&self) -> Value {
        let tree = lock(&self.tree);
        let sealed = tree.held_out_opened.is_empty();
        let node = |(id, n): (&String, &Node)| {
            let r = &n.result;
            let mut errors = last(r, "tests").and_then(Value::as_array).map(|t| pooled(t)).unwrap_or(Value::Null);
            if sealed && errors.is_object() {
                errors["held_out"] = Value::Null;
            }
            let mut said = json!({
                "id": id, "parent": n.parent, "verb": n.verb, "errors": errors, "effects": last(r, "effects"), "added": r["added"],
                "stopped": interrupted(r), "resumed": r["workbench"]["resumed"], "began_with": r["began_with"],
                "termination": last(r, "termination"), "cost": last(r, "cost"), "command": r["workbench"]["command"],
            });
            if let Some(before) = r["before"]["tests"].as_array() {
                said["before"] = pooled(before)["fit"].clone();
            }
            if n.verb == "ladder" {
                for key in [
                    "verdict",
                    "proven",
                    "why",
                    "missing",
                    "instruments",
                    "ended",
                    "interrupted",
                    "next_test",
                    "no_next_test",
                    "unexplained",
                ] {
                    said[key] = r[key].clone();
                }
                let rung = |g: &Value| {
                    json!({ "added": g["added"], "removed": g["removed"], "nats": g["nats"],
                                               "errors": g["tests"].as_array().map(|t| { let mut e = pooled(t); if sealed { e["held_out"] = Value::Null; } e }) })
                };
                said["rungs"] = r["rungs"].as_array().map(|all| all.iter().map(rung).collect::<Vec<_>>()).into();
                said["held_out"] = if sealed { Value::Null } else { r["held_out"].clone() };
                if sealed {
                    said["why"] = Value::Null;
                }
            }
            said
        };
        let taken_up =
            |o: &&Unfinished| tree.taken_up.contains(&o.id) || tree.open.iter().any(|other| other.resumes.as_ref() == Some(&o.id));
        let open: Vec<&Unfinished> = tree.open.iter().filter(|o| !taken_up(o)).collect();
        json!({ "models": tree.nodes.iter().map(node).collect::<Vec<_>>(), "unfinished": open, "held_out_opened": tree.held_out_opened })
    }
}

impl Tree {
    fn enter(&mut self, name: String, verb: String, mut result: Value, model: Option<Arc<Model>>) {
        self.read.insert(name.clone());
        self.taken_up.extend(result["workbench"]["resumed"].as_str().map(String::from));
        if let Some(opened) = result["workbench"].get("held_out_opened").filter(|o| o.is_object()) {
            self.held_out_opened.push(opened.clone());
        }
        // The root of a page that served a run by itself is that run.
        let made_from = result["workbench"]["parent"].as_str().filter(|p| *p != ROOT).or(result[FROM_RUN].as_str());
        let parent = made_from.filter(|p| self.nodes.contains_key(*p)).unwrap_or(ROOT).to_string();
        if let ("profile", Some(fresh)) = (verb.as_str(), result["profiles"].as_array()) {
            let known = self.profiles.entry(parent).or_default();
            known.retain(|k| !fresh.iter().any(|f| f["name"] == k["name"]));
            known.extend(fresh.iter().cloned());
            return;
        }
        if !["fit", "add", "ladder"].contains(&verb.as_str()) {
            return;
        }
        // Curves and candidates stay in the file: the tree needs errors and parameters.
        if let Some(rungs) = result["rungs"].as_array_mut() {
            for rung in rungs.iter_mut().filter_map(Value::as_object_mut) {
                rung.remove("candidates");
            }
        }
        self.nodes.insert(name, Node { parent: Some(parent), verb, result: Arc::new(result), model });
    }
}

/// Whether a run was stopped before its end.
fn interrupted(result: &Value) -> bool {
    result["interrupted"] == true || last(result, "termination").is_some_and(|t| t == "interrupted")
}

/// What the last state of a run says: of an `add` that after it, of a ladder that of its last rung.
fn last<'a>(result: &'a Value, key: &str) -> Option<&'a Value> {
    let states = [Some(result), result.get("after"), result["rungs"].as_array().and_then(|r| r.last())];
    states.into_iter().flatten().find_map(|s| s.get(key)).filter(|v| !v.is_null())
}

/// Names of the run folders, oldest first: the latest of them.
fn run_names(runs: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(runs) else { return vec![] };
    let mut names: Vec<String> = entries
        .filter_map(Result::ok)
        .filter(|e| e.file_type().is_ok_and(|t| t.is_dir()))
        .filter_map(|e| e.file_name().into_string().ok())
        .filter(|n| is_run(n))
        .collect();
    names.sort();
    let from = names.len().saturating_sub(SHOWN);
    names.split_off(from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_run_says_last() {
        let add = json!({ "before": { "cost": 2.0 }, "after": { "cost": 1.0 } });
        assert_eq!(last(&add, "cost"), Some(&json!(1.0)));
        let ladder = json!({ "cost": null, "rungs": [{ "cost": 3.0 }, { "cost": 0.5 }] });
        assert_eq!(last(&json!({ "rungs": ladder["rungs"] }), "cost"), Some(&json!(0.5)));
        assert_eq!(last(&add, "tests"), None);
    }
}
