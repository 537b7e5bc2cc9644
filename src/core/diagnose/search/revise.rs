//! What stands is looked at again: taken out, or exchanged for what does its work better.

use crate::effect::Role;
use crate::model::{Instance, System};
use crate::parallel;

use super::candidates::Name;
use super::climb::{Added, Climb};
use super::fault::{of_all, of_channel};
use super::held_out::HeldOutTests;
use super::step::{Against, Step, Stood, role, step};
use crate::diagnose::DiagnoseError;
use crate::diagnose::calibrate::weigh::{Scale, Tied, Weighed};
use crate::diagnose::results::{EffectAt, Rung, SplitName};
use crate::diagnose::trace;

/// What could stand in the place of an addition.
struct Alternatives {
    /// The addition.
    of: usize,
    /// Tied with it.
    tied: Vec<(Tied, Name, Weighed)>,
    /// What is better than it, by so many nats.
    better: Option<(f64, Name, Weighed)>,
    /// The model without it; none where laws act on it.
    without: Option<Weighed>,
}

/// One effect more, which an exchange has to come up with.
struct Rival<'a> {
    /// Nats by which the model with it is worth more than the present one.
    ahead: f64,
    /// Nats that each candidate may add to the present model at most.
    promises: &'a [(Name, f64)],
}

