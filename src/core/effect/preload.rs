//! Constant force.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Constant force.
pub struct Preload;

impl Force for Preload {
    const INFO: Info = Info {
        name: "preload",
        role: Role::Force,
        claim: "moves the whole loop along the force axis by the same amount in every test; no stiffness, no dissipation",
        equation: "F = f",
        params: &[Param::strength(
            "f",
            Dim::F,
            Sign::Any,
            "force at every motion; positive: the ends pull on each other, negative: they push",
        )],
        states: 0,
        ports: Ports::NONE,
        family: "elastic",
        source: "gas force of a monotube shock absorber, p0 times the area of the rod: Dixon, The Shock Absorber Handbook (2007); dead weight",
        range: "gas volumes large against the stroke, weights, long soft springs; may follow a condition such as the pressure",
    };

    const PRESSES: bool = true;

    fn advance<T: Num>(_u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0]
    }

    fn stiffness<T: Num>(_s: Complex<T>, _p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(Complex::new(T::from(0.0), T::from(0.0)))
    }
}
