//! What a spatial model and its dataset ask of each other.

use crate::data::{Dataset, Record, Test};
use crate::model::{Model, ModelError};

/// Leaves out, in the tests that say which supports they have, the connectors to the ground that they do not name.
///
/// # Errors
/// A name that is no connector to the ground, and a connector that the study says is absent in a test that names it.
pub(super) fn supported(model: &mut Model, dataset: &Dataset) -> Result<(), ModelError> {
    let still = |body: usize| model.bodies[body].free.is_empty();
    let grounded: Vec<usize> = (0..model.declared).filter(|c| still(model.connectors[*c].from) != still(model.connectors[*c].to)).collect();
    let mut absent: Vec<(usize, Vec<String>)> = Vec::new();
    for (test, named) in dataset.tests.iter().filter_map(|t| Some((t, t.supports.as_ref()?))) {
        let name = |c: &usize| model.connectors[*c].name.clone();
        if let Some(odd) = named.iter().find(|n| !grounded.iter().any(|c| name(c) == **n)) {
            return Err(ModelError::no_such("support (connector to the ground)", odd, grounded.iter().map(name)));
        }
        for c in &grounded {
            match (named.contains(&name(c)), model.present(*c, &test.id)) {
                (true, false) => {
                    let message = format!("test `{}` has the support `{}`, and the study says it is absent there", test.id, name(c));
                    return Err(ModelError::invalid(
                        &test.id,
                        message,
                        "`absent` of the connector without this test, or `supports` without it",
                    ));
                }
                (false, true) => absent.push((*c, vec![test.id.clone()])),
                _ => {}
            }
        }
    }
    model.absent.extend(absent);
    Ok(())
}

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
    let dynamic = |t: &&Test| matches!(t.record, Record::Modal(_) | Record::Frf(_) | Record::Transient(_) | Record::Backbone(_));
    let Some(test) = dataset.tests.iter().find(dynamic) else { return Ok(()) };
    let Some(dof) = model.dofs.iter().position(|d| d.mass <= 0.0) else { return Ok(()) };
    let (name, body) = (model.dof_name(dof), &model.bodies[model.dofs[dof].body].name);
    let message = format!("part `{body}` has no inertia along `{name}`, and test `{}` needs it", test.id);
    Err(ModelError::invalid(body, message, "mass and inertia, a section with its density, or the axis held"))
}
