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

/// What deviates.
const SPRING: &str = "linear_stiffness.k";
const MASS: &str = "mass";
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
    /// Of a spring the index of the instance that its group shares; a nominal mass has a number of its own.
    group: usize,
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

/// The system with deviations at `all` that it ties or fixes, or at what the study states alone; the system as it is where there are none.
pub fn given(case: &Case, system: &System, all: bool, settings: &Settings) -> (System, Slack) {
    let mut with = system.clone();
    let mut slack = Slack::default();
    let mut add = |member: Member, effect: &str, place: usize, stated: Option<f64>, width: f64, unit: (String, f64)| {
        let (Ok(effect), nominal) = (find(effect), member.nominal) else { return };
        let stands =
            system.instances.iter().any(|i| i.name() == effect.info().name && matches!(&i.site, Site::Places(p) if p.contains(&place)));
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
        slack.members.push(Member { instance: with.instances.len(), estimated: stated.is_none(), ..member });
        with.instances.push(Instance::new(effect, system.model.place_name(place), Site::Places(vec![place]), vec![value]));
    };
    for (at, width) in springs(system, all) {
        let (i, place) = at;
        let k = &system.instances[i].params[0];
        let at = system.model.place_name(place);
        let member = Member { instance: 0, parameter: SPRING, at, group: i, nominal: k.value, estimated: true };
        add(member, "stiffness_deviation", place, width, settings.slack_spring, k.unit.clone());
    }
    for (place, width) in masses(case, system, all) {
        let (body, mass) = body_at(system, place);
        let member =
            Member { instance: 0, parameter: MASS, at: body, group: system.instances.len() + place, nominal: mass, estimated: true };
        add(member, "mass_deviation", place, width, settings.slack_mass, ("kg".into(), 1.0));
    }
    if slack.members.iter().filter(|m| m.estimated).count() > settings.slack_members {
        return (system.clone(), Slack::default());
    }
    (with, slack)
}

/// Part of a value by which it may deviate at most: beyond it, it is not that part.
const MOST: f64 = 0.9;

