//! The history of a sweep: what a prediction computes while the frequency of a force rises.

/// The history of one sweep.
pub struct Sweep {
    /// Name of the case.
    pub case: String,
    /// `name.axis` of the displacement.
    pub respond: String,
    /// `name.axis` of the force.
    pub at: String,
    /// Mean and amplitude of the force [N].
    pub force: (f64, f64),
    /// Frequencies at the start and at the end [Hz].
    pub frequencies: (f64, f64),
    /// Times [s].
    pub time: Vec<f64>,
    /// Displacement [m] at each.
    pub displacement: Vec<f64>,
}

impl Sweep {
    /// Frequency of the force [Hz] at time `t` [s]: it rises linearly.
    pub fn frequency(&self, t: f64) -> f64 {
        let (from, to) = self.frequencies;
        from + (to - from) * t / self.time.last().copied().unwrap_or(1.0)
    }
}
