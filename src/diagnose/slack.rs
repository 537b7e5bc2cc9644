//! Base slack: what a study ties or fixes (the springs of a group, a nominal mass) deviates a little.
//!
//! Every member m of a group and every nominal value v_m gets a deviation `d_m ~ N(0, w^2 v_m^2)` that is fitted with the base and with every
//! candidate, so that no candidate is believed for what a spring that is 3 % off explains. The width w of each kind is estimated from the
//! deviations themselves (empirical Bayes: `w^2 = mean(d_m^2 + var d_m) / v_m^2`) between what any workshop does and what it would call
//! another part. A deviation that is large and sure is a correction of the model, told apart from missing physics.

use nalgebra::DMatrix;

use crate::effect::{Role, find};
use crate::model::{Instance, ParamValue, Site, System};

use super::case::{Case, Fitted};
use super::results::Correction;
use super::settings::Settings;

/// The effects that stand for deviations.
const FAMILY: &str = "deviation";

/// Whether an instance is a deviation.
pub fn deviates(instance: &Instance) -> bool {
    instance.effect.info().family == FAMILY
}

/// What a deviation belongs to.
#[derive(Clone, Debug)]
struct Member {
    /// Index of its instance.
    instance: usize,
    /// The parameter that deviates: `linear_stiffness.k`, `mass`.
    parameter: &'static str,
    /// The spring's place, the body.
    at: String,
    /// What the study says [SI]; of a free stiffness its value when the slack was given.
    nominal: f64,
    /// Whether the width of its prior is estimated with those of its kind; one that the study states is not.
    estimated: bool,
}

/// The deviations of a climb.
#[derive(Clone, Debug, Default)]
pub struct Slack {
    members: Vec<Member>,
}

/// The system with deviations at whatever it ties or fixes; the system as it is where there are none.
pub fn given(case: &Case, system: &System, settings: &Settings) -> (System, Slack) {
    let mut with = system.clone();
    let mut slack = Slack::default();
    let mut add = |parameter: &'static str, effect: &str, place: usize, at: String, nominal: f64, stated: Option<f64>, width: f64, unit: (String, f64)| {
        let Ok(effect) = find(effect) else { return };
        let stands = system.instances.iter().any(|i| i.name() == effect.info().name && matches!(&i.site, Site::Places(p) if p.contains(&place)));
        if stands || !(nominal.is_finite() && nominal > 0.0) {
            return;
        }
        let value = ParamValue {
            min: -MOST * nominal,
            max: MOST * nominal,
            free: true,
            prior: Some((0.0, stated.unwrap_or(width) * nominal)),
            unit,
            ..ParamValue::fixed(0.0)
        };
        slack.members.push(Member { instance: with.instances.len(), parameter, at, nominal, estimated: stated.is_none() });
        with.instances.push(Instance::new(effect, system.model.place_name(place), Site::Places(vec![place]), vec![value]));
    };
    for (at, width) in springs(case, system) {
        let (i, place) = at;
        let k = &system.instances[i].params[0];
        add("linear_stiffness.k", "stiffness_deviation", place, system.model.place_name(place), k.value, width, settings.slack_spring, k.unit.clone());
    }
    for (place, width) in masses(case, system) {
        let (body, mass) = body_at(system, place);
        add("mass", "mass_deviation", place, body, mass, width, settings.slack_mass, (String::new(), 1.0));
    }
    if slack.members.iter().filter(|m| m.estimated).count() > settings.slack_members {
        return (system.clone(), Slack::default());
    }
    (with, slack)
}

/// Part of a value by which it may deviate at most: beyond it, it is not that part.
const MOST: f64 = 0.9;

/// Springs that share a stiffness or have a fixed one, with the width that the study states.
fn springs(case: &Case, system: &System) -> Vec<((usize, usize), Option<f64>)> {
    let plain = system.model.space.is_none() && case.search.slack;
    let mut found = Vec::new();
    for (i, instance) in system.instances.iter().enumerate() {
        let Site::Places(places) = &instance.site else { continue };
        let stated = instance.params.first().and_then(|p| p.slack);
        let tied = places.len() > 1 || instance.params.first().is_some_and(|p| !p.free);
        if instance.name() == "linear_stiffness" && instance.only.is_none() && (stated.is_some() || (tied && plain)) {
            found.extend(places.iter().map(|p| ((i, *p), stated)));
        }
    }
    found
}

