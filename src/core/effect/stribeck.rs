//! Coulomb friction whose level falls with velocity.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::smooth_sign;
use super::{Force, Inputs, Num};

/// Coulomb friction whose level falls with velocity.
pub struct Stribeck;

impl Force for Stribeck {
    const INFO: Info = Info {
        name: "stribeck",
        role: Role::Force,
        claim: "friction that is highest where motion begins and falls with velocity: peaks after each reversal, stick-slip on a soft drive",
        equation: "F = f (1 + b exp(-(v/vs)^2)) v / sqrt(v^2 + vr^2)",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "friction force at high velocity"),
            Param::shape("vs", Dim::X_PER_T, Grid::OfV(&[0.03, 0.3]), "velocity over which the level falls (Stribeck velocity)"),
            Param::shape("b", Dim::One, Grid::Values(&[0.5]), "static over sliding level, minus one").within(0.0, 10.0),
            Param::setting(
                "vr",
                Dim::X_PER_T,
                Sign::Positive,
                1e-6,
                "velocity below which the sign is regularised; small against vs and every tested velocity",
            )
            .tried(Grid::OfLeastV(&[0.01, 0.001])),
        ],
        states: 0,
        ports: Ports::V,
        family: "friction",
        source: "Stribeck (1902); Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083-1138; Gaussian fall",
        range: "gross sliding; no presliding stiffness (lugre has one)",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        p[0] * excess(u.v, p[1], p[2]) * smooth_sign(u.v / p[3])
    }

    fn stiffness<T: Num>(_s: Complex<T>, _p: &[T]) -> Result<Complex<T>, &'static str> {
        Err("use lugre, which sticks elastically, or declare the excitation amplitude of the FRF")
    }
}

/// Level of friction over its level at high velocity, `1 + b exp(-(v/vs)^2)`.
pub(super) fn excess<T: Num>(v: T, vs: T, b: T) -> T {
    let w = v / vs;
    b * (-(w * w)).exp() + 1.0
}
