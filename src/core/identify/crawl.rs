//! Steps that lower the cost by next to nothing, or not at all, and get nowhere.

/// Steps, taken or refused, that are looked back upon.
const WINDOW: u32 = 20;

/// The cost as it stood, and the steps since.
#[derive(Default)]
pub(super) struct Crawl {
    since: f64,
    steps: u32,
}

impl Crawl {
    /// Takes note of a step that was tried and left the cost at `cost`; whether so many have fallen by less, one with another, than is `worth` one. A residual that
    /// jumps (a sample beside the closing of a gap, a slider that sticks) is lowered a little by ever more steps between two jumps.
    pub fn crawls(&mut self, cost: f64, worth: f64) -> bool {
        if self.steps == 0 {
            self.since = cost;
        }
        self.steps += 1;
        if self.steps <= WINDOW {
            return false;
        }
        let fell = self.since - cost;
        *self = Crawl { since: cost, steps: 1 };
        fell < f64::from(WINDOW) * worth
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twenty_steps_that_fall_by_less_than_twenty_are_worth_end_a_fit() {
        let falls = |by: f64, n: u32| {
            let mut crawl = Crawl::default();
            (0..n).position(|k| crawl.crawls(100.0 - by * f64::from(k), 0.01))
        };
        assert_eq!(falls(0.009, 60), Some(20));
        assert_eq!(falls(0.011, 60), None);
        // A fall long ago is no merit: it is looked back upon twenty steps, no more.
        let mut crawl = Crawl::default();
        let slows = |k: u32| if k < 10 { 100.0 - f64::from(k) } else { 91.0 - 1e-4 * f64::from(k) };
        assert_eq!((0..60).position(|k| crawl.crawls(slows(k), 0.01)), Some(40));
    }
}
