//! Constants of the search for the test that separates what is tied. None of them decides what is believed.

use serde::Serialize;

/// Which tests are tried, how many of them are simulated, and when one is good enough.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Proposals {
    /// Tied laws at most that a test is to separate from the one that was taken.
    pub rivals: usize,
    /// Frequencies of a cycle that are tried...
    pub frequencies: usize,
    /// ...and amplitudes (half ranges)...
    pub amplitudes: usize,
    /// ...from the least tested over this factor to the largest times it: what a bench that ran those can be expected to run.
    pub reach: f64,
    /// Means that are tried about the best cycles, in parts of the half range.
    pub means: [f64; 2],
    /// Part of a condition's value by which one that all tests share is changed; where it varies, half of its range beyond either end is tried.
    pub beyond: f64,
    /// Factors on the lines of an FRF.
    pub bands: [f64; 4],
    /// Factors on its excitation...
    pub excitations: [f64; 4],
    /// ...or parts of the largest force of a cycle, where it has none.
    pub of_force: [f64; 3],
    /// Separation that is aimed at, in standard deviations of noise: among proposals beyond it the one nearest to what was tested is taken.
    pub enough: f64,
    /// Proposals that are simulated...
    pub simulated: usize,
    /// ...and those that are weighed at a time.
    pub batch: usize,
    /// Iterations of a refit to a simulated test: it begins at the fit to the measured ones.
    pub iterations: u64,
    /// Part of the time spent before that all of it may take: a third of that is a quarter of the whole.
    pub share: f64,
    /// The least time it gets [s].
    pub least: f64,
    /// Part of its time after which what has been weighed is simulated.
    pub weighing: f64,
}

impl Default for Proposals {
    fn default() -> Self {
        Proposals {
            rivals: 3,
            frequencies: 4,
            amplitudes: 4,
            reach: 3.0,
            means: [-0.6, 0.6],
            beyond: 0.3,
            bands: [0.1, 0.3, 3.0, 10.0],
            excitations: [0.1, 0.3, 3.0, 10.0],
            of_force: [0.03, 0.3, 1.0],
            enough: 10.0,
            simulated: 2,
            batch: 4,
            iterations: 20,
            share: 1.0 / 3.0,
            least: 2.0,
            weighing: 0.5,
        }
    }
}
