//! Responses: what a test would have measured on the model, at the test's own points, with sensitivities.
//!
//! A [`Plan`] is made once per test: what drives the model, what is read, what was measured with which sigma. [`Plan::evaluate`] runs
//! the engine for the present parameters.

mod amplitude;
mod backbone;
mod beginning;
mod block;
mod channel;
mod covariance;
mod cycle;
mod energy;
mod error;
mod family;
mod frf;
mod geometry;
mod lines;
mod modal;
mod settling;
mod site;
mod transient;
mod variation;

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DMatrixViewMut, DVector};

use crate::data::{Record, Test, TestKind, Unsettled};
use crate::engine::modal::count as modal_count;
use crate::model::{Bound, FreeParam, Model, System};
use crate::units::Unit;

pub use amplitude::Amplitude;
pub use backbone::BackbonePlan;
pub use block::{Block, BlockKind};
pub use covariance::{Coefficients, Covariance, Instruments, Misreading, Reach, Scatter, Tolerances};
pub use cycle::CyclePlan;
pub use energy::{Energies, EnergyPlan, energies};
pub use error::ResponseError;
pub use family::Family;
pub use frf::FrfPlan;
pub use lines::resonances;
pub use modal::{ModalPlan, TableModes};
pub use settling::Transient;
pub use transient::TransientPlan;
pub use variation::{CycleDrive, Variation};

/// Integration error that is allowed, in units of sigma: its square is a hundredth of the noise's.
const STEP_ERROR: f64 = 0.1;
/// Root of the sum of squares of the same of a record.
const RECORD_ERROR: f64 = 1.0;
/// Integration error of a record that slopes and first looks may have, in units of sigma: its square is a twenty-fifth of the noise's.
const ROUGH_ERROR: f64 = 0.2;

/// Factor on the sigma of rows that are left out.
const UNSEEN: f64 = 1e8;

/// Whether a row of a table is compared: one that is left out has a deviation beyond all measure.
pub fn is_compared(sigma: f64, measured: f64) -> bool {
    sigma < UNSEEN.sqrt() * measured.abs()
}

/// How one test is computed and what it is held against.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Id of the test.
    pub id: String,
    /// Kind of test.
    pub kind: TestKind,
    /// Conditions [SI].
    pub conditions: BTreeMap<String, f64>,
    /// The units that they are stated in.
    pub condition_units: BTreeMap<String, Unit>,
    /// Standard deviations of the conditions that state one [SI].
    pub condition_sigmas: BTreeMap<String, f64>,
    /// Measured values, block after block [SI].
    pub measured: Vec<f64>,
    /// Standard deviation of each.
    pub sigma: Vec<f64>,
    /// Channels.
    pub blocks: Vec<Block>,
    /// What was done to the data.
    pub notes: Vec<String>,
    /// Variance of each row within `sigma` that is granted to the model and no noise ([`Plan::tolerant`]); empty where none is.
    pub granted: Vec<f64>,
    /// The relative error of an FRF that this is; 0 where none is granted.
    pub allowed: f64,
    /// Rows that are computed and shown, and held against nothing.
    pub left_out: Vec<usize>,
    /// Channels of a cycle test whose kept cycles still change.
    pub unsettled: Vec<Unsettled>,
    /// Roles of the channels of a cycle test that are clipped, each with what shows it.
    pub clipped: Vec<(String, String)>,
    /// Scatter of each block between cycles; empty for other kinds of tests.
    pub scatter: Vec<Scatter>,
    /// What its instruments may err by.
    pub tolerances: Tolerances,
    /// The covariance that the test is held against; none: sigma is all there is.
    pub covariance: Option<Arc<Covariance>>,
    work: Work,
}

#[derive(Clone, Debug)]
enum Work {
    Cycle(CyclePlan),
    Frf(FrfPlan),
    Transient(TransientPlan),
    Energy(EnergyPlan),
    Modal(ModalPlan),
    Backbone(BackbonePlan),
}

/// How the rows of a table are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TableForm {
    /// As they are compared.
    Logarithms,
    /// As they are printed.
    Plain,
}

/// Computed values and their derivatives, `slopes[row * n_free + k]`.
#[derive(Clone, Debug, Default)]
pub struct Computed {
    /// One per row of the plan.
    pub values: Vec<f64>,
    /// Empty unless asked for.
    pub slopes: Vec<f64>,
}

