//! The cases of a table: one row each, its conditions and its energy.

use std::collections::BTreeMap;

use crate::data::{Dataset, EnergyRow, EnergyTable, Record};
use crate::units::{Dimension, Unit};

use super::ToleranceError;

/// One tolerance case.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name.
    pub name: String,
    /// Tolerances, areas, interferences [SI].
    pub values: BTreeMap<String, f64>,
    /// Dissipated energy per cycle W_D [J].
    pub energy: f64,
    /// Equivalent elastic energy W_s [J], where the table has it.
    pub stored: Option<f64>,
    /// File and line of its row.
    pub place: String,
}

/// All cases with the units of their quantities.
#[derive(Clone, Debug, PartialEq)]
pub struct Cases {
    /// In the order of the table.
    pub cases: Vec<Case>,
    /// Unit of each quantity, for printing.
    pub units: BTreeMap<String, Unit>,
    /// Unit of the energies, for printing.
    pub energy_unit: Unit,
}

/// Part by which two energies of one set of conditions may differ and still be one measurement repeated.
const REPEATED: f64 = 0.05;

/// Refuses a table of which two rows state the same conditions and other energies: no law and no model can have both.
fn contradictions(cases: &[Case], needed: &[(String, Dimension)]) -> Result<(), ToleranceError> {
    for (k, a) in cases.iter().enumerate() {
        let same = |b: &&Case| needed.iter().all(|(q, _)| a.values.get(q) == b.values.get(q));
        let Some(b) = cases[..k].iter().filter(same).find(|b| (a.energy / b.energy).ln().abs() > REPEATED) else { continue };
        let names: Vec<&str> = needed.iter().map(|n| n.0.as_str()).collect();
        return Err(ToleranceError::Row {
            place: a.place.clone(),
            case: a.name.clone(),
            message: format!("it has the conditions of case {} and another energy ({:.4} J and {:.4} J)", b.name, a.energy, b.energy),
            accepted: format!("rows that differ in one of {}, or agree in W_D within {:.0} %", names.join(", "), 100.0 * REPEATED),
        });
    }
    Ok(())
}

impl Cases {
    /// The cases of an energy test, each of which must state every one of `needed` (a name with its dimension).
    pub fn read(dataset: &Dataset, test: &str, needed: &[(String, Dimension)]) -> Result<Cases, ToleranceError> {
        let row = |case: &str, place: String, message: String, accepted: String| ToleranceError::Row {
            place: format!("{}, {place}", dataset.file.display()),
            case: case.into(),
            message,
            accepted,
        };
        let Some(Record::Energy(table)) = dataset.test(test).map(|t| &t.record) else {
            let tests: Vec<&str> = dataset.tests.iter().map(|t| t.id.as_str()).collect();
            let message = format!("there is no energy test `{test}`");
            return Err(row("-", format!("test {test}"), message, format!("an energy test of {}", tests.join(", "))));
        };
        let mut units = BTreeMap::new();
        let one = |(k, r): (usize, &EnergyRow)| -> Result<Case, ToleranceError> {
            let name = r.case.clone().unwrap_or_else(|| (k + 1).to_string());
            let refuse = |message: String, accepted: String| row(&name, r.place.clone(), message, accepted);
            let Some(energy) = &r.dissipated else { return Err(refuse("no W_D".into(), "W_D = \"196.2 mJ\"".into())) };
            let mut values = BTreeMap::new();
            for (quantity, dimension) in needed {
                let example = || format!("conditions = {{ {quantity} = {} }} in every row", dimension.examples());
                let Some(c) = r.conditions.get(quantity) else { return Err(refuse(format!("no condition `{quantity}`"), example())) };
                if c.unit.dimension != *dimension {
                    let message = format!("`{quantity}` is {}, where a {} is expected", c.quantity(), dimension.name());
                    return Err(refuse(message, example()));
                }
                if c.value <= 0.0 || !c.value.is_finite() {
                    return Err(refuse(format!("`{quantity}` is {}", c.quantity()), "a value above 0".into()));
                }
                units.entry(quantity.clone()).or_insert_with(|| c.unit.clone());
                values.insert(quantity.clone(), c.value);
            }
            let stored = r.stored.as_ref().map(|w| w.value);
            Ok(Case { name, values, energy: energy.value, stored, place: format!("{}, {}", dataset.file.display(), r.place) })
        };
        let EnergyTable { rows, .. } = table;
        let cases: Vec<Case> = rows.iter().enumerate().map(one).collect::<Result<_, _>>()?;
        contradictions(&cases, needed)?;
        let energy_unit = rows.iter().find_map(|r| Some(r.dissipated.as_ref()?.unit.clone()));
        let energy_unit = energy_unit.unwrap_or_else(|| Unit::si(Dimension::ENERGY));
        Ok(Cases { cases, units, energy_unit })
    }

    /// Values of a quantity, case by case.
    pub fn of(&self, quantity: &str) -> Vec<f64> {
        self.cases.iter().map(|c| c.values.get(quantity).copied().unwrap_or(f64::NAN)).collect()
    }

    /// The energies [J].
    pub fn energies(&self) -> Vec<f64> {
        self.cases.iter().map(|c| c.energy).collect()
    }

    /// Greatest energy over the least, minus one.
    pub fn span(&self) -> f64 {
        super::energies::span(&self.energies())
    }
}
