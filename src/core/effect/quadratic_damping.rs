//! Quadratic damper.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::num::magnitude;
use super::{Force, Inputs, Num};

/// Quadratic damper.
pub struct QuadraticDamping;

impl Force for QuadraticDamping {
    const INFO: Info = Info {
        name: "quadratic_damping",
        role: Role::Force,
        claim: "force grows with velocity squared; dissipated energy per cycle with frequency squared and amplitude cubed",
        equation: "F = c v |v|",
        params: &[Param::strength("c", Dim::FT2_PER_X2, Sign::NonNegative, "quadratic damping coefficient")],
        states: 0,
        ports: Ports::V,
        family: "viscous",
        source: "drag at high Reynolds numbers; Nayfeh and Mook, Nonlinear Oscillations (1979), ch. 3",
        range: "turbulent flow through orifices and around bodies",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.v * magnitude(u.v)
    }

    fn stiffness<T: Num>(_s: Complex<T>, _p: &[T]) -> Result<Complex<T>, &'static str> {
        // The tangent of v |v| at rest is zero.
        Ok(Complex::new(T::from(0.0), T::from(0.0)))
    }
}
