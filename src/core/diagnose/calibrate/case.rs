//! A model with its tests, and its fit.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::data::Rig;
use crate::effect::Dim;
use crate::identify::{
    self, Constraints, FitOptions, FitOutcome, IdentifyError, LeastSquares, Loss, LossBlock, Measure, Monitor, Prior, Termination,
    Uncertainty, UncertaintyOptions,
};
use crate::model::{FreeParam, Instance, ModelError, ParamValue, Site, System, Target};
use crate::parallel;
use crate::residual::{Common, Memo, Problem};
use crate::response::Plan;
use crate::units::Unit;

use super::approach::approached;
use super::compare::compare;
use super::slack::Slack;
use super::spread;
use super::weigh::{Scale, Weighed};
use crate::diagnose::DiagnoseError;
use crate::diagnose::results::*;

/// What the search for missing effects may use.
#[derive(Clone, Debug, Default)]
pub struct Search {
    /// Effects it is restricted to.
    pub effects: Option<Vec<String>>,
    /// Places it is restricted to.
    pub places: Option<Vec<String>>,
    /// Constants, as far as the study does not state them the default ones.
    pub settings: crate::diagnose::settings::Settings,
    /// Whether springs of a group and nominal masses deviate: from the start, or never; unstated, where that gains more than any effect.
    pub slack: Option<bool>,
    /// Bodies whose mass may deviate by this part, as the study says.
    pub mass_slack: Vec<(String, f64)>,
    /// What the test bench can do, within which a next test is proposed.
    pub rig: Rig,
}

/// A model with its tests.
#[derive(Clone)]
pub struct Case {
    /// Name of the study.
    pub name: String,
    /// Tests made ready, with their splits.
    pub plans: Arc<Vec<(Plan, SplitName)>>,
    /// The model with its effects and present values.
    pub system: System,
    /// What the data say of each other, whatever the model.
    pub of_data: Vec<Finding>,
    /// Pairs of free parameters in rising order, by name, with a least gap.
    pub orders: Vec<(String, String, f64)>,
    /// Loss on whitened residuals.
    pub loss: Loss,
    /// Iterations of a fit at most.
    pub max_iterations: u64,
    /// Starts of a fit.
    pub starts: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// Search.
    pub search: Search,
    /// Relative change of the cost at which a fit may end, where it need not come as close as it can.
    pub f_tol: Option<f64>,
    /// Fall of the cost that is worth no step, in units of the residual variance, where it is not that of a fit to be reported.
    pub worth: Option<f64>,
    /// What was computed of its fit tests a moment ago.
    pub memo: Option<Arc<Memo>>,
    /// Errors that its fit tests have in common.
    pub common: Option<Arc<Common>>,
    /// What deviates in its system of what the study ties or fixes.
    pub deviations: Slack,
    /// Effects that an earlier ladder has found, which goes on with them as its own.
    pub found: Vec<Instance>,
}

/// A fitted case.
#[derive(Clone)]
pub struct Fitted {
    /// The system at its fitted values.
    pub system: System,
    /// Free parameters.
    pub free: Vec<FreeParam>,
    /// What the identification gave.
    pub outcome: FitOutcome,
    /// Options it ran with.
    pub options: FitOptions,
    /// Change of the residuals per standard deviation of what the tests state of their conditions, a column each.
    pub spread: DMatrix<f64>,
}

impl Fitted {
    /// Free parameters that are not held at a bound.
    pub fn inside(&self) -> Vec<usize> {
        let bound = self.options.constraints.at_bound(&self.outcome.p);
        (0..self.free.len()).filter(|k| !bound.iter().any(|(i, _)| i == k)).collect()
    }

    /// Standard deviations, intervals and covariance of its parameters.
    pub fn uncertainty(&self) -> Result<Uncertainty, IdentifyError> {
        identify::uncertainty(&self.outcome, &self.options, &self.judgement())
    }

    /// What the deviations of its parameters are judged by.
    fn judgement(&self) -> UncertaintyOptions {
        let measure = |f: &FreeParam| match (f.log, self.system.absent_at_zero(f)) {
            (true, _) => Measure::Logarithm,
            (false, true) => Measure::Strength,
            (false, false) => Measure::Position,
        };
        let measures = self.free.iter().map(measure).collect();
        UncertaintyOptions { spread: self.spread.clone(), ..UncertaintyOptions::measured(measures) }
    }
}

impl Case {
    /// Plans of the given split.
    pub fn plans_of(&self, split: SplitName) -> Vec<&Plan> {
        self.plans.iter().filter(|(_, s)| *s == split).map(|(p, _)| p).collect()
    }

    /// The same case with this model.
    pub(in crate::diagnose) fn at(&self, system: &System) -> Case {
        Case { system: system.clone(), ..self.clone() }
    }

    /// The same with one start and no more than so many iterations.
    pub(in crate::diagnose) fn coarsely(&self, iterations: u64) -> Case {
        let (max_iterations, f_tol) = (self.max_iterations.min(iterations), Some(self.search.settings.fitting.coarse));
        Case { starts: 1, max_iterations, f_tol, ..self.clone() }
    }

