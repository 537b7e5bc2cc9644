//! Mass that takes part in the relative motion.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Mass that takes part in the relative motion.
pub struct AddedMass;

impl Force for AddedMass {
    const INFO: Info = Info {
        name: "added_mass",
        role: Role::Force,
        claim: "force proportional to relative acceleration: lowers natural frequencies, looks like negative stiffness that grows with frequency squared",
        equation: "F = m a",
        params: &[Param::strength(
            "m",
            Dim::FT2_PER_X,
            Sign::Any,
            "mass, or moment of inertia about a rotation; negative: a body is lighter than declared",
        )],
        states: 0,
        ports: Ports::A,
        family: "inertial",
        source: "entrained fluid and inerters: Smith, IEEE Trans. Autom. Control 47 (2002) 1648-1662; at a connector to the ground, a mass",
        range: "inertia of the structure; moving_mass is one under the load cell, which no part feels",
    };

    const LINEAR: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.a
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(s * s * p[0])
    }
}