impl Climb<'_> {
    /// The model without an addition and the present one, both under the counts of the smaller. That goes on from where it was last weighed, so that it need
    /// not go the way back that the addition has led it.
    fn beside_smaller(&self, k: usize) -> Option<(Scale, Weighed, Weighed)> {
        let mut scale = self.scale.again();
        let without = self.now.fitted.system.without(self.base + k)?;
        let small = match self.added[k].smaller.as_ref().filter(|s| same_effects(&s.fitted.system, &without)) {
            Some(known) => scale.tempered(known, self.monitor).ok()?,
            None => {
                let small = scale.weigh(&without, &self.now.v, self.monitor).ok()?;
                scale.tempered(&small, self.monitor).ok()?
            }
        };
        let whole = scale.weigh(&self.now.fitted.system, &self.now.v, self.monitor).ok()?;
        Some((scale, small, whole))
    }

    /// Takes out what would not be added again to what else is there, the worst first, and what has fallen to zero, among the first so many additions: what
    /// was just added has just been weighed. The effects that are gone.
    pub fn remove(&mut self, mut among: usize) -> Vec<EffectAt> {
        let mut removed = Vec::new();
        while among > 0 && !trace::stopped(self.monitor) {
            let weigh = |k: usize| -> Option<(f64, Weighed)> {
                let (scale, small, whole) = self.beside_smaller(k)?;
                let tried = self.tried / scale.odds(self.added.len() - 1, &small);
                let gain = scale.gain(&whole, &small, tried);
                let stays = gain > -self.settings.tie || scale.in_turn(gain, &whole, &small, self.monitor).yes;
                (!stays).then_some((gain, small))
            };
            let found = parallel::over(among, weigh);
            let worst = found.into_iter().enumerate().filter_map(|(k, f)| Some((k, f?)));
            let Some((k, (gain, small))) = worst.min_by(|a, b| a.1.0.total_cmp(&b.1.0)) else { break };
            let gone = self.added.remove(k);
            among -= 1;
            (self.watch)(&format!("removed {}: it would gain {gain:.1} nats", gone.name));
            removed.push(EffectAt::from(&gone.name));
            self.now = small;
            self.forget();
        }
        removed
    }

    /// Exchanges the addition for which something is better by [`crate::diagnose::settings::Settings::swap`], once, and lists what every addition is tied with;
    /// what was exchanged for what.
    pub fn swap(&mut self) -> Option<(EffectAt, EffectAt)> {
        let exchanged = self.replace(None);
        self.list_ties();
        exchanged
    }

    /// Lists what every addition is tied with, where that is not known.
    pub fn list_ties(&mut self) {
        let law = |k: usize| self.now.fitted.system.instances.get(self.base + k).is_some_and(|i| !of_channel(i));
        if self.added.iter().enumerate().any(|(k, a)| !a.held && law(k)) {
            let found = self.alternatives(None);
            self.tie(found);
        }
    }

    /// The exchange alone, if it comes to no less than one effect more, which a `step` has taken; where there is none and nothing is better, ties are listed on
    /// the way.
    pub fn replace(&mut self, rival: Option<(&Weighed, &Step)>) -> Option<(EffectAt, EffectAt)> {
        let ahead = |r: &Weighed| self.scale.worth(r) - self.scale.worth(&self.now);
        let beside = rival.map(|(r, step)| Rival { ahead: ahead(r), promises: &step.promises });
        let mut found = self.alternatives(beside.as_ref());
        let best = found.iter_mut().filter_map(|a| Some((a.of, a.better.take()?))).max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let Some((k, (nats, name, weighed))) = best else {
            // Beside what is added next they are others, and what is behind that was not looked for.
            if rival.is_none() {
                self.tie(found);
            }
            return None;
        };
        let weighed = self.scale.weigh(&weighed.fitted.system, &weighed.v, self.monitor).unwrap_or(weighed);
        if rival.is_some_and(|(r, _)| self.scale.worth(&weighed) < self.scale.worth(r)) {
            return None;
        }
        let acted_on = self.acted_on(k);
        let own = self.now.fitted.system.instances.get(self.base + k).cloned();
        let mut gone = self.added.remove(k);
        (self.watch)(&format!("{name} takes the place of {}: {nats:.1} nats", gone.name));
        let exchanged = (EffectAt::from(&name), EffectAt::from(&gone.name));
        let mut kin: Vec<(Name, Instance)> = std::mem::take(&mut gone.kin).into_iter().filter(|(n, _)| *n != name).collect();
        kin.extend(own.filter(|_| acted_on).map(|own| (gone.name.clone(), own)));
        let place = if acted_on { k } else { self.added.len() };
        self.added.insert(place, Added { gain: gone.gain + nats, kin, ..Added::new(name.clone()) });
        if acted_on {
            let of = self.added.iter_mut().filter(|a| a.name.at == name.at).filter_map(|a| a.name.of.as_mut());
            of.for_each(|of| *of = of.replacen(gone.name.effect, name.effect, 1));
        }
        self.now = weighed;
        self.forget();
        Some(exchanged)
    }

    /// Takes out that for which held-out and fitted tests together say little, and without which the error of the held-out ones is no larger, what they are most
    /// against first: their veto, addition by addition. The only one is held against the study's own model by the verdict, where nothing deviates; what deviates
    /// earns nothing for it.
    pub fn veto(&mut self, rungs: &mut Vec<Rung>) -> Result<(), DiagnoseError> {
        while self.added.len() > usize::from(self.slack.is_empty()) && !trace::stopped(self.monitor) {
            let plans = self.case.plans_of(SplitName::HeldOut);
            let held = HeldOutTests::new(plans, &self.scale.evidence, &self.first, &self.now, &self.settings);
            let Some((held, last)) = held.as_ref().and_then(|h| Some((h, h.look(&self.now)?))) else { return Ok(()) };
            let against = |k: usize| -> Option<f64> {
                let without = held.look(self.added[k].without.as_ref().filter(|_| self.is_physics(k))?)?;
                let word = held.word(&without, &last);
                (self.added[k].gain + word.nats <= self.settings.unproven && word.fall.0 <= 0.0).then_some(-word.nats)
            };
            let found = (0..self.added.len()).filter_map(|k| Some((k, against(k)?)));
            let Some((k, nats)) = found.max_by(|a, b| a.1.total_cmp(&b.1)) else { return Ok(()) };
            let gone = self.added.remove(k);
            (self.watch)(&format!("removed {}: held-out tests say {nats:.1} nats against it", gone.name));
            let Some(without) = gone.without else { return Ok(()) };
            self.now = without;
            self.forget();
            self.list_ties();
            rungs.push(self.rung(None, vec![EffectAt::from(&gone.name)])?);
        }
        Ok(())
    }

    fn tie(&mut self, found: Vec<Alternatives>) {
        for a in found {
            let loss = a.without.as_ref().map_or(f64::INFINITY, |w| super::step::error_of(&self.scale, w).powi(2));
            let added = &mut self.added[a.of];
            // What was tied with it at other places when it was added is so as long as the model has not changed.
            let known =
                std::mem::take(&mut added.tied).into_iter().filter(|(_, name, _)| added.held && a.tied.iter().all(|t| t.1 != *name));
            let tied = a.tied.iter().cloned().chain(known).collect();
            added.smaller.clone_from(&a.without);
            (added.tied, added.without, added.loss) = (tied, a.without, loss);
        }
        self.added.iter_mut().for_each(|a| a.held = true);
        // What costs most to leave out comes first; instances follow.
        if !self.now.fitted.system.instances.iter().any(|i| i.target.is_some()) {
            let mut order: Vec<usize> = (0..self.added.len()).collect();
            order.sort_by(|a, b| self.added[*b].loss.total_cmp(&self.added[*a].loss));
            self.order = order;
        }
    }

    /// What else of that which `stood` in the place of an addition, and what came close to it before, is worth beside it, the most first.
    fn others(&self, k: usize, (scale, small, stands): (&Scale, &Weighed, f64), stood: Vec<Stood>) -> Vec<(f64, Name, Weighed)> {
        let own = &self.added[k].name;
        let mut others: Vec<(f64, Name, Weighed)> = stood
            .into_iter()
            .filter(|s| s.admissible && s.name != *own && s.weighed.last().is_some_and(|i| !of_channel(i) || of_all(i)))
            .map(|s| (scale.worth(&s.weighed) - stands, s.name, s.weighed))
            .collect();
        // Those that came close when it was added are behind it until the model changes.
        let rivals = self.added[k].rivals.iter().filter(|_| !self.added[k].held);
        others.extend(rivals.filter_map(|(name, instance)| {
            let mut system = small.fitted.system.clone();
            system.instances.push(instance.clone());
            let weighed = scale.weigh(&system, &self.now.v, self.monitor).ok()?;
            Some((scale.worth(&weighed) - stands, name.clone(), weighed))
        }));
        others.sort_by(|a, b| b.0.total_cmp(&a.0));
        // A rival may have been weighed by the step as well.
        let mut told: Vec<Name> = vec![own.clone()];
        others.retain(|o| {
            let first = !told.contains(&o.1);
            told.push(o.1.clone());
            first
        });
        others
    }

    /// Whether laws act on an addition.
    fn acted_on(&self, k: usize) -> bool {
        self.now.fitted.system.without(self.base + k).is_none()
    }

    /// What of its kind could stand in the place of an addition that laws act on, these acting on it in turn. Which friction it is was decided before it was known
    /// that its limit follows a condition, and the rest that this left spoke for one or the other.
    fn with_its_laws(&self, k: usize) -> Alternatives {
        let stands = self.scale.worth(&self.now);
        let weigh = |(name, law): &(Name, Instance)| {
            let system = self.now.fitted.system.exchanged(self.base + k, law.clone())?;
            let weighed = self.scale.weigh(&system, &self.now.v, self.monitor).ok()?;
            Some((self.scale.worth(&weighed) - stands, name.clone(), weighed))
        };
        let mut others: Vec<(f64, Name, Weighed)> = parallel::map(&self.added[k].kin, weigh).into_iter().flatten().collect();
        others.sort_by(|a, b| b.0.total_cmp(&a.0));
        let better = others.first().filter(|o| o.0 > self.settings.swap).cloned();
        let tied = others.into_iter().filter_map(|(_, n, w)| Some((self.scale.tied(&w, &self.now)?, n, w))).collect();
        Alternatives { of: k, tied, better, without: None }
    }

    /// Whether something in the place of an addition may come to no less than one effect more beside it.
    fn may_come_up(&self, k: usize, rival: &Rival) -> bool {
        let added = &self.added[k];
        let free = self.now.fitted.free.iter().filter(|f| f.instance == self.base + k).count();
        let saved = 0.5 * free.saturating_sub(1) as f64 * self.scale.counts.n.ln();
        promised_in_place(&added.name, &added.rivals, rival.promises) + saved + self.settings.tie >= rival.ahead
    }

    /// For every law that was added, what else could stand in its place: all that is better or tied, or what may come up with a rival.
    fn alternatives(&self, rival: Option<&Rival>) -> Vec<Alternatives> {
        (self.watch)("holding what was added against what could stand in its place");
        let of = |k: usize| -> Option<Alternatives> {
            let instance = self.now.fitted.system.instances.get(self.base + k)?;
            if of_channel(instance) || trace::stopped(self.monitor) {
                return None;
            }
            // The step that added it weighed what else could stand there, and nothing has changed since.
            if rival.is_none() && self.added[k].held {
                return None;
            }
            if self.acted_on(k) {
                return Some(self.with_its_laws(k));
            }
            if rival.is_some_and(|r| !self.may_come_up(k, r)) {
                return None;
            }
            let (mut scale, small, whole) = self.beside_smaller(k)?;
            let stands = scale.worth(&whole);
            if instance.effect.info().role != Role::Coefficient {
                // What stands at its place, and what an instrument reads in all tests, since that is seen at every place.
                let roles = scale.case.plans.iter().flat_map(|(p, _)| p.blocks.iter().map(|b| format!("*.{}", b.role)));
                scale.case.search.places = Some(std::iter::once(instance.at.clone()).chain(roles).collect());
            }
            let need = stands - scale.worth(&small) - self.settings.tie;
            let quiet = |_: &str| {};
            // What stands in its place may begin where the model with it stands.
            let elsewhere: Vec<System> = self.now.fitted.system.without(self.base + k).into_iter().collect();
            let added = self.added.iter().enumerate().filter(|(j, _)| *j != k).map(|(_, a)| &a.name).collect();
            let own = &self.added[k].name;
            let mut stands_there = self.now.fitted.system.without(self.base + k)?;
            stands_there.instances.push(instance.clone());
            let against = Against {
                scale: &scale,
                base: &small,
                need: Some(need),
                beyond: rival.map_or(0.0, |r| r.ahead.max(0.0)),
                stands: Some((own, &stands_there)),
                rival: None,
                elsewhere: &elsewhere,
                added,
                monitor: self.monitor,
                watch: &quiet,
            };
            let Step { stood, .. } = step(&against).ok()?;
            let others = self.others(k, (&scale, &small, stands), stood);
            let best = others.iter().find(|o| o.2.last().is_some_and(|i| !of_channel(i)));
            let better = best.filter(|o| o.0 > self.settings.swap).cloned();
            let tied = others.into_iter().filter_map(|(_, n, w)| Some((scale.tied(&w, &whole)?, n, w))).collect();
            Some(Alternatives { of: k, tied, better, without: Some(small) })
        };
        parallel::over(self.added.len(), of).into_iter().flatten().collect()
    }
}

