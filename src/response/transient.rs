//! A whole record, marched from rest, or from the equilibrium under the loads that stay, at its first sample.

use std::sync::Arc;

use crate::data::{Control, TimeRecord};
use crate::effect::Moment;
use crate::engine::march::{Loads, March, Probe};
use crate::engine::{EngineError, equilibrium};
use crate::model::{Bound, Model};

use super::cycle::amplitude;
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
    probes: Vec<(Probe, f64)>,
    moments: Vec<Moment>,
}

/// Steps of a march at most.
const MOST_STEPS: usize = 400_000;

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
                plan.notes.push(format!("{}: sigma {sigma:.3e} from the scatter between neighbouring samples", c.label()));
            }
            let pick = |which: usize| if driven_motion { samples.iter().map(|s| s[which]).collect() } else { vec![] };
            let block = Block {
                label: c.label(),
                role: c.role.word().into(),
                unit: c.unit.dimension.si_unit(),
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
        Ok(TransientPlan { drive: (control, dof, sign), samples: samples.into(), dt, stride: 1, loads, probes, moments })
    }

    /// The same test with twice as many steps; `None` where they would be too many.
    pub(super) fn finer(&self) -> Option<Self> {
        let stride = 2 * self.stride;
        (self.samples.len().saturating_mul(stride) <= MOST_STEPS).then(|| self.marched(stride))
    }

    /// The same test with this part of its steps, one per sample at least; `None` where it has no more.
    pub(super) fn coarser(&self, part: usize) -> Option<Self> {
        let stride = (self.stride / part).max(1);
        (stride < self.stride).then(|| self.marched(stride))
    }

    /// The samples of its first cycles, `1.5 2^doublings` of those in which its fastest channel moves; `None` where these are all.
    pub(super) fn opening(&self, plan: &Plan, doublings: u32) -> Option<usize> {
        let cycles = 1.5 * f64::from(doublings).exp2();
        let of = |block: &Block| {
            let x = &plan.measured[block.range.clone()];
            let most = x.iter().fold(0.0f64, |m, v| m.max((v - x[0]).abs()));
            let onset = x.iter().position(|v| (v - x[0]).abs() > MOVES * most)?;
            let mean = x.iter().sum::<f64>() / x.len() as f64;
            let square: f64 = x.iter().map(|v| (v - mean).powi(2)).sum();
            let rate: f64 = x.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
            // Rice's mean frequency, rms of the rate over that of the value.
            let samples = std::f64::consts::TAU * (square / rate).sqrt();
            Some(onset + (cycles * samples).ceil().max(SHORTEST) as usize)
        };
        plan.blocks.iter().filter_map(of).min().filter(|n| *n < self.moments.len())
    }

    /// The same test up to its `n`-th sample.
    pub(super) fn begun(&self, n: usize) -> Self {
        TransientPlan { samples: self.samples[..n].into(), moments: self.moments[..n].to_vec(), ..self.clone() }.marched(self.stride)
    }

    fn marched(&self, stride: usize) -> Self {
        let (control, dof, sign) = self.drive;
        let loads = site::loads(control, dof, sign, self.dt / stride as f64, &between(control, &self.samples, self.dt, stride));
        TransientPlan { stride, loads, ..self.clone() }
    }

    pub(super) fn dt(&self) -> f64 {
        self.dt
    }
    pub(super) fn duration(&self) -> f64 {
        self.dt * self.moments.len() as f64
    }

    pub(super) fn evaluate(&self, model: &Model, bound: &Bound, plan: &Plan, sensitivities: bool) -> Result<Computed, EngineError> {
        let n = self.moments.len();
        let n_free = if sensitivities { bound.n_free } else { 0 };
        let (mut values, mut slopes) = (vec![vec![0.0; n]; self.probes.len()], vec![vec![0.0; n * n_free]; self.probes.len()]);
        self.run(model, bound, n_free, |k, march, state| {
            for (i, (probe, sign)) in self.probes.iter().enumerate() {
                let d = &mut slopes[i][k * n_free..(k + 1) * n_free];
                values[i][k] = sign * march.read(*probe, state, d);
                d.iter_mut().for_each(|d| *d *= sign);
            }
        })?;
        let mut out = Computed::default();
        for (i, block) in plan.blocks.iter().enumerate() {
            channel::apply(bound, &plan.id, &block.role, self.dt, false, &self.moments, &mut values[i], &mut slopes[i]);
            out.values.append(&mut values[i]);
            out.slopes.append(&mut slopes[i]);
        }
        Ok(out)
    }

    /// Marches and reads at every sample. The march starts with its first step; rest before it reads as the state after it.
    fn run(
        &self,
        model: &Model,
        bound: &Bound,
        columns: usize,
        mut each: impl FnMut(usize, &March, &crate::engine::march::State),
    ) -> Result<(), EngineError> {
        let mut march = March::new(model, bound, &self.loads, RADIUS)?;
        let held: Vec<(usize, f64)> = self.loads.prescribed.iter().map(|(dof, path)| (*dof, path[0][0])).collect();
        let mut state = march.start(equilibrium(model, bound, &held, columns)?, columns);
        for k in 1..self.moments.len() {
            for step in (k - 1) * self.stride + 1..=k * self.stride {
                march.step(step, &mut state, columns)?;
                if step == 1 {
                    each(0, &march, &state);
                }
            }
            each(k, &march, &state);
        }
        Ok(())
    }

    pub(super) fn amplitudes(&self, model: &Model, bound: &Bound) -> Result<Vec<Amplitude>, EngineError> {
        let n = model.places.len();
        let mut seen = vec![vec![]; 2 * n];
        self.run(model, bound, 0, |_, march, state| {
            for p in 0..n {
                seen[p].push(march.read(Probe::Relative(p), state, &mut []));
                seen[n + p].push(march.read(Probe::Force(p), state, &mut []));
            }
        })?;
        Ok((0..n).map(|p| amplitude(&seen[p], &seen[n + p], self.dt)).collect())
    }
}

/// The drive between its samples: a motion by the quintic that takes up displacement, velocity and acceleration at both ends, a force by the
/// cubic through the two samples at either side.
fn between(control: Control, samples: &[[f64; 3]], dt: f64, stride: usize) -> Vec<[f64; 3]> {
    let mut fine = Vec::with_capacity(samples.len() * stride);
    for k in 0..samples.len() - 1 {
        let (a, b) = (samples[k], samples[k + 1]);
        let (before, after) = (samples[k.saturating_sub(1)][0], samples[(k + 2).min(samples.len() - 1)][0]);
        fine.extend((0..stride).map(|j| {
            let t = j as f64 / stride as f64;
            match control {
                Control::Displacement => quintic(a, b, dt, t),
                Control::Force => {
                    let (p, q) = (0.5 * (b[0] - before), 0.5 * (after - a[0]));
                    let (c3, c2) = (2.0 * (a[0] - b[0]) + p + q, 3.0 * (b[0] - a[0]) - 2.0 * p - q);
                    [a[0] + t * (p + t * (c2 + t * c3)), 0.0, 0.0]
                }
            }
        }));
    }
    fine.extend(samples.last());
    fine
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

/// Standard deviation of white noise on a smooth signal, from third differences (variance factor 20) and their median, which jumps do
/// not move.
fn sample_noise(values: &[f64]) -> f64 {
    let mut d: Vec<f64> = values.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
    d.sort_by(f64::total_cmp);
    let range = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let median = d.get(d.len() / 2).copied().unwrap_or(0.0);
    (median / 0.6745 / 20f64.sqrt()).max(1e-6 * range).max(f64::MIN_POSITIVE)
}
