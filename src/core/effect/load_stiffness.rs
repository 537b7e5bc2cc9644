//! Linear law of a coefficient in the load.

use super::Num;
use super::coefficient::{CoefficientLaw, Over};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Linear law of a coefficient in the load.
pub struct LoadStiffness;

impl CoefficientLaw for LoadStiffness {
    const INFO: Info = Info {
        name: "load_stiffness",
        role: Role::Coefficient,
        claim: "a coefficient grows or falls in proportion to the static load: natural frequencies move with preload",
        equation: "p = p_ref (1 + a (load - load_ref))",
        params: &[Param::strength("a", Dim::PerCondition, Sign::Any, "relative change per unit of load")],
        states: 0,
        ports: Ports::NONE,
        family: "coefficient",
        source: "first order of the tangent stiffness of a preloaded contact: Johnson, Contact Mechanics (1985), ch. 4",
        range: "loads near load_ref; the coefficient changes sign at load_ref - 1/a",
    };

    const OVER: Over = Over::Load;

    fn factor<T: Num>(offset: f64, p: &[T]) -> T {
        p[0] * offset + 1.0
    }
}
