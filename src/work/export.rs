//! The calibrated set in the formats of other programs, written into the folder of a run.

use std::collections::BTreeMap;

use crate::data::Test;
use crate::diagnose::Fitted;
use crate::diagnose::results::FitResult;
use crate::export::{CalibratedSet, EXPORTERS, Source};
use crate::model::Level;
use crate::study::Study;
use crate::study::run::RunFolder;

use super::Failure;

/// The test at whose conditions and loads a mechanism is exported.
pub struct Stand {
    /// Its id.
    pub test: String,
    /// Its conditions [SI].
    pub conditions: BTreeMap<String, f64>,
    /// The same as they are stated.
    pub described: String,
}

impl Stand {
    /// The test of this id; without one the first under a load, else the first.
    pub fn of(study: &Study, test: Option<&str>) -> Result<Stand, Failure> {
        let tests = &study.dataset.tests;
        let conditions = |t: &Test| -> BTreeMap<String, f64> { t.conditions.iter().map(|(k, c)| (k.clone(), c.value)).collect() };
        let loaded = |t: &&Test| {
            let stated = |l: &Level| matches!(l, Level::Condition(name, _) if t.conditions.contains_key(name));
            study.system.model.loads.iter().any(|l| l.path.iter().any(stated))
        };
        let test = match test {
            Some(id) => tests.iter().find(|t| t.id == id).ok_or_else(|| {
                let known: Vec<&str> = tests.iter().map(|t| t.id.as_str()).collect();
                Failure::new("export", "--test", format!("there is no test `{id}`"), known.join(", "))
            })?,
            None => tests.iter().find(loaded).or(tests.first()).ok_or_else(|| {
                Failure::new(
                    "export",
                    "--to",
                    "the dataset has no test whose conditions a mechanism could stand at",
                    "at least one [[test]]",
                )
            })?,
        };
        let described: Vec<String> = test.conditions.iter().map(|(k, c)| format!("{k} = {}", c.unit.print(c.value))).collect();
        Ok(Stand { test: test.id.clone(), conditions: conditions(test), described: described.join(", ") })
    }
}

/// Writes the set in these formats; the files, and what a format cannot hold.
pub fn export(
    study: &Study,
    fitted: &Fitted,
    result: &FitResult,
    at: &Stand,
    formats: &[&str],
    folder: &RunFolder,
) -> Result<(Vec<String>, Vec<String>), Failure> {
    let spread = fitted.uncertainty()?;
    let source = crate::limits::bytes(&study.file, crate::limits::CONFIG_BYTES)
        .map_err(|e| Failure::new("study", study.file.display().to_string(), e.to_string(), "a study.toml that can be read"))?;
    let set = CalibratedSet::new(&source, result, fitted, &spread.covariance);
    folder.study(study, &fitted.system)?;
    let (mut files, mut notes): (Vec<String>, Vec<String>) = (vec![], vec![]);
    let of = Source { set: &set, system: &fitted.system, test: &at.test, conditions: &at.conditions, described: &at.described };
    for exporter in EXPORTERS.iter().filter(|e| formats.contains(&e.name())) {
        let exported = exporter.files(&of)?;
        for (name, bytes) in exported.files {
            files.push(folder.write(&name, &bytes)?.display().to_string());
        }
        notes.extend(exported.notes.into_iter().map(|note| format!("{}: {note}", exporter.name())));
    }
    Ok((files, notes))
}
