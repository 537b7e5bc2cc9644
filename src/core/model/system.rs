//! The graph with its effects and their parameters.

use std::collections::{BTreeMap, HashSet};

use crate::effect::{Effect, Kind, Moves, Param, Sign, find};
use crate::explain::Explain;
use crate::units::{Dimension, Unit, parse_unit};

use super::space::Outline;
use super::{Model, ModelError};

/// A parameter's number and how it may move.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamValue {
    /// Present value [SI].
    pub value: f64,
    /// Lower bound [SI], may be -inf.
    pub min: f64,
    /// Upper bound [SI], may be +inf.
    pub max: f64,
    /// Whether a fit moves it.
    pub free: bool,
    /// Prior mean and standard deviation [SI].
    pub prior: Option<(f64, f64)>,
    /// Relative width within which members of its group, or a nominal value, may deviate, as the study states it.
    pub slack: Option<f64>,
    /// Unit for printing, as the engineer gave it, and its SI value.
    pub unit: (String, f64),
}

impl ParamValue {
    /// A fixed value in SI.
    pub fn fixed(value: f64) -> Self {
        ParamValue { value, min: f64::NEG_INFINITY, max: f64::INFINITY, free: false, prior: None, slack: None, unit: (String::new(), 1.0) }
    }
    /// A value of a parameter in SI with the bounds within which it means something; settings are fixed, what else there is is free.
    pub fn of(param: &Param, value: f64) -> Self {
        ParamValue { min: param.min, max: param.max, free: param.kind != Kind::Setting, ..Self::fixed(value) }
    }
    /// A free value in SI with the bounds its sign admits.
    pub fn free(value: f64, sign: Sign) -> Self {
        ParamValue { min: sign.lowest(), free: true, ..Self::fixed(value) }
    }
}

/// A measuring channel: a test and the role of the channel in it; `*` stands for every test that has the role.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChannelSite {
    /// Test id, or `*`.
    pub test: String,
    /// Role: force, displacement, response.
    pub role: String,
}

impl ChannelSite {
    /// Whether it covers this channel.
    pub fn covers(&self, test: &str, role: &str) -> bool {
        (self.test == "*" || self.test == test) && self.role == role
    }
}

/// What a coefficient acts on.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Indices of the instances whose parameter it scales: several, of one law, where one coefficient serves several groups of places.
    pub instances: Vec<usize>,
    /// Index of that parameter in each.
    pub param: usize,
    /// Name of the condition.
    pub condition: String,
    /// Value of the condition at which the factor is 1 [SI].
    pub reference: f64,
    /// The unit that the condition is first stated in.
    pub unit: Unit,
}

impl Target {
    /// What it scales, over which condition: `viscous.c over i`. Two laws over two conditions are two laws.
    pub fn acts_on(&self, system: &System) -> Option<String> {
        let scaled = system.instances.get(*self.instances.first()?)?.effect.info();
        Some(format!("{}.{} over {}", scaled.name, scaled.params.get(self.param)?.name, self.condition))
    }

    /// The unit of one over the condition, which an exponent or a slope has.
    pub fn per_unit(&self) -> Unit {
        let (symbol, over) = (&self.unit.symbol, Dimension::DIMENSIONLESS.over(self.unit.dimension));
        let simple = !symbol.is_empty() && symbol.chars().all(char::is_alphanumeric);
        simple.then(|| parse_unit(&format!("1/{symbol}"), over).ok()).flatten().unwrap_or_else(|| Unit::si(over))
    }
}

/// Where an instance acts.
#[derive(Clone, Debug, PartialEq)]
pub enum Site {
    /// At these places, sharing one set of values.
    Places(Vec<usize>),
    /// On a channel.
    Channel(ChannelSite),
    /// On the geometry.
    Outline(Outline),
}

/// The value of a condition that an instance's values are for.
#[derive(Clone, Debug, PartialEq)]
pub struct AtCondition {
    /// Name of the condition.
    pub name: String,
    /// Its value [SI].
    pub value: f64,
    /// As the dataset prints it, such as "0.3 mm".
    pub printed: String,
}

impl AtCondition {
    /// Whether a test with these conditions is one of those meant.
    pub fn holds(&self, conditions: &BTreeMap<String, f64>) -> bool {
        conditions.get(&self.name).is_some_and(|c| (c - self.value).abs() <= 1e-9 * c.abs().max(self.value.abs()))
    }
}

