//! A bound on the work of one steady cycle, counted in iterations of Newton's method, so that a model that cannot be computed is refused
//! after a count and not after a time. A healthy model takes 2 to 10 iterations a step; it settles, or is refused as not periodic, within
//! tens of cycles. A model that is far from one that stands (a section of a thousandth of the others) takes 25 iterations a step throughout
//! and hundreds of cycles.

use super::EngineError;
use super::March;

/// Iterations a step that any march may take on average, however many cycles it needs.
const ITERATIONS: usize = 10;
/// Cycles whose share is granted from the start: the first cycles are the hard ones. A large system settles in fewer, and takes longer.
pub(super) const CYCLES_SMALL: usize = 100;
pub(super) const CYCLES_LARGE: usize = 60;

/// An error where a march has taken more than [`ITERATIONS`] a step on average, over its cycles or the first `granted` cycles if it has
/// marched fewer.
pub(super) fn bounded(march: &March, steps: usize, cycles: usize, granted: usize) -> Result<(), EngineError> {
    within(march.iterations(), steps, cycles, granted)
}

fn within(iterations: usize, steps: usize, cycles: usize, granted: usize) -> Result<(), EngineError> {
    let most = ITERATIONS * steps * cycles.max(granted);
    if iterations <= most { Ok(()) } else { Err(EngineError::Work { cycles, steps, iterations, most }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::Explain;

    #[test]
    fn a_march_of_many_iterations_throughout_is_refused_with_what_it_took() {
        // 25 iterations a step: 24 cycles of 200 steps are still within what 60 cycles may take.
        assert!(within(24 * 25 * 200, 200, 24, CYCLES_LARGE).is_ok());
        let error = within(24 * 25 * 200 + 1, 200, 24, CYCLES_LARGE).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("24 cycles of 200 steps") && text.contains("120001") && text.contains("120000"), "{text}");
        assert!(error.accepted().contains("stiffness"));
    }

    /// A cycle that decays slowly is never refused for its number of cycles.
    #[test]
    fn a_march_of_few_iterations_a_step_goes_on() {
        for cycles in [1, 60, 200, 300] {
            assert!(
                within(cycles * 10 * 500, 500, cycles, CYCLES_LARGE).is_ok()
                    && within(cycles * 10 * 500, 500, cycles, CYCLES_SMALL).is_ok()
            );
        }
    }
}
