//! Ways to a solution where Newton's method from the line before fails: steps in frequency, steps in force, and the solution curve
//! over the force by its arc length, which passes its folds.

use nalgebra::DVector;

use super::super::EngineError;
use super::balance::Balance;
use crate::parallel;

/// Smallest step of the continuation in frequency and in force, as a fraction of the whole way.
const SMALLEST: [f64; 2] = [1.0 / 64.0, 1.0 / 256.0];
/// Points and corrections on the curve over the force, and its smallest step.
const POINTS: usize = 2000;
const CORRECTIONS: usize = 12;
const SMALLEST_ARC: f64 = 1e-6;

impl Balance<'_> {
    /// In steps from a frequency whose solution stands in `x`.
    pub(super) fn raise_frequency(&mut self, from: f64, to: f64, residual: &mut f64) -> Result<bool, EngineError> {
        let (mut done, mut step) = (0.0, 0.5);
        let mut good = self.x.clone();
        while done < 1.0 {
            let next = f64::min(done + step, 1.0);
            self.condense(from + next * (to - from))?;
            if self.newton(1.0, residual) {
                (done, step) = (next, 1.5 * step);
                good.copy_from(&self.x);
            } else {
                step *= 0.5;
                self.x.copy_from(&good);
                if step < SMALLEST[0] {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// In steps of the force from rest.
    pub(super) fn raise_force(&mut self, residual: &mut f64) -> bool {
        let (mut done, mut step) = (0.0, 0.25);
        self.x.fill(0.0);
        let mut good = self.x.clone();
        while done < 1.0 {
            if parallel::given_up() {
                return false;
            }
            let next = f64::min(done + step, 1.0);
            // The straight line through rest and the last solution.
            if done > 0.0 {
                self.x *= next / done;
            } else {
                self.linear_start();
                self.x *= next;
            }
            if self.newton(next, residual) {
                (done, step) = (next, 1.5 * step);
                good.copy_from(&self.x);
            } else {
                step *= 0.5;
                self.x.copy_from(&good);
                if step < SMALLEST[1] {
                    return false;
                }
            }
        }
        true
    }

    /// Along the curve of solutions `(x, share of the force)` from rest to its first point with the whole force (pseudo-arclength
    /// continuation: Keller 1977), distances measured in the linear response and the force.
    pub(super) fn follow_force(&mut self, residual: &mut f64) -> bool {
        let w = self.width();
        self.linear_start();
        let linear = self.x.clone();
        let scales = self.scales(1.0);
        let over = |a: &DVector<f64>, b: &DVector<f64>| {
            a.iter().zip(b.iter()).enumerate().map(|(i, (a, b))| a * b / scales[i / w].powi(2)).sum::<f64>()
        };
        self.x.fill(0.0);
        if self.balance(0.0, &scales).is_none() {
            return false;
        }
        let (mut point, mut share) = (self.x.clone(), 0.0);
        let mut before: Option<(DVector<f64>, f64)> = None;
        let mut arc = 0.05;
        for _ in 0..POINTS {
            if parallel::given_up() {
                return false;
            }
            let Some(v) = self.linearize().solve(&linear) else { return false };
            let length = (over(&v, &v) + 1.0).sqrt();
            let forward = before.as_ref().is_none_or(|(x, s)| over(&v, x) + s >= 0.0);
            let sign = if forward { 1.0 } else { -1.0 };
            let tangent = (v * (sign / length), sign / length);
            // Shorter arcs until the correction succeeds.
            let next = loop {
                self.x.copy_from(&point);
                self.x.axpy(arc, &tangent.0, 1.0);
                if let Some(next) = self.correct(share + arc * tangent.1, &tangent, &linear, &scales, &over) {
                    break next;
                }
                arc *= 0.5;
                if arc < SMALLEST_ARC {
                    return false;
                }
            };
            if (share - 1.0) * (next - 1.0) <= 0.0 && share != next {
                // The whole force lies between the two points.
                let (end, t) = (self.x.clone(), (1.0 - share) / (next - share));
                self.x = &point * (1.0 - t) + &end * t;
                if self.newton(1.0, residual) {
                    return true;
                }
                self.x.copy_from(&end);
                if self.balance(next, &scales).is_none() {
                    return false;
                }
            }
            point.copy_from(&self.x);
            share = next;
            before = Some(tangent);
            arc = (1.3 * arc).min(0.5);
        }
        false
    }

    /// Newton's method for the balance and the plane across the tangent; the share of the force reached.
    fn correct(
        &mut self,
        mut share: f64,
        tangent: &(DVector<f64>, f64),
        linear: &DVector<f64>,
        scales: &[f64],
        over: &impl Fn(&DVector<f64>, &DVector<f64>) -> f64,
    ) -> Option<f64> {
        let mut last = f64::INFINITY;
        for round in 0..CORRECTIONS {
            let norm = self.balance(share, scales)?;
            if norm < 1e-9 {
                return Some(share);
            }
            if round > 4 && norm > last {
                return None;
            }
            last = norm;
            let factors = self.linearize();
            let (r, v) = (factors.solve(&self.residual)?, factors.solve(linear)?);
            let by = over(&tangent.0, &r) / (over(&tangent.0, &v) + tangent.1);
            self.x -= r;
            self.x.axpy(by, &v, 1.0);
            share += by;
        }
        None
    }
}
