//! Settings of what was added, fitted: a stop whose force grows with the power 1.8 of the penetration is a stop, and no stop of the power 1.5 with a second one beside it.

use crate::effect::{Grid, Kind, Param};
use crate::model::{ParamValue, System};
use crate::parallel;

use super::climb::Climb;
use super::fault::of_channel;
use crate::diagnose::calibrate::weigh::Weighed;
use crate::diagnose::trace;

/// Whether a value is a setting that a fit may move: within bounds to both sides, and none of which the search tries values one by one.
fn may_be_fitted(param: &Param, value: &ParamValue) -> bool {
    param.kind == Kind::Setting && !value.free && param.min.is_finite() && param.max.is_finite() && matches!(param.grid, Grid::None)
}

/// Instance and parameter of every such setting from instance `first` on, but for what a channel reads.
fn settings(system: &System, first: usize) -> Vec<(usize, usize)> {
    let laws = system.instances.iter().enumerate().skip(first).filter(|(_, i)| !of_channel(i));
    let of = |(k, i): (usize, &crate::model::Instance)| {
        let free = i.effect.info().params.iter().zip(&i.params).enumerate().filter(|(_, (p, v))| may_be_fitted(p, v));
        free.map(|(p, _)| (k, p)).collect::<Vec<_>>()
    };
    laws.flat_map(of).collect()
}

impl Climb<'_> {
    /// Fits the setting of an addition that gains most by it, if one does, by the criterion of the search; whether one does. It is weighed before another effect
    /// is, so that none takes up what the setting leaves.
    pub(super) fn free_setting(&mut self) -> bool {
        let open = settings(&self.now.fitted.system, self.base);
        if open.is_empty() || trace::stopped(self.monitor) {
            return false;
        }
        let (scale, now, monitor) = (&self.scale, &self.now, self.monitor);
        let tried = open.len() as f64 / scale.odds(self.added.len(), now);
        let weigh = |&(k, p): &(usize, usize)| -> Option<(f64, Weighed)> {
            let mut system = now.fitted.system.clone();
            let param = &now.fitted.system.instances[k].effect.info().params[p];
            let value = &mut system.instances[k].params[p];
            *value = ParamValue { min: param.min, max: param.max, free: true, ..value.clone() };
            let promised = scale.promised_about(&system, &now.v, monitor).ok()?;
            let most = scale.gain(&promised.stands, now, tried) + scale.settings.reach * promised.step;
            if most < -scale.settings.tie {
                return None;
            }
            let weighed = scale.weigh(&system, &now.v, monitor).ok()?;
            Some((scale.gain(&weighed, now, tried), weighed))
        };
        let found = parallel::map(&open, weigh);
        let best = open.iter().zip(found).filter_map(|(at, f)| Some((at, f?))).max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let Some((&(k, p), (gain, weighed))) = best.filter(|(_, (gain, w))| scale.better(*gain, w, now, monitor).yes) else { return false };
        let instance = &weighed.fitted.system.instances[k];
        let (name, value) = (instance.effect.info().params[p].name, instance.params[p].value);
        (self.watch)(&format!("{name} of {} at {} is fitted: {value:.4}, {gain:.1} nats", instance.name(), instance.at));
        self.now = weighed;
        self.forget();
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::find;
    use crate::model::{Axis, Body, Model};

    #[test]
    fn exponents_are_fitted_and_sides_and_references_are_not() {
        let model = Model::joined(vec![Body::fixed("ground"), Body::new("m", 1.0, &[Axis::X])], &[("c1", "ground", "m")]);
        let system = System::new(model.unwrap()).and("linear_stiffness", "c1.x", &[]).unwrap().and("contact", "c1.x", &[]).unwrap();
        let named = |system: &System, first| -> Vec<&str> {
            settings(system, first).into_iter().map(|(k, p)| system.instances[k].effect.info().params[p].name).collect()
        };
        assert_eq!(named(&system, 1), ["n"]);
        assert!(named(&system, 2).is_empty(), "what the study states stays as it is");
        let mut free = system.clone();
        free.instances[1].params[3].free = true;
        assert!(named(&free, 1).is_empty());
        let with = |name: &str| system.clone().and(name, "c1.x", &[]).unwrap();
        assert_eq!(named(&with("lugre"), 2), ["skew"]);
        assert!(named(&with("bouc_wen"), 2).is_empty(), "whose settings are fitted from the first");
        assert!(find("contact").unwrap().info().params[3].name == "n");
    }
}
