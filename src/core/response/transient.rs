//! A whole record, marched from rest, or from the equilibrium under the loads that stay, at its first sample; one that begins in motion from
//! where it begins ([`super::beginning`]).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::data::{Control, TimeRecord, quietest};
use crate::effect::Moment;
use crate::engine::march::{Loads, March, Probe, State};
use crate::engine::{EngineError, equilibrium};
use crate::model::{Bound, FreeParam, Model, System};

use super::amplitude::amplitude;
use super::beginning::{Beginning, Opening, Start, samples_a_cycle};
use super::{Amplitude, Block, BlockKind, Computed, Plan, ResponseError, channel, site};

/// A transient test made ready.
#[derive(Clone, Debug)]
pub struct TransientPlan {
    /// What drives it, and the driven degree of freedom with the sign of the channel.
    drive: (Control, usize, f64),
    /// Its displacement, velocity and acceleration, or its force, at the samples.
    samples: Arc<[[f64; 3]]>,
    /// Sampling interval [s].
    dt: f64,
    /// Steps of the march from one sample to the next.
    stride: usize,
    loads: Loads,
    /// The same in half as many steps, where there are any: their difference takes the error of second order out of both (Richardson).
    half: Option<Loads>,
    /// Fewest steps from one sample to the next that were seen to be good enough for slopes and first looks.
    rough: Option<usize>,
    probes: Vec<(Probe, f64)>,
    moments: Vec<Moment>,
    /// Where it begins; none: at rest.
    beginning: Option<Beginning>,
}

/// Steps of a march at most.
const MOST_STEPS: usize = 400_000;

/// Steps from one sample to the next from which a march in half as many is extrapolated from.
const EXTRAPOLATED: usize = 2;

/// Part of its largest deflection that a channel has when it begins to move, and the fewest samples from there that are taken.
const MOVES: f64 = 0.05;
const SHORTEST: f64 = 16.0;

/// Spectral radius at infinite frequency: little damping of what the record resolves.
const RADIUS: f64 = 0.6;

impl TransientPlan {
    pub(super) fn new(record: &TimeRecord, model: &Model, plan: &mut Plan) -> Result<Self, ResponseError> {
        let id = plan.id.clone();
        let controlled = record.controlled().ok_or_else(|| {
            ResponseError::invalid(&id, "no channel drives the test", "control = \"displacement\" or \"force\", or input = true")
        })?;
        plan.notes.extend(record.notes.iter().map(|n| format!("{}: {}", n.about, n.text)));
        let control = if controlled.role == Control::Force.role() { Control::Force } else { Control::Displacement };
        let (dof, sign) = site::driven(model, &controlled.at, &id)?;
        let n = record.time.len();
        let dt = (record.time[n - 1] - record.time[0]) / (n - 1) as f64;
        let samples: Vec<[f64; 3]> = if control == Control::Displacement {
            let motion = record.history().motion(&controlled.at).map_err(|e| ResponseError::invalid(&id, e.to_string(), e.accepted()))?;
            plan.notes.extend(motion.notes.iter().map(|n| format!("{}: {}", n.about, n.text)));
            (0..n).map(|k| [motion.displacement[k], motion.velocity[k], motion.acceleration[k]]).collect()
        } else {
            controlled.values.iter().map(|f| [*f, 0.0, 0.0]).collect()
        };
        let driven_motion = control == Control::Displacement;
        let mut probes = Vec::new();
        for c in record.channels.iter().filter(|c| record.answers(c)) {
            probes.push(site::probe(model, c.role, &c.at, control, (dof, sign), &id)?);
            let start = plan.measured.len();
            let sigma = c.sigma.unwrap_or_else(|| sample_noise(&c.values));
            if c.sigma.is_none() {
                plan.notes.push(format!(
                    "{}: sigma {} from the scatter between neighbouring samples and the quietest band of the spectrum",
                    c.label(),
                    c.unit.print_difference(sigma)
                ));
            }
            let pick = |which: usize| if driven_motion { samples.iter().map(|s| s[which]).collect() } else { vec![] };
            let block = Block {
                label: c.label(),
                role: c.role.word().into(),
                unit: c.unit.dimension.si_unit(),
                stated: c.unit.clone(),
                amplitude_unit: None,
                kind: BlockKind::Record,
                range: start..start + n,
                abscissa: record.time.clone(),
                x: pick(0),
                v: pick(1),
            };
            plan.add_block(block, c.values.clone(), vec![sigma; n]);
        }
        let time = |k: usize| (k as f64 - 0.5 * (n - 1) as f64) * dt;
        let moment = |(k, s): (usize, &[f64; 3])| Moment { acceleration: if driven_motion { s[2] } else { 0.0 }, time: time(k) };
        let moments = samples.iter().enumerate().map(moment).collect();
        let loads = site::loads(control, dof, sign, dt, &samples);
        let beginning = Beginning::of(record, control, dof, model);
        plan.notes.extend(beginning.as_ref().map(|b| {
            format!(
                "the record begins in motion: displacements and velocities at its first sample are estimated from its first {:.3} s",
                b.samples() as f64 * dt
            )
        }));
        Ok(TransientPlan {
            drive: (control, dof, sign),
            samples: samples.into(),
            dt,
            stride: 1,
            loads,
            half: None,
            rough: None,
            probes,
            moments,
            beginning,
        })
    }

