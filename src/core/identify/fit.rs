//! One fit: options in, outcome out.

use super::constraints::{Constraints, Source};
use super::ending::{LogEntry, Termination, Tolerances};
use super::journal::{Asked, Kept};
use super::lm::{ConstrainedLm, LmState};
use super::monitor::{Checkpoint, Monitor};
use super::problem::{Augmented, LeastSquares, LossBlock, Losses, Prior};
use super::{EvalError, IdentifyError};
use crate::parallel::{self, Watch};
use argmin::core::{Error, Executor, Jacobian, Operator, State};
use nalgebra::{DMatrix, DVector};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The statement of a fit beside the problem itself.
#[derive(Debug, Clone)]
pub struct FitOptions {
    /// one per parameter, for messages
    pub names: Vec<String>,
    pub constraints: Constraints,
    pub priors: Vec<Prior>,
    pub losses: Vec<LossBlock>,
    pub tolerances: Tolerances,
}

impl FitOptions {
    /// Plain least squares without constraints on `names`.
    pub fn new<S: Into<String>>(names: impl IntoIterator<Item = S>) -> Self {
        let names: Vec<String> = names.into_iter().map(Into::into).collect();
        let constraints = Constraints::none(names.len());
        Self { names, constraints, priors: vec![], losses: vec![], tolerances: Tolerances::default() }
    }

    /// Checks everything that does not need the model: sizes, numbers, constraints and that a point satisfies them, priors, tolerances.
    pub fn validate<P: LeastSquares + ?Sized>(&self, problem: &P) -> Result<(), IdentifyError> {
        self.validate_form(problem)?;
        self.constraints.validate(&self.names)
    }

    /// The start is a feasible point when it is one; only when it is not, the question is whether there is any.
    pub(crate) fn validate_with_start<P: LeastSquares + ?Sized>(&self, problem: &P, start: &[f64]) -> Result<(), IdentifyError> {
        self.validate_form(problem)?;
        self.constraints.check_start(start, &self.names).or_else(|why| self.constraints.validate(&self.names).and(Err(why)))
    }

    pub(crate) fn validate_form<P: LeastSquares + ?Sized>(&self, problem: &P) -> Result<(), IdentifyError> {
        if self.names.len() != problem.n_params() {
            let what = "parameter names".to_string();
            return Err(IdentifyError::Dimension { what, got: self.names.len(), expected: problem.n_params() });
        }
        self.constraints.validate_form(&self.names)?;
        for prior in &self.priors {
            let Some(name) = self.names.get(prior.index) else {
                return Err(IdentifyError::Dimension { what: "prior".into(), got: prior.index + 1, expected: self.names.len() });
            };
            if !prior.mean.is_finite() {
                return Err(IdentifyError::NotFinite { what: "prior mean", name: name.clone(), value: prior.mean });
            }
            if !(prior.sigma.is_finite() && prior.sigma > 0.0) {
                return Err(IdentifyError::NotFinite { what: "prior sigma", name: name.clone(), value: prior.sigma });
            }
            // 1 / sigma stands in the sensitivities, and its square in the normal equations.
            if !(prior.mean / prior.sigma).powi(2).is_finite() || !prior.sigma.powi(2).recip().is_finite() {
                return Err(IdentifyError::NotFinite {
                    what: "square of the prior mean over its sigma, or of 1 / sigma,",
                    name: name.clone(),
                    value: f64::INFINITY,
                });
            }
        }
        let t = &self.tolerances;
        for (option, value) in [("f_tol", t.f_tol), ("x_tol", t.x_tol), ("g_tol", t.g_tol), ("lambda", t.lambda)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(IdentifyError::Option { option, value: value.to_string(), accepted: "a positive number" });
            }
        }
        if !(t.drop.is_finite() && t.drop >= 0.0) {
            return Err(IdentifyError::Option { option: "drop", value: t.drop.to_string(), accepted: "a number that is not negative" });
        }
        Ok(())
    }
}

/// A constraint the outcome rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct ActiveConstraint {
    /// "k1 >= 0"
    pub label: String,
    /// drop of the cost per unit the limit is relaxed by, >= 0
    pub multiplier: f64,
    pub(crate) source: Source,
}

/// What a fit found. `residuals` and `jacobian` hold the problem's rows first and one row per prior after them, raw (not weighted by a
/// robust loss).
#[derive(Debug, Clone)]
pub struct FitOutcome {
    pub p: Vec<f64>,
    pub start: Vec<f64>,
    /// 1/2 ||r||^2, or the sum of the robust losses
    pub cost: f64,
    pub start_cost: f64,
    pub residuals: DVector<f64>,
    pub jacobian: DMatrix<f64>,
    /// rows that belong to the problem; the rest are priors
    pub n_residuals: usize,
    pub termination: Termination,
    pub iterations: u64,
    /// (residual, Jacobian) evaluations
    pub evaluations: (u64, u64),
    pub wall_s: f64,
    pub active: Vec<ActiveConstraint>,
    /// parameters that moved no residual at the last point
    pub held: Vec<usize>,
    pub log: Vec<LogEntry>,
    pub(crate) gait: Gait,
}

