//! Laws over conditions, looked for where each state of the conditions by itself wants the strengths.
//!
//! A score is a slope at the present model. Where a strength in truth doubles from one state of the conditions (an interference, a contact
//! area) to another, the model with one value for all follows some states and misses the others, and the slope there says little. So the
//! tests of every state are fitted by themselves, with what a law may follow free about its present value and all else as it stands. The
//! model is then linear in the logarithms `u` of those values about where each state wants them, `u_s`:
//!
//! ```text
//! r(theta, a) = r_s + J_s (theta - theta_0) + C_s (d ln factor / da at the state's conditions) a - C_s (u_s - u_0)
//! ```
//!
//! with `J_s` the columns of the model's own parameters there and `C_s` those of `u`, whitened with the variances that are left there. What
//! a law explains of it beside the own parameters is its score, and `theta`, `a` are where its refit begins.

use nalgebra::{DMatrix, DVector};

use crate::effect::Effect;
use crate::identify::Monitor;
use crate::model::{Instance, ParamValue, System};
use crate::parallel;
use crate::residual::Problem;
use crate::response::{Computed, Plan};

use super::candidates::Trial;
use super::refit::{cost, started, whitened};
use super::score::{Score, decomposed, project};
use super::secant::admissible;
use crate::diagnose::calibrate::case::Case;
use crate::diagnose::calibrate::weigh::{Scale, Weighed};
use crate::diagnose::results::SplitName;
use crate::diagnose::trace;

/// A law over a condition as the states want it.
pub struct Wanted {
    /// Its trial.
    pub trial: usize,
    /// The part of the cost about the states' own values that it takes away.
    pub drop: f64,
    /// Its standardised score there.
    pub z: f64,
    /// The model with it, where that is cheapest along the way to what the states want.
    pub begun: System,
    /// Its strength there.
    pub strength: f64,
}

impl Wanted {
    /// As a score.
    pub fn score(&self) -> Score {
        Score { trial: self.trial, z: self.z.abs(), drop: self.drop, strength: self.strength, p_value: 1.0, visible: f64::INFINITY }
    }
}

/// A parameter that laws may follow: instance and parameter.
type Followed = (usize, usize);

/// The laws over conditions among the trials, what explains most first. None where no law is tried, or all tests are in one state. `race`: the tests as
/// they are looked at, about where the model stands where that is cheaper.
pub fn wanted(scale: &Scale, race: &Case, base: &Weighed, trials: &[Trial], monitor: &Monitor) -> Vec<Wanted> {
    let system = &base.fitted.system;
    let laws: Vec<usize> = (0..trials.len()).filter(|t| trials[*t].instance.target.is_some()).collect();
    let followed = followed(laws.iter().map(|t| &trials[*t].instance), system);
    let plans = race.plans_of(SplitName::Fit);
    let states = states(&plans, laws.iter().map(|t| &trials[*t].instance));
    if followed.is_empty() || states.len() < 2 || trace::stopped(monitor) {
        return vec![];
    }
    let apart = parallel::map(&states, |tests| by_themselves(race, system, &followed, tests.iter().map(|t| plans[*t]).collect(), monitor));
    let about = About::new((scale, race), base, &followed, &states, &apart);
    let Some(about) = about else { return vec![] };
    let mut found: Vec<Wanted> = laws.iter().filter_map(|t| about.wants(*t, &trials[*t], race, base)).collect();
    found.sort_by(|a, b| b.drop.total_cmp(&a.drop));
    found
}

/// What the laws may follow that has a logarithm.
fn followed<'a>(laws: impl Iterator<Item = &'a Instance>, system: &System) -> Vec<Followed> {
    let mut all: Vec<Followed> = laws.filter_map(|l| l.target.as_ref()).flat_map(|t| t.instances.iter().map(|i| (*i, t.param))).collect();
    all.sort_unstable();
    all.dedup();
    all.retain(|(i, k)| system.instances[*i].params[*k].value > 0.0);
    all
}

/// The tests of every state of the conditions that the laws are over.
fn states<'a>(plans: &[&Plan], laws: impl Iterator<Item = &'a Instance>) -> Vec<Vec<usize>> {
    let mut conditions: Vec<&str> = laws.filter_map(|l| l.target.as_ref()).map(|t| t.condition.as_str()).collect();
    conditions.sort_unstable();
    conditions.dedup();
    let state = |t: usize| -> Vec<Option<u64>> { conditions.iter().map(|c| plans[t].conditions.get(*c).map(|v| v.to_bits())).collect() };
    let mut states: Vec<Vec<usize>> = Vec::new();
    for t in 0..plans.len() {
        match states.iter_mut().find(|s| state(s[0]) == state(t)) {
            Some(same) => same.push(t),
            None => states.push(vec![t]),
        }
    }
    states
}

