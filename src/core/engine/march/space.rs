//! A step of parts that turn far: forces and tangent of the connectors at their own directions, inertia of the parts.

use crate::effect::Inputs;
use crate::model::space::{InPlane, Inertial, PlaneJoint, Pose, Relative, Space};
use crate::model::{Bound, Model};

use super::super::EngineError;
use super::super::blocktri::{Block, Layout};
use super::super::spatial::{Joint, Measured, dot, joints};
use super::sensitivities::add_row;
use super::{March, Rates, Stage, State};

/// The spatial side of a march.
pub(super) struct Spatial {
    pub space: Space,
    pub joints: Vec<JointWork>,
    pub parts: Vec<PartWork>,
    poses: Vec<Pose<f64>>,
    /// Coordinates at which the components at hand were taken.
    taken: Vec<f64>,
}

pub(super) struct JointWork {
    pub joint: Joint,
    /// Its closed form, where its parts stay in the plane.
    plane: Option<PlaneJoint>,
    /// Coordinates that move, by their place among the twelve, with their degree of freedom.
    live: Vec<(usize, usize)>,
    block: Block,
    now: Measured,
    /// Components and derivatives at the start of the step.
    before: Measured,
    geometric: [[f64; 12]; 12],
    seen: Seen,
    /// Whether a state or a reaction follows from it.
    follows: bool,
    /// Whether the rates of the derivatives at hand are zero.
    at_rest: bool,
}

pub(super) struct PartWork {
    part: usize,
    dofs: [Option<usize>; 6],
    block: Block,
    inertial: Inertial,
    /// Whether a reaction follows from it.
    follows: bool,
    /// Moment of inertia about the origin, where the part stays in the plane.
    plane: Option<f64>,
}

impl Spatial {
    pub fn joints(model: &Model, bound: &crate::model::Bound) -> Vec<Joint> {
        model.space.as_ref().map_or(vec![], |space| joints(model, bound, space))
    }

    pub fn new(
        model: &Model,
        bound: &Bound,
        joints: Vec<Joint>,
        layout: &Layout,
        free: &[Option<usize>],
    ) -> Result<Option<Self>, EngineError> {
        let Some(space) = &model.space else { return Ok(None) };
        let prescribed = |dofs: &[Option<usize>]| dofs.iter().flatten().any(|d| free[*d].is_none());
        let joints = joints.into_iter().map(|joint| {
            let block = layout.block(joint.dofs.map(|d| d.and_then(|d| free[d])))?;
            let plane = space.plane(joint.connector, joint.from, joint.to);
            let live = joint.dofs.iter().enumerate().filter_map(|(k, d)| Some((k, (*d)?))).collect();
            let follows = prescribed(&joint.dofs) || joint.elements.iter().any(|(e, _)| bound.elements[*e].n_states() > 0);
            Ok(JointWork {
                follows,
                joint,
                plane,
                live,
                block,
                now: Measured::default(),
                before: Measured::default(),
                geometric: [[0.0; 12]; 12],
                seen: Seen::Plane(InPlane::default()),
                at_rest: true,
            })
        });
        let joints = joints.collect::<Result<Vec<_>, EngineError>>()?;
        let moving = space.parts.iter().enumerate().filter(|(_, p)| p.dofs.iter().any(Option::is_some));
        let parts = moving.map(|(k, p)| {
            let plane = p.in_plane().then(|| p.inertia_about_origin()[2][2]);
            let block = layout.block(p.dofs.map(|d| d.and_then(|d| free[d])))?;
            Ok(PartWork { part: k, dofs: p.dofs, block, inertial: Inertial::default(), follows: prescribed(&p.dofs), plane })
        });
        let parts = parts.collect::<Result<Vec<_>, EngineError>>()?;
        let poses = vec![Pose::turned([0.0; 3]); space.parts.len()];
        Ok(Some(Spatial { space: space.clone(), joints, parts, poses, taken: vec![] }))
    }

    /// Takes the components at the start of a step.
    pub fn begin(&mut self, old: &State) {
        let known = self.taken == old.q;
        if !known {
            self.pose(&old.q, false);
        }
        for j in &mut self.joints {
            if !known {
                j.measure(&self.space, &self.poses);
            }
            (j.before.g, j.before.b) = (j.now.g, j.now.b);
        }
    }