    /// The same test with twice as many steps; `None` where they would be too many.
    pub(super) fn finer(&self) -> Option<Self> {
        let stride = 2 * self.stride;
        (self.samples.len().saturating_mul(stride) <= MOST_STEPS).then(|| self.marched(stride))
    }

    /// That its steps are enough for slopes and first looks, unless fewer were.
    pub(super) fn serves_roughly(&mut self, than: usize) {
        self.rough.get_or_insert(than);
    }

    /// Steps of the march from one sample to the next.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    /// The same test in the fewest steps that serve for slopes and first looks; `None` where it has no more.
    pub(super) fn coarser(&self) -> Option<Self> {
        self.rough.filter(|rough| *rough < self.stride).map(|rough| self.marched(rough))
    }

    /// The samples of its first cycles, `1.5 2^doublings` of those in which its fastest channel moves; `None` where these are all.
    pub(super) fn opening(&self, plan: &Plan, doublings: u32) -> Option<usize> {
        let cycles = 1.5 * f64::from(doublings).exp2();
        let of = |block: &Block| {
            let x = &plan.measured[block.range.clone()];
            let most = x.iter().fold(0.0f64, |m, v| m.max((v - x[0]).abs()));
            let onset = x.iter().position(|v| (v - x[0]).abs() > MOVES * most)?;
            Some(onset + (cycles * samples_a_cycle(x)).ceil().max(SHORTEST) as usize)
        };
        plan.blocks.iter().filter_map(of).min().filter(|n| *n < self.moments.len())
    }

    /// The same test up to its `n`-th sample.
    pub(super) fn begun(&self, n: usize) -> Self {
        let beginning = self.beginning.as_ref().map(|b| b.begun(n));
        TransientPlan { samples: self.samples[..n].into(), moments: self.moments[..n].to_vec(), beginning, ..self.clone() }
            .marched(self.stride)
    }

    fn marched(&self, stride: usize) -> Self {
        let (control, dof, sign) = self.drive;
        let loads =
            |stride: usize| site::loads(control, dof, sign, self.dt / stride as f64, &between(control, &self.samples, self.dt, stride));
        let half = stride.is_multiple_of(EXTRAPOLATED).then(|| loads(stride / 2));
        TransientPlan { stride, loads: loads(stride), half, ..self.clone() }
    }

    pub(super) fn dt(&self) -> f64 {
        self.dt
    }
    pub(super) fn duration(&self) -> f64 {
        self.dt * self.moments.len() as f64
    }

    pub(super) fn evaluate(
        &self,
        system: &System,
        free: &[FreeParam],
        plan: &Plan,
        sensitivities: bool,
    ) -> Result<Computed, ResponseError> {
        let named = |source| ResponseError::Engine { test: plan.id.clone(), source };
        let bound = plan.bind(system, free)?;
        let columns = if sensitivities { bound.n_free } else { 0 };
        let start = self.start(system, &bound, columns, plan)?;
        let (mut values, mut slopes) = self.read(&system.model, &bound, &start, self.moments.len(), columns, plan).map_err(named)?;
        let mut out = Computed::default();
        for (values, slopes) in values.iter_mut().zip(&mut slopes) {
            out.values.append(values);
            out.slopes.append(slopes);
        }
        Ok(out)
    }

    /// Where the record begins, with its derivatives with respect to the first `columns` parameters.
    fn start(&self, system: &System, bound: &Bound, columns: usize, plan: &Plan) -> Result<Start, ResponseError> {
        let Some(beginning) = &self.beginning else { return Ok(Start::default()) };
        // A march whose columns are all perturbations of the start.
        let fixed = plan.bind(system, &[])?;
        let n = beginning.samples();
        let start = beginning.estimated(columns, |start, with| {
            let (bound, columns) = if with { (bound, columns + start.unknowns()) } else { (&fixed, start.unknowns()) };
            let (values, slopes) = self.read(&system.model, bound, start, n, columns, plan)?;
            Ok(self.opening_rows(plan, n, &values, &slopes, columns))
        });
        start.map_err(|source| ResponseError::Engine { test: plan.id.clone(), source })
    }

