//! A ladder into the folder of its run. Its last rung is kept there, so that a ladder that is killed can be gone on with.

use std::path::Path;

use crate::data::toml_strict::TomlFile;
use crate::diagnose::results::{EffectAt, LadderResult};
use crate::diagnose::{self, Case};
use crate::identify::Monitor;
use crate::model::{Instance, System};
use crate::study::run::RunFolder;
use crate::study::{Study, StudyError};

use super::{Failure, report};

/// The model of a study.toml over the dataset of this study.
///
/// # Errors
/// A file that cannot be read, or is no study of this dataset.
pub fn model(study: &Study, file: &Path) -> Result<System, Failure> {
    let file = TomlFile::read(file, "study").map_err(StudyError::from)?;
    Ok(Study::from_toml(&file, study.dataset.clone())?.system)
}

/// The case with the model that an earlier ladder has left in `run`, the folder of its run.
///
/// # Errors
/// Where it has left none.
pub fn gone_on(study: &Study, case: &Case, run: &Path) -> Result<Case, Failure> {
    let Some(file) = RunFolder::at(run).left() else {
        let message = "no rung of an earlier ladder is kept here";
        return Err(Failure::new("study", run.display().to_string(), message, "the folder of a `ladder` that had added an effect"));
    };
    let left = model(study, &file)?;
    let found: Vec<Instance> = left.beyond(&study.system).into_iter().filter(|i| !diagnose::deviates(i.effect)).cloned().collect();
    // Laws that act on others know these by their place in the model: with them it is begun with as a whole.
    let own = study.system.instances.len();
    if found.iter().any(|i| i.target.is_some()) {
        return Ok(Case { system: left, ..case.clone() });
    }
    let is = |i: &Instance| found.iter().any(|f| (f.name(), &f.at) == (i.name(), &i.at));
    let mut system = left.clone();
    for k in (own..left.instances.len()).rev().filter(|k| is(&left.instances[*k])) {
        let Some(less) = system.without(k) else { return Ok(Case { system: left, ..case.clone() }) };
        system = less;
    }
    Ok(Case { system, found, ..case.clone() })
}

/// Climbs from the model of `case`, and writes study, residuals and report into the folder. What is there at a rung is kept as soon as it stands.
///
/// # Errors
/// A ladder that cannot begin, files that cannot be written.
pub fn ladder(
    study: &Study,
    case: &Case,
    folder: &RunFolder,
    monitor: &Monitor,
    say: &(dyn Fn(&str) + Sync),
) -> Result<(LadderResult, System), Failure> {
    let began: Vec<&Instance> = case.system.beyond(&study.system).into_iter().chain(&case.found).collect();
    let began_with: Vec<EffectAt> = began.iter().map(|i| EffectAt::of(&case.system, i)).collect();
    let keep = |system: &System| {
        if let Err(e) = folder.rung(study, system) {
            say(&format!("the model of this rung cannot be kept: {e}"));
        }
    };
    say("first fit");
    if !began.is_empty() {
        let mut system = case.system.clone();
        system.instances.extend(case.found.iter().cloned());
        keep(&system);
    }
    let (mut result, system) = diagnose::ladder_keeping(case, monitor, &|step: &str| say(step), &keep)?;
    // Of the study, not of the case: a rung that was kept has the bounds of the search that left it.
    let system = diagnose::unbounded(&study.system, system);
    result.began_with = began_with;
    result.result_study = Some(folder.path.display().to_string());
    folder.study(study, &system)?;
    if let Some(last) = result.rungs.last() {
        folder.residuals(&last.tests)?;
    }
    report(folder, study, &system, None, None, Some(&result))?;
    Ok((result, system))
}
