//! Strengths of a test that are others than the model's: the temperature and the mounting of a structure differ from one test to the next.

use nalgebra::DVector;

use crate::model::{FreeParam, System};

use super::{Computed, ResponseError};

/// The strengths that a test has of its own, about which it is linear.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnStrengths {
    /// Free strengths by name, with the logarithm `b` of what each is here over what it is in the model.
    pub by: Vec<(String, f64)>,
    /// What these deviations change of the computed rows, to first order about where they stand: `S b` with `S` the columns `df/db` there. The response
    /// at the own strengths less this is what the model's strengths would give, were the response linear (Lindstrom and Bates, Biometrics 46, 1990).
    pub shift: Vec<f64>,
}

impl OwnStrengths {
    /// Deviation of a parameter; 0 where it has none.
    pub fn of(&self, name: &str) -> f64 {
        self.by.iter().find(|(own, _)| own == name).map_or(0.0, |(_, by)| *by)
    }

    /// What `run` computes of the system at the own strengths, its slopes those in the model's parameters.
    pub(super) fn through(
        &self,
        system: &System,
        free: &[FreeParam],
        run: impl Fn(&System) -> Result<Computed, ResponseError>,
    ) -> Result<Computed, ResponseError> {
        let mut there = system.clone();
        for f in system.free() {
            there.instances[f.instance].params[f.param].value *= self.of(&f.name).exp();
        }
        let mut computed = run(&there)?;
        // A slope in a logarithm is the same from either; one in a value is `df/d(v e^b) e^b`.
        for (k, f) in free.iter().enumerate().filter(|(_, f)| !f.log) {
            let by = self.of(&f.name);
            if by != 0.0 {
                computed.slopes.iter_mut().skip(k).step_by(free.len()).for_each(|s| *s *= by.exp());
            }
        }
        Ok(computed)
    }

    /// Takes from residuals what the own strengths change of them.
    pub(super) fn taken_from(&self, residuals: &mut DVector<f64>) {
        residuals.iter_mut().zip(&self.shift).for_each(|(r, s)| *r -= s);
    }
}
