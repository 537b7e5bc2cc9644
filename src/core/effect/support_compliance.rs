//! Linear compliance of the support in series.

use super::Num;
use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::series::SeriesLaw;

/// Linear compliance of the support in series.
pub struct SupportCompliance;

impl SeriesLaw for SupportCompliance {
    const INFO: Info = Info {
        name: "support_compliance",
        role: Role::Series,
        claim: "everything at the place is softer than its own law: part of the travel is taken by the support",
        equation: "y = x - s F",
        params: &[Param::strength("s", Dim::X_PER_F, Sign::NonNegative, "compliance")],
        states: 0,
        ports: Ports::NONE,
        family: "elastic",
        source: "springs in series",
        range: "linear support",
    };

    const LINEAR: bool = true;

    fn opening<T: Num>(f: T, p: &[T]) -> T {
        p[0] * f
    }
}
