//! Steps that are exact for what is linear: the structure moves freely over a step, under its drive, which is a cubic along it, and under the forces of
//! the laws that are not linear, each the mean of its values at both ends. That is the trapezoidal rule for these forces alone (no step is too long for
//! a stiff spring, and the error falls with the square of the step), and no error of frequency or damping for all else: a record of a linear structure takes one
//! step a sample, that of the measured silverbox, whose spring is cubic, eight where the method for any model ([`super`]) took sixteen.

use std::sync::Arc;

use crate::effect::Inputs;
use crate::model::{Bound, Depth, Element, Model, Sensed};

use super::super::EngineError;
use super::super::blocktri::{BlockTri, Layout, Levels};
use super::sensitivities::add_row;
use super::{Loads, March, State};
use hold::{Hold, ORDERS, Structure};

mod balance;
mod hold;
mod slopes;

/// Free degrees of freedom at most: the matrices of a step are full.
const MOST: usize = 24;
/// Rounds in which forces and accelerations at the start find each other.
const ROUNDS: usize = 3;

/// What is sampled at the ends of the steps and acts on a free degree of freedom.
struct Drive {
    at: usize,
    path: Vec<f64>,
}

/// A step of one length.
struct Level {
    hold: Hold,
    /// Displacements and velocities per force of an acting element at either end of a step, a row for each of these.
    reach: Vec<Vec<f64>>,
    /// Both in a row for each displacement and velocity at the end: by those at the start, then by the forces of the acting elements there.
    across: Vec<f64>,
    /// What acting elements see of each other's forces: displacement, velocity, acceleration of the row's by the force of the column's.
    seen: [Vec<f64>; 3],
    /// Displacements and velocities per force of every source at the start and at the end of a step, and per its rate there.
    bent: Vec<[Vec<f64>; 4]>,
}

/// What a march needs for exact steps.
pub(super) struct Exact {
    structure: Structure,
    /// Steps of the whole length, of half of it, and so on.
    levels: Vec<Level>,
    drives: Vec<Drive>,
    /// Linear laws with free parameters.
    sources: Vec<slopes::Source>,
    /// Elements that act beyond their linear part, and behind them those that have candidates besides.
    acting: Vec<usize>,
    /// How many of these act.
    local: usize,
    /// Accelerations of the free degrees of freedom per force of an acting element and of a source, a row for each of these.
    lifts: [Vec<Vec<f64>>; 2],
    /// Accelerations of the free degrees of freedom by displacements, velocities, and forces of the acting elements: a row for each of the former.
    pushed: Vec<f64>,
    /// Elements at prescribed degrees of freedom.
    holding: Vec<usize>,
    matrix: BlockTri<f64>,
    slots: Vec<usize>,
    /// Forces of the acting elements beyond their linear part, and their sensitivities, a row each.
    phi: Vec<f64>,
    dphi: Vec<f64>,
    begun: bool,
    /// Whether no acting element has states, and whether all of them superpose: one step of Newton's method finds their forces then.
    stateless: bool,
    superpose: bool,
    /// Length of the step that `matrix` is factored for, and what the forces feel of the motion there, row by row.
    factored: (f64, Vec<[f64; 3]>),
    // Working vectors: what stood at the start of the step, and before it; displacements and velocities; forces on the free degrees of freedom.
    old_phi: Vec<f64>,
    before: Vec<f64>,
    base: Vec<f64>,
    miss: Vec<f64>,
    newton: Vec<f64>,
    star: Vec<Inputs<f64>>,
    z: Vec<f64>,
    motion: Vec<f64>,
    pull: Vec<f64>,
    rows: Vec<f64>,
    /// Sensitivities of displacements, velocities and forces of the acting elements at the start of a step, a row each.
    known: Vec<f64>,
    /// Rates of the drive at both ends of the step times the step, accelerations within the step there, and their rates times the step.
    pulls: [Vec<f64>; 2],
    within: [Vec<f64>; 2],
    jerks: [Vec<f64>; 2],
}

impl<'a> March<'a> {
    /// A march with exact steps where the structure allows it: parts that do not turn, all with mass, and few.
    pub fn exact(model: &Model, bound: &'a Bound, loads: &'a Loads, radius: f64) -> Result<Self, EngineError> {
        let mut march = March::new(model, bound, loads, radius)?;
        // A step that is too long for the exponential is left to the method for any model.
        let exact = Exact::of(&march)?.and_then(|mut exact| exact.level(&march).map(|_| Box::new(exact)));
        march.exact = exact;
        Ok(march)
    }

