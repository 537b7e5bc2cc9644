//! Gain of a channel.

use num_complex::Complex;

use super::Num;
use super::channel::{ChannelLaw, Moment};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Gain of a channel.
pub struct Gain;

impl ChannelLaw for Gain {
    const INFO: Info = Info {
        name: "gain",
        role: Role::Channel,
        claim: "the channel reads too high or too low by one factor at every amplitude and frequency",
        equation: "y_read = g y",
        params: &[Param { default: 1.0, ..Param::strength("g", Dim::One, Sign::Positive, "gain; 1 is a true channel") }],
        states: 0,
        ports: Ports::NONE,
        family: "instrument",
        source: "McConnell and Varoto, Vibration Testing (2008), ch. 4",
        range: "linear sensors",
    };

    fn reading<T: Num>(y: T, _at: Moment, p: &[T]) -> T {
        y * p[0]
    }

    fn factor<T: Num>(_w: f64, _drive: Complex<T>, p: &[T]) -> Complex<T> {
        Complex::new(p[0], T::from(0.0))
    }
}
