//! Direct differentiation of a step.

use super::super::EngineError;
use super::{March, State};

impl March<'_> {
    /// Direct differentiation of the converged step. Columns beyond the free parameters are perturbations of the start.
    pub(super) fn sensitivities(&mut self, state: &mut State, columns: usize) -> Result<(), EngineError> {
        let (dt, alpha, n, ns) = (self.loads.dt, self.alpha, self.mass.len(), self.n_states);
        let (big_a, big_v) = (1.0 / (alpha.beta * dt * dt), alpha.gamma / (alpha.beta * dt));
        let n_elements = self.bound.elements.len();
        // Parts of dv', da' that do not depend on dq': stored where dv', da' will stand.
        for c in 0..columns {
            let base = c * n;
            for d in 0..n {
                let i = base + d;
                if self.prescribed_at[d].is_some() {
                    (state.dq[i], state.dv[i], state.da[i]) = (0.0, 0.0, 0.0);
                    continue;
                }
                let (q, v, a) = (self.old.dq[i], self.old.dv[i], self.old.da[i]);
                let at = -big_a * (q + dt * v) - (0.5 / alpha.beta - 1.0) * a;
                state.da[i] = at;
                state.dv[i] = v + dt * ((1.0 - alpha.gamma) * a + alpha.gamma * at);
                state.dq[i] = 0.0;
            }
        }
        // h: derivative of every element's force at held q'.
        self.h.clear();
        self.h.resize(columns * n_elements, 0.0);
        for (e, element) in self.bound.elements.iter().enumerate() {
            let (link, sensed) = (&self.links[e], &self.sensed[e]);
            let (d, by_state) = (sensed.inputs(0), sensed.states(0));
            for c in 0..columns {
                let rel = |u: &[f64]| link.to.map_or(0.0, |k| u[c * n + k]) - link.from.map_or(0.0, |k| u[c * n + k]);
                let mut h = d[1] * rel(&state.dv) + d[2] * rel(&state.da) - d[3] * rel(&self.old.dq);
                let old = &self.old.ds[c * ns + link.s0..c * ns + link.s0 + by_state.len()];
                h += by_state.iter().zip(old).map(|(a, b)| a * b).sum::<f64>();
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
            self.refresh_matrix(big_a, big_v);
            self.matrix.factor()?;
            let mut rhs = std::mem::take(&mut self.rhs);
            rhs.resize(n_free * columns, 0.0);
            for c in 0..columns {
                for (i, &d) in self.free_dofs.iter().enumerate() {
                    let at = c * n + d;
                    rhs[c * n_free + i] =
                        -(self.mass[d] * ((1.0 - alpha.m) * state.da[at] + alpha.m * self.old.da[at]) + alpha.f * self.old.dg[at]);
                }
                for (e, link) in self.links.iter().enumerate() {
                    let h = (1.0 - alpha.f) * self.h[c * n_elements + e];
                    if let Some(i) = link.to.and_then(|d| self.free[d]) {
                        rhs[c * n_free + i] -= h;
                    }
                    if let Some(i) = link.from.and_then(|d| self.free[d]) {
                        rhs[c * n_free + i] += h;
                    }
                }
            }
            self.matrix.solve(&mut rhs)?;
            for c in 0..columns {
                for (i, &d) in self.free_dofs.iter().enumerate() {
                    let x = rhs[c * n_free + i];
                    state.dq[c * n + d] = x;
                    state.dv[c * n + d] += big_v * x;
                    state.da[c * n + d] += big_a * x;
                }
            }
            rhs.resize(n_free, 0.0);
            self.rhs = rhs;
        }
        state.dg.fill(0.0);
        for (e, element) in self.bound.elements.iter().enumerate() {
            let (link, sensed) = (&self.links[e], &self.sensed[e]);
            let n_s = element.n_states();
            let k = {
                let d = sensed.inputs(0);
                d[0] + big_v * d[1] + big_a * d[2] + d[3]
            };
            for c in 0..columns {
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
                        state.ds[c * ns + link.s0 + r] = d[0] * dx
                            + d[1] * dv
                            + d[2] * da
                            + d[3] * step
                            + sensed.states(1 + r).iter().zip(old).map(|(a, b)| a * b).sum::<f64>();
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

    fn refresh_matrix(&mut self, big_a: f64, big_v: f64) {
        self.matrix.clear();
        let weight = (1.0 - self.alpha.m) * big_a;
        for (k, slot) in self.diagonal.iter().enumerate() {
            self.matrix.add_at(*slot, weight * self.mass[self.free_dofs[k]]);
        }
        for (link, sensed) in self.links.iter().zip(&self.sensed) {
            let d = sensed.inputs(0);
            let k = (1.0 - self.alpha.f) * (d[0] + big_v * d[1] + big_a * d[2] + d[3]);
            for (slot, value) in link.slots.iter().zip([k, k, -k, -k]) {
                if let Some(slot) = slot {
                    self.matrix.add_at(*slot, value);
                }
            }
        }
    }
}
