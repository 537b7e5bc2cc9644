//! Conditions of a test: frequency, load, interference, temperature, and whatever else a law may depend on.

use super::toml_strict::{TableView, TomlError};
use crate::units::{Dimension, Quantity, Unit};
use std::collections::BTreeMap;

/// One condition: value (SI), unit for printing, standard deviation (SI) where it is uncertain.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    pub value: f64,
    pub unit: Unit,
    pub sigma: Option<f64>,
    /// Line in dataset.toml.
    pub line: usize,
}

impl Condition {
    /// Value and unit, for printing.
    pub fn quantity(&self) -> Quantity {
        Quantity { value: self.value, unit: self.unit.clone() }
    }
}

/// Conditions by name.
pub type Conditions = BTreeMap<String, Condition>;

/// Reads `conditions = { ... }`; empty where the key is not there.
pub(super) fn conditions(table: &TableView<'_>) -> Result<Conditions, TomlError> {
    let Some(value) = table.get("conditions") else { return Ok(Conditions::new()) };
    let mut all = Conditions::new();
    for (name, value) in value.table()?.entries() {
        let fine = name.starts_with(|c: char| c.is_alphabetic()) && name.chars().all(|c| c.is_alphanumeric() || c == '_');
        if !fine {
            return Err(value.refuse(format!("`{name}` is not a name for a condition"), "letters, digits and _, beginning with a letter"));
        }
        // These names mean one thing in every study; any other may have any dimension.
        let expected: &[Dimension] = match name {
            "frequency" => &[Dimension::FREQUENCY],
            "temperature" => &[Dimension::TEMPERATURE],
            "load" | "force" => &[Dimension::FORCE, Dimension::MOMENT],
            "pressure" => &[Dimension::PRESSURE],
            _ => &[],
        };
        let mut read = if expected.is_empty() { value.spread(None) } else { value.spread(Some(expected[0])) };
        for dimension in expected.iter().skip(1) {
            read = read.or_else(|e| value.spread(Some(*dimension)).map_err(|_| e));
        }
        let spread = read?;
        if name == "frequency" && spread.quantity.value <= 0.0 {
            return Err(value.refuse(format!("a frequency of {}", spread.quantity), "a frequency above 0 Hz"));
        }
        let condition = Condition { value: spread.quantity.value, unit: spread.quantity.unit, sigma: spread.sigma, line: value.line() };
        all.insert(name.to_string(), condition);
    }
    Ok(all)
}
