//! Refits that have come to rest, moved on: off a plateau, and with what was kept at a value of its grid free.

use crate::model::System;
use crate::parallel;

use super::refit::{Bench, Leader, cost_of};
use super::score::Score;
use crate::diagnose::calibrate::case::Fitted;

impl Bench<'_> {
    /// Moves the best refits on from where they have come to rest: off a plateau, and with what was kept at a value of its grid free.
    pub fn moved_on(&self, picked: &[Score], fitted: &mut [Result<Fitted, String>], leader: Option<Leader>, watch: &(dyn Fn(&str) + Sync)) {
        let race = self.race();
        let drops = picked.iter().zip(&*fitted).filter(|(_, f)| f.is_ok()).map(|(s, _)| s.drop);
        let expected = drops.chain(leader.map(|l| l.drop)).fold(0.0, f64::max);
        let near = among_three(fitted.iter().map(cost_of).chain(leader.map(|l| l.cost)).collect(), race.hopeful);
        let off = parallel::over(fitted.len(), |k| match &fitted[k] {
            Ok(f) if f.outcome.cost <= near || picked[k].drop >= expected => self.off_plateau(f),
            _ => vec![],
        });
        if off.iter().any(|o| !o.is_empty()) {
            watch(&format!("refitting from {} points off a plateau", off.iter().map(Vec::len).sum::<usize>()));
        }
        self.exchange(fitted, off, 0.0);
        let more_free = |f: &Result<Fitted, String>| f.as_ref().ok().filter(|f| f.outcome.cost <= near).and_then(|f| self.freed(f));
        let more_free = fitted.iter().map(|f| more_free(f).into_iter().collect()).collect();
        self.exchange(fitted, more_free, race.freeing);
    }

    /// Where else a candidate may begin that has come to rest where a combination of its own parameters does nothing: a slider that never
    /// slips shows its stiffness alone, and nothing there says at which force it would. Every positive parameter is moved along that
    /// combination until the response changes.
    fn off_plateau(&self, fitted: &Fitted) -> Vec<System> {
        let last = fitted.system.instances.len() - 1;
        let own: Vec<usize> = (0..fitted.free.len()).filter(|k| fitted.free[*k].instance == last).collect();
        let value = |k: usize| fitted.system.instances[last].params[fitted.free[k].param].value;
        if own.len() < 2 || own.iter().any(|k| value(*k) <= 0.0) || self.monitor.stops() {
            return vec![];
        }
        // Slopes with respect to the logarithms.
        let slope = |i: usize, c: usize| {
            let k = own[c];
            fitted.outcome.jacobian[(i, k)] * if fitted.free[k].log { 1.0 } else { value(k) }
        };
        let slopes = nalgebra::DMatrix::from_fn(fitted.outcome.n_residuals, own.len(), slope);
        let svd = slopes.svd(false, true);
        let (Some(v), size) = (svd.v_t, svd.singular_values.max()) else { return vec![] };
        let (least, at) = (svd.singular_values.min(), svd.singular_values.imin());
        if least > self.race().flat * size {
            return vec![];
        }
        let direction = v.row(at) / v.row(at).amax();
        let here = fitted.outcome.cost;
        let step = |t: &f64| {
            let mut system = fitted.system.clone();
            for (c, k) in own.iter().enumerate() {
                let p = &mut system.instances[last].params[fitted.free[*k].param];
                p.value = (p.value * (t * direction[c]).exp()).clamp(p.min, p.max);
            }
            let changed = self.cost_at(&system).is_some_and(|cost| (cost - here).abs() > self.race().unmoved * here);
            changed.then_some(system)
        };
        parallel::map(&self.race().off, step).into_iter().flatten().collect()
    }

    /// The fitted system with what was kept at a value of its grid free in what was added; none where it has no such.
    pub fn freed(&self, fitted: &Fitted) -> Option<System> {
        let mut system = fitted.system.clone();
        let mut any = false;
        for instance in &mut system.instances[self.base.instances.len()..] {
            let info = instance.effect.info();
            for (value, p) in instance.params.iter_mut().zip(info.params).filter(|(v, p)| p.grid.fitted_last(v.value)) {
                (value.free, value.min, value.max, any) = (true, p.min.max(p.grid.least(value.value)), p.max, true);
            }
        }
        any.then_some(system)
    }
}

/// A cost that only the best three reach, and those within a factor of the best.
fn among_three(mut costs: Vec<f64>, hopeful: f64) -> f64 {
    costs.sort_by(f64::total_cmp);
    let best = costs.first().copied().unwrap_or(0.0);
    (hopeful * best).min(costs.get(2).or(costs.last()).copied().unwrap_or(0.0))
}
