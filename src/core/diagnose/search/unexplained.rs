//! What no candidate explains: the force over displacement, velocity and phase that would, and a formula fitted to it.
//!
//! At every place a list of terms in `u = x/X`, `w = v/V` and `z = v/Vs` (X, V the largest motion that the tests show there, Vs the least
//! velocity amplitude, against which a sign is smoothed) stands in the model as formulas of strength 0; one evaluation gives their columns, as for the candidates of the library. Terms are added one after the other,
//! each time the one that takes most off the projected cost, a loss only with the sign that makes it one; the place where the least is
//! left is taken, and the formula of its terms is refitted in full. Beside it stand splines of the force at that place over velocity and over displacement
//! ([`crate::effect::SPLINE`]), fitted with slopes that are positive over velocity: the one that leaves the least error is told.

use nalgebra::{DMatrix, DVector};

use crate::effect::formula::{Definition, compile};
use crate::effect::{Effect, Inputs, Kind, Scales, Sign, find};
use crate::identify::Monitor;
use crate::model::{Instance, ParamValue, Site, System};
use crate::parallel;
use crate::response::{BlockKind, Plan};
use crate::units::Dimension;

use super::candidates::{Scene, Trial, sites};
use super::refit::{Proof, cost, proof, prove};
use super::score::{Projected, projected};
use crate::diagnose::Case;
use crate::diagnose::calibrate::case::Fitted;
use crate::diagnose::results::{Missed, SplitName, Unexplained};
use crate::diagnose::settings::Telling;

/// A term in u, w and z; whether it is a loss, of which only one sign is passive.
const TERMS: [(&str, bool); 23] = [
    ("u^2", false),
    ("u^3", false),
    ("u*abs(u)", false),
    ("max(u - 0.2, 0)", false),
    ("max(u - 0.5, 0)", false),
    ("max(-u - 0.2, 0)", false),
    ("max(-u - 0.5, 0)", false),
    ("max(abs(u) - 0.3, 0)*sign(u)", false),
    ("max(abs(u) - 0.6, 0)*sign(u)", false),
    ("sin(6*u)", false),
    ("sin(10*u)", false),
    ("sin(16*u)", false),
    ("sin(24*u)", false),
    ("tanh(30*z)", true),
    ("tanh(10*w)", true),
    ("w*abs(w)", true),
    ("w*u^2", true),
    ("max(tanh(30*z), 0)", true),
    ("min(tanh(30*z), 0)", true),
    ("abs(u)*tanh(30*z)", true),
    ("max(abs(u) - 0.3, 0)*tanh(30*z)", true),
    ("max(u, 0)*tanh(30*z)", true),
    ("max(-u, 0)*tanh(30*z)", true),
];

/// The terms chosen at a place.
struct Choice {
    site: usize,
    terms: Vec<(usize, f64)>,
    left: f64,
}

