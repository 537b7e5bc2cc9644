//! The candidates of the search: every effect of the library at every place it may act, over a grid of its shapes.

use crate::effect::{Channel, Effect, Grid, Kind, LIBRARY, Moves, Over, Role, SPLINE, Scales, Sign, find, own};
use crate::model::{ChannelSite, Instance, Model, ParamValue, Site, System, Target};
use crate::parallel;
use crate::response::{BlockKind, Plan};
use crate::units::{Dimension, Unit};

use crate::diagnose::Case;
use crate::diagnose::calibrate::slack;

/// One point of the search: an effect at a place with one choice of shapes.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The instance with its strength at the null value.
    pub instance: Instance,
    /// Index of the candidate (effect and place) it belongs to.
    pub candidate: usize,
}

/// What the tests show at each place, and over which periods.
pub struct Scene {
    /// One for each place.
    scales: Vec<Scales>,
    /// What the tests show of no place.
    all: Scales,
}

impl Scene {
    /// Looks at the tests with the present system.
    pub fn new(plans: &[&Plan], system: &System) -> Scene {
        let mut scales = vec![Scales::NONE; system.model.places.len()];
        let mut all = Scales::NONE;
        for plan in plans {
            all = all.with(Scales { periods: plan.periods(), ..Scales::NONE });
            // A test whose response cannot be computed has been reported by the fit; its amplitudes are not needed here.
            match plan.amplitudes(system) {
                Ok(None) => all.small = true,
                Ok(Some(here)) => scales.iter_mut().zip(here).for_each(|(a, b)| *a = a.with(b.into())),
                Err(_) => {}
            }
        }
        Scene { scales, all }
    }

    /// What the tests show at any of these places.
    pub fn at(&self, places: &[usize]) -> Scales {
        places.iter().map(|p| self.scales[*p]).fold(self.all, Scales::with)
    }
}

/// Names of a candidate: effect, place, and for a coefficient the parameter it acts on.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// Effect.
    pub effect: &'static str,
    /// Place.
    pub at: String,
    /// Parameter scaled.
    pub of: Option<String>,
}

impl Name {
    /// Parameters of a friction with memory; none of other effects.
    pub fn params_with_memory(&self) -> Option<usize> {
        let info = find(self.effect).ok()?.info();
        (info.family == "friction" && info.states > 0).then_some(info.params.len())
    }
}

/// All candidates and their trials. A list that is stopped before its end ([`parallel::given_up`]) is not whole.
pub fn candidates(case: &Case, system: &System, plans: &[&Plan], scene: &Scene) -> (Vec<Name>, Vec<Trial>) {
    let mut list = List { case, system, names: vec![], trials: vec![] };
    let wanted = |effect: &str| case.search.effects.as_ref().is_none_or(|list| list.iter().any(|e| e == effect));
    let tried = |e: &&Effect| {
        wanted(e.info().name)
            && !matches!(e, Effect::Formula(_))
            && e.info().family != SPLINE
            && (!slack::deviates(e) || e.info().name == slack::SOFTER)
    };
    for effect in LIBRARY.iter().chain(own::searched()).filter(tried) {
        if parallel::given_up() {
            break;
        }
        match effect {
            Effect::Coefficient(law) => list.coefficients(effect, &conditions(plans, law.over())),
            Effect::Geometry(law) => list.outlines(effect, law.moves()),
            Effect::Channel(law) => list.channels(effect, plans, *law),
            _ => list.forces(effect, scene),
        }
    }
    (list.names, list.trials)
}

/// Candidates as they are gathered.
struct List<'a> {
    case: &'a Case,
    system: &'a System,
    names: Vec<Name>,
    trials: Vec<Trial>,
}

