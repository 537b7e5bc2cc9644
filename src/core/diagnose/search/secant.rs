//! Secants: what a candidate does at a finite strength.
//!
//! A score is a slope at strength zero. At the strength `s` that it expects, a law that is not smooth does something else, and a model whose
//! own parameters `p` stand still may be far off: a slider adds its stiffness to every FRF, which the spring beside it must give up. So
//! a candidate's best shape is computed at parts of its strength from `p - s J^+ g`, where `-J^+ g` is what the own parameters do of a unit
//! of it (`Scores::own`), its other good shapes at the part that costs least there, and each once from `p` as it stands. What costs least of the first is where its refits begin, and of the
//! second too where it costs no more than the model without the candidate: far from the linear model it is the better guide.

use crate::model::System;
use crate::parallel;
use crate::residual::Problem;

use super::refit::{Bench, cost, started, whitened};
use super::score::Score;
use crate::diagnose::DiagnoseError;
use crate::diagnose::calibrate::case::Case;
use crate::diagnose::results::SplitName;

/// The model with a candidate at a finite strength.
pub struct Secant {
    /// The system, everything of the candidate free.
    pub system: System,
    /// The part of the strength that the score expects at which it stands.
    part: f64,
    /// Half its sum of squares.
    pub cost: f64,
}

impl Bench<'_> {
    /// Where the refits of a candidate begin: its cheapest secants, the own parameters giving way, and the cheapest with them standing still
    /// that costs less than `unexplained`; why there is none where the model cannot be computed at any.
    pub fn secants(&self, best: &Score, unexplained: f64) -> Result<Vec<Secant>, String> {
        let candidate = |trial: usize| self.trials[trial].candidate;
        if let Some((_, system)) = self.stands.filter(|(name, _)| self.names[candidate(best.trial)] == **name) {
            return Ok(vec![self.computed(system.clone(), 1.0)?]);
        }
        let asked = self.wanted.iter().filter(|w| candidate(w.trial) == candidate(best.trial));
        let asked = asked.filter_map(|w| self.computed(w.begun.clone(), 1.0).ok());
        let shapes = self.shapes(best);
        let Some((first, others)) = shapes.split_first() else {
            let asked: Vec<Secant> = asked.collect();
            return if asked.is_empty() { Err("it was not begun".into()) } else { Ok(asked) };
        };
        let begun = self.together(&[*first]);
        // The part that serves the best shape serves the others.
        let part = begun.as_ref().map_or(1.0, |s| s.part);
        let mut giving = parallel::map(others, |s| self.secant(&[*s], part, true));
        giving.insert(0, begun);
        let failed = giving.iter().find_map(|s| s.as_ref().err().cloned());
        let mut found: Vec<Secant> = giving.into_iter().flatten().collect();
        found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        found.truncate(self.race().giving);
        let still = parallel::map(&shapes, |s| self.secant(&[*s], 1.0, false));
        let still = still.into_iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost));
        found.extend(still.filter(|s| s.cost < unexplained));
        found.extend(asked);
        for base in self.elsewhere {
            let there = Bench { base, ..*self };
            let there = parallel::map(&shapes, |s| there.secant(&[*s], part, false));
            found.extend(there.into_iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost)));
        }
        // The model itself can be computed where nothing beside it can.
        let none = found.is_empty().then(|| self.secant(&[*first], 0.0, false));
        found.extend(none.and_then(Result::ok));
        if found.is_empty() { Err(failed.unwrap_or_else(|| "it was not begun".into())) } else { Ok(found) }
    }

    /// The cheapest secant, over the parts of their strengths, of candidates that act at once, the own parameters giving way.
    pub fn together(&self, added: &[Score]) -> Result<Secant, String> {
        let cheapest = |a: Result<Secant, String>, b: Result<Secant, String>| match (&a, &b) {
            (Ok(x), Ok(y)) if y.cost >= x.cost => a,
            (Ok(_), Err(_)) => a,
            _ => b,
        };
        let parts = parallel::map(&self.race().parts, |part| self.secant(added, *part, true));
        parts.into_iter().reduce(cheapest).unwrap_or_else(|| Err("it was not begun".into()))
    }

    /// The scores of a candidate's best shapes.
    fn shapes(&self, best: &Score) -> Vec<Score> {
        let of = |s: &Score| self.trials[s.trial].candidate;
        let own = self.scores.list.iter().filter(|s| of(s) == of(best));
        own.filter(|s| s.drop > self.race().promising * best.drop).take(self.race().shapes).copied().collect()
    }

    /// The system with the candidates at this part of their strengths, the own parameters giving way or standing still.
    pub(crate) fn secant(&self, added: &[Score], part: f64, gives: bool) -> Result<Secant, String> {
        let mut problem = Problem::new(vec![], self.base.clone());
        if gives {
            let here = problem.variables();
            let moved = |k: usize, v: f64| v + added.iter().map(|s| part * s.strength * self.scores.own[s.trial][k]).sum::<f64>();
            let p: Vec<f64> = here.iter().enumerate().map(|(k, v)| moved(k, *v)).collect();
            problem.system = admissible(self.case, self.base, &p).map_err(|e| e.to_string())?;
        }
        let mut system = problem.system;
        system.instances.extend(added.iter().map(|s| started(&self.trials[s.trial], part * s.strength, &self.case.search.settings)));
        self.computed(system, part)
    }

    fn computed(&self, system: System, part: f64) -> Result<Secant, String> {
        Ok(Secant { cost: cost(&whitened(&self.case.plans_of(SplitName::Fit), &system)?), part, system })
    }
}

/// The system at these variables, or at the nearest that are admissible.
pub(in crate::diagnose) fn admissible(case: &Case, system: &System, p: &[f64]) -> Result<System, DiagnoseError> {
    let problem = Problem::new(vec![], system.clone());
    // Distances in units of the values themselves.
    let scale: Vec<f64> = p.iter().zip(&problem.variables()).map(|(a, b)| a.abs().max(b.abs())).collect();
    let p = case.options(system, 0)?.constraints.project(p, &scale)?;
    Ok(problem.system_at(&p))
}
