//! The unit symbols: one table, with SI prefixes for those that take them.

use super::Dimension;
use std::f64::consts::PI;

/// A symbol's meaning: SI value = mantissa * 10^exponent * number (+ offset).
#[derive(Clone, Copy, Debug)]
pub(super) struct Symbol {
    pub mantissa: f64,
    pub exponent: i32,
    pub offset: f64,
    pub dimension: Dimension,
}

/// Name, mantissa, power of ten, dimension, whether it takes SI prefixes.
type Row = (&'static str, f64, i32, Dimension, bool);

/// Standard gravity, m/s2 (CGPM 1901).
const GRAVITY: f64 = 9.806_65;
/// Pound-force, N: 0.45359237 kg (international pound, 1959) times standard gravity.
const POUND_FORCE: f64 = 4.448_221_615_260_5;

const fn electric(current: i8, length: i8, mass: i8, time: i8) -> Dimension {
    Dimension { current, ..Dimension::mechanical(length, mass, time, 0) }
}

const ROWS: &[Row] = &[
    ("m", 1.0, 0, Dimension::LENGTH, true),
    ("in", 254.0, -4, Dimension::LENGTH, false),
    ("inch", 254.0, -4, Dimension::LENGTH, false),
    ("ft", 3048.0, -4, Dimension::LENGTH, false),
    ("mil", 254.0, -7, Dimension::LENGTH, false),
    ("s", 1.0, 0, Dimension::TIME, true),
    ("sec", 1.0, 0, Dimension::TIME, false),
    ("min", 60.0, 0, Dimension::TIME, false),
    ("h", 3600.0, 0, Dimension::TIME, false),
    ("g", 1.0, -3, Dimension::MASS, true),
    ("t", 1.0, 3, Dimension::MASS, false),
    ("lb", 0.453_592_37, 0, Dimension::MASS, false),
    ("lbm", 0.453_592_37, 0, Dimension::MASS, false),
    ("slug", POUND_FORCE / 0.3048, 0, Dimension::MASS, false),
    ("N", 1.0, 0, Dimension::FORCE, true),
    ("lbf", POUND_FORCE, 0, Dimension::FORCE, false),
    ("kip", POUND_FORCE, 3, Dimension::FORCE, false),
    ("kips", POUND_FORCE, 3, Dimension::FORCE, false),
    ("kgf", GRAVITY, 0, Dimension::FORCE, false),
    ("Pa", 1.0, 0, Dimension::PRESSURE, true),
    ("bar", 1.0, 5, Dimension::PRESSURE, false),
    ("psi", POUND_FORCE / 0.0254 / 0.0254, 0, Dimension::PRESSURE, false),
    ("ksi", POUND_FORCE / 0.0254 / 0.0254, 3, Dimension::PRESSURE, false),
    ("J", 1.0, 0, Dimension::ENERGY, true),
    ("W", 1.0, 0, Dimension::POWER, true),
    ("Hz", 1.0, 0, Dimension::FREQUENCY, true),
    ("rad", 1.0, 0, Dimension::ANGLE, true),
    ("deg", PI / 180.0, 0, Dimension::ANGLE, false),
    ("°", PI / 180.0, 0, Dimension::ANGLE, false),
    ("rev", 2.0 * PI, 0, Dimension::ANGLE, false),
    ("rpm", PI / 30.0, 0, Dimension::ANGULAR_VELOCITY, false),
    ("cycle", 1.0, 0, Dimension::DIMENSIONLESS, false),
    ("cycles", 1.0, 0, Dimension::DIMENSIONLESS, false),
    ("%", 1.0, -2, Dimension::DIMENSIONLESS, false),
    ("-", 1.0, 0, Dimension::DIMENSIONLESS, false),
    ("1", 1.0, 0, Dimension::DIMENSIONLESS, false),
    ("K", 1.0, 0, Dimension::TEMPERATURE, true),
    ("°C", 1.0, 0, Dimension::TEMPERATURE, false),
    ("degC", 1.0, 0, Dimension::TEMPERATURE, false),
    ("A", 1.0, 0, electric(1, 0, 0, 0), true),
    ("V", 1.0, 0, electric(-1, 2, 1, -3), true),
    ("C", 1.0, 0, electric(1, 0, 0, 1), true),
    ("mol", 1.0, 0, Dimension { amount: 1, ..Dimension::DIMENSIONLESS }, true),
    ("cd", 1.0, 0, Dimension { luminosity: 1, ..Dimension::DIMENSIONLESS }, true),
];

/// The second reading of a symbol that has two.
const SECOND_READING: &[Row] = &[("g", GRAVITY, 0, Dimension::ACCELERATION, false), ("rpm", 1.0 / 60.0, 0, Dimension::FREQUENCY, false)];

const PREFIXES: &[(&str, i32)] = &[
    ("T", 12),
    ("G", 9),
    ("M", 6),
    ("k", 3),
    ("h", 2),
    ("da", 1),
    ("d", -1),
    ("c", -2),
    ("m", -3),
    ("u", -6),
    ("µ", -6),
    ("μ", -6),
    ("n", -9),
    ("p", -12),
];

/// Looks a symbol up; `second` asks for the second reading of those that have one.
pub(super) fn look_up(name: &str, second: bool) -> Option<Symbol> {
    let symbol = |row: &Row, power: i32| Symbol {
        mantissa: row.1,
        exponent: row.2 + power,
        offset: if matches!(row.0, "°C" | "degC") { 273.15 } else { 0.0 },
        dimension: row.3,
    };
    if second && let Some(row) = SECOND_READING.iter().find(|r| r.0 == name) {
        return Some(symbol(row, 0));
    }
    if let Some(row) = ROWS.iter().find(|r| r.0 == name) {
        return Some(symbol(row, 0));
    }
    PREFIXES.iter().find_map(|(prefix, power)| {
        let rest = name.strip_prefix(prefix)?;
        ROWS.iter().find(|r| r.4 && r.0 == rest).map(|r| symbol(r, *power))
    })
}

/// The known symbol nearest to a misspelt one, if any is near.
pub(super) fn nearest(name: &str) -> Option<String> {
    let common = ["mm", "um", "cm", "km", "kN", "mN", "kPa", "MPa", "GPa", "mJ", "kJ", "kHz", "ms", "us", "kg", "mg", "mrad", "mW", "kW"];
    let candidates = ROWS.iter().map(|r| r.0).filter(|r| r.chars().all(char::is_alphabetic)).chain(common);
    let lower = name.to_lowercase();
    candidates
        .map(|c| (strsim::damerau_levenshtein(&lower, &c.to_lowercase()) * 2 + usize::from(c != name), c))
        .min_by_key(|c| c.0)
        .filter(|(distance, c)| *distance <= 1 || (*distance <= 3 && c.len() > 1 && name.len() > 1))
        .map(|(_, c)| c.to_string())
}
