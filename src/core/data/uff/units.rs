//! Units of a function: from its labels, and from set 164.

use super::function::{Axis, FunctionHeader};
use super::header::UnitSystem;
use crate::data::{FrfQuantity, Note};
use crate::units::{Dimension, Unit, parse_unit, parse_unit_any};

/// What the file says of the unit of an axis.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AxisUnit {
    /// The unit, where label and set 164 give one and do not contradict each other.
    pub unit: Option<Unit>,
    /// As it stands in the file, or as set 164 implies it.
    pub text: String,
    pub finding: Option<Note>,
}

/// Abscissa, ordinate, and what an FRF is.
pub fn describe(header: &FunctionHeader, system: Option<&UnitSystem>) -> (AxisUnit, AxisUnit, Option<FrfQuantity>) {
    let abscissa_dimension = match header.abscissa.data_type {
        18 => Some(Dimension::FREQUENCY),
        17 => Some(Dimension::TIME),
        _ => None,
    };
    let mut abscissa = from_label(&header.abscissa.unit, abscissa_dimension);
    // Time and frequency have no factor in set 164: they are in seconds and hertz.
    if abscissa.unit.is_none()
        && let Some(d) = abscissa_dimension
    {
        abscissa.unit = Some(Unit::si(d));
    }
    if header.function_type == 4 {
        let (ordinate, quantity) = frf(header, system);
        return (abscissa, ordinate, quantity);
    }
    let dimension = match header.function_type {
        6 | 26 => Some(Dimension::DIMENSIONLESS),
        0 | 1 | 12 => dimension(&header.ordinate, header.response.direction),
        _ => None,
    };
    let label = from_label(&header.ordinate.unit, dimension);
    let implied = dimension.and_then(|d| implied(d, system));
    (abscissa, agree(label, implied), None)
}

/// The dimension of a specific data type at a degree of freedom.
fn dimension(axis: &Axis, direction: i64) -> Option<Dimension> {
    let about = direction.abs() > 3;
    let one = |along, rotation| Some(if about { rotation } else { along });
    match axis.data_type {
        2 | 15 => Some(Dimension::PRESSURE),
        3 | 20 => Some(Dimension::DIMENSIONLESS),
        5 => Some(Dimension::TEMPERATURE),
        8 => one(Dimension::LENGTH, Dimension::ANGLE),
        9 | 13 => one(Dimension::FORCE, Dimension::MOMENT),
        11 => one(Dimension::VELOCITY, Dimension::ANGULAR_VELOCITY),
        12 => one(Dimension::ACCELERATION, Dimension::ANGULAR_ACCELERATION),
        16 => Some(Dimension::MASS),
        17 => Some(Dimension::TIME),
        18 => Some(Dimension::FREQUENCY),
        19 => Some(Dimension::ANGULAR_VELOCITY),
        _ => None,
    }
}

fn frf(header: &FunctionHeader, system: Option<&UnitSystem>) -> (AxisUnit, Option<FrfQuantity>) {
    let quantity = match header.ordinate.data_type {
        8 => Some(FrfQuantity::Receptance),
        11 => Some(FrfQuantity::Mobility),
        12 => Some(FrfQuantity::Accelerance),
        _ => None,
    };
    let about = |direction: i64| direction.abs() > 3;
    let force = if about(header.reference.direction) { Dimension::MOMENT } else { Dimension::FORCE };
    let motion = |q: FrfQuantity| {
        let place = if about(header.response.direction) { Dimension::ANGLE } else { Dimension::LENGTH };
        place.over(Dimension::TIME.power(q.derivatives() as i8))
    };
    let label = |q: FrfQuantity| {
        let text = clean(&header.ordinate.unit);
        let whole = parse_unit(text, motion(q).over(force)).ok();
        let (above, below) = (text, clean(&header.denominator.unit));
        let parts = || {
            parse_unit(above, motion(q)).ok()?;
            parse_unit(below, force).ok()?;
            parse_unit(&format!("({above})/({below})"), motion(q).over(force)).ok()
        };
        whole.or_else(parts)
    };
    if let Some(q) = quantity {
        let found = label(q);
        let text = found.as_ref().map_or(header.ordinate.unit.clone(), |u| u.symbol.clone());
        let finding = (found.is_none() && !header.ordinate.unit.is_empty())
            .then(|| Note::new("unit", format!("the label `{}` is no unit of {} {}", header.ordinate.unit, article(q), q.word())));
        let stated = AxisUnit { unit: found, text, finding };
        return (agree(stated, implied(motion(q).over(force), system)), Some(q));
    }
    // Without data types the unit alone says what it is.
    let all = [FrfQuantity::Accelerance, FrfQuantity::Mobility, FrfQuantity::Receptance];
    match all.into_iter().find_map(|q| label(q).map(|u| (u, q))) {
        Some((unit, q)) => {
            let text = unit.symbol.clone();
            (agree(AxisUnit { unit: Some(unit), text, finding: None }, implied(motion(q).over(force), system)), Some(q))
        }
        None => {
            let finding =
                Note::new("unit", format!("neither data types nor the label `{}` say what is divided by what", header.ordinate.unit));
            (AxisUnit { unit: None, text: header.ordinate.unit.clone(), finding: Some(finding) }, None)
        }
    }
}