/// A formula for what the fitted model leaves; none where no test has cycles or a record, no term is worth it, or the plain error does not fall.
pub fn unexplained(case: &Case, base: &Fitted, monitor: &Monitor) -> Option<Unexplained> {
    let all = case.plans_of(SplitName::Fit);
    // The terms have no meaning at small motion about rest, where an FRF lives.
    let plans: Vec<&Plan> =
        all.into_iter().filter(|p| p.blocks.iter().any(|b| matches!(b.kind, BlockKind::Loop | BlockKind::Record))).collect();
    if plans.is_empty() {
        return None;
    }
    let timed = Case {
        plans: std::sync::Arc::new(
            case.plans.iter().filter(|(p, s)| *s != SplitName::Fit || plans.iter().any(|q| q.id == p.id)).cloned().collect(),
        ),
        ..case.clone()
    };
    let (settings, scene) = (&case.search.settings, Scene::new(&plans, &base.system));
    let told = &settings.telling;
    let sites: Vec<(String, Vec<usize>)> = sites(case, &base.system).into_iter().filter(|(_, places)| places.len() == 1).collect();
    let (trials, columns) = terms(&base.system, &sites, &scene, told)?;
    let p = projected(&plans, &base.system, &trials, &base.inside(), &[], &settings.scoring).ok()?;
    let rows: usize = plans.iter().map(|p| p.len()).sum();
    let whole = 0.5 * p.r.norm_squared();
    let choices = (0..sites.len()).filter_map(|site| {
        let own: Vec<usize> = (0..trials.len()).filter(|k| columns[*k].site == site).collect();
        choose(&p, &own, |k| TERMS[columns[k].term].1, rows, whole, told).map(|(list, left)| Choice {
            site,
            terms: list.into_iter().map(|(k, c)| (columns[k].term, c)).collect(),
            left,
        })
    });
    let best = choices.min_by(|a, b| a.left.total_cmp(&b.left))?;
    let (at, places) = &sites[best.site];
    let scales = scene.at(places);
    let rotational = base.system.model.places[places[0]].axis.rotational();
    let formula = instance(&best.terms, at, places, &scales, rotational, told)?;
    let mut system = base.system.clone();
    system.instances.push(formula);
    let before = proof(&timed, base.clone()).ok()?;
    let of_formula = prove(&timed, &system, monitor).ok();
    let of_spline = splined(&timed, base, at, places, &scales, monitor);
    let after = of_formula.into_iter().chain(of_spline).min_by(|a, b| a.error.total_cmp(&b.error))?;
    let (was, is) = (cost(&before.fit), cost(&after.fit));
    // What an instrument within tolerance could have done counts little in the cost; a force that leaves more of the plain error is no help.
    if is >= (1.0 - told.term) * was || after.error >= before.error {
        return None;
    }
    let fitted = after.fitted.system.instances.last()?;
    Some(Unexplained {
        at: at.clone(),
        expression: if is_formula(fitted) { expression(&best.terms) } else { fitted.effect.info().equation.into() },
        formula: if is_formula(fitted) { stated(fitted, &best.terms, rotational) } else { stated_spline(fitted, rotational) },
        explains: 1.0 - is / was,
        error_before: before.error,
        error_after: after.error,
        picture: picture(&plans, &base.system, fitted, places[0], &scales, told.picture),
    })
}

/// Place and term of a column.
struct Column {
    site: usize,
    term: usize,
}

/// Every term at every place that moves, at strength 0, and which place and term each is; none where a formula is refused.
fn terms(system: &System, sites: &[(String, Vec<usize>)], scene: &Scene, told: &Telling) -> Option<(Vec<Trial>, Vec<Column>)> {
    let (mut trials, mut columns) = (Vec::new(), Vec::new());
    for (s, (at, places)) in sites.iter().enumerate() {
        let scales = scene.at(places);
        if !(scales.x > 0.0 && scales.v > 0.0) {
            continue;
        }
        let rotational = system.model.places[places[0]].axis.rotational();
        for t in 0..TERMS.len() {
            let mut instance = instance(&[(t, 1.0)], at, places, &scales, rotational, told)?;
            instance.follower = true;
            trials.push(Trial { instance, candidate: trials.len() });
            columns.push(Column { site: s, term: t });
        }
    }
    Some((trials, columns))
}

fn is_formula(instance: &Instance) -> bool {
    matches!(&instance.effect, Effect::Force(law) if law.formula().is_some())
}

/// The splines at a place that can be fitted, the one with the least error.
fn splined(case: &Case, base: &Fitted, at: &str, places: &[usize], scales: &Scales, monitor: &Monitor) -> Option<Proof> {
    let told = &case.search.settings.telling;
    let over = [("velocity_spline", scales.v), ("displacement_spline", scales.most().max(scales.x))];
    let starts: Vec<_> = over.iter().flat_map(|o| told.spline_begins.iter().map(move |b| (*o, *b))).collect();
    let fits = parallel::map(&starts, |((name, scale), [outer, inner])| {
        let effect = find(name).ok()?;
        let strength = told.spline_takes * scales.f / scale;
        let values = [strength, *outer, *inner, *inner, *outer, *scale];
        let params = effect.info().params.iter().zip(values).map(|(p, v)| ParamValue::of(p, v)).collect();
        let mut system = base.system.clone();
        system.instances.push(Instance::new(effect, at, Site::Places(places.to_vec()), params));
        prove(case, &system, monitor).ok()
    });
    fits.into_iter().flatten().min_by(|a, b| a.error.total_cmp(&b.error))
}

