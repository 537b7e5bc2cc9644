//! Energies per cycle of a sinusoidal test, row by row of a table, compared by their logarithms.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

use crate::parallel;
use num_dual::Dual64;

use crate::data::{Control, EnergyTable, StoredEnergy, TableValue};
use crate::effect::Num;
use crate::engine::harmonic::Expanded;
use crate::engine::march::{Loads, Probe};
use crate::engine::periodic::Cycle;
use crate::model::{Bound, FreeParam, Model, System};
use crate::units::{Dimension, Unit};

use super::amplitude::place_amplitudes;
use super::cycle::computed;
use super::{Amplitude, Block, BlockKind, Computed, Plan, ResponseError, TableForm, site};

/// Steps per cycle at least, before [`Plan::refined`] looks whether they are enough, and at most.
const STEPS: usize = 100;
const MOST_STEPS: usize = 800;
/// Part of the travel, in the middle, over which the slope of the branch mean is taken.
const MIDDLE: f64 = 0.6;

/// Energies of one steady cycle.
#[derive(Clone, Copy, Debug)]
pub struct Energies<T> {
    /// Dissipated energy per cycle, the loop integral of F dx [J].
    pub dissipated: T,
    /// Range of the force [N].
    pub force_range: T,
    /// Range of the displacement [m].
    pub travel: T,
    /// Slope of the branch-mean force over the middle 60 % of travel [N/m].
    pub slope: T,
}

impl<T: Num> Energies<T> {
    /// Equivalent elastic energy W_s [J] in the given reading: `dF^2 / (2 k_s)` or `dF dx / 2`.
    pub fn stored(&self, reading: StoredEnergy) -> T {
        match reading {
            StoredEnergy::Slope => self.force_range * self.force_range / (self.slope * 2.0),
            StoredEnergy::Product => self.force_range * self.travel * 0.5,
        }
    }
}

/// Energies of a closed cycle sampled at equal times; `None` where the travel has no two branches.
pub fn energies<T: Num>(x: &[T], f: &[T]) -> Option<Energies<T>> {
    let n = x.len();
    let order = |a: &usize, b: &usize| x[*a].re().total_cmp(&x[*b].re());
    let (low, high) = ((0..n).min_by(order)?, (0..n).max_by(order)?);
    let travel = x[high] - x[low];
    if travel.re().is_nan() || travel.re() <= 0.0 {
        return None;
    }
    let mut dissipated = T::from(0.0);
    for k in 0..n {
        let j = (k + 1) % n;
        dissipated += (f[k] + f[j]) * (x[j] - x[k]) * 0.5;
    }
    let by_force = |a: &usize, b: &usize| f[*a].re().total_cmp(&f[*b].re());
    let force_range = f[(0..n).max_by(by_force)?] - f[(0..n).min_by(by_force)?];
    // Force on a branch where it passes a displacement, by linear interpolation.
    let branch = |from: usize, to: usize, at: T| -> Option<T> {
        let len = (to + n - from) % n;
        (0..len).find_map(|k| {
            let (a, b) = ((from + k) % n, (from + k + 1) % n);
            let (xa, xb) = (x[a], x[b]);
            ((xa.re() - at.re()) * (xb.re() - at.re()) <= 0.0 && xa.re() != xb.re()).then(|| f[a] + (f[b] - f[a]) * (at - xa) / (xb - xa))
        })
    };
    // Least-squares slope of the branch mean over equidistant displacements, symmetric about the middle.
    let points = 61;
    let (mut top, mut bottom) = (T::from(0.0), 0.0);
    for k in 0..points {
        let u = (k as f64 / (points - 1) as f64 - 0.5) * MIDDLE;
        let at = x[low] + travel * (0.5 + u);
        let mean = (branch(low, high, at)? + branch(high, low, at)?) * 0.5;
        top += mean * u;
        bottom += u * u;
    }
    Some(Energies { dissipated, force_range, travel, slope: top / (travel * bottom) })
}