/// Springs that share a stiffness or have a fixed one, with the width that the study states.
fn springs(system: &System, all: bool) -> Vec<((usize, usize), Option<f64>)> {
    let plain = system.model.space.is_none() && all;
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
fn masses(case: &Case, system: &System, all: bool) -> Vec<(usize, Option<f64>)> {
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
        let at = |i: &&Instance| {
            i.effect.info().role == Role::Force && i.name() == "added_mass" && matches!(&i.site, Site::Places(l) if l.contains(&p))
        };
        system.instances.iter().filter(|i| i.params.iter().any(|p| p.free)).any(|i| at(&i))
    };
    let stated = |dof: usize| {
        let name = &model.bodies[model.dofs[dof].body].name;
        case.search.mass_slack.iter().find(|(n, _)| n == name).map(|(_, w)| *w)
    };
    let found = (0..model.places.len()).filter(|p| !inertial(*p)).filter_map(|p| Some((p, stated(of(p)?))));
    found.filter(|(_, stated)| all || stated.is_some()).collect()
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
        if self.is_empty() {
            return system;
        }
        let spread = Covariance::of(fitted);
        for (kind, least, most) in
            [(SPRING, settings.slack_least, settings.slack_spring), (MASS, settings.slack_least, settings.slack_mass)]
        {
            let own: Vec<&Member> = self.members.iter().filter(|m| m.parameter == kind && m.estimated).collect();
            let square = |m: &&Member| {
                let (value, variance) = (system.instances[m.instance].params[0].value, spread.variance(&[(m.instance, 1.0)]));
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

    /// Nats that the deviations cost: `1/2 ln |I + W S'V^-1 S W|`, S their columns beside what the other parameters can do, W the widths they
    /// were fitted under. A model that needs no deviations has narrow widths and pays nothing.
    pub fn price(&self, fitted: &Fitted) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let covariance = Covariance::of(fitted);
        let at = |m: &Member| covariance.free.iter().position(|i| *i == m.instance);
        let width = |m: &Member| fitted.options.priors.iter().find(|p| Some(p.index) == at(m)).map(|p| p.sigma);
        let known: Vec<(usize, f64)> = self.members.iter().filter_map(|m| Some((at(m)?, width(m)?))).collect();
        // In units of the widths, the posterior covariance of the deviations is (I + W S'V^-1 S W)^-1.
        let own = DMatrix::from_fn(known.len(), known.len(), |i, j| covariance.all[(known[i].0, known[j].0)] / (known[i].1 * known[j].1));
        own.cholesky().map_or(0.0, |c| -c.l().diagonal().iter().map(|d| d.ln()).sum::<f64>())
    }

    /// Deviations that are large and sure, the largest first: of a spring from the mean of those of its group that do not deviate so, of a nominal
    /// value from that.
    pub fn corrections(&self, fitted: &Fitted, settings: &Settings) -> Vec<Correction> {
        let covariance = Covariance::of(fitted);
        let value = |instance: usize| fitted.system.instances[instance].params[0].value;
        // What a group has in common is its own parameter; a nominal value is what the study says.
        let common = |m: &Member| if m.parameter == SPRING { value(m.group) } else { m.nominal };
        let mut open: Vec<usize> = (0..self.members.len()).collect();
        let mut told = Vec::new();
        // Deviation of a member from the mean of those of its group that are open, and its standard deviation: own / mean - 1.
        let of = |k: usize, open: &[usize]| {
            let m = &self.members[k];
            let others: Vec<usize> =
                open.iter().filter(|j| **j != k && self.members[**j].group == m.group).map(|j| self.members[*j].instance).collect();
            let n = others.len().max(1) as f64;
            let (own, mean) = (common(m) + value(m.instance), common(m) + others.iter().map(|o| value(*o)).sum::<f64>() / n);
            let mut weights = vec![(m.instance, 1.0 / mean)];
            weights.extend(others.iter().map(|o| (*o, -own / (n * mean * mean))));
            if m.parameter == SPRING {
                weights.push((m.group, 1.0 / mean - own / (mean * mean)));
            }
            (own / mean - 1.0, covariance.variance(&weights).sqrt())
        };
        loop {
            let sure = open.iter().map(|k| (*k, of(*k, &open))).filter(|(_, (relative, std))| {
                relative.abs() > settings.correction_least && relative.abs() > settings.correction_sure * std
            });
            let Some((k, (relative, std))) = sure.max_by(|a, b| a.1.0.abs().total_cmp(&b.1.0.abs())) else { return told };
            open.retain(|j| *j != k);
            told.push(Correction { parameter: self.members[k].parameter.into(), at: self.members[k].at.clone(), relative, std });
        }
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

/// Covariance of the first parameters of instances, from the Jacobian of their fit with the rows of the priors.
struct Covariance {
    free: Vec<usize>,
    all: DMatrix<f64>,
}

impl Covariance {
    fn of(fitted: &Fitted) -> Self {
        let j = &fitted.outcome.jacobian;
        let size: Vec<f64> = j.column_iter().map(|c| c.norm()).map(|n| if n > 0.0 { n } else { 1.0 }).collect();
        let scaled = DMatrix::from_fn(j.nrows(), j.ncols(), |i, k| j[(i, k)] / size[k]);
        let inverse = (scaled.transpose() * &scaled).pseudo_inverse(1e-12).unwrap_or_else(|_| DMatrix::zeros(j.ncols(), j.ncols()));
        let all = DMatrix::from_fn(j.ncols(), j.ncols(), |a, b| inverse[(a, b)] / (size[a] * size[b]));
        Covariance { free: fitted.free.iter().map(|f| f.instance).collect(), all }
    }

    /// Variance of a weighted sum of (instance, weight).
    fn variance(&self, weights: &[(usize, f64)]) -> f64 {
        let at = |instance: usize| self.free.iter().position(|i| *i == instance);
        let known: Vec<(usize, f64)> = weights.iter().filter_map(|(i, w)| Some((at(*i)?, *w))).collect();
        known
            .iter()
            .flat_map(|(a, x)| known.iter().map(move |(b, y)| (*a, *b, x * y)))
            .map(|(a, b, w)| w * self.all[(a, b)])
            .sum::<f64>()
            .max(0.0)
    }
}
