//! The folder of a run as every verb writes it: study, residuals, report, result.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::diagnose::Case;
use crate::diagnose::results::{Diagnosis, EffectAt, FitResult, LadderResult, ParameterResult, SplitName, TestResult};
use crate::model::System;
use crate::report::{ReportInput, html};
use crate::study::Study;
use crate::study::run::RunFolder;

use super::Failure;
use super::lines::{BOOTSTRAP, PROFILES};

/// File of the report in a run.
pub const REPORT: &str = "report.html";

/// Writes `report.html` into the folder of a run and returns its path.
pub fn report(
    folder: &RunFolder,
    study: &Study,
    system: &System,
    fit: Option<&FitResult>,
    diagnosis: Option<&Diagnosis>,
    ladder: Option<&LadderResult>,
) -> Result<PathBuf, Failure> {
    let html = html(&ReportInput { study, system: Some(system), fit, diagnosis, ladder })?;
    Ok(folder.write(REPORT, html.as_bytes())?)
}

/// Writes study, result, residuals and report of a fit.
pub fn keep(study: &Study, system: &System, folder: &RunFolder, result: &FitResult) -> Result<(), Failure> {
    folder.study(study, system)?;
    folder.residuals(&result.tests)?;
    report(folder, study, system, Some(result), None, None)?;
    folder.result(&json(result, folder)?)?;
    Ok(())
}

/// The system with the fitted values of its free parameters.
pub fn at_values(system: &System, parameters: &[ParameterResult]) -> System {
    system.with_values(|name| parameters.iter().find(|p| p.name == name).map(|p| p.value))
}

/// The comparison in the form the report draws: no iteration was made and no parameter was identified.
pub fn as_it_stands(case: &Case, tests: &[TestResult]) -> FitResult {
    let fitted = || tests.iter().filter(|t| t.split == SplitName::Fit);
    FitResult {
        study: case.name.clone(),
        termination: "not fitted".into(),
        cost: fitted().map(|t| 0.5 * t.whitened_rms.powi(2) * t.n as f64).sum(),
        n_residuals: fitted().map(|t| t.n).sum(),
        n_free: case.system.free().len(),
        wall_s: 0.0,
        iterations: 0,
        tests: tests.to_vec(),
        parameters: vec![],
        model_error: vec![],
        readings: vec![],
        scatter: vec![],
        noise: 1.0,
        unidentifiable: vec![],
        effects: case.system.instances.iter().map(|i| EffectAt::of(&case.system, i)).collect(),
        notes: std::iter::once("the model at the values of study.toml, not fitted".to_string()).chain(case.notes()).collect(),
    }
}

/// A result as JSON, with the folder of its run. Numbers that are not finite are null.
pub fn json(result: &impl serde::Serialize, folder: &RunFolder) -> Result<Value, Failure> {
    let mut value = plain(result)?;
    if let Value::Object(map) = &mut value {
        map.insert("run".into(), folder.path.display().to_string().into());
    }
    Ok(value)
}

/// A result as JSON.
pub fn plain(result: &impl serde::Serialize) -> Result<Value, Failure> {
    serde_json::to_value(result).map_err(|e| Failure::new("cli", "result", e.to_string(), "a result that is valid JSON"))
}

/// Copies the checkpoint of an earlier run, so that its folder stays as it was.
///
/// # Errors
/// Where there is none.
pub fn take_over(old: &Path, folder: &RunFolder) -> Result<(), Failure> {
    let file = if old.is_file() { old.to_path_buf() } else { RunFolder::at(old).checkpoint() };
    let bytes = crate::limits::bytes(&file, crate::limits::CONFIG_BYTES).map_err(|e| {
        let accepted = "the folder of a `fit` or `predict`, which keeps checkpoint.json";
        Failure::new("identify", file.display().to_string(), format!("no best state to go on from: {e}"), accepted)
    })?;
    folder.write("checkpoint.json", &bytes)?;
    for name in [BOOTSTRAP, PROFILES] {
        let kept = old.join(name);
        if kept.is_file() {
            let bytes = crate::limits::bytes(&kept, crate::limits::DATA_BYTES)
                .map_err(|e| Failure::new("identify", kept.display().to_string(), e.to_string(), "a file that can be read"))?;
            folder.write(name, &bytes)?;
        }
    }
    Ok(())
}
