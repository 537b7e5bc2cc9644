//! Drift of a channel.

use num_complex::Complex;

use super::Num;
use super::channel::{ChannelLaw, Moment};
use super::info::{Dim, Info, Param, Ports, Role, Sign};

/// Drift of a channel.
pub struct Drift;

impl ChannelLaw for Drift {
    const INFO: Info = Info {
        name: "drift",
        role: Role::Channel,
        claim: "the reading creeps linearly in time: a loop that does not close, a record that leans",
        equation: "y_read = y + b (t - t_mid)",
        params: &[Param::strength("b", Dim::ChannelPerTime, Sign::Any, "rate of the drift")],
        states: 0,
        ports: Ports::NONE,
        family: "instrument",
        source: "McConnell and Varoto, Vibration Testing (2008), ch. 4",
        range: "t_mid is the middle of the record. A settled loop is the mean of cycles that start at phase 0: there a drift is a ramp over one cycle \
                with a jump of b times the period at phase 0 (a drift between cycles that is seen when they are averaged has been taken out with its ramp). \
                No effect on an FRF",
    };

    const IN_FREQUENCY: bool = false;

    fn reading<T: Num>(y: T, at: Moment, p: &[T]) -> T {
        y + p[0] * at.time
    }

    fn factor<T: Num>(_w: f64, _drive: Complex<T>, _p: &[T]) -> Complex<T> {
        Complex::new(T::from(1.0), T::from(0.0))
    }
}