/// One effect with its values, at one or more places.
#[derive(Clone, Debug)]
pub struct Instance {
    /// The law.
    pub effect: &'static Effect,
    /// `at` as the study has it.
    pub at: String,
    /// The same, resolved.
    pub site: Site,
    /// Parameters in the order of the law.
    pub params: Vec<ParamValue>,
    /// For coefficients.
    pub target: Option<Target>,
    /// Its values are those at one value of a condition: it acts in no other test. Another instance has them at the next value.
    pub only: Option<AtCondition>,
    /// A candidate of the score test: strength at its null value and the only free parameter; its states follow the motion without
    /// acting on it.
    pub follower: bool,
}

impl Instance {
    /// An effect of the model that acts in every test, on no other effect's parameter.
    pub fn new(effect: &'static Effect, at: impl Into<String>, site: Site, params: Vec<ParamValue>) -> Self {
        Instance { effect, at: at.into(), site, params, target: None, only: None, follower: false }
    }
    /// The same with values by parameter name [SI]; those not named start at their default (strength: its null value). Strengths and shapes are
    /// free, settings fixed.
    ///
    /// # Errors
    /// A name that is no parameter of the effect.
    pub fn with_values(effect: &'static Effect, at: impl Into<String>, site: Site, values: &[(&str, f64)]) -> Result<Self, ModelError> {
        let info = effect.info();
        if let Some((name, _)) = values.iter().find(|(name, _)| info.param(name).is_none()) {
            return Err(ModelError::no_such("parameter", name, info.params.iter().map(|p| p.name.to_string())));
        }
        let param = |p: &Param| ParamValue::of(p, values.iter().find(|(name, _)| *name == p.name).map_or(p.default, |v| v.1));
        Ok(Instance::new(effect, at, site, info.params.iter().map(param).collect()))
    }
    /// Refuses a series effect at a place where none of these effects is a force.
    pub fn has_company(&self, model: &Model, all: &[Instance]) -> Result<(), ModelError> {
        let (Effect::Series(_), Site::Places(places)) = (self.effect, &self.site) else { return Ok(()) };
        let forces = all.iter().filter(|i| matches!(i.effect, Effect::Force(_)));
        let acted: HashSet<usize> =
            forces.flat_map(|i| if let Site::Places(at) = &i.site { at.as_slice() } else { &[] }).copied().collect();
        let Some(p) = places.iter().find(|p| !acted.contains(p)) else { return Ok(()) };
        let (name, place) = (self.name(), model.place_name(*p));
        let message = format!("`{name}` stands in series with nothing: no force effect acts at `{place}`");
        Err(ModelError::invalid(&place, message, format!("a force effect at `{place}`, such as linear_stiffness")))
    }
    /// Name of the effect.
    pub fn name(&self) -> &'static str {
        self.effect.info().name
    }
}

/// A free parameter: which number, and in which variable the fit moves it.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeParam {
    /// Index of the instance.
    pub instance: usize,
    /// Index of the parameter.
    pub param: usize,
    /// `at.effect.parameter`; `at.effect[i=0.3 mm].parameter` where a condition has its own value.
    pub name: String,
    /// Whether the fit moves its logarithm (positive shapes).
    pub log: bool,
}

impl FreeParam {
    /// The fit's variable for a value of the parameter.
    pub fn variable(&self, value: f64) -> f64 {
        if self.log { value.ln() } else { value }
    }

    /// The value of the parameter at the fit's variable.
    pub fn value(&self, variable: f64) -> f64 {
        if self.log { variable.exp() } else { variable }
    }
}

/// The graph with its effects.
#[derive(Clone, Debug)]
pub struct System {
    /// The graph.
    pub model: Model,
    /// The effects.
    pub instances: Vec<Instance>,
}

impl System {
    /// A graph on which nothing acts yet.
    pub fn new(model: Model) -> System {
        System { model, instances: vec![] }
    }

