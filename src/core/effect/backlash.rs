//! Free play in series.

use super::Num;
use super::info::{Dim, Grid, Info, Param, Ports, Role, Sign};
use super::num::saturating_tanh;
use super::series::SeriesLaw;

/// Free play in series.
pub struct Backlash;

impl SeriesLaw for Backlash {
    const INFO: Info = Info {
        name: "backlash",
        role: Role::Series,
        claim: "after each reversal a stretch of travel without force: a flat zone in the loop",
        equation: "y = x - (g/2) tanh(F/f_close)",
        params: &[
            Param::strength("g", Dim::X, Sign::NonNegative, "total free play"),
            Param::shape("f_close", Dim::F, Grid::Sharpness(&[0.02, 0.1]), "force that closes the play: below it the parts float"),
        ],
        states: 0,
        ports: Ports::NONE,
        family: "clearance",
        source: "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996), ch. 2; regularised in the force",
        range: "quasi-static play without impact",
    };

    fn opening<T: Num>(f: T, p: &[T]) -> T {
        p[0] * 0.5 * saturating_tanh(f / p[1])
    }
}