impl Plan {
    /// Plans a test on a model.
    pub fn new(test: &Test, model: &Model) -> Result<Plan, ResponseError> {
        let conditions = test.conditions.iter().map(|(k, c)| (k.clone(), c.value)).collect();
        let mut plan = Plan {
            id: test.id.clone(),
            kind: test.kind(),
            conditions,
            condition_sigmas: test.conditions.iter().filter_map(|(k, c)| Some((k.clone(), c.sigma?))).collect(),
            condition_units: test.conditions.iter().map(|(k, c)| (k.clone(), c.unit.clone())).collect(),
            measured: vec![],
            sigma: vec![],
            blocks: vec![],
            notes: vec![],
            granted: vec![],
            allowed: 0.0,
            left_out: vec![],
            unsettled: vec![],
            clipped: vec![],
            scatter: vec![],
            tolerances: Tolerances::GOOD,
            covariance: None,
            work: Work::Energy(EnergyPlan::default()),
        };
        plan.work = match &test.record {
            Record::Cycle(record) => Work::Cycle(CyclePlan::new(record, model, &mut plan)?),
            Record::Frf(frf) => Work::Frf(FrfPlan::new(frf, model, &mut plan)?),
            Record::Transient(record) => Work::Transient(TransientPlan::new(record, model, &mut plan)?),
            Record::Energy(table) => Work::Energy(EnergyPlan::new(table, model, &mut plan)?),
            Record::Modal(table) => Work::Modal(ModalPlan::new(table, &mut plan)?),
            Record::Backbone(table) => Work::Backbone(BackbonePlan::new(table, model, &mut plan)?),
        };
        if plan.is_empty() {
            let accepted = "a channel that answers the drive: a force of what is driven, or a motion of what is not";
            return Err(ResponseError::invalid(&test.id, "nothing in it is compared with the model", accepted));
        }
        if let Some(bad) = plan.sigma.iter().position(|s| !(s.is_finite() && *s > 0.0)) {
            return Err(ResponseError::invalid(&test.id, format!("sigma of point {bad} is {}", plan.sigma[bad]), "sigma above zero"));
        }
        Ok(plan)
    }

    /// Leaves the rows of a table out of every comparison, those of the channel `role` at `abscissa` (mode, frequency); false where there
    /// are none. They are still computed and shown.
    pub fn leave_out(&mut self, role: &str, abscissa: f64, why: &str) -> bool {
        let here = |b: &Block| -> Vec<usize> {
            let rows = b.range.clone().zip(&b.abscissa).filter(|(_, a)| **a == abscissa);
            if b.kind == BlockKind::Table && b.role == role { rows.map(|(row, _)| row).collect() } else { vec![] }
        };
        let rows: Vec<usize> = self.blocks.iter().flat_map(here).collect();
        for &row in &rows {
            self.sigma[row] *= UNSEEN;
        }
        if !rows.is_empty() {
            self.notes.push(format!("{role} {abscissa} is computed and left out of the comparison: {why}"));
        }
        self.left_out.extend(&rows);
        !rows.is_empty()
    }

    /// The same test with a condition that lies `by` [SI] beside where it is stated, in rows of a table that have it from the test as well.
    pub fn beside(&self, condition: &str, by: f64) -> Plan {
        let mut plan = self.clone();
        let Some(value) = plan.conditions.get_mut(condition) else { return plan };
        if let Work::Energy(table) = &mut plan.work {
            table.beside(condition, *value, by);
        }
        *value += by;
        plan
    }

    /// Number of measured values.
    pub fn len(&self) -> usize {
        self.measured.len()
    }
    /// Whether nothing was measured.
    pub fn is_empty(&self) -> bool {
        self.measured.is_empty()
    }

    /// The same test, whose channels may err within tolerance, and whose jumps lie anywhere between two samples. `signal`: what they read,
    /// computed.
    pub fn with_instruments(&self, signal: &[f64]) -> Plan {
        let coefficients = Coefficients::of(self);
        let shared = Instruments::new(self, &coefficients, signal, &self.reach()).columns;
        let noise = coefficients.noise(self);
        Plan { covariance: Some(Arc::new(Covariance::new(coefficients, &noise, &shared))), ..self.clone() }
    }

    /// The same test held against this covariance; against its sigma where there is none.
    pub fn under(&self, covariance: Option<Arc<Covariance>>) -> Plan {
        Plan { covariance, ..self.clone() }
    }

