//! What an effect does, in numbers of order one: a loop of amplitude 1 at 1 rad/s, and the frequency response of a mass 1 on a spring 1
//! with a damper 0.05 under a force of 0.05, without and with it. Computed by the engines that fit and predict.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::effect::{Channel, Coefficient, Dim, Effect, Grid, Info, Kind, Moment, Scales, find};
use crate::engine::harmonic::{Settings, at_amplitude};
use crate::engine::march::{Loads, Probe};
use crate::engine::steady::steady;
use crate::model::{Axis, Body, Bound, Connector, Instance, Model, ParamValue, Site, System};

/// Steps of the loop.
const STEPS: usize = 400;
/// Frequency lines.
const LINES: usize = 64;
/// Force that excites the oscillator: without the effect it moves by 1 in resonance.
const FORCE: f64 = 0.05;

/// Curves of a demonstration.
pub struct Demonstration {
    /// Parameters it was made with, name and value [SI of order one].
    pub parameters: Vec<(&'static str, f64)>,
    /// What the loop is of.
    pub of: &'static str,
    /// Displacement over a cycle.
    pub x: Vec<f64>,
    /// Force without the effect; empty where the effect stands alone.
    pub without: Vec<f64>,
    /// Force with it.
    pub with: Vec<f64>,
    /// Circular frequencies [rad/s].
    pub omega: Vec<f64>,
    /// Receptance without the effect.
    pub h0: Vec<Complex64>,
    /// Receptance with it; empty where there is no steady response.
    pub h: Vec<Complex64>,
}

/// Parameters of order one: strengths as given, shapes in the middle of their grid, settings as the search sets them first.
fn parameters(info: &Info, force: f64, other: f64) -> Vec<f64> {
    let scales = Scales { x: 1.0, travel: (-1.0, 1.0), v: 1.0, least_v: 1.0, f: 1.0, periods: (0.2 * TAU, 5.0 * TAU), small: false };
    let value = |p: &crate::effect::Param| match (p.kind, p.grid) {
        (Kind::Strength, _) => p.default + if p.dim == Dim::F { force } else { other },
        (_, Grid::None) => p.default,
        (kind, grid) => {
            let values = grid.values(&scales);
            values.get(if kind == Kind::Shape { values.len().saturating_sub(1) / 2 } else { 0 }).copied().unwrap_or(p.default)
        }
    };
    info.params.iter().map(value).collect()
}

fn instance(effect: &'static Effect, values: &[f64]) -> Instance {
    let params = values.iter().map(|v| ParamValue::fixed(*v)).collect();
    Instance::new(effect, "c1.x", Site::Places(vec![0]), params)
}

fn named(name: &str, values: &[f64]) -> Option<Instance> {
    find(name).ok().map(|e| instance(e, values))
}

fn model() -> Option<Model> {
    let body = |name: &str, mass: f64, free: Vec<Axis>| Body { name: name.into(), mass, inertia: 0.0, free };
    let bodies = vec![body("ground", 0.0, vec![]), body("end", 1.0, vec![Axis::X])];
    Model::new(bodies, vec![Connector { name: "c1".into(), from: 0, to: 1 }]).ok()
}

/// Displacement and force of the steady cycle x = sin t.
fn cycle(instances: Vec<Instance>) -> Option<(Vec<f64>, Vec<f64>)> {
    let system = System { model: model()?, instances };
    let bound = Bound::new(&system, &[], "", &BTreeMap::new()).ok()?;
    let at = |k: usize| (TAU * k as f64 / STEPS as f64).sin_cos();
    let path = (0..=STEPS).map(at).map(|(s, c)| [s, c, -s]).collect();
    let loads = Loads { dt: TAU / STEPS as f64, prescribed: vec![(0, path)], forces: vec![] };
    let mut found = steady(&system.model, &bound, &loads, &[Probe::Force(0)], false).ok()?;
    Some(((1..=STEPS).map(|k| at(k).0).collect(), found.values.pop()?))
}

fn receptance(instances: Vec<Instance>, omega: &[f64]) -> Option<Vec<Complex64>> {
    let system = System { model: model()?, instances };
    let bound = Bound::new(&system, &[], "", &BTreeMap::new()).ok()?;
    at_amplitude(&system.model, &bound, omega, 0, FORCE, &[0], false, Settings::default()).ok().map(|r| r.h)
}

/// The demonstration of an effect; none for a formula, which has no law of its own, and for a law of the geometry, which needs a structure.
pub fn demonstrate(effect: &'static Effect) -> Option<Demonstration> {
    let info = effect.info();
    let omega: Vec<f64> = (0..LINES).map(|k| 0.3 * 10f64.powf(k as f64 / (LINES - 1) as f64)).collect();
    let spring = |k: f64| named("linear_stiffness", &[k]);
    let damper = |c: f64| named("viscous", &[c]);
    let oscillator = |k: f64| Some(vec![spring(k)?, damper(FORCE)?]);
    let h0 = receptance(oscillator(1.0)?, &omega)?;
    let strong = parameters(info, 1.0, 1.0);
    let mild = parameters(info, 0.4 * FORCE, 0.2);
    let (of, x, without, with, h) = match effect {
        Effect::Force(_) => {
            let (x, with) = cycle(vec![instance(effect, &strong)])?;
            let both = [oscillator(1.0)?, vec![instance(effect, &mild)]].concat();
            ("the effect alone", x, vec![], with, receptance(both, &omega))
        }
        Effect::Series(_) => {
            let base = || Some(vec![spring(1.0)?, named("elastic_slip", &[0.4, 0.1])?]);
            let (x, without) = cycle(base()?)?;
            let (_, with) = cycle([base()?, vec![instance(effect, &mild)]].concat())?;
            let both = [oscillator(1.0)?, vec![instance(effect, &mild)]].concat();
            ("a spring 1 and an elastic_slip 0.4, without and with the effect", x, without, with, receptance(both, &omega))
        }
        Effect::Coefficient(law) => {
            let factor = factor(*law, &mild);
            let (x, without) = cycle(vec![spring(1.0)?])?;
            let (_, with) = cycle(vec![spring(factor)?])?;
            (
                "a spring 1 at the reference and at one unit of the condition above it",
                x,
                without,
                with,
                receptance(oscillator(factor)?, &omega),
            )
        }
        Effect::Channel(law) => {
            let (x, without) = cycle(vec![spring(1.0)?, damper(0.2)?])?;
            let with = read(*law, &mild, &without);
            let h = h0.iter().zip(&omega).map(|(h, w)| h * seen(*law, &mild, *w, *h)).collect();
            ("the force of a spring 1 and a damper 0.2, true and as it is read", x, without, with, Some(h))
        }
        Effect::Formula(_) | Effect::Geometry(_) => return None,
    };
    let values = if matches!(effect, Effect::Force(_)) { strong } else { mild };
    let parameters = info.params.iter().map(|p| p.name).zip(values).collect();
    Some(Demonstration { parameters, of, x, without, with, omega, h0, h: h.unwrap_or_default() })
}

fn factor(law: &dyn Coefficient, p: &[f64]) -> f64 {
    law.factor(1.0, p, &mut vec![0.0; p.len()])
}

/// The force channel as read over one cycle.
fn read(law: &dyn Channel, p: &[f64], truth: &[f64]) -> Vec<f64> {
    let mut dp = vec![0.0; p.len()];
    let n = truth.len();
    let dt = TAU / n as f64;
    let lag = law.shift(p, &mut dp) / dt;
    let at = |k: usize| {
        let place = (k as f64 - lag).rem_euclid(n as f64);
        let (i, part) = (place as usize % n, place.fract());
        truth[i] * (1.0 - part) + truth[(i + 1) % n] * part
    };
    let moment = |k: usize| Moment { acceleration: -((k + 1) as f64 * dt).sin(), time: ((k + 1) % n) as f64 * dt - 0.5 * TAU };
    (0..n).map(|k| law.reading(at(k), moment(k), p, &mut dp).0).collect()
}

/// Factor on the receptance when the force channel is read so.
fn seen(law: &dyn Channel, p: &[f64], w: f64, h: Complex64) -> Complex64 {
    law.factor(w, -h * w * w, p, &mut vec![Complex64::ZERO; p.len()]).0.inv()
}
