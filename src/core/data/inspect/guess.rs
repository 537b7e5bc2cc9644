//! What a column is, by its unit and its name.

use crate::data::readers::dialect::bare;
use crate::data::{FrfQuantity, Role};
use crate::units::{Dimension, parse_unit};

/// Words by which columns are named, of English and German rigs.
const WORDS: [(Role, &[&str]); 11] = [
    (Role::Time, &["t", "time", "zeit", "sec", "seconds", "timestamp", "datetime", "uhrzeit", "zeitstempel"]),
    (
        Role::Displacement,
        &["x", "u", "d", "disp", "displacement", "position", "pos", "stroke", "weg", "deflection", "lvdt", "angle", "rotation"],
    ),
    (Role::Velocity, &["v", "vel", "velocity", "speed", "geschwindigkeit"]),
    (Role::Acceleration, &["a", "acc", "accel", "acceleration", "beschleunigung"]),
    (Role::Force, &["f", "force", "load", "kraft", "cell", "loadcell", "hammer", "moment", "torque"]),
    (Role::Frequency, &["freq", "frequency", "frequenz", "hz"]),
    (Role::Real, &["re", "real"]),
    (Role::Imag, &["im", "imag", "imaginary"]),
    (Role::Phase, &["phase", "phi", "arg"]),
    (Role::Coherence, &["coh", "coherence", "gamma2", "kohaerenz"]),
    (Role::Damping, &["zeta", "damping", "daempfung", "dämpfung", "daempfungsgrad", "dämpfungsgrad"]),
];

/// The role a column seems to have: its unit decides where it can, else its name.
pub fn guess_role(name: &str, unit: Option<&str>) -> Option<Role> {
    let lower = bare(name).to_lowercase();
    let words: Vec<&str> = lower.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).collect();
    let called = |role: Role| {
        WORDS.iter().any(|(r, list)| {
            *r == role && words.iter().any(|w| list.contains(w) || list.contains(&w.trim_end_matches(|c: char| c.is_ascii_digit())))
        })
    };
    let magnitude = || words.iter().any(|w| ["amp", "amplitude", "mag", "magnitude", "abs"].contains(w));
    let Some(unit) = unit else {
        // `real(x)` is a part of something complex, whatever that is.
        if let Some(part) = [("real(", Role::Real), ("imag(", Role::Imag)].into_iter().find(|p| name.starts_with(p.0)) {
            return Some(part.1);
        }
        if magnitude() {
            return Some(Role::Amplitude);
        }
        return WORDS.iter().map(|w| w.0).find(|r| called(*r)).or((lower == "f" || lower == "h").then_some(Role::Frequency));
    };
    let is = |d: Dimension| parse_unit(unit, d).is_ok();
    if quantity(Some(unit)).is_some() {
        return [Role::Real, Role::Imag].into_iter().find(|r| called(*r)).or(magnitude().then_some(Role::Amplitude));
    }
    let by_unit: [(Role, &[Dimension]); 6] = [
        (Role::Time, &[Dimension::TIME]),
        (Role::Frequency, &[Dimension::FREQUENCY]),
        (Role::Displacement, &[Dimension::LENGTH]),
        (Role::Velocity, &[Dimension::VELOCITY, Dimension::ANGULAR_VELOCITY]),
        (Role::Acceleration, &[Dimension::ACCELERATION, Dimension::ANGULAR_ACCELERATION]),
        (Role::Force, &[Dimension::FORCE, Dimension::MOMENT]),
    ];
    if is(Dimension::ANGLE) {
        return Some(if called(Role::Phase) { Role::Phase } else { Role::Displacement });
    }
    let found = by_unit.iter().find(|(_, d)| d.iter().any(|d| is(*d))).map(|f| f.0);
    let named = || [Role::Coherence, Role::Damping].into_iter().find(|r| called(*r));
    found.or_else(|| named().filter(|_| is(Dimension::DIMENSIONLESS)))
}

/// Whether a column, alone or in a structure, is named by one letter and has no unit that says what it is: its role is a guess.
pub(super) fn by_letter(name: &str, unit: Option<&str>) -> bool {
    let bare = bare(name);
    let letters = bare.rsplit_once('.').map_or(bare, |(_, field)| field).trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
    unit.is_none() && letters.chars().count() == 1
}

/// What an FRF with a unit is.
pub(super) fn quantity(unit: Option<&str>) -> Option<FrfQuantity> {
    let unit = unit?;
    let all = [
        (FrfQuantity::Accelerance, Dimension::ACCELERANCE),
        (FrfQuantity::Mobility, Dimension::MOBILITY),
        (FrfQuantity::Receptance, Dimension::RECEPTANCE),
    ];
    all.into_iter().find(|(_, d)| parse_unit(unit, *d).is_ok()).map(|f| f.0)
}
