//! Implicit time integration of `M a + F(x, v, a; states) = f(t)` with direct differentiation.
//!
//! Generalised-alpha method (Chung and Hulbert, J. Appl. Mech. 60, 1993) in the form of Arnold and Bruels (Multibody Syst. Dyn. 18,
//! 2007): the equations of motion hold at the end of every step, and an auxiliary acceleration carries the weights, so that it stays of
//! second order where the inertia depends on the position. The damping of the highest frequencies is set by its spectral radius; the
//! constitutive updates of the elements take the motion at the end of the step. At each step the displacements follow from Newton's
//! method with the exact tangent, block tridiagonal; afterwards every sensitivity costs one more back-substitution with the same
//! tangent. Prescribed degrees of freedom enter with given displacement, velocity, acceleration.
//!
//! Without inertia and velocities ([`March::quasi_static`]) the same steps follow an equilibrium along a loading path.

use std::sync::Arc;

use crate::effect::Inputs;
use crate::model::{Bound, Depth, ElementScratch, Model, Sensed};

use super::EngineError;
use super::blocktri::{BlockTri, Layout, Levels};
use super::spatial::{self, Joint};

mod broyden;
mod effort;
mod exact;
mod kept;
mod link;
mod method;
mod probe;
mod sensitivities;
mod space;
mod state;
mod statics;
mod trend;

use broyden::Broyden;
use link::{Link, add_link};
use method::{Alpha, Rates};
pub use probe::Probe;
use sensitivities::Motion;
use space::Spatial;
pub use state::State;
use trend::Trend;

/// What drives the structure, sampled at the ends of the steps (index 0: the start).
#[derive(Clone, Debug, Default)]
pub struct Loads {
    /// Step length [s].
    pub dt: f64,
    /// Degrees of freedom with given displacement, velocity and acceleration.
    pub prescribed: Vec<(usize, Vec<[f64; 3]>)>,
    /// External general forces [N or N m].
    pub forces: Vec<(usize, Vec<f64>)>,
}

impl Loads {
    /// Number of steps.
    fn steps(&self) -> usize {
        self.prescribed.first().map(|p| p.1.len()).or(self.forces.first().map(|f| f.1.len())).unwrap_or(1) - 1
    }
}

/// The march of one model under one set of loads.
pub struct March<'a> {
    bound: &'a Bound,
    loads: &'a Loads,
    /// Length of the step at hand [s].
    dt: f64,
    mass: Vec<f64>,
    /// Index among the free degrees of freedom; `None` where prescribed.
    free: Vec<Option<usize>>,
    free_dofs: Vec<usize>,
    prescribed_at: Vec<Option<usize>>,
    links: Vec<Link>,
    spatial: Option<Spatial>,
    /// All connectors of a spatial model, for readings.
    connectors: Vec<Joint>,
    /// Connector and axis of every place of a spatial model.
    places: Vec<(usize, usize)>,
    /// Loads that stay.
    constant: Vec<(usize, f64)>,
    diagonal: Vec<usize>,
    matrix: BlockTri<f64>,
    alpha: Alpha,
    broyden: Broyden,
    scratch: ElementScratch,
    sensed: Vec<Sensed>,
    /// Derivatives of every element's force with respect to the coordinates of its connector, of a spatial model.
    rows: Vec<[f64; 12]>,
    /// Elements that act; those that are attached under load do not, they are for small motion about it.
    acts: Vec<bool>,
    n_states: usize,
    n_follower_states: usize,
    /// Whether the first columns are the free parameters; otherwise all are perturbations of the start.
    pub(super) by_parameter: bool,
    /// Whether sensitivities of more than displacements and velocities are read; exact steps leave the others out where not.
    pub reads_beyond_state: bool,
    // Working vectors.
    old: State,
    new_s: Vec<f64>,
    rhs: Vec<f64>,
    external: Vec<f64>,
    force: Vec<f64>,
    h: Vec<f64>,
    motion: Motion,
    forces: Vec<f64>,
    base: Vec<f64>,
    newton: Vec<f64>,
    scale: f64,
    /// Residual over the forces present below which a step has converged.
    enough: f64,
    /// Whether the factors at hand are taken again.
    keep: bool,
    kept: kept::Kept,
    trend: Trend,
    /// What exact steps need, of a march of these.
    exact: Option<Box<exact::Exact>>,
    /// What hard steps have taken so far.
    effort: effort::Effort,
}

