//! Fits that have ended, kept so that a search that was stopped or killed need not make them again.
//!
//! A search is deterministic: begun anew it makes the same decisions and asks for the same fits, as long as these end where they ended before. With the
//! fits of the earlier run at hand it stands again where that one was cut off, after little more than one evaluation a fit.
//!
//! A fit is known by where it begins: the names of its parameters, its tolerances and constraints, its values, and the residuals and sensitivities there,
//! which stand for the tests and the covariance that it is made under. A kept fit is believed where its values give the cost that was kept with them.

use std::collections::HashMap;
use std::time::Duration;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use xxhash_rust::xxh3::xxh3_64;

use super::constraints::Source;
use super::ending::Termination;
use super::fit::{FitOptions, FitOutcome, Gait};
use super::problem::Loss;

/// Relative difference up to which numbers are the same: what was computed a moment ago may come back within a few last bits, and sums of it differ by more.
const SAME: f64 = 1e-9;
/// Cost, as a part of that at the start, below which two costs are both nothing.
const NOTHING: f64 = 1e-15;
/// Evaluations of a fit that is worth keeping: answered from the journal it takes two.
const WORTH: u64 = 3;

/// Numbers that come back to the last bit, infinite ones as well: the shortest decimals that tell a number from its neighbours.
#[derive(Debug, Clone, PartialEq)]
struct Exact(Vec<f64>);

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let words: Vec<String> = self.0.iter().map(|v| format!("{v:e}")).collect();
        to.serialize_str(&words.join(" "))
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        let numbers: Result<Vec<f64>, _> = text.split_ascii_whitespace().map(str::parse).collect();
        numbers.map(Exact).map_err(serde::de::Error::custom)
    }
}

/// A fit that has ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Kept {
    key: u64,
    begins: Exact,
    p: Exact,
    /// cost, lambda, growth, last drop, seconds
    ends: Exact,
    scale: Exact,
    termination: Termination,
    iterations: u64,
    evaluations: (u64, u64),
    active: Vec<Source>,
    multipliers: Exact,
    held: Vec<usize>,
}

/// Where a fit begins.
pub(super) struct Asked {
    key: u64,
    begins: Vec<f64>,
}

/// Hash of what a fit is asked that rounding does not change: XXH3 of bytes that are listed here one by one, so that the journal of a run is read by a program that
/// another release of Rust has compiled.
fn key(options: &FitOptions, residuals: usize, went_on: bool) -> u64 {
    let (t, c) = (&options.tolerances, &options.constraints);
    let mut bytes = Vec::new();
    let mut counts = |list: &[usize]| list.iter().for_each(|n| bytes.extend((*n as u64).to_le_bytes()));
    counts(&[options.names.len(), residuals, t.max_iterations as usize, t.acceleration.into(), went_on.into()]);
    options.priors.iter().for_each(|prior| counts(&[prior.index]));
    c.orders.iter().for_each(|order| counts(&[order.below, order.above]));
    c.rows.iter().for_each(|row| {
        counts(&[row.coefficients.len()]);
        row.coefficients.iter().for_each(|(j, _)| counts(&[*j]));
    });
    let mut numbers = vec![t.f_tol, t.x_tol, t.g_tol, t.drop, t.lambda];
    numbers.extend(c.orders.iter().map(|order| order.gap));
    c.rows.iter().for_each(|row| numbers.extend(row.coefficients.iter().map(|(_, a)| *a).chain([row.limit])));
    for block in &options.losses {
        let (kind, width) = match block.loss {
            Loss::Squares => (0, 0.0),
            Loss::Huber(k) => (1, k),
            Loss::SoftL1(k) => (2, k),
            Loss::Cauchy(k) => (3, k),
        };
        counts(&[block.rows.start, block.rows.end, kind]);
        numbers.push(width);
    }
    numbers.iter().for_each(|v| bytes.extend(v.to_bits().to_le_bytes()));
    // No name holds a zero byte.
    options.names.iter().for_each(|name| bytes.extend(name.bytes().chain([0])));
    xxh3_64(&bytes)
}

