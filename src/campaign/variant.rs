//! A study with some of its values replaced, and what its files hold.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use toml::{Table, Value};
use xxhash_rust::xxh3::Xxh3;

use crate::limits;

/// Sets a value of a study: by the name of a parameter (`c1.x.viscous.c`, its start), or by the path of a key (`fit.loss`, `prediction.0.mode`).
pub(super) fn set(study: &mut Table, key: &str, value: &Value) -> Result<(), String> {
    if let Some(parameter) = parameter(study, key) {
        match parameter {
            Value::Table(t) => drop(t.insert("start".into(), value.clone())),
            other => *other = value.clone(),
        }
        return Ok(());
    }
    let mut steps = key.split('.').collect::<Vec<_>>();
    let last = steps.pop().unwrap_or_default();
    let none = |step: &str| format!("the study has neither a parameter `{key}` nor a key `{step}`");
    // A table such as [fit] need not stand in the study for one of its keys to be set.
    if let ([table], false) = (steps.as_slice(), study.contains_key(steps.first().copied().unwrap_or_default())) {
        study.insert((*table).into(), Value::Table(Table::new()));
    }
    let mut at = study;
    let mut inside = steps.into_iter();
    while let Some(step) = inside.next() {
        let next = at.get_mut(step).ok_or_else(|| none(step))?;
        at = match next {
            Value::Table(t) => t,
            Value::Array(list) => {
                let index = inside.next().and_then(|s| s.parse::<usize>().ok());
                match index.and_then(|k| list.get_mut(k)) {
                    Some(Value::Table(t)) => t,
                    _ => return Err(format!("`{key}` needs the number of a table of [[{step}]], from 0")),
                }
            }
            _ => return Err(none(step)),
        };
    }
    at.insert(last.into(), value.clone());
    Ok(())
}

/// The parameter of an `[[effect]]`: `at.effect.parameter`, `effect#2` for the second of its kind at the place.
fn parameter<'a>(study: &'a mut Table, key: &str) -> Option<&'a mut Value> {
    let (rest, parameter) = key.rsplit_once('.')?;
    let (at, effect) = rest.rsplit_once('.')?;
    let (effect, number) = effect.split_once('#').map_or((effect, 1), |(e, n)| (e, n.parse().unwrap_or(0)));
    let places = |t: &Table| match t.get("at") {
        Some(Value::String(s)) => s.clone(),
        Some(Value::Array(a)) => a.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(","),
        _ => String::new(),
    };
    let Some(Value::Array(effects)) = study.get_mut("effect") else { return None };
    let tables = effects.iter_mut().filter_map(Value::as_table_mut);
    let mut same = tables.filter(|t| t.get("effect").and_then(Value::as_str) == Some(effect) && places(t) == at);
    same.nth(usize::checked_sub(number, 1)?)?.get_mut(parameter)
}

/// Makes the paths of a study that stands in `folder` hold from anywhere.
pub(super) fn absolute(study: &mut Table, folder: &Path) {
    let whole = |v: &mut Value| {
        if let Value::String(s) = v {
            let path = folder.join(&*s);
            *s = path.canonicalize().unwrap_or(path).display().to_string();
        }
    };
    for key in ["dataset", "folder"] {
        study.get_mut(key).into_iter().for_each(whole);
    }
    if let Some(Value::Array(rungs)) = study.get_mut("rungs") {
        rungs.iter_mut().for_each(whole);
    }
    if let Some(Value::Table(t)) = study.get_mut("tolerance") {
        t.get_mut("dataset").into_iter().for_each(whole);
    }
}

/// Hashes of files, each read once.
#[derive(Default)]
pub(super) struct Contents {
    known: BTreeMap<PathBuf, u128>,
}

impl Contents {
    /// The hash of a study with its dataset, raw files, cases and rungs: what is not there counts as such.
    pub fn study(&mut self, path: &Path) -> u128 {
        let mut files = Vec::new();
        of_study(path, &mut files, 0);
        let mut hash = Xxh3::new();
        for file in files {
            hash.update(&self.file(&file).to_le_bytes());
        }
        hash.digest128()
    }

    fn file(&mut self, path: &Path) -> u128 {
        if let Some(known) = self.known.get(path) {
            return *known;
        }
        let mut hash = Xxh3::new();
        if let Ok(mut file) = limits::open(path) {
            let mut buffer = vec![0; 1 << 16];
            while let Ok(n) = std::io::Read::read(&mut file, &mut buffer) {
                if n == 0 {
                    break;
                }
                hash.update(&buffer[..n]);
            }
        }
        let digest = hash.digest128();
        self.known.insert(path.to_path_buf(), digest);
        digest
    }
}

