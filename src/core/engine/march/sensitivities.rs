//! Direct differentiation of a step. Every row of sensitivities holds one entry per column, so that all columns go through a derivative
//! side by side.

use crate::model::Sensed;

use super::super::EngineError;
use super::super::blocktri::widest;
use super::space::Spatial;
use super::{March, State, add_link};

/// Adds `by` times row `row` of `u` to `out`, a row of as many columns. By index: an iterator's adapters are not inlined everywhere.
#[inline(always)]
pub(super) fn add_row(out: &mut [f64], by: f64, u: &[f64], row: usize) {
    if by == 0.0 {
        return;
    }
    let n = out.len();
    let u = &u[row * n..(row + 1) * n];
    for c in 0..n {
        out[c] += by * u[c];
    }
}

/// Sensitivities of what an element sees of the motion: of its relative displacement, velocity, acceleration, and of the step.
#[derive(Default)]
pub(super) struct Motion([Vec<f64>; 4]);

impl Motion {
    pub fn clear(&mut self, columns: usize) {
        for row in &mut self.0 {
            row.clear();
            row.resize(columns, 0.0);
        }
    }

    #[inline(always)]
    pub fn add(&mut self, input: usize, by: f64, u: &[f64], row: usize) {
        add_row(&mut self.0[input], by, u, row);
    }

    /// Sensitivities of the new states of an element whose states begin at `s0`, those of the parameters left out.
    #[inline(always)]
    pub fn states(&self, sensed: &Sensed, s0: usize, old: &[f64], new: &mut [f64]) {
        let columns = self.0[0].len();
        for r in 0..sensed.states(0).len() {
            let out = &mut new[(s0 + r) * columns..(s0 + r + 1) * columns];
            out.fill(0.0);
            let (inputs, states) = (sensed.inputs(1 + r), sensed.states(1 + r));
            for k in 0..self.0.len() {
                add_row(out, inputs[k], &self.0[k], 0);
            }
            for k in sensed.span(1 + r) {
                add_row(out, states[k], old, s0 + k);
            }
        }
    }
}

widest! {
    fn differentiate(march: &mut March, spatial: Option<&Spatial>, state: &mut State, columns: usize) -> Result<(), EngineError> {
        march.differentiated(spatial, state, columns)
    }
}

