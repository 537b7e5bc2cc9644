//! Linear law of a coefficient in a condition.

use super::Num;
use super::coefficient::{CoefficientLaw, Over};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Linear law of a coefficient in a condition, such as the contact area A.
pub struct LinearLaw;

impl CoefficientLaw for LinearLaw {
    const INFO: Info = Info {
        name: "linear_law",
        role: Role::Coefficient,
        claim: "a coefficient grows or falls in proportion to a test condition",
        equation: "p = p_ref (1 + a (c - c_ref))",
        params: &[Param::strength("a", Dim::PerCondition, Sign::Any, "relative change per unit of the condition")],
        states: 0,
        ports: Ports::NONE,
        family: "coefficient",
        source: "a boundary film's shear strength times the contact area: Bowden and Tabor, The Friction and Lubrication of Solids (1950), ch. 5",
        range: "conditions near c_ref; the coefficient changes sign at c_ref - 1/a",
    };

    // Over a load it is load_stiffness.
    const OVER: Over = Over::NoLoad;

    fn factor<T: Num>(offset: f64, p: &[T]) -> T {
        p[0] * offset + 1.0
    }
}