/// The block of a spline for study.toml.
fn stated_spline(instance: &Instance, rotational: bool) -> String {
    let info = instance.effect.info();
    let mut text = format!("[[effect]]\neffect = \"{}\"\nat = \"{}\"\n", info.name, instance.at);
    for (p, value) in info.params.iter().zip(&instance.params) {
        let (v, unit) = (value.value, p.dim.si(rotational));
        text += &match p.kind {
            Kind::Setting => format!("{} = {{ start = \"{v:.4e} {unit}\", fixed = true }}\n", p.name),
            Kind::Strength => format!("{} = {{ start = \"{v:.4e} {unit}\" }}\n", p.name),
            Kind::Shape => format!("{} = {v:.4e}\n", p.name),
        };
    }
    text
}

/// Terms among `own` with their strengths, and what they leave of the cost.
fn choose(
    p: &Projected,
    own: &[usize],
    is_loss: impl Fn(usize) -> bool,
    rows: usize,
    whole: f64,
    told: &Telling,
) -> Option<(Vec<(usize, f64)>, f64)> {
    let mut chosen: Vec<usize> = Vec::new();
    let mut state: (Vec<f64>, f64) = (vec![], whole);
    while chosen.len() < told.terms {
        let next = own.iter().filter(|k| !chosen.contains(k)).filter_map(|k| {
            let mut with = chosen.clone();
            with.push(*k);
            let columns: Vec<&DVector<f64>> = with.iter().map(|k| p.columns[*k].as_ref()).collect::<Option<_>>()?;
            let g = DMatrix::from_columns(&columns.into_iter().cloned().collect::<Vec<_>>());
            let strengths = g.clone().svd(true, true).solve(&-&p.r, f64::EPSILON * g.norm()).ok()?;
            let passive = with.iter().zip(strengths.iter()).all(|(k, c)| !is_loss(*k) || *c >= 0.0);
            passive.then(|| (*k, strengths.as_slice().to_vec(), 0.5 * (&p.r + &g * &strengths).norm_squared()))
        });
        let Some((k, strengths, left)) = next.min_by(|a, b| a.2.total_cmp(&b.2)) else { break };
        let fall = state.1 - left;
        if fall < told.term * whole || fall < 0.5 * (rows.max(1) as f64).ln() + told.term_nats {
            break;
        }
        chosen.push(k);
        state = (strengths, left);
    }
    (!chosen.is_empty()).then(|| (chosen.into_iter().zip(state.0).collect(), state.1))
}

/// The formula of terms in x and v.
fn expression(terms: &[(usize, f64)]) -> String {
    let term = |(k, (t, _)): (usize, &(usize, f64))| {
        let text = TERMS[*t].0.replace('u', "(x/X)").replace('w', "(v/V)").replace('z', "(v/Vs)");
        format!("f{}*({text})", k + 1)
    };
    terms.iter().enumerate().map(term).collect::<Vec<_>>().join(" + ")
}

/// Terms as one effect of the model; none where the formula is refused.
fn instance(terms: &[(usize, f64)], at: &str, places: &[usize], scales: &Scales, rotational: bool, told: &Telling) -> Option<Instance> {
    let expression = expression(terms);
    let (force, length) = if rotational { (Dimension::MOMENT, Dimension::ANGLE) } else { (Dimension::FORCE, Dimension::LENGTH) };
    let mut parameters: Vec<(String, Dimension)> = (0..terms.len()).map(|k| (format!("f{}", k + 1), force)).collect();
    let mut params: Vec<ParamValue> = terms
        .iter()
        .map(|(t, c)| {
            let most = told.term_reach * c.abs();
            let least = if TERMS[*t].1 { 0.0 } else { -most };
            ParamValue { min: least, max: most, ..ParamValue::free(*c, Sign::Any) }
        })
        .collect();
    let velocity = length.over(Dimension::TIME);
    // Where no test moves slowly, the largest velocity is the least.
    let slow = if scales.least_v.is_finite() { scales.least_v } else { scales.v };
    for (name, dimension, value) in [("X", length, scales.x), ("V", velocity, scales.v), ("Vs", velocity, slow)] {
        if expression.contains(&format!("/{name})")) {
            parameters.push((name.into(), dimension));
            params.push(ParamValue::fixed(value));
        }
    }
    let effect = compile(&Definition { expression, states: vec![], parameters, active: false, rotational }).ok()?;
    Some(Instance::new(effect, at, Site::Places(places.to_vec()), params))
}