fn read(path: &Path) -> Table {
    limits::text(path).ok().and_then(|t| t.parse().ok()).unwrap_or_default()
}

fn inside(path: PathBuf, name: &str) -> PathBuf {
    if path.is_dir() { path.join(name) } else { path }
}

fn of_study(path: &Path, files: &mut Vec<PathBuf>, depth: usize) {
    let file = inside(path.to_path_buf(), "study.toml");
    let folder = file.parent().unwrap_or(Path::new("")).to_path_buf();
    let study = read(&file);
    files.push(file);
    let text = |t: &Table, key: &str| t.get(key).and_then(Value::as_str).map(|s| folder.join(s));
    let raw = text(&study, "folder");
    for dataset in [text(&study, "dataset"), study.get("tolerance").and_then(Value::as_table).and_then(|t| text(t, "dataset"))] {
        dataset.into_iter().for_each(|d| of_dataset(d, raw.as_deref(), files));
    }
    // A rung of a rung of ... ends.
    if depth < 4 {
        let rungs = study.get("rungs").and_then(Value::as_array);
        rungs.into_iter().flatten().filter_map(Value::as_str).for_each(|r| of_study(&folder.join(r), files, depth + 1));
    }
}

fn of_dataset(path: PathBuf, raw: Option<&Path>, files: &mut Vec<PathBuf>) {
    let file = inside(path, "dataset.toml");
    let beside = file.parent().unwrap_or(Path::new("")).to_path_buf();
    let dataset = read(&file);
    files.push(file);
    let folder =
        raw.map_or_else(|| dataset.get("folder").and_then(Value::as_str).map_or(beside.clone(), |f| beside.join(f)), Path::to_path_buf);
    let tests = dataset.get("test").and_then(Value::as_array);
    let named = tests.into_iter().flatten().filter_map(|t| t.get("file")?.as_str());
    files.extend(named.map(|n| folder.join(n)));
}

#[cfg(test)]
mod tests {
    use super::*;

    const STUDY: &str = "dataset = \"data\"\n[fit]\nstarts = 1\n[[effect]]\neffect = \"viscous\"\nat = \"c1.x\"\nc = { start = \"1 N s/m\", min = \"0 N s/m\" }\n\
                         [[effect]]\neffect = \"viscous\"\nat = \"c1.x\"\nc = \"2 N s/m\"\n[[prediction]]\nmode = 1\n";

    #[test]
    fn parameters_by_name_and_keys_by_path() {
        let mut study: Table = STUDY.parse().unwrap();
        set(&mut study, "c1.x.viscous.c", &"5 N s/m".into()).unwrap();
        set(&mut study, "c1.x.viscous#2.c", &"6 N s/m".into()).unwrap();
        set(&mut study, "fit.loss", &"huber".into()).unwrap();
        set(&mut study, "search.max_added", &Value::Integer(1)).unwrap();
        assert_eq!(study["search"]["max_added"].as_integer(), Some(1));
        set(&mut study, "prediction.0.mode", &Value::Integer(2)).unwrap();
        let effects = study["effect"].as_array().unwrap();
        assert_eq!(effects[0]["c"]["start"].as_str(), Some("5 N s/m"));
        assert_eq!(effects[0]["c"]["min"].as_str(), Some("0 N s/m"));
        assert_eq!(effects[1]["c"].as_str(), Some("6 N s/m"));
        assert_eq!(study["fit"]["loss"].as_str(), Some("huber"));
        assert_eq!(study["prediction"][0]["mode"].as_integer(), Some(2));
        let e = set(&mut study, "c9.x.viscous.c", &"1".into()).unwrap_err();
        assert!(e.contains("neither a parameter `c9.x.viscous.c`"), "{e}");
        assert!(set(&mut study, "prediction.7.mode", &"1".into()).is_err());
    }

    /// A file that is moved keeps its name, one that is changed does not.
    #[test]
    fn a_study_is_named_by_what_its_files_hold() {
        let write = |folder: &Path, loop_: &str| {
            std::fs::create_dir_all(folder.join("data")).unwrap();
            std::fs::write(folder.join("study.toml"), STUDY).unwrap();
            std::fs::write(folder.join("data/dataset.toml"), "[[test]]\nfile = \"a.csv\"\n").unwrap();
            std::fs::write(folder.join("data/a.csv"), loop_).unwrap();
            Contents::default().study(folder)
        };
        let dir = tempfile::tempdir().unwrap();
        let first = write(&dir.path().join("a"), "t,x\n0,1\n");
        assert_eq!(first, write(&dir.path().join("b"), "t,x\n0,1\n"));
        assert_ne!(first, write(&dir.path().join("b"), "t,x\n0,2\n"));
    }
}
