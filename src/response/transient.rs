//! A whole record, marched from rest, or from the equilibrium under the loads that stay, at its first sample.

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
    loads: Loads,
    probes: Vec<(Probe, f64)>,
    moments: Vec<Moment>,
}

/// Spectral radius at infinite frequency: little damping of what the record resolves.
const RADIUS: f64 = 0.6;

impl TransientPlan {
    pub(super) fn new(record: &TimeRecord, model: &Model, plan: &mut Plan) -> Result<Self, ResponseError> {
        let id = plan.id.clone();
        let controlled = record.controlled().ok_or_else(|| {
            ResponseError::invalid(&id, "no channel drives the test", "control = \"displacement\" or \"force\", or input = true")
        })?;
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
        use crate::data::Role;
        for c in record.channels.iter().filter(|c| !c.input && matches!(c.role, Role::Displacement | Role::Force)) {
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
        Ok(TransientPlan { loads: site::loads(control, dof, sign, dt, &samples), probes, moments })
    }

    pub(super) fn dt(&self) -> f64 {
        self.loads.dt
    }
    pub(super) fn duration(&self) -> f64 {
        self.loads.dt * self.moments.len() as f64
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
            // The march starts with its first step; rest before it reads as the state after it.
            values[i][0] = values[i][1];
            slopes[i].copy_within(n_free..2 * n_free, 0);
            channel::apply(bound, &plan.id, &block.role, self.loads.dt, false, &self.moments, &mut values[i], &mut slopes[i]);
            out.values.append(&mut values[i]);
            out.slopes.append(&mut slopes[i]);
        }
        Ok(out)
    }

    fn run(
        &self,
        model: &Model,
        bound: &Bound,
        columns: usize,
        mut each: impl FnMut(usize, &March, &crate::engine::march::State),
    ) -> Result<(), EngineError> {
        let mut march = March::new(model, bound, &self.loads, RADIUS)?;
        let mut state = march.start(equilibrium(model, bound, columns)?, columns);
        for k in 1..self.moments.len() {
            march.step(k, &mut state, columns)?;
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
        Ok((0..n).map(|p| amplitude(&seen[p], &seen[n + p], self.loads.dt)).collect())
    }
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
