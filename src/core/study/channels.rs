//! The channels of the dataset against the model: every place must be there.

use std::collections::HashSet;

use crate::data::{Dataset, Record, Test};
use crate::explain::Explain;
use crate::model::{Model, ModelError};

use super::{StudyError, TestProblem};

/// Checks every `at`, `excite` and `respond`: a connector's axis (`c1.x`, what acts or moves across it) or a body's (`m8.x`).
pub(super) fn check(dataset: &Dataset, model: &Model) -> Result<(), StudyError> {
    let places: Vec<String> = (0..model.places.len()).map(|p| model.place_name(p)).collect();
    let bodies: Vec<String> = (0..model.dofs.len()).map(|d| model.dof_name(d)).collect();
    let at_places: HashSet<&str> = places.iter().map(String::as_str).collect();
    let at_bodies: HashSet<&str> = bodies.iter().map(String::as_str).collect();
    let there = |test: &Test, about: String, at: &str, bodies_too: bool| -> Result<(), StudyError> {
        if at_places.contains(at) || bodies_too && at_bodies.contains(at) {
            return Ok(());
        }
        let known = places.iter().chain(bodies.iter().filter(|_| bodies_too)).cloned();
        let e = ModelError::no_such("place", at, known);
        let (message, accepted) = (format!("{e} in the model"), e.accepted());
        Err(TestProblem { file: dataset.file.clone(), line: test.line, test: test.id.clone(), about, message, accepted }.into())
    };
    for test in &dataset.tests {
        match &test.record {
            Record::Cycle(r) | Record::Transient(r) => {
                for channel in &r.channels {
                    there(test, format!("channel {}", channel.label()), &channel.at, true)?;
                }
            }
            Record::Frf(f) => {
                there(test, "excite".into(), &f.excite, true)?;
                there(test, "respond".into(), &f.respond, true)?;
            }
            Record::Energy(e) => there(test, "at".into(), &e.at, true)?,
            Record::Backbone(b) => there(test, "at".into(), &b.at, true)?,
            Record::Modal(_) => {}
        }
    }
    Ok(())
}
