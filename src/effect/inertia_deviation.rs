//! How much of a chain's mass lies between its nodes.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Mass that lies along connectors, where the model has it at the nodes.
pub struct InertiaDeviation;

impl Force for InertiaDeviation {
    const INFO: Info = Info {
        name: "inertia_deviation",
        role: Role::Force,
        claim: "mass lies between the nodes that carry it in the model: the same total, less inertia of relative motion, natural frequencies higher the \
                higher the mode. A correction of the model, not missing physics",
        equation: "F = -m d2x/dt2",
        params: &[Param::strength(
            "m",
            Dim::FT2_PER_X,
            Sign::NonNegative,
            "inertia that relative motion lacks: a sixteenth of a body's mass in a chain of twice as many bodies, a twelfth in a bar",
        )],
        states: 0,
        ports: Ports::A,
        family: "deviation",
        source: "lumped, consistent and averaged mass of a bar: Hughes, The Finite Element Method (1987), sec. 7.3.2",
        range: "to first order in frequency squared; above it the structure needs more bodies",
    };

    const LINEAR: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        -(p[0] * u.a)
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(-(s * s * p[0]))
    }
}
