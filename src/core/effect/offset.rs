//! Offset of a channel.

use num_complex::Complex;

use super::Num;
use super::channel::{ChannelLaw, Moment};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Offset of a channel.
pub struct Offset;

impl ChannelLaw for Offset {
    const INFO: Info = Info {
        name: "offset",
        role: Role::Channel,
        claim: "the channel reads a constant on top of the signal",
        equation: "y_read = y + b",
        params: &[Param::strength("b", Dim::Channel, Sign::Any, "offset")],
        states: 0,
        ports: Ports::NONE,
        family: "instrument",
        source: "McConnell and Varoto, Vibration Testing (2008), ch. 4",
        range: "no effect on an FRF",
    };

    const IN_FREQUENCY: bool = false;

    fn reading<T: Num>(y: T, _at: Moment, p: &[T]) -> T {
        y + p[0]
    }

    fn factor<T: Num>(_w: f64, _drive: Complex<T>, _p: &[T]) -> Complex<T> {
        Complex::new(T::from(1.0), T::from(0.0))
    }
}
