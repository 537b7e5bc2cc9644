//! Steps that large rotations, or kinks of several laws at once, do not allow to be taken at once.

use super::super::EngineError;
use super::{March, State};

/// A step is taken in parts down to twice this.
const LEAST_PART: f64 = 0.02;
/// Halvings that a march may make at any time, and for every step that it has taken. Here and there a step needs them, such as where a
/// contact opens; a model that needs them throughout is far from one that stands, and would take a hundred times as long to say so.
const FIRST: usize = 30;
const PER_STEP: f64 = 0.05;

/// What a march has had to halve.
#[derive(Default)]
pub(super) struct Halved {
    steps: usize,
    halvings: usize,
}

impl Halved {
    fn too_often(&self) -> bool {
        self.halvings as f64 > FIRST as f64 + PER_STEP * self.steps as f64
    }
}

impl March<'_> {
    /// One step, to the loads at index `k`. Where no equilibrium is found at its end, it is taken in halves.
    pub fn step(&mut self, k: usize, state: &mut State, columns: usize) -> Result<(), EngineError> {
        self.halved.steps += 1;
        let mut force = std::mem::take(&mut self.force);
        let done = self.parts(k, (0.0, 1.0), state, columns, &mut force);
        self.force = force;
        done
    }

    /// From one part of the step to another.
    fn parts(&mut self, k: usize, (from, to): (f64, f64), state: &mut State, columns: usize, force: &mut [f64]) -> Result<(), EngineError> {
        self.dt = (to - from) * self.loads.dt;
        match self.advance(k, to, state, columns, force) {
            Err(EngineError::NoEquilibrium { .. } | EngineError::NotFinite { .. })
                if to - from > LEAST_PART && !self.halved.too_often() =>
            {
                self.halved.halvings += 1;
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
        assert!(!Halved { steps: 1, halvings: 30 }.too_often() && Halved { steps: 1, halvings: 31 }.too_often());
        assert!(!Halved { steps: 4000, halvings: 230 }.too_often() && Halved { steps: 4000, halvings: 231 }.too_often());
    }
}
