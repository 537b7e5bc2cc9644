//! What the verbs print with `--json`: the results of the library, and the shape of what a verb puts together itself. A test holds what the verbs print
//! to these types (`tests/behaviour/schema.rs`). Keys beside those named may be added; none is renamed or taken away.

// The fields are read by the derive alone.
#![allow(dead_code)]

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde_json::Value;

use crate::diagnose::results::{Diagnosis, EffectAt, FitResult, LadderResult, TestResult};
use crate::trial::Table;
use crate::work::Scored;

/// `{error: {stage, where, message, accepted}}`.
#[derive(JsonSchema)]
pub struct Error {
    /// The error.
    error: Problem,
}

/// What is wrong, where, and what would be accepted.
#[derive(JsonSchema)]
pub struct Problem {
    /// Stage: data, study, model, identify, ...
    stage: String,
    /// File and line, test, or option.
    #[schemars(rename = "where")]
    place: String,
    /// What is wrong.
    message: String,
    /// What would be accepted.
    accepted: String,
}

/// Result of `new`.
#[derive(JsonSchema)]
pub struct New {
    /// dataset.toml that was written.
    dataset: String,
    /// study.toml that was written.
    study: String,
    /// What was found in the files.
    found: Vec<Found>,
    /// What to confirm by eye.
    to_confirm: Vec<String>,
    /// Files that could not be read.
    left_out: Vec<Problem>,
    /// What is still wrong with the dataset.
    problem: Option<Problem>,
    /// Modes of the FRFs.
    modes: Option<Vec<Value>>,
    /// Why FRFs show no modes.
    no_modes: Option<String>,
}

/// A record of a file.
#[derive(JsonSchema)]
pub struct Found {
    /// The file.
    file: String,
    /// cycle, transient, frf, modal, other.
    what: String,
}

/// Result of `check`.
#[derive(JsonSchema)]
pub struct Check {
    /// Whether a fit can begin.
    ok: bool,
    /// What is wrong.
    problems: Vec<Problem>,
    /// Free parameters.
    free: Vec<Free>,
    /// Remarks on data and model.
    findings: Vec<String>,
}

/// A free parameter at the gate.
#[derive(JsonSchema)]
pub struct Free {
    /// `at.effect.parameter`.
    name: String,
    /// Whether any residual depends on it.
    moves_residual: bool,
}

/// Result of `simulate`.
#[derive(JsonSchema)]
pub struct Simulate {
    /// Folder of the dataset.
    dataset: String,
    /// Its tests.
    tests: Vec<Simulated>,
    /// Folder of the run.
    run: String,
}

/// A simulated test.
#[derive(JsonSchema)]
pub struct Simulated {
    /// Id.
    id: String,
    /// cycle, frf, transient, energy, modal, backbone.
    kind: String,
}

/// Result of `fit`.
#[derive(JsonSchema)]
pub struct Fit {
    #[schemars(flatten)]
    result: FitResult,
    /// Folder of the run.
    run: String,
    /// Profile likelihoods, where asked for.
    #[schemars(skip_serializing_if = "Option::is_none")]
    profiles: Option<Vec<Value>>,
    /// Bootstrap, where asked for.
    #[schemars(skip_serializing_if = "Option::is_none")]
    bootstrap: Option<Value>,
}

/// Result of `compare`.
#[derive(JsonSchema)]
pub struct Compare {
    /// Name of the study.
    study: String,
    /// Every test.
    tests: Vec<TestResult>,
    /// Folder of the run.
    run: String,
}

/// Result of `diagnose`.
#[derive(JsonSchema)]
pub struct Diagnose {
    #[schemars(flatten)]
    result: Diagnosis,
    /// The fit it stands on.
    fit: FitResult,
    /// Folder of the run.
    run: String,
}

/// Result of `diagnose --scores`.
#[derive(JsonSchema)]
pub struct Scores {
    /// Every candidate that is expected to lower the cost, the largest drop first.
    scores: Vec<Scored>,
    /// The fit it stands on.
    fit: FitResult,
    /// Folder of the run.
    run: String,
}

