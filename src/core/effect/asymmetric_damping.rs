//! Damper of unlike coefficients in the two directions.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::magnitude;
use super::{Force, Inputs, Num};

/// Damper of unlike coefficients in the two directions.
pub struct AsymmetricDamping;

impl Force for AsymmetricDamping {
    const INFO: Info = Info {
        name: "asymmetric_damping",
        role: Role::Force,
        claim: "damps one direction more than the other: the mean force over a cycle grows with velocity, even harmonics of force",
        equation: "F = c (v + beta |v|):  c (1 + beta) for v > 0, c (1 - beta) for v < 0",
        params: &[
            Param::strength("c", Dim::FT_PER_X, Sign::NonNegative, "mean of the coefficients of the two directions"),
            Param::shape(
                "beta",
                Dim::One,
                Grid::Values(&[-0.5, 0.5]),
                "asymmetry: 0 a plain damper, 1 no force for v < 0, -1 none for v > 0",
            )
            .signed()
            .within(-1.0, 1.0),
        ],
        states: 0,
        ports: Ports::V,
        family: "viscous",
        source: "bump and rebound of vehicle dampers: Surace, Worden and Tomlinson, Proc. IMechE D 206 (1992) 3-16; Dixon, The Shock Absorber \
                 Handbook (2007)",
        range: "valves of either direction in laminar flow; beside digressive_damping or quadratic_damping where these are not",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * (u.v + p[1] * magnitude(u.v))
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        // |v| of a sine has even harmonics only: at every amplitude the fundamental is that of the mean coefficient.
        Ok(s * p[0])
    }
}
