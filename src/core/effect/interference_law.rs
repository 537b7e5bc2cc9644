//! Exponential law of a coefficient in a condition.

use super::Num;
use super::coefficient::CoefficientLaw;
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Exponential law of a coefficient in a condition, such as the interference i.
pub struct InterferenceLaw;

impl CoefficientLaw for InterferenceLaw {
    const INFO: Info = Info {
        name: "interference_law",
        role: Role::Coefficient,
        claim: "a coefficient grows or falls exponentially with a test condition",
        equation: "p = p_ref exp(a (i - i_ref))",
        params: &[Param::strength("a", Dim::PerCondition, Sign::Any, "exponent; monotone rising when bounded by 0 from below")],
        states: 0,
        ports: Ports::NONE,
        family: "coefficient",
        source: "paper eqs. 7-8, with the reference at the design interference (design.md section 2)",
        range: "the paper gives 0.03 mm to 1.3 mm",
    };

    fn factor<T: Num>(offset: f64, p: &[T]) -> T {
        (p[0] * offset).exp()
    }
}
