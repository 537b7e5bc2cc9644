//! Equilibrium along the loading path of the loads that stay: the operating point of small motion and the start of transients.
//!
//! From rest every load passes through its declared values in steps. Each step is one of [`March::quasi_static`]: Newton's method with
//! the exact tangent, states of friction carried from step to step, sensitivities by direct differentiation of every step. What creeps
//! (a Maxwell branch) has settled at the end of each step. A constant force of a connector acts from the first step on.

use crate::model::{Bound, Element, Model};

use super::EngineError;
use super::blocktri::BlockTriError;
use super::march::{Loads, March, State};

/// The state under the loads that stay.
pub struct Equilibrium {
    /// Coordinates and states, with their sensitivities.
    pub state: State,
    /// Force of each element.
    pub elements: Vec<f64>,
    /// Their sensitivities, `d_elements[e * columns + column]`.
    pub d_elements: Vec<f64>,
}

/// Length of a step [s]: long against every relaxation.
const SETTLED: f64 = 1e4;
/// Steps at the end in which nothing changes any more, for laws that look back over steps.
const HOLD: usize = 2;
/// How often the steps are halved where one of them fails.
const HALVINGS: usize = 5;

/// The state under the loads that stay and the constant forces of connectors, with `columns` sensitivities; `None` where there are none.
/// Without loads that stay, the degrees of freedom in `held` stand at the values given; under loads the whole structure is free, as it is
/// where the loads are put on.
///
/// # Errors
/// [`EngineError::NoEquilibrium`] where Newton's method fails at every step length (a load beyond a limit point), and
/// [`EngineError::Unstable`] where the tangent is not that of a stable equilibrium: a buckled chain, a support that has lifted off.
pub fn equilibrium(model: &Model, bound: &Bound, held: &[(usize, f64)], columns: usize) -> Result<Option<Equilibrium>, EngineError> {
    if bound.loads.is_empty() && !bound.elements.iter().any(Element::presses) {
        return Ok(None);
    }
    let mut failure = None;
    for halving in 0..=HALVINGS {
        match follow(model, bound, held, columns, 1 << halving) {
            Ok(state) => return Ok(Some(state)),
            Err(e @ (EngineError::NoEquilibrium { .. } | EngineError::NotFinite { .. })) => failure = Some(e),
            Err(e) => return Err(e),
        }
    }
    Err(failure.unwrap_or(EngineError::NotFinite { step: 0 }))
}

fn follow(model: &Model, bound: &Bound, held: &[(usize, f64)], columns: usize, finer: usize) -> Result<Equilibrium, EngineError> {
    let loads = path(bound, held, finer);
    let steps = loads.forces.first().map_or(HOLD, |f| f.1.len().saturating_sub(1));
    let mut march = March::quasi_static(model, bound, &loads)?;
    let mut state = march.rest(columns);
    // Without prescribed degrees of freedom the march numbers them as the model does.
    let unstable = |step: usize, dof: usize| EngineError::Unstable { step, steps, dof: model.dof_name(dof.min(model.dofs.len() - 1)) };
    for k in 1..=steps {
        march.step(k, &mut state, columns).map_err(|e| match e {
            EngineError::Linear(BlockTriError::Singular { dof, .. }) => unstable(k, dof),
            e => e,
        })?;
    }
    if let Some(dof) = march.unstable(&mut state)? {
        return Err(unstable(steps, dof));
    }
    let (elements, d_elements) = march.element_forces(columns);
    Ok(Equilibrium { state, elements, d_elements })
}

/// The loads as sampled paths, all passing through their values together.
fn path(bound: &Bound, held: &[(usize, f64)], finer: usize) -> Loads {
    let stages = bound.loads.iter().map(|l| l.path.len()).max().unwrap_or(0);
    let per_stage = bound.loads.iter().map(|l| l.steps).max().unwrap_or(1).max(1) * finer;
    let forces = bound.loads.iter().map(|l| {
        let level = |stage: usize| match stage {
            0 => 0.0,
            s => l.path.get(s - 1).or(l.path.last()).copied().unwrap_or(0.0),
        };
        let values = (0..=stages * per_stage).map(|k| {
            let (stage, part) = (k / per_stage, (k % per_stage) as f64 / per_stage as f64);
            if part == 0.0 { level(stage) } else { level(stage) + part * (level(stage + 1) - level(stage)) }
        });
        (l.dof, values.chain([level(stages); HOLD]).collect())
    });
    let held = if bound.loads.is_empty() { held } else { &[] };
    let prescribed = held.iter().map(|(dof, x)| (*dof, vec![[*x, 0.0, 0.0]; HOLD + 1])).collect();
    Loads { dt: SETTLED, prescribed, forces: forces.collect() }
}