impl Asked {
    /// `went_on`: whether it takes up the damping of an earlier fit.
    pub fn new(p: &[f64], options: &FitOptions, (r, j): (&DVector<f64>, &DMatrix<f64>), cost: f64, went_on: bool) -> Asked {
        let c = &options.constraints;
        let mut begins = p.to_vec();
        begins.extend(c.lower.iter().chain(&c.upper));
        begins.extend(options.priors.iter().flat_map(|prior| [prior.mean, prior.sigma]));
        begins.push(cost);
        begins.extend(j.column_iter().map(|column| column.norm()));
        Asked { key: key(options, r.len(), went_on), begins }
    }

    /// How far a kept fit began from here, the largest relative difference; none where that is more than rounding.
    fn off(&self, kept: &Kept) -> Option<f64> {
        let off = |(a, b): (&f64, &f64)| if a == b { 0.0 } else { (a - b).abs() / a.abs().max(b.abs()) };
        if kept.begins.0.len() != self.begins.len() {
            return None;
        }
        // The maximum of f64 passes over what is no number.
        let worst = self.begins.iter().zip(&kept.begins.0).map(off).try_fold(0.0, |worst, off| (off <= SAME).then_some(off.max(worst)));
        worst.filter(|_| kept.key == self.key)
    }
}

impl Kept {
    /// The fit that began as `asked` and came to this.
    fn of(asked: Asked, outcome: &FitOutcome) -> Kept {
        let gait = &outcome.gait;
        Kept {
            key: asked.key,
            begins: Exact(asked.begins),
            p: Exact(outcome.p.clone()),
            ends: Exact(vec![outcome.cost, gait.lambda, gait.growth, gait.last_drop, outcome.wall_s]),
            scale: Exact(gait.scale.clone()),
            termination: outcome.termination.clone(),
            iterations: outcome.iterations,
            evaluations: outcome.evaluations,
            active: outcome.active.iter().map(|a| a.source).collect(),
            multipliers: Exact(outcome.active.iter().map(|a| a.multiplier).collect()),
            held: outcome.held.clone(),
        }
    }

    /// Where it ended.
    pub(super) fn p(&self) -> &[f64] {
        &self.p.0
    }

    /// Why it ended.
    pub(super) fn termination(&self) -> &Termination {
        &self.termination
    }

    /// Iterations and evaluations that it took.
    pub(super) fn took(&self) -> (u64, (u64, u64)) {
        (self.iterations, self.evaluations)
    }

    /// The constraints that it rests on, with their multipliers.
    pub(super) fn active(&self) -> impl Iterator<Item = (Source, f64)> {
        self.active.iter().copied().zip(self.multipliers.0.iter().copied())
    }

    /// Parameters that moved nothing.
    pub(super) fn held(&self) -> Vec<usize> {
        self.held.clone()
    }

    /// How the solver was moving, and the seconds it took; none where these numbers cannot be those of a fit under `options`.
    pub(super) fn gait(&self, options: &FitOptions) -> Option<(Gait, f64)> {
        let (n, c) = (options.names.len(), &options.constraints);
        let [_, lambda, growth, last_drop, wall_s] = self.ends.0[..] else { return None };
        let there = |source: &Source| match *source {
            Source::Lower(k) | Source::Upper(k) => k < n,
            Source::Order(k) => k < c.orders.len(),
            Source::Row(k) => k < c.rows.len(),
        };
        let whole = self.p.0.len() == n
            && self.scale.0.len() == n
            && self.active.len() == self.multipliers.0.len()
            && self.active.iter().all(there)
            && self.held.iter().all(|k| *k < n);
        let numbers = self.p.0.iter().chain(&self.scale.0).chain(&self.multipliers.0).all(|v| v.is_finite());
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let moves = positive(lambda) && positive(growth) && !last_drop.is_nan() && wall_s.is_finite() && wall_s >= 0.0;
        (whole && numbers && moves).then(|| (Gait { lambda, growth, scale: self.scale.0.clone(), last_drop }, wall_s))
    }