impl List<'_> {
    /// Whether the study's `places` let anything be looked for here.
    fn allowed(&self, at: &str) -> bool {
        self.case.search.places.as_ref().is_none_or(|list| list.iter().any(|p| p == at))
    }

    /// A force or a law in series at every place where it may act, over the grid of its shapes there.
    fn forces(&mut self, effect: &'static Effect, scene: &Scene) {
        let (info, system, s) = (effect.info(), self.system, &self.case.search.settings);
        let inertial = info.family == "inertial";
        let (own, tied) = (if inertial { parts(system) } else { vec![] }, slack::tied_stiffness(self.case, effect, system));
        let at_bodies = bodies(self.case, system, inertial || LINKS.contains(&info.name));
        for (at, places) in sites(self.case, system).into_iter().chain(at_bodies).chain(own) {
            if parallel::given_up() {
                return;
            }
            let loose = info.role == Role::Series && !forced(system, &places);
            if loose || !self.allowed(&at) || already(system, info.name, &places, info.params.iter().any(|p| p.kind == Kind::Shape)) {
                continue;
            }
            // A spring that stands may be softer, which none beside it is; elsewhere nothing is there to deviate.
            let most = tied.as_ref().map_or(Some(f64::INFINITY), |tied| tied.get(&places[..]).copied());
            let (Some(most), scales, from) = (most, scene.at(&places), self.trials.len()) else { continue };
            self.push(effect, Name { effect: info.name, at, of: None }, Site::Places(places), None, shapes(effect, &scales));
            for Trial { instance, .. } in &mut self.trials[from..] {
                confine(instance, &scales, s.race.passed);
                instance.params[0].min = instance.params[0].min.max(-s.slack_reach * most);
            }
        }
    }

    /// A law over each of the conditions of every parameter that may follow it.
    fn coefficients(&mut self, effect: &'static Effect, conditions: &[(String, f64, Unit)]) {
        let (info, system) = (effect.info(), self.system);
        for (condition, reference, unit) in conditions {
            for (i, target) in system.instances.iter().enumerate() {
                let (Site::Places(places), Role::Force | Role::Series) = (&target.site, target.effect.info().role) else { continue };
                // A deviation that follows a condition would be one place's part of the law that its group follows.
                if !self.allowed(&target.at) || slack::deviates(target.effect) {
                    continue;
                }
                for param in followed(target) {
                    let taken = system.instances.iter().any(|c| {
                        let same = |t: &Target| t.instances.contains(&i) && t.param == param && t.condition == *condition;
                        c.name() == info.name && c.target.as_ref().is_some_and(same)
                    });
                    if taken {
                        continue;
                    }
                    let to = Target { instances: vec![i], param, condition: condition.clone(), reference: *reference, unit: unit.clone() };
                    let name = Name { effect: info.name, at: target.at.clone(), of: to.acts_on(system) };
                    self.push(effect, name, Site::Places(places.clone()), Some(to), vec![vec![]]);
                }
            }
        }
    }

    /// A law of the geometry at every outline that it moves.
    fn outlines(&mut self, effect: &'static Effect, moves: Moves) {
        let (info, system) = (effect.info(), self.system);
        for at in outlines(system, moves) {
            let Ok(outline) = system.model.outline(moves, &at) else { continue };
            let taken = system.instances.iter().any(|i| i.name() == info.name && i.site == Site::Outline(outline));
            if !taken && self.allowed(&at) {
                self.push(effect, Name { effect: info.name, at, of: None }, Site::Outline(outline), None, vec![vec![]]);
            }
        }
    }

    /// A misreading of every channel that it can concern.
    fn channels(&mut self, effect: &'static Effect, plans: &[&Plan], law: &dyn Channel) {
        let (info, system) = (effect.info(), self.system);
        for site in channels(plans, law).into_iter().filter(|s| info.name != "drift" || drifts(plans, s)) {
            let at = format!("{}.{}", site.test, site.role);
            let taken = system.instances.iter().any(|i| i.name() == info.name && i.site == Site::Channel(site.clone()));
            if !taken && self.allowed(&at) {
                self.push(effect, Name { effect: info.name, at, of: None }, Site::Channel(site), None, vec![vec![]]);
            }
        }
    }

    /// One candidate, a trial for each of its shapes; none where it has none.
    fn push(&mut self, effect: &'static Effect, name: Name, site: Site, target: Option<Target>, shapes: Vec<Vec<(usize, f64)>>) {
        if shapes.is_empty() || parallel::given_up() {
            return;
        }
        let candidate = self.names.len();
        for shape in shapes {
            let mut instance = at_null(effect, name.at.clone(), site.clone(), target.clone());
            for (k, v) in shape {
                instance.params[k].value = v;
            }
            self.trials.push(Trial { instance, candidate });
        }
        self.names.push(name);
    }
}