    /// The first `n` samples of every channel, whitened by sigma.
    fn opening_rows(&self, plan: &Plan, n: usize, values: &[Vec<f64>], slopes: &[Vec<f64>], columns: usize) -> Opening {
        let weight = |row: usize| if plan.left_out.contains(&row) { 0.0 } else { 1.0 / plan.sigma[row] };
        let row = |i: usize| (i / n, i % n, plan.blocks[i / n].range.start + i % n);
        let rows = values.len() * n;
        let weights: Vec<f64> = (0..rows).map(|i| weight(row(i).2)).collect();
        let residual = |i: usize| {
            let (block, k, at) = row(i);
            weights[i] * (values[block][k] - plan.measured[at])
        };
        let slope = |i: usize, c: usize| {
            let (block, k, _) = row(i);
            weights[i] * slopes[block][k * columns + c]
        };
        Opening { r: DVector::from_fn(rows, |i, _| residual(i)), slopes: DMatrix::from_fn(rows, columns, slope) }
    }

    /// What every channel reads at the first `n` samples, with `columns` slopes each.
    #[allow(clippy::type_complexity)]
    fn read(
        &self,
        model: &Model,
        bound: &Bound,
        start: &Start,
        n: usize,
        columns: usize,
        plan: &Plan,
    ) -> Result<(Vec<Vec<f64>>, Vec<Vec<f64>>), EngineError> {
        let (mut values, mut slopes) = self.marched_through((&self.loads, self.stride), model, bound, start, n, columns)?;
        if let Some(half) = &self.half {
            let (coarse, coarse_slopes) = self.marched_through((half, self.stride / 2), model, bound, start, n, columns)?;
            let beyond = |fine: &mut [Vec<f64>], coarse: &[Vec<f64>]| {
                let all = fine.iter_mut().flatten().zip(coarse.iter().flatten());
                all.for_each(|(f, c)| *f += (*f - c) / 3.0);
            };
            beyond(&mut values, &coarse);
            beyond(&mut slopes, &coarse_slopes);
        }
        for (i, block) in plan.blocks.iter().enumerate() {
            channel::apply(bound, &plan.id, &block.role, self.dt, false, &self.moments[..n], &mut values[i], &mut slopes[i]);
        }
        Ok((values, slopes))
    }

    /// What every probe reads in a march under these loads.
    #[allow(clippy::type_complexity)]
    fn marched_through(
        &self,
        loads: (&Loads, usize),
        model: &Model,
        bound: &Bound,
        start: &Start,
        n: usize,
        columns: usize,
    ) -> Result<(Vec<Vec<f64>>, Vec<Vec<f64>>), EngineError> {
        let (mut values, mut slopes) = (vec![vec![0.0; n]; self.probes.len()], vec![vec![0.0; n * columns]; self.probes.len()]);
        self.run(loads, model, bound, columns, start, n, |k, stepped, march, state| {
            let reads = |probe: &Probe| stepped || (probe.of_state() && model.space.is_none());
            for (i, (probe, sign)) in self.probes.iter().enumerate().filter(|(_, (probe, _))| reads(probe)) {
                let d = &mut slopes[i][k * columns..(k + 1) * columns];
                values[i][k] = sign * march.read(*probe, state, d);
                d.iter_mut().for_each(|d| *d *= sign);
            }
        })?;
        Ok((values, slopes))
    }

    /// Marches from a start and reads at the first `n` samples. The march starts with its first step, after which what it has before it is read: all
    /// of a record from rest; one that begins in motion is shown before it as well, for what needs no step to be read.
    fn run(
        &self,
        (loads, stride): (&Loads, usize),
        model: &Model,
        bound: &Bound,
        columns: usize,
        start: &Start,
        n: usize,
        mut each: impl FnMut(usize, bool, &March, &State),
    ) -> Result<(), EngineError> {
        let mut march = March::exact(model, bound, loads, RADIUS)?;
        march.reads_beyond_state = self.probes.iter().any(|(probe, _)| !probe.of_state());
        let held: Vec<(usize, f64)> = loads.prescribed.iter().map(|(dof, path)| (*dof, path[0][0])).collect();
        let mut state = march.start(equilibrium(model, bound, &held, columns)?, columns);
        start.apply(&mut state, columns);
        let before = if start.unknowns() > 0 { state.clone() } else { State::default() };
        for k in 1..n {
            for step in (k - 1) * stride + 1..=k * stride {
                march.step(step, &mut state, columns)?;
                if step == 1 {
                    each(0, true, &march, &state);
                    if start.unknowns() > 0 {
                        each(0, false, &march, &before);
                    }
                }
            }
            each(k, true, &march, &state);
        }
        Ok(())
    }

