//! How much of a chain's mass lies between its nodes: what relative motion has less of.

use num_complex::Complex;

use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Mass that lies along connectors, where the model has it at the nodes.
pub struct InertiaDeviation;

/// Own frequency squared of the mass between two nodes that are held, over `k / m` of its spring and body: 8 for one mass in the middle of every spring,
/// for two at its thirds and for a bar, each to the fourth power of the wave number (unit test).
const OWN: f64 = 8.0;

/// `w2 = 8 k / m` and `d = 8 c / m`; none where nothing weighs.
pub fn own_motion<T: Num>(m: T, k: T, c: T) -> [T; 2] {
    if m.re() > 0.0 { [k * OWN / m, c * OWN / m] } else { [T::from(0.0); 2] }
}

/// Acceleration of a mass between nodes, its sign turned, from its motion r beside them over a step of constant average acceleration, `r'' + d r' + w2 r = -a`.
/// `s`: r, r' and the velocity of the nodes at the start of the step.
pub(super) fn lag<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], [w2, d]: [T; 2]) -> T {
    let h = 0.5 * dt;
    let (r, rate, v) = (s[0], s[1], s[2]);
    let known = rate - (u.v - v) - (w2 * r * 2.0 + (d + w2 * h) * rate) * h;
    let rate1 = known / ((d + w2 * h) * h + 1.0);
    let r1 = r + (rate + rate1) * h;
    (s[0], s[1], s[2]) = (r1, rate1, u.v);
    w2 * r1 + d * rate1
}

impl Force for InertiaDeviation {
    const INFO: Info = Info {
        name: "inertia_deviation",
        role: Role::Force,
        claim: "mass lies between the nodes that carry it in the model, on the springs that join them: natural frequencies higher the higher the mode. A \
                correction of the model, not missing physics; with node_deviation at the nodes",
        equation: "F = -(part m / 4) y'',  y'' + w2 (y - x) + d (y' - v) = 0,  w2 = 8 k / m,  d = 8 c / m",
        params: &[
            Param::strength(
                "part",
                Dim::One,
                Sign::NonNegative,
                "part of a body's mass that lies between two nodes: 1/2 in a chain of twice as many bodies, 2/3 in a bar",
            ),
            Param::setting("m", Dim::FT2_PER_X, Sign::NonNegative, 0.0, "mean mass of the bodies at its ends; always that of the model"),
            Param::setting(
                "k",
                Dim::F_PER_X,
                Sign::NonNegative,
                0.0,
                "stiffness of the springs at the same place; always that of the model",
            ),
            Param::setting("c", Dim::FT_PER_X, Sign::NonNegative, 0.0, "damping at the same place; always that of the model"),
        ],
        states: 3,
        ports: Ports::V,
        family: "deviation",
        source: "dynamic condensation of a mass in the middle of a spring: Leung, Int. J. Numer. Meth. Eng. 12 (1978) 1705; lumped and consistent mass: \
                 Hughes, The Finite Element Method (1987), sec. 7.3.2",
        range: "below the frequency of the mass between two held nodes; above it the structure needs more bodies",
    };

    const SUPERPOSES: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        p[0] * p[1] * 0.25 * lag(u, dt, s, own_motion(p[1], p[2], p[3]))
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let [w2, d] = own_motion(p[1], p[2], p[3]);
        let spring = s * d + Complex::new(w2, T::from(0.0));
        Ok(-(s * s * spring / (s * s + spring) * (p[0] * p[1] * 0.25)))
    }
}
