//! Mass between the load cell and the structure.

use num_complex::Complex;

use super::Num;
use super::channel::{ChannelLaw, Moment};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Mass between the load cell and the structure.
pub struct MovingMass;

impl ChannelLaw for MovingMass {
    const INFO: Info = Info {
        name: "moving_mass",
        role: Role::Channel,
        claim: "the load cell also reads the inertia of what moves with it: a force in phase with acceleration, growing with frequency squared",
        equation: "F_read = F + m a",
        params: &[Param::strength("m", Dim::FT2_PER_X, Sign::NonNegative, "moving mass under the load cell")],
        states: 0,
        ports: Ports::NONE,
        family: "instrument",
        source: "Ewins, Modal Testing (2000), sec. 3.10 (mass cancellation)",
        range: "on force channels",
    };

    const READS: Option<&'static str> = Some("force");

    fn reading<T: Num>(y: T, at: Moment, p: &[T]) -> T {
        y + p[0] * at.acceleration
    }

    fn factor<T: Num>(_w: f64, drive: Complex<T>, p: &[T]) -> Complex<T> {
        drive * p[0] + T::from(1.0)
    }
}