/// A table of energies made ready.
#[derive(Clone, Debug, Default)]
pub struct EnergyPlan {
    rows: Vec<Row>,
    reading: Option<StoredEnergy>,
    probe: Option<Probe>,
    /// Steps per cycle.
    steps: usize,
}

#[derive(Clone, Debug)]
struct Row {
    /// What drives the cycle, the driven degree of freedom with the sign of the channel.
    drive: (Control, usize, f64),
    /// Least and greatest of the drive [N or m], frequency [Hz].
    limits: (f64, f64),
    frequency: f64,
    /// One cycle in the steps of the plan.
    loads: Loads,
    conditions: BTreeMap<String, f64>,
    dissipated: bool,
    stored: bool,
    /// A cycle about which this one is balanced instead of marched, for a look.
    expanded: Option<Arc<Expanded>>,
}

impl Row {
    fn sampled(self, steps: usize) -> Self {
        let (low, high) = self.limits;
        let w = TAU * self.frequency;
        let sample = |k: usize| {
            let (s, c) = (TAU * k as f64 / steps as f64).sin_cos();
            let half = 0.5 * (high - low);
            [0.5 * (high + low) + half * s, half * w * c, -half * w * w * s]
        };
        let samples: Vec<[f64; 3]> = (0..=steps).map(sample).collect();
        let (control, dof, sign) = self.drive;
        Row { loads: site::loads(control, dof, sign, 1.0 / (self.frequency * steps as f64), &samples), expanded: None, ..self }
    }
}

impl EnergyPlan {
    pub(super) fn new(table: &EnergyTable, model: &Model, plan: &mut Plan) -> Result<Self, ResponseError> {
        let id = plan.id.clone();
        let Some((low, high)) = table.limits else {
            return Err(ResponseError::invalid(&id, "the limits of the cycle are not known", "force_min and force_max, or the like"));
        };
        let drive = site::driven(model, &table.at, &id)?;
        let probe = if table.control == Control::Displacement { Probe::Reaction(drive.0) } else { Probe::Dof(drive.0) };
        let (mut rows, mut values, mut sigmas, mut labels) = (vec![], vec![], vec![], vec![]);
        for row in &table.rows {
            let f = row.frequency.ok_or_else(|| {
                ResponseError::invalid(
                    &id,
                    format!("{}: no frequency, so the cycle cannot be computed", row.place),
                    "frequency = \"1 Hz\" in every row",
                )
            })?;
            let conditions = plan.conditions.clone().into_iter().chain(row.conditions.iter().map(|(k, c)| (k.clone(), c.value))).collect();
            for (name, value) in [("W_D", &row.dissipated), ("W_s", &row.stored)] {
                if let Some(v) = value {
                    labels.push(format!("{name} at {f} Hz"));
                    if v.value <= 0.0 {
                        return Err(ResponseError::invalid(&id, format!("{}: {name} is {} J", row.place, v.value), "an energy above zero"));
                    }
                    values.push(v.value.ln());
                    sigmas.push(deviation(v) / v.value);
                }
            }
            let row = Row {
                drive: (table.control, drive.0, drive.1),
                limits: (low, high),
                frequency: f,
                loads: Loads::default(),
                conditions,
                dissipated: row.dissipated.is_some(),
                stored: row.stored.is_some(),
                expanded: None,
            };
            rows.push(row.sampled(STEPS));
        }
        if table.rows.iter().any(|r| r.stored.is_some()) && table.stored.is_none() {
            plan.notes.push("the table does not say what W_s was evaluated as: read as dF^2/(2 k_s) over the middle 60 % of travel".into());
        }
        let stated = table.rows.iter().flat_map(|r| [&r.dissipated, &r.stored]).flatten().all(|v| v.sigma.is_some());
        if !stated {
            plan.notes.push(format!("no sigma is stated: {} % of each value is assumed", 100.0 * UNSTATED));
        }
        for (which, name) in ["W_D", "W_s"].iter().enumerate() {
            let picked: Vec<usize> = (0..labels.len()).filter(|k| labels[*k].starts_with(name)).collect();
            if picked.is_empty() {
                continue;
            }
            let start = plan.measured.len();
            let block = Block {
                label: format!("{name} per cycle at {}", table.at),
                role: if which == 0 { "dissipated" } else { "stored" }.into(),
                unit: "J".into(),
                stated: Unit::si(Dimension::ENERGY),
                amplitude_unit: None,
                kind: BlockKind::Table,
                range: start..start + picked.len(),
                abscissa: table
                    .rows
                    .iter()
                    .filter(|r| if which == 0 { r.dissipated.is_some() } else { r.stored.is_some() })
                    .filter_map(|r| r.frequency)
                    .collect(),
                x: vec![],
                v: vec![],
            };
            plan.add_block(block, picked.iter().map(|k| values[*k]).collect(), picked.iter().map(|k| sigmas[*k]).collect());
        }
        Ok(EnergyPlan { rows, reading: table.stored, probe: Some(probe), steps: STEPS })
    }

