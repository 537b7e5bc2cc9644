//! Whether the model's own transient has decayed when the record of a cycle test begins to be kept.
//!
//! The test is marched from rest, through the discarded cycles with the amplitudes that its drive has there, then through the kept ones and
//! as many after them; the mean of the kept cycles is held against the last one marched.

use crate::data::{SettledLoop, TimeRecord};
use crate::engine::EngineError;
use crate::engine::march::{Loads, March};
use crate::model::{Bound, Model};

use super::{CyclePlan, Plan};

/// Steps over all cycles that are aimed at; short cycles of many steps are marched with fewer.
const STEPS: usize = 20_000;
/// Steps beyond which nothing is computed, and nothing claimed.
const MOST_STEPS: usize = 400_000;
/// Kept cycles that are looked at: what decays stands in the first of them.
const KEPT: usize = 20;
/// Cycles marched after the kept ones at least.
const AFTER: usize = 20;
/// Change from cycle to cycle, in units of sigma, at which the march has settled.
const STILL: f64 = 1e-3;
/// Spectral radius at infinite frequency: little damping of what is resolved.
const RADIUS: f64 = 0.7;

/// The first cycle of a record counts as another than the settled one beyond so many standard deviations.
const OTHER: f64 = 5.0;
/// A drive whose first cycle has this part of its amplitude starts at once.
const AT_ONCE: f64 = 0.97;

/// How a record comes to its kept cycles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Beginning {
    /// Amplitude of the drive in each discarded cycle, over that of the kept ones.
    amplitudes: Vec<f64>,
    /// Cycles kept.
    kept: usize,
    /// Whether the record shows a start: its first cycle is not yet the settled one.
    starts: bool,
}

impl Beginning {
    pub fn of(record: &TimeRecord, settled: &SettledLoop) -> Self {
        let discarded = settled.left_out;
        let begin = record.time.first().copied().unwrap_or(0.0);
        // A sample that falls on the end of a cycle may lie a rounding before it.
        let at = |c: usize| record.time.partition_point(|t| (t - begin) * settled.frequency < c as f64 - 1e-6);
        let cycle = |values: &[f64], c: usize| values.get(at(c)..at(c + 1)).map(<[f64]>::to_vec).unwrap_or_default();
        let half = |values: &[f64]| {
            let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            0.5 * (high - low)
        };
        let full = settled.channels.get(settled.controlled).map_or(0.0, |c| half(&c.mean));
        let drive = record.controlled().map_or(&[][..], |c| &c.values);
        let amplitudes: Vec<f64> = (0..discarded).map(|c| (half(&cycle(drive, c)) / full).clamp(0.0, 1.0)).collect();
        let other = |(channel, own): (&crate::data::Channel, &crate::data::LoopChannel)| {
            let (first, n) = (cycle(&channel.values, 0), settled.n as f64);
            let moments = |v: &[f64]| {
                let mean = v.iter().sum::<f64>() / v.len().max(1) as f64;
                (mean, (v.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / v.len().max(1) as f64).sqrt())
            };
            let ((m0, s0), (m, s)) = (moments(&first), moments(&own.mean));
            // The noise adds to the spread of a single cycle.
            let s0 = (s0 * s0 - own.sigma_sample.powi(2)).max(0.0).sqrt();
            let limit = OTHER * own.sigma_sample / n.sqrt();
            !first.is_empty() && ((m0 - m).abs() > limit || (s0 - s).abs() > limit)
        };
        let starts = record.channels.iter().zip(&settled.channels).any(other);
        Beginning { amplitudes, kept: settled.cycles, starts }
    }

    /// Part of its amplitude that the drive has, and its change per cycle, `at` cycles after the start.
    fn envelope(&self, at: f64) -> (f64, f64) {
        let a = &self.amplitudes;
        let (Some(first), last) = (a.first(), a.len() as f64) else { return (1.0, 0.0) };
        // Straight between the middles of the cycles, and on to 1 at the end of the discarded ones.
        let second = a.get(1).unwrap_or(&1.0);
        let start = if *first >= AT_ONCE { *first } else { (first - 0.5 * (second - first)).clamp(0.0, *first) };
        let knot = |k: usize| match k {
            0 => (0.0, start),
            k if k <= a.len() => (k as f64 - 0.5, a[k - 1]),
            _ => (last, 1.0),
        };
        let k = ((at + 0.5).floor() as usize).min(a.len());
        let ((x0, y0), (x1, y1)) = (knot(k), knot(k + 1));
        let slope = (y1 - y0) / (x1 - x0);
        (y0 + slope * (at - x0), slope)
    }

