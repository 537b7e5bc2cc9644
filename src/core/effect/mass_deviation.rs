//! How far a body's mass lies beside what the model says of it.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// How far a body's mass lies beside its nominal value.
pub struct MassDeviation;

impl Force for MassDeviation {
    const INFO: Info = Info {
        name: "mass_deviation",
        role: Role::Force,
        claim: "a body is heavier or lighter than its nominal mass: a correction of the model, not missing physics",
        equation: "F = m a",
        params: &[Param::strength("m", Dim::FT2_PER_X, Sign::Any, "mass beside the nominal one; negative: lighter")],
        states: 0,
        ports: Ports::A,
        family: "deviation",
        source: "base slack: nominal values with a hierarchical prior, Gelman et al., Bayesian Data Analysis, 3rd ed., ch. 5",
        range: "a few per cent of the mass that it corrects",
    };

    const LINEAR: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.a
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(s * s * p[0])
    }
}
