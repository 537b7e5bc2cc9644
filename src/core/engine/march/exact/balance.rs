//! The forces of what is not linear at the end of a step.

use crate::effect::Inputs;
use crate::model::Depth;

use super::super::super::EngineError;
use super::super::sensitivities::add_row;
use super::super::{ACCEPTED, HOVERS, March, SHORTEST, State};
use super::{Exact, Level, along, beyond, dot};

/// Residual over the forces present below which a step has converged, below which one that no longer falls has, and below which one step of Newton's method
/// more leaves nothing: that one is not looked at again, and states follow it where they are computed anyway.
const CONVERGED: f64 = 1e-12;
const ROUNDED: f64 = 1e-10;
const SQUARED: f64 = 1e-7;

impl Exact {
    /// The forces of the acting elements by Newton's method, and the motion under them; the residual over the forces present where none are found. `follows`: their
    /// states at the end of the step are computed by whoever asks.
    pub(super) fn balance(&mut self, march: &mut March, level: &Level, state: &mut State, follows: bool) -> Result<(), f64> {
        self.z.copy_from_slice(&self.motion);
        self.accelerate(march, state);
        if self.z.iter().any(|z| !z.is_finite()) {
            return Err(f64::NAN);
        }
        for row in 0..self.local {
            self.star[row] = march.inputs(self.acting[row], state);
        }
        // They go on as they did.
        for ((phi, old), before) in self.phi[..self.local].iter_mut().zip(&self.old_phi).zip(&self.before) {
            *phi = 2.0 * old - before;
        }
        let (mut least, mut factor, mut last) = (f64::INFINITY, 1.0, 0.0);
        // Whether the last step of Newton's method was not looked at.
        let (mut converged, mut unseen) = (self.local == 0, false);
        for iteration in 0.. {
            if converged || !march.effort.goes_on(iteration) {
                break;
            }
            let (norm, scale) = self.missed(march, level, state);
            if !norm.is_finite() {
                return Err(f64::NAN);
            }
            last = norm / scale.max(f64::MIN_POSITIVE);
            let hovers = iteration >= HOVERS && last <= ACCEPTED;
            if last <= CONVERGED || norm == 0.0 || (norm >= least && last <= ROUNDED) || hovers {
                converged = true;
                continue;
            }
            if norm < least || factor < SHORTEST {
                (least, factor) = (norm, 1.0);
                self.base.copy_from_slice(&self.phi[..self.local]);
                self.newton.copy_from_slice(&self.miss);
                self.tangent(march, level).map_err(|_| last)?;
                self.matrix.solve(&mut self.newton).map_err(|_| last)?;
                converged = self.superpose || last <= SQUARED;
                unseen = converged;
            } else {
                // Laws that are not smooth make full steps jump between branches.
                factor *= 0.5;
            }
            for row in 0..self.local {
                self.phi[row] = self.base[row] + factor * self.newton[row];
            }
        }
        if !converged && last > ACCEPTED {
            return Err(last);
        }
        for (phi, reach) in self.phi[..self.local].iter().zip(&level.reach) {
            add_row(&mut self.z, *phi, reach, 0);
        }
        self.pull_back(march);
        self.accelerate(march, state);
        if unseen && !self.stateless && !follows {
            for row in 0..self.local {
                let u = march.inputs(self.acting[row], state);
                march.follow(self.acting[row], &u);
            }
        }
        Ok(())
    }

    /// How far the forces are from those of the motion that they lead to; its largest, and the forces present.
    fn missed(&mut self, march: &mut March, level: &Level, state: &mut State) -> (f64, f64) {
        let local = self.local;
        let mut norm = 0.0f64;
        for row in 0..local {
            let e = self.acting[row];
            let by = |seen: &[f64]| dot(&seen[row * local..(row + 1) * local], &self.phi[..local]);
            let (star, x) = (&self.star[row], by(&level.seen[0]));
            let u = Inputs { x: star.x + x, v: star.v + by(&level.seen[1]), a: star.a + by(&level.seen[2]), dx: star.dx + x };
            march.sense(e, &u, Depth::Inputs, &mut state.fs);
            let (f, linear) = (march.sensed[e].f, along(&march.bound.elements[e].linear_part(), &u));
            self.miss[row] = f - linear - self.phi[row];
            // A force that is not finite stays one in the sum.
            norm = if self.miss[row].is_finite() { norm.max(self.miss[row].abs()) } else { f64::NAN };
            if norm.is_nan() {
                break;
            }
            march.scale = march.scale.max(f.abs() + linear.abs());
        }
        (norm, march.scale)
    }

    /// `I - D G` of the acting elements, factored: `D` what their forces feel of the motion, `G` what the motion feels of their forces. Factors serve as long as
    /// neither changes by more than rounding: of laws that superpose, in all steps of one length.
    pub(super) fn tangent(&mut self, march: &March, level: &Level) -> Result<(), EngineError> {
        let local = self.local;
        let feels = |row: usize| beyond(&march.bound.elements[self.acting[row]], &march.sensed[self.acting[row]]);
        let (dt, felt) = (&mut self.factored.0, &mut self.factored.1);
        let same = |(a, b): (&f64, f64)| (a - b).abs() <= f64::EPSILON * b.abs();
        if *dt == level.hold.dt && (0..local).all(|row| felt[row].iter().zip(feels(row)).all(same)) {
            return Ok(());
        }
        felt.clear();
        felt.extend((0..local).map(feels));
        // Factors that fail serve no step.
        *dt = f64::NAN;
        self.matrix.clear();
        for row in 0..local {
            let [x, v, a] = felt[row];
            for column in 0..local {
                let at = row * local + column;
                let feels = x * level.seen[0][at] + v * level.seen[1][at] + a * level.seen[2][at];
                self.matrix.add_at(self.slots[at], if row == column { 1.0 - feels } else { -feels });
            }
        }
        self.matrix.factor()?;
        *dt = level.hold.dt;
        Ok(())
    }
}