/// Residual over the forces present at which a step that does not get closer stands, and the iterations after which it has not: very stiff
/// links under small loads leave their rounding.
const ACCEPTED: f64 = 1e-8;
const HOVERS: usize = 20;
/// Residual over the forces present at which a step has converged, and below which one that no longer falls has: what it stands at is rounding. The steps that follow are taken for converged
/// below twice that, as long as it is no more than the last of these: each would spend an evaluation on seeing the same again.
const CONVERGED: f64 = 1e-13;
const FLAT: f64 = 1e-10;
const ROUNDED: f64 = 2.0;
const EXACT: f64 = 1e-12;
/// Newton steps of a spatial model that are taken whole although the residual rises.
const PATIENCE: usize = 30;
/// Fall of the residual per iteration at which kept factors no longer serve.
const SLOW: f64 = 0.1;
/// Shortest part of a Newton step.
const SHORTEST: f64 = 1e-4;

impl<'a> March<'a> {
    /// Prepares a march; `radius` is the spectral radius at infinite frequency (0: strongest damping of what is not resolved, 1: none).
    pub fn new(model: &Model, bound: &'a Bound, loads: &'a Loads, radius: f64) -> Result<Self, EngineError> {
        let n = model.dofs.len();
        let mut prescribed_at = vec![None; n];
        for (k, (dof, _)) in loads.prescribed.iter().enumerate() {
            prescribed_at[*dof] = Some(k);
        }
        let free_dofs: Vec<usize> = (0..n).filter(|d| prescribed_at[*d].is_none()).collect();
        let mut free = vec![None; n];
        free_dofs.iter().enumerate().for_each(|(k, d)| free[*d] = Some(k));
        let joints = Spatial::joints(model, bound);
        let both = |(i, j): (usize, usize)| Some((free[i]?, free[j]?));
        let coupled = model.space.iter().flat_map(|space| spatial::pairs(&joints, space)).filter_map(both);
        let pairs: Vec<(usize, usize)> = bound
            .elements
            .iter()
            .filter_map(|e| Some((free[e.to?]?, free[e.from?]?)))
            .chain((0..free_dofs.len()).map(|k| (k, k)))
            .chain(coupled)
            .collect();
        let layout = Arc::new(Layout::new(Levels::new(free_dofs.len(), &pairs)?));
        let (mut s0, mut fs0) = (0, 0);
        let mut links = Vec::with_capacity(bound.elements.len());
        for e in &bound.elements {
            let (t, f) = (e.to.and_then(|d| free[d]), e.from.and_then(|d| free[d]));
            let slot = |i: Option<usize>, j: Option<usize>| match (i, j) {
                (Some(i), Some(j)) => layout.slot(i, j).map(Some),
                _ => Ok(None),
            };
            links.push(Link { to: e.to, from: e.from, s0, fs0, slots: [slot(t, t)?, slot(f, f)?, slot(t, f)?, slot(f, t)?] });
            s0 += e.n_states();
            fs0 += e.n_follower_states();
        }
        let diagonal = (0..free_dofs.len()).map(|k| layout.slot(k, k)).collect::<Result<_, _>>()?;
        let connectors =
            model.space.iter().flat_map(|space| (0..model.connectors.len()).map(|c| spatial::joint(model, space, c))).collect();
        let places = model.space.iter().flat_map(|_| model.places.iter().map(|p| (p.connector, p.axis as usize))).collect();
        let mut march = March {
            bound,
            loads,
            dt: loads.dt,
            // The inertia of parts that turn depends on where they are.
            mass: model.dofs.iter().map(|d| if model.space.is_some() { 0.0 } else { d.mass }).collect(),
            spatial: Spatial::new(model, bound, joints, &layout, &free)?,
            connectors,
            places,
            constant: bound.loads.iter().filter_map(|l| Some((l.dof, *l.path.last()?))).collect(),
            matrix: BlockTri::new(layout),
            free,
            rhs: vec![0.0; free_dofs.len()],
            base: vec![0.0; free_dofs.len()],
            newton: vec![0.0; free_dofs.len()],
            free_dofs,
            prescribed_at,
            links,
            diagonal,
            alpha: Alpha::new(radius),
            broyden: Broyden::default(),
            scratch: ElementScratch::default(),
            sensed: bound.elements.iter().map(|_| Sensed::default()).collect(),
            rows: vec![[0.0; 12]; bound.elements.len()],
            acts: vec![true; bound.elements.len()],
            n_states: s0,
            n_follower_states: fs0,
            by_parameter: true,
            reads_beyond_state: true,
            old: State::default(),
            new_s: vec![0.0; s0],
            external: vec![0.0; n],
            force: vec![0.0; n],
            h: vec![],
            motion: Motion::default(),
            forces: vec![0.0; bound.elements.len()],
            scale: 0.0,
            enough: CONVERGED,
            keep: false,
            kept: kept::Kept::default(),
            trend: Trend::new(n),
            exact: None,
            effort: effort::Effort::default(),
        };
        march.leave_out(&model.attached, model);
        Ok(march)
    }

