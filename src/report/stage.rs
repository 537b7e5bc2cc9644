//! The states of the model that the page compares: the rungs of a ladder, or one fit.

use crate::diagnose::results::{EffectAt, ParameterResult, SplitName, TestResult};
use crate::response::BlockKind;

use super::text::esc;
use super::{ReportError, ReportInput};

/// Error over floor up to which a model is said to fit to the noise.
pub const FITS: f64 = 1.2;

/// One state of the model.
pub struct Stage<'a> {
    /// Name as it is: `as given`, `+ coulomb at c3.x`.
    pub name: String,
    /// Its tests.
    pub tests: &'a [TestResult],
    /// Its parameters.
    pub parameters: &'a [ParameterResult],
    /// Its effects.
    pub effects: &'a [EffectAt],
    /// How its fit ended.
    pub termination: &'a str,
}

/// The rungs of the ladder; without one the fit alone; without that nothing.
pub fn stages<'a>(input: &ReportInput<'a>) -> Vec<Stage<'a>> {
    if let Some(ladder) = input.ladder.filter(|l| !l.rungs.is_empty()) {
        let name = |k: usize, added: &Option<EffectAt>| match added {
            Some(e) => format!("+ {e}"),
            None if k == 0 => "model as given".into(),
            None => "pruned".into(),
        };
        let stage = |(k, r): (usize, &'a crate::diagnose::results::Rung)| Stage {
            name: name(k, &r.added),
            tests: &r.tests,
            parameters: &r.parameters,
            effects: &r.effects,
            termination: &r.termination,
        };
        return ladder.rungs.iter().enumerate().map(stage).collect();
    }
    let stage = |f: &'a crate::diagnose::results::FitResult| Stage {
        name: "model as fitted".into(),
        tests: &f.tests,
        parameters: &f.parameters,
        effects: &f.effects,
        termination: &f.termination,
    };
    input.fit.map(stage).into_iter().collect()
}

/// `coulomb at c3.x`, escaped.
pub fn effect_at(effect: &str, at: &str) -> String {
    format!("{} at {}", esc(effect), esc(at))
}

/// Refuses curves whose columns are not equally long, so that nothing after needs to look.
pub fn check(stages: &[Stage]) -> Result<(), ReportError> {
    for test in stages.iter().flat_map(|s| s.tests) {
        for c in &test.curves {
            let n = c.measured.len();
            let points = if c.kind == BlockKind::Frf { n / 2 } else { n };
            let driven = |v: &Vec<f64>| if v.is_empty() { points } else { v.len() };
            // A table may have rows without a frequency.
            let abscissa = if c.kind == BlockKind::Table { points } else { c.abscissa.len() };
            let columns = [
                ("computed", c.computed.len(), n),
                ("sigma", c.sigma.len(), n),
                ("abscissa", abscissa, points),
                ("x", driven(&c.x), points),
                ("v", driven(&c.v), points),
                ("measured", n, if c.kind == BlockKind::Frf { 2 * points } else { n }),
            ];
            if let Some(&(column, found, wanted)) = columns.iter().find(|(_, found, wanted)| found != wanted) {
                return Err(ReportError::Curve { test: test.id.clone(), label: c.label.clone(), column, found, wanted });
            }
        }
    }
    Ok(())
}

/// The tests of a stage in the given split.
pub fn of_split<'a>(stage: &Stage<'a>, split: SplitName) -> Vec<&'a TestResult> {
    stage.tests.iter().filter(|t| t.split == split).collect()
}

/// The result of a test on a stage.
pub fn test<'a>(stage: &Stage<'a>, id: &str) -> Option<&'a TestResult> {
    stage.tests.iter().find(|t| t.id == id)
}

/// Ids of all tests of all stages, in the order in which they come.
pub fn ids<'a>(stages: &[Stage<'a>]) -> Vec<&'a str> {
    let mut ids: Vec<&str> = Vec::new();
    for t in stages.iter().flat_map(|s| s.tests) {
        if !ids.contains(&t.id.as_str()) {
            ids.push(&t.id);
        }
    }
    ids
}

/// Error and floor pooled over tests as root mean square; none without a test.
pub fn pooled<'a>(tests: impl IntoIterator<Item = &'a TestResult>) -> Option<(f64, f64)> {
    let (mut error, mut floor, mut n) = (0.0, 0.0, 0usize);
    for t in tests {
        error += t.error * t.error;
        floor += t.floor * t.floor;
        n += 1;
    }
    (n > 0).then(|| ((error / n as f64).sqrt(), (floor / n as f64).sqrt()))
}

/// Error over floor; not a number where there is no floor.
pub fn over_floor(error: f64, floor: f64) -> f64 {
    if floor > 0.0 { error / floor } else { f64::NAN }
}

/// The split as it is printed.
pub fn split_words(split: SplitName) -> &'static str {
    match split {
        SplitName::Fit => "fit",
        SplitName::Select => "select",
        SplitName::HeldOut => "held out",
    }
}