fn article(q: FrfQuantity) -> &'static str {
    if q == FrfQuantity::Accelerance { "an" } else { "a" }
}

/// A label without the brackets around it.
fn clean(text: &str) -> &str {
    let text = text.trim();
    let inner = text.strip_prefix('[').and_then(|t| t.strip_suffix(']'));
    inner.unwrap_or(text).trim()
}

fn from_label(text: &str, expected: Option<Dimension>) -> AxisUnit {
    let text = clean(text);
    if text.is_empty() {
        return AxisUnit::default();
    }
    let unit = match expected {
        Some(d) => parse_unit(text, d).ok(),
        None => parse_unit_any(text).ok(),
    };
    let finding = unit.is_none().then(|| {
        let what = expected.map_or(String::new(), |d| format!(" of {}", d.name()));
        Note::new("unit", format!("the label `{text}` is no unit{what} that is known"))
    });
    AxisUnit { unit, text: text.to_string(), finding }
}

/// The unit that set 164 implies for a dimension of length, force and time; none where its factors are not those of known units.
fn implied(d: Dimension, system: Option<&UnitSystem>) -> Option<Unit> {
    let system = system?;
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-5;
    let named = |factor: f64, all: &[(&'static str, f64)]| all.iter().find(|(_, f)| near(factor, *f)).map(|(name, _)| *name);
    let length = named(system.length, &[("m", 1.0), ("mm", 1e3), ("cm", 1e2), ("um", 1e6), ("in", 1.0 / 0.0254), ("ft", 1.0 / 0.3048)])?;
    const POUND: f64 = 4.448_221_615_260_5;
    let force = named(system.force, &[("N", 1.0), ("mN", 1e3), ("cN", 1e2), ("kN", 1e-3), ("lbf", 1.0 / POUND), ("kgf", 1.0 / 9.806_65)])?;
    // [L^a M^b T^c] in length, force and time: M = F T^2 / L.
    let powers = [(length, d.length - d.mass), (force, d.mass), ("s", d.time + 2 * d.mass), ("rad", d.angle)];
    let word = |p: &(&str, i8)| format!("{}^{}", p.0, p.1);
    let text: Vec<String> = powers.iter().filter(|p| p.1 != 0).map(word).collect();
    if text.is_empty() {
        return None;
    }
    parse_unit(&text.join(" "), d).ok()
}

/// The label wins where both agree; where they do not, the file contradicts itself and the unit has to be declared.
fn agree(label: AxisUnit, implied: Option<Unit>) -> AxisUnit {
    match (label.unit, implied) {
        (Some(l), Some(i)) if (l.factor / i.factor - 1.0).abs() > 1e-5 => {
            let finding = Note::new(
                "unit",
                format!("the label says `{}`, and set 164 implies `{}`; the unit has to be declared", l.symbol, i.symbol),
            );
            AxisUnit { unit: None, text: label.text, finding: Some(finding) }
        }
        (Some(l), _) => AxisUnit { unit: Some(l), ..AxisUnit { unit: None, ..label } },
        (None, Some(i)) if label.text.is_empty() => AxisUnit { text: i.symbol.clone(), unit: Some(i), finding: None },
        (None, i) => AxisUnit { unit: i.filter(|_| label.text.is_empty()), ..AxisUnit { unit: None, ..label } },
    }
}
