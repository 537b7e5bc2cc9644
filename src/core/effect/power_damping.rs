//! Damper with a power law of velocity.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::power;
use super::{Force, Inputs, Num};

/// Damper with a power law of velocity.
pub struct PowerDamping;

impl Force for PowerDamping {
    const INFO: Info = Info {
        name: "power_damping",
        role: Role::Force,
        claim: "force is a power of velocity: dissipated energy per cycle is a straight line over frequency in logarithms, of slope n",
        equation: "F = f (v/vr) ((v^2 + v0^2)/vr^2)^((n-1)/2),  for |v| >> v0: F = f |v/vr|^n sign(v)",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "force at the velocity vr"),
            Param::shape("n", Dim::One, Grid::Values(&[0.3, 0.7, 1.5]), "exponent: 0 Coulomb, 1 viscous, 2 quadratic").within(0.1, 4.0),
            Param::setting("vr", Dim::X_PER_T, Sign::Positive, 1e-3, "velocity at which the force is f").tried(Grid::OfV(&[1.0])),
            Param::setting(
                "v0",
                Dim::X_PER_T,
                Sign::Positive,
                1e-6,
                "velocity below which the force is linear; small against every tested one",
            )
            .tried(Grid::OfLeastV(&[0.01, 0.001])),
        ],
        states: 0,
        ports: Ports::V,
        family: "viscous",
        source: "Ostwald-de Waele fluid; fluid dampers with n 0.3 to 2: Constantinou and Symans, report NCEER-92-0032 (1992)",
        range: "shear-thinning (n < 1) and thickening (n > 1) fluids over one or two decades of velocity",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        let (w, floor) = (u.v / p[2], p[3] / p[2]);
        p[0] * w * power(w * w + floor * floor, (p[1] - 1.0) * 0.5)
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        if p[1].re() < 1.0 {
            return Err("use film, which sticks elastically, or declare the excitation amplitude of the FRF");
        }
        Ok(s * (p[0] / p[2] * power(p[3] / p[2], p[1] - 1.0)))
    }
}