    /// The same test with the sign of its channels of this role turned.
    pub fn turned_round(&self, role: &str) -> Plan {
        let mut plan = self.clone();
        for block in self.blocks.iter().filter(|b| b.role == role) {
            plan.measured[block.range.clone()].iter_mut().for_each(|v| *v = -*v);
        }
        plan
    }

    /// What the channel of each block reads in this test.
    pub fn reach(&self) -> Vec<Reach> {
        self.blocks.iter().map(|b| Reach::of(&self.measured[b.range.clone()])).collect()
    }

    /// Whitened residuals, computed minus measured.
    pub fn whitened(&self, computed: &[f64]) -> DVector<f64> {
        let rows = computed.iter().zip(&self.measured).map(|(y, m)| y - m);
        let mut r = DVector::from_iterator(self.len(), rows);
        self.whiten(DMatrixViewMut::from_slice(r.as_mut_slice(), self.len(), 1));
        r
    }

    /// Whitens rows of the test, one column or many.
    pub fn whiten(&self, mut rows: DMatrixViewMut<f64>) {
        match &self.covariance {
            Some(covariance) => covariance.whiten(rows),
            None => rows.row_iter_mut().zip(&self.sigma).for_each(|(mut row, s)| row /= *s),
        }
    }

    /// Rows as coefficients, with the residual in front: `[computed - measured, slopes]`.
    pub fn turned(&self, coefficients: &Coefficients, computed: &Computed, columns: usize) -> DMatrix<f64> {
        let entry = |i: usize, k: usize| match k {
            0 => computed.values[i] - self.measured[i],
            k => computed.slopes[i * columns + k - 1],
        };
        coefficients.turned(&DMatrix::from_fn(self.len(), columns + 1, entry))
    }

    fn add_block(&mut self, block: Block, measured: Vec<f64>, sigma: Vec<f64>) {
        self.measured.extend(measured);
        self.sigma.extend(sigma);
        self.blocks.push(block);
    }

    /// Binds the system to this test.
    pub fn bind(&self, system: &System, free: &[FreeParam]) -> Result<Bound, ResponseError> {
        let bound = Bound::new(system, free, &self.id, &self.conditions)?;
        Ok(match &self.work {
            Work::Cycle(cycle) => bound.driven_at(1.0 / cycle.period()),
            _ => bound,
        })
    }

    /// Runs the engine.
    pub fn evaluate(&self, system: &System, free: &[FreeParam], sensitivities: bool) -> Result<Computed, ResponseError> {
        geometry::through(system, free, sensitivities, |system, free, sensitivities| self.run(system, free, sensitivities))
    }

    /// The same of a system whose parts lie where they are drawn.
    fn run(&self, system: &System, free: &[FreeParam], sensitivities: bool) -> Result<Computed, ResponseError> {
        let named = |source| ResponseError::Engine { test: self.id.clone(), source };
        match &self.work {
            Work::Cycle(w) => w.evaluate(&system.model, &self.bind(system, free)?, self, sensitivities).map_err(named),
            Work::Frf(w) => w.evaluate(&system.model, &self.bind(system, free)?, self, sensitivities).map_err(named),
            Work::Transient(w) => w.evaluate(system, free, self, sensitivities),
            Work::Energy(w) => w.evaluate(system, free, self, sensitivities, TableForm::Logarithms),
            Work::Modal(w) => w.evaluate(system, free, self, sensitivities, TableForm::Logarithms),
            Work::Backbone(w) => w.evaluate(system, free, self, sensitivities, TableForm::Logarithms),
        }
    }

    /// As [`Plan::evaluate`] with sensitivities, but the rows of a table as they are, not as logarithms: a model without losses
    /// dissipates 0 J and has modes of damping 0.
    pub fn evaluate_plain(&self, system: &System, free: &[FreeParam]) -> Result<Computed, ResponseError> {
        geometry::through(system, free, true, |system, free, sensitivities| match &self.work {
            Work::Energy(w) => w.evaluate(system, free, self, sensitivities, TableForm::Plain),
            Work::Modal(w) => w.evaluate(system, free, self, sensitivities, TableForm::Plain),
            Work::Backbone(w) => w.evaluate(system, free, self, sensitivities, TableForm::Plain),
            _ => self.run(system, free, sensitivities),
        })
    }

