//! The steady cycle of a structure under a periodic drive, with sensitivities.
//!
//! From rest the drive is ramped up to its value at the start of the cycle (the declared loading path of history-dependent laws), then
//! cycles are marched until they repeat. What decays slowly is found by shooting: Newton's method on the state at the start of the
//! cycle, with the monodromy matrix from the march's own sensitivities; directions that never decay (an element that stays stuck) keep
//! what the loading path left there.

use nalgebra::{DMatrix, DVector};

use crate::model::{Bound, Model};

use super::EngineError;
use super::march::{Loads, March, Probe, State};

/// One steady cycle.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Steps per cycle.
    pub steps: usize,
    /// Number of sensitivities.
    pub columns: usize,
    /// Readings, `values[probe][k]` at the end of step `k + 1`; the last is the start of the cycle as well.
    pub values: Vec<Vec<f64>>,
    /// Sensitivities, `slopes[probe][k * columns + c]`.
    pub slopes: Vec<Vec<f64>>,
    /// Cycles marched before the one reported.
    pub cycles: usize,
}

/// Change per cycle, relative to the largest value in the cycle, at which it counts as repeating.
const TOLERANCE: f64 = 1e-10;
/// The same of a large system, whose sensitivities repeat within [`SENSED`] or are taken as they are after [`ROUNDS`] cycles.
const REPEATS: f64 = 1e-7;
const SENSED: f64 = 1e-5;
const ROUNDS: usize = 12;
/// Largest state for which the monodromy matrix is formed.
const SHOOT: usize = 200;
const CYCLES: usize = 300;
/// Cycles of the loading path that are marched with sensitivities.
const PATH_CYCLES: usize = 3;
/// Spectral radius at infinite frequency: little error of second order in what is resolved, and damping of what is not.
const RADIUS: f64 = 0.7;

/// Marches to the steady cycle. `loads` holds one cycle: its first and last sample are equal.
pub fn periodic(model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe], sensitivities: bool) -> Result<Cycle, EngineError> {
    let steps = length(loads);
    let columns = if sensitivities { bound.n_free } else { 0 };
    let rise = (steps / 4).max(16);
    let mut march = March::new(model, bound, loads, RADIUS)?;
    let mut z = Shooting::new(&march, &march.rest(0));
    if z.len() > SHOOT {
        let state = ramp(model, bound, loads, rise, columns)?;
        return repeated(&mut march, state, &mut z, steps, probes, columns);
    }
    let mut state = ramp(model, bound, loads, rise, 0)?;
    let mut cycles = 0;
    let mut change = f64::INFINITY;
    let mut wait = 3;
    while cycles < CYCLES && change >= TOLERANCE {
        let before = state.clone();
        cycle(&mut march, &mut state, &mut z, steps)?;
        cycles += 1;
        let last = change;
        change = z.change(&before, &state);
        // What decays quickly is marched; shooting is for slow decay, and is taken back where it does not help.
        if cycles >= wait && change >= TOLERANCE && change > 0.05 * last {
            let marched = state.clone();
            let shot = z.shoot(&mut march, &mut state, steps).and_then(|()| {
                let start = state.clone();
                cycle(&mut march, &mut state, &mut z, steps)?;
                Ok(z.change(&start, &state))
            });
            cycles += 2;
            match shot {
                Ok(after) if after < 0.5 * change => change = after,
                _ => {
                    state = marched;
                    wait = cycles + 4;
                }
            }
        }
    }
    // Shooting on a non-smooth cycle may hover just above the tolerance; what matters is far above it.
    if change > 1e-6 {
        return Err(EngineError::NotPeriodic { change, cycles });
    }
    follow(&mut march, &mut state, steps)?;
    let start = state.clone();
    if columns == 0 {
        return record(&mut march, &mut state, steps, probes, 0).map(|mut c| {
            c.cycles = cycles;
            c
        });
    }
    let path = Path { model, bound, loads, rise, cycles: cycles.clamp(1, PATH_CYCLES), columns };
    // Repetition costs a march of the columns for every cycle that they take to settle, as many as the values took; the monodromy matrix
    // one march of its own columns beside them.
    let mut cycle = None;
    if z.len() == 0 || cycles * columns < columns + z.len() {
        cycle = by_repetition(&mut march, &start, &path, &z, steps, probes, cycles)?;
    }
    let mut cycle = match cycle {
        Some(cycle) => cycle,
        None => by_monodromy(&mut march, &start, &path, &z, steps, probes)?,
    };
    cycle.cycles = cycles;
    Ok(cycle)
}

