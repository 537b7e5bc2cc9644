//! The tolerance cases of a study: their energies by every rung on the way to its answer, and what the tolerance stage makes of them.

use nalgebra::DMatrix;

use crate::diagnose::results::SplitName;
use crate::diagnose::{self, Case, Fitted};
use crate::identify::Monitor;
use crate::model::{Instance, System};
use crate::study::{Study, ToleranceSpec};
use crate::tolerance::{
    Constant, Finding, LawOutcome, LawQuestion, Outcome, Prediction, Quantity, Rung, Surface, energies, outcome as words, through,
};

use super::{Calibrated, PredictError, link, rung};

/// Relative change of the cost at which the fit of a rung that the program wrote may end: it stands at its optimum, and the fit need only see that it does.
const WRITTEN: f64 = 1e-6;

/// Points of the surface from one case to the next.
const FINER: usize = 8;

/// Effects of `system` that `before` does not have, as `effect at place`.
fn added(before: &System, system: &System) -> Vec<String> {
    let over = |i: &Instance| i.target.as_ref().map_or(String::new(), |t| format!(" over {}", t.condition));
    system.beyond(before).into_iter().map(|i| format!("{}{} at {}", i.name(), over(i), i.at)).collect()
}

/// Everything that the cases say of the answer and of the rungs before it.
fn outcome(spec: &ToleranceSpec, answer: &Calibrated, rungs: Vec<Rung>, seed: u64) -> Result<Outcome, PredictError> {
    let cases = &spec.tables[0].cases;
    let reference = energies::find(cases, &spec.reference)?;
    let mut findings: Vec<Finding> = Vec::new();
    let laws = if spec.libraries.is_empty() { None } else { Some(law(spec, answer, &rungs, reference, seed)?) };
    findings.extend(laws.iter().flat_map(|l| l.findings.clone()));
    if laws.is_none() {
        findings.extend(words::of_rungs(&rungs));
    }
    for c in &spec.conditions {
        let values: Vec<f64> = cases.cases.iter().map(|k| c.of.iter().filter_map(|q| k.values.get(q)).sum()).collect();
        findings.extend(words::unlike(cases, &c.name, &values));
    }
    findings.extend(words::varies(&spec.conditions.iter().map(|c| c.name.clone()).collect::<Vec<_>>(), &unvaried(spec, answer.study)));
    let constant = match (&spec.housing, spec.pairs.is_empty()) {
        (Some(housing), false) => {
            let constant = Constant::of(cases, &spec.pairs)?;
            let inertia = housing.moment_of_area(constant.value);
            let leaf = (inertia, housing.leaf_thickness(inertia));
            findings.extend(words::of_constant(&constant, leaf, housing.thickness));
            Some((constant, leaf))
        }
        _ => None,
    };
    let surface = spec.surface.as_ref().map(|axes| surface(spec, axes, &rungs, laws.as_ref())).transpose()?;
    Ok(Outcome { cases: cases.clone(), reference, constant, rungs, laws, surface, findings })
}

/// Conditions of the cases over which the model has a law though no two tests differ in them.
fn unvaried(spec: &ToleranceSpec, study: &Study) -> Vec<String> {
    let law = |name: &str| {
        study.system.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.condition == name) && i.params.iter().any(|p| p.free))
    };
    let varies = |name: &str| {
        let mut values = study.dataset.tests.iter().filter_map(|t| t.conditions.get(name)).map(|c| c.value);
        let first = values.next();
        values.any(|v| Some(v) != first)
    };
    spec.conditions.iter().map(|c| c.name.clone()).filter(|n| law(n) && !varies(n)).collect()
}

/// The law of the strengths that carry the model's loss, identified from the cases.
fn law(spec: &ToleranceSpec, answer: &Calibrated, rungs: &[Rung], reference: usize, seed: u64) -> Result<LawOutcome, PredictError> {
    let (link, at_link) = link(spec, answer)?;
    let base: Vec<f64> = match rungs.last().and_then(|r| r.cycles.first()) {
        Some(c) => c.predictions.iter().filter(|p| p.quantity == Quantity::Dissipated).map(|p| p.value / spec.scale).collect(),
        None => vec![],
    };
    let ask = LawQuestion {
        cases: &spec.tables[0].cases,
        reference,
        libraries: &spec.libraries,
        scale: spec.scale,
        others: &spec.scales,
        link: &link,
        base: &base,
        at_link,
        permutations: spec.permutations,
        seed,
    };
    Ok(through::answer(&ask)?)
}

