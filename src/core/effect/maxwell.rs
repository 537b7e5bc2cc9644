//! Maxwell branch: a spring in series with a damper.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Maxwell branch: a spring in series with a damper.
pub struct Maxwell;

impl Force for Maxwell {
    const INFO: Info = Info {
        name: "maxwell",
        role: Role::Force,
        claim: "dissipates around one relaxation time and stiffens above it",
        equation: "F = k s,  ds/dt = v - s/tau",
        params: &[
            Param::strength("k", Dim::F_PER_X, Sign::NonNegative, "stiffness of the branch above its relaxation frequency"),
            Param::shape("tau", Dim::T, Grid::Time(8), "relaxation time; the loss peaks at w = 1/tau"),
        ],
        states: 1,
        ports: Ports::DX,
        family: "viscoelastic",
        source: "Christensen, Theory of Viscoelasticity (1982), sec. 1.6",
        range: "linear viscoelastic materials; several branches for a wide band",
    };

    const SUPERPOSES: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        // Exact for a displacement that is linear over the step: second order for any other, stable at every dt/tau.
        let ratio = p[1].recip() * dt;
        let decay = (-ratio).exp();
        let gain = -(-ratio).exp_m1() / ratio;
        s[0] = s[0] * decay + u.dx * gain;
        p[0] * s[0]
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let st = s * p[1];
        Ok(st * p[0] / (st + T::from(1.0)))
    }
}
