//! Dimensions of parameters, and the units they are written in when nobody chose one.

use crate::data::Dataset;
use crate::effect::Dim;
use crate::model::{Instance, System, Target};
use crate::units::{Dimension, Unit, parse_unit};

use super::site;

/// Units for machine parts: newton, millimetre, second; radian for rotations.
const UNITS: [&str; 24] = [
    "N/mm",
    "N s/mm",
    "N",
    "mm",
    "mm/s",
    "mm/N",
    "N/mm3",
    "N/mm2",
    "kg",
    "s",
    "Hz",
    "N m/rad",
    "N m s/rad",
    "N m",
    "rad",
    "rad/s",
    "kg m2",
    "N s2/mm2",
    "N/s",
    "s/mm",
    "N m s2/rad2",
    "N m/rad2",
    "N m/rad3",
    "s/rad",
];

/// The dimension of a parameter: `place` along a translation or about a rotation, `channel` for a channel effect, `condition` for a
/// coefficient.
pub(super) fn dimension(dim: Dim, rotational: bool, channel: Dimension, condition: Dimension) -> Dimension {
    let (force, length) = if rotational { (Dimension::MOMENT, Dimension::ANGLE) } else { (Dimension::FORCE, Dimension::LENGTH) };
    match dim {
        Dim::One => Dimension::DIMENSIONLESS,
        Dim::Channel => channel,
        Dim::ChannelPerTime => channel.over(Dimension::TIME),
        Dim::Declared(dimension) => dimension,
        Dim::PerCondition => Dimension::DIMENSIONLESS.over(condition),
        // A moment of inertia: its radians are not written.
        Dim::Place { f: 1, x: -1, t: 2 } => {
            if rotational {
                Dimension::INERTIA
            } else {
                Dimension::MASS
            }
        }
        Dim::Place { f, x, t } => force.power(f).times(length.power(x)).times(Dimension::TIME.power(t)),
    }
}

/// The dimension of parameter `param` of an instance of `system`, whose conditions `dataset` states.
pub fn dimension_of(system: &System, dataset: &Dataset, instance: &Instance, param: usize) -> Dimension {
    let Some(info) = instance.effect.info().params.get(param) else { return Dimension::DIMENSIONLESS };
    let (rotational, channel) = site::nature(&system.model, dataset, &instance.site);
    let condition = instance.target.as_ref().map_or(Dimension::DIMENSIONLESS, |t| t.unit.dimension);
    dimension(info.dim, rotational, channel, condition)
}

/// The unit to print a parameter in: the one the engineer wrote, else the usual one in newton, millimetre, second and radian.
pub fn unit_of(system: &System, dataset: &Dataset, instance: &Instance, param: usize) -> Unit {
    let dimension = dimension_of(system, dataset, instance, param);
    let written = instance.params.get(param).map(|p| p.unit.0.as_str()).filter(|symbol| !symbol.is_empty());
    if let Some(unit) = written.and_then(|symbol| parse_unit(symbol, dimension).ok()) {
        return unit;
    }
    // As other effects and the channels have it: an engineer who writes kip and inches reads them.
    let others = system.instances.iter().flat_map(|i| &i.params).map(|p| p.unit.0.as_str()).filter(|symbol| !symbol.is_empty());
    let written = others.filter_map(|symbol| parse_unit(symbol, dimension).ok()).find(|u| u.dimension == dimension);
    if let Some(unit) = written.or_else(|| channel(dataset, dimension)) {
        return unit;
    }
    let per_condition = instance.target.as_ref().map(Target::per_unit).filter(|u| u.dimension == dimension);
    per_condition
        .or_else(|| UNITS.iter().filter_map(|u| parse_unit(u, dimension).ok()).find(|u| u.dimension == dimension))
        .unwrap_or_else(|| Unit::si(dimension))
}

/// The unit of the first channel of this dimension.
fn channel(dataset: &Dataset, dimension: Dimension) -> Option<Unit> {
    let of = |t: &crate::data::Test| match &t.record {
        crate::data::Record::Cycle(r) | crate::data::Record::Transient(r) => r.channels.iter().map(|c| c.unit.clone()).collect(),
        _ => vec![],
    };
    dataset.tests.iter().flat_map(of).find(|u: &Unit| u.dimension == dimension)
}

/// The unit a condition is first stated in.
pub(super) fn condition(dataset: &Dataset, name: &str) -> Option<Unit> {
    dataset.tests.iter().find_map(|t| {
        let rows = match &t.record {
            crate::data::Record::Energy(table) => table.rows.as_slice(),
            _ => &[],
        };
        std::iter::once(&t.conditions).chain(rows.iter().map(|r| &r.conditions)).find_map(|c| c.get(name)).map(|c| c.unit.clone())
    })
}
