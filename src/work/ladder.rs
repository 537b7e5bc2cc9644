//! A ladder into the folder of its run, with a journal of its fits there, by which one that was stopped or killed is gone on with.

use std::path::Path;

use crate::data::toml_strict::TomlFile;
use crate::diagnose::results::{EffectAt, LadderResult};
use crate::diagnose::{self, Case};
use crate::identify::Monitor;
use crate::model::System;
use crate::study::run::RunFolder;
use crate::study::{Study, StudyError};

use super::{Failure, journal, report};

/// The model of a study.toml over the dataset of this study.
///
/// # Errors
/// A file that cannot be read, or is no study of this dataset.
pub fn model(study: &Study, file: &Path) -> Result<System, Failure> {
    let file = TomlFile::read(file, "study").map_err(StudyError::from)?;
    Ok(Study::from_toml(&file, study.dataset.clone())?.system)
}

/// Climbs from the model of `case`, and writes study, residuals and report into the folder. Every fit is kept there as soon as it has ended. With `resume`,
/// the folder of a ladder that was stopped or killed, its fits are not made again, and the answer is that of a ladder that nobody had disturbed.
///
/// # Errors
/// A ladder that cannot begin or be gone on with, files that cannot be written.
pub fn ladder(
    study: &Study,
    case: &Case,
    folder: &RunFolder,
    resume: Option<&Path>,
    monitor: Monitor,
    say: &(dyn Fn(&str) + Sync),
) -> Result<(LadderResult, System), Failure> {
    let monitor = monitor.journal(journal::open(folder, case, resume, say)?);
    let done = climbed(study, case, folder, &monitor, say);
    // A ladder that cannot be climbed leaves nothing, but what it was begun with.
    let own = |run: &Path| run.canonicalize().ok() == folder.path.canonicalize().ok();
    done.inspect_err(|_| {
        if !resume.is_some_and(own) {
            folder.forget();
        }
    })
}

fn climbed(
    study: &Study,
    case: &Case,
    folder: &RunFolder,
    monitor: &Monitor,
    say: &(dyn Fn(&str) + Sync),
) -> Result<(LadderResult, System), Failure> {
    say("first fit");
    let (mut result, system) = diagnose::ladder(case, monitor, &|step: &str| say(step))?;
    // Of the study, not of the case: what was added to a model on the page has the bounds of the search that added it.
    let system = diagnose::unbounded(&study.system, system);
    result.began_with = case.system.beyond(&study.system).into_iter().map(|i| EffectAt::of(&case.system, i)).collect();
    result.result_study = Some(folder.path.display().to_string());
    folder.study(study, &system)?;
    if let Some(last) = result.rungs.last() {
        folder.residuals(&last.tests)?;
    }
    report(folder, study, &system, None, None, Some(&result))?;
    Ok((result, system))
}
