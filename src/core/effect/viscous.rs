//! Viscous damper.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Viscous damper.
pub struct Viscous;

impl Force for Viscous {
    const INFO: Info = Info {
        name: "viscous",
        role: Role::Force,
        claim: "force proportional to velocity; dissipated energy per cycle grows with frequency and amplitude squared",
        equation: "F = c v",
        params: &[Param::strength("c", Dim::FT_PER_X, Sign::NonNegative, "viscous damping coefficient")],
        states: 0,
        ports: Ports::V,
        family: "viscous",
        source: "Rayleigh; paper eq. 1",
        range: "laminar films, small frequency range",
    };

    const LINEAR: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.v
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(s * p[0])
    }
}
