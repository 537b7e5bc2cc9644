//! Base slack: what a study ties or fixes (the springs of a group, a nominal mass) deviates a little.
//!
//! Every member m of a group and every nominal value v_m gets a deviation `d_m ~ N(0, w^2 v_m^2)` that is fitted with the base and with every
//! candidate, so that no candidate is believed for what a spring that is 3 % off explains. The width w of each kind is estimated from the
//! deviations themselves (empirical Bayes: `w^2 = mean(d_m^2 + var d_m) / v_m^2`) between what any workshop does and what it would call
//! another part. A deviation that is large and sure is a correction of the model, told apart from missing physics.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use crate::effect::{Effect, find};
use crate::model::{Instance, ParamValue, Site, System};

use super::case::{Case, Fitted};
use crate::diagnose::results::{BETWEEN, Correction, END};
use crate::diagnose::settings::Settings;

/// What deviates.
const SPRING: &str = "linear_stiffness.k";
const DAMPER: &str = "viscous.c";
const MASS: &str = "mass";
/// Its part at the nodes, a number that follows it.
const NODES: &str = "mass beside nodes";
/// The deviation of a spring, which a search looks for by itself as well: a spring beside another makes that stiffer alone.
pub const SOFTER: &str = "stiffness_deviation";
/// The effects that stand for deviations.
const FAMILY: &str = "deviation";

/// Whether an effect is a deviation, and so no candidate for missing physics.
pub fn deviates(effect: &Effect) -> bool {
    effect.info().family == FAMILY
}

/// What a deviation belongs to.
#[derive(Clone, Debug)]
struct Member {
    /// Index of its instance.
    instance: usize,
    /// The parameter that deviates: `linear_stiffness.k`, `viscous.c`, `mass`, `mass between nodes`, `mass of an end`.
    parameter: &'static str,
    /// The place of the spring or damper, the body.
    at: String,
    /// Of a spring or damper the index of the instance that its group shares; a nominal mass has a number of its own.
    group: usize,
    /// What the study says [SI]; of a free parameter its value when the slack was given.
    nominal: f64,
    /// Whether the width of its prior is estimated with those of its kind; one that the study states is not.
    estimated: bool,
}

/// The deviations of a climb.
#[derive(Clone, Debug, Default)]
pub struct Slack {
    members: Vec<Member>,
}

/// What is to deviate: at these places together, within the width that the study states, if it does.
struct Nominal {
    parameter: &'static str,
    effect: &'static str,
    at: String,
    places: Vec<usize>,
    group: usize,
    value: f64,
    stated: Option<f64>,
    unit: (String, f64),
}

/// The system with deviations at `all` that it ties or fixes, or at what the study states alone; the system as it is where there are none. Where
/// there would be more than [`Settings::slack_members`] unasked, those that the study states stand alone.
pub fn given(case: &Case, system: &System, all: bool, settings: &Settings) -> (System, Slack) {
    let mut nominal = tied(system, all);
    let between = between(system, all);
    let end = |n: &Nominal| n.stated.is_none() && between.as_ref().is_some_and(|b| ends(system, n, b));
    nominal.extend(masses(case, system, all).into_iter().map(|n| Nominal { parameter: if end(&n) { END } else { n.parameter }, ..n }));
    let nodes = between.as_ref().map(|b| nodes(system, b));
    nominal.extend(between);
    nominal.retain(|n| !stands(system, n) && n.value.is_finite() && n.value > 0.0);
    if nominal.iter().filter(|n| n.stated.is_none()).count() > settings.slack_members {
        nominal.retain(|n| n.stated.is_some());
    }
    let (mut with, mut slack) = (system.clone(), Slack::default());
    for n in nominal {
        let Ok(effect) = find(n.effect) else { continue };
        let width = widest(n.parameter, settings);
        let [least, most] = reach(n.parameter, settings).map(|part| part * n.value);
        let prior = Some((0.0, n.stated.unwrap_or(width) * n.value));
        let value = ParamValue { min: least, max: most, free: true, prior, unit: n.unit, ..ParamValue::fixed(0.0) };
        let (instance, estimated) = (with.instances.len(), n.stated.is_none());
        slack.members.push(Member { instance, parameter: n.parameter, at: n.at, group: n.group, nominal: n.value, estimated });
        let at: Vec<String> = n.places.iter().map(|p| system.model.place_name(*p)).collect();
        with.instances.push(deviation(effect, at.join(","), n.places, value));
    }
    // What follows the mass between the nodes stands where that does.
    if slack.members.iter().any(|m| m.parameter == BETWEEN) {
        for (effect, place) in find("node_deviation").ok().into_iter().flat_map(|e| nodes.iter().flatten().map(move |p| (e, *p))) {
            let (instance, at) = (with.instances.len(), system.model.place_name(place));
            slack.members.push(Member { instance, parameter: NODES, at: at.clone(), group: usize::MAX, nominal: 1.0, estimated: false });
            with.instances.push(deviation(effect, at, vec![place], ParamValue::fixed(0.0)));
        }
    }
    (with, slack)
}

