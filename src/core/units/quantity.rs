//! Units, quantities, and the parsing of both against an expected dimension.

use super::expression::{self, Factor};
use super::{Dimension, UnitError};
use crate::limits::MAGNITUDE;
use std::fmt;

/// Longest text taken for a quantity.
const LIMIT: usize = 160;

/// A unit as the engineer wrote it.
///
/// SI value = number * `factor` (+ `offset`, for degrees Celsius standing alone).
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// The text it was written with, trimmed: `N/mm`; empty for a bare number.
    pub symbol: String,
    /// SI units in one of it: 1000 for N/mm.
    pub factor: f64,
    /// Its dimension.
    pub dimension: Dimension,
    mantissa: f64,
    exponent: i32,
    offset: f64,
}

impl Unit {
    /// The coherent SI unit of a dimension.
    pub fn si(dimension: Dimension) -> Self {
        let symbol = if dimension.is_dimensionless() { String::new() } else { dimension.si_unit() };
        Self { symbol, factor: 1.0, dimension, mantissa: 1.0, exponent: 0, offset: 0.0 }
    }

    fn new(symbol: &str, f: Factor) -> Self {
        let Factor { mantissa, exponent, offset, dimension } = f;
        Self { symbol: symbol.trim().to_string(), factor: scale(1.0, mantissa, exponent), dimension, mantissa, exponent, offset }
    }

    /// A number in this unit, in SI.
    pub fn to_si(&self, number: f64) -> f64 {
        self.difference_to_si(number) + self.offset
    }

    /// An SI value, in this unit.
    pub fn from_si(&self, si: f64) -> f64 {
        self.difference_from_si(si - self.offset)
    }

    /// A difference (standard deviation, drift) in this unit, in SI: no offset of the temperature scale.
    pub fn difference_to_si(&self, number: f64) -> f64 {
        // Powers of ten are applied by an exact multiplication or division, so that 0.3 mm is the double nearest to 0.0003 m.
        scale(number, self.mantissa, self.exponent)
    }

    /// An SI difference, in this unit.
    pub fn difference_from_si(&self, si: f64) -> f64 {
        scale(si / self.mantissa, 1.0, -self.exponent)
    }

    /// `si` printed in this unit, in the fewest digits (15 to 17) that read back to it: `20 N/mm`.
    pub fn print(&self, si: f64) -> String {
        let exact = self.from_si(si);
        let digits = |n: usize| format!("{exact:.n$e}").parse::<f64>().ok();
        let number = [14, 15, 16].into_iter().filter_map(digits).find(|x| self.to_si(*x) == si).unwrap_or(exact);
        self.written(number)
    }

    /// `si` printed in this unit for a reader, in the fewest digits that are within 1e-9 of it: far below what any measurement tells, and `310.059827 N/mm` where all digits
    /// are `310.0598271343528 N/mm`.
    pub fn print_short(&self, si: f64) -> String {
        let exact = self.from_si(si);
        let near = |x: &f64| (self.to_si(*x) - si).abs() <= 1e-9 * si.abs();
        let number = (0..16).filter_map(|n| format!("{exact:.n$e}").parse::<f64>().ok()).find(near).unwrap_or(exact);
        self.written(number)
    }

    /// An SI difference printed in this unit: four significant digits, e.g. `0.0213 N`.
    pub fn print_difference(&self, si: f64) -> String {
        let number: f64 = format!("{:.3e}", self.difference_from_si(si)).parse().unwrap_or(f64::NAN);
        self.written(number)
    }

    /// A number in this unit, with a power of ten where all its digits would be more than are read again.
    pub fn written(&self, number: f64) -> String {
        let plain = format!("{number}");
        let number = if plain.len() > LONGEST { format!("{number:e}") } else { plain };
        if self.symbol.is_empty() { number } else { format!("{number} {}", self.symbol) }
    }
}

/// Characters of a number without a power of ten at most: 17 digits, a sign, a point, and some zeros.
const LONGEST: usize = 32;

