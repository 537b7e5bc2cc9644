//! What is observed of a march.

use super::sensitivities::add_row;
use super::{March, State};

/// What is observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probe {
    /// Displacement of a degree of freedom.
    Dof(usize),
    /// Its velocity.
    Velocity(usize),
    /// Its acceleration.
    Acceleration(usize),
    /// Relative displacement of a place.
    Relative(usize),
    /// Relative velocity of a place between parts that do not turn.
    RelativeVelocity(usize),
    /// Relative acceleration of the same.
    RelativeAcceleration(usize),
    /// Force of a place's element.
    Force(usize),
    /// Force that holds a prescribed degree of freedom, inertia included.
    Reaction(usize),
}

impl Probe {
    /// Whether it is read from displacements and velocities alone, before a step as after it.
    pub fn of_state(self) -> bool {
        matches!(self, Probe::Dof(_) | Probe::Velocity(_) | Probe::Relative(_) | Probe::RelativeVelocity(_))
    }
}

impl March<'_> {
    /// What a probe reads after a step, with its sensitivities written to `d` (one per column).
    pub fn read(&self, probe: Probe, state: &State, d: &mut [f64]) -> f64 {
        let columns = d.len();
        let row = |u: &[f64], k: usize, d: &mut [f64]| d.copy_from_slice(&u[k * columns..(k + 1) * columns]);
        let mut across = |place: usize, u: &[f64], du: &[f64]| {
            let Some(e) = self.bound.elements.iter().position(|e| e.place == place) else { return 0.0 };
            d.fill(0.0);
            self.links[e].ends().for_each(|(dof, sign)| add_row(d, sign, du, dof));
            self.relative(e, u)
        };
        match probe {
            Probe::Dof(dof) => {
                row(&state.dq, dof, d);
                state.q[dof]
            }
            Probe::Velocity(dof) => {
                row(&state.dv, dof, d);
                state.v[dof]
            }
            Probe::Acceleration(dof) => {
                row(&state.da, dof, d);
                state.a[dof]
            }
            Probe::RelativeVelocity(place) => across(place, &state.v, &state.dv),
            Probe::RelativeAcceleration(place) => across(place, &state.a, &state.da),
            Probe::Relative(place) => {
                if let Some(spatial) = &self.spatial {
                    let (connector, axis) = self.places[place];
                    return self.read_relative(spatial, connector, axis, state, d);
                }
                across(place, &state.q, &state.dq)
            }
            Probe::Force(place) => {
                let Some(e) = self.bound.elements.iter().position(|e| e.place == place) else { return 0.0 };
                match &self.exact {
                    Some(exact) => exact.force_slopes(self, e, state, d),
                    None => row(&self.h, e, d),
                }
                self.forces[e]
            }
            Probe::Reaction(dof) => {
                row(&state.dg, dof, d);
                state.g[dof]
            }
        }
    }
}