    /// The modes of the system beside the rows of a modal table; `None` for another kind of test.
    pub fn modes(&self, system: &System) -> Result<Option<TableModes>, ResponseError> {
        let system = &*system.shaped();
        match &self.work {
            Work::Modal(w) => w.modes(system, self).map(Some),
            _ => Ok(None),
        }
    }

    /// Number of modes of the system between the first and the last line of an FRF; `None` for another kind of test, and of a system without a small-signal
    /// limit.
    pub fn modes_within(&self, system: &System) -> Option<usize> {
        let Work::Frf(frf) = &self.work else { return None };
        let system = &*system.shaped();
        let ((low, high), bound) = (frf.band(), self.bind(system, &[]).ok()?);
        modal_count(&system.model, &bound, low, high).ok()
    }

    /// Amplitudes at every place under this test; `None` for tests that declare none.
    pub fn amplitudes(&self, system: &System) -> Result<Option<Vec<Amplitude>>, ResponseError> {
        let system = &*system.shaped();
        let named = |source| ResponseError::Engine { test: self.id.clone(), source };
        let bound = self.bind(system, &[])?;
        match &self.work {
            Work::Cycle(w) => w.amplitudes(&system.model, &bound).map(Some).map_err(named),
            Work::Transient(w) => w.amplitudes(system, self).map(Some),
            Work::Energy(w) => w.amplitudes(system, self).map(Some),
            Work::Frf(w) => w.amplitudes(&system.model, &bound).map_err(named),
            Work::Backbone(w) => w.amplitudes(system, self).map(Some),
            Work::Modal(_) => Ok(None),
        }
    }

    /// What is left of the model's own transient in the kept cycles of a cycle test; none where it is long gone, or the test no cycle.
    /// `enough`: what may be left, in units of sigma.
    pub fn transient(&self, system: &System, enough: f64) -> Result<Option<Transient>, ResponseError> {
        let Work::Cycle(cycle) = &self.work else { return Ok(None) };
        let system = &*system.shaped();
        let named = |source| ResponseError::Engine { test: self.id.clone(), source };
        settling::transient(cycle, &system.model, &self.bind(system, &[])?, self, enough).map_err(named)
    }

    /// The plan with as many steps, or harmonics, as its noise asks for at the system's present values: they are doubled until the computed response
    /// moves by less than a tenth (`STEP_ERROR`) of sigma, that of a record by less than one sigma (`RECORD_ERROR`) along the whole of it. `None` where they
    /// are enough.
    pub fn refined(&self, system: &System) -> Option<Plan> {
        let mut best: Option<Plan> = None;
        loop {
            let now = best.as_ref().unwrap_or(self);
            let finer = match &now.work {
                Work::Cycle(cycle) => cycle.finer().map(Work::Cycle),
                Work::Transient(record) => record.finer().map(Work::Transient),
                Work::Energy(table) => table.finer().map(Work::Energy),
                Work::Frf(frf) => frf.finer().map(Work::Frf),
                Work::Backbone(table) => table.finer().map(Work::Backbone),
                Work::Modal(_) => None,
            };
            let Some(finer) = finer else { return best };
            let mut finer = Plan { work: finer, ..now.clone() };
            let (Ok(a), Ok(b)) = (now.evaluate(system, &[], false), finer.evaluate(system, &[], false)) else { return best };
            let moved: f64 = a.values.iter().zip(&b.values).zip(&self.sigma).map(|((a, b), s)| ((a - b) / s).powi(2)).sum();
            // The error is of second order, that of an extrapolated record of fourth: what doubling moves is three quarters of it at least. A record is one
            // long motion whose error adds up along it, and bends a parameter by up to the root of the sum in standard errors; where the
            // model still fails by many times the noise, a part of that is close enough.
            let enough = if matches!(now.work, Work::Transient(_)) {
                let fails = self.whitened(&a.values).norm() / (self.len().max(1) as f64).sqrt();
                RECORD_ERROR * (fails / 3.0).max(1.0)
            } else {
                STEP_ERROR * (self.len().max(1) as f64).sqrt()
            };
            if moved.sqrt() < 0.75 * enough {
                return best;
            }
            if let (Work::Transient(record), Work::Transient(now)) = (&mut finer.work, &now.work)
                && moved.sqrt() < ROUGH_ERROR * (self.len().max(1) as f64).sqrt()
            {
                record.serves_roughly(now.stride());
            }
            best = Some(finer);
        }
    }

