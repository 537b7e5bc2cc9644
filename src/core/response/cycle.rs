//! The settled loop of a cycle test.

use std::f64::consts::TAU;
use std::sync::Arc;

use crate::data::{Control, FourierInput, TimeRecord};
use crate::effect::Moment;
use crate::engine::EngineError;
use crate::engine::harmonic::Expanded;
use crate::engine::march::{Loads, Probe};
use crate::engine::periodic::Cycle;
use crate::engine::steady::steady;
use crate::model::{Bound, Model};
use crate::units::Unit;

use super::amplitude::place_amplitudes;
use super::settling::Beginning;
use super::variation::{CycleDrive, Variation};
use super::{Amplitude, Block, BlockKind, Computed, Plan, ResponseError, Scatter, channel, site};

/// Steps per cycle at least, before [`Plan::refined`] looks whether they are enough.
const STEPS: usize = 200;

/// Steps per cycle at most.
const MOST_STEPS: usize = 6000;

/// A cycle test made ready.
#[derive(Clone, Debug)]
pub struct CyclePlan {
    loads: Loads,
    probes: Vec<(Probe, f64)>,
    /// Points per cycle and engine steps per point.
    points: usize,
    stride: usize,
    /// Acceleration of the driven end at every step, and time from the middle of the cycle as it lay in the record.
    moments: Vec<Moment>,
    drive: Drive,
    /// A cycle about which this one is balanced instead of marched, for a look.
    expanded: Option<Arc<Expanded>>,
}

/// What drives the test, from which its loads are sampled.
#[derive(Clone, Debug)]
struct Drive {
    input: FourierInput,
    /// Unit of the recorded drive.
    unit: Unit,
    phase: f64,
    frequency: f64,
    /// How the record comes to its kept cycles.
    beginning: Beginning,
    control: Control,
    dof: usize,
    sign: f64,
    /// Point with which the cycles begin in the record.
    first: usize,
    /// Steps per cycle at least.
    least: usize,
}

impl Drive {
    /// Value, velocity and acceleration over one cycle.
    fn samples(&self, steps: usize) -> Vec<[f64; 3]> {
        let at = |j: usize| self.input.at_phase(self.phase + TAU * j as f64 / steps as f64);
        (0..=steps).map(at).map(|(x, v, a)| [x, v, a]).collect()
    }
}

impl CyclePlan {
    pub(super) fn new(record: &TimeRecord, model: &Model, plan: &mut Plan) -> Result<Self, ResponseError> {
        let settled = record.settled()?;
        let control = record.control.unwrap_or(Control::Displacement);
        let controlled = &settled.channels[settled.controlled];
        let (dof, sign) = site::driven(model, &controlled.at, &plan.id)?;
        let n = settled.n;
        let stride = STEPS.div_ceil(n).max(1);
        let drive = Drive {
            input: settled.input.clone(),
            unit: controlled.unit.clone(),
            phase: settled.phase[0],
            frequency: settled.frequency,
            beginning: Beginning::of(record, &settled),
            control,
            dof,
            sign,
            first: settled.first,
            least: STEPS,
        };
        let samples = drive.samples(n * stride);
        let driven_motion = control == Control::Displacement;
        let mut probes = Vec::new();
        for (c, _) in settled.channels.iter().zip(&record.channels).filter(|(_, recorded)| record.answers(recorded)) {
            // The force of a machine that drives one end of a connector is the reaction there.
            probes.push(site::probe(model, c.role, &c.at, control, (dof, sign), &plan.id)?);
            let start = plan.measured.len();
            let at_points = |which: usize| {
                if driven_motion { (0..n).map(|i| samples[i * stride][which]).collect() } else { vec![] }
            };
            let block = Block {
                label: format!("{} at {}", c.role.word(), c.at),
                role: c.role.word().into(),
                unit: c.unit.dimension.si_unit(),
                stated: c.unit.clone(),
                amplitude_unit: None,
                kind: BlockKind::Loop,
                range: start..start + n,
                abscissa: settled.phase.clone(),
                x: if driven_motion { at_points(0) } else { controlled.mean.clone() },
                v: at_points(1),
            };
            plan.add_block(block, c.mean.clone(), vec![c.sigma_mean; n]);
            let crept = c.drift * (settled.left_out + settled.cycles) as f64;
            plan.scatter.push(Scatter { variance: c.scatter.clone(), cycles: settled.cycles, crept });
        }
        plan.unsettled.extend(settled.unsettled.iter().cloned());
        plan.clipped = record.clipped(&settled).into_iter().map(|(role, _, why)| (role.word().to_string(), why)).collect();
        let found = record.findings_of(&settled);
        plan.notes.extend(record.notes.iter().chain(&settled.notes).chain(&found).map(|n| format!("{}: {}", n.about, n.text)));
        Ok(Self::sampled(drive, probes, n, stride))
    }