    /// Poses at `q`: of all parts, or of those between which a state or a reaction follows.
    fn pose(&mut self, q: &[f64], last: bool) {
        let mut at = |k: usize| self.poses[k] = Pose::new(&self.space.coordinates(k, q));
        if last {
            self.joints.iter().filter(|j| j.follows).for_each(|j| [j.joint.from, j.joint.to].into_iter().for_each(&mut at));
            self.parts.iter().filter(|p| p.follows).for_each(|p| at(p.part));
        } else {
            (0..self.space.parts.len()).for_each(at);
        }
        self.taken.clear();
        self.taken.extend_from_slice(q);
    }
}

/// What was measured, with what its second derivatives need.
// Kept in place of the last one: nothing is allocated in a step.
#[allow(clippy::large_enum_variant)]
pub(super) enum Seen {
    Plane(InPlane),
    Space(Relative<f64>),
}

impl JointWork {
    /// Components and derivatives at the present poses, into `now`.
    fn measure(&mut self, space: &Space, poses: &[Pose<f64>]) {
        if let Some(plane) = &self.plane {
            let (a, b) = (&poses[self.joint.from], &poses[self.joint.to]);
            self.seen = Seen::Plane(plane.measure(a, b, &mut self.now.g, &mut self.now.b));
            return;
        }
        let relative = self.joint.between(space, poses);
        (self.now.g, self.now.b) = (relative.g, relative.b);
        self.seen = Seen::Space(relative);
    }
}

