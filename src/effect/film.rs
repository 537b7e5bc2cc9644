//! Shear-thinning lubricant film in series with its contact stiffness.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::{bdf2, sinh_cosh};
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
        // v - d (3 u - 4 u1 + u2)/(2 dt) = v0 sinh(u): monotone in u, so Newton from a bound is safe; one Newton step in
        // the number type at the converged point carries the exact derivatives.
        let (u1, u2) = (s[0], s[1]);
        let w = T::from(answer(u.v.re(), [u1.re(), u2.re()], p[1].re(), p[2].re(), dt));
        let w = w - excess(w, u.v, [u1, u2], p[1], p[2], dt);
        (s[0], s[1]) = (w, u1);
        p[0] * w
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        // Small motion: v0 u = s x - d s u.
        Ok(s * p[0] / (s * p[2] + p[1]))
    }
}

/// Residual of the balance at `w` over its slope.
#[inline]
fn excess<T: Num>(w: T, v: T, [u1, u2]: [T; 2], v0: T, d: T, dt: f64) -> T {
    let (sinh, cosh) = sinh_cosh(w);
    (v0 * sinh + d * bdf2(w, u1, u2, dt) - v) / (v0 * cosh + d * (1.5 / dt))
}

/// The `w` that balances, in plain numbers.
fn answer(v: f64, [u1, u2]: [f64; 2], v0: f64, d: f64, dt: f64) -> f64 {
    let driven = v + d * (u1 * 4.0 - u2) * (0.5 / dt);
    let rigid = (driven / v0).asinh();
    if d <= 0.0 {
        return rigid;
    }
    // Film alone and contact alone both bound the answer; the residual is convex away from it, so that steps from the closer bound are monotone.
    let stuck = driven / d * (dt / 1.5);
    let mut w = if stuck.abs() < rigid.abs() { stuck } else { rigid };
    for _ in 0..60 {
        let step = excess(w, v, [u1, u2], v0, d, dt);
        w -= step;
        if step.abs() <= 1e-14 * (1.0 + w.abs()) {
            break;
        }
    }
    w
}
