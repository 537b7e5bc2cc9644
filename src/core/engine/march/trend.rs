//! A prediction of third order where the motion is smooth: the auxiliary accelerations go on changing as they did in the step before. It saves
//! an evaluation of the model in a step. Where friction turns they jump, and a trend through the jump is worse than none.

/// Part of the square of a change that the trend before must have foretold.
const FORETOLD: f64 = 0.5;

/// Change of the auxiliary accelerations over a step.
pub(super) struct Trend {
    change: Vec<f64>,
    /// Length of the step at whose end it was taken [s]; none where no equilibrium was found there.
    dt: Option<f64>,
    /// Whether it is gone by.
    holds: bool,
}

impl Trend {
    /// Of so many degrees of freedom.
    pub fn new(n: usize) -> Self {
        Trend { change: vec![0.0; n], dt: None, holds: false }
    }

    /// Takes the change over the last step, before one of `dt`: it is gone by where the last one was as long and changed as the one before it.
    pub fn follow(&mut self, dt: f64, old: &[f64], now: &[f64]) {
        let goes_on = self.dt == Some(dt) && old.len() == now.len();
        let (mut square, mut missed) = (0.0, 0.0);
        for (d, change) in self.change.iter_mut().enumerate() {
            let new = if goes_on { now[d] - old[d] } else { 0.0 };
            square += new * new;
            missed += (new - *change) * (new - *change);
            *change = new;
        }
        self.holds = missed < (1.0 - FORETOLD) * square;
        self.dt = None;
    }

    /// The step at hand has ended, at an equilibrium where its length is given.
    pub fn ended(&mut self, dt: Option<f64>) {
        self.dt = dt;
    }

    /// What is predicted of the change over the step at hand.
    pub fn of(&self, d: usize) -> f64 {
        if self.holds { self.change[d] } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is predicted after each of these accelerations, in steps of one length.
    fn predicted(w: &[f64]) -> Vec<f64> {
        let mut trend = Trend::new(1);
        let step = |pair: &[f64]| {
            trend.ended(Some(1e-3));
            trend.follow(1e-3, &pair[..1], &pair[1..]);
            trend.of(0)
        };
        w.windows(2).map(step).collect()
    }

    #[test]
    fn a_steady_change_is_gone_by_and_a_jump_is_not() {
        assert_eq!(predicted(&[0.0, 1.0, 2.0, 3.1, 9.0, 10.0, 11.0]), [0.0, 1.0, 3.1 - 2.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_step_of_another_length_or_without_an_equilibrium_has_no_trend() {
        let mut trend = Trend::new(1);
        for (ended, dt, expected) in [(Some(1e-3), 1e-3, 0.0), (Some(1e-3), 1e-3, 2.0), (Some(1e-3), 5e-4, 0.0), (None, 5e-4, 0.0)] {
            trend.ended(ended);
            trend.follow(dt, &[1.0], &[3.0]);
            assert_eq!(trend.of(0), expected);
        }
    }
}
