//! The calibrated mechanism free of any program: parts, joints, laws with their numbers, loads, and what it does.

use std::collections::BTreeMap;

use crate::effect::{Effect, Info};
use crate::engine::modal::{Range, modes};
use crate::engine::{EngineError, equilibrium};
use crate::explain::Explain;
use crate::model::space::rotation::{M3, UNIT, V3};
use crate::model::{Axis, Bound, Level, Model, System};

use super::ExportError;

/// A rigid part; one that cannot move is the ground.
pub(super) struct Part {
    pub name: String,
    pub mass: f64,
    /// Origin in the reference position [m]: its displacement along fixed axes are the coordinates.
    pub origin: V3<f64>,
    /// Centre of mass relative to the origin [m].
    pub centre: V3<f64>,
    /// About the centre of mass [kg m2].
    pub inertia: M3<f64>,
    pub free: [bool; 6],
}

impl Part {
    pub fn ground(&self) -> bool {
        self.free == [false; 6]
    }
}

/// A law at one axis of a joint.
pub(super) struct Law {
    pub axis: Axis,
    pub info: &'static Info,
    /// Values at the test's conditions [SI].
    pub values: Vec<f64>,
    /// `GF1-3.psi`, as in the study.
    pub at: String,
}

/// A connector with everything that acts at it.
pub(super) struct Joint {
    pub name: String,
    pub from: usize,
    pub to: usize,
    /// Its point in the reference position [m].
    pub point: V3<f64>,
    /// Its axes as columns, fixed to the first part.
    pub axes: M3<f64>,
    /// Whether it is attached when the loads have come on, and carries none of them.
    pub attached: bool,
    pub laws: Vec<Law>,
}

/// A load that stays.
pub(super) struct Load {
    pub part: usize,
    pub axis: Axis,
    /// Values passed through from 0; the last one stays [N, N m].
    pub path: Vec<f64>,
    pub steps: usize,
}

/// What misfit's own engines say of it.
#[derive(Default)]
pub(super) struct Expected {
    /// Damped natural frequencies without loads [Hz].
    pub frequencies: Vec<f64>,
    /// Displacement of each degree of freedom under the loads [m, rad].
    pub deflection: Vec<(usize, Axis, f64)>,
    /// Why something is not there.
    pub remarks: Vec<String>,
}

/// The mechanism at the conditions of one test.
pub(super) struct Mechanism {
    pub spatial: bool,
    pub parts: Vec<Part>,
    pub joints: Vec<Joint>,
    pub loads: Vec<Load>,
    /// Effects that belong to no mechanism: the instruments'.
    pub instruments: Vec<String>,
    /// Effects in series, which no explicit force expresses.
    pub series: Vec<String>,
    pub expected: Expected,
}

/// Modes that are computed beside an exported mechanism.
const MODES: usize = 10;

impl Mechanism {
    pub fn new(system: &System, test: &str, conditions: &BTreeMap<String, f64>, format: &'static str) -> Result<Self, ExportError> {
        let system = &*system.shaped();
        let model = &system.model;
        let acting =
            system.acting(test, conditions).map_err(|e| ExportError { format, reason: format!("{e}; accepted: {}", e.accepted()) })?;
        let mut joints: Vec<Joint> = model
            .connectors
            .iter()
            .enumerate()
            .map(|(k, c)| {
                let frame = model.space.as_ref().map(|s| s.frames[k]);
                let (point, axes) = frame.map_or(([0.0; 3], UNIT), |f| (f.point, f.axes));
                Joint { name: c.name.clone(), from: c.from, to: c.to, point, axes, attached: model.attached.contains(&k), laws: vec![] }
            })
            .collect();
        let (mut instruments, mut series) = (vec![], vec![]);
        for i in &system.instances {
            let named = || format!("{} at {}", i.name(), i.at);
            match i.effect {
                Effect::Channel(_) => instruments.push(named()),
                Effect::Series(_) => series.push(named()),
                _ => {}
            }
        }
        for a in acting {
            let (instance, place) = (&system.instances[a.instance], &model.places[a.place]);
            if let Effect::Force(law) = instance.effect {
                let law = Law { axis: place.axis, info: law.info(), values: a.values, at: instance.at.clone() };
                joints[place.connector].laws.push(law);
            }
        }
        joints.retain(|j| !j.laws.is_empty());
        let level = |l: &Level| match l {
            Level::Value(f) => Some(*f),
            Level::Condition(name, factor) => conditions.get(name).map(|c| c * factor),
        };
        let loads = model.loads.iter().filter_map(|l| {
            let dof = &model.dofs[l.dof];
            Some(Load { part: dof.body, axis: dof.axis, path: l.path.iter().map(level).collect::<Option<_>>()?, steps: l.steps })
        });
        Ok(Mechanism {
            spatial: model.space.is_some(),
            parts: parts(model),
            joints,
            loads: loads.collect(),
            instruments,
            series,
            expected: expected(system, test, conditions),
        })
    }
}

fn parts(model: &Model) -> Vec<Part> {
    let of = |(b, body): (usize, &crate::model::Body)| {
        let mut free = [false; 6];
        body.free.iter().for_each(|a| free[*a as usize] = true);
        match &model.space {
            Some(space) => {
                let p = &space.parts[b];
                Part { name: body.name.clone(), mass: p.mass, origin: p.origin, centre: p.centre, inertia: p.inertia, free }
            }
            None => {
                let inertia = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { body.inertia } else { 0.0 }));
                Part { name: body.name.clone(), mass: body.mass, origin: [0.0; 3], centre: [0.0; 3], inertia, free }
            }
        }
    };
    model.bodies.iter().enumerate().map(of).collect()
}

/// Frequencies without loads, and the equilibrium under them. What cannot be computed is said and left out.
fn expected(system: &System, test: &str, conditions: &BTreeMap<String, f64>) -> Expected {
    let mut out = Expected::default();
    let bound = |system: &System| Bound::new(system, &[], test, conditions).map_err(|e| e.to_string());
    let text = |e: EngineError| e.to_string();
    let mut unloaded = system.clone();
    unloaded.model.loads.clear();
    let count = MODES.min(system.model.dofs.len());
    match bound(&unloaded).and_then(|b| modes(&unloaded.model, &b, Range::Lowest(count), false).map_err(text)) {
        Ok(found) => out.frequencies = found.iter().map(|m| m.frequency_hz).collect(),
        Err(e) => out.remarks.push(format!("misfit has no natural frequencies of it: {e}")),
    }
    match bound(system).and_then(|b| equilibrium(&system.model, &b, &[], 0).map_err(text)) {
        Ok(Some(at)) => {
            out.deflection = system.model.dofs.iter().zip(&at.state.q).map(|(d, q)| (d.body, d.axis, *q)).collect();
        }
        Ok(None) => out.remarks.push("no load is declared for this test".into()),
        Err(e) => out.remarks.push(format!("misfit has no equilibrium of it: {e}")),
    }
    out
}
