//! Where an effect acts: `at` against the model and the dataset.

use crate::data::{Dataset, Record, Role, Test};
use crate::effect::{Effect, Role as EffectRole};
use crate::model::{ChannelSite, Finder, Model, ModelError, Site};
use crate::units::Dimension;

/// A channel of a test that an effect may act on.
pub(super) struct TestChannel {
    /// The word that names it in `at`.
    pub role: &'static str,
    /// Where it measures, `name.axis`.
    pub at: String,
    /// Dimension of what it reads.
    pub dimension: Dimension,
}

/// The channels of a test. An FRF has its response and its force.
pub(super) fn channels(test: &Test) -> Vec<TestChannel> {
    match &test.record {
        Record::Cycle(r) | Record::Transient(r) => {
            r.channels.iter().map(|c| TestChannel { role: c.role.word(), at: c.at.clone(), dimension: c.unit.dimension }).collect()
        }
        Record::Frf(f) => {
            let along = |role: Role, at: &str| along(role.dimensions(), at);
            let response = along(Role::Displacement, &f.respond).over(Dimension::TIME.power(f.quantity.derivatives() as i8));
            vec![
                TestChannel { role: "response", at: f.respond.clone(), dimension: response },
                TestChannel { role: "force", at: f.excite.clone(), dimension: along(Role::Force, &f.excite) },
            ]
        }
        Record::Modal(_) | Record::Energy(_) | Record::Backbone(_) => vec![],
    }
}

/// Of a translational and a rotational dimension, the one of the axis of `at`.
pub(super) fn along(dimensions: &[Dimension], at: &str) -> Dimension {
    let index = usize::from(rotational(at)).min(dimensions.len().saturating_sub(1));
    dimensions.get(index).copied().unwrap_or(Dimension::DIMENSIONLESS)
}

/// Whether the axis of `name.axis` is a rotation.
pub(super) fn rotational(at: &str) -> bool {
    at.rsplit_once('.').and_then(|(_, axis)| crate::model::Axis::parse(axis).ok()).is_some_and(|a| a.rotational())
}

/// Resolves `at` (one entry of it where it is a list); errors say which entry.
pub(super) fn resolve(finder: &Finder, dataset: &Dataset, effect: &Effect, at: &[&str]) -> Result<Site, (usize, ModelError)> {
    let info = effect.info();
    if info.role == EffectRole::Channel {
        return match at {
            [one] => channel(dataset, one).and_then(|site| reads(dataset, effect, one, site)).map(Site::Channel).map_err(|e| (0, e)),
            _ => {
                let message = format!("`{}` acts on one channel, and {} are named", info.name, at.len());
                Err((1, ModelError::invalid(at.join(","), message, "one [[effect]] for each channel, or `*.force` for all of a role")))
            }
        };
    }
    if let Effect::Geometry(law) = effect {
        return match at {
            [one] => finder.model.outline(law.moves(), one).map(Site::Outline).map_err(|e| (0, e)),
            _ => {
                let message = format!("`{}` moves one chain or point, and {} are named", info.name, at.len());
                Err((1, ModelError::invalid(at.join(","), message, "one [[effect]] for each")))
            }
        };
    }
    finder.all_places(at).map(Site::Places)
}

/// Refuses an effect of a load cell, or of an accelerometer, on what is none.
fn reads(dataset: &Dataset, effect: &Effect, at: &str, site: ChannelSite) -> Result<ChannelSite, ModelError> {
    let Effect::Channel(law) = effect else { return Ok(site) };
    let Some(role) = law.reads().filter(|role| *role != site.role) else { return Ok(site) };
    let who = if role == Role::Force.word() { "what a load cell reads" } else { "the responses of FRFs" };
    let has = |t: &&Test| channels(t).iter().any(|c| c.role == role);
    let known: Vec<String> = dataset.tests.iter().filter(has).take(5).map(|t| format!("{}.{role}", t.id)).collect();
    let message = format!("`{}` acts on {who}, and `{at}` is a {}", effect.info().name, site.role);
    let accepted =
        if known.is_empty() { format!("a test with a {role} channel") } else { format!("`*.{role}`, or one of {}", known.join(", ")) };
    Err(ModelError::invalid(at, message, accepted))
}

/// `loop-1Hz.force`, `*.force`.
fn channel(dataset: &Dataset, at: &str) -> Result<ChannelSite, ModelError> {
    let all = || dataset.tests.iter().flat_map(|t| channels(t).into_iter().map(move |c| (t.id.as_str(), c)));
    let mut known: Vec<String> =
        all().map(|(id, c)| format!("{id}.{}", c.role)).chain(all().map(|(_, c)| format!("*.{}", c.role))).collect();
    let mut seen = std::collections::HashSet::new();
    known.retain(|k| seen.insert(k.clone()));
    let Some((test, role)) = at.rsplit_once('.') else { return Err(ModelError::no_such("channel", at, known)) };
    if test != "*" && dataset.test(test).is_none() {
        return Err(ModelError::no_such("test", test, dataset.tests.iter().map(|t| t.id.clone()).chain(["*".to_string()])));
    }
    let covered: Vec<TestChannel> = all().filter(|(id, c)| (test == "*" || *id == test) && c.role == role).map(|(_, c)| c).collect();
    let Some(first) = covered.first() else {
        known.retain(|k| k.strip_prefix(test).is_some_and(|rest| rest.starts_with('.')));
        return Err(ModelError::no_such("channel", at, known));
    };
    if let Some(odd) = covered.iter().find(|c| rotational(&c.at) != rotational(&first.at)) {
        let message = format!("`{at}` covers channels at `{}` and `{}`: no value has the units of both", first.at, odd.at);
        return Err(ModelError::invalid(at, message, "one [[effect]] for each test"));
    }
    Ok(ChannelSite { test: test.to_string(), role: role.to_string() })
}

/// Whether what acts there is a moment over an angle, and the dimension of the channel where it is one.
pub(super) fn nature(model: &Model, dataset: &Dataset, site: &Site) -> (bool, Dimension) {
    match site {
        Site::Places(places) => (places.first().is_some_and(|p| model.places[*p].axis.rotational()), Dimension::DIMENSIONLESS),
        Site::Channel(site) => dataset
            .tests
            .iter()
            .flat_map(|t| channels(t).into_iter().map(move |c| (t, c)))
            .find(|(t, c)| site.covers(&t.id, c.role))
            .map_or((false, Dimension::DIMENSIONLESS), |(_, c)| (rotational(&c.at), c.dimension)),
        Site::Outline(_) => (false, Dimension::DIMENSIONLESS),
    }
}