/// Nats by which the model with something else in the place of an addition may be likelier than the present one, at most. It is a part of the model with both: no
/// likelier than that, which is above the present one by what the score of the other law promises beside it. Without bound where the scores do not tell: of
/// frictions with memory one alone is scored at a place, and a law over a condition is held against laws everywhere.
fn promised_in_place(own: &Name, rivals: &[(Name, Instance)], promises: &[(Name, f64)]) -> f64 {
    if own.params_with_memory().is_some() || role(own) == Some(Role::Coefficient) {
        return f64::INFINITY;
    }
    let could = |n: &Name| n.at == own.at || n.at.starts_with("*.") || rivals.iter().any(|(r, _)| r == n);
    promises.iter().filter(|(n, _)| could(n)).map(|(_, nats)| *nats).fold(0.0, f64::max)
}

/// Whether the same effects act at the same places of two systems.
fn same_effects(a: &System, b: &System) -> bool {
    let same = |(a, b): (&Instance, &Instance)| std::ptr::eq(a.effect, b.effect) && (&a.site, &a.target) == (&b.site, &b.target);
    a.instances.len() == b.instances.len() && a.instances.iter().zip(&b.instances).all(same)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::find;
    use crate::model::Site;

    #[test]
    fn what_could_stand_in_a_place_promises_no_more_than_beside_what_stands_there() {
        let name = |effect: &'static str, at: &str| Name { effect, at: at.into(), of: None };
        let promises = [(name("coulomb", "c2.x"), 30.0), (name("backlash", "c1.x"), 4.0), (name("gain", "*.force"), 5.0)];
        let own = name("cubic_stiffness", "c1.x");
        assert_eq!(promised_in_place(&own, &[], &promises), 5.0, "at its place, and what an instrument reads in all tests");
        let rival = Instance::new(find("coulomb").unwrap(), "c2.x", Site::Places(vec![1]), vec![]);
        assert_eq!(promised_in_place(&own, &[(promises[0].0.clone(), rival)], &promises), 30.0, "what came close elsewhere as well");
        assert_eq!(promised_in_place(&own, &[], &promises[..1]), 0.0);
        assert_eq!(promised_in_place(&name("elastic_slip", "c1.x"), &[], &promises), f64::INFINITY);
    }
}
