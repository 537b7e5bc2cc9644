//! Jenkins element: a spring in series with a Coulomb slider.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Jenkins element: a spring in series with a Coulomb slider.
pub struct ElasticSlip;

impl Force for ElasticSlip {
    const INFO: Info = Info {
        name: "elastic_slip",
        role: Role::Force,
        claim: "sticks elastically at small amplitude, slips at a limit force: loops with parallel flanks and flat tops, equal at every frequency",
        equation: "F = f u,  u = clamp(u0 + dx/d, -1, 1)",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "slip force"),
            Param::shape("d", Dim::X, Grid::OfX(&[0.01, 0.03, 0.1, 0.3, 0.8]), "slip displacement: the stuck stiffness is f/d"),
        ],
        states: 1,
        ports: Ports::DX,
        family: "friction",
        source: "Jenkins (1962); Iwan, J. Appl. Mech. 33 (1966)",
        range: "rate-independent friction with presliding",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, s: &mut [T], p: &[T]) -> T {
        // Return mapping with the state scaled by the slip force, so that it does not depend on the strength.
        let trial = s[0] + u.dx / p[1];
        s[0] = if trial.re() > 1.0 {
            T::from(1.0)
        } else if trial.re() < -1.0 {
            T::from(-1.0)
        } else {
            trial
        };
        p[0] * s[0]
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        Ok(Complex::new(p[0] / p[1], T::from(0.0)))
    }
}
