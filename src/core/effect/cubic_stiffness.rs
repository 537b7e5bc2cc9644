//! Cubic spring.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Cubic spring.
pub struct CubicStiffness;

impl Force for CubicStiffness {
    const INFO: Info = Info {
        name: "cubic_stiffness",
        role: Role::Force,
        claim: "stiffens (k3 > 0) or softens (k3 < 0) with amplitude, symmetrically; no dissipation",
        equation: "F = k3 x^3",
        params: &[Param::strength("k3", Dim::F_PER_X3, Sign::Any, "cubic stiffness")],
        states: 0,
        ports: Ports::X,
        family: "elastic",
        source: "Duffing (1918)",
        range: "moderate amplitudes; a negative k3 is unstable at large ones",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.x * u.x * u.x
    }

    fn stiffness<T: Num>(_s: Complex<T>, _p: &[T]) -> Result<Complex<T>, &'static str> {
        // The tangent of x^3 at rest is zero.
        Ok(Complex::new(T::from(0.0), T::from(0.0)))
    }
}