/// number * mantissa * 10^exponent with the power of ten as one exact factor or divisor (up to 10^22).
fn scale(number: f64, mantissa: f64, exponent: i32) -> f64 {
    let value = number * mantissa;
    if exponent >= 0 { value * 10f64.powi(exponent) } else { value / 10f64.powi(-exponent) }
}

/// A value with the unit it was written in. The value is SI; the unit serves printing.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// SI value.
    pub value: f64,
    pub unit: Unit,
}

impl Quantity {
    /// A quantity in SI units.
    pub fn si(value: f64, dimension: Dimension) -> Self {
        Self { value, unit: Unit::si(dimension) }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.unit.print(self.value))
    }
}

/// A quantity with, where one was written, its standard deviation (SI).
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    pub quantity: Quantity,
    pub sigma: Option<f64>,
}

/// Parses `text` as a quantity of dimension `expected`; returns the SI value.
pub fn parse(text: &str, expected: Dimension) -> Result<f64, UnitError> {
    parse_quantity(text, expected).map(|q| q.value)
}

/// Parses `text` as a quantity of dimension `expected`, keeping the unit for printing.
pub fn parse_quantity(text: &str, expected: Dimension) -> Result<Quantity, UnitError> {
    quantity(text, Some(expected))
}

/// Parses `text` as a quantity of any dimension (a bare number is dimensionless; `g` is the gram, `rpm` an angular velocity).
pub fn parse_any(text: &str) -> Result<Quantity, UnitError> {
    quantity(text, None)
}

/// Parses a unit alone (`N/mm`) of dimension `expected`. An empty text is the unit of a dimensionless quantity only.
pub fn parse_unit(text: &str, expected: Dimension) -> Result<Unit, UnitError> {
    unit(checked(text)?, text, Some(expected))
}

/// Parses a unit alone, of any dimension.
pub fn parse_unit_any(text: &str) -> Result<Unit, UnitError> {
    unit(checked(text)?, text, None)
}

/// Parses `0.4 mm`, `0.4 mm +- 0.02 mm`, `0.4 +- 0.02 mm`, `0.4 mm ± 5 %` (one standard deviation); any dimension when `expected` is none.
///
/// A deviation without unit has the unit of the value.
pub fn parse_spread(text: &str, expected: Option<Dimension>) -> Result<Spread, UnitError> {
    let text = checked(text)?;
    let Some((value, sigma)) = ["+-", "+/-", "±"].iter().find_map(|mark| text.split_once(mark)) else {
        return Ok(Spread { quantity: quantity(text, expected)?, sigma: None });
    };
    let (value, sigma) = (value.trim(), sigma.trim());
    let (_, sigma_unit) = split_number(sigma, expected)?;
    let (_, value_unit) = split_number(value, expected)?;
    let value = if value_unit.is_empty() && sigma_unit != "%" { format!("{value} {sigma_unit}") } else { value.to_string() };
    let quantity = quantity(&value, expected)?;
    let (number, _) = split_number(sigma, expected)?;
    let sigma = if sigma_unit.is_empty() {
        quantity.unit.difference_to_si(number)
    } else if sigma_unit == "%" && !quantity.unit.dimension.is_dimensionless() {
        number / 100.0 * quantity.value.abs()
    } else {
        unit(sigma_unit, sigma, Some(quantity.unit.dimension))?.difference_to_si(number)
    };
    if !(sigma <= MAGNITUDE && sigma > 0.0) {
        return Err(UnitError::Spread { text: text.to_string(), what: "the standard deviation must be above 0".to_string() });
    }
    Ok(Spread { quantity, sigma: Some(sigma) })
}

fn checked(text: &str) -> Result<&str, UnitError> {
    if text.len() > LIMIT {
        let text = text.chars().take(24).chain("...".chars()).collect();
        return Err(UnitError::TooLong { text, limit: LIMIT });
    }
    Ok(text.trim())
}