/// A deviation with this first parameter; its others come from the model.
fn deviation(effect: &'static Effect, at: String, places: Vec<usize>, value: ParamValue) -> Instance {
    let others = effect.info().params.iter().skip(1).map(|p| ParamValue::fixed(p.default));
    Instance::new(effect, at, Site::Places(places), std::iter::once(value).chain(others).collect())
}

/// Parts of a nominal value between which a deviation lies.
fn reach(parameter: &str, settings: &Settings) -> [f64; 2] {
    match parameter {
        BETWEEN => [0.0, settings.slack_reach],
        // Half of what lies on its spring.
        END => [-0.5 * settings.slack_reach, settings.slack_mass],
        _ => [-settings.slack_reach, settings.slack_reach],
    }
}

/// Whether a body ends a chain of springs with mass on them: those of one connector alone hang on it, or one leads to the ground, which may hold a part of
/// that mass.
fn ends(system: &System, mass: &Nominal, between: &Nominal) -> bool {
    let model = &system.model;
    let own: Vec<usize> = mass.places.iter().filter_map(|p| model.places[*p].to).collect();
    let here = |p: &&usize| [model.places[**p].from, model.places[**p].to].iter().flatten().any(|d| own.contains(d));
    let beside: Vec<usize> = between.places.iter().filter(here).copied().collect();
    let mut connectors: Vec<usize> = beside.iter().map(|p| model.places[*p].connector).collect();
    connectors.sort_unstable();
    connectors.dedup();
    connectors.len() == 1 || beside.iter().any(|p| model.places[*p].from.is_none() || model.places[*p].to.is_none())
}

/// Places of the bodies beside these springs.
fn nodes(system: &System, between: &Nominal) -> Vec<usize> {
    let model = &system.model;
    let mut dofs: Vec<usize> = between.places.iter().flat_map(|p| [model.places[*p].from, model.places[*p].to]).flatten().collect();
    dofs.sort_unstable();
    dofs.dedup();
    let of = |dof: usize| {
        let own = |p: &usize| model.places[*p].to == Some(dof) && model.places[*p].from.is_none() && !model.on_connector(*p);
        (0..model.places.len()).find(own)
    };
    dofs.into_iter().filter_map(of).collect()
}

/// Whether the system has this deviation already.
fn stands(system: &System, n: &Nominal) -> bool {
    let there = |i: &Instance| i.name() == n.effect && matches!(&i.site, Site::Places(p) if n.places.iter().any(|own| p.contains(own)));
    system.instances.iter().any(there)
}

/// Width of the prior of a deviation at most.
fn widest(parameter: &str, settings: &Settings) -> f64 {
    match parameter {
        SPRING => settings.slack_spring,
        DAMPER => settings.slack_damper,
        BETWEEN => settings.slack_between,
        END => 0.5 * settings.slack_between,
        _ => settings.slack_mass,
    }
}

/// Width of the prior of a deviation at least.
fn narrowest(parameter: &str, settings: &Settings) -> f64 {
    if parameter == BETWEEN { settings.slack_between_least } else { settings.slack_least }
}