    /// The same rows in twice the steps; `None` where there are as many as there may be.
    pub(super) fn finer(&self) -> Option<Self> {
        (self.steps < MOST_STEPS).then(|| self.marched(2 * self.steps))
    }

    /// The same rows in this part of the steps, though never in fewer than they began with; `None` where they have no more.
    pub(super) fn coarser(&self, part: usize) -> Option<Self> {
        let steps = (self.steps / part).max(STEPS);
        (steps < self.steps).then(|| self.marched(steps))
    }

    fn marched(&self, steps: usize) -> Self {
        EnergyPlan { rows: self.rows.iter().map(|r| r.clone().sampled(steps)).collect(), steps, ..self.clone() }
    }

    /// The same rows balanced about the cycles of this system, where it is one of parts that turn far; `None` where none is.
    pub(super) fn expanded(&self, system: &System, id: &str) -> Option<Self> {
        let of = |row: &Row| -> Option<Row> {
            let bound = Bound::new(system, &[], id, &row.conditions).ok()?.driven_at(row.frequency);
            let expanded = Expanded::about(&system.model, &bound, &row.loads, self.probe.as_slice()).ok()??;
            Some(Row { expanded: Some(Arc::new(expanded)), ..row.clone() })
        };
        let rows = parallel::map(&self.rows, of);
        let any = rows.iter().any(Option::is_some);
        let rows = rows.into_iter().zip(&self.rows).map(|(expanded, row)| expanded.unwrap_or_else(|| row.clone()));
        any.then(|| EnergyPlan { rows: rows.collect(), ..self.clone() })
    }

    pub(super) fn periods(&self) -> (f64, f64) {
        let periods = self.rows.iter().map(|r| 1.0 / r.frequency);
        periods.fold((f64::INFINITY, 0.0), |(lo, hi), t| (lo.min(t / 5.0), hi.max(t)))
    }

    fn cycle(&self, row: &Row, model: &Model, bound: &Bound, id: &str, slopes: bool) -> Result<Cycle, ResponseError> {
        computed(row.expanded.as_deref(), model, bound, &row.loads, self.probe.as_slice(), slopes)
            .map_err(|source| ResponseError::Engine { test: id.into(), source })
    }