    /// The system with a force or series effect, of the library or registered, more: `at` is a place (`c1.x`), a range (`c1-7.x`) or several of these
    /// with commas between, which share one set of values; `values` by parameter name [SI], as in [`Instance::with_values`].
    ///
    /// # Errors
    /// Names that are not there; a series effect where no force acts; coefficients, channel effects and formulas, which need a study.
    pub fn and(mut self, effect: &str, at: &str, values: &[(&str, f64)]) -> Result<System, ModelError> {
        let law = find(effect).map_err(|e| ModelError::invalid(effect, e.to_string(), e.accepted()))?;
        if !matches!(law, Effect::Force(_) | Effect::Series(_)) {
            let message = format!("`{effect}` refers to a dataset or to an expression, which a system by itself does not have");
            return Err(ModelError::invalid(effect, message, "a force or series effect; for others study.toml and `Study::load`"));
        }
        let names: Vec<&str> = at.split(',').map(str::trim).collect();
        let places = self.model.finder().all_places(&names).map_err(|(_, e)| e)?;
        let instance = Instance::with_values(law, names.join(","), Site::Places(places), values)?;
        instance.has_company(&self.model, &self.instances)?;
        self.instances.push(instance);
        Ok(self)
    }

    /// What acts in this system and not in `before`, by effect, place and, of a coefficient, condition: each once.
    pub fn beyond(&self, before: &System) -> Vec<&Instance> {
        fn name(i: &Instance) -> (&str, &str, Option<&str>) {
            (i.name(), &i.at, i.target.as_ref().map(|t| t.condition.as_str()))
        }
        let count = |all: &System, i: &Instance| all.instances.iter().filter(|o| name(o) == name(i)).count();
        let mut list: Vec<&Instance> = Vec::new();
        for i in &self.instances {
            if count(before, i) < count(self, i) && !list.iter().any(|o| name(o) == name(i)) {
                list.push(i);
            }
        }
        list
    }

    /// The system without its `k`-th instance; none where another acts on it.
    pub fn without(&self, k: usize) -> Option<System> {
        let acts = |i: &Instance| i.target.as_ref().is_some_and(|t| t.instances.contains(&k));
        if self.instances.iter().any(acts) {
            return None;
        }
        let mut system = self.clone();
        system.instances.remove(k);
        system.renumbered(|i| if i > k { i - 1 } else { i });
        Some(system)
    }

    /// The system with another law in the place of its `k`-th. What acts on that acts on the parameter of the same name and dimension of the other; none where it has
    /// no such, or where something acts on both this law and others.
    pub fn exchanged(&self, k: usize, other: Instance) -> Option<System> {
        let mut system = self.clone();
        let (own, theirs) = (self.instances.get(k)?.effect.info(), other.effect.info());
        for target in system.instances.iter_mut().filter_map(|i| i.target.as_mut()).filter(|t| t.instances.contains(&k)) {
            let scaled = &own.params[target.param];
            let same = theirs.params.iter().position(|p| p.name == scaled.name && p.dim == scaled.dim);
            target.param = same.filter(|_| target.instances == [k])?;
        }
        system.instances[k] = other;
        Some(system)
    }

    /// The system with these instances put in before its `k`-th, which know of no instance behind themselves.
    pub fn with(&self, k: usize, added: Vec<Instance>) -> System {
        let (mut system, by) = (self.clone(), added.len());
        system.renumbered(|i| if i >= k { i + by } else { i });
        system.instances.splice(k..k, added);
        system
    }

    /// What acts on an instance finds it at its new place.
    fn renumbered(&mut self, to: impl Fn(usize) -> usize) {
        let targets = self.instances.iter_mut().filter_map(|i| i.target.as_mut());
        targets.flat_map(|t| t.instances.iter_mut()).for_each(|i| *i = to(*i));
    }

    /// The system at these of the fit's variables, one for each of its free parameters.
    pub fn at_variables(&self, free: &[FreeParam], variables: &[f64]) -> System {
        let mut system = self.clone();
        for (f, v) in free.iter().zip(variables) {
            let param = &mut system.instances[f.instance].params[f.param];
            // A logarithm at its bound comes back beyond it by rounding.
            param.value = if f.log { f.value(*v).max(param.min).min(param.max) } else { *v };
        }
        system
    }

    /// The system with other values of its free parameters: those that `of` has for their names.
    pub fn with_values(&self, of: impl Fn(&str) -> Option<f64>) -> System {
        let mut system = self.clone();
        for f in self.free() {
            let value = &mut system.instances[f.instance].params[f.param].value;
            *value = of(&f.name).unwrap_or(*value);
        }
        system
    }

