//! The fit of a case, and what it is told as.

use crate::effect::Dim;
use crate::identify::Monitor;
use crate::model::{FreeParam, Site, System, Target};
use crate::parallel;
use crate::residual::Problem;
use crate::units::Unit;

use super::absurd::absurd;
use super::approach::approached;
use super::case::{Case, Fitted};
use super::compare::compare;
use super::spread;
use super::weigh::{Scale, Weighed};
use crate::diagnose::DiagnoseError;
use crate::diagnose::results::*;

/// A case fitted to its fit tests.
pub struct Began {
    /// The case, with the time steps that the fit needed.
    pub case: Case,
    /// The fit.
    pub fitted: Fitted,
    /// Whether it began where the logarithm of an FRF, or the first cycles of a record, led to.
    nearer: bool,
}

/// A case fitted to its fit tests in the time steps that it has, from where [`approached`] leads; and whether that led anywhere.
///
/// # Errors
/// As [`Case::fit_system`]; a frequency response that is refused.
pub fn led(case: &Case, monitor: &Monitor) -> Result<(Fitted, bool), DiagnoseError> {
    if let Some(doubt) = case.refused.first() {
        return Err(doubt.error().into());
    }
    let case = &Case { memo: Some(case.memo.clone().unwrap_or_default()), ..case.clone() };
    let nearer = approached(case, monitor)?;
    let start = nearer.as_ref().unwrap_or(&case.system);
    let about = if case.starts > 1 || monitor.resumes() { None } else { case.led_about(start, monitor) };
    let fitted = case.fit_system(about.as_ref().unwrap_or(start), case.plans_of(SplitName::Fit), monitor)?;
    Ok((fitted, nearer.is_some()))
}

/// Fits a case to its fit tests.
///
/// # Errors
/// As [`Case::fit_system`].
pub fn begin(case: &Case, monitor: &Monitor) -> Result<Began, DiagnoseError> {
    let mut case = case.clone();
    let (mut fitted, nearer) = led(&case, monitor)?;
    // Finer steps take the longest evaluations of all: they are given up, and not gone on with, when it is time to stop.
    let finer = parallel::watched(&monitor.watch(), || case.refined(&fitted.system));
    if let Some(finer) = finer.filter(|_| !monitor.stops()) {
        case = finer;
        // Finer steps move the best of several starts a little; they open no other valley.
        let single = Case { starts: 1, ..case.clone() };
        fitted = single.fit_system(&fitted.system, case.plans_of(SplitName::Fit), monitor)?;
    }
    Ok(Began { case, fitted, nearer })
}

/// Fits a case to its fit tests and holds every test that `splits` names against the result. The case comes back with the time steps
/// that the fit needed.
pub fn fit(case: &Case, splits: &[SplitName], monitor: &Monitor) -> Result<(Case, Fitted, FitResult), DiagnoseError> {
    let started = std::time::Instant::now();
    let start = &case.system;
    let Began { case, mut fitted, nearer } = begin(case, monitor)?;
    let case = &case;
    fitted.spread = parallel::watched(&monitor.watch(), || spread::columns(&case.plans_of(SplitName::Fit), &fitted.system));
    let tests = compare(case, &fitted.system, splits, &monitor.watch())?;
    let (parameters, unidentifiable) = parameters(case, &fitted)?;
    let mut notes = Vec::new();
    let sigmas = fitted.outcome.whitened_rms();
    if sigmas > case.search.settings.fitting.misses && !parameters.is_empty() {
        notes.push(format!(
            "parameters: their intervals are those of a model that is right; this one stays {} sigma (rms) from the fitted tests, and its \
             parameters make up for what it lacks",
            digits(sigmas, 2)
        ));
    }
    if nearer {
        notes.push(
            "start: an FRF or a record is computed off by more than half of what was measured; the logarithm of an FRF led to where its \
             peaks overlap, the first cycles of a record to where it is in phase"
                .into(),
        );
    }
    notes.extend(as_many(compared(&tests), fitted.free.len()));
    notes.extend(too_quiet(&tests, fitted.free.len(), &case.search.settings.fitting));
    notes.extend(case.notes());
    let away = absurd(case, &fitted, &parameters, start);
    let termination = if away.is_empty() { fitted.outcome.termination.name() } else { "failed" };
    notes.splice(0..0, away);
    let (scale, stands) = as_it_stands(case, &fitted);
    let result = FitResult {
        model_error: stands.as_ref().map_or_else(Vec::new, |w| scale.model_error(w)),
        readings: stands.as_ref().map_or_else(Vec::new, |w| scale.readings(w)),
        scatter: stands.as_ref().map_or_else(Vec::new, |w| scale.scatter(w)),
        noise: stands.as_ref().map_or(1.0, |w| w.v.kappa.exp()),
        study: case.name.clone(),
        termination: termination.into(),
        cost: fitted.outcome.cost,
        n_residuals: fitted.outcome.n_residuals,
        n_free: fitted.free.len(),
        wall_s: started.elapsed().as_secs_f64(),
        iterations: fitted.outcome.iterations,
        tests,
        parameters,
        unidentifiable,
        effects: effects(&fitted.system),
        notes,
    };
    Ok((case.clone(), fitted, result))
}

/// Where no more values are compared than parameters are free, every model of as many parameters meets them.
fn as_many(compared: usize, free: usize) -> Option<String> {
    (0 < compared && compared <= free).then(|| {
        format!(
            "parameters: {free} are free and {compared} values are compared: a model of as many meets them whatever it is, and what is left says nothing \
             about this one; more tests, or fewer free parameters, do"
        )
    })
}