    /// The drive of the discarded cycles, from that of one settled cycle of `steps` steps.
    fn loads(&self, one: &Loads, steps: usize) -> Loads {
        let samples = 0..=self.amplitudes.len() * steps;
        let per_second = 1.0 / (one.dt * steps as f64);
        let envelope = |k: usize| {
            let (e, slope) = self.envelope(k as f64 / steps as f64);
            (e, slope * per_second)
        };
        let motion = |path: &[[f64; 3]], k: usize| {
            let (e, rate) = envelope(k);
            let [x, v, a] = path[k % steps];
            [e * x, e * v + rate * x, e * a + 2.0 * rate * v]
        };
        Loads {
            dt: one.dt,
            prescribed: one.prescribed.iter().map(|(d, p)| (*d, samples.clone().map(|k| motion(p, k)).collect())).collect(),
            forces: one.forces.iter().map(|(d, f)| (*d, samples.clone().map(|k| envelope(k).0 * f[k % steps]).collect())).collect(),
        }
    }
}

/// What is left of the transient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transient {
    /// Cycles the dataset discards.
    pub discarded: usize,
    /// What is left in the mean of the kept cycles: root mean square over the points, in units of sigma.
    pub left: f64,
    /// Cycles after which the rest is below `enough`; none where it is longer than what was marched.
    pub needed: Option<usize>,
}

/// Marches the test; none where the record shows no start, or has too many cycles to be marched. `enough`: what may be left, in units of sigma.
pub(super) fn transient(
    cycle: &CyclePlan,
    model: &Model,
    bound: &Bound,
    plan: &Plan,
    enough: f64,
) -> Result<Option<Transient>, EngineError> {
    let beginning = cycle.beginning();
    if !beginning.starts {
        return Ok(None);
    }
    let (discarded, kept) = (beginning.amplitudes.len(), beginning.kept);
    let looked = kept.min(KEPT);
    let all = discarded + looked + AFTER.max(discarded).max(looked);
    let coarse = cycle.coarser(STEPS / all.max(1));
    let steps = coarse.steps();
    if all.saturating_mul(steps) > MOST_STEPS {
        return Ok(None);
    }
    let started = beginning.loads(coarse.loads(), steps);
    let mut march = March::new(model, bound, &started, RADIUS)?;
    let mut state = march.rest(0);
    for k in 1..=discarded * steps {
        march.step(k, &mut state, 0)?;
    }
    let mut march = March::new(model, bound, coarse.loads(), RADIUS)?;
    let mut seen: Vec<Vec<f64>> = Vec::with_capacity(all - discarded);
    let distance = |a: &[f64], b: &[f64]| {
        let sum: f64 = a.iter().zip(b).zip(&plan.sigma).map(|((a, b), s)| ((a - b) / s).powi(2)).sum();
        (sum / plan.len().max(1) as f64).sqrt()
    };
    for _ in discarded..all {
        let mut values = vec![0.0; plan.len()];
        for k in 1..=steps {
            march.step(k, &mut state, 0)?;
            if let Some(point) = coarse.point_at(k) {
                for (block, (probe, sign)) in plan.blocks.iter().zip(coarse.probes()) {
                    values[block.range.start + point] = sign * march.read(*probe, &state, &mut []);
                }
            }
        }
        let still = seen.last().is_some_and(|before| distance(before, &values) < STILL);
        seen.push(values);
        if still {
            break;
        }
    }
    let Some(end) = seen.last() else { return Ok(None) };
    let mut mean = vec![0.0; plan.len()];
    for values in seen.iter().take(looked) {
        mean.iter_mut().zip(values.iter().zip(end)).for_each(|(m, (v, e))| *m += (v - e) / kept as f64);
    }
    let left = distance(&mean, &vec![0.0; plan.len()]);
    let needed = (1..seen.len() - 1).find(|c| distance(&seen[*c], end) < enough).map(|c| discarded + c);
    Ok(Some(Transient { discarded, left, needed }))
}
