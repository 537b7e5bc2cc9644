//! The steady cycle of a large system, whose monodromy matrix would take hundreds of columns.
//!
//! Values are marched until they repeat within [`REPEATS`], each cycle from where the secants of the last ones say. Then the sensitivities
//! are marched along the steady values, where a cycle is an affine map `S -> M S + b` with one `M` for all columns: every column of two
//! cycles is a secant for all of them, and so few cycles suffice. States that only fade are taken where they stand once the cycle
//! repeats ([`Fades`]). What a stuck slider keeps depends on the loading path: the sensitivities
//! start from those at the end of the first [`PATH`] cycles.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector};

use super::fading::Fades;
use super::secants::{Pass, Secants};
use super::shooting::Shooting;
use super::{CYCLES, Cycle, follow, record_with, with_columns, work};
use crate::engine::EngineError;
use crate::engine::march::{March, Probe, State};

/// Change per cycle, relative to the largest value in the cycle, at which values repeat, and sensitivities.
const REPEATS: f64 = 1e-7;
const SENSED: f64 = 1e-5;
/// Cycles after which the sensitivities are taken as they are.
const ROUNDS: usize = 12;
/// Cycles of the loading path that are marched with sensitivities.
const PATH: usize = 2;
/// Differences of cycles that the secants of values are taken from: more of them are older than the motion is linear.
const KEPT: usize = 5;
/// The first cycle that starts where the secants say is the one after this.
const FIRST: usize = 3;
/// Cycles marched on where a start by the secants was taken back, before the next.
const REST: usize = 1;
/// Most that a secant may move a start, per change that it takes away: decay by one part in so many per cycle. Beyond it secants of values
/// say more of what is not linear than of decay; those of sensitivities are exact but for rounding.
const OPEN: f64 = 100.0;
const AFFINE: f64 = 1000.0;
/// Secants of sensitivities at most.
const MOST: usize = 100;
/// What creeps takes ever more cycles for ever less: after so many, more than any test is run in before it is recorded, this change per
/// cycle will do.
const LONG: usize = 20;
const CREEPS: f64 = 1e-5;
/// Cycles in which the change per cycle must halve.
const STUCK: usize = 10;

/// What is read of the steady cycle.
pub(super) struct Wanted<'a> {
    pub steps: usize,
    pub probes: &'a [Probe],
    pub columns: usize,
}

/// From the end of the ramp, with sensitivities, to the steady cycle.
pub(super) fn steady(march: &mut March, state: State, z: &mut Shooting, wanted: &Wanted<'_>) -> Result<Cycle, EngineError> {
    let (mut cycle, mut state, path) = values(march, state, z, wanted)?;
    if wanted.columns == 0 || cycle.columns > 0 {
        return Ok(cycle);
    }
    follow(march, &mut state, wanted.steps)?;
    let slopes = sensitivities(march, &state, &path, z, wanted)?;
    cycle.cycles += slopes.cycles;
    Ok(Cycle { cycles: cycle.cycles, ..slopes })
}

/// Marches until the values repeat: the last cycle, its end, and the end of the loading path with its sensitivities. The cycle has
/// sensitivities where they repeat as well.
fn values(march: &mut March, mut state: State, z: &mut Shooting, wanted: &Wanted<'_>) -> Result<(Cycle, State, State), EngineError> {
    let (mut least, mut halved, mut rest) = (f64::INFINITY, 0, 0);
    let mut passes: VecDeque<(State, State)> = VecDeque::new();
    let mut path = State::default();
    // Where the last cycle ended, and how much it moved, if this one starts elsewhere.
    let mut marched: Option<(State, f64)> = None;
    let fades = Fades::of(march, wanted.steps);
    for cycles in 1..=CYCLES {
        let columns = if cycles <= PATH { wanted.columns } else { 0 };
        let start = state.clone();
        let done = record_with(march, &mut state, wanted.steps, wanted.probes, columns, Some(z));
        work::bounded(march, wanted.steps, cycles, work::CYCLES_LARGE)?;
        let change = z.slow_change(&start, &state);
        if let Some((stood, moved)) = marched.take()
            && (done.is_err() || change > moved.max(REPEATS))
        {
            state = stood;
            rest = REST;
            // It was no cycle on the way.
            halved += 1;
            continue;
        }
        let mut cycle = done?;
        cycle.cycles = cycles;
        if change < 0.5 * least {
            (least, halved) = (change, cycles);
        }
        let last = cycles == CYCLES || cycles > halved + STUCK;
        let repeats = change < if cycles > LONG { CREEPS } else { REPEATS } || (last && change <= 1e-6);
        if last && !repeats {
            return Err(EngineError::NotPeriodic { change, cycles });
        }
        if columns > 0 {
            if repeats && state.fs.is_empty() && settled(&z.pack_columns(&start, columns), &z.pack_columns(&state, columns)) {
                return Ok((cycle, state, path));
            }
            path = state.clone();
            if cycles == PATH || repeats {
                march.set_columns(&mut state, 0);
            }
        }
        if repeats {
            return Ok((Cycle { columns: 0, ..cycle }, state, path));
        }
        let repeated = fades.repeated(march, &start, &state, 0);
        passes.push_back((start, repeated));
        if passes.len() > KEPT + 1 {
            passes.pop_front();
        }
        if rest > 0 {
            rest -= 1;
        } else if cycles >= FIRST {
            let next = z.unpacked(&next_start(&passes, z), &state);
            marched = Some((std::mem::replace(&mut state, next), change));
        }
    }
    Err(EngineError::NotPeriodic { change: f64::INFINITY, cycles: CYCLES })
}

