//! What a spatial model and its dataset ask of each other.

use crate::data::{Dataset, Record, Test};
use crate::model::{Model, ModelError};

/// What a spatial model and a dataset ask of each other: tests that `absent` names are there, and a part that is free along an axis has
/// inertia along it where a test needs that.
pub(super) fn against(model: &Model, dataset: &Dataset) -> Result<(), ModelError> {
    if model.space.is_none() {
        return Ok(());
    }
    let stands = |pattern: &str| match pattern.strip_suffix('*') {
        Some(front) => dataset.tests.iter().any(|t| t.id.starts_with(front)),
        None => dataset.test(pattern).is_some(),
    };
    if let Some(pattern) = model.absent.iter().flat_map(|a| &a.1).find(|p| !stands(p)) {
        return Err(ModelError::no_such("test", pattern, dataset.tests.iter().map(|t| t.id.clone())));
    }
    let dynamic = |t: &&Test| matches!(t.record, Record::Modal(_) | Record::Frf(_) | Record::Transient(_));
    let Some(test) = dataset.tests.iter().find(dynamic) else { return Ok(()) };
    let Some(dof) = model.dofs.iter().position(|d| d.mass <= 0.0) else { return Ok(()) };
    let (name, body) = (model.dof_name(dof), &model.bodies[model.dofs[dof].body].name);
    let message = format!("part `{body}` has no inertia along `{name}`, and test `{}` needs it", test.id);
    Err(ModelError::invalid(body, message, "mass and inertia, a section with its density, or the axis held"))
}
