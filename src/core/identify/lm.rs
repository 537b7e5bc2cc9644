//! Constrained Levenberg-Marquardt as an argmin [`Solver`].
//!
//! One convention everywhere: cost = 1/2 ||r||^2 (for robust losses the sum of rho), gradient J'r, predicted drop
//! 1/2 (||r||^2 - ||r + J d||^2). Damping acts on u = D d, D the fading maximum of the column norms of J (after Moré 1978), and every
//! test is a ratio, so the iterates do not depend on units of parameters or residuals. The damping follows the gain ratio (Nielsen 1999).
//!
//! Convergence is judged on the undamped constrained step d0, never on a step that damping made short:
//!
//! | kind | test |
//! |---|---|
//! | gradient | sqrt(||r||^2 - ||r + J d0||^2) <= g_tol ||r||: the cosine between the residual and the free tangent space |
//! | step | ||D d0|| <= x_tol ||D p|| |
//! | cost | predicted drop of d0, and the last drop achieved, both <= f_tol cost or <= drop; where rounding in the residual hides smaller drops: 1e3 f_tol, and 1e6 f_tol when no step at all lowers the cost |

use super::constraints::{Constraints, Inequality, Source};
use super::crawl::Crawl;
use super::ending::{Convergence, Event, LogEntry, Termination, Tolerances};
use super::fit::Gait;
use super::linalg::{QrReducer, Reduced};
use super::monitor::{Checkpoint, Monitor, Progress};
use super::problem::Losses;
use super::step::{Step, StepProblem, predicted_drop, scaled_norm, yielding};
use argmin::core::{ArgminError, Error, IterState, Jacobian, KV, Operator, Problem, Solver, State, TerminationReason};
use argmin::kv;
use nalgebra::{DMatrix, DVector};
use std::time::Instant;

type V = DVector<f64>;
/// argmin's state: parameters, gradient, Jacobian, no Hessian, residuals.
pub type LmState = IterState<V, V, DMatrix<f64>, (), V, f64>;

/// Damping of the step that convergence is judged on: small against any singular value that carries information, large against rounding.
const UNDAMPED: f64 = 1e-16;
const LEAST_DAMPING: f64 = 1e-20;
const TRIALS: usize = 60;
/// Greatest shrinkage of the damping after one good step.
const SHRINK: f64 = 0.1;
/// The scale forgets: D = max(FADE D, column norms). At 1 (Moré) one wild start shrinks every later step; at 0 (Marquardt) parameters on a
/// plateau run away. NIST's 54 fits all succeed from 0.4 to 0.9.
const FADE: f64 = 0.7;
/// Rounding in the residual makes the cost uncertain by more than its own last bits: once neither the linear model nor the cost itself
/// changes by more than this many f_tol, there is nothing left to decide by.
const FLOOR: f64 = 1e3;
/// Steps of a relative length below `CREEP` that are taken one after another before the fit is called stalled: along a combination that the
/// residual hardly sees, the undamped step stays long while no step of it lowers the cost by anything.
const CREEP: f64 = 1e-10;
const CREEPING: u32 = 8;
/// Acceleration: place of the extra evaluation along the step, largest 2 |a| / |d| believed, relative length below which a step is straight.
const PROBE: f64 = 0.01;
const BEND: f64 = 0.75;
const SHORT: f64 = 1e-4;

