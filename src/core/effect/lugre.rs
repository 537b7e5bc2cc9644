//! LuGre friction: bristles that deflect, then slip at a level that falls with velocity.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::{magnitude, sign};
use super::stribeck::excess;
use super::{Force, Inputs, Num};

/// LuGre friction: bristles that deflect, then slip at a level that falls with velocity.
pub struct LuGre;

impl Force for LuGre {
    const INFO: Info = Info {
        name: "lugre",
        role: Role::Force,
        claim: "sticks elastically, overshoots where slip begins, slides at a level that falls with velocity: stick-slip at reversals",
        equation: "F = f (u + tau' du/dt),  du/dt = (v - |v| u/g)/d,  g = (1 + b exp(-(v/vs)^2)) (1 + skew sign(v)),  tau' = tau/(1 + tau |v|/(4 d g))",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "sliding friction force at high velocity"),
            Param::shape("d", Dim::X, Grid::OfX(&[0.03, 0.2]), "bristle deflection: the stuck stiffness is f/d"),
            Param::shape("vs", Dim::X_PER_T, Grid::OfV(&[0.1]), "velocity over which the level falls (Stribeck velocity)"),
            Param::shape("b", Dim::One, Grid::Values(&[0.5]), "static over sliding level, minus one").within(0.0, 10.0),
            Param::setting("skew", Dim::One, Sign::Any, 0.0, "direction dependence: levels 1 + skew for v > 0, 1 - skew for v < 0")
                .within(-0.95, 0.95),
            Param::setting("tau", Dim::T, Sign::NonNegative, 0.0, "damping of the bristles over their stiffness"),
        ],
        states: 1,
        ports: Ports::VDX,
        family: "friction",
        source: "Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Autom. Control 40 (1995) 419-425; bristle \
                 damping that falls with velocity: Olsson et al., Eur. J. Control 4 (1998) 176-195",
        range: "lubricated contacts with presliding; passive at every tau, since tau' |v| < 4 d g (Barabanov and Ortega, IEEE Trans. Autom. Control 45, 2000)",
    };

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        // Exact for a constant velocity over the step: the deflection relaxes over the distance travelled to the level.
        let level = |v: T, direction: f64| excess(v, p[2], p[3]) * (p[4] * direction + 1.0);
        let direction = sign(u.dx);
        let end = level(u.dx / dt, direction);
        let travelled = u.dx * direction / p[1];
        let goal = end * direction;
        s[0] -= (goal - s[0]) * (-travelled / end).exp_m1();
        let g = level(u.v, sign(u.v));
        let speed = magnitude(u.v);
        let rate = (u.v - speed * s[0] / g) / p[1];
        let damping = p[5] / (p[5] * speed / (p[1] * g * 4.0) + 1.0);
        p[0] * (s[0] + damping * rate)
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok((s * p[5] + T::from(1.0)) * (p[0] / p[1]))
    }
}