/// Where the cycle after these is to start.
fn next_start(passes: &VecDeque<(State, State)>, z: &Shooting) -> DVector<f64> {
    let pass = |(a, b): &(State, State)| Pass { start: z.pack(a), end: z.pack(b), readings: DVector::zeros(0) };
    let passes: Vec<Pass> = passes.iter().map(pass).collect();
    let mut secants = Secants::within(OPEN);
    passes.windows(2).rev().for_each(|w| secants.add(&w[0], &w[1]));
    passes.last().map_or(DVector::zeros(0), |pass| secants.combined(pass).end)
}

fn settled(before: &DMatrix<f64>, after: &DMatrix<f64>) -> bool {
    (0..after.ncols()).all(|c| (before.column(c) - after.column(c)).amax() <= SENSED * after.column(c).amax())
}

/// The cycle from `start` with its sensitivities, which begin as those of `path`.
fn sensitivities(march: &mut March, start: &State, path: &State, z: &Shooting, wanted: &Wanted<'_>) -> Result<Cycle, EngineError> {
    let (steps, columns, n) = (wanted.steps, wanted.columns, wanted.probes.len());
    let mut state = with_columns(march, start, Some(path), columns);
    let mut secants = Secants::within(AFFINE);
    let mut passes: Vec<Pass> = vec![];
    let fades = Fades::of(march, steps);
    for cycles in 1..=ROUNDS + 1 {
        let (begun, begin) = (state.clone(), z.pack_columns(&state, columns));
        let mut cycle = record_with(march, &mut state, steps, wanted.probes, columns, None)?;
        cycle.cycles = cycles;
        let end = z.pack_columns(&fades.repeated(march, &begun, &state, columns), columns);
        let reading = |c: usize| DVector::from_fn(n * steps, |r, _| cycle.slopes[r / steps][r % steps * columns + c]);
        let pass = |c: usize| Pass { start: begin.column(c).into_owned(), end: end.column(c).into_owned(), readings: reading(c) };
        let new: Vec<Pass> = (0..columns).map(pass).collect();
        for (before, after) in passes.iter().zip(&new).take(MOST - secants.len().min(MOST)) {
            secants.add(before, after);
        }
        let combined: Vec<Pass> = new.iter().map(|pass| secants.combined(pass)).collect();
        passes = new;
        let near = |p: &Pass| p.change().amax() <= SENSED * p.end.amax();
        if combined.iter().all(near) || cycles > ROUNDS {
            for (c, pass) in combined.iter().enumerate() {
                (0..n * steps).for_each(|r| cycle.slopes[r / steps][r % steps * columns + c] = pass.readings[r]);
            }
            return Ok(cycle);
        }
        let ends: Vec<DVector<f64>> = combined.into_iter().map(|p| p.end).collect();
        state = with_columns(march, start, Some(&state), columns);
        z.unpack_columns(&DMatrix::from_columns(&ends), &mut state);
    }
    Err(EngineError::NotPeriodic { change: f64::INFINITY, cycles: ROUNDS })
}
