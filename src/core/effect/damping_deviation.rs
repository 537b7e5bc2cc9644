//! How far one damper lies beside what the model says of it.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// How far one damper lies beside its group or its nominal value.
pub struct DampingDeviation;

impl Force for DampingDeviation {
    const INFO: Info = Info {
        name: "damping_deviation",
        role: Role::Force,
        claim: "one damper is stronger or weaker than its group or its nominal value: a correction of the model, not missing physics",
        equation: "F = c dx/dt",
        params: &[Param::strength("c", Dim::FT_PER_X, Sign::Any, "damping beside that of the group; negative: weaker")],
        states: 0,
        ports: Ports::V,
        family: "deviation",
        source: "base slack: nominal values with a hierarchical prior, Gelman et al., Bayesian Data Analysis, 3rd ed., ch. 5",
        range: "a tenth of the damping that it corrects",
    };

    const LINEAR: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.v
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(s * p[0])
    }
}