    /// What was found in the data of every test and done to them, `test: what`.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.plans.iter().flat_map(|(p, _)| p.notes.iter().map(move |n| format!("{}: {n}", p.id))).collect();
        notes.extend(self.of_data.iter().map(|f| format!("{}: {}", f.test, f.claim)));
        notes.dedup();
        notes
    }

    /// The case with as many time steps in every test as the noise asks for at the system's present values; `None` where they are enough.
    pub fn refined(&self, system: &System) -> Option<Case> {
        self.in_other_steps(|p, _| p.refined(system))
    }

    /// The case with its fit tests computed about what this system does in them ([`Plan::expanded`]); `None` where none is.
    pub fn expanded(&self, system: &System) -> Option<Case> {
        self.in_other_steps(|p, split| if split == SplitName::Fit { p.expanded(system) } else { None })
    }

    /// The case as it was `expanded` about a system, or else in fewer time steps, and at fewer lines ([`Plan::coarser`], [`Plan::fewer_lines`]), for a first look at what
    /// it may say; `None` where there is nothing to spare.
    pub fn coarser(&self, expanded: Option<Case>) -> Option<Case> {
        let (steps, settings) = (expanded.is_none(), &self.search.settings);
        let fewer = expanded.as_ref().unwrap_or(self).in_other_steps(|p, _| {
            let coarser = p.coarser().filter(|_| steps);
            coarser.as_ref().unwrap_or(p).fewer_lines(settings.race.lines, settings.evidence.rises).or(coarser)
        });
        fewer.or(expanded)
    }

    /// The case with the plans that have other steps; `None` where none has.
    fn in_other_steps(&self, of: impl Fn(&Plan, SplitName) -> Option<Plan> + Sync) -> Option<Case> {
        let other = parallel::map(&self.plans, |(p, split)| of(p, *split));
        if other.iter().all(Option::is_none) {
            return None;
        }
        let plans = self.plans.iter().zip(other).map(|((p, s), o)| (o.unwrap_or_else(|| p.clone()), *s)).collect();
        Some(Case { plans: Arc::new(plans), memo: None, ..self.clone() })
    }

    /// Bounds, orders and priors of the system's free parameters in the fit's variables.
    pub fn options(&self, system: &System, n_residuals: usize) -> Result<FitOptions, ModelError> {
        self.options_in(&system.free(), system, n_residuals)
    }

    /// The same in the variables of the given free parameters.
    pub(in crate::diagnose) fn options_in(
        &self,
        free: &[FreeParam],
        system: &System,
        n_residuals: usize,
    ) -> Result<FitOptions, ModelError> {
        let param = |f: &FreeParam| -> &ParamValue { &system.instances[f.instance].params[f.param] };
        let mut options = FitOptions::new(free.iter().map(|f| f.name.clone()));
        let bound = |f: &FreeParam, v: f64, side: f64| match (f.log, v) {
            // A positive shape is kept within so many times its start, so that one without influence does not run away.
            (true, v) if v.is_infinite() || v <= 0.0 => f.variable(param(f).value) + side * self.search.settings.fitting.shape_reach.ln(),
            (true, v) => v.ln(),
            (false, v) => v,
        };
        let lower = free.iter().map(|f| bound(f, param(f).min, -1.0)).collect();
        let upper = free.iter().map(|f| bound(f, param(f).max, 1.0)).collect();
        options.constraints = Constraints::bounds(lower, upper);
        for (below, above, gap) in &self.orders {
            let find = |name: &str| free.iter().position(|f| f.name == name);
            let (Some(a), Some(b)) = (find(below), find(above)) else {
                let missing = if find(below).is_none() { below } else { above };
                return Err(ModelError::no_such("free parameter", missing, free.iter().map(|f| f.name.clone())));
            };
            options.constraints = options.constraints.order(a, b, *gap);
        }
        options.priors =
            free.iter().enumerate().filter_map(|(index, f)| param(f).prior.map(|(mean, sigma)| Prior { index, mean, sigma })).collect();
        if self.loss != Loss::Squares && n_residuals > 0 {
            options.losses = vec![LossBlock { rows: 0..n_residuals, loss: self.loss }];
        }
        options.tolerances.max_iterations = self.max_iterations;
        options.tolerances.drop = self.worth.unwrap_or(self.search.settings.fitting.worth_no_step);
        options.tolerances.f_tol = self.f_tol.unwrap_or(options.tolerances.f_tol);
        Ok(options)
    }

    fn problem<'a>(&self, system: &System, plans: Vec<&'a Plan>) -> Problem<'a> {
        Problem { memo: self.memo.clone(), common: self.common.clone(), ..Problem::new(plans, system.clone()) }
    }

    /// Fits the given system to the given tests.
    pub fn fit_system(&self, system: &System, plans: Vec<&Plan>, monitor: &Monitor) -> Result<Fitted, DiagnoseError> {
        let problem = self.problem(system, plans);
        let rows = problem.plans.iter().map(|p| p.len()).sum();
        let options = self.options(system, rows)?;
        options.constraints.validate(&options.names)?;
        let start = problem.variables();
        // What is resumed goes on from the best of its starts.
        let outcome = if self.starts > 1 && !start.is_empty() && !monitor.resumes() {
            let mut starts = vec![start.clone()];
            starts.extend(identify::latin_hypercube(&start, &options, self.starts - 1, self.seed)?);
            let mut results = identify::multi_start(&problem, &starts, &options, monitor)?;
            results.remove(0).result?
        } else {
            identify::fit(&problem, &start, &options, monitor)?
        };
        Ok(Fitted { system: problem.system_at(&outcome.p), free: problem.free, outcome, options, spread: DMatrix::zeros(0, 0) })
    }

    /// Where fits of the tests computed about a system lead from here ([`Case::expanded`]), for a fit in full to begin at: the way there costs little.
    /// None where nothing is cheaper so, or it leads nowhere.
    pub(in crate::diagnose) fn led_about(&self, system: &System, monitor: &Monitor) -> Option<System> {
        let mut led: Option<System> = None;
        for _ in 0..self.search.settings.rounds {
            let from = led.as_ref().unwrap_or(system);
            let Some(near) = self.expanded(from) else { break };
            match near.fit_system(from, near.plans_of(SplitName::Fit), &monitor.quiet()) {
                Ok(fitted) if !matches!(fitted.outcome.termination, Termination::Failed(_)) => led = Some(fitted.system),
                _ => break,
            }
        }
        let there = led?;
        // Where the tests themselves cannot be computed there, or are no better met, it led nowhere.
        let problem = |of: &System| self.problem(of, self.plans_of(SplitName::Fit));
        let (from, to) = (problem(system), problem(&there));
        let squares = |r: DVector<f64>| r.norm_squared();
        let misses = from.residuals(&from.variables()).map_or(f64::INFINITY, squares);
        // With sensitivities: the fit asks for them first.
        (to.jacobian(&to.variables()).map_or(f64::INFINITY, |(r, _)| squares(r)) < misses).then_some(there)
    }

    /// More iterations for a fit to these tests that has used up its own.
    pub fn go_on(&self, fitted: Fitted, plans: Vec<&Plan>, monitor: &Monitor) -> Result<Fitted, DiagnoseError> {
        let Fitted { system, mut options, outcome, .. } = fitted;
        let problem = Problem::new(plans, system);
        options.tolerances.max_iterations = self.max_iterations;
        let outcome = identify::go_on(&problem, outcome, &options, monitor)?;
        Ok(Fitted { system: problem.system_at(&outcome.p), free: problem.free, outcome, options, spread: DMatrix::zeros(0, 0) })
    }
}

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
/// As [`Case::fit_system`].
pub fn led(case: &Case, monitor: &Monitor) -> Result<(Fitted, bool), DiagnoseError> {
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
    notes.extend(too_quiet(&tests, fitted.free.len(), &case.search.settings.fitting));
    notes.extend(case.notes());
    let away = ran_away(&fitted, &parameters, start, case.search.settings.fitting.ran_away);
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

/// Free parameters that have run away from where they began, each with what may be done.
fn ran_away(fitted: &Fitted, parameters: &[ParameterResult], began: &System, times: f64) -> Vec<String> {
    let value = |system: &System, f: &FreeParam| system.instances[f.instance].params[f.param].value;
    let one = |f: &FreeParam| {
        let (from, to) = (value(began, f), value(&fitted.system, f));
        let (symbol, factor) = &fitted.system.instances[f.instance].params[f.param].unit;
        let open = fitted.system.instances[f.instance].params[f.param].max.is_infinite();
        let held = parameters.iter().any(|p| p.name == f.name && p.identifiable);
        let far = open && !held && from != 0.0 && to.abs() > times * from.abs();
        far.then(|| {
            format!(
                "`{}` ran away: from {} to {} {symbol}; the fitted tests do not hold it, or contradict the model (signs, units, places: \
                 `misfit check`); a `max` in study.toml keeps it",
                f.name,
                digits(from / factor, 3),
                digits(to / factor, 3)
            )
        })
    };
    fitted.free.iter().filter_map(one).collect()
}

/// What the likelihood makes of the residuals on the fitted tests.
fn as_it_stands(case: &Case, fitted: &Fitted) -> (Scale, Option<Weighed>) {
    let scale = Scale::of_fitted(case, &fitted.system, &case.search.settings);
    let stands = scale.as_it_stands(fitted);
    (scale, stands)
}

/// The effects of a system with their places.
pub fn effects(system: &System) -> Vec<EffectAt> {
    system.instances.iter().map(|i| EffectAt { effect: i.name().into(), at: i.at.clone() }).collect()
}

/// A number with this many significant digits, in plain notation where that is short.
fn digits(value: f64, count: i32) -> String {
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
                printed: format!("{} {text}{spread}", digits(p.value / factor, 5)),
                note: open.or_else(|| u.note.clone()),
            }
        })
        .collect();
    Ok((list, uncertainty.unidentifiable.iter().map(|n| n.label.clone()).collect()))
}
