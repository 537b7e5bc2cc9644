//! Spring whose force levels off.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::smooth_sign;
use super::{Force, Inputs, Num};

/// Spring whose force levels off.
pub struct SaturatingStiffness;

impl Force for SaturatingStiffness {
    const INFO: Info = Info {
        name: "saturating_stiffness",
        role: Role::Force,
        claim: "softens with amplitude to either side towards a constant force, and stays stable at every amplitude; no dissipation",
        equation: "F = k x/sqrt(1 + (x/d)^2);  levels off at k d",
        params: &[
            Param::strength("k", Dim::F_PER_X, Sign::NonNegative, "stiffness at small displacement"),
            Param::shape("d", Dim::X, Grid::OfX(&[0.05, 0.2, 0.7]), "displacement at which the force is 71 % of its limit"),
        ],
        states: 0,
        ports: Ports::X,
        family: "elastic",
        source: "Richard and Abbott, J. Eng. Mech. Div. 101 (1975) 511-515 (exponent 2, no plastic branch)",
        range: "preloaded washers, magnetic and superelastic springs; linear_stiffness beside it where the force goes on rising",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * p[1] * smooth_sign(u.x / p[1])
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(Complex::new(p[0], T::from(0.0)))
    }
}