    /// The part `(from, to)` of step `k` as an exact one.
    pub(super) fn advance_exactly(
        &mut self,
        mut exact: Box<Exact>,
        k: usize,
        part: (f64, f64),
        state: &mut State,
        columns: usize,
    ) -> Result<(), EngineError> {
        let at = exact.level(self);
        let levels = std::mem::take(&mut exact.levels);
        let done = match at {
            Some(at) => exact.advance(self, &levels[at], (k, part), state, columns),
            None => Err(EngineError::NotFinite { step: k }),
        };
        exact.levels = levels;
        self.exact = Some(exact);
        done
    }

    fn inputs(&self, e: usize, state: &State) -> Inputs<f64> {
        let x = self.relative(e, &state.q);
        Inputs { x, v: self.relative(e, &state.v), a: self.relative(e, &state.a), dx: x - self.relative(e, &self.old.q) }
    }

    /// Free degrees of freedom at the ends of an element, with the sign with which they strain it.
    fn free_ends(&self, e: usize) -> impl Iterator<Item = (usize, f64)> {
        self.links[e].ends().filter_map(|(d, sign)| Some((self.free[d]?, sign)))
    }
}

impl Exact {
    fn of(march: &March) -> Result<Option<Exact>, EngineError> {
        let (bound, n) = (march.bound, march.free_dofs.len());
        let usable = march.spatial.is_none() && march.acts.iter().all(|a| *a) && (1..=MOST).contains(&n);
        let Some(structure) = usable.then(|| Structure::of(bound, &march.mass, &march.free, n)).flatten() else { return Ok(None) };
        let all = || bound.elements.iter().enumerate();
        let mut acting: Vec<usize> = all().filter(|(_, e)| e.is_local()).map(|(e, _)| e).collect();
        let local = acting.len();
        acting.extend(all().filter(|(_, e)| !e.is_local() && e.n_followers() > 0).map(|(e, _)| e));
        let sources: Vec<slopes::Source> = all().filter_map(|(e, element)| slopes::Source::of(e, element)).collect();
        let lift =
            |e: usize| -> Vec<f64> { (0..n).map(|i| march.free_ends(e).map(|(j, s)| -s * structure.flexible[(i, j)]).sum()).collect() };
        let lifts: [Vec<Vec<f64>>; 2] = [acting.iter().map(|e| lift(*e)).collect(), sources.iter().map(|s| lift(s.element)).collect()];
        let holding = all().map(|(e, _)| e).filter(|e| march.links[*e].ends().any(|(d, _)| march.prescribed_at[d].is_some())).collect();
        let pairs: Vec<(usize, usize)> = (0..local).flat_map(|i| (0..local).map(move |j| (i, j))).collect();
        let layout = Arc::new(Layout::new(Levels::new(local, &pairs)?));
        let slots = pairs.iter().map(|(i, j)| layout.slot(*i, *j)).collect::<Result<_, _>>()?;
        let mut pushed = Vec::new();
        for i in 0..n {
            pushed.extend_from_slice(&structure.rates[2 * n * i..2 * n * (i + 1)]);
            pushed.extend(lifts[0].iter().map(|lift| lift[i]));
        }
        Ok(Some(Exact {
            drives: drives(march),
            structure,
            levels: vec![],
            sources,
            local,
            lifts,
            pushed,
            holding,
            matrix: BlockTri::new(layout),
            slots,
            phi: vec![0.0; acting.len()],
            dphi: vec![],
            begun: false,
            old_phi: vec![],
            before: vec![],
            stateless: acting[..local].iter().all(|e| bound.elements[*e].n_states() == 0),
            superpose: acting[..local].iter().all(|e| bound.elements[*e].superposes()),
            factored: (f64::NAN, vec![]),
            base: vec![0.0; local],
            miss: vec![0.0; local],
            newton: vec![0.0; local],
            star: vec![Inputs::default(); local],
            z: vec![0.0; 2 * n],
            motion: vec![0.0; 2 * n],
            pull: vec![0.0; n],
            rows: vec![],
            known: vec![],
            pulls: [vec![0.0; n], vec![0.0; n]],
            within: [vec![0.0; march.mass.len()], vec![0.0; march.mass.len()]],
            jerks: [vec![0.0; march.mass.len()], vec![0.0; march.mass.len()]],
            acting,
        }))
    }