/// The solver; made by [`super::fit`], which is the way to use it.
pub struct ConstrainedLm<'a> {
    pub(crate) tolerances: Tolerances,
    pub(crate) constraints: &'a Constraints,
    pub(crate) inequalities: Vec<Inequality>,
    pub(crate) losses: Losses,
    pub(crate) names: &'a [String],
    pub(crate) monitor: &'a Monitor<'a>,
    pub(crate) lambda: f64,
    pub(crate) growth: f64,
    /// D, fading maximum of the column norms; zero for a parameter that has moved nothing so far
    pub(crate) scale: Vec<f64>,
    pub(crate) held: Vec<usize>,
    pub(crate) active: Vec<(Source, f64)>,
    pub(crate) log: Vec<LogEntry>,
    pub(crate) termination: Option<Termination>,
    pub(crate) first_iteration: u64,
    /// D as it stood before this iteration, which is what a resumed fit starts from
    scale_before: Vec<f64>,
    pub(crate) last_drop: f64,
    /// the first step that the model was asked about was accepted, so the next one's Jacobian will most likely be wanted with its residual
    trusting: bool,
    /// steps in a row that were too short to matter
    creeping: u32,
    crawl: Crawl,
    crawls: bool,
    reducer: QrReducer,
    second_reducer: QrReducer,
    last_saved: Option<Instant>,
    /// cost below which the residual is what rounding leaves of that at the start
    nothing: f64,
    /// residuals and Jacobian at the start, where they are known
    pub(crate) known: Option<(V, DMatrix<f64>)>,
}

/// The state between two iterations, taken out of argmin's boxes.
struct Point {
    p: V,
    r: V,
    j: DMatrix<f64>,
    cost: f64,
}

enum Trial {
    Accepted { point: Point, relative_step: f64, ratio: f64 },
    Ended(Termination),
}

enum Acceleration {
    None,
    Add(V),
    /// 2 |a| / |d|, and the least-squares problem that a answers
    TooCurved {
        ratio: f64,
        bend: Box<StepProblem>,
    },
}

impl<'a> ConstrainedLm<'a> {
    pub(crate) fn new(
        tolerances: Tolerances,
        constraints: &'a Constraints,
        losses: Losses,
        names: &'a [String],
        monitor: &'a Monitor<'a>,
    ) -> Self {
        Self {
            tolerances,
            constraints,
            inequalities: constraints.inequalities(),
            losses,
            names,
            monitor,
            lambda: tolerances.lambda,
            growth: 2.0,
            scale: vec![0.0; names.len()],
            held: vec![],
            active: vec![],
            log: vec![],
            termination: None,
            first_iteration: 0,
            scale_before: vec![0.0; names.len()],
            last_drop: f64::INFINITY,
            trusting: false,
            creeping: 0,
            crawl: Crawl::default(),
            crawls: false,
            reducer: QrReducer::default(),
            second_reducer: QrReducer::default(),
            last_saved: None,
            nothing: 0.0,
            known: None,
        }
    }

    /// Goes on as an earlier fit went.
    pub(crate) fn walk_as(&mut self, gait: Gait) {
        (self.lambda, self.growth, self.scale, self.last_drop) = (gait.lambda, gait.growth, gait.scale, gait.last_drop);
    }

    fn note(&mut self, iteration: u64, cost: f64, event: Event) {
        self.log.push(LogEntry { iteration, event, cost, lambda: self.lambda });
    }

    /// Column norms of the weighted J into D. A column that is zero, or whose parameter at its full size would move the residual by less
    /// than rounding of what the others move, is held still: nothing but rounding would steer it.
    fn rescale(&mut self, reduced: &Reduced, p: &V, iteration: u64, cost: f64) {
        let norms: Vec<f64> = reduced.a.column_iter().map(|c| c.norm()).collect();
        let top = norms.iter().zip(p.iter()).map(|(n, p)| n * p.abs()).fold(0.0, f64::max);
        self.scale_before.clone_from(&self.scale);
        let mut held = vec![];
        for (j, &norm) in norms.iter().enumerate() {
            if norm == 0.0 || (p[j] != 0.0 && norm * p[j].abs() <= 1e-15 * top) {
                held.push(j);
                if !self.held.contains(&j) && !self.constraints.is_fixed(j) {
                    self.note(iteration, cost, Event::Held { name: self.names[j].clone() });
                }
            } else {
                self.scale[j] = (FADE * self.scale[j]).max(norm);
            }
        }
        self.held = held;
    }

    /// Fall of the cost that is worth a step: `drop` in units of the noise, or of the residual variance 2 cost / n where that is larger.
    fn worth(&self, cost: f64, n: usize) -> f64 {
        (self.tolerances.drop * (2.0 * cost / n.max(1) as f64).max(1.0)).max(self.tolerances.f_tol * cost)
    }

