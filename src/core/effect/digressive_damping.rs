//! Damper whose coefficient falls with velocity.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::magnitude;
use super::{Force, Inputs, Num};

/// Damper whose coefficient falls with velocity.
pub struct DigressiveDamping;

impl Force for DigressiveDamping {
    const INFO: Info = Info {
        name: "digressive_damping",
        role: Role::Force,
        claim: "damps slow motion steeply, fast motion with a force that levels off: the valve blows off",
        equation: "F = c v/(1 + |v|/v0);  levels off at c v0",
        params: &[
            Param::strength("c", Dim::FT_PER_X, Sign::NonNegative, "coefficient at small velocity"),
            Param::shape("v0", Dim::X_PER_T, Grid::OfV(&[0.02, 0.1, 0.5]), "velocity at which the coefficient has fallen to half"),
        ],
        states: 0,
        ports: Ports::V,
        family: "viscous",
        source: "shear-thinning fluid of exponent 1: Cross, J. Colloid Sci. 20 (1965) 417-437; digressive characteristic of valves: Duym, Stiens and \
                 Reybrouck, Vehicle Syst. Dyn. 27 (1997) 109-127",
        range: "preloaded valves and thinning fluids; viscous beside it where the force goes on rising",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * u.v / (magnitude(u.v) / p[1] + 1.0)
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(s * p[0])
    }
}