    /// Whether its values give the cost that was kept with them; `start` is the cost it began with.
    pub(super) fn costs(&self, cost: f64, start: f64) -> bool {
        self.ends.0.first().is_some_and(|kept| (kept - cost).abs() <= SAME * kept.abs().min(cost.abs()) + NOTHING * start)
    }
}

/// Where the fits of a search are kept: those of an earlier run answer the same questions again, those of this one are handed out as they end.
pub struct Journal {
    known: HashMap<u64, Vec<Kept>>,
    spent: Duration,
    keep: Box<dyn Fn(&Kept) + Send + Sync>,
}

impl std::fmt::Debug for Journal {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("Journal")
    }
}

impl Journal {
    /// Fits of an earlier run, the time that it had taken for them, and what takes those of this one.
    pub fn new(known: Vec<Kept>, spent: Duration, keep: impl Fn(&Kept) + Send + Sync + 'static) -> Journal {
        let mut by_key: HashMap<u64, Vec<Kept>> = HashMap::new();
        known.into_iter().for_each(|kept| by_key.entry(kept.key).or_default().push(kept));
        Journal { known: by_key, spent, keep: Box::new(keep) }
    }

    /// The time that the earlier run had taken.
    pub(super) fn spent(&self) -> Duration {
        self.spent
    }