/// Result of `add`.
#[derive(JsonSchema)]
pub struct Add {
    /// Fit without the effect.
    before: FitResult,
    /// Fit with it.
    after: FitResult,
    /// The effect.
    added: EffectAt,
    /// Folder of the run.
    run: String,
}

/// Result of `ladder`.
#[derive(JsonSchema)]
pub struct Ladder {
    #[schemars(flatten)]
    result: LadderResult,
    /// Folder of the run.
    run: String,
}

/// Result of `predict`.
#[derive(JsonSchema)]
pub struct Predict {
    /// The fit.
    fit: FitResult,
    /// The predictions.
    predictions: Vec<Prediction>,
    /// Shifts of natural frequencies.
    shifts: Vec<Shift>,
    /// Root mean square error of the shifts over that of no shift.
    shift_error_over_none: Option<f64>,
    /// Tolerance cases by every rung.
    #[schemars(skip_serializing_if = "Option::is_none")]
    tolerance: Option<Value>,
    /// Folder of the run.
    run: String,
}

/// One predicted value.
#[derive(JsonSchema)]
pub struct Prediction {
    /// Case.
    case: String,
    /// Quantity.
    quantity: String,
    /// Unit of the value.
    unit: String,
    /// Value.
    value: f64,
    /// Standard deviation.
    std: Option<f64>,
    /// Value it is held against.
    reference: Option<f64>,
    /// value / reference - 1.
    relative_error: Option<f64>,
}

/// Shift of a natural frequency.
#[derive(JsonSchema)]
pub struct Shift {
    /// Test.
    test: String,
    /// Number of the mode.
    mode: u32,
    /// As printed.
    measured: f64,
    /// By the model.
    computed: f64,
}

/// Result of `export`.
#[derive(JsonSchema)]
pub struct Export {
    /// Files that were written.
    files: Vec<String>,
    /// What a format cannot hold.
    notes: Vec<String>,
    /// Test whose conditions the set stands at.
    test: String,
    /// Folder of the run.
    run: String,
}

/// Result of `report`.
#[derive(JsonSchema)]
pub struct Report {
    /// The page.
    file: String,
    /// Folder of the run.
    run: String,
}

/// Result of `trial`.
#[derive(JsonSchema)]
pub struct Trial {
    #[schemars(flatten)]
    table: Table,
    /// Seed of the cases.
    seed: u64,
    /// Whether it was stopped.
    interrupted: bool,
    /// Folder of the cases.
    folder: String,
}

/// Result of `campaign`.
#[derive(JsonSchema)]
pub struct Campaign {
    /// Tasks of the campaign.
    tasks: usize,
    /// Tasks with a result.
    done: usize,
    /// Tasks that failed.
    failed: Vec<FailedTask>,
    /// Parquet file with a row a task.
    table: String,
    /// HTML page.
    report: String,
    /// Tasks computed in this run; the others were there.
    computed: usize,
    /// Earlier results of other inputs.
    of_other_inputs: usize,
    /// Whether it was stopped.
    interrupted: bool,
}

/// A task that failed.
#[derive(JsonSchema)]
pub struct FailedTask {
    /// What it differs in.
    task: String,
    /// Why it failed.
    reason: String,
}

/// Result of `effects`.
#[derive(JsonSchema)]
pub struct Effects {
    /// The library, or the one that was asked for.
    effects: Vec<Law>,
}

/// A law of the library.
#[derive(JsonSchema)]
pub struct Law {
    /// Name.
    effect: String,
    /// force, series, coefficient, channel.
    role: String,
    /// What it claims.
    claim: String,
    /// Its equation.
    equation: String,
    /// Its parameters.
    parameters: Vec<Parameter>,
    /// Laws that are told apart with difficulty.
    family: String,
}

/// A parameter of a law.
#[derive(JsonSchema)]
pub struct Parameter {
    /// Name.
    name: String,
    /// Unit along an axis.
    unit: String,
    /// `>= 0`, `> 0`, `any`.
    sign: String,
}

/// Result of `schema` without a name.
#[derive(JsonSchema)]
pub struct Schemas {
    /// Schemas by name.
    schemas: BTreeMap<String, Value>,
}
