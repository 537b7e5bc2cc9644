//! Iwan's parallel-series model: Jenkins elements whose sliders give way one after the other.

use std::sync::LazyLock;

use num_complex::Complex;

use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::{Force, Inputs, Num};

/// Iwan's parallel-series model: Jenkins elements whose sliders give way one after the other.
pub struct Iwan;

/// Sliders.
const SLIDERS: usize = 12;

impl Force for Iwan {
    const INFO: Info = Info {
        name: "iwan",
        role: Role::Force,
        claim: "slips little by little from the smallest amplitude on: loss per cycle a power of amplitude, Masing loops equal at every frequency",
        equation: "F = f sum_j u_j / sum_j y_j,  u_j = clamp(u_j + dx/d, -y_j, y_j),  y_j = ((j - 1/2)/12)^(1/(1 + chi)), j = 1..12",
        params: &[
            Param::strength("f", Dim::F, Sign::NonNegative, "force at which every slider slips"),
            Param::shape("d", Dim::X, Grid::OfX(&[0.1, 0.5, 1.5]), "displacement at which the last slider slips"),
            Param::setting(
                "chi",
                Dim::One,
                Sign::Any,
                0.0,
                "density y^chi of sliders over the slip displacement y d: 0 uniform, large: one slider",
            )
            .within(-0.9, 50.0)
            .tried(Grid::Starts(&[0.0])),
        ],
        states: SLIDERS,
        ports: Ports::DX,
        family: "friction",
        source: "Iwan, J. Appl. Mech. 33 (1966) 893-900 (uniform density); power-law density: Segalman, J. Appl. Mech. 72 (2005) 752-760",
        range: "bolted and press-fitted joints; below the first slider's slip, d/24 at chi = 0, all of them stick",
    };

    const PARALLEL: bool = true;

    fn advance<T: Num>(u: &Inputs<T>, _dt: f64, s: &mut [T], p: &[T]) -> T {
        let step = u.dx / p[1];
        let exponent = (p[2] + 1.0).recip();
        let (mut sum, mut full) = (T::from(0.0), T::from(0.0));
        for (j, state) in s.iter_mut().enumerate() {
            let limit = limit(j, exponent);
            let trial = *state + step;
            *state = if trial.re() > limit.re() {
                limit
            } else if trial.re() < -limit.re() {
                -limit
            } else {
                trial
            };
            sum += *state;
            full += limit;
        }
        p[0] * sum / full
    }

    fn stiffness<T: Num>(_s: Complex<T>, p: &[T]) -> Result<Complex<T>, &'static str> {
        let exponent = (p[2] + 1.0).recip();
        let full = (0..SLIDERS).fold(T::from(0.0), |sum, j| sum + limit(j, exponent));
        Ok(Complex::new(p[0] / (p[1] * full) * SLIDERS as f64, T::from(0.0)))
    }
}

/// Logarithms of the quantiles `(j - 1/2)/12`.
static QUANTILES: LazyLock<[f64; SLIDERS]> = LazyLock::new(|| std::array::from_fn(|j| ((j as f64 + 0.5) / SLIDERS as f64).ln()));

/// Slip displacement of every slider over that of the whole, for a density `y^chi`.
pub fn limits(chi: f64) -> Vec<f64> {
    (0..SLIDERS).map(|j| limit(j, 1.0 / (1.0 + chi))).collect()
}

/// Slip displacement of slider `j`, counted from 0, over that of the whole: the quantiles of the density.
fn limit<T: Num>(j: usize, exponent: T) -> T {
    (exponent * QUANTILES[j]).exp()
}