/// The way to the steady cycle, to be marched with sensitivities where something stays stuck: what it keeps of the loading path depends
/// on the parameters too.
struct Path<'a> {
    model: &'a Model,
    bound: &'a Bound,
    loads: &'a Loads,
    rise: usize,
    cycles: usize,
    columns: usize,
}

impl Path<'_> {
    fn march(&self, march: &mut March, steps: usize) -> Result<State, EngineError> {
        let mut state = ramp(self.model, self.bound, self.loads, self.rise, self.columns)?;
        for _ in 0..self.cycles {
            for k in 1..=steps {
                march.step(k, &mut state, self.columns)?;
            }
        }
        Ok(state)
    }
}

/// Cycles of a large system, values and sensitivities together, until both repeat; what is left then is below [`REPEATS`].
fn repeated(
    march: &mut March,
    mut state: State,
    z: &mut Shooting,
    steps: usize,
    probes: &[Probe],
    columns: usize,
) -> Result<Cycle, EngineError> {
    let (mut steady, mut followed, mut waited) = (false, false, 0);
    let mut before = z.pack_columns(&state, columns);
    for cycles in 1..=CYCLES {
        let start = state.clone();
        let mut cycle = record_with(march, &mut state, steps, probes, columns, Some(z))?;
        let change = z.slow_change(&start, &state);
        steady |= change < REPEATS;
        let after = z.pack_columns(&state, columns);
        let settled = (0..columns).all(|c| (before.column(c) - after.column(c)).amax() <= SENSED * after.column(c).amax());
        before = after;
        waited += usize::from(steady);
        if steady && !state.fs.is_empty() && !followed {
            follow(march, &mut state, steps)?;
            followed = true;
        } else if steady && (settled || waited > ROUNDS) || (cycles == CYCLES && change <= 1e-6) {
            cycle.cycles = cycles;
            return Ok(cycle);
        } else if cycles == CYCLES {
            return Err(EngineError::NotPeriodic { change, cycles });
        }
    }
    Err(EngineError::NotPeriodic { change: f64::INFINITY, cycles: CYCLES })
}

fn cycle(march: &mut March, state: &mut State, z: &mut Shooting, steps: usize) -> Result<(), EngineError> {
    for k in 1..=steps {
        march.step(k, state, 0)?;
        z.widen(state);
    }
    Ok(())
}

fn length(loads: &Loads) -> usize {
    let paths = loads.prescribed.iter().map(|p| p.1.len()).chain(loads.forces.iter().map(|f| f.1.len()));
    paths.min().unwrap_or(1) - 1
}

/// From rest to the loads at the start of the cycle along a smooth monotonic path, with `columns` sensitivities.
fn ramp(model: &Model, bound: &Bound, loads: &Loads, steps: usize, columns: usize) -> Result<State, EngineError> {
    let rise = |k: usize| {
        let t = k as f64 / steps as f64;
        let per_step = 1.0 / (steps as f64 * loads.dt);
        (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) * per_step, (6.0 - 12.0 * t) * per_step * per_step)
    };
    let path = Loads {
        dt: loads.dt,
        prescribed: loads
            .prescribed
            .iter()
            .map(|(d, p)| (*d, (0..=steps).map(&rise).map(|(s, v, a)| [p[0][0] * s, p[0][0] * v, p[0][0] * a]).collect()))
            .collect(),
        // Loads that stay come on with the drive.
        forces: (loads.forces.iter().map(|(d, f)| (*d, f[0])))
            .chain(bound.loads.iter().filter_map(|l| Some((l.dof, *l.path.last()?))))
            .map(|(d, f)| (d, (0..=steps).map(|k| f * rise(k).0).collect()))
            .collect(),
    };
    let mut march = March::loading(model, bound, &path, RADIUS)?;
    let mut state = march.rest(columns);
    for k in 1..=steps {
        march.step(k, &mut state, columns)?;
    }
    for (dof, p) in &loads.prescribed {
        (state.v[*dof], state.a[*dof]) = (p[0][1], p[0][2]);
    }
    Ok(state)
}