    /// Which level has steps as long as the one at hand; it is made where none has. None where the step is too long for the exponential.
    fn level(&mut self, march: &March) -> Option<usize> {
        if let Some(at) = self.levels.iter().position(|l| (l.hold.dt / march.dt - 1.0).abs() < 1e-9) {
            return Some(at);
        }
        let (n, local) = (self.structure.n, self.local);
        let hold = Hold::new(&self.structure, march.dt)?;
        // A force of an element pulls its `to` end back.
        let by = |matrix: &[f64], e: usize, factor: f64| -> Vec<f64> {
            (0..2 * n).map(|i| march.free_ends(e).map(|(j, s)| -factor * s * matrix[i * n + j]).sum()).collect()
        };
        let reach: Vec<Vec<f64>> = self.acting.iter().map(|e| by(&hold.forced[0], *e, 0.5)).collect();
        let mut seen = [(); 3].map(|()| vec![0.0; local * local]);
        for (c, z) in reach[..local].iter().enumerate() {
            let acceleration = |i: usize| dot(&self.structure.rates[2 * n * i..2 * n * (i + 1)], z) + self.lifts[0][c][i];
            for (r, e) in self.acting[..local].iter().enumerate() {
                for (i, sign) in march.free_ends(*e) {
                    let at = r * local + c;
                    seen[0][at] += sign * z[i];
                    seen[1][at] += sign * z[n + i];
                    seen[2][at] += sign * acceleration(i);
                }
            }
        }
        let bent = slopes::bent(&self.sources, &hold, by);
        let mut across = Vec::new();
        for i in 0..2 * n {
            across.extend_from_slice(&hold.free[2 * n * i..2 * n * (i + 1)]);
            across.extend(reach.iter().map(|reach| reach[i]));
        }
        self.levels.push(Level { hold, reach, across, seen, bent });
        Some(self.levels.len() - 1)
    }

    fn advance(
        &mut self,
        march: &mut March,
        level: &Level,
        (k, part): (usize, (f64, f64)),
        state: &mut State,
        columns: usize,
    ) -> Result<(), EngineError> {
        if !self.begun {
            self.begin(march, state, columns);
        }
        // What stood before is no guide where the length of the step changes.
        let goes_on = self.before.len() == self.phi.len() && state.dt == march.dt;
        march.uniform_history(state, columns);
        march.old.begin_at(state);
        self.before.clone_from(if goes_on { &self.old_phi } else { &self.phi });
        self.old_phi.clone_from(&self.phi);
        march.load(k, part.1, state);
        self.fly(march, level, k, part);
        let follows = columns > 0 || march.n_follower_states > 0;
        if let Err(residual) = self.balance(march, level, state, follows) {
            self.phi.clone_from(&self.old_phi);
            return Err(match residual.is_finite() {
                true => EngineError::NoEquilibrium { step: k, steps: march.loads.steps(), residual },
                false => EngineError::NotFinite { step: k },
            });
        }
        if follows {
            self.evaluate(march, state);
        }
        for (e, element) in march.bound.elements.iter().enumerate() {
            march.forces[e] = along(&element.linear_part(), &march.inputs(e, state));
        }
        self.acting.iter().zip(&self.phi).for_each(|(e, phi)| march.forces[*e] += phi);
        state.g.fill(0.0);
        for (d, _) in &march.loads.prescribed {
            state.g[*d] = march.mass[*d] * state.a[*d] - march.external[*d];
        }
        for e in &self.holding {
            let ends = march.links[*e].ends().filter(|(d, _)| march.prescribed_at[*d].is_some());
            ends.for_each(|(d, sign)| state.g[d] += sign * march.forces[*e]);
        }
        if columns > 0 {
            self.differentiate(march, level, state, columns)?;
        }
        state.s.copy_from_slice(&march.new_s);
        Ok(())
    }