/// For the deviation of a spring, the stiffness [SI] at every place where the study ties or fixes it and lets it deviate; none for other effects, which need
/// nothing to deviate from.
pub fn tied_stiffness(case: &Case, effect: &Effect, system: &System) -> Option<BTreeMap<Vec<usize>, f64>> {
    if !deviates(effect) {
        return None;
    }
    let nominal = if case.search.slack == Some(false) { vec![] } else { tied(system, true) };
    let springs = nominal.into_iter().filter(|n| n.effect == SOFTER && n.value > 0.0).map(|n| (n.places, n.value));
    Some(springs.collect())
}

/// Springs and dampers that share a coefficient or have a fixed one.
fn tied(system: &System, all: bool) -> Vec<Nominal> {
    let plain = system.model.space.is_none() && all;
    let mut found = Vec::new();
    for (group, instance) in system.instances.iter().enumerate() {
        let (Site::Places(places), Some(k)) = (&instance.site, instance.params.first()) else { continue };
        let (parameter, effect) = match instance.name() {
            "linear_stiffness" => (SPRING, SOFTER),
            "viscous" => (DAMPER, "damping_deviation"),
            _ => continue,
        };
        let tied = places.len() > 1 || !k.free;
        if instance.only.is_none() && (k.slack.is_some() || (tied && plain)) {
            found.extend(places.iter().map(|p| Nominal {
                parameter,
                effect,
                at: system.model.place_name(*p),
                places: vec![*p],
                group,
                value: k.value,
                stated: k.slack,
                unit: k.unit.clone(),
            }));
        }
    }
    found
}

/// Bodies with a mass that nothing fits yet, along all axes in which they move.
fn masses(case: &Case, system: &System, all: bool) -> Vec<Nominal> {
    let model = &system.model;
    if model.space.is_some() {
        return vec![];
    }
    let weighs = |p: usize| {
        let place = &model.places[p];
        let dof = place.to.filter(|_| place.from.is_none() && !model.on_connector(p))?;
        (!model.dofs[dof].axis.rotational() && model.dofs[dof].mass > 0.0).then_some(dof)
    };
    let fitted = |places: &[usize]| {
        let here = |i: &Instance| matches!(&i.site, Site::Places(l) if places.iter().any(|p| l.contains(p)));
        system.instances.iter().any(|i| i.name() == "added_mass" && i.params.iter().any(|p| p.free) && here(i))
    };
    let of = |body: usize| -> Option<Nominal> {
        let own: Vec<(usize, usize)> = (0..model.places.len()).filter_map(|p| Some((p, weighs(p)?))).collect();
        let own: Vec<(usize, usize)> = own.into_iter().filter(|(_, dof)| model.dofs[*dof].body == body).collect();
        let (places, value) = (own.iter().map(|o| o.0).collect::<Vec<_>>(), model.dofs[own.first()?.1].mass);
        let at = model.bodies[body].name.clone();
        let stated = case.search.mass_slack.iter().find(|(name, _)| *name == at).map(|(_, w)| *w);
        let wanted = (all || stated.is_some()) && !fitted(&places);
        let group = system.instances.len() + body;
        let unit = ("kg".to_string(), 1.0);
        wanted.then_some(Nominal { parameter: MASS, effect: "mass_deviation", at, places, group, value, stated, unit })
    };
    (0..model.bodies.len()).filter_map(of).collect()
}

/// Mass between the nodes, along all springs of a model of several bodies: one number, the part of a body's mass that lies there, since a chain that is cut
/// too coarsely is so everywhere. `inertia_deviation` and `node_deviation` together are what condensation makes of it at every frequency: exact for a mass
/// in the middle of every spring, close for more of them and for a bar (unit test).
fn between(system: &System, all: bool) -> Option<Nominal> {
    let model = &system.model;
    let masses = model.dofs.iter().filter(|d| !d.axis.rotational() && d.mass > 0.0).count();
    if !all || model.space.is_some() || masses < 2 {
        return None;
    }
    let springs = system.instances.iter().filter(|i| i.name() == "linear_stiffness" && i.only.is_none());
    let mut places: Vec<usize> = springs.flat_map(|i| if let Site::Places(p) = &i.site { p.clone() } else { vec![] }).collect();
    let carries = |dof: Option<usize>| dof.is_none_or(|d| model.dofs[d].mass > 0.0);
    places.retain(|p| !model.places[*p].axis.rotational() && carries(model.places[*p].from) && carries(model.places[*p].to));
    places.sort_unstable();
    places.dedup();
    (places.len() > 1).then(|| Nominal {
        parameter: BETWEEN,
        effect: "inertia_deviation",
        at: "all springs".into(),
        places,
        group: usize::MAX,
        value: 1.0,
        stated: None,
        unit: ("-".into(), 1.0),
    })
}

