//! Natural frequency and damping of a nonlinear mode over its amplitude, compared by their logarithms with what the model's mode has there
//! ([`crate::engine::harmonic::Backbone`]).

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::data::BackboneTable;
use crate::engine::EngineError;
use crate::engine::harmonic::{self, Backbone, Which};
use crate::model::{Bound, FreeParam, Model, System};
use crate::units::{Dimension, Unit};

use super::amplitude::amplitude;
use super::site::{Seat, seat};
use super::{Amplitude, Block, BlockKind, Computed, Plan, ResponseError, TableForm};

/// Resolutions of the balance, [`Plan::refined`] looks which is enough. The balance holds far below what a level leaves out, because frequency and damping
/// are found by differences of its force.
const LEVELS: [harmonic::Settings; 3] = [
    harmonic::Settings { harmonics: 3, samples: 128, tolerance: 1e-11 },
    harmonic::Settings { harmonics: 7, samples: 256, tolerance: 1e-11 },
    harmonic::Settings { harmonics: 15, samples: 512, tolerance: 1e-11 },
];

/// Assumed relative deviation of a frequency and of a damping ratio that state none, as in modal tables.
const UNSTATED: [f64; 2] = [0.005, 0.05];
/// Damping ratio below which none is told from none.
const LEAST: f64 = 1e-9;
/// Samples of a cycle on which the motion across a place is looked at.
const SAMPLES: usize = 64;
/// Roles of the two blocks.
const ROLES: [&str; 2] = ["backbone_frequency", "backbone_damping"];

/// A backbone test made ready.
#[derive(Clone, Debug)]
pub struct BackbonePlan {
    /// Displacement at the place as a row of degrees of freedom.
    row: Vec<(usize, f64)>,
    which: Which,
    rows: Vec<Row>,
    level: usize,
}

/// The mode at one amplitude.
#[derive(Clone, Debug)]
struct Row {
    /// First harmonic at the place [m or rad].
    amplitude: f64,
    /// Unit that the table states it in.
    unit: Unit,
    /// As measured [Hz], where it was.
    frequency: Option<f64>,
    /// Whether damping was measured.
    damping: bool,
    /// Where the row stands, for errors.
    place: String,
}

impl BackbonePlan {
    pub(super) fn new(table: &BackboneTable, model: &Model, plan: &mut Plan) -> Result<Self, ResponseError> {
        let id = plan.id.clone();
        if model.space.is_some() {
            let message = "a backbone curve is not computed of parts that turn far";
            return Err(ResponseError::invalid(&id, message, "a model along axes; modal, cycle, frf or transient tests of this one"));
        }
        let row = match seat(model, &table.at)? {
            Seat::Dof(dof) => vec![(dof, 1.0)],
            Seat::Place(p) => {
                let ends = [(model.places[p].to, 1.0), (model.places[p].from, -1.0)];
                ends.into_iter().filter_map(|(d, sign)| Some((d?, sign))).collect()
            }
        };
        let first = table.rows.first().and_then(|r| r.frequency.as_ref());
        let which = match (table.mode, first) {
            (Some(number), _) => Which::Number(number as usize),
            (None, Some(frequency)) => Which::Nearest(frequency.value),
            (None, None) => return Err(ResponseError::invalid(&id, "nothing says which mode it is", "mode = 1, 2, ...")),
        };
        let mut assumed = false;
        for (k, (role, name)) in ROLES.iter().zip(["natural frequency", "damping ratio"]).enumerate() {
            let of = |r: &crate::data::BackboneRow| [r.frequency.clone(), r.damping.clone()][k].clone();
            let stated: Vec<_> = table.rows.iter().filter_map(|r| Some((r.amplitude, of(r)?))).collect();
            if stated.is_empty() {
                continue;
            }
            assumed |= stated.iter().any(|(_, v)| v.sigma.is_none());
            let start = plan.measured.len();
            let block = Block {
                label: format!("{name} over amplitude at {}", table.at),
                role: (*role).into(),
                unit: ["Hz", "-"][k].into(),
                stated: Unit::si([Dimension::FREQUENCY, Dimension::DIMENSIONLESS][k]),
                amplitude_unit: table.rows.first().map(|r| r.unit.clone()),
                kind: BlockKind::Table,
                range: start..start + stated.len(),
                abscissa: stated.iter().map(|s| s.0).collect(),
                x: vec![],
                v: vec![],
            };
            let sigma = stated.iter().map(|(_, v)| v.sigma.map_or(UNSTATED[k], |s| s / v.value).max(v.rounding / v.value)).collect();
            plan.add_block(block, stated.iter().map(|(_, v)| v.value.ln()).collect(), sigma);
        }
        if assumed {
            plan.notes.push("no sigma is stated: 0.5 % of a frequency and 5 % of a damping ratio are assumed".into());
        }
        let rows = table.rows.iter().map(|r| Row {
            amplitude: r.amplitude,
            unit: r.unit.clone(),
            frequency: r.frequency.as_ref().map(|f| f.value),
            damping: r.damping.is_some(),
            place: r.place.clone(),
        });
        Ok(BackbonePlan { row, which, rows: rows.collect(), level: 0 })
    }

