//! Constants of the likelihood: meaning, unit, why.

use serde::Serialize;

/// What is assumed of noise, instruments and the model's own error.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Settings {
    /// Relative error of a model below which no model of a device is claimed: sampling, integration and geometry are not better known.
    pub model_error_least: f64,
    /// Standard deviation of the logarithm of the model's error in one test over the common one: laws fail unevenly, by factors of two.
    pub model_error_spread: f64,
    /// Half-normal prior of the relative scatter of strengths between tests: temperature and mounting.
    pub scatter_prior: f64,
    /// Largest scatter of strengths: what differs more from test to test is an error of the model, or it eats relaxation and inertia.
    pub scatter_most: f64,
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
    /// Evaluations of the likelihood in one estimate of the variances.
    pub evaluations: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            model_error_least: 0.003,
            model_error_spread: 0.7,
            scatter_prior: 0.02,
            scatter_most: 0.04,
            noise_spread: 0.3,
            noise_most: 2.0,
            noise_pool: 8.0,
            facts_loop: 4.0,
            facts_most: 16.0,
            facts_mode: 6.0,
            facts_record: 12.0,
            evaluations: 80,
        }
    }
}