    /// The same test in a quarter of the time steps, a record in the fewest that were seen to err by less than a fifth of sigma, as far as it has them: for slopes that need be known to a hundredth, where the values
    /// are needed to a part of the noise. `None` where it has no steps to spare.
    pub fn coarser(&self) -> Option<Plan> {
        let work = match &self.work {
            Work::Cycle(cycle) => {
                let coarser = cycle.coarser(cycle.steps() / 4);
                (coarser.steps() < cycle.steps()).then_some(Work::Cycle(coarser))
            }
            Work::Transient(record) => record.coarser().map(Work::Transient),
            Work::Energy(table) => table.coarser(4).map(Work::Energy),
            Work::Frf(frf) => frf.coarser().map(Work::Frf),
            Work::Backbone(table) => table.coarser().map(Work::Backbone),
            Work::Modal(_) => None,
        };
        work.map(|work| Plan { work, ..self.clone() })
    }

    /// The same test computed about what this system does in it, for a look at what others do: the loops and energies of parts that turn far, balanced about the
    /// mean of their cycle ([`crate::engine::harmonic::Expanded`]), and their frequency responses about where they stand; `None` for other tests and models.
    pub fn expanded(&self, system: &System) -> Option<Plan> {
        let system = &*system.shaped();
        let work = match &self.work {
            Work::Cycle(cycle) => Work::Cycle(cycle.expanded(&system.model, &self.bind(system, &[]).ok()?)?),
            Work::Energy(table) => Work::Energy(table.expanded(system, &self.id)?),
            Work::Frf(frf) => Work::Frf(frf.expanded(&system.model, &self.bind(system, &[]).ok()?)?),
            _ => return None,
        };
        Some(Plan { work, ..self.clone() })
    }

    /// A cycle test with at most `points` points a loop, evenly taken; others as they are.
    pub fn thinned(&self, points: usize) -> Plan {
        let Work::Cycle(cycle) = &self.work else { return self.clone() };
        let n = cycle.points();
        let Some(part) = (n.div_ceil(points.max(1))..=n).find(|part| n.is_multiple_of(*part)).filter(|part| *part > 1) else {
            return self.clone();
        };
        let mut plan = Plan {
            measured: vec![],
            sigma: vec![],
            blocks: vec![],
            scatter: vec![],
            work: Work::Cycle(cycle.thinned(part)),
            ..self.clone()
        };
        for block in &self.blocks {
            let every = |values: &[f64]| values.iter().step_by(part).copied().collect::<Vec<f64>>();
            let (measured, sigma) = (every(&self.measured[block.range.clone()]), every(&self.sigma[block.range.clone()]));
            let start = plan.measured.len();
            let range = start..start + measured.len();
            let block = Block { range, abscissa: every(&block.abscissa), x: every(&block.x), v: every(&block.v), ..block.clone() };
            plan.add_block(block, measured, sigma);
        }
        plan.notes.push(format!("{} of {n} points of the loop are compared", n / part));
        plan
    }

    /// An FRF test whose model is known to be off by itself by this part of |H|, root mean square; others as they are. The variance of each
    /// line becomes `sigma^2 + (part |H|)^2 / 2`, of the real and of the imaginary part alike.
    pub fn tolerant(mut self, part: f64) -> Plan {
        (self.granted, self.allowed) = (vec![0.0; self.len()], part);
        for block in self.blocks.iter().filter(|b| b.kind == BlockKind::Frf) {
            for line in block.range.clone().step_by(2) {
                let rows = line..(line + 2).min(block.range.end);
                let own = part * self.measured[rows.clone()].iter().map(|x| x * x).sum::<f64>().sqrt() / std::f64::consts::SQRT_2;
                for row in rows {
                    (self.sigma[row], self.granted[row]) = (self.sigma[row].hypot(own), own * own);
                }
            }
            self.notes.push(format!("{:.3} % of |H| is allowed to the model beside the noise (frf_tolerance)", 100.0 * part));
        }
        self
    }

    /// Shortest and longest period the test speaks of [s].
    pub fn periods(&self) -> (f64, f64) {
        match &self.work {
            Work::Cycle(w) => (w.period() / 5.0, w.period()),
            Work::Frf(w) => w.periods(),
            Work::Transient(w) => (w.dt() * 10.0, w.duration()),
            Work::Energy(w) => w.periods(),
            Work::Modal(w) => w.periods(),
            Work::Backbone(w) => w.periods(),
        }
    }
}
