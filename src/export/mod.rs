//! The calibrated set in the formats of other programs. One format per file, one list of all.

mod adams;
mod alone;
mod csv;
mod exudyn;
mod json;
mod law;
mod mechanism;
mod parquet;
#[cfg(test)]
mod tests;

pub use alone::stand_alone;

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use serde::Serialize;

use crate::diagnose::Fitted;
use crate::diagnose::results::{EffectAt, FitResult, ParameterResult, TestResult};
use crate::explain::Explain;
use crate::model::System;

/// What a calibration found, free of any format. SI.
#[derive(Clone, Debug, Serialize)]
pub struct CalibratedSet {
    /// Version of this form.
    pub schema: u32,
    /// Name of the study.
    pub study: String,
    /// FNV-1a (64 bit) of study.toml, so that a set can be traced to the file it came from.
    pub study_hash: String,
    /// How the fit ended.
    pub termination: String,
    /// 1/2 ||r||^2.
    pub cost: f64,
    /// Free parameters with intervals.
    pub parameters: Vec<ParameterResult>,
    /// Parameters that were declared, not identified.
    pub fixed: Vec<Fixed>,
    /// Covariance of the free parameters, in their order [SI units of row times column]; none where one is not identified.
    pub covariance: Vec<Vec<Option<f64>>>,
    /// Combinations the data do not determine.
    pub unidentifiable: Vec<String>,
    /// Effects with their places.
    pub effects: Vec<EffectAt>,
    /// Errors by test.
    pub tests: Vec<TestResult>,
}

/// A declared parameter.
#[derive(Clone, Debug, Serialize)]
pub struct Fixed {
    /// `at.effect.parameter`.
    pub name: String,
    /// Value [SI].
    pub value: f64,
}

impl CalibratedSet {
    /// From a fit; `covariance` is in the fit's variables, and is taken to the parameters here (dp = p d ln p where the fit moved a
    /// logarithm).
    pub fn new(study_toml: &[u8], result: &FitResult, fitted: &Fitted, covariance: &DMatrix<f64>) -> Self {
        let slope: Vec<f64> =
            fitted.free.iter().map(|f| if f.log { fitted.system.instances[f.instance].params[f.param].value } else { 1.0 }).collect();
        let cell = |a: usize, b: usize| Some(covariance[(a, b)] * slope[a] * slope[b]).filter(|c| c.is_finite());
        let n = slope.len();
        let fixed = fitted
            .system
            .instances
            .iter()
            .flat_map(|i| {
                let named = move |(p, v): (&crate::effect::Param, &crate::model::ParamValue)| Fixed {
                    name: format!("{}.{}.{}", i.at, i.name(), p.name),
                    value: v.value,
                };
                i.effect.info().params.iter().zip(&i.params).filter(|(_, v)| !v.free).map(named)
            })
            .collect();
        CalibratedSet {
            schema: 1,
            study: result.study.clone(),
            study_hash: format!("fnv1a64:{:016x}", fnv1a(study_toml)),
            termination: result.termination.clone(),
            cost: result.cost,
            parameters: result.parameters.clone(),
            fixed,
            covariance: (0..n).map(|a| (0..n).map(|b| cell(a, b)).collect()).collect(),
            unidentifiable: result.unidentifiable.clone(),
            effects: result.effects.clone(),
            tests: result.tests.clone(),
        }
    }
}

/// Fowler, Noll and Vo, variant 1a, 64 bit.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// A format.
pub trait Exporter: Sync {
    /// Its word on the command line.
    fn name(&self) -> &'static str;
    /// The files of the set.
    fn files(&self, of: &Source) -> Result<Exported, ExportError>;
}

/// What is exported: the set, and the mechanism at the conditions of one test.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The calibrated set.
    pub set: &'a CalibratedSet,
    /// The system at its calibrated values.
    pub system: &'a System,
    /// Test at whose conditions coefficients and loads are taken.
    pub test: &'a str,
    /// Its conditions [SI].
    pub conditions: &'a BTreeMap<String, f64>,
    /// The same as the dataset states them.
    pub described: &'a str,
}

/// The files of a format.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exported {
    /// Name and content.
    pub files: Vec<(String, Vec<u8>)>,
    /// What the format cannot hold, in words.
    pub notes: Vec<String>,
}

impl From<Vec<(String, Vec<u8>)>> for Exported {
    fn from(files: Vec<(String, Vec<u8>)>) -> Self {
        Exported { files, notes: vec![] }
    }
}

/// Every format there is.
pub static EXPORTERS: &[&dyn Exporter] = &[&json::Json, &csv::Csv, &parquet::Parquet, &adams::Adams, &exudyn::Exudyn];

/// A set that cannot be written in a format.
#[derive(Debug, thiserror::Error)]
#[error("{format}: {reason}")]
pub struct ExportError {
    /// Format.
    pub format: &'static str,
    /// Why.
    pub reason: String,
}

impl Explain for ExportError {
    fn stage(&self) -> &'static str {
        "export"
    }
    fn place(&self) -> String {
        self.format.into()
    }
    fn accepted(&self) -> String {
        "a calibrated set that the format can hold; json holds every set".into()
    }
}

/// Text of the user in a comment of one line: no line end of any kind, no character that controls.
fn clean(text: &str) -> String {
    text.chars().map(|c| if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') { ' ' } else { c }).collect()
}

#[cfg(test)]
mod hash {
    #[test]
    fn hash_as_published() {
        // Test vectors of the FNV authors.
        assert_eq!(super::fnv1a(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(super::fnv1a(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
