//! Direct differentiation of a step.

use super::super::EngineError;
use super::space::Spatial;
use super::{March, State, add_link};

impl March<'_> {
    /// Direct differentiation of the converged step. Columns beyond the free parameters are perturbations of the start.
    pub(super) fn sensitivities(&mut self, state: &mut State, columns: usize) -> Result<(), EngineError> {
        let spatial = self.spatial.take();
        let done = self.differentiate(spatial.as_ref(), state, columns);
        self.spatial = spatial;
        done
    }

    fn differentiate(&mut self, spatial: Option<&Spatial>, state: &mut State, columns: usize) -> Result<(), EngineError> {
        let (dt, alpha, n, ns) = (self.loads.dt, self.alpha, self.mass.len(), self.n_states);
        let rates = self.rates();
        let n_elements = self.bound.elements.len();
        // Parts of dw', dv', da' that do not depend on dq': stored where these will stand.
        for c in 0..columns {
            let base = c * n;
            for d in 0..n {
                let i = base + d;
                if self.prescribed_at[d].is_some() {
                    (state.dq[i], state.dw[i], state.dv[i], state.da[i]) = (0.0, 0.0, 0.0, 0.0);
                    continue;
                }
                let old = &self.old;
                (state.dw[i], state.dv[i], state.da[i]) = alpha.end(dt, 0.0, old.dq[i], old.dv[i], old.dw[i], old.da[i]);
                state.dq[i] = 0.0;
            }
        }
        // h: derivative of every element's force at held q'.
        self.h.clear();
        self.h.resize(columns * n_elements, 0.0);
        let acting = self.sensed.iter_mut().zip(&self.acts).filter(|(_, acts)| **acts);
        acting.for_each(|(sensed, _)| sensed.find_spans());
        for (e, element) in self.bound.elements.iter().enumerate().filter(|(e, _)| self.acts[*e]) {
            let (link, sensed) = (&self.links[e], &self.sensed[e]);
            let (d, n_s) = (sensed.inputs(0), element.n_states());
            for c in (0..columns).take_while(|_| spatial.is_none()) {
                let rel = |u: &[f64]| link.to.map_or(0.0, |k| u[c * n + k]) - link.from.map_or(0.0, |k| u[c * n + k]);
                let mut h = d[1] * rel(&state.dv) + d[2] * rel(&state.da) - d[3] * rel(&self.old.dq);
                h += sensed.along_states(0, &self.old.ds[c * ns + link.s0..c * ns + link.s0 + n_s]);
                self.h[c * n_elements + e] = h;
            }
            for (p, chain) in element.chains.iter().enumerate().filter(|_| self.by_parameter) {
                for (theta, slope) in chain {
                    self.h[theta * n_elements + e] += sensed.params(0)[p] * slope;
                }
            }
        }
        let n_free = self.free_dofs.len();
        if n_free > 0 {
            // The tangent of the last iteration may lag behind the converged point.
            self.refresh_matrix(spatial);
            self.matrix.factor()?;
            let mut rhs = std::mem::take(&mut self.rhs);
            rhs.resize(n_free * columns, 0.0);
            for c in 0..columns {
                for (i, &d) in self.free_dofs.iter().enumerate() {
                    let at = c * n + d;
                    rhs[c * n_free + i] = -self.mass[d] * state.da[at];
                }
                for (e, link) in self.links.iter().enumerate() {
                    let h = self.h[c * n_elements + e];
                    if let Some(i) = link.to.and_then(|d| self.free[d]) {
                        rhs[c * n_free + i] -= h;
                    }
                    if let Some(i) = link.from.and_then(|d| self.free[d]) {
                        rhs[c * n_free + i] += h;
                    }
                }
            }
            if let Some(spatial) = spatial {
                self.held_spatial(spatial, state, columns, &mut rhs);
            }
            self.matrix.solve(&mut rhs)?;
            for c in 0..columns {
                for (i, &d) in self.free_dofs.iter().enumerate() {
                    let x = rhs[c * n_free + i];
                    state.dq[c * n + d] = x;
                    state.dw[c * n + d] += rates.w * x;
                    state.dv[c * n + d] += rates.v * x;
                    state.da[c * n + d] += rates.a * x;
                }
            }
            rhs.resize(n_free, 0.0);
            self.rhs = rhs;
        } else if let Some(at) = spatial {
            self.refresh_matrix(spatial);
            self.held_spatial(at, state, columns, &mut []);
        }
        for c in 0..columns {
            (0..n).for_each(|d| state.dg[c * n + d] = self.mass[d] * state.da[c * n + d]);
        }
        if let Some(spatial) = spatial {
            self.follow_spatial(spatial, state, columns);
        }
        for (e, element) in self.bound.elements.iter().enumerate().filter(|(e, _)| self.acts[*e]) {
            let (link, sensed) = (&self.links[e], &self.sensed[e]);
            let n_s = element.n_states();
            let k = {
                let d = sensed.inputs(0);
                d[0] + rates.v * d[1] + rates.a * d[2] + d[3]
            };
            for c in (0..columns).take_while(|_| spatial.is_none()) {
                let rel = |u: &[f64]| link.to.map_or(0.0, |d| u[c * n + d]) - link.from.map_or(0.0, |d| u[c * n + d]);
                let dx = rel(&state.dq);
                let df = self.h[c * n_elements + e] + k * dx;
                self.h[c * n_elements + e] = df;
                if let Some(d) = link.to {
                    state.dg[c * n + d] += df;
                }
                if let Some(d) = link.from {
                    state.dg[c * n + d] -= df;
                }
                if n_s > 0 {
                    let (dv, da, step) = (rel(&state.dv), rel(&state.da), dx - rel(&self.old.dq));
                    let old = &self.old.ds[c * ns + link.s0..c * ns + link.s0 + n_s];
                    for r in 0..n_s {
                        let d = sensed.inputs(1 + r);
                        state.ds[c * ns + link.s0 + r] = d[0] * dx + d[1] * dv + d[2] * da + d[3] * step + sensed.along_states(1 + r, old);
                    }
                }
            }
            for (p, chain) in element.chains.iter().enumerate().filter(|_| n_s > 0 && self.by_parameter) {
                for (theta, slope) in chain {
                    for r in 0..n_s {
                        state.ds[theta * ns + link.s0 + r] += sensed.params(1 + r)[p] * slope;
                    }
                }
            }
        }
        Ok(())
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
