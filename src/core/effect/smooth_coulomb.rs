//! Friction whose sign changes over a width of velocity.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::saturating_tanh;
use super::{Force, Inputs, Num};

/// Friction whose sign changes over a width of velocity.
pub struct SmoothCoulomb;

impl Force for SmoothCoulomb {
    const INFO: Info = Info {
        name: "smooth_coulomb",
        role: Role::Force,
        claim: "a damper at small velocity, friction of constant size at large velocity: loops with flat tops and rounded, inclined reversals",
        equation: "F = f tanh(v/w)",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "friction force at large velocity"),
            Param::shape("w", Dim::X_PER_T, Grid::OfV(&[0.03, 0.1, 0.4]), "width: at this velocity the force is 76 % of f"),
        ],
        states: 0,
        ports: Ports::V,
        family: "friction",
        source: "tanh characteristic: Worden, Hickey, Haroon and Adams, Mech. Syst. Signal Process. 23 (2009) 104-126; Andersson, Soderberg and \
                 Bjorklund, Tribol. Int. 40 (2007) 580-587",
        range: "friction that creeps before it slides: seals, lubricated guides, dithered contacts; coulomb where the width is not seen",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * saturating_tanh(u.v / p[1])
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(s * (p[0] / p[1]))
    }
}
