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
        // v - d (3 u - 4 u1 + u2)/(2 dt) = v0 sinh(u), a rising function of u that is convex away from zero, solved in plain numbers; one step of
        // Newton's method in the number type at the solution carries the exact derivatives.
        let (u1, u2) = (s[0], s[1]);
        let (v0, d, rate) = (p[1].re(), p[2].re(), 1.5 / dt);
        let (elastic, pull) = (d * rate, u.v.re() + d * (u1.re() * 4.0 - u2.re()) * (0.5 / dt));
        let (sign, before, pull) = (1f64.copysign(pull), u1.re() * 1f64.copysign(pull), pull.abs());
        let linear = pull / (v0 + elastic);
        // With sinh(u) >= u the answer is not beyond that of a linear film, nor beyond the rigid one.
        let most = || if linear > 1.0 || d <= 0.0 { linear.min((pull / v0 + ((pull / v0).powi(2) + 1.0).sqrt()).ln()) } else { linear };
        // The step before is near, where it lies on the same side. From below a step may lead far beyond, from above it does not.
        let mut w = if d > 0.0 && before > 0.0 && before < linear { before } else { most() };
        // Halley's method; the step of Newton's method is at most doubled.
        for _ in 0..60 {
            let (sinh, cosh) = sinh_cosh(w);
            let slope = v0 * cosh + elastic;
            let newton = (v0 * sinh + elastic * w - pull) / slope;
            let step = newton / (1.0 - 0.5 * newton * v0 * sinh / slope).max(0.5);
            w = if step > -1.0 { w - step } else { (w - step).min(most()) };
            if step.abs() <= 1e-5 {
                break;
            }
        }
        let w = sign * w;
        let ((sinh, cosh), w) = (sinh_cosh(w), T::from(w));
        let gap = p[1] * sinh + p[2] * bdf2(w, u1, u2, dt) - u.v;
        let w = w - gap / (p[1] * cosh + p[2] * rate);
        (s[0], s[1]) = (w, u1);
        p[0] * w
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        // Small motion: v0 u = s x - d s u.
        Ok(s * p[0] / (s * p[2] + p[1]))
    }
}
