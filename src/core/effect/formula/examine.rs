//! A formula on a grid of cycles before it is used: has it a value everywhere, do its states return, does it keep the energy it is given.

use std::f64::consts::TAU;

use super::{Formula, FormulaError, Inputs, Update};

/// A motion the tests show: amplitudes of displacement and velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Displacement amplitude [m or rad].
    pub x: f64,
    /// Velocity amplitude [m/s or rad/s].
    pub v: f64,
}

const CYCLES: usize = 12;
const STEPS: usize = 200;
/// Energy that counts as given back, against the energy that went to and fro.
const GIVEN: f64 = 1e-6;
/// Growth of a state over equal cycles that counts as unstable.
const GROWTH: f64 = 100.0;

impl Formula {
    /// Examines it at the parameters `p` [SI] over cycles of the amplitudes and frequencies of `motions`, a third and three times as fast,
    /// a tenth and all of the amplitude, about rest and about the amplitude itself.
    ///
    /// # Errors
    /// [`FormulaError::NoValue`] with the first step of the program that fails; [`FormulaError::Unstable`]; [`FormulaError::Energy`] where
    /// closed cycles give back more than rounding, unless it is declared active.
    pub fn examine(&self, p: &[f64], motions: &[Motion]) -> Result<(), FormulaError> {
        let rest = self.variables([0.0; 3], p);
        self.finite(&rest)?;
        for m in motions.iter().filter(|m| m.x > 0.0 && m.v > 0.0 && m.x.is_finite() && m.v.is_finite()) {
            for speed in [1.0, 1.0 / 3.0, 3.0] {
                for size in [1.0, 0.1] {
                    for mean in [0.0, m.x] {
                        self.cycles(p, size * m.x, speed * m.v / m.x, mean)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn finite(&self, variables: &[f64]) -> Result<(), FormulaError> {
        let texts = std::iter::once(&self.definition.expression).chain(self.definition.states.iter().map(|s| &s.1));
        for (program, text) in std::iter::once(&self.force).chain(&self.rates).zip(texts) {
            if let Some((position, what)) = program.fault(variables) {
                let states = self.definition.states.iter().map(|s| s.0.as_str());
                let names = ["x", "v", "a"].into_iter().chain(states);
                let motion = names.zip(variables).map(|(n, v)| format!("{n} = {v:.4}")).collect::<Vec<_>>().join(", ");
                return Err(FormulaError::NoValue { text: text.clone(), position, what, motion });
            }
        }
        Ok(())
    }

    fn cycles(&self, p: &[f64], amplitude: f64, omega: f64, mean: f64) -> Result<(), FormulaError> {
        let dt = TAU / omega / STEPS as f64;
        let mut s = vec![0.0; 2 * self.n_states()];
        let (mut before, mut total, mut last, mut exchanged) = (None, 0.0, 0.0, 0.0);
        let (mut early, mut late) = (0.0f64, 0.0f64);
        for k in 0..=CYCLES * STEPS {
            let (sin, cos) = (TAU * (k % STEPS) as f64 / STEPS as f64).sin_cos();
            let u = Inputs { x: mean + amplitude * sin, v: amplitude * omega * cos, a: -amplitude * omega * omega * sin, dx: 0.0 };
            let f = self.advance(&u, dt, &mut s, p);
            if !f.is_finite() || s.iter().any(|z| !z.is_finite()) {
                let mut all = self.variables([u.x, u.v, u.a], p);
                (0..self.n_states()).for_each(|j| all[3 + j] = s[2 * j]);
                self.finite(&all)?;
                // The program has a value there; what has none is the equation of the states.
                return Err(self.unstable(0.0, f64::INFINITY, amplitude, omega));
            }
            let size = s.iter().fold(0.0f64, |m, z| m.max(z.abs()));
            if (2 * STEPS..3 * STEPS).contains(&k) {
                early = early.max(size);
            }
            if k >= (CYCLES - 1) * STEPS {
                late = late.max(size);
            }
            if let Some((x0, f0)) = before {
                let work: f64 = 0.5 * (f + f0) * (u.x - x0);
                total += work;
                if k > (CYCLES - 1) * STEPS {
                    last += work;
                    exchanged += work.abs();
                }
            }
            before = Some((u.x, f));
        }
        if late > GROWTH * early && early > 0.0 {
            return Err(self.unstable(early, late, amplitude, omega));
        }
        // A state that still settles may give back in one cycle what it took before; a source gives in every cycle.
        if !self.definition.active && last < -GIVEN * exchanged && total < -GIVEN * exchanged {
            let text = self.definition.expression.clone();
            return Err(FormulaError::Energy { text, given: -last, amplitude, frequency: omega / TAU });
        }
        Ok(())
    }

    fn unstable(&self, before: f64, after: f64, amplitude: f64, omega: f64) -> FormulaError {
        let text = self.definition.states.first().map_or(&self.definition.expression, |s| &s.1).clone();
        FormulaError::Unstable { text, before, after, amplitude, frequency: omega / TAU }
    }
}