    /// The kept fit that began nearest to this one, within rounding.
    pub(super) fn find(&self, asked: &Asked) -> Option<&Kept> {
        let near = self.known.get(&asked.key)?.iter().filter_map(|kept| Some((asked.off(kept)?, kept)));
        near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, kept)| kept)
    }

    /// Takes note of a fit that has ended by itself.
    pub(super) fn keep(&self, asked: Asked, outcome: &FitOutcome) {
        let (residuals, jacobians) = outcome.evaluations;
        if residuals + jacobians >= WORTH && outcome.termination != Termination::Interrupted {
            (self.keep)(&Kept::of(asked, outcome));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::super::problem::{LossBlock, Prior};
    use super::super::tests::{decay, options};
    use super::super::{Monitor, fit, go_on};
    use super::*;

    /// What is handed out of two fits, one gone on with.
    fn kept() -> (Vec<Kept>, [FitOutcome; 2]) {
        let all: Arc<Mutex<Vec<Kept>>> = Arc::default();
        let to = all.clone();
        let monitor = Monitor::default().journal(Journal::new(vec![], Duration::ZERO, move |k| to.lock().unwrap().push(k.clone())));
        let fits = both(&monitor);
        let list = all.lock().unwrap().clone();
        (list, fits)
    }

    fn both(monitor: &Monitor) -> [FitOutcome; 2] {
        let (problem, mut few) = (decay([1.0, 1.5, 0.3], 1.0), options(3));
        few.tolerances.max_iterations = 2;
        let begun = fit(&problem, &[3.0, 0.2, -1.0], &few, monitor).unwrap();
        [begun.clone(), go_on(&problem, begun, &options(3), monitor).unwrap()]
    }

    /// Everything but the time, to the last bit.
    fn bits(o: &FitOutcome) -> String {
        let at = (&o.p, &o.start, o.cost, o.start_cost, &o.residuals, &o.jacobian);
        format!("{at:?} {:?} {:?} {:?} {:?} {:?} {:?}", o.termination, o.iterations, o.evaluations, o.active, o.held, o.gait)
    }

    #[test]
    fn a_kept_fit_comes_back_to_the_last_bit_and_is_not_made_again() {
        let (list, first) = kept();
        assert_eq!(list.len(), 2);
        assert_eq!(first.each_ref().map(bits), both(&Monitor::default()).each_ref().map(bits), "a journal changes nothing");
        let text = serde_json::to_string(&list).unwrap();
        let list: Vec<Kept> = serde_json::from_str(&text).unwrap();
        let silent = |k: &Kept| panic!("it was fitted again: {k:?}");
        let again = both(&Monitor::default().journal(Journal::new(list, Duration::ZERO, silent)));
        assert_eq!(again.each_ref().map(bits), first.each_ref().map(bits));
    }

    /// The key is that of every release: a journal of today is read tomorrow. Every statement of a fit has its part in it.
    #[test]
    fn the_key_of_a_fit_is_the_same_in_every_release() {
        let plain = options(3);
        let others: [&dyn Fn(&mut FitOptions); 7] = [
            &|o| o.names[1] = "b".into(),
            &|o| o.tolerances.max_iterations += 1,
            &|o| o.tolerances.x_tol *= 2.0,
            &|o| o.constraints = o.constraints.clone().order(0, 1, 0.5),
            &|o| o.constraints = o.constraints.clone().row(vec![(0, 1.0), (2, -1.0)], 3.0),
            &|o| o.losses = vec![LossBlock { rows: 0..4, loss: Loss::Huber(1.5) }],
            &|o| o.priors = vec![Prior { index: 1, mean: 1.0, sigma: 2.0 }],
        ];
        let mut keys: Vec<u64> = others
            .iter()
            .map(|change| {
                let mut changed = plain.clone();
                change(&mut changed);
                key(&changed, 7, false)
            })
            .collect();
        keys.extend([key(&plain, 7, false), key(&plain, 8, false), key(&plain, 7, true)]);
        assert_eq!(keys[7], 37_813_187_357_207_728, "XXH3 of the bytes of a fit of three parameters to seven residuals");
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), 10);
    }

    #[test]
    fn what_is_not_the_end_of_this_fit_is_not_believed() {
        let (list, first) = kept();
        let answers = |change: &dyn Fn(&mut Kept)| {
            let mut list = list.clone();
            list.iter_mut().for_each(change);
            let made: Arc<Mutex<usize>> = Arc::default();
            let count = made.clone();
            let journal = Journal::new(list, Duration::ZERO, move |_| *count.lock().unwrap() += 1);
            let fits = both(&Monitor::default().journal(journal));
            assert_eq!(fits.each_ref().map(bits), first.each_ref().map(bits));
            *made.lock().unwrap()
        };
        assert_eq!(answers(&|_| {}), 0);
        assert_eq!(answers(&|k| k.begins.0[0] *= 1.0 + 1e-12), 0, "rounding");
        assert_eq!(answers(&|k| k.begins.0[0] *= 1.0 + 1e-7), 2);
        assert_eq!(answers(&|k| k.p.0[1] *= 1.0 + 1e-3), 2);
        assert_eq!(answers(&|k| k.p.0[2] = f64::NAN), 2);
        assert_eq!(answers(&|k| k.p.0[2] = 1e308), 2);
        assert_eq!(answers(&|k| k.ends.0[0] *= 1.001), 2);
        assert_eq!(answers(&|k| k.ends.0[1] = f64::INFINITY), 2);
        assert_eq!(answers(&|k| k.ends.0.truncate(2)), 2);
        assert_eq!(answers(&|k| k.held = vec![3]), 2);
        assert_eq!(answers(&|k| (k.active, k.multipliers) = (vec![Source::Row(0)], Exact(vec![1.0]))), 2);
    }

    #[test]
    fn a_fit_that_was_cut_off_is_not_kept() {
        let all: Arc<Mutex<Vec<Kept>>> = Arc::default();
        let to = all.clone();
        let keep = move |k: &Kept| to.lock().unwrap().push(k.clone());
        let flag: Arc<std::sync::atomic::AtomicBool> = Arc::default();
        let stop = flag.clone();
        let monitor = Monitor::default()
            .cancel(flag)
            .on_iteration(move |_| stop.store(true, std::sync::atomic::Ordering::Relaxed))
            .journal(Journal::new(vec![], Duration::ZERO, keep));
        let cut = fit(&decay([1.0, 1.5, 0.3], 1.0), &[3.0, 0.2, -1.0], &options(3), &monitor).unwrap();
        assert_eq!(cut.termination, Termination::Interrupted);
        assert!(all.lock().unwrap().is_empty());
    }
}