impl March<'_> {
    /// The spatial counterpart of the sum over the elements; inertia included.
    pub(super) fn internal_spatial(&mut self, spatial: &mut Spatial, state: &mut State, stage: Stage, force: &mut [f64]) -> f64 {
        let (dt, rates) = (self.dt, self.rates());
        let mut scale = 0.0;
        let last = stage == Stage::Last;
        spatial.pose(&state.q, last);
        for work in spatial.joints.iter_mut().filter(|j| !last || j.follows) {
            work.measure(&spatial.space, &spatial.poses);
            let joint = &work.joint;
            let (reads_v, reads_a) = joint.rates;
            let with_rates = reads_a || (reads_v && stage == Stage::Full);
            if let (Seen::Plane(at), true, false) = (&work.seen, with_rates, reads_a) {
                at.rates(&joint.gather(&state.v), &mut work.now.rate);
            } else if with_rates {
                joint.rates_into(&spatial.space, &state.q, &state.v, &state.a, &mut work.now);
            } else if !work.at_rest {
                (work.now.rate, work.now.second) = ([[0.0; 12]; 6], [[0.0; 12]; 6]);
            }
            work.at_rest = !with_rates;
            let gather = |reads: bool, u: &[f64]| if reads { joint.gather(u) } else { [0.0; 12] };
            let (v12, a12) = (gather(reads_v || reads_a, &state.v), gather(reads_a, &state.a));
            let mut on = [0.0; 12];
            let mut f = [0.0; 6];
            let mut rows = [[0.0; 12]; 6];
            for &(e, c) in &joint.elements {
                let element = &self.bound.elements[e];
                let (row, link) = (&work.now.b[c], &self.links[e]);
                let x = work.now.g[c];
                let v = if reads_v || reads_a { dot(row, &v12) } else { 0.0 };
                let a = if reads_a { dot(row, &a12) + dot(&work.now.rate[c], &v12) } else { 0.0 };
                let u = Inputs { x, v, a, dx: x - work.before.g[c] };
                let s = &mut self.new_s[link.s0..link.s0 + element.n_states()];
                let fs = &mut state.fs[link.fs0..link.fs0 + element.n_follower_states()];
                let value = if stage.values() {
                    element.value(&u, dt, s, &mut self.scratch)
                } else {
                    let out = &mut self.sensed[e];
                    element.tangent(&u, dt, s, fs, stage.depth(), out, &mut self.scratch);
                    if stage == Stage::Newton {
                        rows[c] = effective_row(out.inputs(0), &work.now, c, &rates);
                    }
                    out.f
                };
                f[c] = value;
                on.iter_mut().zip(row).for_each(|(on, b)| *on += b * value);
                self.forces[e] = value;
                scale += value.abs();
            }
            work.live.iter().for_each(|(k, d)| force[*d] += on[*k]);
            if !stage.values() {
                match &work.seen {
                    Seen::Plane(at) => at.geometric(&f, &mut work.geometric),
                    Seen::Space(relative) => work.geometric = relative.geometric(&f, &spatial.poses[joint.from], &spatial.poses[joint.to]),
                }
            }
            if stage == Stage::Newton {
                add_joint(&mut self.matrix, work, &rows);
            }
        }
        for work in spatial.parts.iter_mut().filter(|p| !self.alpha.still && (!last || p.follows)) {
            let part = &spatial.space.parts[work.part];
            let at = |u: &[f64]| -> [f64; 6] { std::array::from_fn(|k| work.dofs[k].map_or(0.0, |d| u[d])) };
            let (q, v, a) = (at(&state.q), at(&state.v), at(&state.a));
            let pose = &spatial.poses[work.part];
            match (stage, work.plane) {
                (_, Some(inertia)) => part.plane_inertial(pose, &v, &a, inertia, &mut work.inertial),
                (Stage::Full, _) => work.inertial = part.inertial_tangent(&q, &v, &a),
                (Stage::Newton, _) => work.inertial = part.inertial_by_acceleration(pose, &v, &a),
                (Stage::Value | Stage::Last, _) => work.inertial.p = part.inertial_forces(pose, &v, &a),
            }
            for (d, p) in work.dofs.iter().zip(work.inertial.p) {
                if let Some(d) = d {
                    force[*d] += p;
                    scale += p.abs();
                }
            }
            if stage == Stage::Newton {
                add_part(&mut self.matrix, work, &rates);
            }
        }
        scale
    }

    /// The tangent at the converged step, every derivative included.
    pub(super) fn refresh_spatial(&mut self, spatial: &Spatial) {
        let rates = self.rates();
        for work in &spatial.joints {
            let mut rows = [[0.0; 12]; 6];
            for &(e, c) in &work.joint.elements {
                rows[c] = effective_row(self.sensed[e].inputs(0), &work.now, c, &rates);
                self.rows[e] = rows[c];
            }
            add_joint(&mut self.matrix, work, &rows);
        }
        for work in spatial.parts.iter().filter(|_| !self.alpha.still) {
            add_part(&mut self.matrix, work, &rates);
        }
    }

    /// Derivatives of the elements' forces, and of the inertial forces, at held coordinates: the first into `h`, and with their
    /// directions taken from `rhs`.
    pub(super) fn held_spatial(&mut self, spatial: &Spatial, state: &State, columns: usize, rhs: &mut [f64]) {
        for work in &spatial.joints {
            for &(e, axis) in &work.joint.elements {
                let (sensed, s0) = (&self.sensed[e], self.links[e].s0);
                let (d, h) = (sensed.inputs(0), &mut self.h[e * columns..(e + 1) * columns]);
                let (b, rate, before) = (&work.now.b[axis], &work.now.rate[axis], &work.before.b[axis]);
                for &(k, dof) in &work.live {
                    add_row(h, d[1] * b[k] + 2.0 * d[2] * rate[k], &state.dv, dof);
                    add_row(h, d[2] * b[k], &state.da, dof);
                    add_row(h, -d[3] * before[k], &self.old.dq, dof);
                }
                for k in sensed.span(0) {
                    add_row(h, sensed.states(0)[k], &self.old.ds, s0 + k);
                }
                // A spring without parameters changes with the coordinates alone.
                if h.iter().all(|h| *h == 0.0) {
                    continue;
                }
                for &(k, dof) in &work.live {
                    if let Some(i) = self.free[dof] {
                        add_row(&mut rhs[i * columns..(i + 1) * columns], -b[k], h, 0);
                    }
                }
            }
        }
        for work in spatial.parts.iter().filter(|_| !self.alpha.still) {
            for (k, i) in work.dofs.iter().enumerate().filter_map(|(k, d)| Some((k, self.free[(*d)?]?))) {
                let out = &mut rhs[i * columns..(i + 1) * columns];
                for (j, dof) in work.dofs.iter().enumerate().filter_map(|(j, d)| Some((j, (*d)?))) {
                    add_row(out, -work.inertial.by_v[k][j], &state.dv, dof);
                    add_row(out, -work.inertial.by_a[k][j], &state.da, dof);
                }
            }
        }
    }

    /// Derivatives of forces, states and reactions once those of the motion are known.
    pub(super) fn follow_spatial(&mut self, spatial: &Spatial, state: &mut State, columns: usize) {
        // Only what is prescribed has a reaction.
        let reactions = !self.loads.prescribed.is_empty();
        for work in &spatial.joints {
            for &(e, axis) in &work.joint.elements {
                let sensed = &self.sensed[e];
                let h = &mut self.h[e * columns..(e + 1) * columns];
                work.live.iter().for_each(|&(k, dof)| add_row(h, self.rows[e][k], &state.dq, dof));
                if !sensed.states(0).is_empty() {
                    let (b, rate, second) = (&work.now.b[axis], &work.now.rate[axis], &work.now.second[axis]);
                    self.motion.clear(columns);
                    for &(k, dof) in &work.live {
                        self.motion.add(0, b[k], &state.dq, dof);
                        self.motion.add(1, b[k], &state.dv, dof);
                        self.motion.add(1, rate[k], &state.dq, dof);
                        self.motion.add(2, b[k], &state.da, dof);
                        self.motion.add(2, 2.0 * rate[k], &state.dv, dof);
                        self.motion.add(2, second[k], &state.dq, dof);
                        self.motion.add(3, b[k], &state.dq, dof);
                        self.motion.add(3, -work.before.b[axis][k], &self.old.dq, dof);
                    }
                    self.motion.states(sensed, self.links[e].s0, &self.old.ds, &mut state.ds);
                }
                for &(k, dof) in work.live.iter().filter(|_| reactions) {
                    add_row(&mut state.dg[dof * columns..(dof + 1) * columns], work.now.b[axis][k], h, 0);
                }
            }
            for &(k, dof) in work.live.iter().filter(|_| reactions) {
                let out = &mut state.dg[dof * columns..(dof + 1) * columns];
                work.live.iter().for_each(|&(j, other)| add_row(out, work.geometric[k][j], &state.dq, other));
            }
        }
        for work in spatial.parts.iter().filter(|_| reactions && !self.alpha.still) {
            let p = &work.inertial;
            for (k, dof) in work.dofs.iter().enumerate().filter_map(|(k, d)| Some((k, (*d)?))) {
                let out = &mut state.dg[dof * columns..(dof + 1) * columns];
                for (j, other) in work.dofs.iter().enumerate().filter_map(|(j, d)| Some((j, (*d)?))) {
                    add_row(out, p.by_q[k][j], &state.dq, other);
                    add_row(out, p.by_v[k][j], &state.dv, other);
                    add_row(out, p.by_a[k][j], &state.da, other);
                }
            }
        }
    }

    /// Relative displacement of a place of a spatial model, with its sensitivities.
    pub(super) fn read_relative(&self, spatial: &Spatial, connector: usize, axis: usize, state: &State, d: &mut [f64]) -> f64 {
        let joint = &self.connectors[connector];
        let (relative, ..) = joint.relative(&spatial.space, &state.q);
        d.fill(0.0);
        for (k, dof) in joint.dofs.iter().enumerate().filter_map(|(k, d)| Some((k, (*d)?))) {
            add_row(d, relative.b[axis][k], &state.dq, dof);
        }
        relative.g[axis]
    }
}

/// `dF/dq` of an element with velocity and acceleration following from the displacement of the step.
fn effective_row(d: &[f64], now: &Measured, c: usize, rates: &Rates) -> [f64; 12] {
    let straight = d[0] + d[3] + rates.v * d[1] + rates.a * d[2];
    let turning = d[1] + 2.0 * rates.v * d[2];
    std::array::from_fn(|k| straight * now.b[c][k] + turning * now.rate[c][k] + d[2] * now.second[c][k])
}

fn add_joint(matrix: &mut super::BlockTri<f64>, work: &JointWork, rows: &[[f64; 12]; 6]) {
    matrix.add_block(&work.block, |i, j| {
        let direct: f64 = (0..6).map(|c| work.now.b[c][i] * rows[c][j]).sum();
        direct + work.geometric[i][j]
    });
}

fn add_part(matrix: &mut super::BlockTri<f64>, work: &PartWork, rates: &Rates) {
    let p = &work.inertial;
    matrix.add_block(&work.block, |i, j| p.by_q[i][j] + rates.v * p.by_v[i][j] + rates.a * p.by_a[i][j]);
}
