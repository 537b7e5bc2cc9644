//! A model with its tests, and the least squares of it.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::data::{FrfDoubt, Rig};
use crate::identify::{
    self, Constraints, FitOptions, FitOutcome, IdentifyError, LeastSquares, Loss, LossBlock, Measure, Monitor, Prior, Termination,
    Uncertainty, UncertaintyOptions,
};
use crate::model::{FreeParam, ModelError, ParamValue, System};
use crate::parallel;
use crate::residual::{Common, Memo, Problem};
use crate::response::Plan;

use super::slack::Slack;
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
    /// Frequency responses that are refused: no fit begins with one.
    pub refused: Vec<FrfDoubt>,
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

    /// The same with one start, no more than so many iterations, and an end where the cost changes little (`fitting.coarse`).
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

    /// Whitened residuals of these tests in the free parameters of a system.
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
        // With sensitivities where they are kept: a fit asks for them first.
        let v = to.variables();
        let met = if self.memo.is_some() { to.jacobian(&v).map(|(r, _)| r) } else { to.residuals(&v) };
        (met.map_or(f64::INFINITY, squares) < misses).then_some(there)
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