/// The parameters of an effect that may follow a condition: its strength, and what else of it the study fits.
fn followed(target: &Instance) -> Vec<usize> {
    let info = target.effect.info();
    let fits = |k: &usize| *k == 0 || (target.params[*k].free && info.params[*k].kind == Kind::Shape);
    (0..info.params.len()).filter(fits).collect()
}

/// Every place of a connector (of a spatial model those where something acts), the groups that effects of the model share, and the places
/// and groups that the study asks for, whether anything acts there or not.
pub fn sites(case: &Case, system: &System) -> Vec<(String, Vec<usize>)> {
    let model = &system.model;
    let acted = |p: usize| system.instances.iter().any(|i| matches!(&i.site, Site::Places(list) if list.contains(&p)));
    let there = |p: &usize| if model.space.is_some() { acted(*p) } else { model.on_connector(*p) };
    let mut sites: Vec<(String, Vec<usize>)> = (0..model.places.len()).filter(there).map(|p| (model.place_name(p), vec![p])).collect();
    // What deviates everywhere alike makes no group.
    for i in system.instances.iter().filter(|i| !slack::deviates(i.effect)) {
        if let Site::Places(list) = &i.site
            && list.len() > 1
            && !sites.iter().any(|(_, s)| s == list)
        {
            sites.push((i.at.clone(), list.clone()));
        }
    }
    for at in case.search.places.iter().flatten() {
        let places: Result<Vec<Vec<usize>>, _> = at.split(',').map(|one| model.places_at(one.trim())).collect();
        let Ok(places) = places.map(|p| p.concat()) else { continue };
        if places.iter().all(|p| model.on_connector(*p)) && !sites.iter().any(|(_, s)| *s == places) {
            sites.push((at.clone(), places));
        }
    }
    sites
}

/// What laws of the geometry may move: the chains of parts, and the points of parts that a load or a connector to the ground holds, in the plane of
/// the chains.
fn outlines(system: &System, moves: Moves) -> Vec<String> {
    let model = &system.model;
    let Some(space) = model.space.as_ref().filter(|s| !s.stems.is_empty()) else { return vec![] };
    if moves != Moves::Point {
        return space.stems.iter().map(|s| s.name.clone()).collect();
    }
    let still = |b: usize| model.bodies[b].free.is_empty();
    let loaded = |b: usize| model.loads.iter().any(|l| model.dofs[l.dof].body == b);
    let points = (0..model.bodies.len()).filter(|b| !still(*b) && (joined_to_ground(model, *b) || loaded(*b)));
    points.flat_map(|b| ["x", "y"].map(|axis| format!("{}.{axis}", model.bodies[b].name))).collect()
}

/// Whether a declared connector joins the body to one that is held.
fn joined_to_ground(model: &Model, body: usize) -> bool {
    let still = |b: usize| model.bodies[b].free.is_empty();
    model.connectors[..model.declared].iter().any(|c| (c.from == body && still(c.to)) || (c.to == body && still(c.from)))
}

/// Whether a force acts at all of these places, for an effect in series to be in series with.
fn forced(system: &System, places: &[usize]) -> bool {
    let forces = |p: &usize| {
        system.instances.iter().any(|i| i.effect.info().role == Role::Force && matches!(&i.site, Site::Places(at) if at.contains(p)))
    };
    places.iter().all(forces)
}

/// What a cable, a hose or a guide that nobody drew does to a body.
const LINKS: [&str; 2] = ["linear_stiffness", "viscous"];

