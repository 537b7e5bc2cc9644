//! Unilateral contact beyond a gap.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::{positive, power};
use super::{Force, Inputs, Num};

/// Unilateral contact beyond a gap.
pub struct Contact;

impl Force for Contact {
    const INFO: Info = Info {
        name: "contact",
        role: Role::Force,
        claim: "no force until a gap is closed, then a force that hardens with penetration, to one side or to both",
        equation: "F = k d (d/r)^(n-1) max(1 + 3/2 alpha d', 0),  d = max(x - g, 0); side -1: mirrored, F(x) -> -F(-x); side 0: both",
        params: &[
            Param::strength("k", Dim::F_PER_X, Sign::NonNegative, "force per penetration at the penetration r"),
            Param::shape("g", Dim::X, Grid::Along(&[0.0, 0.5]), "gap from x = 0 towards the stop; negative: pressed at x = 0").signed(),
            Param::setting("side", Dim::One, Sign::Any, 1.0, "1: touches for x > g; -1: for x < -g; 0: a stop on either side")
                .within(-1.0, 1.0)
                .tried(Grid::Values(&[1.0, -1.0, 0.0])),
            Param::setting("n", Dim::One, Sign::Positive, 1.5, "exponent: 1 flat faces, 1.5 Hertz, above 1.5 rough faces").within(1.0, 5.0),
            Param::setting("r", Dim::X, Sign::Positive, 1e-3, "penetration at which k is the force per penetration; no effect for n = 1")
                .tried(Grid::OfX(&[1.0])),
            Param::setting(
                "alpha",
                Dim::T_PER_X,
                Sign::NonNegative,
                0.0,
                "damping: coefficient of restitution 1 - alpha v at a slow impact v",
            ),
        ],
        states: 0,
        ports: Ports::XV,
        family: "clearance",
        source: "Hertz (1882), in Johnson, Contact Mechanics (1985), ch. 4; damping: Hunt and Crossley, J. Appl. Mech. 42 (1975) 440-445",
        range: "contact without adhesion; the force never pulls",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        let (gap, side) = (p[1], p[2].re());
        let mut phi = T::from(0.0);
        if side >= 0.0 {
            phi += stop(u.x - gap, u.v, [p[3], p[4], p[5] * 1.5]);
        }
        if side <= 0.0 {
            phi -= stop(-u.x - gap, -u.v, [p[3], p[4], p[5] * 1.5]);
        }
        p[0] * phi
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let depth = -p[1];
        let sides = if p[2].re() == 0.0 { 2.0 } else { 1.0 };
        let zero = T::from(0.0);
        if depth.re() > 0.0 {
            let secant = power(depth / p[4], p[3] - 1.0);
            let damping = p[5] * depth * secant * 1.5;
            return Ok((s * damping + Complex::new(secant * p[3], zero)) * (p[0] * sides));
        }
        // Faces that just touch, of exponent 1: the fundamental of a small motion sees half of the stop.
        let share = if depth.re() == 0.0 && p[3].re() == 1.0 { 0.5 * sides } else { 0.0 };
        Ok(Complex::new(p[0] * share, zero))
    }
}

/// Force per strength at a penetration `depth` that grows at `rate`: exponent, reference penetration and damping per rate.
pub(super) fn stop<T: Num>(depth: T, rate: T, [n, r, chi]: [T; 3]) -> T {
    if depth.re() <= 0.0 {
        return T::from(0.0);
    }
    depth * power(depth / r, n - 1.0) * positive(rate * chi + 1.0)
}