    fn sampled(drive: Drive, probes: Vec<(Probe, f64)>, points: usize, stride: usize) -> Self {
        let steps = points * stride;
        let samples = drive.samples(steps);
        let driven_motion = drive.control == Control::Displacement;
        let loads = site::loads(drive.control, drive.dof, drive.sign, 1.0 / (drive.frequency * steps as f64), &samples);
        // The last step ends at the first point. The middle of the points of the cycle, not of its steps, is time 0.
        let middle = (points - 1) as f64 / 2.0 * stride as f64;
        let time = |k: usize| (((k + 1 + steps - drive.first * stride) % steps) as f64 - middle) * loads.dt;
        let moment = |(k, s): (usize, &[f64; 3])| Moment { acceleration: if driven_motion { s[2] } else { 0.0 }, time: time(k) };
        let moments = samples.iter().skip(1).enumerate().map(moment).collect();
        CyclePlan { loads, probes, points, stride, moments, drive, expanded: None }
    }

    /// The same test marched with twice the steps; `None` where it has as many as it may.
    pub(super) fn finer(&self) -> Option<Self> {
        (self.points * self.stride < MOST_STEPS)
            .then(|| Self::sampled(self.drive.clone(), self.probes.clone(), self.points, 2 * self.stride))
    }

    /// Every `part`-th point of the loop, with half as many steps per cycle to begin with.
    pub(super) fn thinned(&self, part: usize) -> Self {
        let points = self.points / part;
        let drive = Drive { first: self.drive.first / part, least: STEPS / 2, ..self.drive.clone() };
        let stride = drive.least.div_ceil(points).max(1);
        Self::sampled(drive, self.probes.clone(), points, stride)
    }

    /// Points per cycle.
    pub(super) fn points(&self) -> usize {
        self.points
    }

    /// The same test with fewer steps per cycle where it has more than `steps`, though never fewer than it began with.
    pub(super) fn coarser(&self, steps: usize) -> Self {
        let least = self.drive.least.div_ceil(self.points).max(1);
        let stride = (steps / self.points).clamp(least, self.stride.max(least));
        Self::sampled(self.drive.clone(), self.probes.clone(), self.points, stride)
    }

    /// The same test balanced about the cycle of this system, where it is one of parts that turn far; `None` where it is not.
    pub(super) fn expanded(&self, model: &Model, bound: &Bound) -> Option<Self> {
        let probes: Vec<Probe> = self.probes.iter().map(|p| p.0).collect();
        let expanded = Expanded::about(model, bound, &self.loads, &probes).ok()??;
        Some(CyclePlan { expanded: Some(Arc::new(expanded)), ..self.clone() })
    }

    /// How the record comes to its kept cycles.
    pub(super) fn beginning(&self) -> &Beginning {
        &self.drive.beginning
    }
    pub(super) fn loads(&self) -> &Loads {
        &self.loads
    }
    pub(super) fn probes(&self) -> &[(Probe, f64)] {
        &self.probes
    }
    /// Steps per cycle.
    pub(super) fn steps(&self) -> usize {
        self.points * self.stride
    }
    /// The point of the loop that the end of step `k` (from 1) is.
    pub(super) fn point_at(&self, k: usize) -> Option<usize> {
        k.is_multiple_of(self.stride).then(|| k / self.stride % self.points)
    }

