//! A parameter of an effect, as a study declares it.

use super::error::TomlError;
use super::view::ValueView;
use crate::units::{Dimension, Quantity};

/// A parameter's start, bounds and prior. All values SI.
///
/// Written as `"20 N/mm"` (start only, free) or
/// `{ start = "20 N/mm", min = "0 N/mm", max = "1 kN/mm", prior = { mean = "18 N/mm", sigma = "2 N/mm" }, fixed = true }`.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterSpec {
    /// Start value with the unit that serves printing.
    pub start: Quantity,
    pub min: Option<f64>,
    pub max: Option<f64>,
    pub prior: Option<PriorSpec>,
    /// Not identified.
    pub fixed: bool,
    /// Relative width within which what it stands for may deviate.
    pub slack: Option<f64>,
    /// Line in the file.
    pub line: usize,
}

/// A normal prior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorSpec {
    pub mean: f64,
    pub sigma: f64,
}

impl<'a> ValueView<'a> {
    /// Reads a parameter of dimension `dimension`; `more` names keys a caller reads itself from the same table.
    ///
    /// Refused: bounds that cross, a start outside them, a prior whose sigma is not above 0.
    pub fn parameter(&self, dimension: Dimension, more: &[&str]) -> Result<ParameterSpec, TomlError> {
        if !self.is_table() {
            let start = self.quantity(dimension)?;
            return Ok(ParameterSpec { start, min: None, max: None, prior: None, fixed: false, slack: None, line: self.line() });
        }
        let table = self.table()?;
        table.only(&[&["start", "min", "max", "prior", "fixed", "slack"], more].concat())?;
        let start = table.quantity("start", dimension)?;
        let min = table.optional("min", |v| v.quantity(dimension))?;
        let max = table.optional("max", |v| v.quantity(dimension))?;
        let fixed = table.optional("fixed", |v| v.bool())?.unwrap_or(false);
        if let (Some(low), Some(high)) = (&min, &max)
            && low.value >= high.value
        {
            return Err(table.refuse(format!("min {low} is not below max {high}"), "min below max"));
        }
        let below = min.as_ref().filter(|m| start.value < m.value);
        let above = max.as_ref().filter(|m| start.value > m.value);
        if let Some(bound) = below.or(above) {
            let side = if below.is_some() { "below min" } else { "above max" };
            return Err(table.refuse(format!("start {start} is {side} {bound}"), "a start within min and max"));
        }
        let prior = table.optional("prior", |v| prior(&v, dimension))?;
        let slack = table.optional("slack", slack)?;
        Ok(ParameterSpec { start, min: min.map(|q| q.value), max: max.map(|q| q.value), prior, fixed, slack, line: self.line() })
    }
}

/// A relative width: `"5 %"`, `0.05`.
fn slack(value: ValueView<'_>) -> Result<f64, TomlError> {
    let width = value.quantity(Dimension::DIMENSIONLESS)?;
    if width.value > 0.0 && width.value < 1.0 {
        return Ok(width.value);
    }
    Err(value.refuse(format!("a slack of {width}"), "a part above 0 and below 100 %, or no slack"))
}

fn prior(value: &ValueView<'_>, dimension: Dimension) -> Result<PriorSpec, TomlError> {
    let table = value.table()?;
    table.only(&["mean", "sigma"])?;
    let mean = table.quantity("mean", dimension)?;
    let sigma = table.require("sigma", "a standard deviation above 0")?.deviation(&mean.unit, mean.value)?;
    Ok(PriorSpec { mean: mean.value, sigma })
}