/// What these tests by themselves want of the parameters that laws may follow; the present values where that cannot be fitted.
fn by_themselves(race: &Case, system: &System, followed: &[Followed], plans: Vec<&Plan>, monitor: &Monitor) -> Vec<f64> {
    let s = &race.search.settings.race;
    let mut own = system.clone();
    own.instances.iter_mut().flat_map(|i| &mut i.params).for_each(|p| p.free = false);
    for (i, k) in followed {
        let p = &mut own.instances[*i].params[*k];
        let v = p.value;
        let (min, max) = (p.min.max(v / s.state_reach), p.max.min(v * s.state_reach));
        *p = ParamValue { free: true, prior: Some((v, s.state_width * v)), min, max, ..p.clone() };
    }
    let case = Case { orders: vec![], ..race.coarsely(s.state_iterations) };
    let values = |system: &System| followed.iter().map(|(i, k)| system.instances[*i].params[*k].value).collect();
    case.fit_system(&own, plans, &monitor.quiet()).map_or_else(|_| values(system), |f| values(&f.system))
}

/// The tests, linear about what every state wants.
struct About {
    /// What is left of the residuals without what the own parameters can do.
    r: DVector<f64>,
    /// The residuals at the model's own values, by the linear model.
    whole: DVector<f64>,
    /// Basis of the own parameters' columns, and the way back to them.
    q: DMatrix<f64>,
    back: DMatrix<f64>,
    /// The free parameters of the model whose columns these are.
    kept: Vec<usize>,
    /// Columns of the logarithms of what laws may follow.
    logs: DMatrix<f64>,
    /// Index of the test of each row.
    of_row: Vec<usize>,
    /// The tests, under the variances that are left there.
    plans: Vec<Plan>,
    followed: Vec<Followed>,
}

/// Whitened residuals of the tests and their slopes in the first of so many rows.
fn stacked(plans: &[&Plan], computed: &[Computed], columns: usize, rows: usize) -> (DVector<f64>, DMatrix<f64>) {
    let (mut r, mut j, mut row) = (DVector::zeros(rows), DMatrix::zeros(rows, columns), 0);
    for (plan, computed) in plans.iter().zip(computed) {
        r.rows_mut(row, plan.len()).copy_from(&plan.whitened(&computed.values));
        let mut own = DMatrix::from_row_slice(plan.len(), columns, &computed.slopes);
        plan.whiten(own.rows_mut(0, plan.len()));
        j.rows_mut(row, plan.len()).copy_from(&own);
        row += plan.len();
    }
    (r, j)
}