/// What an added spring or damper says of a tied or fixed one that stands there already, as far as slack may deviate: the same as that deviation, a
/// correction of that value; so is a compliance in series with nothing but such a spring and a damper, which is a softer spring. An added mass corrects a nominal
/// one as far as slack has a width for it; beyond that something weighs on the body.
pub fn correction(case: &Case, fitted: &Fitted, base: usize, instance: usize, settings: &Settings) -> Option<Correction> {
    let own = &fitted.system.instances[instance];
    let parameter = match own.name() {
        "added_mass" => MASS,
        "linear_stiffness" | SOFTER | "support_compliance" => SPRING,
        "viscous" => DAMPER,
        _ => return None,
    };
    let (Site::Places(places), value) = (&own.site, own.params.first()?.value) else { return None };
    let [place] = places[..] else { return None };
    let model = &fitted.system.model;
    // A connector to the ground and its body are one place.
    let grounded = |p: usize| model.places[p].from.xor(model.places[p].to);
    let same = |p: &usize| *p == place || (grounded(*p).is_some() && grounded(*p) == grounded(place));
    let study = System { instances: fitted.system.instances[..base].to_vec(), ..fitted.system.clone() };
    let in_series = own.name() == "support_compliance";
    let reach = match parameter {
        MASS => settings.slack_mass,
        _ if in_series => settings.slack_softer * settings.slack_spring,
        _ => settings.slack_reach,
    };
    let mut nominal = tied(&study, true);
    nominal.extend(masses(case, &study, true));
    let linear = |i: &Instance| ["linear_stiffness", "viscous", "support_compliance"].contains(&i.name()) || deviates(i.effect);
    let here = |i: &Instance| matches!(&i.site, Site::Places(l) if l.iter().any(same));
    if in_series && !fitted.system.instances.iter().all(|i| !here(i) || linear(i)) {
        return None;
    }
    // What it is of the nominal value, and its derivative.
    let relative = |n: &Nominal| {
        let soft = 1.0 / (1.0 + value * n.value);
        if in_series { (soft - 1.0, n.value * soft * soft) } else { (value / n.value, 1.0 / n.value) }
    };
    let of = |n: &Nominal| n.parameter == parameter && n.places.iter().any(same) && relative(n).0.abs() <= reach;
    let n = nominal.into_iter().find(of)?;
    let (relative, by) = relative(&n);
    let std = Covariance::of(fitted).variance(&[(instance, by)]).sqrt();
    Some(Correction { parameter: parameter.into(), at: n.at, relative, std })
}

impl Slack {
    /// Whether nothing deviates.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// The same without mass between the nodes, and a system without what stands for it; none where there is none. What a system has of deviations stands
    /// at its end. A body that ends a chain then deviates as any other does.
    pub fn lumped(&self, system: &System, settings: &Settings) -> Option<(System, Slack)> {
        let stays = |m: &&Member| ![BETWEEN, NODES].contains(&m.parameter);
        let kept: Vec<Member> = self.members.iter().filter(stays).cloned().collect();
        let first = self.members.first()?.instance;
        if kept.len() == self.members.len() || kept.is_empty() {
            return None;
        }
        let mut fewer = system.clone();
        fewer.instances.truncate(first);
        let mut members = Vec::new();
        for (k, m) in kept.into_iter().enumerate() {
            let mut instance = system.instances[m.instance].clone();
            let parameter = if m.parameter == END { MASS } else { m.parameter };
            if m.parameter == END {
                let [least, most] = reach(MASS, settings).map(|part| part * m.nominal);
                let p = &mut instance.params[0];
                (p.min, p.max, p.prior) = (least, most, Some((0.0, widest(MASS, settings) * m.nominal)));
            }
            fewer.instances.push(instance);
            members.push(Member { instance: first + k, parameter, ..m });
        }
        Some((fewer, Slack { members }))
    }

