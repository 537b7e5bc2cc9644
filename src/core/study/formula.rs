//! `effect = "formula"`: a law that stands in the study file.

use crate::data::toml_strict::{TableView, TomlError, ValueView};
use crate::effect::formula::{Definition, Part, compile};
use crate::effect::{Effect, FormulaError};
use crate::explain::Explain;
use crate::model::{Instance, System};
use crate::units::Dimension;

use super::error::at;

/// Keys of a formula beside those of every effect; every other key is a parameter.
pub(super) const KEYS: [&str; 3] = ["expression", "states", "active"];

/// Reads and compiles the formula of an `[[effect]]`.
pub(super) fn read(table: &TableView<'_>, rotational: bool) -> Result<&'static Effect, TomlError> {
    let expression = table.require("expression", "\"k*x + c*v*abs(x)\", with x, v, a and the parameters beside it")?;
    let states = match table.get("states") {
        None => vec![],
        Some(value) => {
            value.table()?.entries().map(|(k, v)| Ok((k.to_string(), v.string()?.to_string(), v))).collect::<Result<Vec<_>, TomlError>>()?
        }
    };
    let own = |key: &str| KEYS.contains(&key) || ["effect", "at"].contains(&key);
    let mut parameters = Vec::new();
    for (key, value) in table.entries().filter(|(key, _)| !own(key)) {
        parameters.push((key.to_string(), declared(key, &value)?));
    }
    let definition = Definition {
        expression: expression.string()?.to_string(),
        states: states.iter().map(|(name, rate, _)| (name.clone(), rate.clone())).collect(),
        parameters,
        active: table.optional("active", |v| v.bool())?.unwrap_or(false),
        rotational,
    };
    compile(&definition).map_err(|(part, e)| {
        let value = match &part {
            Part::Expression => None,
            Part::State(name) => states.iter().find(|s| s.0 == *name).map(|s| s.2.clone()),
            Part::Parameter(name) => table.get(name),
        };
        at(&value.unwrap_or(expression), &e)
    })
}

/// Dimension of a parameter from the unit it is given in. A free one needs bounds: nothing else says where the fit may go.
fn declared(key: &str, value: &ValueView<'_>) -> Result<Dimension, TomlError> {
    let example =
        format!("{key} = {{ start = \"20 N/mm\", min = \"0 N/mm\", max = \"100 N/mm\" }}, or {{ start = \"20 N/mm\", fixed = true }}");
    if !value.is_table() {
        return Err(value.refuse(format!("the parameter `{key}` of the formula has no bounds"), example));
    }
    let spec = value.table()?;
    let start = spec.require("start", "a quantity with a unit such as \"20 N/mm\"; a pure number as \"0.5 -\"")?;
    let quantity = if start.is_string() { Some(start.spread(None)?.quantity) } else { None };
    let Some(quantity) = quantity.filter(|q| !q.unit.symbol.is_empty()) else {
        return Err(start.refuse(format!("the parameter `{key}` of the formula has no unit"), "\"20 N/mm\"; a pure number as \"0.5 -\""));
    };
    let fixed = spec.optional("fixed", |v| v.bool())?.unwrap_or(false);
    if !(fixed || spec.has("min") && spec.has("max")) {
        return Err(value.refuse(format!("the parameter `{key}` of the formula has no bounds"), example));
    }
    Ok(quantity.unit.dimension)
}

/// Examines every formula of a system over the motions that `motions` gives for its places.
pub(super) fn examine(
    system: &System,
    motions: impl Fn(&Instance) -> Vec<crate::effect::formula::Motion>,
) -> Result<(), (usize, FormulaError)> {
    for (i, instance) in system.instances.iter().enumerate() {
        let Effect::Force(law) = instance.effect else { continue };
        let Some(formula) = law.formula() else { continue };
        let p: Vec<f64> = instance.params.iter().map(|p| p.value).collect();
        formula.examine(&p, &motions(instance)).map_err(|e| (i, e))?;
    }
    Ok(())
}

/// The error of a formula with its place.
pub(super) fn located(instance: &Instance, e: &FormulaError) -> crate::model::ModelError {
    crate::model::ModelError::invalid(format!("{}.formula", instance.at), e.to_string(), e.accepted())
}
