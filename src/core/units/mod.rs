//! Quantities as engineers write them, turned into SI at the border and back again for printing.
//!
//! ```
//! use misfit_core::units::{self, Dimension};
//! assert_eq!(units::parse("20 N/mm", Dimension::STIFFNESS).unwrap(), 20e3);
//! let k = units::parse("1490 N mm/deg", Dimension::ROTATIONAL_STIFFNESS).unwrap();
//! assert!((k - 1.49_f64.to_degrees()).abs() < 1e-12);
//! assert!(units::parse("20 mm", Dimension::FORCE).is_err());
//! ```
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
