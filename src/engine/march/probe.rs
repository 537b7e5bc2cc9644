//! What is observed of a march.

use super::sensitivities::add_row;
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
        let columns = d.len();
        let row = |u: &[f64], k: usize, d: &mut [f64]| d.copy_from_slice(&u[k * columns..(k + 1) * columns]);
        match probe {
            Probe::Dof(dof) => {
                row(&state.dq, dof, d);
                state.q[dof]
            }
            Probe::Relative(place) => {
                if let Some(spatial) = &self.spatial {
                    let (connector, axis) = self.places[place];
                    return self.read_relative(spatial, connector, axis, state, d);
                }
                let Some(e) = self.bound.elements.iter().position(|e| e.place == place) else { return 0.0 };
                let link = &self.links[e];
                d.fill(0.0);
                link.ends().for_each(|(dof, sign)| add_row(d, sign, &state.dq, dof));
                self.relative(e, &state.q)
            }
            Probe::Force(place) => {
                let Some(e) = self.bound.elements.iter().position(|e| e.place == place) else { return 0.0 };
                row(&self.h, e, d);
                self.forces[e]
            }
            Probe::Reaction(dof) => {
                row(&state.dg, dof, d);
                state.g[dof]
            }
        }
    }
}