    fn rates(&self) -> Rates {
        self.alpha.rates(self.dt)
    }

    /// Rest, at step 0 of the loads for what is prescribed, with `columns` sensitivities of zero.
    pub fn rest(&self, columns: usize) -> State {
        let n = self.mass.len();
        let mut state = State {
            q: vec![0.0; n],
            v: vec![0.0; n],
            a: vec![0.0; n],
            s: vec![0.0; self.n_states],
            fs: vec![0.0; self.n_follower_states],
            w: vec![0.0; n],
            g: vec![0.0; n],
            ..State::default()
        };
        self.set_columns(&mut state, columns);
        for (dof, path) in &self.loads.prescribed {
            (state.q[*dof], state.v[*dof], state.a[*dof]) = (path[0][0], path[0][1], path[0][2]);
        }
        state
    }

    /// Zeroes the sensitivities and sets their number.
    pub fn set_columns(&self, state: &mut State, columns: usize) {
        let n = self.mass.len();
        for (vector, len) in [&mut state.dq, &mut state.dv, &mut state.da, &mut state.dw, &mut state.dg]
            .map(|u| (u, n))
            .into_iter()
            .chain([(&mut state.ds, self.n_states)])
        {
            vector.clear();
            vector.resize(len * columns, 0.0);
        }
    }

    /// Degrees of freedom that are not prescribed.
    pub fn free_dofs(&self) -> &[usize] {
        &self.free_dofs
    }

    fn relative(&self, e: usize, u: &[f64]) -> f64 {
        let link = &self.links[e];
        link.to.map_or(0.0, |d| u[d]) - link.from.map_or(0.0, |d| u[d])
    }

    /// Sums the elements at trial motion `q, v, a` into the internal forces; with `newton` also the tangent matrix.
    fn internal(&mut self, state: &mut State, stage: Stage, force: &mut [f64]) -> f64 {
        let (dt, rates) = (self.dt, self.rates());
        force.fill(0.0);
        let mut scale = 0.0;
        self.new_s.copy_from_slice(&self.old.s);
        if stage == Stage::Newton {
            self.matrix.clear();
            for (k, slot) in self.diagonal.iter().enumerate() {
                self.matrix.add_at(*slot, rates.a * self.mass[self.free_dofs[k]]);
            }
        }
        if let Some(mut spatial) = self.spatial.take() {
            scale = self.internal_spatial(&mut spatial, state, stage, force);
            self.spatial = Some(spatial);
            return scale;
        }
        for (e, element) in self.bound.elements.iter().enumerate() {
            let x = self.relative(e, &state.q);
            let u = Inputs { x, v: self.relative(e, &state.v), a: self.relative(e, &state.a), dx: x - self.relative(e, &self.old.q) };
            let link = &self.links[e];
            let s = &mut self.new_s[link.s0..link.s0 + element.n_states()];
            let fs = &mut state.fs[link.fs0..link.fs0 + element.n_follower_states()];
            let f = if stage.values() {
                element.value(&u, dt, s, &mut self.scratch)
            } else {
                let out = &mut self.sensed[e];
                element.tangent(&u, dt, s, fs, stage.depth(), out, &mut self.scratch);
                out.f
            };
            scale += f.abs();
            self.forces[e] = f;
            if let Some(d) = link.to {
                force[d] += f;
            }
            if let Some(d) = link.from {
                force[d] -= f;
            }
            if stage == Stage::Newton {
                let d = self.sensed[e].inputs(0);
                let k = d[0] + rates.v * d[1] + rates.a * d[2] + d[3];
                add_link(&mut self.matrix, &link.slots, k);
            }
        }
        scale
    }