/// Brings the followers' states to their steady cycle: two cycles, then the limit of a geometric approach for what still moves.
fn follow(march: &mut March, state: &mut State, steps: usize) -> Result<(), EngineError> {
    if state.fs.is_empty() {
        return Ok(());
    }
    let mut seen = vec![state.fs.clone()];
    for _ in 0..3 {
        let start = state.clone();
        for k in 1..=steps {
            march.step(k, state, 0)?;
        }
        let fs = std::mem::take(&mut state.fs);
        *state = State { fs, ..start };
        seen.push(state.fs.clone());
    }
    for i in 0..state.fs.len() {
        let (first, second) = (seen[2][i] - seen[1][i], seen[3][i] - seen[2][i]);
        let ratio = second / first;
        if first != 0.0 && ratio.abs() < 1.0 && second.abs() > 1e-12 * seen[3][i].abs() {
            state.fs[i] += second * ratio / (1.0 - ratio);
        }
    }
    Ok(())
}

fn record(march: &mut March, state: &mut State, steps: usize, probes: &[Probe], columns: usize) -> Result<Cycle, EngineError> {
    march.set_columns(state, columns);
    record_with(march, state, steps, probes, columns, None)
}

fn record_with(
    march: &mut March,
    state: &mut State,
    steps: usize,
    probes: &[Probe],
    columns: usize,
    mut z: Option<&mut Shooting>,
) -> Result<Cycle, EngineError> {
    let mut values = vec![vec![0.0; steps]; probes.len()];
    let mut slopes = vec![vec![0.0; steps * columns]; probes.len()];
    for k in 1..=steps {
        march.step(k, state, columns)?;
        if let Some(z) = &mut z {
            z.widen(state);
        }
        for (i, probe) in probes.iter().enumerate() {
            values[i][k - 1] = march.read(*probe, state, &mut slopes[i][(k - 1) * columns..k * columns]);
        }
    }
    Ok(Cycle { steps, columns, values, slopes, cycles: 0 })
}

/// Sensitivities by marching them until they repeat; `None` where they decay too slowly.
fn by_repetition(
    march: &mut March,
    start: &State,
    path: &Path<'_>,
    z: &Shooting,
    steps: usize,
    probes: &[Probe],
    cycles: usize,
) -> Result<Option<Cycle>, EngineError> {
    let columns = path.columns;
    let path = if z.remembers(march, start, steps)? { Some(path.march(march, steps)?) } else { None };
    let mut state = with_columns(march, start, path.as_ref(), columns);
    let mut before = z.pack_columns(&state, columns);
    for _ in 0..=cycles {
        let cycle = record_with(march, &mut state, steps, probes, columns, None)?;
        let after = z.pack_columns(&state, columns);
        let settled = (0..columns).all(|c| {
            let (a, b) = (before.column(c), after.column(c));
            (a - b).amax() <= 1e-9 * b.amax()
        });
        if settled {
            return Ok(Some(cycle));
        }
        before = after;
        // Values start again exactly from the steady cycle; only the sensitivities go on.
        state = with_columns(march, start, Some(&state), columns);
    }
    Ok(None)
}

/// The start of the cycle with the sensitivities of another state, or none yet.
fn with_columns(march: &March, start: &State, from: Option<&State>, columns: usize) -> State {
    let mut state = start.clone();
    match from {
        Some(s) => {
            let (dq, dv, da) = (s.dq.clone(), s.dv.clone(), s.da.clone());
            state = State { dq, dv, da, ds: s.ds.clone(), dw: s.dw.clone(), dg: s.dg.clone(), ..state };
        }
        None => march.set_columns(&mut state, columns),
    }
    state
}

