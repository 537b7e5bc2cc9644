//! What a march takes upon itself where steps are hard: large rotations, or kinks of several laws at once. Here and there a step is, such as
//! where a contact opens; a model that needs it throughout is far from one that stands, and would take a hundred times as long to say so.

use super::super::EngineError;
use super::{March, State};
use crate::parallel;

/// A step is taken in parts down to twice this.
const LEAST_PART: f64 = 0.02;
/// Newton iterations and shortened steps together in one time step, at most, and of a march that has had its share.
const ITERATIONS: usize = 120;
const FEW: usize = 30;
/// What a march may use at any time, and for every step that it has taken. A chain of the paper's size takes 4 to 10 iterations a step.
const HALVINGS: Share = Share { first: 30.0, per_step: 0.05 };
const PATIENCE: Share = Share { first: 1000.0, per_step: 25.0 };

struct Share {
    first: f64,
    per_step: f64,
}

/// What a march has used.
#[derive(Default)]
pub(super) struct Effort {
    steps: usize,
    halvings: usize,
    iterations: usize,
}

impl Effort {
    fn within(&self, used: usize, share: &Share) -> bool {
        used as f64 <= share.first + share.per_step * self.steps as f64
    }

    /// Whether a step that has made so many iterations may make another, which is counted.
    pub fn goes_on(&mut self, iteration: usize) -> bool {
        let most = if self.within(self.iterations, &PATIENCE) { ITERATIONS } else { FEW };
        self.iterations += usize::from(iteration < most);
        iteration < most
    }

    fn may_halve(&self) -> bool {
        self.within(self.halvings, &HALVINGS) && self.within(self.iterations, &PATIENCE)
    }
}

impl March<'_> {
    /// One step, to the loads at index `k`. Where no equilibrium is found at its end, it is taken in halves.
    pub fn step(&mut self, k: usize, state: &mut State, columns: usize) -> Result<(), EngineError> {
        if parallel::given_up() {
            return Err(EngineError::GivenUp);
        }
        self.effort.steps += 1;
        let mut force = std::mem::take(&mut self.force);
        let done = self.parts(k, (0.0, 1.0), state, columns, &mut force);
        self.force = force;
        done
    }

    /// From one part of the step to another.
    fn parts(&mut self, k: usize, (from, to): (f64, f64), state: &mut State, columns: usize, force: &mut [f64]) -> Result<(), EngineError> {
        self.dt = (to - from) * self.loads.dt;
        match self.advance(k, to, state, columns, force) {
            Err(EngineError::NoEquilibrium { .. } | EngineError::NotFinite { .. }) if to - from > LEAST_PART && self.effort.may_halve() => {
                self.effort.halvings += 1;
                state.clone_from(&self.old);
                self.keep = false;
                let middle = 0.5 * (from + to);
                self.parts(k, (from, middle), state, columns, force)?;
                self.parts(k, (middle, to), state, columns, force)
            }
            done => done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_here_and_there_is_admitted_and_throughout_is_not() {
        let of = |steps, halvings| Effort { steps, halvings, iterations: 0 }.may_halve();
        assert!(of(1, 30) && !of(1, 31) && of(4000, 230) && !of(4000, 231));
    }

    #[test]
    fn a_march_that_has_had_its_share_of_iterations_neither_halves_nor_searches_long() {
        let of = |iterations| Effort { steps: 100, halvings: 0, iterations };
        assert!(of(3500).may_halve() && !of(3501).may_halve());
        assert!(of(3500).goes_on(119) && !of(3500).goes_on(120));
        assert!(of(3501).goes_on(29) && !of(3501).goes_on(30));
        let mut effort = of(10);
        assert!(effort.goes_on(5) && effort.iterations == 11);
    }
}