impl March<'_> {
    /// Direct differentiation of the converged step. Columns beyond the free parameters are perturbations of the start.
    pub(super) fn sensitivities(&mut self, state: &mut State, columns: usize) -> Result<(), EngineError> {
        let spatial = self.spatial.take();
        let done = differentiate(self, spatial.as_ref(), state, columns);
        self.spatial = spatial;
        done
    }

    #[inline(always)]
    fn differentiated(&mut self, spatial: Option<&Spatial>, state: &mut State, columns: usize) -> Result<(), EngineError> {
        let (dt, n) = (self.dt, self.mass.len());
        let rates = self.rates();
        // Parts of dw', dv', da' that do not depend on dq': stored where these will stand.
        state.dq[..n * columns].fill(0.0);
        for d in 0..n {
            let at = d * columns..(d + 1) * columns;
            let (w, v, a) = (&mut state.dw[at.clone()], &mut state.dv[at.clone()], &mut state.da[at.clone()]);
            if self.prescribed_at[d].is_some() {
                [w, v, a].into_iter().for_each(|u| u.fill(0.0));
                continue;
            }
            let old = &self.old;
            self.alpha.carried(dt, [&old.dq[at.clone()], &old.dv[at.clone()], &old.dw[at.clone()], &old.da[at]], [w, v, a]);
        }
        // h: derivative of every element's force at held q'.
        self.h.clear();
        self.h.resize(columns * self.bound.elements.len(), 0.0);
        let acting = self.sensed.iter_mut().zip(&self.acts).filter(|(_, acts)| **acts);
        acting.for_each(|(sensed, _)| sensed.find_spans());
        for (e, element) in self.bound.elements.iter().enumerate().filter(|(e, _)| self.acts[*e]) {
            let (link, sensed) = (&self.links[e], &self.sensed[e]);
            let h = &mut self.h[e * columns..(e + 1) * columns];
            if spatial.is_none() {
                let d = sensed.inputs(0);
                for (dof, sign) in link.ends() {
                    add_row(h, sign * d[1], &state.dv, dof);
                    add_row(h, sign * d[2], &state.da, dof);
                    add_row(h, -sign * d[3], &self.old.dq, dof);
                }
                for k in sensed.span(0) {
                    add_row(h, sensed.states(0)[k], &self.old.ds, link.s0 + k);
                }
            }
            for (p, chain) in element.chains.iter().enumerate().filter(|_| self.by_parameter) {
                for (theta, slope) in chain {
                    h[*theta] += sensed.params(0)[p] * slope;
                }
            }
        }
        let n_free = self.free_dofs.len();
        if n_free > 0 {
            // The tangent of the last iteration may lag behind the converged point.
            self.refresh_matrix(spatial);
            self.matrix.factor()?;
            let mut rhs = std::mem::take(&mut self.rhs);
            rhs.clear();
            rhs.resize(n_free * columns, 0.0);
            for (i, &d) in self.free_dofs.iter().enumerate() {
                add_row(&mut rhs[i * columns..(i + 1) * columns], -self.mass[d], &state.da, d);
            }
            for (e, link) in self.links.iter().enumerate() {
                for (dof, sign) in link.ends() {
                    if let Some(i) = self.free[dof] {
                        add_row(&mut rhs[i * columns..(i + 1) * columns], -sign, &self.h, e);
                    }
                }
            }
            if let Some(spatial) = spatial {
                self.held_spatial(spatial, state, columns, &mut rhs);
            }
            self.matrix.solve_rows(&mut rhs, columns)?;
            for (i, &d) in self.free_dofs.iter().enumerate() {
                let at = d * columns..(d + 1) * columns;
                state.dq[at.clone()].copy_from_slice(&rhs[i * columns..(i + 1) * columns]);
                add_row(&mut state.dw[at.clone()], rates.w, &rhs, i);
                add_row(&mut state.dv[at.clone()], rates.v, &rhs, i);
                add_row(&mut state.da[at], rates.a, &rhs, i);
            }
            rhs.resize(n_free, 0.0);
            self.rhs = rhs;
        } else if let Some(at) = spatial {
            self.refresh_matrix(spatial);
            self.held_spatial(at, state, columns, &mut []);
        }
        state.dg[..n * columns].fill(0.0);
        for d in 0..n {
            add_row(&mut state.dg[d * columns..(d + 1) * columns], self.mass[d], &state.da, d);
        }
        if let Some(spatial) = spatial {
            self.follow_spatial(spatial, state, columns);
        }
        for e in 0..self.links.len() {
            if !self.acts[e] {
                continue;
            }
            if spatial.is_none() {
                let (link, d) = (&self.links[e], self.sensed[e].inputs(0));
                let k = d[0] + rates.v * d[1] + rates.a * d[2] + d[3];
                let df = &mut self.h[e * columns..(e + 1) * columns];
                link.ends().for_each(|(dof, sign)| add_row(df, sign * k, &state.dq, dof));
                link.ends().for_each(|(dof, sign)| add_row(&mut state.dg[dof * columns..(dof + 1) * columns], sign, df, 0));
                self.follow_motion(e, state, columns);
            }
            self.follow_parameters(e, state, columns);
        }
        Ok(())
    }

    /// Sensitivities of the states of an element after a step, but for those of its own parameters.
    #[inline(always)]
    fn follow_motion(&mut self, e: usize, state: &mut State, columns: usize) {
        let (link, sensed) = (&self.links[e], &self.sensed[e]);
        if self.bound.elements[e].n_states() == 0 {
            return;
        }
        self.motion.clear(columns);
        for (end, sign) in link.both() {
            let Some(dof) = end else { continue };
            self.motion.add(0, sign, &state.dq, dof);
            self.motion.add(1, sign, &state.dv, dof);
            self.motion.add(2, sign, &state.da, dof);
            self.motion.add(3, sign, &state.dq, dof);
            self.motion.add(3, -sign, &self.old.dq, dof);
        }
        self.motion.states(sensed, link.s0, &self.old.ds, &mut state.ds);
    }

    /// What the parameters of an element change of its states by themselves.
    #[inline(always)]
    fn follow_parameters(&self, e: usize, state: &mut State, columns: usize) {
        let (element, s0, sensed) = (&self.bound.elements[e], self.links[e].s0, &self.sensed[e]);
        if element.n_states() == 0 || !self.by_parameter {
            return;
        }
        for p in 0..element.chains.len() {
            for (theta, slope) in &element.chains[p] {
                for r in 0..element.n_states() {
                    state.ds[(s0 + r) * columns + theta] += sensed.params(1 + r)[p] * slope;
                }
            }
        }
    }

    /// Sensitivities of the states of an element of a model along one axis after a step.
    #[inline(always)]
    pub(super) fn follow_states(&mut self, e: usize, state: &mut State, columns: usize) {
        self.follow_motion(e, state, columns);
        self.follow_parameters(e, state, columns);
    }

    fn refresh_matrix(&mut self, spatial: Option<&Spatial>) {
        let rates = self.rates();
        self.matrix.clear();
        for (k, slot) in self.diagonal.iter().enumerate() {
            self.matrix.add_at(*slot, rates.a * self.mass[self.free_dofs[k]]);
        }
        if let Some(spatial) = spatial {
            return self.refresh_spatial(spatial);
        }
        for (link, sensed) in self.links.iter().zip(&self.sensed) {
            let d = sensed.inputs(0);
            let k = d[0] + rates.v * d[1] + rates.a * d[2] + d[3];
            add_link(&mut self.matrix, &link.slots, k);
        }
    }
}