fn surface(spec: &ToleranceSpec, axes: &[String; 2], rungs: &[Rung], laws: Option<&LawOutcome>) -> Result<Surface, PredictError> {
    let cases = &spec.tables[0].cases;
    let of = |list: &[Prediction]| list.iter().filter(|p| p.quantity == Quantity::Dissipated).map(|p| p.value).collect::<Vec<f64>>();
    let mut known = vec![("table".to_string(), cases.energies())];
    known.extend(rungs.iter().filter_map(|r| Some((r.title.clone(), of(&r.cycles.first()?.predictions)))));
    if let Some(l) = laws {
        known.push(("law through the model".into(), of(&l.predictions)));
    }
    let axes = [axes[0].as_str(), axes[1].as_str()];
    Ok(Surface::of(cases, axes, &known, FINER)?)
}

/// The case of a study; `written` of a rung that the program wrote.
///
/// # Errors
/// As [`Case::from_study`].
pub fn case(study: &Study, written: bool, seed: u64) -> Result<Case, PredictError> {
    Ok(Case { f_tol: written.then_some(WRITTEN), ..Case::from_study(study, seed)? })
}

/// The tolerance cases by every rung before the last of `way`, each fitted as long as there is time, and by the answer: `study`, the last of them, or the study that was
/// asked for where `way` is empty. `say` hears what is being done.
///
/// # Errors
/// A rung that cannot be fitted, a case that the model cannot compute, tables that do not fit together.
pub fn tolerance(
    spec: &ToleranceSpec,
    way: &[Study],
    (study, fitted, covariance): (&Study, &Fitted, &DMatrix<f64>),
    seed: u64,
    monitor: &Monitor,
    say: &dyn Fn(&str),
) -> Result<Outcome, PredictError> {
    let earlier = way.len().saturating_sub(1);
    let added = |k: usize, now: &Study| k.checked_sub(1).map_or(vec![], |k| added(&way[k].system, &now.system));
    let mut rungs = Vec::new();
    for (k, before) in way[..earlier].iter().enumerate() {
        // The answer comes before the way to it.
        if monitor.stops() {
            break;
        }
        say(&format!("fit of rung {k}"));
        let (_, fitted, _) = diagnose::fit(&case(before, true, seed)?, &SplitName::ALL, monitor)?;
        let spread = fitted.uncertainty()?;
        let added = added(k, before);
        let own = before.tolerance.as_ref().unwrap_or(spec);
        rungs.push(rung(own, &Calibrated::of(before, &fitted, &spread.covariance), title(k, &added), added)?);
    }
    say("tolerance cases");
    let added = added(earlier, study);
    let answer = Calibrated::of(study, fitted, covariance);
    rungs.push(rung(spec, &answer, title(earlier, &added), added)?);
    let untold = earlier + 1 - rungs.len();
    let mut outcome = outcome(spec, &answer, rungs, seed)?;
    if untold > 0 {
        outcome.findings.push(words::untold(untold));
    }
    Ok(outcome)
}

/// Of each case, W_D by the law of the strengths over `scale` times that of the model as it stands; 1 where the study asks for no law.
///
/// # Errors
/// As [`tolerance`].
pub fn factors(spec: &ToleranceSpec, scale: f64, model: &Calibrated, seed: u64) -> Result<Vec<f64>, PredictError> {
    let cases = &spec.tables[0].cases;
    if spec.libraries.is_empty() {
        return Ok(vec![1.0; cases.cases.len()]);
    }
    let rung = rung(spec, model, "as it stands".into(), vec![])?;
    let of = |list: &[Prediction]| -> Vec<f64> { list.iter().filter(|p| p.quantity == Quantity::Dissipated).map(|p| p.value).collect() };
    let plain = rung.cycles.first().map_or(vec![], |c| of(&c.predictions));
    let reference = energies::find(cases, &spec.reference)?;
    let law = of(&law(spec, model, &[rung], reference, seed)?.predictions);
    Ok(law.iter().zip(&plain).map(|(l, p)| l / p * spec.scale / scale).collect())
}

/// What a rung is called: as it stands, or what was added.
fn title(k: usize, added: &[String]) -> String {
    match (k, added) {
        (0, _) => "as it stands".into(),
        (k, []) => format!("rung {k}"),
        (k, [only]) => format!("rung {k}, with {only}"),
        (k, [first, more @ ..]) => format!("rung {k}, with {first} and {} more", more.len()),
    }
}
