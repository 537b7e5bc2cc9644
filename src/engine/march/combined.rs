//! Weighted sums of states.

use super::State;

impl State {
    fn values(&self) -> [&[f64]; 6] {
        [&self.q, &self.v, &self.a, &self.s, &self.w, &self.g]
    }
    fn values_mut(&mut self) -> [&mut [f64]; 6] {
        [&mut self.q, &mut self.v, &mut self.a, &mut self.s, &mut self.w, &mut self.g]
    }
    fn slopes(&self) -> [&[f64]; 6] {
        [&self.dq, &self.dv, &self.da, &self.ds, &self.dw, &self.dg]
    }
    fn slopes_mut(&mut self) -> [&mut [f64]; 6] {
        [&mut self.dq, &mut self.dv, &mut self.da, &mut self.ds, &mut self.dw, &mut self.dg]
    }

    /// The sum of `seen` with the weights `values` of their values and `slopes[c]` of the sensitivities in column `c`, one weight a state;
    /// what has no weights is that of the last. Followers are those of the last.
    pub(in super::super) fn combined(seen: &[State], values: Option<&[f64]>, slopes: &[Option<Vec<f64>>]) -> Option<State> {
        let mut sum = seen.last()?.clone();
        if let Some(weights) = values {
            for (k, out) in sum.values_mut().into_iter().enumerate() {
                for (i, out) in out.iter_mut().enumerate() {
                    *out = seen.iter().zip(weights).map(|(s, w)| w * s.values()[k][i]).sum();
                }
            }
        }
        for (k, out) in sum.slopes_mut().into_iter().enumerate() {
            for (i, out) in out.iter_mut().enumerate() {
                if let Some(weights) = &slopes[i % slopes.len()] {
                    *out = seen.iter().zip(weights).map(|(s, w)| w * s.slopes()[k][i]).sum();
                }
            }
        }
        Some(sum)
    }
}