/// Places of the bodies with a mass, the first axis of each, with the width that the study states.
fn masses(case: &Case, system: &System) -> Vec<(usize, Option<f64>)> {
    let model = &system.model;
    if model.space.is_some() {
        return vec![];
    }
    let weighs = |dof: usize| !model.dofs[dof].axis.rotational() && model.dofs[dof].mass > 0.0;
    let of = |p: usize| {
        let place = &model.places[p];
        let dof = if place.from.is_none() { place.to } else { None }?;
        let first = (0..dof).all(|d| model.dofs[d].body != model.dofs[dof].body || !weighs(d));
        (!model.on_connector(p) && weighs(dof) && first).then_some(dof)
    };
    let inertial = |p: usize| {
        let at = |i: &&Instance| i.effect.info().role == Role::Force && i.name() == "added_mass" && matches!(&i.site, Site::Places(l) if l.contains(&p));
        system.instances.iter().filter(|i| i.params.iter().any(|p| p.free)).any(|i| at(&i))
    };
    let stated = |dof: usize| {
        let name = &model.bodies[model.dofs[dof].body].name;
        case.search.mass_slack.iter().find(|(n, _)| n == name).map(|(_, w)| *w)
    };
    let all = (0..model.places.len()).filter(|p| !inertial(*p)).filter_map(|p| Some((p, stated(of(p)?))));
    all.filter(|(_, stated)| case.search.slack || stated.is_some()).collect()
}

/// Name and mass of the body whose place this is.
fn body_at(system: &System, place: usize) -> (String, f64) {
    let model = &system.model;
    let dof = model.places[place].to.unwrap_or_default();
    (model.bodies[model.dofs[dof].body].name.clone(), model.dofs[dof].mass)
}

impl Slack {
    /// Whether nothing deviates.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// How many deviations there are.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether a parameter of this name is one of them.
    pub fn is_own(&self, name: &str) -> bool {
        !self.is_empty() && (name.contains(".stiffness_deviation.") || name.contains(".mass_deviation."))
    }

    /// The system with the widths that its deviations, as they were fitted, speak for.
    pub fn widened(&self, fitted: &Fitted, settings: &Settings) -> System {
        let mut system = fitted.system.clone();
        let spread = deviations(fitted);
        for (kind, least, most) in
            [("linear_stiffness.k", settings.slack_least, settings.slack_spring), ("mass", settings.slack_least, settings.slack_mass)]
        {
            let own: Vec<&Member> = self.members.iter().filter(|m| m.parameter == kind && m.estimated).collect();
            let square = |m: &&Member| {
                let (value, variance) = (system.instances[m.instance].params[0].value, spread(m.instance));
                (value * value + variance) / (m.nominal * m.nominal)
            };
            let mean = own.iter().map(square).sum::<f64>() / own.len().max(1) as f64;
            let width = mean.sqrt().clamp(least, most);
            for m in own {
                system.instances[m.instance].params[0].prior = Some((0.0, width * m.nominal));
            }
        }
        system
    }

    /// Deviations that are large and sure.
    pub fn corrections(&self, fitted: &Fitted, settings: &Settings) -> Vec<Correction> {
        let spread = deviations(fitted);
        let of = |m: &Member| {
            let relative = fitted.system.instances[m.instance].params[0].value / m.nominal;
            let std = spread(m.instance).sqrt() / m.nominal;
            let large = relative.abs() > settings.correction_least && relative.abs() > settings.correction_sure * std;
            large.then(|| Correction { parameter: m.parameter.into(), at: m.at.clone(), relative, std })
        };
        let mut all: Vec<Correction> = self.members.iter().filter_map(of).collect();
        all.sort_by(|a, b| b.relative.abs().total_cmp(&a.relative.abs()));
        all
    }

    /// The system with its deviations held, as it is written: what is too small to matter goes with it, so that the errors are those that were told.
    pub fn held(&self, system: &System) -> System {
        let mut held = system.clone();
        for m in &self.members {
            let p = &mut held.instances[m.instance].params[0];
            (p.free, p.prior) = (false, None);
        }
        held
    }
}

/// Variance of the first parameter of an instance, from the Jacobian of its fit with the rows of the priors; that of its prior where the tests
/// say nothing.
fn deviations(fitted: &Fitted) -> impl Fn(usize) -> f64 {
    let j = &fitted.outcome.jacobian;
    let size: Vec<f64> = j.column_iter().map(|c| c.norm()).map(|n| if n > 0.0 { n } else { 1.0 }).collect();
    let scaled = DMatrix::from_fn(j.nrows(), j.ncols(), |i, k| j[(i, k)] / size[k]);
    let covariance = (scaled.transpose() * &scaled).pseudo_inverse(1e-12).unwrap_or_else(|_| DMatrix::zeros(j.ncols(), j.ncols()));
    let free: Vec<usize> = fitted.free.iter().map(|f| f.instance).collect();
    move |instance| free.iter().position(|i| *i == instance).map_or(0.0, |k| covariance[(k, k)] / (size[k] * size[k]))
}
