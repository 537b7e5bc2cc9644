//! Unilateral contact with restitution.

use num_complex::Complex;

use super::contact::stop;
use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::power;
use super::{Force, Inputs, Num};

/// Unilateral contact with restitution.
pub struct HuntCrossley;

impl Force for HuntCrossley {
    const INFO: Info = Info {
        name: "hunt_crossley",
        role: Role::Force,
        claim: "no force until a gap is closed, then a force that hardens with penetration and is larger on the way in than on the way out",
        equation: "F = k d (d/r)^(n-1) max(1 + chi d', 0),  d = max(x - g, 0); side -1: mirrored, F(x) -> -F(-x); side 0: both",
        params: &[
            Param::strength("k", Dim::F_PER_X, Sign::NonNegative, "force per penetration at the penetration r, at rest"),
            Param::shape("g", Dim::X, Grid::Along(&[0.0, 0.5]), "gap from x = 0 towards the stop; negative: pressed at x = 0").signed(),
            Param::shape("chi", Dim::T_PER_X, Grid::PerV(&[0.5]), "damping: coefficient of restitution 1 - (2/3) chi v at a slow impact v"),
            Param::setting("side", Dim::One, Sign::Any, 1.0, "1: touches for x > g; -1: for x < -g; 0: a stop on either side")
                .within(-1.0, 1.0)
                .tried(Grid::Values(&[1.0, -1.0, 0.0])),
            Param::setting("n", Dim::One, Sign::Positive, 1.5, "exponent: 1 flat faces, 1.5 Hertz, above 1.5 rough faces").within(1.0, 5.0),
            Param::setting("r", Dim::X, Sign::Positive, 1e-3, "penetration at which k is the force per penetration; no effect for n = 1")
                .tried(Grid::OfX(&[1.0])),
        ],
        states: 0,
        ports: Ports::XV,
        family: "clearance",
        source: "Hunt and Crossley, J. Appl. Mech. 42 (1975) 440-445; Hertz (1882), in Johnson, Contact Mechanics (1985), ch. 4",
        range: "play with impacts; contact is the same without damping; the force never pulls",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        let (gap, side) = (p[1], p[3].re());
        let one = |x: T, v: T| stop(x, v, [p[4], p[5], p[2]]);
        let mut phi = T::from(0.0);
        if side >= 0.0 {
            phi += one(u.x - gap, u.v);
        }
        if side <= 0.0 {
            phi -= one(-u.x - gap, -u.v);
        }
        p[0] * phi
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let (depth, zero) = (-p[1], T::from(0.0));
        let sides = if p[3].re() == 0.0 { 2.0 } else { 1.0 };
        if depth.re() > 0.0 {
            let secant = power(depth / p[5], p[4] - 1.0);
            return Ok((s * (p[2] * depth * secant) + Complex::new(secant * p[4], zero)) * (p[0] * sides));
        }
        // Faces that just touch, of exponent 1: the fundamental of a small motion sees half of the stop.
        let share = if depth.re() == 0.0 && p[4].re() == 1.0 { 0.5 * sides } else { 0.0 };
        Ok(Complex::new(p[0] * share, zero))
    }
}
