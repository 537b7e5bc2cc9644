//! Mass of an accelerometer on the place whose response it reads.

use num_complex::Complex;

use super::Num;
use super::channel::{ChannelLaw, Moment};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Mass of an accelerometer on the place whose response it reads.
pub struct AccelerometerMass;

impl ChannelLaw for AccelerometerMass {
    const INFO: Info = Info {
        name: "accelerometer_mass",
        role: Role::Channel,
        claim: "the accelerometer loads the place where it sits: natural frequencies are lower in every test by the mode's motion there, so that those of a \
                roving accelerometer do not agree",
        equation: "H_read = H_re / (1 + m A_rr), A_rr the accelerance at the place of the response",
        params: &[Param::strength("m", Dim::FT2_PER_X, Sign::NonNegative, "mass of the accelerometer with what moves along")],
        states: 0,
        ports: Ports::NONE,
        family: "instrument",
        source: "Ewins, Modal Testing (2000), sec. 3.10 (mass loading); Sherman-Morrison for one added mass",
        range: "on responses of FRFs, in small motion of the structure",
    };

    const READS: Option<&'static str> = Some("response");

    // It acts on responses of FRFs alone; over time a signal is read as it is.
    fn reading<T: Num>(y: T, _at: Moment, _p: &[T]) -> T {
        y
    }

    fn factor<T: Num>(_w: f64, accelerance: Complex<T>, p: &[T]) -> Complex<T> {
        Complex::new(T::from(1.0), T::from(0.0)) / (accelerance * p[0] + T::from(1.0))
    }
}
