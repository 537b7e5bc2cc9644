//! Force over velocity, and over displacement, as a spline: what is measured, where no law has its shape.
//!
//! The slope is linear between five nodes at -1, -1/4, 0, 1/4 and 1 times a scale and constant beyond, so that the force is a quadratic spline, smooth at its
//! nodes and linear in its slopes.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Place of the inner nodes, in parts of the scale.
const INNER: f64 = 0.25;

/// Integral from 0 to `u` of the slope that is 1 at 0; `near` and `far` are the slopes at the inner and the outer node on the side of `u`.
fn integral<T: Num>(u: T, scale: T, near: T, far: T) -> T {
    let (s, side) = if u.re() < 0.0 { (-u, -1.0) } else { (u, 1.0) };
    let inner = scale * INNER;
    let first = (near - 1.0) / (inner * 2.0);
    if s.re() <= inner.re() {
        return (s + s * s * first) * side;
    }
    let rest = scale - inner;
    let (at, second) = (inner + inner * inner * first, (far - near) / (rest * 2.0));
    let beyond = s - inner;
    if s.re() <= scale.re() {
        return (at + near * beyond + beyond * beyond * second) * side;
    }
    (at + near * rest + rest * rest * second + far * (s - scale)) * side
}

/// The force of the slopes `p = [at 0, low, lower, high, higher, scale]`.
fn force<T: Num>(u: T, p: &[T]) -> T {
    let (near, far) = if u.re() < 0.0 { (p[2], p[1]) } else { (p[3], p[4]) };
    p[0] * integral(u, p[5], near, far)
}

/// Damper whose force is a spline over velocity.
pub struct VelocitySpline;

impl Force for VelocitySpline {
    const INFO: Info = Info {
        name: "velocity_spline",
        role: Role::Force,
        claim: "any rising force over velocity: what is measured of a damper, where no law has its shape",
        equation: "dF/dv = c s(v), s linear between -V: s_4, -V/4: s_1, 0: 1, V/4: r_1, V: r_4, constant beyond",
        params: &[
            Param::strength("c", Dim::FT_PER_X, Sign::NonNegative, "slope at rest"),
            Param::shape("s_4", Dim::One, SLOPES, "slope at -V over that at rest").within(1e-3, 1e3),
            Param::shape("s_1", Dim::One, SLOPES, "slope at -V/4 over that at rest").within(1e-3, 1e3),
            Param::shape("r_1", Dim::One, SLOPES, "slope at V/4 over that at rest").within(1e-3, 1e3),
            Param::shape("r_4", Dim::One, SLOPES, "slope at V over that at rest").within(1e-3, 1e3),
            Param::setting("v_scale", Dim::X_PER_T, Sign::Positive, 1.0, "V, the largest velocity that was measured"),
        ],
        states: 0,
        ports: Ports::V,
        family: FAMILY,
        source: "measured characteristics of vehicle dampers: Dixon, The Shock Absorber Handbook (2007); slopes that are not negative: Ramsay, Statistical \
                 Science 3 (1988) 425-441",
        range: "where no law of the library has the shape; it says nothing beyond the velocities that were measured",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        force(u.v, p)
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(s * p[0])
    }
}

/// Spring whose force is a spline over displacement.
pub struct DisplacementSpline;

impl Force for DisplacementSpline {
    const INFO: Info = Info {
        name: "displacement_spline",
        role: Role::Force,
        claim: "any force over displacement without memory: what is measured of a spring, where no law has its shape",
        equation: "dF/dx = k s(x), s linear between -X: s_4, -X/4: s_1, 0: 1, X/4: r_1, X: r_4, constant beyond",
        params: &[
            Param::strength("k", Dim::F_PER_X, Sign::Any, "slope at rest"),
            Param::shape("s_4", Dim::One, SLOPES, "slope at -X over that at rest").signed().within(-1e3, 1e3),
            Param::shape("s_1", Dim::One, SLOPES, "slope at -X/4 over that at rest").signed().within(-1e3, 1e3),
            Param::shape("r_1", Dim::One, SLOPES, "slope at X/4 over that at rest").signed().within(-1e3, 1e3),
            Param::shape("r_4", Dim::One, SLOPES, "slope at X over that at rest").signed().within(-1e3, 1e3),
            Param::setting("x_scale", Dim::X, Sign::Positive, 1.0, "X, the largest displacement that was measured"),
        ],
        states: 0,
        ports: Ports::X,
        family: FAMILY,
        source: "measured characteristics of springs and mounts as general forces over displacement; de Boor, A Practical Guide to Splines (1978)",
        range: "where no law of the library has the shape; it says nothing beyond the displacements that were measured",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        force(u.x, p)
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(Complex::new(p[0], T::from(0.0)))
    }
}

/// No search over a grid finds a spline: it is fitted where the library ends.
const SLOPES: Grid = Grid::Values(&[1.0]);
/// What a search for laws leaves out.
pub const FAMILY: &str = "spline";

#[cfg(test)]
mod tests {
    use super::super::find;
    use super::*;
    use crate::effect::Effect;

    /// Against the slope integrated numerically, on both sides, within and beyond the nodes; passive over velocity.
    #[test]
    fn a_spline_is_the_integral_of_its_slopes() {
        let p = [3.0, 0.2, 0.5, 2.0, 4.0, 0.8];
        let nodes = [-0.8, -0.2, 0.0, 0.2, 0.8];
        let slopes = [0.2, 0.5, 1.0, 2.0, 4.0];
        let slope = |u: f64| {
            let Some(k) = nodes.iter().position(|n| u < *n) else { return slopes[4] };
            if k == 0 { slopes[0] } else { slopes[k - 1] + (slopes[k] - slopes[k - 1]) * (u - nodes[k - 1]) / (nodes[k] - nodes[k - 1]) }
        };
        for name in ["velocity_spline", "displacement_spline"] {
            let Effect::Force(law) = find(name).unwrap() else { panic!("{name}") };
            for end in [-1.3, -0.8, -0.5, -0.1, 0.0, 0.15, 0.4, 1.1] {
                let n = 20_000;
                let sum: f64 = (0..n).map(|k| slope(end * (f64::from(k) + 0.5) / f64::from(n))).sum::<f64>() * 3.0 * end / f64::from(n);
                let found = law.value(&Inputs { x: end, v: end, ..Inputs::default() }, 1.0, &mut [], &p);
                assert!((found - sum).abs() < 1e-6, "{name} at {end}: {found} {sum}");
                assert!(found * end >= 0.0);
            }
        }
    }
}