/// The block for study.toml.
fn stated(instance: &Instance, terms: &[(usize, f64)], rotational: bool) -> String {
    let (force, length) = if rotational { ("N m", "rad") } else { ("N", "m") };
    let mut text = format!("[[effect]]\neffect = \"formula\"\nat = \"{}\"\nexpression = \"{}\"\n", instance.at, expression(terms));
    for (p, value) in instance.effect.info().params.iter().zip(&instance.params) {
        let v = value.value;
        text += &match p.name {
            "X" => format!("X = {{ start = \"{v:.4e} {length}\", fixed = true }}\n"),
            "V" | "Vs" => format!("{} = {{ start = \"{v:.4e} {length}/s\", fixed = true }}\n", p.name),
            name => format!(
                "{name} = {{ start = \"{v:.4e} {force}\", min = \"{:.4e} {force}\", max = \"{:.4e} {force}\" }}\n",
                value.min, value.max
            ),
        };
    }
    text
}

/// The missing force where a test drives the place itself and reads its force; else the formula over a cycle of the largest motion.
fn picture(plans: &[&Plan], system: &System, fitted: &Instance, place: usize, scales: &Scales, points: usize) -> Vec<Missed> {
    let crate::effect::Effect::Force(law) = fitted.effect else { return vec![] };
    let p: Vec<f64> = fitted.params.iter().map(|p| p.value).collect();
    let force = |x: f64, v: f64| law.value(&Inputs { x, v, a: 0.0, dx: 0.0 }, 1.0, &mut [], &p);
    let name = format!("force at {}", system.model.place_name(place));
    let mut list = Vec::new();
    for plan in plans {
        let Some(block) = plan.blocks.iter().find(|b| b.kind == BlockKind::Loop && b.label == name && b.x.len() == b.range.len()) else {
            continue;
        };
        let Ok(computed) = plan.evaluate(system, &[], false) else { continue };
        let step = block.range.len().div_ceil(points).max(1);
        let rows: Vec<usize> = (0..block.range.len()).step_by(step).collect();
        let pick = |values: &[f64]| rows.iter().map(|k| values[*k]).collect::<Vec<f64>>();
        let (x, v) = (pick(&block.x), pick(&block.v));
        list.push(Missed {
            test: plan.id.clone(),
            phase: pick(&block.abscissa),
            force: rows.iter().map(|k| block.range.start + k).map(|i| plan.measured[i] - computed.values[i]).collect(),
            formula: x.iter().zip(&v).map(|(x, v)| force(*x, *v)).collect(),
            x,
            v,
        });
    }
    if list.is_empty() {
        let phase: Vec<f64> = (0..=points).map(|k| std::f64::consts::TAU * k as f64 / points as f64).collect();
        let x: Vec<f64> = phase.iter().map(|p| scales.x * p.sin()).collect();
        let v: Vec<f64> = phase.iter().map(|p| scales.v * p.cos()).collect();
        let formula = x.iter().zip(&v).map(|(x, v)| force(*x, *v)).collect();
        list.push(Missed { test: String::new(), phase, x, v, force: vec![], formula });
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every term is a formula of the right dimension, and keeps the energy it is given where it is a loss.
    #[test]
    fn every_term_is_a_passive_formula() {
        let motion = crate::effect::formula::Motion { x: 2e-3, v: 0.1 };
        let scales = Scales { x: 2e-3, v: 0.1, least_v: 0.01, ..Scales::default() };
        for t in 0..TERMS.len() {
            for rotational in [false, true] {
                let made = instance(&[(t, 3.0)], "c1.x", &[0], &scales, rotational, &Telling::default());
                let made = made.unwrap_or_else(|| panic!("{} is refused", TERMS[t].0));
                let crate::effect::Effect::Force(law) = made.effect else { panic!("{made:?}") };
                let p: Vec<f64> = made.params.iter().map(|p| p.value).collect();
                law.formula().unwrap().examine(&p, &[motion]).unwrap();
                let power = |x: f64, v: f64| law.value(&Inputs { x, v, a: 0.0, dx: 0.0 }, 1.0, &mut [], &p) * v;
                let grid = (-4..=4).flat_map(|i| (-4..=4).map(move |j| (2e-3 * f64::from(i) / 4.0, 0.1 * f64::from(j) / 4.0)));
                assert!(!TERMS[t].1 || grid.clone().all(|(x, v)| power(x, v) >= 0.0), "{}", TERMS[t].0);
            }
        }
        assert_eq!(expression(&[(1, 1.0), (19, 2.0)]), "f1*((x/X)^3) + f2*(abs((x/X))*tanh(30*(v/Vs)))");
    }
}
