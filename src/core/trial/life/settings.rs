//! Magnitudes of everything that the model and the instruments of a realistic case do not know: meaning, unit, why.

use serde::Serialize;

/// Magnitudes of the realistic generator. Pairs are the ends of a draw, uniform in the logarithm unless it says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Settings {
    /// Strength of what is hidden, in standard deviations of an observer who knows the form of the law and every variance below: from hardly
    /// visible to plain.
    pub strength: (f64, f64),
    /// Noise of a sample over the rms of its channel: load cells and displacement transducers between 40 and 55 dB below the signal.
    pub noise: (f64, f64),
    /// Correlation length of the noise, in parts of a cycle, or of the first period of a hit: filters and structure-borne noise.
    pub correlation: (f64, f64),
    /// Correlation length of the noise of a frequency response [lines]: windows and leakage.
    pub correlation_lines: (f64, f64),
    /// Standard deviation of the slow part of the noise over that of the whole: temperature and amplifiers.
    pub slow_part: f64,
    /// Correlation length of the slow part [cycles].
    pub slow_cycles: f64,
    /// Standard deviation of the force from cycle to cycle, relative: the cycle's row of the reference has 1 %, most rigs less.
    pub cycles: f64,
    /// Standard deviation of every strength from test to test, relative: temperature and mounting.
    pub scatter: f64,
    /// The same from one frequency response to the next: taken within an hour, without remounting.
    pub scatter_frf: f64,
    /// Stated over true standard deviation of the noise.
    pub stated: (f64, f64),
    /// Part of the cases in which no standard deviation is stated.
    pub unstated: f64,
    /// Quadratic and cubic error of a sensor at full scale, relative to full scale, either sign: linearity of 0.1 % in data sheets.
    pub sensor: f64,
    /// Standard deviation of the gain of a channel in a test: calibration.
    pub gain: f64,
    /// Largest error of that gain: cells outside 1 % are at fault.
    pub gain_most: f64,
    /// Standard deviation of a spring against its group, relative: parts of one batch.
    pub stiffness: f64,
    /// The same of a damper: damping is less well made than stiffness.
    pub damping: f64,
    /// The same of a mass: parts can be weighed, what moves with them cannot.
    pub mass: f64,
    /// Part of the chains in which one spring is off by [`Settings::odd_size`].
    pub odd: f64,
    /// Deviation of the odd spring, relative, either sign: another batch.
    pub odd_size: f64,
    /// Force of the base's own nonlinearity over the largest force of a spring: what nobody models in a part that is called linear.
    pub nonlinearity: (f64, f64),
    /// Loops of a connector, least and most, uniform: a day on the rig.
    pub loops: (usize, usize),
    /// Cycles kept of a loop, least and most, uniform.
    pub kept: (usize, usize),
    /// Part of the connector's loops that are recorded from the first cycle on, without discard_cycles.
    pub run_up: f64,
    /// Cycles of a run-up, least and most, uniform.
    pub run_up_cycles: (usize, usize),
    /// Part of the connector's cases that run about a mean, where their laws have one.
    pub mean: f64,
    /// That mean over the largest amplitude, either sign.
    pub mean_size: f64,
    /// Bodies of a chain, least and most, uniform.
    pub bodies: (usize, usize),
}

/// Samples per cycle of a loop: rigs record at fixed rates and at rates that follow the drive. None is a multiple of four, so that no sample
/// falls on a reversal, where the force of a dry friction is whatever a rounding error makes of it.
pub const SAMPLINGS: [usize; 5] = [82, 102, 130, 202, 254];
/// Lines of a frequency response.
pub const LINES: [usize; 3] = [120, 200, 320];

/// As the reference generators have it (one connector: noise 0.5-3 %, AR(1) of 1 and 5 % of a cycle, 1 % from cycle to cycle, stiffness
/// 1-3 %, sensor 0.1 %, gain 0.5 %; chains: springs 5 %, masses 3 % at most, one odd spring of 10 %).
pub const SETTINGS: Settings = Settings {
    strength: (2.0, 30.0),
    noise: (0.003, 0.02),
    correlation: (0.005, 0.05),
    correlation_lines: (1.0, 5.0),
    slow_part: 0.3,
    slow_cycles: 1.5,
    cycles: 0.005,
    scatter: 0.01,
    scatter_frf: 0.003,
    stated: (0.5, 2.0),
    unstated: 0.5,
    sensor: 0.001,
    gain: 0.005,
    gain_most: 0.01,
    stiffness: 0.02,
    damping: 0.1,
    mass: 0.01,
    odd: 0.2,
    odd_size: 0.1,
    nonlinearity: (0.002, 0.01),
    loops: (4, 8),
    kept: (3, 8),
    run_up: 0.3,
    run_up_cycles: (1, 3),
    mean: 0.3,
    mean_size: 0.2,
    bodies: (2, 8),
};