    /// The kind of convergence reached at this point, if any.
    fn converged(&self, step: &StepProblem, reduced: &Reduced, scale: &[f64], p: &V, cost: f64, n: usize) -> Option<Convergence> {
        let d = &step.solve(UNDAMPED)?.d;
        let drop = predicted_drop(reduced, d);
        let norm = |v: &V| scaled_norm(v, scale);
        let worth = self.worth(cost, n);
        if (2.0 * drop.max(0.0)).sqrt() <= self.tolerances.g_tol * reduced.q.norm() {
            Some(Convergence::Gradient)
        } else if norm(d) <= self.tolerances.x_tol * norm(p) {
            Some(Convergence::Step)
        } else if drop <= worth && self.last_drop <= worth {
            Some(Convergence::Cost)
        } else {
            None
        }
    }

    /// Converged: the undamped step is within tolerance and lands closer by a whole order. Taken when the cost does not rise by more than it
    /// resolves: here the linear model sees further than differences of costs.
    fn last_step<O>(&self, problem: &mut Problem<O>, at: Point, step: &Step) -> Point
    where
        O: Operator<Param = V, Output = V> + Jacobian<Param = V, Jacobian = (V, DMatrix<f64>)>,
    {
        let mut p = &at.p + &step.d;
        let sources: Vec<Source> = step.active.iter().map(|a| a.0).collect();
        self.constraints.snap(p.as_mut_slice(), &sources);
        if p == at.p || !self.pull_inside(&mut p, &at.p) {
            return at;
        }
        match problem.problem("jacobian_count", |o| o.jacobian(&p)) {
            Ok((r, j)) if self.losses.cost(&r) <= at.cost * (1.0 + FLOOR * self.tolerances.f_tol) => {
                Point { cost: self.losses.cost(&r), p, r, j }
            }
            _ => at,
        }
    }

    fn reject(&mut self, iteration: u64, cost: f64, reason: String, at_least: f64) {
        self.note(iteration, cost, Event::Rejected { reason });
        self.lambda *= self.growth.max(at_least);
        self.growth *= 2.0;
    }