/// Bodies as places, where an effect would act between the body and the ground: those that the study asks for, those where it has a force
/// other than an inertia, as that of a guide, and all that no connector joins to the ground for what needs no connector (`free`): an inertia, which
/// a body has of its own, and a linear link to the ground.
fn bodies(case: &Case, system: &System, free: bool) -> Vec<(String, Vec<usize>)> {
    let model = &system.model;
    let grounded = |p: &crate::model::Place| p.from.is_none().then_some(p.to).or_else(|| p.to.is_none().then_some(p.from)).flatten();
    let joined = |dof: Option<usize>| (0..model.places.len()).any(|p| model.on_connector(p) && grounded(&model.places[p]) == dof);
    let guides = |i: &Instance, p: usize| {
        let info = i.effect.info();
        let law = info.role == Role::Force && info.family != "inertial" && !slack::deviates(i.effect);
        law && matches!(&i.site, Site::Places(list) if list.contains(&p))
    };
    let guided = |p: usize| system.instances.iter().any(|i| guides(i, p));
    let asked = |at: &str| case.search.places.as_ref().is_some_and(|list| list.iter().any(|p| p == at));
    let all = (0..model.places.len()).filter(|p| !model.on_connector(*p)).map(|p| (model.place_name(p), vec![p]));
    all.filter(|(at, p)| asked(at) || guided(p[0]) || (free && !joined(grounded(&model.places[p[0]])))).collect()
}

/// Parts of a spatial model that no connector joins to the ground, along all axes in which they move: where a mass sits that nobody drew.
fn parts(system: &System) -> Vec<(String, Vec<usize>)> {
    let model = &system.model;
    let mut found: Vec<(usize, String, Vec<usize>)> = Vec::new();
    let free = |p: &usize| !model.on_connector(*p) && !joined_to_ground(model, model.connectors[model.places[*p].connector].to);
    let moves = |p: &usize| model.space.is_some() && free(p) && !model.places[*p].axis.rotational();
    for place in (0..model.places.len()).filter(moves) {
        let (connector, name) = (model.places[place].connector, model.place_name(place));
        match found.last_mut().filter(|(c, ..)| *c == connector) {
            Some((_, at, places)) => {
                *at += &format!(",{name}");
                places.push(place);
            }
            None => found.push((connector, name, vec![place])),
        }
    }
    found.into_iter().map(|(_, at, places)| (at, places)).collect()
}

/// Whether two groups are the same places, in whatever order.
fn same_places(a: &[usize], b: &[usize]) -> bool {
    a.len() == b.len() && a.iter().all(|p| b.contains(p))
}

/// Whether the effect already stands at exactly these places and a second one could not differ from it, as it could from one that a law acts on.
fn already(system: &System, effect: &str, places: &[usize], shaped: bool) -> bool {
    let acted_on = |k: usize| system.instances.iter().filter_map(|c| c.target.as_ref()).any(|t| t.instances.contains(&k));
    let stands = |i: &Instance| i.name() == effect && matches!(&i.site, Site::Places(p) if same_places(p, places));
    let here = system.instances.iter().enumerate().filter(|(k, i)| stands(i) && !acted_on(*k)).count();
    here > usize::from(shaped)
}

/// Conditions that every test states and that vary, and would without any one test ([`rests_on_one`]), with a middle value and the unit, as far as a law is offered them.
fn conditions(plans: &[&Plan], over: Over) -> Vec<(String, f64, Unit)> {
    let mut names: Vec<&String> = plans.iter().flat_map(|p| p.conditions.keys()).collect();
    names.sort();
    names.dedup();
    let offered = |n: &str| {
        let unit = plans.iter().find_map(|p| p.condition_units.get(n));
        let force = n != "amplitude" && unit.is_some_and(|u| u.dimension == Dimension::FORCE);
        let setting = ["frequency", "amplitude", "load"].contains(&n);
        match over {
            Over::Any => !setting,
            Over::Load => n == "load" || force,
            Over::NoLoad => !setting && !force,
        }
    };
    names
        .into_iter()
        .filter(|n| offered(n))
        .filter_map(|n| {
            let mut values: Vec<f64> = plans.iter().filter_map(|p| p.conditions.get(n).copied()).collect();
            if values.len() < plans.len() {
                return None;
            }
            values.sort_by(f64::total_cmp);
            if rests_on_one(&values) {
                return None;
            }
            values.dedup();
            let unit = plans.iter().find_map(|p| p.condition_units.get(n))?;
            Some((n.clone(), values[values.len() / 2], unit.clone()))
        })
        .collect()
}

