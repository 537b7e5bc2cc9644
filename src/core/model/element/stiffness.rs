//! An element in small motion: its dynamic stiffness, with derivatives or without.

use num_complex::Complex64;

use crate::effect::dispatch::Wanted;
use crate::effect::{EffectError, Inputs, Tangent};

use super::Element;

impl Element {
    /// Dynamic stiffness of small motion at the complex frequency `s`, its derivative with respect to `s`, and with respect to the
    /// parameters (`dp`, sized here).
    pub fn stiffness(&self, s: Complex64, dp: &mut Vec<Complex64>) -> Result<(Complex64, Complex64), EffectError> {
        self.stiffness_about(s, 0.0, 0.0, dp).map(|(z, dz, _)| (z, dz))
    }

    /// The same about an operating point with the displacement `x` under the force `f`; third, the derivative with respect to `x`.
    /// Friction is stuck there. The derivative takes openings as they are, not how they change along the way to the point.
    pub fn stiffness_about(
        &self,
        s: Complex64,
        x: f64,
        f: f64,
        dp: &mut Vec<Complex64>,
    ) -> Result<(Complex64, Complex64, Complex64), EffectError> {
        let zero = Complex64::new(0.0, 0.0);
        dp.clear();
        dp.resize(self.p.len(), zero);
        let (mut z, mut dz, mut by_x) = (zero, zero, zero);
        let (open, slope) = self.opened(f);
        let at_rest = x == 0.0 && f == 0.0;
        for piece in self.linear.iter().chain(&self.forces) {
            let (p, dp) = (&self.p[piece.p.clone()], &mut dp[piece.p.clone()]);
            let (value, by_s, along) = match at_rest {
                true => piece.law.stiffness_tangent(s, p, dp).map(|(z, dz)| (z, dz, zero))?,
                false => piece.law.stiffness_about(s, x - open, p, dp)?,
            };
            z += value;
            dz += by_s;
            by_x += along;
        }
        for piece in &self.followers {
            // A candidate without a small-signal limit leaves no trace in this test.
            let p = &self.p[piece.p.clone()];
            dp[piece.p.start] = if at_rest { piece.law.stiffness(s, p) } else { piece.law.stiffness_at(s, x - open, p) }.unwrap_or(zero);
        }
        if self.series.is_empty() {
            return Ok((z, dz, by_x));
        }
        let denominator = z * slope + 1.0;
        let outer = (denominator * denominator).inv();
        dp.iter_mut().for_each(|d| *d *= outer);
        for piece in &self.series {
            let np = piece.p.len();
            let (mut value, mut slopes) = (vec![0.0; np], vec![0.0; np]);
            piece.law.opening_params(f, &self.p[piece.p.clone()], &mut value, &mut slopes);
            for (k, slope) in slopes.iter().enumerate() {
                dp[piece.p.start + k] = -z * z * outer * *slope;
            }
        }
        Ok((z / denominator, dz * outer, by_x * outer / (1.0 + slope * z.re)))
    }

    /// The value of [`Element::stiffness_about`] alone, which candidates have no part in.
    pub fn stiffness_at(&self, s: Complex64, x: f64, f: f64) -> Result<Complex64, EffectError> {
        let (open, slope) = self.opened(f);
        let mut z = Complex64::new(0.0, 0.0);
        for piece in self.linear.iter().chain(&self.forces) {
            let p = &self.p[piece.p.clone()];
            z += if x == 0.0 && f == 0.0 { piece.law.stiffness(s, p) } else { piece.law.stiffness_at(s, x - open, p) }?;
        }
        Ok(if self.series.is_empty() { z } else { z / (z * slope + 1.0) })
    }

    /// Derivative of [`Element::inertia`] with respect to every parameter (`slopes`, sized here), linear candidates of the score test included.
    pub fn inertia_slopes(&self, slopes: &mut Vec<f64>) {
        slopes.clear();
        slopes.resize(self.p.len(), 0.0);
        if self.opening {
            return;
        }
        let (accelerated, mut t) = (Inputs { a: 1.0, ..Inputs::default() }, Tangent::default());
        for piece in self.linear.iter().chain(self.followers.iter().filter(|f| f.law.linear())) {
            let (p, active) = (&self.p[piece.p.clone()], &self.active[piece.p.clone()]);
            piece.law.tangent(&accelerated, 1.0, &mut [], p, Wanted::Params(active), &mut t);
            slopes[piece.p.clone()].copy_from_slice(&t.params(0)[..p.len()]);
        }
    }

    /// Opening under the force `f` and its slope.
    fn opened(&self, f: f64) -> (f64, f64) {
        let own = self.series.iter().filter(|p| p.follower.is_none()).map(|piece| piece.law.opening(f, &self.p[piece.p.clone()]));
        own.fold((0.0, 0.0), |(open, slope), (o, d)| (open + o, slope + d))
    }
}
