//! When factors that are kept from step to step are taken anew.
//!
//! The further the motion gets from where they were taken, the more evaluations a step asks for. Their cost spread over the steps that they
//! served is least when the next step would take more than this mean: then new ones are worth their price.

/// What a tangent and its factors cost, in evaluations of the forces: a chain of 22 parts is marched fastest at 2 to 4.
const PRICE: usize = 3;

/// What the factors at hand have taken so far.
#[derive(Default)]
pub(super) struct Kept {
    evaluations: usize,
    steps: usize,
}

impl Kept {
    /// New factors.
    pub fn renew(&mut self) {
        *self = Kept::default();
    }

    /// Counts a step of so many evaluations, and whether a next one like it is cheaper than new factors.
    pub fn serve(&mut self, evaluations: usize) -> bool {
        self.evaluations += evaluations;
        self.steps += 1;
        evaluations * self.steps <= PRICE + self.evaluations
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_serve_until_a_step_costs_more_than_they_have_on_average() {
        let mut kept = Kept::default();
        let steps = [3, 3, 4, 4, 5, 5, 6];
        // (3 + 3 + 3 + 4 + 4 + 5) / 5 = 4.4.
        let served = steps.into_iter().take_while(|n| kept.serve(*n)).count();
        assert_eq!(served, 4);
        kept.renew();
        // Steps that cost the same throughout never ask for new ones.
        assert!((0..1000).all(|_| kept.serve(9)));
    }
}
