//! How far the energies of a table are off, as factors, and how far they must be where one strength carries the whole loss.

use argmin::core::{CostFunction, Error, Executor};
use argmin::solver::goldensectionsearch::GoldenSectionSearch;

use crate::data::TestKind;
use crate::effect::Role;
use crate::model::{FreeParam, System};
use crate::parallel;
use crate::response::{Block, Computed, Plan};

use crate::diagnose::results::{Factor, OneStrength};
use crate::diagnose::settings::Telling;

/// The factors of every channel of an energy table, given its computed values; none for other tests.
pub fn factors(plan: &Plan, system: &System, computed: &Computed, s: &Telling) -> Vec<Factor> {
    if plan.kind != TestKind::Energy {
        return vec![];
    }
    let of = |block: &Block| {
        let logarithms = block.range.clone().map(|k| computed.values[k] - plan.measured[k]);
        let strength = if block.role == "dissipated" { one_strength(plan, system, block, s) } else { None };
        Factor { channel: block.label.clone(), largest: logarithms.fold(0.0, |m: f64, r| m.max(r.abs())).exp(), strength }
    };
    plan.blocks.iter().map(of).collect()
}

/// The one free strength without which nothing is dissipated, with the least largest factor that it can reach while all else stays.
fn one_strength(plan: &Plan, system: &System, block: &Block, s: &Telling) -> Option<OneStrength> {
    let free = system.free();
    let strengths = free.iter().filter(|f| f.param == 0 && system.instances[f.instance].effect.info().role == Role::Force);
    strengths.into_iter().find_map(|f| {
        let value = system.instances[f.instance].params[f.param].value;
        let (rows, values) = (block.range.clone(), |v: f64| plan.evaluate(&at(system, f, v), &[], false).ok().map(|c| c.values));
        let (strong, weak) = (values(value)?, values(s.weak * value)?);
        // With the strength nearly gone, so is every loss.
        if rows.clone().any(|k| weak[k] - strong[k] > s.falls.ln()) {
            return None;
        }
        let ratios: Vec<f64> = rows.map(|k| weak[k] - plan.measured[k]).collect();
        let (value, best) = Search { plan, system, strength: f, block, s }.best()?;
        Some(OneStrength { parameter: f.name.clone(), value, best: best.exp(), weak: half_range(&ratios).exp() })
    })
}

fn half_range(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    0.5 * (high - low)
}

/// The system with one strength at another value.
fn at(system: &System, f: &FreeParam, value: f64) -> System {
    let mut system = system.clone();
    system.instances[f.instance].params[f.param].value = value;
    system
}

/// Largest |ln(computed / measured)| of a block against the logarithm of a strength.
struct Search<'a> {
    plan: &'a Plan,
    system: &'a System,
    strength: &'a FreeParam,
    block: &'a Block,
    s: &'a Telling,
}

impl Search<'_> {
    /// Infinite where the model cannot be computed.
    fn largest(&self, logarithm: f64) -> f64 {
        let Ok(c) = self.plan.evaluate(&at(self.system, self.strength, logarithm.exp()), &[], false) else { return f64::INFINITY };
        self.block.range.clone().map(|k| (c.values[k] - self.plan.measured[k]).abs()).fold(0.0, f64::max)
    }

    /// The value that serves best, and what it leaves: a scan, then golden sections between the neighbours of its best point.
    fn best(&self) -> Option<(f64, f64)> {
        let p = &self.system.instances[self.strength.instance].params[self.strength.param];
        if p.value <= 0.0 {
            return None;
        }
        let low = (p.value / self.s.strength_reach).max(p.min).max(f64::MIN_POSITIVE).ln();
        let high = (p.value * self.s.strength_reach).min(p.max).ln();
        let step = (high - low) / (self.s.strengths - 1) as f64;
        let tried = parallel::over(self.s.strengths, |k| {
            let u = low + step * k as f64;
            (u, self.largest(u))
        });
        let scan = *tried.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let (from, to) = ((scan.0 - step).max(low), (scan.0 + step).min(high));
        let narrowed = || -> Result<(f64, f64), Error> {
            let solver = GoldenSectionSearch::new(from, to)?.with_tolerance(self.s.narrow)?;
            let run = Executor::new(self, solver).configure(|s| s.param(scan.0).max_iters(self.s.narrowing)).timer(false).run()?;
            Ok((run.state.best_param.unwrap_or(scan.0), run.state.best_cost))
        };
        let best = narrowed().ok().filter(|n| n.1 < scan.1).unwrap_or(scan);
        best.1.is_finite().then(|| (best.0.exp(), best.1))
    }
}

impl CostFunction for &Search<'_> {
    type Param = f64;
    type Output = f64;
    fn cost(&self, logarithm: &f64) -> Result<f64, Error> {
        Ok(self.largest(*logarithm))
    }
}