/// Sensitivities of the steady cycle: those of the start solve `(I - M) S = b`; what never decays has those of the loading path.
fn by_monodromy(
    march: &mut March,
    start: &State,
    path: &Path<'_>,
    z: &Shooting,
    steps: usize,
    probes: &[Probe],
) -> Result<Cycle, EngineError> {
    let columns = path.columns;
    let mut state = start.clone();
    let all = columns + z.len();
    march.set_columns(&mut state, all);
    z.seed(&mut state, columns);
    let cycle = record_with(march, &mut state, steps, probes, all, None)?;
    let end = z.pack_columns(&state, all);
    let b = end.columns(0, columns).into_owned();
    let monodromy = end.columns(columns, z.len()).into_owned();
    let mut kept = || path.march(march, steps).map(|p| z.pack_columns(&p, columns));
    let s0 = solve_fixed_point(&monodromy, &b, if z.ns > 0 { Some(&mut kept) } else { None })?;
    let slopes = cycle
        .slopes
        .iter()
        .map(|full| {
            let mut out = vec![0.0; steps * columns];
            for k in 0..steps {
                let row = &full[k * all..(k + 1) * all];
                for c in 0..columns {
                    out[k * columns + c] = row[c] + row[columns..].iter().zip(s0.column(c).iter()).map(|(a, b)| a * b).sum::<f64>();
                }
            }
            out
        })
        .collect();
    Ok(Cycle { columns, slopes, ..cycle })
}

/// Solves `(I - M) S = b`. With `L'(I - M) = 0 = (I - M) R` the directions `R` never decay and `L'S` is what a cycle conserves: it is that
/// of `path`, which is asked for where there are such directions, or left out.
fn solve_fixed_point(
    monodromy: &DMatrix<f64>,
    b: &DMatrix<f64>,
    path: Option<&mut dyn FnMut() -> Result<DMatrix<f64>, EngineError>>,
) -> Result<DMatrix<f64>, EngineError> {
    if monodromy.iter().chain(b.iter()).any(|v| !v.is_finite()) {
        return Err(EngineError::NotFinite { step: 0 });
    }
    let n = monodromy.nrows();
    let svd = (DMatrix::identity(n, n) - monodromy).svd(true, true);
    let cut = 1e-9 * svd.singular_values.max();
    let mut s = svd.solve(b, cut).unwrap_or_else(|_| DMatrix::zeros(n, b.ncols()));
    let lasting: Vec<usize> = (0..svd.singular_values.len()).filter(|k| svd.singular_values[*k] <= cut).collect();
    if let (Some(path), Some(u), Some(v_t), false) = (path, &svd.u, &svd.v_t, lasting.is_empty()) {
        let path = path()?;
        let (l, r) = (u.select_columns(&lasting), v_t.select_rows(&lasting).transpose());
        if let Some(share) = l.tr_mul(&r).lu().solve(&l.tr_mul(&(path - &s))) {
            s += r * share;
        }
    }
    Ok(s)
}

/// The state at the start of a cycle as one scaled vector: displacement, velocity, acceleration of the free degrees of freedom, states
/// of the elements.
struct Shooting {
    dofs: Vec<usize>,
    n: usize,
    ns: usize,
    scale: [f64; 4],
    state_scale: Vec<f64>,
}