/// Whether the values, in order, do not vary, or would not without one of three tests and more: what a single test has of its own is no law. Of
/// two tests neither is the odd one.
fn rests_on_one(values: &[f64]) -> bool {
    let n = values.len();
    n < 2 || values[0] == values[n - 1] || (n > 2 && (values[0] == values[n - 2] || values[1] == values[n - 1]))
}

fn channels(plans: &[&Plan], law: &dyn Channel) -> Vec<ChannelSite> {
    let mut sites: Vec<ChannelSite> = Vec::new();
    let mut add = |test: &str, role: &str| {
        let site = ChannelSite { test: test.into(), role: role.into() };
        if !sites.contains(&site) {
            sites.push(site);
        }
    };
    let timed = |p: &&&Plan, role: &str| p.blocks.iter().any(|b| matches!(b.kind, BlockKind::Loop | BlockKind::Record) && b.role == role);
    let is_frf = |p: &&&Plan| p.blocks.iter().any(|b| b.kind == BlockKind::Frf);
    let forces: Vec<_> = plans.iter().filter(|p| timed(p, "force")).collect();
    let motions =
        ["displacement", "velocity", "acceleration"].map(|role| (role, plans.iter().filter(|p| timed(p, role)).collect::<Vec<_>>()));
    let frfs: Vec<_> = plans.iter().filter(is_frf).collect();
    if law.reads() == Some("response") {
        // One accelerometer is moved from place to place.
        if !frfs.is_empty() {
            add("*", "response");
        }
        return sites;
    }
    if !forces.is_empty() && (frfs.is_empty() || law.in_frequency()) {
        add("*", "force");
    }
    if law.info().name == "moving_mass" {
        // Only a load cell carries a moving mass; under an FRF it is that of the exciting force.
        if !frfs.is_empty() {
            add("*", "force");
        }
        return sites;
    }
    for (role, _) in motions.iter().filter(|(_, plans)| !plans.is_empty() && law.in_frequency()) {
        add("*", role);
    }
    if !frfs.is_empty() && law.in_frequency() {
        add("*", "response");
    }
    for p in &forces {
        add(&p.id, "force");
    }
    for (role, plans) in &motions {
        plans.iter().for_each(|p| add(&p.id, role));
    }
    if law.in_frequency() {
        for p in &frfs {
            add(&p.id, "response");
        }
    }
    sites
}

/// Whether a channel may drift unseen: between the cycles of a loop a drift is seen and taken out, along a record it is not.
fn drifts(plans: &[&Plan], site: &ChannelSite) -> bool {
    let recorded = |p: &&&Plan| p.blocks.iter().any(|b| b.kind == BlockKind::Record && site.covers(&p.id, &b.role));
    let looped = |p: &&&Plan| p.blocks.iter().any(|b| b.kind == BlockKind::Loop && site.covers(&p.id, &b.role));
    plans.iter().filter(recorded).count() > 0 && plans.iter().filter(looped).count() == 0
}

/// All combinations of grid values of the shape and searched setting parameters; empty where a shape has no grid here.
fn shapes(effect: &Effect, scales: &Scales) -> Vec<Vec<(usize, f64)>> {
    let mut combinations = vec![vec![]];
    let params = effect.info().params;
    let is_side = |k: usize| params[k].name == "side" && params[k].kind == Kind::Setting;
    let mut order: Vec<usize> = (0..params.len()).filter(|k| params[*k].grid != Grid::None).collect();
    // Where a stop may be depends on the side that it faces.
    order.sort_by_key(|k| !is_side(*k));
    for (k, p) in order.into_iter().map(|k| (k, &params[k])) {
        // One setting at a time: where the band of a law begins elsewhere than it does by default, its other settings keep their defaults.
        let elsewhere = |(j, v): &(usize, f64)| matches!(effect.info().params[*j].grid, Grid::Between(always, _) if *v != always);
        let with = |c: &Vec<(usize, f64)>| match p.kind == Kind::Setting && c.iter().any(elsewhere) {
            true => vec![c.clone()],
            false => {
                let side = c.iter().find(|(j, _)| is_side(*j)).map_or(1.0, |(_, side)| *side);
                p.grid.values(&scales.from_side(side)).iter().map(|v| [c.as_slice(), &[(k, *v)]].concat()).collect()
            }
        };
        combinations = combinations.iter().flat_map(with).collect();
    }
    combinations
}

