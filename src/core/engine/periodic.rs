//! The steady cycle of a structure under a periodic drive, with sensitivities.
//!
//! From rest the drive is ramped up to its value at the start of the cycle (the declared loading path of history-dependent laws), then
//! cycles are marched until they repeat. What decays slowly is found by shooting: Newton's method on the state at the start of the
//! cycle, with the monodromy matrix from the march's own sensitivities; directions that never decay (an element that stays stuck) keep
//! what the loading path left there. A large system: `periodic::large`.

use nalgebra::DMatrix;

use crate::model::{Bound, Model};

use super::EngineError;
use super::march::{Loads, March, Probe, State};

mod fading;
mod large;
mod secants;
mod shooting;
mod work;

use shooting::{Shooting, solve_fixed_point};

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
/// Largest state for which the monodromy matrix is formed.
const SHOOT: usize = 200;
const CYCLES: usize = 300;
/// Cycles in which the change per cycle must halve, or it never ends: at rounding, or in a motion that does not repeat.
const STUCK: usize = 40;
/// Cycles of the loading path that are marched with sensitivities.
const PATH_CYCLES: usize = 3;
/// What a step with sensitivities costs before their first column, in columns.
const STEP: usize = 8;
/// Part of the change per cycle that a step with a kept monodromy matrix may leave.
const CHORD: f64 = 0.3;
/// Spectral radius at infinite frequency: little error of second order in what is resolved, and damping of what is not.
const RADIUS: f64 = 0.7;
/// The same of a large system, most of whose modes are not resolved: they vanish at once.
const STIFF_RADIUS: f64 = 0.0;

/// Marches to the steady cycle. `loads` holds one cycle: its first and last sample are equal.
pub fn periodic(model: &Model, bound: &Bound, loads: &Loads, probes: &[Probe], sensitivities: bool) -> Result<Cycle, EngineError> {
    let steps = length(loads);
    let columns = if sensitivities { bound.n_free } else { 0 };
    let rise = (steps / 4).max(16);
    let mut march = March::new(model, bound, loads, RADIUS)?;
    let mut z = Shooting::new(&march, &march.rest(0));
    if z.len() > SHOOT {
        march = March::new(model, bound, loads, STIFF_RADIUS)?;
        let state = ramp(model, bound, loads, rise, columns, STIFF_RADIUS)?;
        return large::steady(&mut march, state, &mut z, &large::Wanted { steps, probes, columns });
    }
    let mut state = ramp(model, bound, loads, rise, 0, RADIUS)?;
    let mut cycles = 0;
    let mut change = f64::INFINITY;
    let mut wait = 3;
    let mut inverse: Option<DMatrix<f64>> = None;
    // Least change so far, and when it was last halved.
    let (mut least, mut halved) = (f64::INFINITY, 0);
    while cycles < CYCLES && change >= TOLERANCE && cycles <= halved + STUCK {
        if change < 0.5 * least {
            (least, halved) = (change, cycles);
        }
        let before = state.clone();
        cycle(&mut march, &mut state, &mut z, steps)?;
        cycles += 1;
        work::bounded(&march, steps, cycles, work::CYCLES_SMALL)?;
        let last = change;
        change = z.change(&before, &state);
        // The monodromy matrix at hand serves as long as it brings the cycle closer.
        if let Some(m) = inverse.as_ref().filter(|_| change >= TOLERANCE) {
            if change < CHORD * last {
                z.correct(&mut state, &before, m);
                continue;
            }
            inverse = None;
        }
        // What decays quickly is marched; shooting is for slow decay, and is taken back where it does not help.
        if cycles >= wait && change >= TOLERANCE && change > 0.05 * last {
            let marched = state.clone();
            let shot = z.shoot(&mut march, &mut state, steps).and_then(|m| {
                let start = state.clone();
                cycle(&mut march, &mut state, &mut z, steps)?;
                Ok((z.change(&start, &state), start, m))
            });
            cycles += 2;
            match shot {
                Ok((after, start, m)) if after < 0.5 * change => {
                    change = after;
                    if change >= TOLERANCE {
                        z.correct(&mut state, &start, &m);
                        inverse = Some(m);
                    }
                }
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
    if z.len() == 0 || cycles * (STEP + columns) < STEP + columns + z.len() {
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
        let mut state = ramp(self.model, self.bound, self.loads, self.rise, self.columns, RADIUS)?;
        for _ in 0..self.cycles {
            for k in 1..=steps {
                march.step(k, &mut state, self.columns)?;
            }
        }
        Ok(state)
    }
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
fn ramp(model: &Model, bound: &Bound, loads: &Loads, steps: usize, columns: usize, radius: f64) -> Result<State, EngineError> {
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
    let mut march = March::loading(model, bound, &path, radius)?;
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
