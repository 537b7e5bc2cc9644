//! Constants of the likelihood: meaning, unit, why.

use serde::Serialize;

/// What is assumed of noise, instruments and the model's own error.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Settings {
    /// Relative error of a model below which no model of a device is claimed: sampling, integration and geometry are not better known.
    pub model_error_least: f64,
    /// The same of an FRF. A linear response is computed without steps, and its error is smooth: over the lines of a resonance noise averages out, and
    /// 0.3 % would hide what they show.
    pub frf_error_least: f64,
    /// Standard deviation of the logarithm of the model's error in one test over the common one: laws fail unevenly, by factors of two.
    pub model_error_spread: f64,
    /// Half-normal prior of the relative scatter of strengths between tests: temperature and mounting.
    pub scatter_prior: f64,
    /// Largest scatter of strengths: what differs more from test to test is an error of the model, or it eats relaxation and inertia.
    pub scatter_most: f64,
    /// Standard deviation of the logarithm of the scatter in tests of one kind over the common one: an FRF is a mean of many averages, a loop of its cycles, a
    /// record one event.
    pub scatter_spread: f64,
    /// Step of the pattern search along that logarithm at first.
    pub scatter_step: f64,
    /// Directions in the space of strengths in which the curvature of a record is granted beside its slope, those in which it moves most...
    pub curved: usize,
    /// ...and the part of the strengths over which the curvature is taken: what they scatter by, from which estimates of that begin.
    pub curved_over: f64,
    /// Part of the variance of what an instrument may misread that all tests of its channel have in common: calibration, zero and characteristic are the sensor's,
    /// mounting and temperature the test's. Half is what is said of two parts of which nothing is known.
    pub instruments_common: f64,
    /// Standard deviation of the logarithm of true over seen noise: a scatter of few cycles knows it to a third.
    pub noise_spread: f64,
    /// Largest factor on the noise, and one over it: what is noisier is an error of the model.
    pub noise_most: f64,
    /// Cycles' worth of weight of a noise spectrum pooled over tests: a test of four cycles has three degrees of freedom a harmonic.
    pub noise_pool: f64,
    /// Facts that a loop holds at least: mean, stiffness, loss, one of shape.
    pub facts_loop: f64,
    /// Facts that the model's error of one channel counts as at most over all loops: one strength must take 43 % of its power.
    pub facts_most: f64,
    /// Facts that a resonance holds in an FRF: frequency, damping, residue and their phases.
    pub facts_mode: f64,
    /// Facts that a channel of a record holds: its stretches that are independent.
    pub facts_record: f64,
    /// Largest relative error of a model, as a logarithm.
    pub model_error_most: f64,
    /// Evaluations of the likelihood in one estimate of the variances...
    pub evaluations: usize,
    /// ...steps of its pattern search at first, in the logarithms of noise, model error and scatter. The last gives the noise what it takes from the
    /// model error: where both are white the likelihood has a ridge along it, and steps along the axes alone stop beside its crest...
    pub steps: [[f64; 3]; 4],
    /// ...and the part of these steps at which it ends.
    pub last_step: f64,
    /// Grid of the logarithm of a channel's own model error over the common one: its reach to either side...
    pub own_reach: f64,
    /// ...and its points.
    pub own_points: usize,
    /// Nats below the most at which the integrand over that grid, continued in held-out tests, is left off.
    pub negligible: f64,
    /// Logarithm of a scatter that is none, a fifth of a percent...
    pub no_scatter: f64,
    /// ...and of that from which an estimate begins at least: below it the likelihood is flat.
    pub scatter_from: f64,
    /// Ridge on the information of the parameters, of which the tests may not know all.
    pub ridge: f64,
    /// Lines on either side over which the size of an FRF is averaged: between resonances a model errs by what its neighbours are.
    pub neighbours: usize,
    /// Lines of FRFs from which the correlation of neighbours is told...
    pub colour_lines: usize,
    /// ...and the most that it is: what is smoother is no noise.
    pub colour_most: f64,
    /// A maximum of an FRF's magnitude is a resonance where it stands this far above the minima about it.
    pub rises: f64,
}

impl Settings {
    /// Logarithms of a channel's own model error over the common one that are tried.
    pub(super) fn own_grid(&self) -> impl Iterator<Item = f64> {
        self.endless_grid().take(self.own_points)
    }

    /// The same grid, going on without an end.
    pub(super) fn endless_grid(&self) -> impl Iterator<Item = f64> {
        let (reach, points) = (self.own_reach, self.own_points);
        (0..).map(move |k| reach * (2.0 * k as f64 / (points - 1) as f64 - 1.0))
    }

    /// Least error of any channel.
    pub fn least(&self) -> f64 {
        self.model_error_least.min(self.frf_error_least)
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            model_error_least: 0.003,
            frf_error_least: 0.001,
            model_error_spread: 0.7,
            scatter_prior: 0.02,
            scatter_most: 0.04,
            scatter_spread: 0.7,
            scatter_step: 0.8,
            curved: 2,
            curved_over: 0.01,
            instruments_common: 0.5,
            noise_spread: 0.3,
            noise_most: 2.0,
            noise_pool: 8.0,
            facts_loop: 4.0,
            facts_most: 16.0,
            facts_mode: 6.0,
            facts_record: 12.0,
            model_error_most: 2.3,
            evaluations: 240,
            steps: [[0.3, 0.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.8], [0.3, -0.6, 0.0]],
            last_step: 0.02,
            own_reach: 2.0,
            own_points: 41,
            negligible: 20.0,
            no_scatter: -6.2,
            scatter_from: -5.3,
            ridge: 1e-9,
            neighbours: 3,
            colour_lines: 50,
            colour_most: 0.9,
            rises: 1.4,
        }
    }
}
