//! Steps without inertia, and what an equilibrium is asked for.

use crate::model::{Bound, Model};

use super::super::EngineError;
use super::super::blocktri::BlockTriError;
use super::super::equilibrium::Equilibrium;
use super::{Loads, March, Stage, State};

impl<'a> March<'a> {
    /// Prepares steps without inertia and velocity along a loading path: `loads` holds all that acts, those of the model that stay
    /// included.
    pub fn quasi_static(model: &Model, bound: &'a Bound, loads: &'a Loads) -> Result<Self, EngineError> {
        let mut march = March::loading(model, bound, loads, 1.0)?;
        march.alpha.still = true;
        Ok(march)
    }

    /// Takes what acts at these connectors away; the matrix keeps its form.
    pub(super) fn leave_out(&mut self, connectors: &[usize], model: &Model) {
        for (acts, element) in self.acts.iter_mut().zip(&self.bound.elements) {
            *acts &= !connectors.contains(&model.places[element.place].connector);
        }
        if let Some(spatial) = &mut self.spatial {
            let acts = &self.acts;
            spatial.joints.iter_mut().for_each(|work| work.joint.elements.retain(|(e, _)| acts[*e]));
        }
    }

    /// A march whose `loads` hold all that acts, those that stay included.
    pub(in crate::engine) fn loading(model: &Model, bound: &'a Bound, loads: &'a Loads, radius: f64) -> Result<Self, EngineError> {
        let mut march = March::new(model, bound, loads, radius)?;
        march.constant.clear();
        Ok(march)
    }

    /// Rest in an equilibrium, at step 0 of the loads for what is prescribed; without one, [`March::rest`].
    pub fn start(&self, equilibrium: Option<Equilibrium>, columns: usize) -> State {
        let mut state = self.rest(columns);
        if let Some(Equilibrium { state: at, .. }) = equilibrium {
            (state.q, state.s, state.dq, state.ds) = (at.q, at.s, at.dq, at.ds);
            for (dof, path) in &self.loads.prescribed {
                state.q[*dof] = path[0][0];
                state.dq[dof * columns..(dof + 1) * columns].fill(0.0);
            }
        }
        state
    }

    /// A degree of freedom that moves most in an unstable direction of a quasi-static equilibrium; `None` where none is found. An odd
    /// number of unstable directions is found: the first one that a rising load brings.
    pub fn unstable(&mut self, state: &mut State) -> Result<Option<usize>, EngineError> {
        let mut force = std::mem::take(&mut self.force);
        self.old.clone_from(state);
        if let Some(spatial) = &mut self.spatial {
            spatial.begin(&self.old);
        }
        self.internal(state, Stage::Newton, &mut force);
        self.force = force;
        match self.matrix.factor() {
            Ok(weakest) => Ok((self.matrix.determinant_sign() < 0.0).then(|| self.free_dofs[weakest.dof])),
            Err(BlockTriError::Singular { dof, .. }) => Ok(Some(self.free_dofs[dof])),
            Err(e) => Err(e.into()),
        }
    }

    /// Force of every element after a step, and its sensitivities (a row for every element).
    pub(in crate::engine) fn element_forces(&self, columns: usize) -> (Vec<f64>, Vec<f64>) {
        (self.forces.clone(), self.h[..columns * self.forces.len()].to_vec())
    }
}
