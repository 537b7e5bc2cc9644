//! What is observed of a march.

use super::{March, State};

/// What is observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probe {
    /// Displacement of a degree of freedom.
    Dof(usize),
    /// Relative displacement of a place.
    Relative(usize),
    /// Force of a place's element.
    Force(usize),
    /// Force that holds a prescribed degree of freedom, inertia included.
    Reaction(usize),
}

impl March<'_> {
    /// What a probe reads after a step, with its sensitivities written to `d` (one per column).
    pub fn read(&self, probe: Probe, state: &State, d: &mut [f64]) -> f64 {
        let (n, n_elements) = (self.mass.len(), self.links.len());
        match probe {
            Probe::Dof(dof) => {
                d.iter_mut().enumerate().for_each(|(c, out)| *out = state.dq[c * n + dof]);
                state.q[dof]
            }
            Probe::Relative(place) => {
                if let Some(spatial) = &self.spatial {
                    let (connector, axis) = self.places[place];
                    return self.read_relative(spatial, connector, axis, state, d);
                }
                let Some(e) = self.bound.elements.iter().position(|e| e.place == place) else { return 0.0 };
                let link = &self.links[e];
                let rel = |u: &[f64], c: usize| link.to.map_or(0.0, |k| u[c * n + k]) - link.from.map_or(0.0, |k| u[c * n + k]);
                d.iter_mut().enumerate().for_each(|(c, out)| *out = rel(&state.dq, c));
                rel(&state.q, 0)
            }
            Probe::Force(place) => {
                let Some(e) = self.bound.elements.iter().position(|e| e.place == place) else { return 0.0 };
                d.iter_mut().enumerate().for_each(|(c, out)| *out = self.h[c * n_elements + e]);
                self.forces[e]
            }
            Probe::Reaction(dof) => {
                d.iter_mut().enumerate().for_each(|(c, out)| *out = state.dg[c * n + dof]);
                state.g[dof]
            }
        }
    }
}