/// Fitted tests that leave much less than their sigma, of which a model that is wrong would leave no more than noise.
fn too_quiet(tests: &[TestResult], free: usize, s: &crate::diagnose::settings::Fitting) -> Vec<String> {
    let quiet = |t: &&TestResult| t.split == SplitName::Fit && t.whitened_rms < s.too_quiet && t.n >= s.per_parameter * free.max(1);
    let say = |t: &TestResult| {
        format!(
            "{}: what is left is {} of its sigma: the noise is less than was stated or estimated, and an error of the model that is no larger stays unseen; \
             a `sigma` of its channels closer to the noise shows it",
            t.id,
            digits(t.whitened_rms, 2)
        )
    };
    tests.iter().filter(quiet).map(say).collect()
}

/// What the likelihood makes of the residuals on the fitted tests.
fn as_it_stands(case: &Case, fitted: &Fitted) -> (Scale, Option<Weighed>) {
    let scale = Scale::of_fitted(case, &fitted.system, &case.search.settings);
    let stands = scale.as_it_stands(fitted);
    (scale, stands)
}

/// The effects of a system with their places.
pub fn effects(system: &System) -> Vec<EffectAt> {
    system.instances.iter().map(|i| EffectAt::of(system, i)).collect()
}

/// A number with this many significant digits, in plain notation where that is short.
pub(super) fn digits(value: f64, count: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let order = value.abs().log10().floor() as i32;
    if (-4..6).contains(&order) {
        format!("{value:.*}", (count - 1 - order).max(0) as usize)
    } else {
        format!("{value:.*e}", (count - 1).max(0) as usize)
    }
}

fn rotational(system: &System, f: &FreeParam) -> bool {
    match &system.instances[f.instance].site {
        Site::Places(p) => p.first().is_some_and(|p| system.model.places[*p].axis.rotational()),
        Site::Channel(_) | Site::Outline(_) => false,
    }
}

/// What a law over a condition is per, where that is the dimension of the parameter.
fn per_condition(system: &System, f: &FreeParam) -> Option<Unit> {
    let instance = &system.instances[f.instance];
    let dim = instance.effect.info().params[f.param].dim;
    instance.target.as_ref().filter(|_| dim == Dim::PerCondition).map(Target::per_unit)
}

/// Unit of a parameter in SI.
pub fn unit_of(system: &System, f: &FreeParam) -> String {
    match per_condition(system, f) {
        Some(unit) => unit.dimension.si_unit(),
        None => system.instances[f.instance].effect.info().params[f.param].dim.si(rotational(system, f)),
    }
}

/// Unit for printing a parameter that the study gives none for, with its value in SI.
fn practical_unit(system: &System, f: &FreeParam) -> (String, f64) {
    match per_condition(system, f) {
        Some(unit) => (unit.symbol, unit.factor),
        None => system.instances[f.instance].effect.info().params[f.param].dim.practical(rotational(system, f)),
    }
}

/// Parameters with their intervals, and the named combinations the data do not determine.
pub fn parameters(case: &Case, fitted: &Fitted) -> Result<(Vec<ParameterResult>, Vec<String>), DiagnoseError> {
    let problem = Problem::new(case.plans_of(SplitName::Fit), fitted.system.clone());
    let mut uncertainty = fitted.uncertainty()?;
    uncertainty.probe(&problem, &fitted.outcome, &fitted.options)?;
    let list = uncertainty
        .parameters
        .iter()
        .zip(&fitted.free)
        .map(|(u, f)| {
            let p = &fitted.system.instances[f.instance].params[f.param];
            // From the fit's variable to the parameter: by the slope for the deviation, by the map for the interval.
            let back = |v: Option<f64>| v.map(|v| f.value(v));
            let std = u.std.map(|s| if f.log { s * p.value } else { s });
            let (text, factor) = if p.unit.0.is_empty() { practical_unit(&fitted.system, f) } else { p.unit.clone() };
            // A number without a unit is printed without a sign for none.
            let text = if text == "-" { String::new() } else { text };
            let spread = std.map(|s| format!(" +- {}", digits(1.96 * s / factor, 2))).unwrap_or_else(|| " (not identified)".into());
            let interval = (back(u.interval.0), back(u.interval.1));
            // As many digits as tell the ends apart, and two of their distance.
            let apart = match interval {
                (Some(a), Some(b)) if b > a => 2 + (a.abs().max(b.abs()) / (b - a)).log10().ceil().clamp(0.0, 8.0) as i32,
                _ => 4,
            };
            let end = |v: Option<f64>, open: &str| v.map_or(open.to_string(), |v| digits(v / factor, apart));
            let printed_interval = match interval {
                (None, None) => "open on both sides".into(),
                (a, b) => format!("{} to {} {text}", end(a, "-inf"), end(b, "inf")).trim_end().to_string(),
            };
            let open = back(u.open_to).map(|far| {
                let limit = if far.abs() > p.value.abs() { "infinite" } else { "nothing" };
                let far = format!("{} {text}", digits(far / factor, 4));
                format!("open: even {} agrees with the data, on this scale it is {limit}", far.trim_end())
            });
            ParameterResult {
                name: f.name.clone(),
                value: p.value,
                unit: unit_of(&fitted.system, f),
                std,
                interval,
                printed_interval,
                identifiable: u.identifiable,
                at_bound: u.at_bound,
                printed: format!("{}{spread}", format!("{} {text}", digits(p.value / factor, 5)).trim_end()),
                note: open.or_else(|| u.note.clone()),
            }
        })
        .collect();
    Ok((list, uncertainty.unidentifiable.iter().map(|n| n.label.clone()).collect()))
}