    /// The loads at the part `to` of the way to those at index `k`, and the prescribed motion there into the state.
    fn load(&mut self, k: usize, to: f64, state: &mut State) {
        let along = |before: f64, after: f64| if to < 1.0 { before + to * (after - before) } else { after };
        self.external.fill(0.0);
        for (dof, f) in &self.constant {
            self.external[*dof] += f;
        }
        for (dof, path) in &self.loads.forces {
            self.external[*dof] += along(path[k - 1], path[k]);
        }
        for (dof, path) in &self.loads.prescribed {
            let [q, v, a] = [0, 1, 2].map(|i| along(path[k - 1][i], path[k][i]));
            (state.q[*dof], state.v[*dof], state.a[*dof]) = (q, v, a);
        }
    }

    /// A step of `self.dt` that ends at the part `to` of the way to the loads at index `k`.
    fn advance(&mut self, k: usize, to: f64, state: &mut State, columns: usize, force: &mut [f64]) -> Result<(), EngineError> {
        let (dt, alpha, rates, n) = (self.dt, self.alpha, self.rates(), self.mass.len());
        let moving = self.spatial.is_some() && !alpha.still;
        if moving {
            self.trend.follow(dt, &self.old.w, &state.w);
        }
        self.uniform_history(state, columns);
        self.old.clone_from(state);
        if let Some(spatial) = &mut self.spatial {
            spatial.begin(&self.old);
        }
        self.load(k, to, state);
        let update = |state: &mut State, old: &State, dofs: &[usize]| {
            for &d in dofs {
                (state.w[d], state.v[d], state.a[d]) = alpha.end(dt, state.q[d], old.q[d], old.v[d], old.w[d], old.a[d]);
            }
        };
        let n_free = self.free_dofs.len();
        let (mut converged, mut at_end) = (false, false);
        if n_free > 0 {
            // A stiff link feels the second order of a prediction.
            let (second, third) = if moving { (0.5 * dt * dt, 1.0 / rates.w) } else { (0.0, 0.0) };
            for &d in &self.free_dofs {
                state.q[d] += dt * state.v[d] + second * state.w[d] + third * self.trend.of(d);
            }
            update(state, &self.old, &self.free_dofs);
            let (mut base_norm, mut factor) = (f64::INFINITY, 1.0);
            let mut last = (f64::INFINITY, f64::INFINITY);
            // Bending a chain of stiff links strains them to second order: the residual may rise far before it falls.
            let patience = if self.spatial.is_some() { PATIENCE } else { 0 };
            self.keep &= patience > 0;
            let mut evaluations = 0;
            self.broyden.clear();
            for iteration in 0.. {
                if !self.effort.goes_on(iteration) {
                    break;
                }
                // Factors are kept from step to step while they serve.
                let stage = if self.keep { Stage::Value } else { Stage::Newton };
                let mut scale = self.internal(state, stage, force);
                evaluations += 1;
                let mut norm = 0.0f64;
                for (i, &d) in self.free_dofs.iter().enumerate() {
                    let inertia = self.mass[d] * state.a[d];
                    let r = inertia + force[d] - self.external[d];
                    scale += inertia.abs() + self.external[d].abs();
                    norm = norm.max(r.abs());
                    self.rhs[i] = -r;
                }
                if !norm.is_finite() {
                    return Err(EngineError::NotFinite { step: k });
                }
                // What a stiff link carries in passing is no measure of the forces present.
                self.scale = if patience > 0 { scale } else { self.scale.max(scale) };
                last = (norm, self.scale);
                if norm <= self.enough * self.scale || norm == 0.0 {
                    (converged, at_end) = (true, true);
                    break;
                }
                // A residual that no longer falls at rounding level is as good as it gets.
                let level = if self.keep { SLOW * base_norm } else { base_norm };
                let hovers = iteration >= HOVERS && norm <= ACCEPTED * self.scale;
                let flat = norm >= level && norm <= FLAT * self.scale;
                if flat || hovers {
                    if flat && norm <= EXACT * self.scale {
                        self.enough = ROUNDED * norm / self.scale;
                    }
                    (converged, at_end) = (true, true);
                    break;
                }
                // A residual that falls as it fell before is converged after the next iteration. Where a look at all parts is what an iteration costs, that one is
                // not looked at again, if what is left is next to nothing: forces that neither a state nor a reaction asks for stay what they are here.
                let falls = self.spatial.is_some() && factor == 1.0 && base_norm.is_finite() && norm < SLOW * base_norm;
                converged = falls && norm <= FLAT * self.scale && norm * (norm / base_norm) <= self.enough * self.scale;
                if self.keep && (norm >= level || iteration >= patience) {
                    self.keep = false;
                    continue;
                }
                if norm < base_norm || factor < SHORTEST || iteration < patience {
                    base_norm = norm;
                    factor = 1.0;
                    for (i, &d) in self.free_dofs.iter().enumerate() {
                        self.base[i] = state.q[d];
                    }
                    if !self.keep {
                        self.broyden.clear();
                        self.matrix.factor()?;
                        self.kept.renew();
                        self.keep = self.spatial.is_some() && !alpha.still;
                    }
                    self.matrix.solve(&mut self.rhs)?;
                    self.newton.copy_from_slice(&self.rhs);
                    if self.keep {
                        self.broyden.improve(&mut self.newton);
                    }
                } else {
                    // Non-smooth laws can make full steps jump between branches: go back and take less of the step.
                    factor *= 0.5;
                    self.broyden.clear();
                }
                for (i, &d) in self.free_dofs.iter().enumerate() {
                    state.q[d] = self.base[i] + factor * self.newton[i];
                }
                update(state, &self.old, &self.free_dofs);
                if converged {
                    break;
                }
            }
            self.trend.ended(converged.then_some(dt));
            // Sensitivities take factors of their own.
            self.keep &= columns > 0 || self.kept.serve(evaluations);
            if !converged && last.0 > ACCEPTED * last.1 {
                return Err(EngineError::NoEquilibrium { step: k, steps: self.loads.steps(), residual: last.0 / last.1 });
            }
        }
        let stage = match columns > 0 || self.n_follower_states > 0 {
            true => Stage::Full,
            false if converged => Stage::Last,
            false => Stage::Value,
        };
        // The last sum of Newton's method may have been taken at the converged point.
        if stage == Stage::Full || !at_end {
            self.internal(state, stage, force);
        }
        if force.iter().any(|f| !f.is_finite()) {
            return Err(EngineError::NotFinite { step: k });
        }
        for d in 0..n {
            state.g[d] = self.mass[d] * state.a[d] + force[d] - self.external[d];
        }
        if columns > 0 {
            self.sensitivities(state, columns)?;
        }
        state.s.copy_from_slice(&self.new_s);
        Ok(())
    }
}

/// What a sum over the elements is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// Forces and new states only.
    Value,
    /// The same where new states or reactions ask for them: the forces elsewhere are those of the iteration before, the residual of which was below [`FLAT`].
    Last,
    /// Also the tangent matrix.
    Newton,
    /// Also the derivatives with respect to parameters; followers advance.
    Full,
}

impl Stage {
    /// Whether it takes no derivatives.
    fn values(self) -> bool {
        matches!(self, Stage::Value | Stage::Last)
    }

    /// The derivatives of the elements that it takes.
    fn depth(self) -> Depth {
        if self == Stage::Full { Depth::Params } else { Depth::Inputs }
    }
}
