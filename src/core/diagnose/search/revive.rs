//! What a fit has put out is begun again.
//!
//! An effect of the study whose strength has gone to zero shows nothing of its shape any more, and no step from there brings it back. That
//! happens to an effect that was bent to do another's work: once the other stands beside it, the values it was bent to are wrong, and zero is
//! better than they are. So the model is fitted once more from where the study begins, its additions as they stand, and what is at zero even then
//! is searched for at its place, over all its shapes, as a candidate would be.

use crate::effect::{Kind, Role};
use crate::model::Instance;

use super::climb::Climb;
use super::step::{Against, step};
use crate::diagnose::calibrate::case::Case;
use crate::diagnose::calibrate::fit::begin;
use crate::diagnose::trace;

impl Climb<'_> {
    /// Begins every effect of the study that stands at zero again, where the study begins it or where it scores best, and keeps it there where that
    /// gains more than a tie.
    pub fn revive(&mut self) {
        if (0..self.base).any(|k| is_out(&self.now.fitted.system.instances[k]) && !self.slack.has(k)) {
            self.begin_again();
        }
        for k in 0..self.base {
            if !is_out(&self.now.fitted.system.instances[k]) || self.slack.has(k) || trace::stopped(self.monitor) {
                continue;
            }
            self.revive_one(k);
        }
    }

    /// The model fitted once more from where the study begins, its additions as they stand, where that is better: without them the fit may have gone
    /// into another valley, from which nothing leads back. What was bent to their work is then not where it was bent to.
    fn begin_again(&mut self) -> Option<()> {
        let mut system = self.now.fitted.system.clone();
        for (own, start) in system.instances.iter_mut().take(self.base).zip(&self.case.system.instances) {
            own.params.iter_mut().zip(&start.params).filter(|(v, _)| v.free).for_each(|(v, s)| v.value = s.value);
        }
        let loose = Case { worth: Some(self.settings.settled), ..self.scale.case.at(&system) };
        let began = begin(&loose, &self.monitor.quiet()).ok()?;
        let again = self.scale.weigh(&began.fitted.system, &self.now.v, self.monitor).ok()?;
        let again = self.scale.finished(again, self.monitor).ok()?;
        let gain = self.scale.worth(&again) - self.scale.worth(&self.now);
        if gain > self.settings.tie {
            (self.watch)(&format!("begun again from the study's own start with what was added: {gain:.1} nats"));
            self.now = again;
            self.forget();
        }
        Some(())
    }

    fn revive_one(&mut self, k: usize) -> Option<()> {
        let own = self.now.fitted.system.instances[k].clone();
        let mut scale = self.scale.again();
        let small = scale.weigh(&self.now.fitted.system.without(k)?, &self.now.v, self.monitor).ok()?;
        (scale.case.search.effects, scale.case.search.places) = (Some(vec![own.name().into()]), Some(vec![own.at.clone()]));
        let tie = self.settings.tie;
        let quiet = |_: &str| {};
        let against = Against {
            scale: &scale,
            base: &small,
            need: Some(tie),
            beyond: 0.0,
            stands: None,
            rival: None,
            elsewhere: &[],
            added: vec![],
            monitor: self.monitor,
            watch: &quiet,
        };
        let found = step(&against).ok()?.stood.into_iter().find(|s| s.name.at == own.at)?;
        let (begun, others) = found.weighed.fitted.system.instances.split_last()?;
        let mut system = found.weighed.fitted.system.clone();
        system.instances = others.to_vec();
        let system = system.with(k, vec![at_values_of(&own, begun)]);
        let again = self.scale.weigh(&system, &found.weighed.v, self.monitor).ok()?;
        let gain = self.scale.worth(&again) - self.scale.worth(&self.now);
        if gain > tie {
            (self.watch)(&format!("{} at {} was out, and is begun again: {gain:.1} nats", own.name(), own.at));
            self.now = again;
            self.forget();
        }
        Some(())
    }
}

/// Whether an effect stands at strength zero, its least, and has a shape that is fitted: nothing there says what that should be.
fn is_out(instance: &Instance) -> bool {
    let info = instance.effect.info();
    let acts = matches!(info.role, Role::Force | Role::Series);
    let shaped = instance.params.iter().zip(info.params).any(|(v, p)| v.free && p.kind == Kind::Shape);
    let strength = &instance.params[0];
    acts && shaped && strength.free && strength.min == 0.0 && strength.value == 0.0
}

/// The instance with what another one of its law has for the parameters that it fits, within its own bounds.
fn at_values_of(own: &Instance, other: &Instance) -> Instance {
    let mut instance = own.clone();
    for (v, o) in instance.params.iter_mut().zip(&other.params).filter(|(v, _)| v.free) {
        v.value = o.value.clamp(v.min, v.max);
    }
    instance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Sign, find};
    use crate::model::{ParamValue, Site};

    fn film(f: ParamValue, v0: ParamValue) -> Instance {
        let effect = find("film").unwrap();
        let mut params: Vec<ParamValue> = effect.info().params.iter().map(|p| ParamValue::fixed(p.default)).collect();
        (params[0], params[1]) = (f, v0);
        Instance::new(effect, "c1.x", Site::Places(vec![0]), params)
    }

    #[test]
    fn what_has_gone_to_zero_with_a_free_shape_is_out() {
        let free = |v: f64| ParamValue::free(v, Sign::Positive);
        assert!(is_out(&film(free(0.0), free(1e-3))));
        // It acts; it is meant to be absent; its shape is known, so that its strength alone comes back by itself.
        assert!(!is_out(&film(free(1.0), free(1e-3))));
        assert!(!is_out(&film(ParamValue::fixed(0.0), free(1e-3))));
        assert!(!is_out(&film(free(0.0), ParamValue::fixed(1e-3))));
    }

    #[test]
    fn it_begins_at_what_was_found_within_the_bounds_of_the_study() {
        let free = |v: f64| ParamValue::free(v, Sign::Positive);
        let own = film(free(0.0), ParamValue { max: 0.01, ..free(1e-5) });
        let begun = at_values_of(&own, &film(free(3.0), free(0.5)));
        assert_eq!((begun.params[0].value, begun.params[1].value), (3.0, 0.01));
        // What the study fixes stays.
        let fixed = film(free(0.0), ParamValue::fixed(1e-5));
        assert_eq!(at_values_of(&fixed, &film(free(3.0), free(0.5))).params[1].value, 1e-5);
    }
}
