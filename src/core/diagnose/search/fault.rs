//! Faults of instruments, held against the record: what concerns one test alone is never physics, and what physics explains is no fault.

use crate::effect::Role;
use crate::evidence::Seen;
use crate::model::{Instance, Site, System};
use crate::response::{Coefficients, Plan};

use crate::diagnose::calibrate::weigh::{Scale, Weighed};
use crate::diagnose::results::Fault;
use crate::diagnose::results::SplitName;

/// Whether an instance is a law of a measuring channel.
pub fn of_channel(instance: &Instance) -> bool {
    instance.effect.info().role == Role::Channel
}

/// The one test that a fault concerns; none of a fault of all.
fn own_test(instance: &Instance) -> Option<&str> {
    match &instance.site {
        Site::Channel(site) if site.test != "*" => Some(&site.test),
        _ => None,
    }
}

/// Whether it is a fault of a channel in all tests. Such a fault may read in every test as an effect does.
pub fn of_all(instance: &Instance) -> bool {
    of_channel(instance) && own_test(instance).is_none()
}

impl Scale {
    /// What in the record contradicts the fault that the last instance of a weighed model is; none where the record shows it. `before`: the
    /// model without it.
    pub fn contradicted(&self, with: &Weighed) -> Option<Fault> {
        let system = &with.fitted.system;
        let fault = system.instances.last().filter(|i| of_channel(i))?;
        let plans = self.case.plans_of(SplitName::Fit);
        if own_test(fault).is_some() && plans.len() < self.settings.fault_tests {
            return Some(Fault::FewTests);
        }
        let mut without = system.clone();
        without.instances.pop();
        let moves: Vec<f64> = plans.iter().map(|p| moved(p, system, &without).unwrap_or(0.0)).collect();
        let t = (0..moves.len()).max_by(|a, b| moves[*a].total_cmp(&moves[*b]))?;
        let least = if fault.name() == "gain" { self.settings.fault_gain } else { self.settings.fault_least };
        if moves[t] < least {
            return Some(Fault::Small);
        }
        // A fault bends the one test to the model, whatever the model errs by: what it errs by elsewhere counts as well.
        let errors = with.v.own_errors(t, &self.evidence.records[t]);
        let errs = errors.iter().copied().fold(with.v.model_error(&self.evidence), f64::max);
        if moves[t] < self.settings.fault_over * errs {
            return Some(Fault::BelowModelError);
        }
        own_test(fault)?;
        let left: Vec<f64> = with.seen.iter().enumerate().map(|(t, s)| self.error(t, s)).collect();
        let floor = self.noise(t) + self.settings.visible_least * self.settings.evidence.model_error_least;
        let mut others: Vec<f64> = left.iter().enumerate().filter(|(k, _)| *k != t).map(|(_, e)| *e).collect();
        others.sort_by(f64::total_cmp);
        let median = others.get(others.len() / 2).copied().unwrap_or(0.0);
        (left[t] > self.settings.like_others * median.max(floor)).then_some(Fault::UnlikeOthers)
    }

    /// Relative error of a test, root mean square over its coefficients.
    pub fn error(&self, test: usize, seen: &Seen) -> f64 {
        self.relative(test, |i| seen.r[i] * seen.r[i])
    }

    /// The same of noise.
    pub fn noise(&self, test: usize) -> f64 {
        self.relative(test, |i| self.evidence.records[test].noise[i])
    }

    fn relative(&self, test: usize, square: impl Fn(usize) -> f64) -> f64 {
        let record = &self.evidence.records[test];
        let seen: Vec<usize> = (0..record.noise.len()).filter(|i| record.noise[*i].is_finite() && record.size[*i] > 0.0).collect();
        (seen.iter().map(|i| square(*i) / record.size[*i]).sum::<f64>() / seen.len().max(1) as f64).sqrt()
    }
}

/// Part of a test's response by which two systems differ there, root mean square.
fn moved(plan: &Plan, a: &System, b: &System) -> Option<f64> {
    let turned = |s: &System| {
        let computed = plan.evaluate(s, &[], false).ok()?;
        let of = Coefficients::of(plan);
        Some(of.turned(&nalgebra::DMatrix::from_column_slice(plan.len(), 1, &computed.values)))
    };
    let (a, b) = (turned(a)?, turned(b)?);
    Some((&a - &b).norm() / a.norm().max(f64::MIN_POSITIVE))
}