    pub(super) fn period(&self) -> f64 {
        self.loads.dt * (self.points * self.stride) as f64
    }

    /// Another drive of the same shape.
    pub(super) fn varied(&self, by: &Variation) -> Self {
        let mut plan = CyclePlan { expanded: None, ..self.clone() };
        plan.loads.dt /= by.frequency;
        let (f, a) = (by.frequency, by.amplitude);
        for (_, path) in &mut plan.loads.prescribed {
            let (mean, half) = middle(path.iter().map(|s| s[0]));
            let shifted = mean + by.mean * a * half;
            path.iter_mut().for_each(|s| *s = [shifted + a * (s[0] - mean), a * f * s[1], a * f * f * s[2]]);
        }
        for (_, path) in &mut plan.loads.forces {
            let (mean, half) = middle(path.iter().copied());
            let shifted = mean + by.mean * a * half;
            path.iter_mut().for_each(|s| *s = shifted + a * (*s - mean));
        }
        for m in &mut plan.moments {
            *m = Moment { acceleration: m.acceleration * a * f * f, time: m.time / f };
        }
        plan
    }

    /// Frequency, half range and mean of the drive, from its samples.
    pub(super) fn drive(&self) -> CycleDrive {
        let prescribed = self.loads.prescribed.iter().map(|(_, path)| middle(path.iter().map(|s| s[0])));
        let all = prescribed.chain(self.loads.forces.iter().map(|(_, path)| middle(path.iter().copied())));
        let (mean, amplitude) = all.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        CycleDrive { frequency: 1.0 / self.period(), amplitude, mean: mean * self.drive.sign, unit: self.drive.unit.clone() }
    }

    pub(super) fn evaluate(&self, model: &Model, bound: &Bound, plan: &Plan, sensitivities: bool) -> Result<Computed, EngineError> {
        let probes: Vec<Probe> = self.probes.iter().map(|p| p.0).collect();
        let mut cycle = computed(self.expanded.as_deref(), model, bound, &self.loads, &probes, sensitivities)?;
        let n_free = cycle.columns;
        let mut out = Computed::default();
        for (i, block) in plan.blocks.iter().enumerate() {
            let sign = self.probes[i].1;
            cycle.values[i].iter_mut().for_each(|v| *v *= sign);
            cycle.slopes[i].iter_mut().for_each(|v| *v *= sign);
            let (values, slopes) = (&mut cycle.values[i], &mut cycle.slopes[i]);
            channel::apply(bound, &plan.id, &block.role, self.loads.dt, true, &self.moments, values, slopes);
            let steps = cycle.steps;
            for point in 0..self.points {
                // Point 0 is the start of the cycle, which the march reports as its end.
                let k = (point * self.stride + steps - 1) % steps;
                out.values.push(values[k]);
                out.slopes.extend_from_slice(&slopes[k * n_free..(k + 1) * n_free]);
            }
        }
        Ok(out)
    }

    pub(super) fn amplitudes(&self, model: &Model, bound: &Bound) -> Result<Vec<Amplitude>, EngineError> {
        place_amplitudes(model, bound, &self.loads)
    }
}

/// The steady cycle, about one that it is expanded about or by itself.
pub(super) fn computed(
    about: Option<&Expanded>,
    model: &Model,
    bound: &Bound,
    loads: &Loads,
    probes: &[Probe],
    sensitivities: bool,
) -> Result<Cycle, EngineError> {
    match about {
        Some(about) => about.steady(model, bound, loads, probes, sensitivities),
        None => steady(model, bound, loads, probes, sensitivities),
    }
}

/// Middle and half of the range.
fn middle(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    (0.5 * (low + high), 0.5 * (high - low))
}
