//! Secants: what a candidate does at a finite strength, the model's own parameters giving way.
//!
//! A score is a slope at strength zero. At the strength `s` that it expects, a law that is not smooth does something else, and a model whose
//! own parameters `p` stood still would be far off: a slider adds its stiffness to every FRF, which the spring beside it must give up. So
//! each of a candidate's best shapes is computed at parts of its strength from `p - s J^+ g`, where `J^+ g` is what the own parameters do
//! of a unit of it (`Scores::own`); what costs least of them is where its refit begins.

use crate::model::System;
use crate::parallel;
use crate::residual::Problem;

use super::refit::{Bench, cost, started, whitened};
use super::results::SplitName;
use super::score::Score;

/// Parts of the strength that the score expects.
const PARTS: [f64; 3] = [1.0, 0.3, 0.1];
/// Shapes of a candidate that are looked at: its best, as far as they promise at least this part of the best of them.
const SHAPES: usize = 3;
const PROMISING: f64 = 0.3;

/// The model with a candidate at a finite strength.
pub struct Secant {
    /// The system, everything of the candidate free.
    pub system: System,
    /// Half its sum of squares.
    pub cost: f64,
}

impl Bench<'_> {
    /// The secants of each picked candidate, the cheapest shape first; why there is none where the model cannot be computed at any.
    pub fn secants(&self, picked: &[Score]) -> Vec<Result<Vec<Secant>, String>> {
        let shapes: Vec<(usize, Score)> =
            picked.iter().enumerate().flat_map(|(k, best)| self.shapes(best).into_iter().map(move |s| (k, s))).collect();
        let computed = self.at_parts(&shapes.iter().map(|(_, s)| vec![*s]).collect::<Vec<_>>());
        let mut found: Vec<Result<Vec<Secant>, String>> = picked.iter().map(|_| Err("it was not begun".to_string())).collect();
        for ((k, _), secant) in shapes.iter().zip(computed) {
            match (&mut found[*k], secant) {
                (Ok(list), Ok(secant)) => list.push(secant),
                (slot, Ok(secant)) => *slot = Ok(vec![secant]),
                (Err(why), Err(reason)) => *why = reason,
                (Ok(_), Err(_)) => {}
            }
        }
        found.iter_mut().flatten().for_each(|list| list.sort_by(|a, b| a.cost.total_cmp(&b.cost)));
        found
    }

    /// The secant of candidates that act at once.
    pub fn together(&self, added: &[Score]) -> Result<Secant, String> {
        self.at_parts(&[added.to_vec()]).remove(0)
    }

    /// The scores of a candidate's best shapes.
    fn shapes(&self, best: &Score) -> Vec<Score> {
        let of = |s: &Score| self.trials[s.trial].candidate;
        let own = self.scores.list.iter().filter(|s| of(s) == of(best));
        own.filter(|s| s.drop > PROMISING * best.drop).take(SHAPES).copied().collect()
    }

    /// The cheapest over the parts of the strength.
    fn at_parts(&self, added: &[Vec<Score>]) -> Vec<Result<Secant, String>> {
        let all: Vec<(&[Score], f64)> = added.iter().flat_map(|a| PARTS.iter().map(move |part| (a.as_slice(), *part))).collect();
        let plans = self.case.plans_of(SplitName::Fit);
        let mut computed = parallel::map(&all, |(added, part)| -> Result<Secant, String> {
            let system = self.giving_way(added, *part)?;
            Ok(Secant { cost: cost(&whitened(&plans, &system)?), system })
        })
        .into_iter();
        let cheapest = |a: Result<Secant, String>, b: Result<Secant, String>| match (&a, &b) {
            (Ok(x), Ok(y)) if y.cost >= x.cost => a,
            (Ok(_), Err(_)) => a,
            _ => b,
        };
        added
            .iter()
            .map(|_| computed.by_ref().take(PARTS.len()).reduce(cheapest).unwrap_or_else(|| Err("it was not begun".into())))
            .collect()
    }

    /// The system with the candidates at this part of their strengths.
    pub(crate) fn giving_way(&self, added: &[Score], part: f64) -> Result<System, String> {
        let problem = Problem::new(vec![], self.base.clone());
        let here = problem.variables();
        let moved = |k: usize, v: f64| v + added.iter().map(|s| part * s.strength * self.scores.own[s.trial][k]).sum::<f64>();
        let p: Vec<f64> = here.iter().enumerate().map(|(k, v)| moved(k, *v)).collect();
        // Distances in units of the values themselves.
        let scale: Vec<f64> = p.iter().zip(&here).map(|(a, b)| a.abs().max(b.abs())).collect();
        let options = self.case.options(self.base, 0).map_err(|e| e.to_string())?;
        let p = options.constraints.project(&p, &scale).map_err(|e| e.to_string())?;
        let mut system = problem.system_at(&p);
        system.instances.extend(added.iter().map(|s| started(&self.trials[s.trial], part * s.strength)));
        Ok(system)
    }
}
