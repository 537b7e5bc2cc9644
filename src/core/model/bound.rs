//! What one test sees of a system.

use std::collections::BTreeMap;

use crate::effect::{Channel, Effect};

use super::between::Numbers;
use super::{ChannelSite, Element, FreeParam, Instance, Level, ModelError, Site, System};

/// Chain of derivatives: indices of free parameters with the derivative of a number with respect to each.
pub type Chain = Vec<(usize, f64)>;

/// A force, series or formula effect at one place, with its numbers at a test's conditions.
#[derive(Clone, Debug, PartialEq)]
pub struct Acting {
    /// Index of the instance.
    pub instance: usize,
    /// Index of the place.
    pub place: usize,
    /// Parameters, coefficients applied [SI].
    pub values: Vec<f64>,
}

/// A channel effect with its numbers.
pub struct ChannelPiece {
    /// The law.
    pub law: &'static dyn Channel,
    /// The channel.
    pub site: ChannelSite,
    /// Parameters.
    pub p: Vec<f64>,
    /// Derivatives of each parameter with respect to the free ones.
    pub chains: Vec<Chain>,
}

/// The numbers of every effect at one test's conditions, by place and channel.
pub struct Bound {
    /// One element for every place with an effect.
    pub elements: Vec<Element>,
    /// Channel effects that cover the test.
    pub channels: Vec<ChannelPiece>,
    /// Number of free parameters.
    pub n_free: usize,
    /// Loads that stay.
    pub loads: Vec<BoundLoad>,
}

/// A load that stays, with its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundLoad {
    /// Degree of freedom.
    pub dof: usize,
    /// Values passed through from 0 [N or N m]; the last one stays.
    pub path: Vec<f64>,
    /// Steps from one to the next.
    pub steps: usize,
}

impl Bound {
    /// The same elements, each taken apart into what is linear at every amplitude and the rest ([`Element::apart`]). Channels are left out.
    pub fn apart(&self) -> Bound {
        let of = |e: &Element| e.apart().map_or_else(|| vec![e.clone()], Vec::from);
        Bound { elements: self.elements.iter().flat_map(of).collect(), channels: vec![], n_free: self.n_free, loads: self.loads.clone() }
    }

    /// The same without candidates of the score test, its free parameters numbered anew; with it, the number that each of them has here.
    pub fn without_followers(&self) -> (Bound, Vec<usize>) {
        let mut elements: Vec<Element> = self.elements.iter().map(Element::without_followers).collect();
        let mut columns: Vec<usize> = elements.iter().flat_map(|e| e.chains.iter().flatten().map(|c| c.0)).collect();
        columns.sort_unstable();
        columns.dedup();
        let chains = elements.iter_mut().flat_map(|e| e.chains.iter_mut().flatten());
        chains.for_each(|c| c.0 = columns.binary_search(&c.0).unwrap_or(c.0));
        (Bound { elements, channels: vec![], n_free: columns.len(), loads: self.loads.clone() }, columns)
    }

    /// The same in a settled cycle of this frequency [Hz].
    pub fn driven_at(mut self, frequency: f64) -> Bound {
        self.elements.iter_mut().for_each(|e| e.driven_at(frequency));
        self
    }

    /// Binds `system` to a test with the given conditions [SI]. The chains refer to `free`, whose variables are the logarithms where
    /// `free[k].log`.
    pub fn new(system: &System, free: &[FreeParam], test: &str, conditions: &BTreeMap<String, f64>) -> Result<Bound, ModelError> {
        let mut values: Vec<Vec<f64>> = system.instances.iter().map(|i| i.params.iter().map(|p| p.value).collect()).collect();
        let mut chains: Vec<Vec<Chain>> = system.instances.iter().map(|i| vec![Chain::new(); i.params.len()]).collect();
        for (k, f) in free.iter().enumerate() {
            let slope = if f.log { values[f.instance][f.param] } else { 1.0 };
            chains[f.instance][f.param].push((k, slope));
        }
        every_condition_has_values(system, conditions)?;
        let laws = system.laws();
        let mut elements: BTreeMap<usize, Element> = BTreeMap::new();
        let mut channels = Vec::new();
        for (i, instance) in system.instances.iter().enumerate() {
            if instance.only.as_ref().is_some_and(|only| !only.holds(conditions)) {
                continue;
            }
            match (instance.effect, &instance.site) {
                (Effect::Channel(law), Site::Channel(site)) => {
                    if site.test == "*" || site.test == test {
                        let (p, chains) = (std::mem::take(&mut values[i]), std::mem::take(&mut chains[i]));
                        channels.push(ChannelPiece { law: *law, site: site.clone(), p, chains });
                    }
                }
                (Effect::Coefficient(_), _) => {}
                (effect, Site::Places(places)) => {
                    for &place in places.iter().filter(|p| system.model.present(system.model.places[**p].connector, test)) {
                        let (mut p, mut chain) = (values[i].clone(), chains[i].clone());
                        let numbers = Numbers { system, laws: &laws, conditions, values: &values, chains: &chains };
                        numbers.scale(i, place, &mut p, &mut chain)?;
                        numbers.take(i, place, &mut p, &mut chain)?;
                        let element = elements.entry(place).or_insert_with(|| Element::new(&system.model, place));
                        match effect {
                            Effect::Force(law) => element.push_force(*law, p, chain, instance.follower),
                            Effect::Series(law) => element.push_series(*law, p, chain, instance.follower),
                            _ => {}
                        }
                    }
                }
                (_, Site::Channel(_) | Site::Outline(_)) => {}
            }
        }
        let value = |level: &Level| match level {
            Level::Value(f) => Some(*f),
            Level::Condition(name, factor) => conditions.get(name).map(|c| c * factor),
        };
        let loads = system.model.loads.iter().filter_map(|l| {
            let path = l.path.iter().map(value).collect::<Option<Vec<f64>>>()?;
            Some(BoundLoad { dof: l.dof, path, steps: l.steps })
        });
        Ok(Bound { elements: elements.into_values().collect(), channels, n_free: free.len(), loads: loads.collect() })
    }
}