    /// How many instances of the system they are.
    pub fn instances(&self) -> usize {
        self.members.len()
    }

    /// How many deviations there are, what only follows another left out.
    pub fn len(&self) -> usize {
        self.members.iter().filter(|m| m.parameter != NODES).count()
    }

    /// Whether this instance of the system is one of them.
    pub fn has(&self, instance: usize) -> bool {
        self.members.iter().any(|m| m.instance == instance)
    }

    /// The system with the widths that its deviations, as they were fitted, speak for.
    pub fn widened(&self, fitted: &Fitted, settings: &Settings) -> System {
        let mut system = fitted.system.clone();
        if self.is_empty() {
            return system;
        }
        let spread = Covariance::of(fitted);
        for kind in [SPRING, DAMPER, MASS, BETWEEN, END] {
            let own: Vec<&Member> = self.members.iter().filter(|m| m.parameter == kind && m.estimated).collect();
            let square = |m: &&Member| {
                let (value, variance) = (system.instances[m.instance].params[0].value, spread.variance(&[(m.instance, 1.0)]));
                (value * value + variance) / (m.nominal * m.nominal)
            };
            let mean = own.iter().map(square).sum::<f64>() / own.len().max(1) as f64;
            let width = mean.sqrt().clamp(narrowest(kind, settings), widest(kind, settings));
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

    /// Deviations that are large and sure, the largest first: of a spring from the median of its group, of a nominal value from that.
    pub fn corrections(&self, fitted: &Fitted, settings: &Settings) -> Vec<Correction> {
        let covariance = Covariance::of(fitted);
        let value = |instance: usize| fitted.system.instances[instance].params[0].value;
        let is_nominal = |m: &Member| [MASS, BETWEEN, NODES, END].contains(&m.parameter);
        // What a group has in common is its own parameter; a nominal value is what the study says.
        let common = |m: &Member| if is_nominal(m) { m.nominal } else { value(m.group) };
        // Own over median of the group, less 1, and its standard deviation. Half of a group may deviate without moving that of the others.
        let of = |m: &Member| {
            let middle = self.middle(m, &value);
            let n = middle.len().max(1) as f64;
            let (own, reference) = (common(m) + value(m.instance), common(m) + middle.iter().map(|o| value(*o)).sum::<f64>() / n);
            let mut weights = vec![(m.instance, 1.0 / reference)];
            weights.extend(middle.iter().map(|o| (*o, -own / (n * reference * reference))));
            if !is_nominal(m) {
                weights.push((m.group, 1.0 / reference - own / (reference * reference)));
            }
            (own / reference - 1.0, covariance.variance(&weights).sqrt())
        };
        let told =
            self.members.iter().map(|m| (m, of(m))).filter(|(_, (relative, std))| {
                relative.abs() > settings.correction_least && relative.abs() > settings.correction_sure * std
            });
        let correction =
            |(m, (relative, std)): (&Member, (f64, f64))| Correction { parameter: m.parameter.into(), at: m.at.clone(), relative, std };
        let mut told: Vec<Correction> = told.map(correction).collect();
        told.sort_by(|a, b| b.relative.abs().total_cmp(&a.relative.abs()));
        told
    }

    /// The one or two deviations in the middle of a member's group; none where it is alone in that.
    fn middle(&self, m: &Member, value: &impl Fn(usize) -> f64) -> Vec<usize> {
        let mut group: Vec<usize> =
            self.members.iter().filter(|o| o.group == m.group && o.parameter == m.parameter).map(|o| o.instance).collect();
        if group.len() < 2 {
            return vec![];
        }
        group.sort_by(|a, b| value(*a).total_cmp(&value(*b)));
        group[(group.len() - 1) / 2..=group.len() / 2].to_vec()
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
        let inverse = (scaled.transpose() * &scaled)
            .pseudo_inverse(f64::EPSILON * j.nrows().max(j.ncols()) as f64)
            .unwrap_or_else(|_| DMatrix::zeros(j.ncols(), j.ncols()));
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
