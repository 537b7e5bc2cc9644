//! Shear-thinning lubricant film in series with its contact stiffness.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::bdf2;
use super::{Force, Inputs, Num};

/// Shear-thinning lubricant film in series with its contact stiffness.
pub struct Film;

impl Force for Film {
    const INFO: Info = Info {
        name: "film",
        role: Role::Force,
        claim: "dissipated energy per cycle grows with the logarithm of velocity; sticks elastically at small amplitude",
        equation: "F = f u,  sinh(u) = (v - d du/dt)/v0",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "force scale; the force reaches f asinh(v/v0)"),
            Param::shape("v0", Dim::X_PER_T, Grid::OfV(&[0.001, 0.01, 0.1, 0.5]), "velocity at which thinning sets in"),
            Param {
                sign: Sign::NonNegative,
                ..Param::setting(
                    "d",
                    Dim::X,
                    Sign::NonNegative,
                    0.0,
                    "elastic displacement of the contact per unit u: its stiffness is f/d; 0 is a rigid contact",
                )
                .tried(Grid::Elastic(&[0.03, 0.3]))
            },
        ],
        states: 2,
        ports: Ports::V,
        family: "friction",
        source: "Eyring, J. Chem. Phys. 4 (1936); film in series with a contact stiffness: design.md section 7",
        range: "boundary-lubricated sliding over decades of velocity",
    };

    const LOOKS_BACK: usize = 1;

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        // v - d (3 u - 4 u1 + u2)/(2 dt) = v0 sinh(u): monotone in u, so Newton from the rigid answer is safe; one Newton step in
        // the number type at the converged point carries the exact derivatives.
        let (u1, u2) = (s[0], s[1]);
        let slope = |w: T| p[1] * w.cosh() + p[2] * (1.5 / dt);
        let gap = |w: T| p[1] * w.sinh() + p[2] * bdf2(w, u1, u2, dt) - u.v;
        let mut w = T::from(((u.v + p[2] * (u1 * 4.0 - u2) * (0.5 / dt)) / p[1]).asinh().re());
        if p[2].re() > 0.0 {
            // The elastic term only pulls the answer towards zero, and the residual is convex away from it: steps are monotone.
            for _ in 0..60 {
                let step = (gap(w) / slope(w)).re();
                w = T::from(w.re() - step);
                if step.abs() <= 1e-14 * (1.0 + w.re().abs()) {
                    break;
                }
            }
        }
        w -= gap(w) / slope(w);
        (s[0], s[1]) = (w, u1);
        p[0] * w
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        // Small motion: v0 u = s x - d s u.
        Ok(s * p[0] / (s * p[2] + p[1]))
    }
}