/// An effect whose values are given per value of a condition has some at this test's.
fn every_condition_has_values(system: &System, conditions: &BTreeMap<String, f64>) -> Result<(), ModelError> {
    for instance in &system.instances {
        let Some(only) = &instance.only else { continue };
        let mut siblings = system.instances.iter().filter(|i| i.at == instance.at && i.name() == instance.name()).filter_map(|i| {
            let other = i.only.as_ref()?;
            (other.name == only.name).then_some(other)
        });
        if !siblings.any(|o| o.holds(conditions)) {
            let stated = conditions.get(&only.name).map_or("that the test does not state".to_string(), |v| format!("= {v} [SI]"));
            return Err(ModelError::invalid(
                format!("{}.{}", instance.at, instance.name()),
                format!("its values are given per value of `{}`, and none for {} {stated}", only.name, only.name),
                "a value the effect is given for, or a law over the condition such as interference_law",
            ));
        }
    }
    Ok(())
}

impl System {
    /// What acts at each place in a test with the given conditions [SI], connectors that are absent there left out.
    pub fn acting(&self, test: &str, conditions: &BTreeMap<String, f64>) -> Result<Vec<Acting>, ModelError> {
        let values: Vec<Vec<f64>> = self.instances.iter().map(|i| i.params.iter().map(|p| p.value).collect()).collect();
        let none: Vec<Vec<Chain>> = self.instances.iter().map(|i| vec![Chain::new(); i.params.len()]).collect();
        let (laws, mut all) = (self.laws(), Vec::new());
        let acts = |i: &Instance| i.only.as_ref().is_none_or(|only| only.holds(conditions));
        for (i, instance) in self.instances.iter().enumerate().filter(|(_, i)| acts(i)) {
            let (Site::Places(places), false) = (&instance.site, matches!(instance.effect, Effect::Coefficient(_))) else { continue };
            for &place in places.iter().filter(|p| self.model.present(self.model.places[**p].connector, test)) {
                let (mut p, mut chain) = (values[i].clone(), none[i].clone());
                let numbers = Numbers { system: self, laws: &laws, conditions, values: &values, chains: &none };
                numbers.scale(i, place, &mut p, &mut chain)?;
                numbers.take(i, place, &mut p, &mut chain)?;
                all.push(Acting { instance: i, place, values: p });
            }
        }
        Ok(all)
    }
}

impl System {
    /// The instances that scale the strengths of others.
    fn laws(&self) -> Vec<usize> {
        (0..self.instances.len()).filter(|i| matches!(self.instances[*i].effect, Effect::Coefficient(_))).collect()
    }
}

impl Numbers<'_> {
    /// Applies the coefficients that act at `place` on instance `i`: `p = p_ref * factor`, chain rule in both.
    pub(super) fn scale(&self, i: usize, place: usize, p: &mut [f64], chain: &mut [Chain]) -> Result<(), ModelError> {
        for (c, law) in self.laws.iter().map(|c| (*c, &self.system.instances[*c])) {
            let (Effect::Coefficient(coefficient), Some(target), Site::Places(places)) = (law.effect, &law.target, &law.site) else {
                continue;
            };
            if !target.instances.contains(&i) || !places.contains(&place) {
                continue;
            }
            let condition = self.conditions.get(&target.condition).ok_or_else(|| {
                ModelError::invalid(
                    format!("{}.{}", law.at, law.name()),
                    format!("a test does not state the condition `{}` that `{}` needs", target.condition, law.name()),
                    format!("conditions = {{ {} = \"...\" }} in every test", target.condition),
                )
            })?;
            let mut dp = vec![0.0; self.values[c].len()];
            let factor = coefficient.factor(condition - target.reference, &self.values[c], &mut dp);
            let base = p[target.param];
            p[target.param] = base * factor;
            chain[target.param].iter_mut().for_each(|(_, d)| *d *= factor);
            for (own, d) in self.chains[c].iter().zip(&dp) {
                chain[target.param].extend(own.iter().map(|(k, slope)| (*k, base * d * slope)));
            }
        }
        Ok(())
    }
}