    pub(super) fn evaluate(
        &self,
        system: &System,
        free: &[FreeParam],
        plan: &Plan,
        sensitivities: bool,
        form: TableForm,
    ) -> Result<Computed, ResponseError> {
        let n_free = if sensitivities { free.len() } else { 0 };
        type Logged = (f64, Vec<f64>);
        let one = |row: &Row| -> Result<(Option<Logged>, Option<Logged>), ResponseError> {
            let bound = Bound::new(system, free, &plan.id, &row.conditions)?.driven_at(row.frequency);
            let cycle = self.cycle(row, &system.model, &bound, &plan.id, sensitivities)?;
            let driven: Vec<f64> = match (row.loads.prescribed.first(), row.loads.forces.first()) {
                (Some((_, path)), _) => path.iter().skip(1).map(|s| s[0]).collect(),
                (_, Some((_, path))) => path[1..].to_vec(),
                _ => vec![],
            };
            let force_driven = row.loads.prescribed.is_empty();
            let reading = self.reading.unwrap_or(StoredEnergy::Slope);
            let run = |k: Option<usize>| {
                let out: Vec<Dual64> =
                    (0..self.steps).map(|s| Dual64::new(cycle.values[0][s], k.map_or(0.0, |k| cycle.slopes[0][s * n_free + k]))).collect();
                let drive: Vec<Dual64> = driven.iter().map(|d| Dual64::from_re(*d)).collect();
                let e = if force_driven { energies(&out, &drive) } else { energies(&drive, &out) };
                e.map(|e| (e.dissipated, e.stored(reading), e.force_range.re * e.travel.re)).ok_or_else(|| {
                    ResponseError::invalid(&plan.id, "the computed cycle has no travel", "a model that moves under the load")
                })
            };
            let base = run(None)?;
            let (mut d_wd, mut d_ws) = (Vec::with_capacity(n_free), Vec::with_capacity(n_free));
            for k in 0..n_free {
                let (a, b, _) = run(Some(k))?;
                d_wd.push(a.eps);
                d_ws.push(b.eps);
            }
            let lost = if base.0.re.abs() <= ROUNDING * base.2 { 0.0 } else { base.0.re };
            let (dissipated, stored) = match form {
                TableForm::Plain => {
                    // So is what such a part of a parameter would change.
                    for (d, f) in d_wd.iter_mut().zip(free) {
                        let value = system.instances[f.instance].params[f.param].value;
                        let part = if f.log { 1.0 } else { value.abs() };
                        if value != 0.0 && d.abs() * part <= ROUNDING * base.2 {
                            *d = 0.0;
                        }
                    }
                    ((lost, d_wd), (base.1.re, d_ws))
                }
                TableForm::Logarithms => (logarithm(base.0.re, d_wd), logarithm(base.1.re, d_ws)),
            };
            Ok((row.dissipated.then_some(dissipated), row.stored.then_some(stored)))
        };
        let (wd, ws): (Vec<_>, Vec<_>) = parallel::map(&self.rows, one).into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        let mut out = Computed::default();
        for (value, slopes) in wd.into_iter().chain(ws).flatten() {
            out.values.push(value);
            out.slopes.extend(slopes);
        }
        Ok(out)
    }

    /// Moves a condition of the rows that have it at `value`.
    pub(super) fn beside(&mut self, condition: &str, value: f64, by: f64) {
        let of = self.rows.iter_mut().filter_map(|r| r.conditions.get_mut(condition));
        of.filter(|c| **c == value).for_each(|c| *c += by);
    }

    pub(super) fn amplitudes(&self, system: &System, plan: &Plan) -> Result<Vec<Amplitude>, ResponseError> {
        let mut widest = vec![Amplitude::default(); system.model.places.len()];
        for row in &self.rows {
            let bound = Bound::new(system, &[], &plan.id, &row.conditions)?.driven_at(row.frequency);
            let here = place_amplitudes(&system.model, &bound, &row.loads)
                .map_err(|source| ResponseError::Engine { test: plan.id.clone(), source })?;
            widest.iter_mut().zip(here).for_each(|(w, a)| *w = w.or(a));
        }
        Ok(widest)
    }
}

/// Logarithm of an energy and of its slopes: energies run over decades. One that is not positive counts as immeasurably small.
fn logarithm(value: f64, mut slopes: Vec<f64>) -> (f64, Vec<f64>) {
    let energy = value.max(LEAST);
    slopes.iter_mut().for_each(|d| *d = if value > LEAST { *d / energy } else { 0.0 });
    (energy.ln(), slopes)
}

/// Part of dF dx below which a dissipated energy is rounding, and what the tolerance of the steady cycle leaves.
const ROUNDING: f64 = 1e-9;

/// Energy below which none is told from none [J].
const LEAST: f64 = 1e-12;

/// Assumed relative deviation of a table entry that states none.
const UNSTATED: f64 = 0.01;

fn deviation(v: &TableValue) -> f64 {
    v.sigma.unwrap_or(UNSTATED * v.value.abs()).max(v.rounding).max(f64::MIN_POSITIVE)
}