    pub(super) fn amplitudes(&self, system: &System, plan: &Plan) -> Result<Vec<Amplitude>, ResponseError> {
        let (model, bound) = (&system.model, plan.bind(system, &[])?);
        let start = self.start(system, &bound, 0, plan)?;
        let n = model.places.len();
        let mut seen = vec![vec![]; 2 * n];
        let run = self.run((&self.loads, self.stride), model, &bound, 0, &start, self.moments.len(), |_, stepped, march, state| {
            if !stepped {
                return;
            }
            for p in 0..n {
                seen[p].push(march.read(Probe::Relative(p), state, &mut []));
                seen[n + p].push(march.read(Probe::Force(p), state, &mut []));
            }
        });
        run.map_err(|source| ResponseError::Engine { test: plan.id.clone(), source })?;
        Ok((0..n).map(|p| amplitude(&seen[p], &seen[n + p], self.dt)).collect())
    }
}

/// The drive between its samples: a motion by the quintic that takes up displacement, velocity and acceleration at both ends, a force by the
/// cubic spline through all samples, which passes what an anti-aliasing filter does to a few parts in a thousand up to a third of the sampling frequency.
fn between(control: Control, samples: &[[f64; 3]], dt: f64, stride: usize) -> Vec<[f64; 3]> {
    let mut fine = Vec::with_capacity(samples.len() * stride);
    let bends = if control == Control::Force && stride > 1 { bends(samples) } else { vec![] };
    for k in 0..samples.len() - 1 {
        let (a, b) = (samples[k], samples[k + 1]);
        fine.extend((0..stride).map(|j| {
            let t = j as f64 / stride as f64;
            match control {
                Control::Displacement => quintic(a, b, dt, t),
                Control::Force if j == 0 => a,
                Control::Force => {
                    let s = 1.0 - t;
                    let bend = (s.powi(3) - s) * bends[k] + (t.powi(3) - t) * bends[k + 1];
                    [s * a[0] + t * b[0] + bend / 6.0, 0.0, 0.0]
                }
            }
        }));
    }
    fine.extend(samples.last());
    fine
}

/// Second derivatives, per step squared, of the natural cubic spline through equidistant samples: `m[k-1] + 4 m[k] + m[k+1] = 6 (f[k-1] - 2 f[k] + f[k+1])`.
fn bends(samples: &[[f64; 3]]) -> Vec<f64> {
    let n = samples.len();
    let (mut m, mut ahead) = (vec![0.0; n], vec![0.0; n]);
    for k in 1..n.saturating_sub(1) {
        let pivot = 4.0 - ahead[k - 1];
        ahead[k] = 1.0 / pivot;
        m[k] = (6.0 * (samples[k - 1][0] - 2.0 * samples[k][0] + samples[k + 1][0]) - m[k - 1]) / pivot;
    }
    for k in (1..n.saturating_sub(1)).rev() {
        m[k] -= ahead[k] * m[k + 1];
    }
    m
}

/// Displacement, velocity and acceleration at the part `t` of the interval `dt` between two states.
fn quintic(a: [f64; 3], b: [f64; 3], dt: f64, t: f64) -> [f64; 3] {
    let (v0, v1, a0, a1) = (a[1] * dt, b[1] * dt, a[2] * dt * dt, b[2] * dt * dt);
    // What the parabola from the first state misses at the second, in displacement, velocity and acceleration.
    let (e, f, g) = (b[0] - a[0] - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0);
    let (c3, c4, c5) = (10.0 * e - 4.0 * f + 0.5 * g, -15.0 * e + 7.0 * f - g, 6.0 * e - 3.0 * f + 0.5 * g);
    [
        a[0] + t * (v0 + t * (0.5 * a0 + t * (c3 + t * (c4 + t * c5)))),
        (v0 + t * (a0 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)))) / dt,
        (a0 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))) / (dt * dt),
    ]
}

/// Standard deviation of white noise on a signal: from third differences (variance factor 20) and their median, which jumps do not move, where the signal is
/// smooth from sample to sample; where it is not, they are the signal's, and the quietest band of the spectrum holds less ([`quietest`]).
pub(super) fn sample_noise(values: &[f64]) -> f64 {
    let mut d: Vec<f64> = values.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
    d.sort_by(f64::total_cmp);
    let range = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let median = d.get(d.len() / 2).copied().unwrap_or(0.0);
    let smooth = median / 0.6745 / 20f64.sqrt();
    quietest(values, smooth).unwrap_or(smooth).max(1e-6 * range).max(f64::MIN_POSITIVE)
}
