//! What was added, as it is named: missing physics, and instruments at fault.

use super::candidates::Name;
use super::climb::{Added, Climb};
use super::fault::{of_all, of_channel};
use super::held_out::{HeldOutTests, Look};
use super::ladder::strength_unit;
use crate::diagnose::calibrate::weigh::{Tied, Weighed};
use crate::diagnose::results::{EffectAt, Instrument, Missing};
use crate::model::Instance;

impl From<&Name> for EffectAt {
    fn from(name: &Name) -> EffectAt {
        EffectAt { effect: name.effect.into(), at: name.at.clone(), of: name.of.clone() }
    }
}

impl std::fmt::Display for Name {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        EffectAt::from(self).fmt(f)
    }
}

impl Climb<'_> {
    /// Physics that was added, what costs most to leave out first.
    pub(in crate::diagnose) fn missing(&self, held: Option<(&HeldOutTests, &Look)>) -> Vec<Missing> {
        let of = |k: &usize| {
            let a = &self.added[*k];
            let proven = held.and_then(|(h, last)| Some(h.word(&h.look(a.without.as_ref()?)?, last).bears_out(&self.settings)));
            Missing { effect: a.name.effect.into(), at: a.name.at.clone(), of: a.name.of.clone(), tied_with: tied_with(a), proven }
        };
        self.order.iter().filter(|k| self.is_physics(**k)).map(of).collect()
    }

    /// Instruments at fault, with what the record says; those as well that say the same as an effect in all tests, which no test here tells apart.
    pub(in crate::diagnose) fn instruments(&self) -> Vec<Instrument> {
        let of = |k: &usize| -> Option<Instrument> {
            let (a, instance) = (&self.added[*k], self.instance(*k)?);
            let why = self.says(&a.name, instance)?;
            Some(Instrument { effect: a.name.effect.into(), at: a.name.at.clone(), why, tied_with: tied_with(a) })
        };
        let faults = self.order.iter().filter(|k| self.is_fault(**k)).filter_map(of);
        let same = self.order.iter().filter(|k| self.is_physics(**k)).flat_map(|k| self.same(&self.added[*k]));
        self.turned.iter().cloned().chain(faults).chain(same).collect()
    }

    /// Instruments that read, in all tests, the very same as an addition does.
    fn same(&self, a: &Added) -> Vec<Instrument> {
        let equal =
            a.tied.iter().filter(|(how, _, w)| *how == Tied::Alike && self.scale.apart(&w.seen, &self.now) <= self.settings.settled);
        let of = |(_, name, w): &(Tied, Name, Weighed)| {
            let why = format!(
                "{}, or {} at {}: in these tests both say the same",
                self.says(name, w.last().filter(|i| of_all(i))?)?,
                a.name.effect,
                a.name.at
            );
            let effect = vec![format!("{} at {}", a.name.effect, a.name.at)];
            Some(Instrument { effect: name.effect.into(), at: name.at.clone(), why, tied_with: effect })
        };
        equal.filter_map(of).collect()
    }

    /// What a fault does to a channel, in words.
    fn says(&self, name: &Name, instance: &Instance) -> Option<String> {
        let (unit, factor) = strength_unit(&self.case, &self.now.fitted.system, name);
        let value = instance.params.first()?.value / factor;
        let (test, role) = name.at.rsplit_once('.')?;
        let who = if test == "*" { format!("the {role} channel of all tests") } else { format!("the {role} channel of {test}") };
        Some(match name.effect {
            "gain" => format!("{who} reads {value:.3} of what the model and the other tests say"),
            "delay" => format!("{who} is late by {value:.3e} {unit}"),
            "offset" => format!("{who} lies {value:.3e} {unit} beside the others"),
            "moving_mass" | "accelerometer_mass" => format!("{who} carries a mass of {value:.3e} {unit}"),
            other => format!("{who} has a {other} of {value:.3e} {unit}"),
        })
    }

    /// The instance of an addition.
    pub(in crate::diagnose) fn instance(&self, k: usize) -> Option<&Instance> {
        self.now.fitted.system.instances.get(self.base + k)
    }

    /// Effects that were added; what an instrument does is none.
    pub(in crate::diagnose) fn effects(&self) -> usize {
        (0..self.added.len()).filter(|k| !self.is_fault(*k)).count()
    }

    /// Whether an addition is a fault of an instrument.
    pub(in crate::diagnose) fn is_fault(&self, k: usize) -> bool {
        self.instance(k).is_some_and(of_channel)
    }
}

fn tied_with(a: &Added) -> Vec<String> {
    a.tied.iter().map(|(_, n, _)| format!("{} at {}", n.effect, n.at)).collect()
}