/// Keeps the places along the motion at which a law changes over (a gap, the corner of a stiffness) within `passed` times the largest
/// displacement of any test: farther off none is passed, and the law is one of its own tails, which a constant force and a spring are as
/// well. Not where a test of small signal is about a state that is at rest elsewhere.
fn confine(instance: &mut Instance, scales: &Scales, passed: f64) {
    if scales.small || scales.most() <= 0.0 {
        return;
    }
    let reach = passed * scales.most();
    let along = |p: &crate::effect::Param| p.kind == Kind::Shape && p.sign == Sign::Any && matches!(p.grid, Grid::OfX(_) | Grid::Along(_));
    for (value, _) in instance.params.iter_mut().zip(instance.effect.info().params).filter(|(_, p)| along(p)) {
        (value.min, value.max) = (-reach, reach);
    }
}

/// An effect at its null value, its strength free.
fn at_null(effect: &'static Effect, at: String, site: Site, target: Option<Target>) -> Instance {
    let info = effect.info();
    let mut params: Vec<ParamValue> = info.params.iter().map(|p| ParamValue::fixed(p.default)).collect();
    params[0] = ParamValue::free(info.params[0].default, info.params[0].sign);
    let follower = matches!(info.role, Role::Force | Role::Series);
    Instance { target, follower, ..Instance::new(effect, at, site, params) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_condition_that_one_test_alone_has_otherwise_is_no_law() {
        for values in [&[1.0, 1.0, 2.0][..], &[1.0, 2.0, 2.0, 2.0], &[1.0; 4], &[1.0]] {
            assert!(rests_on_one(values), "{values:?}");
        }
        assert!(!rests_on_one(&[1.0, 2.0, 3.0]) && !rests_on_one(&[1.0, 1.0, 2.0, 2.0]) && !rests_on_one(&[1.0, 2.0]));
    }

    #[test]
    fn a_gap_is_looked_for_where_the_motion_passes() {
        let contact = crate::effect::find("contact").unwrap();
        let scales = Scales { x: 1e-3, travel: (-1e-3, 3e-3), ..Scales::NONE };
        let at = |small: bool| {
            let mut instance = at_null(contact, "c1.x".into(), Site::Places(vec![0]), None);
            confine(&mut instance, &Scales { small, ..scales }, 2.0);
            (instance.params[1].min, instance.params[1].max)
        };
        assert_eq!(at(false), (-6e-3, 6e-3));
        assert_eq!(at(true), (f64::NEG_INFINITY, f64::INFINITY));
    }

    #[test]
    fn a_stop_begins_where_the_tests_move_whichever_way_it_faces() {
        let contact = crate::effect::find("contact").unwrap();
        let gaps = |travel: (f64, f64)| -> Vec<(f64, f64)> {
            let scales = Scales { x: 1e-3, travel, ..Scales::NONE };
            let of = |shape: &Vec<(usize, f64)>, k: usize| shape.iter().find(|s| s.0 == k).unwrap().1;
            shapes(contact, &scales).iter().map(|s| (of(s, 2), of(s, 1))).collect()
        };
        // Under a load that stays the place travels from rest at 0 to 4 mm.
        for (side, gap) in gaps((0.0, 4e-3)) {
            let stops = if side == 0.0 { vec![gap, -gap] } else { vec![side * gap] };
            assert!(stops.iter().any(|at| (0.0..4e-3).contains(at)), "a stop of side {side} at {stops:?}");
        }
        assert_eq!(gaps((-2e-3, 2e-3)), [1.0, -1.0, 0.0].map(|side| [(side, 0.0), (side, 1e-3)]).concat());
    }
}