    /// Forces of the acting elements where the march begins, with their sensitivities.
    fn begin(&mut self, march: &mut March, state: &State, columns: usize) {
        self.begun = true;
        let n = self.structure.n;
        let mut started = state.clone();
        march.old.clone_from(state);
        for (i, d) in march.free_dofs.iter().enumerate() {
            (self.z[i], self.z[n + i]) = (state.q[*d], state.v[*d]);
        }
        // Forces that feel accelerations change these in turn.
        for _ in 0..ROUNDS {
            self.pull.fill(0.0);
            self.drives.iter().for_each(|drive| self.pull[drive.at] += drive.path[0]);
            self.pull_back(march);
            self.accelerate(march, &mut started);
            // What follows states goes on from where it is.
            started.fs.clone_from(&state.fs);
            self.evaluate(march, &mut started);
            for (row, e) in self.acting.iter().enumerate().take(self.local) {
                self.phi[row] = march.sensed[*e].f - along(&march.bound.elements[*e].linear_part(), &march.inputs(*e, &started));
            }
        }
        self.dphi.clear();
        self.dphi.resize(self.acting.len() * columns, 0.0);
        self.known.clear();
        if columns > 0 {
            self.slope_at_start(march, state, columns);
            for du in [&state.dq, &state.dv] {
                march.free_dofs.iter().for_each(|d| self.known.extend_from_slice(&du[d * columns..(d + 1) * columns]));
            }
            self.known.extend_from_slice(&self.dphi);
        }
    }

    /// Takes the forces of the acting elements off what pulls at the structure.
    fn pull_back(&mut self, march: &March) {
        for (e, phi) in self.acting[..self.local].iter().zip(&self.phi) {
            march.free_ends(*e).for_each(|(i, s)| self.pull[i] -= s * phi);
        }
    }

    /// Displacements and velocities `z` with the accelerations under `pull`, into the state.
    fn accelerate(&self, march: &March, state: &mut State) {
        let n = self.structure.n;
        for (i, d) in march.free_dofs.iter().enumerate() {
            let pulled: f64 = (0..n).map(|j| self.structure.flexible[(i, j)] * self.pull[j]).sum();
            (state.q[*d], state.v[*d]) = (self.z[i], self.z[n + i]);
            state.a[*d] = dot(&self.structure.rates[2 * n * i..2 * n * (i + 1)], &self.z) + pulled;
        }
    }

    /// Where the structure comes to under its drive and the forces that the acting elements had at the start, as `motion`; the drive at the end as `pull`.
    fn fly(&mut self, march: &March, level: &Level, k: usize, part: (f64, f64)) {
        let n = self.structure.n;
        for (i, d) in march.free_dofs.iter().enumerate() {
            (self.z[i], self.z[n + i]) = (march.old.q[*d], march.old.v[*d]);
        }
        for i in 0..2 * n {
            self.motion[i] = dot(&level.hold.free[2 * n * i..2 * n * (i + 1)], &self.z);
        }
        for (phi, reach) in self.old_phi[..self.local].iter().zip(&level.reach) {
            add_row(&mut self.motion, *phi, reach, 0);
        }
        self.pull.fill(0.0);
        self.pulls.iter_mut().for_each(|p| p.fill(0.0));
        for drive in &self.drives {
            let c = cubic(&drive.path, k, part);
            self.pull[drive.at] += c.iter().sum::<f64>();
            self.pulls[0][drive.at] += c[1];
            self.pulls[1][drive.at] += c[1] + 2.0 * c[2] + 3.0 * c[3];
            for i in 0..2 * n {
                self.motion[i] += (0..ORDERS).map(|j| level.hold.forced[j][i * n + drive.at] * c[j]).sum::<f64>();
            }
        }
    }

    /// The acting elements at the motion of the state, with all derivatives, into `sensed` and the new states.
    fn evaluate(&self, march: &mut March, state: &mut State) {
        for e in &self.acting {
            let u = march.inputs(*e, state);
            march.sense(*e, &u, Depth::Params, &mut state.fs);
        }
    }
}

impl March<'_> {
    /// An element at this motion, from the states at the start of the step.
    fn sense(&mut self, e: usize, u: &Inputs<f64>, depth: Depth, fs: &mut [f64]) {
        let (element, link) = (&self.bound.elements[e], &self.links[e]);
        let states = link.s0..link.s0 + element.n_states();
        self.new_s[states.clone()].copy_from_slice(&self.old.s[states.clone()]);
        let fs = &mut fs[link.fs0..link.fs0 + element.n_follower_states()];
        element.tangent(u, self.dt, &mut self.new_s[states], fs, depth, &mut self.sensed[e], &mut self.scratch);
    }
}

impl March<'_> {
    /// The states of an element after this motion, from those at the start of the step.
    fn follow(&mut self, e: usize, u: &Inputs<f64>) {
        let (element, s0) = (&self.bound.elements[e], self.links[e].s0);
        let states = s0..s0 + element.n_states();
        self.new_s[states.clone()].copy_from_slice(&self.old.s[states.clone()]);
        element.value(u, self.dt, &mut self.new_s[states], &mut self.scratch);
    }
}

