//! Linear spring.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Linear spring.
pub struct LinearStiffness;

impl Force for LinearStiffness {
    const INFO: Info = Info {
        name: "linear_stiffness",
        role: Role::Force,
        claim: "force proportional to displacement; no dissipation",
        equation: "F = k x",
        params: &[Param::strength("k", Dim::F_PER_X, Sign::NonNegative, "stiffness")],
        states: 0,
        ports: Ports::X,
        family: "elastic",
        source: "Hooke; paper eq. 1",
        range: "small strain of the joint",
    };

    const LINEAR: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.x
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(Complex::new(p[0], T::from(0.0)))
    }
}