    /// The same test in the next finer resolution; none where it is as fine as it gets.
    pub(super) fn finer(&self) -> Option<Self> {
        (self.level + 1 < LEVELS.len()).then(|| BackbonePlan { level: self.level + 1, ..self.clone() })
    }

    /// The same in the next coarser one.
    pub(super) fn coarser(&self) -> Option<Self> {
        (self.level > 0).then(|| BackbonePlan { level: self.level - 1, ..self.clone() })
    }

    /// Shortest and longest period that was measured [s].
    pub(super) fn periods(&self) -> (f64, f64) {
        let periods = self.rows.iter().filter_map(|r| r.frequency).map(f64::recip);
        periods.fold((f64::INFINITY, 0.0), |(lo, hi), t| (lo.min(t), hi.max(t)))
    }

    /// The modes of the rows, one after the other in rising amplitude: what `read` takes from each.
    fn along<T>(
        &self,
        model: &Model,
        bound: &Bound,
        id: &str,
        mut read: impl FnMut(&mut Backbone, &Row) -> Result<T, EngineError>,
    ) -> Result<Vec<T>, ResponseError> {
        let failed = |row: Option<&Row>, source: EngineError| match (row, &source) {
            (Some(row), EngineError::NoNonlinearMode { .. }) => {
                let amplitude = row.unit.print_short(row.amplitude);
                let accepted = crate::explain::Explain::accepted(&source);
                ResponseError::invalid(id, format!("{}: at an amplitude of {amplitude} there is {source}", row.place), accepted)
            }
            _ => ResponseError::Engine { test: id.into(), source },
        };
        let apart = bound.apart();
        let settings = LEVELS[self.level];
        let mut backbone = Backbone::new(model, &apart, &self.row, self.which, settings).map_err(|e| failed(self.rows.first(), e))?;
        self.rows.iter().map(|row| read(&mut backbone, row).map_err(|e| failed(Some(row), e))).collect()
    }

    pub(super) fn evaluate(
        &self,
        system: &System,
        free: &[FreeParam],
        plan: &Plan,
        sensitivities: bool,
        form: TableForm,
    ) -> Result<Computed, ResponseError> {
        let bound = plan.bind(system, free)?;
        let n_free = if sensitivities { bound.n_free } else { 0 };
        let modes = self.along(&system.model, &bound, &plan.id, |b, row| b.at(row.amplitude, sensitivities))?;
        let mut out = Computed::default();
        for quantity in 0..2 {
            let measured = |r: &Row| if quantity == 0 { r.frequency.is_some() } else { r.damping };
            for (_, mode) in self.rows.iter().zip(&modes).filter(|(row, _)| measured(row)) {
                let value = [mode.frequency_hz, mode.damping][quantity];
                let slopes = (0..n_free).map(|k| mode.slopes[k][quantity]);
                if form == TableForm::Plain {
                    out.values.push(value);
                    out.slopes.extend(slopes);
                    continue;
                }
                // A mode without damping counts as immeasurably lightly damped.
                let least = value.max(LEAST);
                out.values.push(least.ln());
                out.slopes.extend(slopes.map(|s| if value > LEAST { s / least } else { 0.0 }));
            }
        }
        Ok(out)
    }