fn quantity(text: &str, expected: Option<Dimension>) -> Result<Quantity, UnitError> {
    let text = checked(text)?;
    let (number, unit_text) = split_number(text, expected)?;
    let unit = match (unit_text.is_empty(), expected) {
        (true, Some(d)) if !d.is_dimensionless() => return Err(UnitError::MissingUnit { text: text.to_string(), expected: d }),
        (true, _) => Unit::si(Dimension::DIMENSIONLESS),
        (false, _) => unit(unit_text, text, expected)?,
    };
    let value = unit.to_si(number);
    if value.is_nan() || value.abs() > MAGNITUDE {
        return Err(UnitError::NotFinite { text: text.to_string() });
    }
    Ok(Quantity { value, unit })
}

/// Splits the leading number off; the rest is the unit, trimmed.
fn split_number(text: &str, expected: Option<Dimension>) -> Result<(f64, &str), UnitError> {
    if text.is_empty() {
        return Err(UnitError::Empty { expected });
    }
    let lower = text.trim_start_matches(['+', '-', '−']).to_ascii_lowercase();
    if ["nan", "inf"].iter().any(|word| lower.starts_with(word)) {
        return Err(UnitError::NotFinite { text: text.to_string() });
    }
    let end = number_length(text);
    let (number, rest) = text.split_at(end);
    if rest.starts_with(',') {
        return Err(UnitError::DecimalComma { text: text.to_string() });
    }
    let no_number = || UnitError::NoNumber { text: text.to_string(), expected };
    let value: f64 = number.replace('−', "-").parse().map_err(|_| no_number())?;
    if !value.is_finite() {
        return Err(UnitError::NotFinite { text: text.to_string() });
    }
    Ok((value, rest.trim()))
}

/// Bytes of the leading `[+-]digits[.digits][e[+-]digits]`.
fn number_length(text: &str) -> usize {
    let digits = |from: usize| text.get(from..).unwrap_or("").bytes().take_while(u8::is_ascii_digit).count();
    let sign =
        |from: usize| text.get(from..).and_then(|r| r.chars().next()).filter(|c| matches!(c, '+' | '-' | '−')).map_or(0, char::len_utf8);
    let mut end = sign(0);
    end += digits(end);
    if text.get(end..).is_some_and(|r| r.starts_with('.')) {
        end += 1 + digits(end + 1);
    }
    if text.get(end..).is_some_and(|r| r.starts_with(['e', 'E'])) {
        let from = end + 1 + sign(end + 1);
        let n = digits(from);
        if n > 0 {
            end = from + n;
        }
    }
    end
}

/// Parses a unit text found in `whole`, choosing the reading that fits the expected dimension.
fn unit(text: &str, whole: &str, expected: Option<Dimension>) -> Result<Unit, UnitError> {
    let clarify = |error: UnitError| match error {
        UnitError::Syntax { what, .. } => UnitError::Syntax { text: whole.to_string(), what, expected },
        UnitError::UnknownUnit { symbol, nearest, .. } => UnitError::UnknownUnit { text: whole.to_string(), symbol, nearest, expected },
        other => other,
    };
    let Some(expected) = expected else {
        if text.is_empty() {
            return Ok(Unit::si(Dimension::DIMENSIONLESS));
        }
        return expression::evaluate(text, false).map(|f| Unit::new(text, f)).map_err(clarify);
    };
    if text.is_empty() {
        return if expected.is_dimensionless() {
            Ok(Unit::si(expected))
        } else {
            Err(UnitError::MissingUnit { text: whole.to_string(), expected })
        };
    }
    let first = expression::evaluate(text, false).map_err(clarify)?;
    if expected.accepts(first.dimension) {
        return Ok(Unit::new(text, first));
    }
    let second = expression::evaluate(text, true).map_err(clarify)?;
    if expected.accepts(second.dimension) {
        return Ok(Unit::new(text, second));
    }
    Err(UnitError::WrongDimension { text: whole.to_string(), found: first.dimension, expected })
}

#[cfg(test)]
mod tests;
