//! Derivatives of an element's force and states.

use crate::effect::dispatch::INPUTS;

/// Which derivatives of an element are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// Of the force with respect to the inputs.
    Inputs,
    /// Of force and states with respect to inputs and old states.
    States,
    /// Also with respect to the parameters; followers advance.
    Params,
}

/// Derivatives of one element over a step: row 0 the force, then the states as far as they were asked for; columns `x, v, a, dx`, states, parameters.
#[derive(Default)]
pub struct Sensed {
    /// General force.
    pub f: f64,
    n_states: usize,
    n_params: usize,
    d: Vec<f64>,
    /// Per row, the old states from the first to one past the last that it depends on.
    spans: Vec<(usize, usize)>,
}

impl Sensed {
    pub(super) fn reset(&mut self, n_states: usize, n_params: usize, rows: usize) {
        (self.f, self.n_states, self.n_params) = (0.0, n_states, n_params);
        self.d.clear();
        self.d.resize(rows * self.stride(), 0.0);
    }
    fn stride(&self) -> usize {
        INPUTS + self.n_states + self.n_params
    }
    pub(super) fn row_mut(&mut self, row: usize) -> &mut [f64] {
        let n = self.stride();
        &mut self.d[row * n..(row + 1) * n]
    }
    /// All derivatives of a row.
    pub fn row(&self, row: usize) -> &[f64] {
        let n = self.stride();
        &self.d[row * n..(row + 1) * n]
    }
    /// Derivatives of a row with respect to `x, v, a, dx`.
    pub fn inputs(&self, row: usize) -> &[f64] {
        &self.row(row)[..INPUTS]
    }
    /// Derivatives of a row with respect to the old states.
    pub fn states(&self, row: usize) -> &[f64] {
        &self.row(row)[INPUTS..INPUTS + self.n_states]
    }
    /// Derivatives of a row with respect to the parameters.
    pub fn params(&self, row: usize) -> &[f64] {
        &self.row(row)[INPUTS + self.n_states..]
    }
    /// Finds which old states each row depends on: a state mostly goes on from itself alone, and columns are many.
    pub fn find_spans(&mut self) {
        let mut spans = std::mem::take(&mut self.spans);
        spans.clear();
        for row in 0..=self.n_states {
            let d = self.states(row);
            let first = d.iter().position(|v| *v != 0.0).unwrap_or(d.len());
            let end = d.iter().rposition(|v| *v != 0.0).map_or(first, |last| last + 1);
            spans.push((first, end));
        }
        self.spans = spans;
    }
    /// The old states from the first to the last that a row depends on; after [`Sensed::find_spans`].
    #[inline(always)]
    pub fn span(&self, row: usize) -> std::ops::Range<usize> {
        self.spans[row].0..self.spans[row].1
    }
}