    /// Tries steps with growing damping until one lowers the cost. Where the last step was taken at the first trial, the Jacobian is asked
    /// for with the residual: it costs little more than the residual alone, and a rejection is rare there.
    fn advance<O>(&mut self, problem: &mut Problem<O>, at: &Point, step: &StepProblem, reduced: &Reduced, scale: &[f64], k: u64) -> Trial
    where
        O: Operator<Param = V, Output = V> + Jacobian<Param = V, Jacobian = (V, DMatrix<f64>)>,
    {
        let mut failure = None; // why no trial could be evaluated, as long as none could
        let mut evaluated = false;
        let mut first = true; // of the steps taken to the model; one that bends too much is not
        for _ in 0..TRIALS {
            if self.monitor.stop().is_some() {
                return Trial::Ended(Termination::Interrupted);
            }
            let Some(found) = step.solve(self.lambda) else {
                failure = Some("the step's quadratic program finds no answer".into());
                self.reject(k, at.cost, "the step's quadratic program found no answer".into(), 10.0);
                continue;
            };
            let mut p = &at.p + &found.d;
            match self.accelerate(problem, at, &found, scale) {
                Acceleration::None => {}
                Acceleration::Add(a) => p += a,
                Acceleration::TooCurved { ratio, bend } => {
                    self.reject(k, at.cost, format!("the step bends too much (acceleration over velocity {ratio:.2})"), 0.0);
                    self.straighten(step, &bend, scaled_norm(&found.d, scale), scale);
                    continue;
                }
            }
            let sources: Vec<Source> = found.active.iter().map(|a| a.0).collect();
            self.constraints.snap(p.as_mut_slice(), &sources);
            if !self.pull_inside(&mut p, &at.p) {
                self.reject(k, at.cost, "rounding leaves the feasible set".into(), 10.0);
                continue;
            }
            if p == at.p {
                break; // the step is below the resolution of the parameters
            }
            let d = &p - &at.p;
            // what the linear model promises: of the step on its constraints as taken, without the acceleration
            let predicted = predicted_drop(reduced, if found.active.is_empty() { &found.d } else { &d });
            let ahead = (first && self.trusting).then(|| problem.problem("jacobian_count", |o| o.jacobian(&p)).ok()).flatten();
            (self.trusting, first) = (first, false);
            let evaluation = match ahead {
                Some((r, j)) => Ok((r, Some(j))),
                None => problem.problem("residual_count", |o| o.apply(&p)).map(|r| (r, None)),
            };
            let (r, known) = match evaluation {
                Ok(found) => found,
                Err(why) => {
                    failure = Some(format!("the model fails at every step tried: {why}"));
                    self.reject(k, at.cost, format!("the model failed: {why}"), 10.0);
                    continue;
                }
            };
            evaluated = true;
            let cost = self.losses.cost(&r);
            let ratio = if predicted > 0.0 { (at.cost - cost) / predicted } else { 0.0 };
            if !(cost < at.cost && ratio > 1e-4) {
                let floor = FLOOR * self.tolerances.f_tol * at.cost;
                let below = predicted <= floor && (cost - at.cost).abs() <= floor;
                if below && self.lambda <= 1e-3 {
                    // the promise and the change are both below what the cost can resolve
                    return Trial::Ended(Termination::Converged(Convergence::Cost));
                }
                self.reject(k, at.cost, format!("cost {cost:e}, gain ratio {ratio:.3e}"), 0.0);
                if self.crawl.crawls(at.cost, self.worth(at.cost, at.r.len())) {
                    return Trial::Ended(Termination::Stalled);
                }
                // A shorter step changes no digit that is asked for.
                if scaled_norm(&d, scale) <= self.tolerances.x_tol * scaled_norm(&at.p, scale) {
                    break;
                }
                continue;
            }
            let (r, j) = match known.map_or_else(|| problem.problem("jacobian_count", |o| o.jacobian(&p)), |j| Ok((r, j))) {
                Ok(pair) => pair,
                Err(why) => {
                    self.reject(k, at.cost, format!("the sensitivities failed: {why}"), 10.0);
                    continue;
                }
            };
            let norm = |v: &V| scaled_norm(v, scale);
            let relative_step = norm(&d) / norm(&p).max(f64::MIN_POSITIVE);
            self.active = found.active;
            self.note(k, at.cost, Event::Accepted { ratio, relative_step });
            self.lambda = (self.lambda * (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(SHRINK, 2.0)).max(LEAST_DAMPING);
            self.growth = 2.0;
            return Trial::Accepted { point: Point { p, r, j, cost }, relative_step, ratio };
        }
        if self.monitor.stop().is_some() {
            return Trial::Ended(Termination::Interrupted);
        }
        if let Some(why) = failure.filter(|_| !evaluated) {
            return Trial::Ended(Termination::Failed(why));
        }
        // No step lowers the cost. Where the linear model promises next to nothing either, that is rounding, and the place is the minimum.
        let promised = step.solve(UNDAMPED).map_or(f64::INFINITY, |s| predicted_drop(reduced, &s.d));
        let rounding = promised <= FLOOR * FLOOR * self.tolerances.f_tol * at.cost;
        Trial::Ended(if rounding { Termination::Converged(Convergence::Cost) } else { Termination::Stalled })
    }

    /// Geodesic acceleration (Transtrum and Sethna 2012): along the step d the residual is r + J d + r''/2, r'' the second derivative in
    /// that direction, from one more evaluation; the correction is a/2 with a the damped least-squares answer to r''. It follows curved
    /// valleys with far fewer iterations, and a step whose a is not small against d lies outside what the linear model describes: damp
    /// it, even if it happens to lower the cost. Steps on active constraints and steps too short to bend are taken as they are.
    fn accelerate<O>(&mut self, problem: &mut Problem<O>, at: &Point, step: &Step, scale: &[f64]) -> Acceleration
    where
        O: Operator<Param = V, Output = V> + Jacobian<Param = V, Jacobian = (V, DMatrix<f64>)>,
    {
        let norm = |v: &V| scaled_norm(v, scale);
        let length = norm(&step.d);
        if !self.tolerances.acceleration || !step.active.is_empty() || length <= SHORT * norm(&at.p) {
            return Acceleration::None;
        }
        let h = PROBE;
        let Ok(probed) = problem.problem("residual_count", |o| o.apply(&(&at.p + &step.d * h))) else {
            return Acceleration::None; // the full step will tell
        };
        let second = ((probed - &at.r) / h - &at.j * &step.d) * (2.0 / h);
        let mut reduced = self.second_reducer.reduce(&at.j, &second, self.losses.sqrt_weights(&at.r).as_deref());
        reduced.forget(&self.held);
        let bend = StepProblem::new(&reduced, scale, at.p.as_slice(), self.constraints, &[]);
        let Some(a) = bend.solve(self.lambda) else {
            return Acceleration::None;
        };
        let ratio = 2.0 * norm(&a.d) / length;
        if ratio > BEND {
            return Acceleration::TooCurved { ratio, bend: Box::new(bend) };
        }
        let a = a.d * 0.5;
        let inside = self.inequalities.is_empty() || self.constraints.is_feasible((&at.p + &step.d + &a).as_slice());
        if inside { Acceleration::Add(a) } else { Acceleration::None }
    }

    /// After a step of length `length` that bends too much: raises the damping past the values at which the step, by the second derivative
    /// just measured (which goes with the square of the length), would bend too much again. Saves their evaluations; what is then tried is
    /// probed in its own direction.
    fn straighten(&mut self, step: &StepProblem, bend: &StepProblem, length: f64, scale: &[f64]) {
        for _ in 0..TRIALS {
            let (Some(next), Some(a)) = (step.solve(self.lambda), bend.solve(self.lambda)) else { return };
            let shorter = scaled_norm(&next.d, scale);
            if !next.active.is_empty() || 2.0 * scaled_norm(&a.d, scale) * (shorter / length).powi(2) <= BEND * shorter {
                return;
            }
            self.lambda *= self.growth;
            self.growth *= 2.0;
        }
    }

    /// After snapping, linear rows may be violated by rounding: go back along the step until they are not.
    fn pull_inside(&self, p: &mut V, from: &V) -> bool {
        let mut back = 1e-15;
        while !self.constraints.is_feasible(p.as_slice()) {
            if back > 1e-3 {
                return false;
            }
            *p = &*p + (from - &*p) * back;
            self.constraints.snap(p.as_mut_slice(), &[]);
            back *= 10.0;
        }
        true
    }

    fn save(&mut self, point: &Point, iteration: u64, last: bool) {
        let Some(file) = &self.monitor.checkpoint else { return };
        if !last && self.last_saved.is_some_and(|t| t.elapsed() < file.every) {
            return;
        }
        self.last_saved = Some(Instant::now());
        let state = Checkpoint {
            schema: 1,
            names: self.names.to_vec(),
            n_residuals: point.r.len(),
            iteration,
            cost: point.cost,
            p: point.p.as_slice().to_vec(),
            lambda: self.lambda,
            growth: self.growth,
            scale: if last { self.scale_before.clone() } else { self.scale.clone() },
            last_drop: Some(self.last_drop).filter(|d| d.is_finite()),
        };
        if let Err(why) = file.keep(&state) {
            self.note(iteration, point.cost, Event::CheckpointFailed { reason: why.to_string() });
        }
    }
}

fn store(state: LmState, point: Point) -> LmState {
    let gradient = point.j.tr_mul(&point.r);
    state.param(point.p).residuals(point.r).jacobian(point.j).gradient(gradient).cost(point.cost)
}

impl<O> Solver<O, LmState> for ConstrainedLm<'_>
where
    O: Operator<Param = V, Output = V> + Jacobian<Param = V, Jacobian = (V, DMatrix<f64>)>,
{
    fn name(&self) -> &str {
        "constrained Levenberg-Marquardt"
    }

    fn init(&mut self, problem: &mut Problem<O>, mut state: LmState) -> Result<(LmState, Option<KV>), Error> {
        let p = state.take_param().ok_or_else(incomplete)?;
        let known = self.known.take().map(Ok);
        let (r, j) = known.unwrap_or_else(|| problem.problem("jacobian_count", |o| o.jacobian(&p)))?;
        let cost = self.losses.cost(&r);
        self.nothing = cost * f64::EPSILON.powi(2);
        Ok((store(state, Point { p, r, j, cost }), None))
    }

    fn next_iter(&mut self, problem: &mut Problem<O>, mut state: LmState) -> Result<(LmState, Option<KV>), Error> {
        let k = self.first_iteration + state.iter;
        let p = state.take_param().ok_or_else(incomplete)?;
        let (r, j) = (state.take_residuals().ok_or_else(incomplete)?, state.take_jacobian().ok_or_else(incomplete)?);
        let cost = state.get_cost();
        let mut at = Point { p, r, j, cost };

        let mut reduced = self.reducer.reduce(&at.j, &at.r, self.losses.sqrt_weights(&at.r).as_deref());
        self.rescale(&reduced, &at.p, k, cost);
        reduced.forget(&self.held);
        let scale = yielding(&self.scale, &self.held, self.constraints, &self.inequalities);
        let step = StepProblem::new(&reduced, &scale, at.p.as_slice(), self.constraints, &self.inequalities);

        // with constraints the test costs a quadratic program, so it waits until the cost has begun to settle
        let settled = !step.is_constrained() || self.last_drop <= 1e-2 * cost || state.iter == 0;
        let mut trial = if cost == 0.0 {
            Trial::Ended(Termination::Converged(Convergence::ZeroResidual))
        } else if let Some(kind) = settled.then(|| self.converged(&step, &reduced, &scale, &at.p, cost, at.r.len())).flatten() {
            Trial::Ended(Termination::Converged(kind))
        } else if self.creeping >= CREEPING || self.crawls {
            Trial::Ended(Termination::Stalled)
        } else {
            self.advance(problem, &at, &step, &reduced, &scale, k)
        };
        if matches!(trial, Trial::Ended(Termination::Stalled)) && cost <= self.nothing {
            trial = Trial::Ended(Termination::Converged(Convergence::ZeroResidual));
        }
        if let Trial::Ended(Termination::Converged(_)) = trial
            && let Some(full) = step.solve(UNDAMPED)
        {
            at = self.last_step(problem, at, &full);
            self.active = full.active; // with the multipliers of the undamped problem
        }
        let cost = at.cost;
        match trial {
            Trial::Accepted { point, relative_step, ratio } => {
                self.last_drop = cost - point.cost;
                self.crawls = self.crawl.crawls(point.cost, self.worth(point.cost, point.r.len()));
                self.creeping = if relative_step < CREEP { self.creeping + 1 } else { 0 };
                self.save(&point, k + 1, false);
                if let Some(callback) = &self.monitor.on_iteration {
                    callback(&Progress { iteration: k + 1, cost: point.cost, lambda: self.lambda, step: relative_step });
                }
                if let Some(callback) = &self.monitor.on_point {
                    callback(point.p.as_slice());
                }
                let log = kv!("lambda" => self.lambda; "step" => relative_step; "ratio" => ratio;);
                Ok((store(state, point), Some(log)))
            }
            Trial::Ended(why) => {
                self.save(&at, k, true);
                let reason = match why {
                    Termination::Converged(_) => TerminationReason::SolverConverged,
                    Termination::Interrupted => TerminationReason::Interrupt,
                    _ => TerminationReason::SolverExit(why.name().into()),
                };
                self.note(k, cost, Event::Ended { reason: format!("{why:?}") });
                self.termination = Some(why);
                Ok((store(state, at).terminate_with(reason), None))
            }
        }
    }
}

fn incomplete() -> Error {
    ArgminError::PotentialBug { text: "the state of the fit is incomplete".into() }.into()
}
