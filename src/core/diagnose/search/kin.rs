//! Laws of one kind say the same of a place in parameters of the same name: where elastic slip stands at a force and a distance, Bouc-Wen
//! stands at much the same. One that has come to rest in another valley than its kin is begun once more at the values that theirs came to.

use crate::model::{Instance, System};
use crate::parallel;

use super::refit::{Bench, Refit, proof};

impl Bench<'_> {
    /// Fits every refitted candidate that stands behind its kin at its place from the values of the best of them, where these might come first; what
    /// that betters takes its place. `unexplained`: the cost without a candidate.
    pub fn begin_at_kin(&self, refits: &mut [Refit], unexplained: f64, watch: &(dyn Fn(&str) + Sync)) {
        let least = refits.iter().filter_map(|r| r.result.as_ref().ok()).map(|p| p.fitted.outcome.cost / unexplained).fold(1.0, f64::min);
        let starts: Vec<(usize, System)> = (0..refits.len()).filter_map(|k| Some((k, self.of_kin(refits, k, unexplained)?))).collect();
        if starts.is_empty() || self.monitor.stops() {
            return;
        }
        watch(&format!("refitting {} from where a law of their kind stands", starts.len()));
        let bettered = parallel::map_into(starts, |_, (k, start)| {
            let stands = refits[k].result.as_ref().ok()?;
            // A fit that the select tests cannot be computed with leaves what stands.
            let found = self.bettered(&refits[k].score, &stands.fitted, start, least)?;
            Some((k, proof(self.case, found).ok()?))
        });
        for (k, proof) in bettered.into_iter().flatten() {
            let name = &self.names[refits[k].candidate];
            watch(&format!("  refit {} at {}: cost {:.4e}", name.effect, name.at, proof.fitted.outcome.cost));
            refits[k].result = Ok(proof);
        }
    }

    /// The candidate at the values of the best of its kin, in the model as that was fitted.
    fn of_kin(&self, refits: &[Refit], k: usize, unexplained: f64) -> Option<System> {
        let own = refits[k].result.as_ref().ok()?;
        let nats = |cost: f64| self.nats(cost / unexplained);
        let best = refits.iter().filter_map(|r| r.result.as_ref().ok()).map(|p| nats(p.fitted.outcome.cost)).fold(0.0, f64::max);
        let place = |r: &Refit| &self.names[r.candidate].at;
        let ahead = refits.iter().filter(|r| place(r) == place(&refits[k])).filter_map(|r| r.result.as_ref().ok());
        let ahead = ahead.filter(|p| p.fitted.outcome.cost < (1.0 - self.race().kin_ahead) * own.fitted.outcome.cost);
        // Where its kin cannot come first, neither can it.
        let ahead = ahead.filter(|p| (self.bound)(refits[k].candidate, nats(p.fitted.outcome.cost)) >= best - self.tie);
        let begun = ahead.filter_map(|p| {
            let (kin, others) = p.fitted.system.instances.split_last()?;
            let begun = carried(own.fitted.system.instances.last()?, kin, self.race().shared)?;
            let mut system = System { instances: others.to_vec(), ..p.fitted.system.clone() };
            system.instances.push(begun);
            Some((p.fitted.outcome.cost, system))
        });
        begun.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, system)| system)
    }
}

/// The law with the values of its kin; none where they share too little.
pub(in crate::diagnose) fn carried(law: &Instance, kin: &Instance, least: usize) -> Option<Instance> {
    let (own, theirs) = (law.effect.info(), kin.effect.info());
    if own.name == theirs.name {
        return None;
    }
    let mut begun = law.clone();
    let mut shared = 0;
    for (value, p) in begun.params.iter_mut().zip(own.params).filter(|(v, _)| v.free) {
        let same = theirs.params.iter().position(|q| q.name == p.name && q.dim == p.dim);
        if let Some(from) = same.map(|q| &kin.params[q]).filter(|v| v.value > 0.0) {
            value.value = from.value.clamp(value.min, value.max);
            shared += 1;
        }
    }
    (shared >= least).then_some(begun)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{Sign, find};
    use crate::model::{ParamValue, Site};

    fn law(name: &str, values: &[(&str, f64)]) -> Instance {
        let effect = find(name).unwrap();
        let value = |p: &crate::effect::Param| {
            let stated = values.iter().find(|(n, _)| *n == p.name);
            stated.map_or(ParamValue::fixed(p.default), |(_, v)| ParamValue::free(*v, Sign::Positive))
        };
        Instance::new(effect, "c1.x", Site::Places(vec![0]), effect.info().params.iter().map(value).collect())
    }

    fn value(i: &Instance, name: &str) -> f64 {
        i.params[i.effect.info().params.iter().position(|p| p.name == name).unwrap()].value
    }

    #[test]
    fn a_law_takes_what_it_shares_with_its_kin() {
        let far = law("bouc_wen", &[("f", 3.0), ("d", 1e-6), ("n", 1.0)]);
        let begun = carried(&far, &law("elastic_slip", &[("f", 26.0), ("d", 7e-5)]), 2).unwrap();
        assert_eq!((value(&begun, "f"), value(&begun, "d")), (26.0, 7e-5));
        // What the kin does not have keeps its own value.
        assert_eq!(value(&begun, "n"), 1.0);
        // Within its own bounds.
        let mut bounded = far.clone();
        bounded.params.iter_mut().for_each(|p| p.max = 10.0);
        assert_eq!(value(&carried(&bounded, &law("elastic_slip", &[("f", 26.0), ("d", 7e-5)]), 2).unwrap(), "f"), 10.0);
    }

    #[test]
    fn one_name_in_common_makes_no_kin() {
        let slip = law("elastic_slip", &[("f", 26.0), ("d", 7e-5)]);
        assert!(carried(&slip, &slip, 2).is_none());
        assert!(carried(&law("coulomb", &[("f", 1.0)]), &slip, 2).is_none());
        assert!(carried(&law("viscous", &[("c", 1.0)]), &slip, 2).is_none());
    }
}
