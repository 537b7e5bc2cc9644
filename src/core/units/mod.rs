//! Quantities as engineers write them, turned into SI at the border and back again for printing.
//!
//! Grammar: a number (decimal point, optional exponent), then a unit expression of symbols joined by a space, `*`, `·` (product) and
//! `/` (quotient, read from the left), with integer powers (`s2`, `s^2`, `s²`, `s^-1`, `s⁻¹`) and brackets. A product after a
//! quotient (`N/m s`) is ambiguous and refused. Two symbols have two readings and are settled by the dimension that is expected:
//! `g` (gram, standard gravity) and `rpm` (angular velocity, frequency).

mod digits;
mod dimension;
mod error;
mod expression;
mod quantity;
mod table;

pub use digits::significant;
pub use dimension::Dimension;
pub use error::UnitError;
pub use quantity::{Quantity, Spread, Unit, parse, parse_any, parse_quantity, parse_spread, parse_unit, parse_unit_any};