/// Force of a linear law with these derivatives.
fn along(by: &[f64; 3], u: &Inputs<f64>) -> f64 {
    by[0] * u.x + by[1] * u.v + by[2] * u.a
}

/// Derivatives of an element's force beyond its linear part, with respect to displacement, velocity and acceleration at the end of the step.
fn beyond(element: &Element, sensed: &Sensed) -> [f64; 3] {
    let (d, [k, c, m]) = (sensed.inputs(0), element.linear_part());
    [d[0] + d[3] - k, d[1] - c, d[2] - m]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Loads and prescribed motion as forces on the free degrees of freedom, at the ends of all steps.
fn drives(march: &March) -> Vec<Drive> {
    let samples = march.loads.steps() + 1;
    let mut paths = vec![vec![]; march.free_dofs.len()];
    let mut add = |at: usize, of: &dyn Fn(usize) -> f64| {
        let path: &mut Vec<f64> = &mut paths[at];
        path.resize(samples, 0.0);
        path.iter_mut().enumerate().for_each(|(k, f)| *f += of(k));
    };
    for (dof, f) in &march.constant {
        march.free[*dof].into_iter().for_each(|i| add(i, &|_| *f));
    }
    for (dof, path) in &march.loads.forces {
        march.free[*dof].into_iter().for_each(|i| add(i, &|k| path[k]));
    }
    for (e, element) in march.bound.elements.iter().enumerate() {
        let by = element.linear_part();
        for (dof, held) in march.links[e].ends() {
            let Some(p) = march.prescribed_at[dof] else { continue };
            let path = &march.loads.prescribed[p].1;
            let force = |k: usize| along(&by, &Inputs { x: path[k][0], v: path[k][1], a: path[k][2], dx: 0.0 });
            march.free_ends(e).for_each(|(i, sign)| add(i, &|k| -sign * held * force(k)));
        }
    }
    paths.into_iter().enumerate().filter(|(_, path)| !path.is_empty()).map(|(at, path)| Drive { at, path }).collect()
}

/// Coefficients of the cubic through the four samples next to step `k`, along the part of it from `from` to `to`; a line where there are fewer.
fn cubic(path: &[f64], k: usize, (from, to): (f64, f64)) -> [f64; ORDERS] {
    let n = path.len();
    let mut c = [path[k - 1], path[k] - path[k - 1], 0.0, 0.0];
    if n >= ORDERS {
        let first = k.saturating_sub(2).min(n - ORDERS);
        let f = &path[first..first + ORDERS];
        // Newton's form over the samples at 0, 1, 2, 3, then about the start of the step.
        let (d1, d2) = (f[1] - f[0], 0.5 * (f[2] - 2.0 * f[1] + f[0]));
        let d3 = (f[3] - 3.0 * f[2] + 3.0 * f[1] - f[0]) / 6.0;
        let t = (k - 1 - first) as f64;
        let power = [f[0], d1 - d2 + 2.0 * d3, d2 - 3.0 * d3, d3];
        c = shifted(power, t);
    }
    let h = to - from;
    let [c0, c1, c2, c3] = if from == 0.0 { c } else { shifted(c, from) };
    [c0, c1 * h, c2 * h * h, c3 * h * h * h]
}

/// A cubic about another point.
fn shifted([c0, c1, c2, c3]: [f64; ORDERS], t: f64) -> [f64; ORDERS] {
    [c0 + t * (c1 + t * (c2 + t * c3)), c1 + t * (2.0 * c2 + 3.0 * t * c3), c2 + 3.0 * t * c3, c3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_through_samples_of_a_cubic_is_that_cubic() {
        let of = |t: f64| 2.0 - 3.0 * t + 0.5 * t * t + 0.25 * t * t * t;
        let path: Vec<f64> = (0..7).map(|k| of(f64::from(k))).collect();
        for k in 1..7 {
            for (from, to) in [(0.0, 1.0), (0.25, 0.5)] {
                let c = cubic(&path, k, (from, to));
                for s in [0.0, 0.3, 1.0] {
                    let t = (k - 1) as f64 + from + s * (to - from);
                    let value = c[0] + s * (c[1] + s * (c[2] + s * c[3]));
                    assert!((value - of(t)).abs() < 1e-12 * of(t).abs().max(1.0), "step {k} at {s}: {value} {}", of(t));
                }
            }
        }
        assert_eq!(cubic(&[1.0, 3.0], 1, (0.5, 1.0)), [2.0, 1.0, 0.0, 0.0]);
    }
}
