//! Quadratic spring.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Quadratic spring.
pub struct QuadraticStiffness;

impl Force for QuadraticStiffness {
    const INFO: Info = Info {
        name: "quadratic_stiffness",
        role: Role::Force,
        claim: "stiffer to one side and softer to the other in proportion to displacement; even harmonics, no dissipation",
        equation: "F = k2 x^2",
        params: &[Param::strength("k2", Dim::F_PER_X2, Sign::Any, "quadratic stiffness; positive stiffens for x > 0")],
        states: 0,
        ports: Ports::X,
        family: "elastic",
        source: "Helmholtz's asymmetric oscillator; Nayfeh and Mook, Nonlinear Oscillations (1979), ch. 2",
        range: "small asymmetry; unstable beyond |x| = k/(2 k2) of the spring beside it",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.x * u.x
    }

    fn stiffness<T: Num>(_s: Complex<T>, _p: &[T]) -> Result<Complex<T>, &'static str> {
        // The tangent of x^2 at rest is zero.
        Ok(Complex::new(T::from(0.0), T::from(0.0)))
    }
}