impl FitOutcome {
    /// rms of the whitened residuals of the data: 1 for a model that is right.
    pub fn whitened_rms(&self) -> f64 {
        (self.residuals.rows(0, self.n_residuals).norm_squared() / self.n_residuals.max(1) as f64).sqrt()
    }
}

/// How the solver was moving when it ended: what [`go_on`] takes up again.
#[derive(Debug, Clone)]
pub(crate) struct Gait {
    pub(crate) lambda: f64,
    pub(crate) growth: f64,
    /// one per parameter
    pub(crate) scale: Vec<f64>,
    pub(crate) last_drop: f64,
}

/// argmin's view of the problem. The first evaluation gives the state that is kept where the fit is stopped at once; later ones are trials,
/// and are given up when the fit is stopped.
struct Evaluated<'a, P: LeastSquares + ?Sized> {
    problem: Augmented<'a, P>,
    watches: [Watch; 2],
    begun: AtomicBool,
}

impl<P: LeastSquares + ?Sized> Evaluated<'_, P> {
    fn watched<T>(&self, evaluate: impl FnOnce(&Augmented<'_, P>) -> T) -> T {
        let trial = usize::from(self.begun.swap(true, Ordering::Relaxed));
        parallel::watched(&self.watches[trial], || evaluate(&self.problem))
    }
}

impl<P: LeastSquares + ?Sized> Operator for Evaluated<'_, P> {
    type Param = DVector<f64>;
    type Output = DVector<f64>;
    fn apply(&self, p: &Self::Param) -> Result<Self::Output, Error> {
        Ok(self.watched(|o| o.residuals(p.as_slice()))?)
    }
}

impl<P: LeastSquares + ?Sized> Jacobian for Evaluated<'_, P> {
    type Param = DVector<f64>;
    type Jacobian = (DVector<f64>, DMatrix<f64>);
    fn jacobian(&self, p: &Self::Param) -> Result<Self::Jacobian, Error> {
        Ok(self.watched(|o| o.jacobian(p.as_slice()))?)
    }
}

/// Fits `problem` from `start`. Errors are for what cannot begin (bad constraints, a start that cannot be evaluated); whatever happens
/// after that is in the outcome's `termination`, with the best state found.
pub fn fit<P: LeastSquares + ?Sized>(
    problem: &P,
    start: &[f64],
    options: &FitOptions,
    monitor: &Monitor<'_>,
) -> Result<FitOutcome, IdentifyError> {
    options.validate_with_start(problem, start)?;
    let mut solver = solver(problem, options, monitor)?;
    let mut p = start.to_vec();
    if let Some(file) = monitor.checkpoint.as_ref().filter(|_| monitor.resumes()) {
        let found = Checkpoint::load(&file.path, &options.names, rows(problem, options))?;
        p = found.p;
        // decimal digits may move a bound by its last bit
        options.constraints.snap(&mut p, &[]);
        options.constraints.check_start(&p, &options.names)?;
        solver.first_iteration = found.iteration;
        let last_drop = found.last_drop.unwrap_or(f64::INFINITY);
        solver.walk_as(Gait { lambda: found.lambda, growth: found.growth, scale: found.scale, last_drop });
    }
    run(problem, p, solver, options)
}

/// As many iterations more as `options` allows, from where an earlier fit of the same problem under the same statement ended: its residuals,
/// its Jacobian and its damping are taken up as they are, so that nothing is evaluated twice.
pub fn go_on<P: LeastSquares + ?Sized>(
    problem: &P,
    from: FitOutcome,
    options: &FitOptions,
    monitor: &Monitor<'_>,
) -> Result<FitOutcome, IdentifyError> {
    options.validate_with_start(problem, &from.p)?;
    let (got, expected) = (from.residuals.len(), rows(problem, options));
    if got != expected {
        return Err(IdentifyError::Dimension { what: "residuals of the fit that is gone on with".into(), got, expected });
    }
    let mut solver = solver(problem, options, monitor)?;
    solver.walk_as(from.gait);
    solver.known = Some((from.residuals, from.jacobian));
    run(problem, from.p, solver, options)
}

/// Rows of the problem and its priors.
fn rows<P: LeastSquares + ?Sized>(problem: &P, options: &FitOptions) -> usize {
    Augmented { problem, priors: &options.priors }.n_rows()
}

fn solver<'a, P: LeastSquares + ?Sized>(
    problem: &P,
    options: &'a FitOptions,
    monitor: &'a Monitor<'_>,
) -> Result<ConstrainedLm<'a>, IdentifyError> {
    let losses = Losses::new(&options.losses, problem.n_residuals())?;
    Ok(ConstrainedLm::new(options.tolerances, &options.constraints, losses, &options.names, monitor))
}