    /// The free parameters in order of instance and parameter.
    pub fn free(&self) -> Vec<FreeParam> {
        let mut seen: BTreeMap<String, usize> = BTreeMap::new();
        let mut free = Vec::new();
        for (i, instance) in self.instances.iter().enumerate() {
            let info = instance.effect.info();
            let stem = match &instance.target {
                Some(t) => {
                    let of = self.instances[t.instances[0]].effect.info();
                    format!("{}.{}({}.{})", instance.at, info.name, of.name, of.params[t.param].name)
                }
                None => format!("{}.{}", instance.at, info.name),
            };
            let stem = instance.only.as_ref().map_or(stem.clone(), |only| format!("{stem}[{}={}]", only.name, only.printed));
            let count = seen.entry(stem.clone()).or_insert(0);
            *count += 1;
            let stem = if *count > 1 { format!("{stem}#{count}") } else { stem };
            for (p, value) in instance.params.iter().enumerate().filter(|(_, v)| v.free) {
                let info = &info.params[p];
                let log = info.kind != Kind::Strength && info.sign == Sign::Positive && value.prior.is_none();
                free.push(FreeParam { instance: i, param: p, name: format!("{stem}.{}", info.name), log });
            }
        }
        free
    }

    /// Whether zero of this parameter is the absence of its effect: a strength whose null value it is.
    pub fn absent_at_zero(&self, f: &FreeParam) -> bool {
        let info = self.instances[f.instance].effect.info();
        info.params.get(f.param).is_some_and(|p| p.kind == Kind::Strength && p.default == 0.0)
    }

    /// Checks that every value lies in its bounds and has an admissible sign.
    pub fn check(&self) -> Result<(), ModelError> {
        for f in self.params() {
            let value = &self.instances[f.instance].params[f.param];
            let sign = self.instances[f.instance].effect.info().params[f.param].sign;
            let bad = |message: String, accepted: &str| Err(ModelError::invalid(&f.name, message, accepted));
            if !value.value.is_finite() {
                return bad(format!("`{}` is {}", f.name, value.value), "a finite number");
            }
            if value.min > value.max {
                return bad(format!("the bounds of `{}` exclude every value: {} > {}", f.name, value.min, value.max), "min below max");
            }
            if value.value < value.min || value.value > value.max {
                return bad(
                    format!("the start {} of `{}` lies outside its bounds [{}, {}]", value.value, f.name, value.min, value.max),
                    "a start within the bounds",
                );
            }
            if (sign == Sign::NonNegative && value.value < 0.0) || (sign == Sign::Positive && value.value <= 0.0) {
                return bad(format!("`{}` is {}", f.name, value.value), &format!("a value {}", sign.word()));
            }
        }
        self.unfolded()
    }

    /// Checks that no chain is bent by a law of the geometry until it meets itself, or left without mass.
    fn unfolded(&self) -> Result<(), ModelError> {
        for instance in &self.instances {
            let (Site::Outline(Outline::Stem(stem)), Some(space)) = (&instance.site, &self.model.space) else { continue };
            let value = instance.params[0].value;
            if matches!(instance.effect, Effect::Geometry(law) if law.moves() == Moves::Mass) {
                if value <= -1.0 {
                    let message = format!("the parts of `{}` would have no mass: {value}", instance.at);
                    return Err(ModelError::invalid(&instance.at, message, "a relative change above -1"));
                }
                continue;
            }
            let swept = space.stems[*stem].curve.bent(1.0 + value).swept();
            if swept >= std::f64::consts::TAU {
                let message = format!("the arcs of `{}` turn by {:.1} deg in all: the chain meets itself", instance.at, swept.to_degrees());
                return Err(ModelError::invalid(&instance.at, message, "a curvature at which they turn by less than 360 deg"));
            }
        }
        Ok(())
    }

    /// Every parameter, free or fixed, as if it were free.
    pub fn params(&self) -> Vec<FreeParam> {
        let mut all = self.clone();
        all.instances.iter_mut().flat_map(|i| &mut i.params).for_each(|p| p.free = true);
        all.free()
    }
}
