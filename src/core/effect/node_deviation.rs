//! How much of a chain's mass lies between its nodes: what the nodes have more of than by its rigid motion.

use num_complex::Complex;

use super::inertia_deviation::lag;
use super::info::{Dim, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// The mass beside a node, which moves further than it.
pub struct NodeDeviation;

impl Force for NodeDeviation {
    const INFO: Info = Info {
        name: "node_deviation",
        role: Role::Force,
        claim: "the mass that inertia_deviation has on the springs beside a node moves further than the node, the more the higher the frequency. Part of that \
                correction, not missing physics",
        equation: "F = m (y'' - x''),  y'' + w2 (y - x) + d (y' - v) = 0",
        params: &[
            Param::strength(
                "m",
                Dim::FT2_PER_X,
                Sign::NonNegative,
                "mass that the node has on its springs; always that of inertia_deviation there",
            ),
            Param::setting(
                "w2",
                Dim::Place { f: 0, x: 0, t: -2 },
                Sign::NonNegative,
                0.0,
                "its own frequency squared, the mean over these springs; always that of inertia_deviation there",
            ),
            Param::setting("d", Dim::PER_T, Sign::NonNegative, 0.0, "its damping over its mass, likewise"),
        ],
        states: 3,
        ports: Ports::VA,
        family: "deviation",
        source: "dynamic condensation: Leung, Int. J. Numer. Meth. Eng. 12 (1978) 1705",
        range: "below the frequency of the mass between two held nodes",
    };

    const SUPERPOSES: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, dt: f64, s: &mut [T], p: &[T]) -> T {
        -(p[0] * (lag(u, dt, s, [p[1], p[2]]) + u.a))
    }

    fn stiffness<T: Num>(s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let whole = s * s + s * p[2] + Complex::new(p[1], T::from(0.0));
        Ok(-(s * s * s * s / whole * p[0]))
    }
}
