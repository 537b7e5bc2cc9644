//! Spring whose stiffness changes at one point.

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::positive;
use super::{Force, Inputs, Num};

/// Spring whose stiffness changes at one point.
pub struct BilinearStiffness;

impl Force for BilinearStiffness {
    const INFO: Info = Info {
        name: "bilinear_stiffness",
        role: Role::Force,
        claim: "one stiffness below a point of travel and another above it, without a jump of the force; no dissipation",
        equation: "F = k (max(x - x0, 0) - max(-x0, 0))",
        params: &[
            Param::strength("k", Dim::F_PER_X, Sign::Any, "stiffness above x0 minus stiffness below it"),
            Param::shape("x0", Dim::X, Grid::Along(&[-0.5, 0.0, 0.5]), "where the stiffness changes").signed(),
        ],
        states: 0,
        ports: Ports::X,
        family: "elastic",
        source: "Shaw and Holmes, J. Sound Vib. 90 (1983) 129-155",
        range: "beside a linear_stiffness; negative k: the spring is stiffer below x0",
    };

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, _s: &mut [T], p: &[T]) -> T {
        // The constant takes the preload out: no force at x = 0.
        p[0] * (positive(u.x - p[1]) - positive(-p[1]))
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        // Exactly at the point the fundamental of a small motion sees the mean of both sides.
        let share = if p[1].re() < 0.0 {
            1.0
        } else if p[1].re() > 0.0 {
            0.0
        } else {
            0.5
        };
        Ok(Complex::new(p[0] * share, T::from(0.0)))
    }
}
