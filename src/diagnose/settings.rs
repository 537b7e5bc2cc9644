//! Constants of the search: meaning, unit, why. Those of the likelihood stand in [`crate::evidence::Settings`].

use serde::Serialize;

use crate::evidence;

/// How missing physics is searched for, and when it is believed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Effects added at most.
    pub max_added: usize,
    /// Candidates refitted for their scores: what is not refitted is not found.
    pub refits: usize,
    /// Refitted candidates that are weighed with variances of their own.
    pub weighed: usize,
    /// Factor on the gain that a score or a refit under the base's variances promises, below which a candidate is not looked at further: once
    /// it is there, the error it leaves has a smaller variance.
    pub promise: f64,
    /// The same of an effect in series, whose score at opening zero says little.
    pub promise_series: f64,
    /// Fits and estimates of variances in turn.
    pub rounds: usize,
    /// Iterations of each of these fits.
    pub iterations: u64,
    /// Candidates that stood best alone and are tried in pairs where none alone gains.
    pub pair_of: usize,
    /// Model error, in parts of the least, from which pairs are tried.
    pub pairs_from: f64,
    /// Nats within which two laws cannot be told apart; what stands is taken out only below minus this.
    pub tie: f64,
    /// Nats by which an alternative must be better to take the place of what stands.
    pub swap: f64,
    /// Ties named at most.
    pub ties: usize,
    /// Nats by which the density of the held-out tests must rise for an effect to be proven.
    pub held_out_nats: f64,
    /// Part by which their error must fall beside that.
    pub held_out_fall: f64,
    /// Part of the first model error left on the held-out tests above which the verdict stays `unexplained`...
    pub remainder: f64,
    /// ...where it is more than this many times the noise...
    pub visible: f64,
    /// ...and this many times the least model error.
    pub visible_least: f64,
    /// Part of a channel's rms that a gain of one test must move: less is scatter between tests.
    pub fault_gain: f64,
    /// The same of other faults of a channel.
    pub fault_least: f64,
    /// Times the model's own error in a test that a fault must move it: physics first.
    pub fault_over: f64,
    /// Error that a test may have once its fault is taken out, over the median of the others.
    pub like_others: f64,
    /// Tests from which a fault of one of them can be told from physics.
    pub fault_tests: usize,
    /// What the likelihood assumes.
    #[serde(flatten)]
    pub evidence: evidence::Settings,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            max_added: 4,
            refits: 8,
            weighed: 8,
            promise: 2.0,
            promise_series: 5.0,
            rounds: 2,
            iterations: 12,
            pair_of: 4,
            pairs_from: 2.0,
            tie: 1.5,
            swap: 0.5,
            ties: 5,
            held_out_nats: 1.0,
            held_out_fall: 0.03,
            remainder: 1.0 / 3.0,
            visible: 2.0,
            visible_least: 3.0,
            fault_gain: 0.03,
            fault_least: 0.01,
            fault_over: 3.0,
            like_others: 2.5,
            fault_tests: 3,
            evidence: evidence::Settings::default(),
        }
    }
}
