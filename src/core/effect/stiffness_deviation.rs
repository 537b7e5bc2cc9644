//! How far one spring lies beside what the model says of it.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// How far one spring lies beside its group or its nominal value.
pub struct StiffnessDeviation;

impl Force for StiffnessDeviation {
    const INFO: Info = Info {
        name: "stiffness_deviation",
        role: Role::Force,
        claim: "one spring is stiffer or softer than its group or its nominal value: a correction of the model, not missing physics",
        equation: "F = k x",
        params: &[Param::strength("k", Dim::F_PER_X, Sign::Any, "stiffness beside that of the group; negative: softer")],
        states: 0,
        ports: Ports::X,
        family: "deviation",
        source: "base slack: nominal values with a hierarchical prior, Gelman et al., Bayesian Data Analysis, 3rd ed., ch. 5",
        range: "a few per cent of the stiffness that it corrects",
    };

    const LINEAR: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.x
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(Complex::new(p[0], T::from(0.0)))
    }
}