impl Shooting {
    fn new(march: &March, state: &State) -> Self {
        let dofs = march.free_dofs().to_vec();
        Shooting { dofs, n: state.q.len(), ns: state.s.len(), scale: [1e-300; 4], state_scale: vec![1e-300; state.s.len()] }
    }
    fn len(&self) -> usize {
        4 * self.dofs.len() + self.ns
    }
    /// Takes the largest values seen as scales.
    fn widen(&mut self, state: &State) {
        for (scale, u) in self.scale.iter_mut().zip([&state.q, &state.v, &state.a, &state.w]) {
            *scale = u.iter().fold(*scale, |m, x| m.max(x.abs()));
        }
        for (scale, s) in self.state_scale.iter_mut().zip(&state.s) {
            *scale = scale.max(s.abs());
        }
    }
    fn pack(&self, state: &State) -> DVector<f64> {
        let parts = [&state.q, &state.v, &state.a, &state.w];
        let motion = parts.iter().zip(self.scale).flat_map(|(u, scale)| self.dofs.iter().map(move |d| u[*d] / scale));
        DVector::from_iterator(self.len(), motion.chain(state.s.iter().zip(&self.state_scale).map(|(s, scale)| s / scale)))
    }
    fn unpack(&self, z: &DVector<f64>, state: &mut State) {
        let m = self.dofs.len();
        for (i, d) in self.dofs.iter().enumerate() {
            state.q[*d] = z[i] * self.scale[0];
            state.v[*d] = z[m + i] * self.scale[1];
            state.a[*d] = z[2 * m + i] * self.scale[2];
            state.w[*d] = z[3 * m + i] * self.scale[3];
        }
        for (i, s) in state.s.iter_mut().enumerate() {
            *s = z[4 * m + i] * self.state_scale[i];
        }
    }
    /// Change of displacements and states, which velocities and accelerations follow.
    fn slow_change(&self, before: &State, after: &State) -> f64 {
        let moved = self.dofs.iter().map(|d| (after.q[*d] - before.q[*d]).abs() / self.scale[0]);
        let states = after.s.iter().zip(&before.s).zip(&self.state_scale).map(|((a, b), scale)| (a - b).abs() / scale);
        moved.chain(states).fold(0.0, f64::max)
    }
    fn change(&self, before: &State, after: &State) -> f64 {
        if self.len() == 0 { 0.0 } else { (self.pack(before) - self.pack(after)).amax() }
    }
    /// Whether a change of an element's state at the start of the cycle lives on at its end: something stays stuck, or decays slowly.
    fn remembers(&self, march: &mut March, start: &State, steps: usize) -> Result<bool, EngineError> {
        if self.ns == 0 {
            return Ok(false);
        }
        let mut state = start.clone();
        march.set_columns(&mut state, self.ns);
        for (i, scale) in self.state_scale.iter().enumerate() {
            state.ds[i * self.ns + i] = *scale;
        }
        march.by_parameter = false;
        let marched = (1..=steps).try_for_each(|k| march.step(k, &mut state, self.ns));
        march.by_parameter = true;
        marched?;
        Ok(self.pack_columns(&state, self.ns).amax() > 1e-6)
    }
    /// Unit perturbations of the scaled start in the columns from `first` on.
    fn seed(&self, state: &mut State, first: usize) {
        let m = self.dofs.len();
        for (i, d) in self.dofs.iter().enumerate() {
            state.dq[(first + i) * self.n + d] = self.scale[0];
            state.dv[(first + m + i) * self.n + d] = self.scale[1];
            state.da[(first + 2 * m + i) * self.n + d] = self.scale[2];
            state.dw[(first + 3 * m + i) * self.n + d] = self.scale[3];
        }
        for i in 0..self.ns {
            state.ds[(first + 4 * m + i) * self.ns + i] = self.state_scale[i];
        }
    }
    /// Scaled sensitivities, one column each.
    fn pack_columns(&self, state: &State, columns: usize) -> DMatrix<f64> {
        let m = self.dofs.len();
        DMatrix::from_fn(self.len(), columns, |r, c| match (r / m.max(1), r) {
            (g @ 0..=3, r) if r < 4 * m => {
                [&state.dq, &state.dv, &state.da, &state.dw][g][c * self.n + self.dofs[r - g * m]] / self.scale[g]
            }
            _ => state.ds[c * self.ns + r - 4 * m] / self.state_scale[r - 4 * m],
        })
    }
    /// One Newton step on the start of the cycle.
    fn shoot(&self, march: &mut March, state: &mut State, steps: usize) -> Result<(), EngineError> {
        let before = self.pack(state);
        let start = state.clone();
        march.set_columns(state, self.len());
        self.seed(state, 0);
        march.by_parameter = false;
        let marched = (1..=steps).try_for_each(|k| march.step(k, state, self.len()));
        march.by_parameter = true;
        marched?;
        let gap = self.pack(state) - &before;
        let monodromy = self.pack_columns(state, self.len());
        let delta = solve_fixed_point(&monodromy, &DMatrix::from_column_slice(gap.len(), 1, gap.as_slice()), None)?;
        *state = start;
        march.set_columns(state, 0);
        self.unpack(&(before + delta.column(0)), state);
        Ok(())
    }
}