fn run<P: LeastSquares + ?Sized>(
    problem: &P,
    p: Vec<f64>,
    mut solver: ConstrainedLm<'_>,
    options: &FitOptions,
) -> Result<FitOutcome, IdentifyError> {
    let clock = Instant::now();
    let monitor = solver.monitor;
    let augmented = Augmented { problem, priors: &options.priors };
    let start = p.clone();
    let first_iteration = solver.first_iteration;
    let limit = options.tolerances.max_iterations.saturating_sub(first_iteration);

    // A fit that goes on has its first evaluation behind it.
    let evaluated = Evaluated {
        problem: augmented,
        watches: [solver.monitor.first_watch(), solver.monitor.watch()],
        begun: AtomicBool::new(solver.known.is_some()),
    };
    // A fit of no iterations is one evaluation, and one with a checkpoint of its own goes on from there.
    let journal = monitor.journal.as_ref().filter(|_| limit > 0 && monitor.checkpoint.is_none());
    let (mut asked, mut before) = (None, 0);
    if let Some(journal) = journal {
        let went_on = solver.known.is_some();
        let first = solver.known.take().map_or_else(|| evaluated.jacobian(&DVector::from_column_slice(&p)), Ok);
        let (r, j) = first.map_err(start_fails)?;
        let begins = Asked::new(&p, options, (&r, &j), solver.losses.cost(&r), went_on);
        if let Some(outcome) = journal.find(&begins).and_then(|kept| again(kept, &evaluated, (&p, &r, &j), &solver.losses, options)) {
            return Ok(outcome);
        }
        (solver.known, before, asked) = (Some((r, j)), u64::from(!went_on), Some(begins));
    }
    let configure = |state: LmState| state.param(DVector::from_vec(p)).max_iters(limit).counting(true);
    let result = Executor::new(evaluated, solver).configure(configure).timer(false).run();
    let mut result = result.map_err(start_fails)?;
    let count = |name: &str| result.problem.counts.get(name).copied().unwrap_or(0);
    let evaluations = (count("residual_count"), before + count("jacobian_count"));
    let solver = result.solver;
    let state = &mut result.state;
    let (Some(p), Some(residuals), Some(jacobian)) = (state.take_param(), state.take_residuals(), state.take_jacobian()) else {
        return Err(IdentifyError::Numerical { while_doing: "taking the outcome of the fit" });
    };
    let start_cost = solver.log.first().map_or_else(|| state.get_cost(), |entry| entry.cost);
    let outcome = FitOutcome {
        start,
        cost: solver.losses.cost(&residuals),
        start_cost,
        n_residuals: problem.n_residuals(),
        termination: solver.termination.unwrap_or(Termination::MaxIterations),
        iterations: first_iteration + state.get_iter(),
        evaluations,
        wall_s: clock.elapsed().as_secs_f64(),
        active: named(solver.active.iter().copied(), options),
        held: solver.held,
        log: solver.log,
        gait: Gait { lambda: solver.lambda, growth: solver.growth, scale: solver.scale, last_drop: solver.last_drop },
        p: p.as_slice().to_vec(),
        residuals,
        jacobian,
    };
    // What was given up on the way, here or in the work around it, is no end of this fit.
    if let Some((journal, asked)) = journal.zip(asked).filter(|_| !monitor.stops() && !parallel::given_up()) {
        journal.keep(asked, &outcome);
    }
    Ok(outcome)
}

/// The constraints that a fit rests on, by name.
fn named(active: impl Iterator<Item = (Source, f64)>, options: &FitOptions) -> Vec<ActiveConstraint> {
    let one = |(source, multiplier)| ActiveConstraint { label: options.constraints.label(source, &options.names), multiplier, source };
    active.map(one).collect()
}

/// Why a fit cannot begin.
fn start_fails(why: Error) -> IdentifyError {
    IdentifyError::StartFails(why.downcast_ref::<EvalError>().cloned().unwrap_or_else(|| EvalError::new(why.to_string())))
}

/// The outcome of a kept fit that began as this one does, evaluated where it ended; none where that cannot be computed, is not feasible, or does not cost
/// what was kept of it.
fn again<P: LeastSquares + ?Sized>(
    kept: &Kept,
    evaluated: &Evaluated<'_, P>,
    (start, r, j): (&[f64], &DVector<f64>, &DMatrix<f64>),
    losses: &Losses,
    options: &FitOptions,
) -> Option<FitOutcome> {
    let (gait, wall_s) = kept.gait(options)?;
    let mut p = kept.p().to_vec();
    if options.constraints.check_start(&p, &options.names).is_err() {
        // A bound may have moved by its last bit.
        options.constraints.snap(&mut p, &[]);
        options.constraints.check_start(&p, &options.names).ok()?;
    }
    let there = || evaluated.jacobian(&DVector::from_column_slice(&p)).ok();
    let (residuals, jacobian) = if p == start { (r.clone(), j.clone()) } else { there()? };
    let (cost, start_cost) = (losses.cost(&residuals), losses.cost(r));
    let (iterations, evaluations) = kept.took();
    kept.costs(cost, start_cost).then(|| FitOutcome {
        start: start.to_vec(),
        cost,
        start_cost,
        n_residuals: evaluated.problem.problem.n_residuals(),
        termination: kept.termination().clone(),
        iterations,
        evaluations,
        wall_s,
        active: named(kept.active(), options),
        held: kept.held(),
        log: vec![],
        gait,
        p,
        residuals,
        jacobian,
    })
}