impl About {
    fn new(
        (scale, race): (&Scale, &Case),
        base: &Weighed,
        followed: &[Followed],
        states: &[Vec<usize>],
        apart: &[Vec<f64>],
    ) -> Option<About> {
        let system = &base.fitted.system;
        let plans = race.plans_of(SplitName::Fit);
        let tests = plans.len();
        let mut whole = system.clone();
        followed.iter().for_each(|(i, k)| whole.instances[*i].params[*k].free = true);
        let free = whole.free();
        let of_state: Vec<usize> = (0..tests).map(|t| states.iter().position(|s| s.contains(&t)).unwrap_or(0)).collect();
        let at = |s: usize| {
            let mut there = whole.clone();
            followed.iter().zip(&apart[s]).for_each(|((i, k), v)| there.instances[*i].params[*k].value = *v);
            there
        };
        let there: Vec<System> = (0..states.len()).map(at).collect();
        let computed = parallel::over(tests, |t| plans[t].evaluate(&there[of_state[t]], &free, true).ok());
        let computed: Vec<Computed> = computed.into_iter().collect::<Option<_>>()?;
        if computed.iter().any(|c| c.values.iter().chain(&c.slopes).any(|v| !v.is_finite())) {
            return None;
        }
        let seen: Vec<_> = (0..tests).map(|t| scale.evidence.records[t].see(plans[t], &computed[t], &there[of_state[t]], &free)).collect();
        let v = scale.evidence.estimate_without_scatter(&seen, &scale.counts, &base.v);
        let under = scale.under(&seen, &v, &scale.evidence.independent());
        let plans = under.plans_of(SplitName::Fit);
        let priors = &base.fitted.options.priors;
        let points = plans.iter().map(|p| p.len()).sum::<usize>();
        let (mut r, mut j) = stacked(&plans, &computed, free.len(), points + priors.len());
        let of_row: Vec<usize> = plans.iter().enumerate().flat_map(|(t, p)| std::iter::repeat_n(t, p.len())).collect();
        // The columns of what laws may follow, for its logarithm, and the way from where the states want it back to where it stands.
        let mut logs = DMatrix::zeros(r.len(), followed.len());
        for (c, f) in followed.iter().enumerate() {
            let k = free.iter().position(|p| (p.instance, p.param) == *f)?;
            let now = system.instances[f.0].params[f.1].value;
            for i in 0..points {
                let wanted = apart[of_state[of_row[i]]][c];
                j[(i, k)] *= if free[k].log { 1.0 } else { wanted };
                logs[(i, c)] = j[(i, k)];
                r[i] -= logs[(i, c)] * (wanted / now).ln();
            }
        }
        let own = &base.fitted.free;
        let place = |k: usize| free.iter().position(|p| (p.instance, p.param) == (own[k].instance, own[k].param));
        for (n, prior) in priors.iter().enumerate() {
            let p = &own[prior.index];
            let value = p.variable(system.instances[p.instance].params[p.param].value);
            let follows = followed.contains(&(p.instance, p.param)) && !p.log;
            j[(points + n, place(prior.index)?)] = if follows { value } else { 1.0 } / prior.sigma;
            r[points + n] = (value - prior.mean) / prior.sigma;
        }
        let kept = base.fitted.inside();
        let columns: Vec<usize> = kept.iter().map(|k| place(*k)).collect::<Option<_>>()?;
        let (q, back) = decomposed(&j.select_columns(&columns), &scale.settings.scoring);
        let plans = plans.into_iter().cloned().collect();
        Some(About { whole: r.clone(), r: project(&q, r), q, back, kept, logs, of_row, plans, followed: followed.to_vec() })
    }

    /// The column of a law's strength.
    fn column(&self, law: &Instance) -> Option<DVector<f64>> {
        let (target, Effect::Coefficient(effect)) = (law.target.as_ref()?, law.effect) else { return None };
        let null: Vec<f64> = law.params.iter().map(|p| p.value).collect();
        let grows = |plan: &Plan| -> Option<f64> {
            let mut slope = vec![0.0; null.len()];
            let factor = effect.factor(plan.conditions.get(&target.condition)? - target.reference, &null, &mut slope);
            Some(slope[0] / factor)
        };
        let grows: Vec<f64> = self.plans.iter().map(grows).collect::<Option<_>>()?;
        let mut g = DVector::zeros(self.logs.nrows());
        for i in &target.instances {
            let c = self.followed.iter().position(|f| *f == (*i, target.param))?;
            self.of_row.iter().enumerate().for_each(|(row, t)| g[row] += self.logs[(row, c)] * grows[*t]);
        }
        Some(g)
    }

    fn wants(&self, at: usize, trial: &Trial, race: &Case, base: &Weighed) -> Option<Wanted> {
        let g = self.column(&trial.instance)?;
        let left = project(&self.q, g.clone());
        let (norm, size) = (left.norm(), self.r.norm());
        if !(norm > 0.0 && size > 0.0 && norm.is_finite()) {
            return None;
        }
        let z = -left.dot(&self.r) / norm;
        let strength = z / norm;
        let moved = -(&self.back * self.q.tr_mul(&(&self.whole + &g * strength)));
        let begun = race.search.settings.race.state_parts.iter().filter_map(|part| {
            let problem = Problem::new(vec![], base.fitted.system.clone());
            let mut p = problem.variables();
            for (k, by) in self.kept.iter().zip(moved.iter()) {
                let f = &problem.free[*k];
                let follows = self.followed.contains(&(f.instance, f.param)) && !f.log;
                p[*k] = if follows { p[*k] * (part * by).exp() } else { p[*k] + part * by };
            }
            let mut system = admissible(race, &base.fitted.system, &p).ok()?;
            system.instances.push(started(trial, part * strength, &race.search.settings));
            let cost = cost(&whitened(&race.plans_of(SplitName::Fit), &system).ok()?);
            cost.is_finite().then_some((cost, system))
        });
        let (_, begun) = begun.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Wanted { trial: at, drop: (z / size).powi(2), z, begun, strength })
    }
}
