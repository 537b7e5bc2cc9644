//! A test in which strengths are not quite those of the others.

use std::sync::Arc;

use crate::model::System;

use super::Plan;

/// Strengths that are others in one test, by temperature or mounting, and what the model computes there carried back to where they are not.
///
/// What a test leaves is linear in small deviations `d` of the logarithms of strengths, in a record of many cycles only about the right ones: 1 % of
/// stiffness is half a radian after sixteen cycles. Such a test is computed at its own `d`, and its values are carried back by their slopes there,
/// `f(0) ~ f(d) - S d`: the covariance `omega^2 S S'` of the scatter then speaks of the right columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stray {
    /// Logarithm of the factor on each of these free parameters.
    pub by: Vec<(String, f64)>,
    /// `S d` of every row; empty: values are those at `d`.
    pub ahead: Vec<f64>,
}

impl Stray {
    /// Factors on the parameters of this system, by instance and parameter.
    pub(super) fn factors(&self, system: &System) -> Vec<((usize, usize), f64)> {
        let by = |name: &str| self.by.iter().find(|(n, _)| n == name).map(|(_, by)| by.exp());
        system.free().iter().filter_map(|f| Some(((f.instance, f.param), by(&f.name)?))).collect()
    }

    /// Takes off what lies ahead.
    pub(super) fn back(&self, values: &mut [f64]) {
        values.iter_mut().zip(&self.ahead).for_each(|(v, ahead)| *v -= ahead);
    }
}

impl Plan {
    /// The same test with strengths of its own.
    pub fn strayed(&self, stray: Option<Arc<Stray>>) -> Plan {
        Plan { stray, ..self.clone() }
    }
}
