//! Time by which a channel lags.

use num_complex::Complex;

use super::Num;
use super::channel::{ChannelLaw, Moment};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Time by which a channel lags.
pub struct Delay;

impl ChannelLaw for Delay {
    const INFO: Info = Info {
        name: "delay",
        role: Role::Channel,
        claim: "the channel lags by a constant time: looks like damping that grows with frequency, negative for a lead",
        equation: "y_read(t) = y(t - tau)",
        params: &[Param::strength("tau", Dim::T, Sign::Any, "lag of the channel")],
        states: 0,
        ports: Ports::NONE,
        family: "instrument",
        source: "McConnell and Varoto, Vibration Testing (2008), ch. 4",
        range: "delays short against the period",
    };

    fn shift<T: Num>(p: &[T]) -> T {
        p[0]
    }

    fn reading<T: Num>(y: T, _at: Moment, _p: &[T]) -> T {
        y
    }

    fn factor<T: Num>(w: f64, _drive: Complex<T>, p: &[T]) -> Complex<T> {
        Complex::new((p[0] * w).cos(), -(p[0] * w).sin())
    }
}