    /// Amplitudes at every place over the rows. The force is the sum of the inertia forces of the bodies.
    pub(super) fn amplitudes(&self, system: &System, plan: &Plan) -> Result<Vec<Amplitude>, ResponseError> {
        let (model, bound) = (&system.model, plan.bind(system, &[])?);
        let motions = self.along(model, &bound, &plan.id, |b, row| {
            b.at(row.amplitude, false)?;
            b.motion()
        })?;
        let mut widest = vec![Amplitude::default(); model.places.len()];
        for (omega, harmonics) in motions {
            let inertia = |q: &Vec<Complex64>| q.iter().zip(&model.dofs).map(|(q, d)| omega * omega * d.mass * q.norm()).sum::<f64>();
            let force = harmonics.get(1).map_or(0.0, inertia);
            for (a, place) in widest.iter_mut().zip(&model.places) {
                let across = |q: &Vec<Complex64>| {
                    let at = |d: Option<usize>| d.map_or(Complex64::ZERO, |d| q[d]);
                    at(place.to) - at(place.from)
                };
                let series: Vec<Complex64> = harmonics.iter().map(across).collect();
                let x = |n: usize| {
                    let turned = |(k, x): (usize, &Complex64)| (x * Complex64::from_polar(1.0, TAU * (k * n) as f64 / SAMPLES as f64)).re;
                    series.iter().enumerate().map(turned).sum::<f64>()
                };
                let x: Vec<f64> = (0..=SAMPLES).map(x).collect();
                *a = a.or(amplitude(&x, &[-force, force], TAU / omega / SAMPLES as f64));
            }
        }
        Ok(widest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{BackboneRow, Record, TableValue, Test};
    use crate::model::{Axis, Body};
    use crate::units::{Dimension, Unit};

    /// A mass of 2 kg on 800 N/m with a cubic spring and a damper.
    fn oscillator() -> System {
        let body =
            |name: &str, mass: f64| Body { name: name.into(), mass, inertia: 0.0, free: if mass > 0.0 { vec![Axis::X] } else { vec![] } };
        let model = Model::joined(vec![body("ground", 0.0), body("m", 2.0)], &[("c", "ground", "m")]).unwrap();
        let of = |s: System, effect: &str, value: (&str, f64)| s.and(effect, "c.x", &[value]).unwrap();
        let system = of(System::new(model), "linear_stiffness", ("k", 800.0));
        of(of(system, "viscous", ("c", 0.8)), "cubic_stiffness", ("k3", 3e5))
    }

    fn test(at: &str, mode: Option<u32>, amplitudes: &[f64]) -> Test {
        let value = |v: f64| TableValue { value: v, unit: Unit::si(Dimension::DIMENSIONLESS), sigma: None, rounding: 0.0 };
        let row = |x: &f64| BackboneRow {
            amplitude: *x,
            unit: Unit::si(Dimension::LENGTH),
            frequency: (*x < 0.015).then(|| value(3.0)),
            damping: Some(value(0.01)),
            place: format!("line {x}"),
        };
        Test::new("b", Record::Backbone(BackboneTable { at: at.into(), mode, rows: amplitudes.iter().map(row).collect() }))
    }

    #[test]
    fn rows_are_computed_in_order_at_bodies_and_connectors() {
        let system = oscillator();
        let amplitudes = [1e-3, 0.01, 0.02];
        for (at, mode) in [("m.x", None), ("c.x", Some(1))] {
            let plan = Plan::new(&test(at, mode, &amplitudes), &system.model).unwrap();
            assert!(plan.notes.iter().any(|n| n.contains("no sigma is stated")) && plan.sigma == [0.005, 0.005, 0.05, 0.05, 0.05]);
            let plan = plan.refined(&system).unwrap_or(plan);
            let free = system.free();
            let logarithms = plan.evaluate(&system, &free, true).unwrap();
            let plain = plan.evaluate_plain(&system, &free).unwrap();
            let omega = amplitudes.map(|x| ((800.0 + 0.75 * 3e5 * x * x) / 2.0f64).sqrt());
            let exact = [omega[0] / TAU, omega[1] / TAU, 0.2 / omega[0], 0.2 / omega[1], 0.2 / omega[2]];
            for (k, exact) in exact.iter().enumerate() {
                assert!((plain.values[k] / exact - 1.0).abs() < 1e-3, "{k}: {} {exact}", plain.values[k]);
                assert!((plain.values[k].ln() - logarithms.values[k]).abs() < 1e-12);
                for p in 0..free.len() {
                    let [plain, log] = [&plain, &logarithms].map(|c| c.slopes[k * free.len() + p]);
                    assert!((plain / exact - log).abs() <= 4e-3 * log.abs(), "{k} {p}: {plain} {log}");
                }
            }
            let a = plan.amplitudes(&system).unwrap().unwrap()[0];
            assert!((a.x / 0.02 - 1.0).abs() < 0.01 && (a.v / (omega[2] * 0.02) - 1.0).abs() < 0.02, "{a:?}");
            assert!((a.f / (omega[2].powi(2) * 0.02 * 2.0) - 1.0).abs() < 0.02, "{a:?}");
        }
    }

    #[test]
    fn a_row_without_a_mode_is_named() {
        let system = oscillator();
        let plan = Plan::new(&test("m.x", Some(2), &[1e-3, 0.03]), &system.model).unwrap();
        let error = plan.evaluate(&system, &[], false).unwrap_err().to_string();
        assert!(error.contains("test `b`") && error.contains("line 0.001") && error.contains("mode 2 was asked for"), "{error}");
        assert!(Plan::new(&test("x.x", Some(1), &[1e-3]), &system.model).unwrap_err().to_string().contains("x.x"));
    }
}
