//! Rigid Coulomb friction, regularised in velocity.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::smooth_sign;
use super::{Force, Inputs, Num};

/// Rigid Coulomb friction, regularised in velocity.
pub struct Coulomb;

impl Force for Coulomb {
    const INFO: Info = Info {
        name: "coulomb",
        role: Role::Force,
        claim: "force of constant size against the motion; dissipated energy per cycle independent of frequency, proportional to amplitude",
        equation: "F = f v / sqrt(v^2 + vr^2)",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "friction force"),
            Param {
                grid: Grid::OfLeastV(&[0.01, 0.001]),
                ..Param::setting(
                    "vr",
                    Dim::X_PER_T,
                    Sign::Positive,
                    1e-6,
                    "velocity below which the sign is regularised; small against every tested velocity",
                )
            },
        ],
        states: 0,
        ports: Ports::V,
        family: "friction",
        source: "Coulomb (1785); regularisation as in the paper's FE model (sec. 2)",
        range: "gross sliding; no presliding stiffness",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * smooth_sign(u.v / p[1])
    }

    fn stiffness<T: Num>(_s: Complex<T>, _p: &[T]) -> Result<Complex<T>, &'static str> {
        Err("use elastic_slip, which sticks elastically, or declare the excitation amplitude of the FRF")
    }
}
