//! Hidden degree of freedom: a mass on a spring and a damper.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Hidden degree of freedom: a mass on a spring and a damper.
pub struct Absorber;

impl Force for Absorber {
    const INFO: Info = Info {
        name: "absorber",
        role: Role::Force,
        claim: "a mass below its own frequency, a notch with two peaks beside it there, nothing but a damper above: a loose part, a cable, a cover that rings",
        equation: "F = m y'',  y'' + 2 zeta w (y' - v) + w^2 (y - x) = 0,  w = 2 pi f0",
        params: &[
            Param::strength("m", Dim::FT2_PER_X, Sign::NonNegative, "hidden mass, or moment of inertia about a rotation"),
            Param::shape(
                "f0",
                Dim::PER_T,
                Grid::Across(&[0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0]),
                "its natural frequency with the body held",
            ),
            Param::shape("zeta", Dim::One, Grid::Values(&[0.03]), "its damping ratio with the body held").within(1e-4, 2.0),
        ],
        states: 3,
        ports: Ports::XVDX,
        family: "inertial",
        source: "Frahm, US patent 989958 (1911); Den Hartog, Mechanical Vibrations, 4th ed. (1956), sec. 3.2",
        range: "hangs on a body; at a connector between two bodies it is an inerter behind a spring and a damper",
    };

    const SUPERPOSES: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        // The rule of constant average acceleration on r = y - x and y'; states: r, y', v at the start of the step.
        let omega = p[1] * std::f64::consts::TAU;
        let (k, c) = (omega * omega, p[2] * omega * 2.0);
        let (r, rate, v) = (s[0], s[1], s[2]);
        let (h, force) = (0.5 * dt, k * r + c * (rate - v));
        // r1 = r + h (rate + rate1) - dx;  rate1 = rate - h (force + k r1 + c (rate1 - v1)).
        let known = r + rate * h - u.dx;
        let rate1 = (rate - (force + k * known - c * u.v) * h) / ((c + k * h) * h + 1.0);
        let r1 = known + rate1 * h;
        (s[0], s[1], s[2]) = (r1, rate1, u.v);
        -p[0] * (k * r1 + c * (rate1 - u.v))
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let omega = p[1] * std::f64::consts::TAU;
        let held = s * (p[2] * omega * 2.0) + Complex::new(omega * omega, T::from(0.0));
        Ok(s * s * held / (s * s + held) * p[0])
    }
}
