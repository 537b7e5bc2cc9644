//! Friction under a normal force that grows with displacement and may lift off.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::positive;
use super::{Force, Inputs, Num};

/// Friction under a normal force that grows with displacement and may lift off.
pub struct WedgeFriction;

impl Force for WedgeFriction {
    const INFO: Info = Info {
        name: "wedge_friction",
        role: Role::Force,
        claim: "friction that grows with displacement and vanishes where the faces lift off: loops that open like a fan, equal at every frequency",
        equation: "F = k u,  u = clamp(u0 + r dx, -n, n),  n = max(x - x0, 0); side -1: max(-x - x0, 0); side 0: max(|x| - x0, 0)",
        params: &[
            Param::strength(
                "k",
                Dim::F_PER_X,
                Sign::NonNegative,
                "coefficient of friction times the stiffness that makes the normal force",
            ),
            Param::shape("x0", Dim::X, Grid::OfX(&[-0.8, -0.05]), "travel at which the faces lift off; negative: they press at x = 0")
                .signed(),
            Param::setting("side", Dim::One, Sign::Any, 1.0, "1: presses for x > x0; -1: for x < -x0; 0: for |x| > x0")
                .within(-1.0, 1.0)
                .tried(Grid::Values(&[1.0, -1.0, 0.0])),
            Param::shape("r", Dim::One, Grid::Values(&[10.0]), "stuck stiffness over k").within(0.1, 1e3),
        ],
        states: 1,
        ports: Ports::XDX,
        family: "friction",
        source: "Yang, Chu and Menq, J. Sound Vib. 210 (1998) 461-481 (contact under variable normal load); leaf springs: Fancher et al., SAE 800905 (1980)",
        range: "wedges, leaf springs, tapered and tilting fits; rate-independent; in a frequency response it sticks as it does at x = 0",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, s: &mut [T], p: &[T]) -> T {
        // Return mapping under the normal force at the end of the step. What a falling limit cuts off the state is elastic energy lost,
        // so that the law is passive at every path of the normal force.
        let limit = pressed(u.x, p[1], p[2].re());
        let trial = s[0] + u.dx * p[3];
        s[0] = if trial.re() > limit.re() {
            limit
        } else if trial.re() < -limit.re() {
            -limit
        } else {
            trial
        };
        p[0] * s[0]
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let zero = T::from(0.0);
        match p[1].re() {
            x0 if x0 < 0.0 => Ok(Complex::new(p[0] * p[3], zero)),
            x0 if x0 > 0.0 => Ok(Complex::new(zero, zero)),
            _ => Err("an x0 other than 0: faces that just touch slip at every amplitude; or declare the excitation amplitude of the FRF"),
        }
    }
}

/// Normal force per stiffness at the displacement `x`.
fn pressed<T: Num>(x: T, x0: T, side: f64) -> T {
    if side == 0.0 {
        let over = if x.re() < 0.0 { -x } else { x };
        return positive(over - x0);
    }
    positive(x * side.signum() - x0)
}
