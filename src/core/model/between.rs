//! What the deviations of mass between nodes take from the model that they act in: masses, springs and dampers beside them.

use std::collections::BTreeMap;

use crate::effect::own_motion;

use super::bound::Chain;
use super::{Instance, ModelError, Site, System};

/// A number with its derivatives.
#[derive(Clone, Default)]
struct Known {
    value: f64,
    chain: Chain,
}

impl Known {
    fn add(&mut self, other: &Known, times: f64) {
        self.value += times * other.value;
        self.chain.extend(other.chain.iter().map(|(k, d)| (*k, times * d)));
    }
}

/// A test's numbers, before they act at places.
pub(super) struct Numbers<'a> {
    pub system: &'a System,
    /// Its instances that scale others.
    pub laws: &'a [usize],
    pub conditions: &'a BTreeMap<String, f64>,
    pub values: &'a [Vec<f64>],
    pub chains: &'a [Vec<Chain>],
}

impl Numbers<'_> {
    /// Sets what instance i takes from the model at this place; nothing of other effects.
    pub(super) fn take(&self, i: usize, place: usize, p: &mut [f64], chain: &mut [Chain]) -> Result<(), ModelError> {
        match self.system.instances[i].name() {
            "inertia_deviation" => {
                let (m, [k, c]) = (self.mass(place), self.springs(place)?);
                p[1] = m;
                for (at, known) in [(2, k), (3, c)] {
                    (p[at], chain[at]) = (known.value, known.chain);
                }
            }
            "node_deviation" => self.node(place, p, chain)?,
            _ => {}
        }
        Ok(())
    }

    /// Mean mass of the bodies at the ends of a place.
    fn mass(&self, place: usize) -> f64 {
        let model = &self.system.model;
        let ends: Vec<usize> = [model.places[place].from, model.places[place].to].into_iter().flatten().collect();
        ends.iter().map(|d| model.dofs[*d].mass).sum::<f64>() / ends.len().max(1) as f64
    }

    /// Stiffness and damping of the springs and dampers at a place.
    fn springs(&self, place: usize) -> Result<[Known; 2], ModelError> {
        let mut found = [Known::default(), Known::default()];
        for (i, instance) in self.system.instances.iter().enumerate().filter(|(_, i)| acts(i, place)) {
            let into = match instance.name() {
                "linear_stiffness" | "stiffness_deviation" => 0,
                "viscous" | "damping_deviation" => 1,
                _ => continue,
            };
            if instance.only.as_ref().is_some_and(|only| !only.holds(self.conditions)) {
                continue;
            }
            let (mut p, mut chain) = (self.values[i].clone(), self.chains[i].clone());
            self.scale(i, place, &mut p, &mut chain)?;
            found[into].add(&Known { value: p[0], chain: chain.swap_remove(0) }, 1.0);
        }
        Ok(found)
    }

    /// Twice the quarter of a mass on every spring beside the node, and the mean of their own motions.
    fn node(&self, place: usize, p: &mut [f64], chain: &mut [Chain]) -> Result<(), ModelError> {
        let model = &self.system.model;
        let dof = model.places[place].to.or(model.places[place].from);
        let (mut mass, mut own, mut count) = (Known::default(), [Known::default(), Known::default()], 0.0f64);
        for (a, instance) in self.system.instances.iter().enumerate().filter(|(_, i)| i.name() == "inertia_deviation") {
            let Site::Places(places) = &instance.site else { continue };
            for q in places.iter().filter(|q| dof.is_some() && (model.places[**q].from == dof || model.places[**q].to == dof)) {
                let (m, springs) = (self.mass(*q), self.springs(*q)?);
                mass.add(&Known { value: self.values[a][0], chain: self.chains[a][0].clone() }, 0.5 * m);
                let unit = own_motion(m, 1.0, 0.0)[0];
                own.iter_mut().zip(&springs).for_each(|(own, known)| own.add(known, unit));
                count += 1.0;
            }
        }
        (p[0], chain[0]) = (mass.value, mass.chain);
        for (at, own) in own.iter().enumerate() {
            let mut mean = Known::default();
            mean.add(own, 1.0 / count.max(1.0));
            (p[at + 1], chain[at + 1]) = (mean.value, mean.chain);
        }
        Ok(())
    }
}

fn acts(instance: &Instance, place: usize) -> bool {
    matches!(&instance.site, Site::Places(places) if places.contains(&place))
}
