//! The test that would separate tied candidates.
//!
//! Proposed: cycles at other frequencies, amplitudes and means, FRFs over another band or at another excitation, any test at another value of a
//! condition that a law or a load of the tied models depends on. Each is weighed by how far
//! the tied responses stay apart after the one that is wrong has adjusted its parameters as far as the measured tests let it: with `d` the
//! difference of the responses, `J` the columns of the wrong one on the new test and `R'R` its information from the measured ones, all
//! whitened, the least `||d + J s||^2 + ||R s||^2` over `s`. The best proposals are then simulated: noise is added, both are refitted to
//! all tests, and the tie must break, whichever of the two is true.
//!
//! What the models say without adjusting themselves bounds the separation from above and costs least, so it sets the order; only until
//! enough proposals separate well are they weighed in full. The whole takes no more than a share of what the search for the effects took;
//! what was cut short says so.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use crate::parallel;
use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::data::{Rig, TestKind};
use crate::identify::{Monitor, Termination};
use crate::model::System;
use crate::response::{BlockKind, CycleDrive, Plan, Variation};
use crate::units::Dimension;

use super::apart::differing;
use super::candidates::Name;
use super::levels;
use crate::diagnose::Case;
use crate::diagnose::calibrate::case::Fitted;
use crate::diagnose::results::{NextTest, SplitName};
use crate::diagnose::settings::Proposals;
use crate::diagnose::settings::Scoring;
use crate::diagnose::settings::Settings;

/// A proposal: the plan, what it is, and how far the tied are apart there, unadjusted and adjusted.
struct Proposal<'a> {
    base: &'a Plan,
    by: Variation,
    bound: f64,
    separation: f64,
}

impl<'a> Proposal<'a> {
    fn new(base: &'a Plan, by: Variation) -> Self {
        Proposal { base, by, bound: 0.0, separation: 0.0 }
    }

    /// How far it lies from what was tested.
    fn distance(&self) -> f64 {
        // Other shims cost as much as a drive that is e times faster.
        let set = f64::from(u8::from(self.by.condition.is_some()));
        self.by.frequency.ln().abs() + self.by.amplitude.ln().abs() + self.by.mean.abs() + set
    }
}

/// Of those that separate well enough, the one nearest to a test that was run comes first.
fn order(proposals: &mut [Proposal], s: &Proposals, size: impl Fn(&Proposal) -> f64) {
    let key = |p: &Proposal| size(p).min(s.enough);
    proposals.sort_by(|a, b| key(b).total_cmp(&key(a)).then(a.distance().total_cmp(&b.distance())));
}

/// The time there is.
struct Clock {
    started: Instant,
    budget: Duration,
}

impl Clock {
    fn over(&self, part: f64) -> bool {
        self.started.elapsed() >= self.budget.mul_f64(part)
    }

    /// The monitor that stops when the time is over, or before as it is told.
    fn limit(&self, monitor: &Monitor) -> Monitor<'static> {
        let end = self.started.checked_add(self.budget);
        let deadline = [monitor.deadline, end].into_iter().flatten().min();
        Monitor { deadline, ..monitor.quiet() }
    }
}

/// The tied models.
struct Tied<'a> {
    case: &'a Case,
    best: &'a Fitted,
    rivals: &'a [(Name, Fitted)],
}

/// The test that separates `best` from every rival, proposed only where the tie broke in its simulation or there was no time to simulate it;
/// or why there is none. `spent`: the time that was taken to find them.
pub fn separating(case: &Case, best: &System, rivals: &[(&Name, &System)], spent: Duration, monitor: &Monitor) -> Result<NextTest, String> {
    let s = &case.search.settings.next;
    let clock = Clock { started: Instant::now(), budget: spent.mul_f64(s.share).max(Duration::from_secs_f64(s.least)) };
    let monitor = clock.limit(monitor);
    let fitted = |system: &System| case.fit_system(system, case.plans_of(SplitName::Fit), &monitor.quiet()).ok();
    let rivals: Vec<(Name, Fitted)> = rivals.iter().filter_map(|(n, system)| Some(((*n).clone(), fitted(system)?))).collect();
    let Some(best) = &fitted(best).filter(|_| !rivals.is_empty()) else {
        return Err("what is tied with it could not be fitted once more".into());
    };
    let tied = Tied { case, best, rivals: &rivals };
    let plans = [SplitName::Fit, SplitName::Select].map(|s| case.plans_of(s)).concat();
    let mut left: Vec<Proposal> = variations(&plans, s);
    let systems: Vec<&System> = rivals.iter().map(|r| &r.1.system).chain([&best.system]).collect();
    left.extend(levels::variations(&plans, &systems, s).into_iter().map(|(plan, by)| Proposal::new(plan, by)));
    let mut weighed: Vec<Proposal> = Vec::new();
    let mut cut = tied.weigh(&mut left, &mut weighed, &clock);
    if !enough(&weighed, s) && !cut {
        // Means are tried about the best cycles alone.
        order(&mut weighed, s, |p| p.separation);
        let cycles = weighed.iter().filter(|p| p.base.cycle_drive().is_some() && p.separation > 0.0).take(2);
        let mut means = cycles.flat_map(|p| s.means.map(|mean| Proposal::new(p.base, Variation { mean, ..p.by }))).collect();
        cut = tied.weigh(&mut means, &mut weighed, &clock);
    }
    weighed.retain(|p| p.separation > 0.0);
    order(&mut weighed, s, |p| p.separation);
    let mut found: Option<NextTest> = None;
    for proposal in weighed.iter().take(s.simulated) {
        if monitor.stops() {
            cut = true;
            break;
        }
        let Some(apart) = tied.simulated(proposal, &monitor) else { continue };
        if found.as_ref().is_none_or(|f| apart > f.separation) {
            found = Some(told(proposal, &case.search.settings, apart, "simulated with its noise and refitted"));
        }
        if found.as_ref().is_some_and(|f| f.breaks) {
            break;
        }
    }
    cut |= monitor.stops() && found.as_ref().is_none_or(|f| !f.breaks);
    // What the simulation does not tell apart at all is no proposal; what there was no time to simulate is an estimate.
    let mut found = match found {
        Some(found) => Some(found).filter(|f| f.separation > 0.0),
        None if cut => weighed
            .first()
            .map(|p| NextTest { breaks: false, ..told(p, &case.search.settings, p.separation, "by their slopes, not simulated") }),
        None => None,
    };
    if let Some(found) = found.as_mut().filter(|_| cut) {
        found.cut_short = true;
        found.describe += &format!(" (the search for this test was cut short after {:.0} s)", clock.started.elapsed().as_secs_f64());
    }
    let names: Vec<String> = rivals.iter().map(|(n, _)| n.to_string()).collect();
    let none = || {
        let bench = if case.search.rig == Rig::default() { "" } else { ", within the limits of the bench ([rig])," };
        format!(
            "no test from a third of the least to {:.0} times the most that was tested, nor one at other conditions,{bench} separates it from {}",
            s.reach,
            names.join(", ")
        )
    };
    let otherwise = rivals
        .first()
        .filter(|_| !monitor.stops())
        .and_then(|(name, rival)| differing(case, best, (&name.to_string(), rival), &case.search.settings));
    let otherwise = otherwise.map_or(String::new(), |said| format!("; {said}"));
    match found {
        Some(found) if found.breaks || found.cut_short => Ok(NextTest { describe: found.describe + &otherwise, ..found }),
        Some(found) => Err(format!("{}; the best found: {}{otherwise}", none(), found.describe)),
        None => Err(none() + &otherwise),
    }
}

/// Whether as many separate well as are simulated.
fn enough(weighed: &[Proposal], s: &Proposals) -> bool {
    weighed.iter().filter(|p| p.separation >= s.enough).count() >= s.simulated
}

/// Every drive that is tried. Tests of one drive and one set of channels are varied from the one of the largest amplitude.
fn variations<'a>(plans: &[&'a Plan], s: &Proposals) -> Vec<Proposal<'a>> {
    let mut list = Vec::new();
    let new = Proposal::new;
    let channels = |p: &Plan| p.blocks.iter().map(|b| b.label.clone()).collect::<Vec<_>>();
    let cycles: Vec<(&Plan, CycleDrive)> = plans.iter().filter_map(|p| Some((*p, p.cycle_drive()?))).collect();
    let mut seen: Vec<Vec<String>> = Vec::new();
    for (first, _) in &cycles {
        let key = channels(first);
        if seen.contains(&key) {
            continue;
        }
        let alike: Vec<&(&Plan, CycleDrive)> = cycles.iter().filter(|(p, _)| channels(p) == key).collect();
        seen.push(key);
        let Some((base, own)) = alike.iter().max_by(|a, b| a.1.amplitude.total_cmp(&b.1.amplitude)) else { continue };
        let spread = |of: &dyn Fn(&CycleDrive) -> f64, n: usize| -> Vec<f64> {
            let (low, high) = alike.iter().map(|(_, d)| of(d)).fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
            let (low, high) = (low / s.reach, high * s.reach);
            (0..n).map(|k| low * (high / low).powf(k as f64 / (n - 1) as f64)).collect()
        };
        for f in spread(&|d| d.frequency, s.frequencies) {
            for a in spread(&|d| d.amplitude, s.amplitudes) {
                let by = Variation { frequency: f / own.frequency, amplitude: a / own.amplitude, ..Variation::default() };
                list.push(new(base, by));
            }
        }
    }
    let force = cycles.iter().filter(|(p, _)| p.blocks.iter().any(|b| b.role == "displacement")).map(|(_, d)| d.amplitude);
    let force = force.fold(0.0, f64::max);
    let mut seen: Vec<Vec<String>> = Vec::new();
    for plan in plans.iter().filter(|p| p.cycle_drive().is_none()) {
        if seen.contains(&channels(plan)) {
            continue;
        }
        seen.push(channels(plan));
        list.extend(s.bands.map(|frequency| new(plan, Variation { frequency, ..Variation::default() })));
        let forces = plan.excitation().map_or(s.of_force.map(|p| p * force).to_vec(), |own| s.excitations.map(|p| p * own).to_vec());
        let excited = forces.into_iter().filter(|f| *f > 0.0).map(|f| Variation { excitation: Some(f), ..Variation::default() });
        list.extend(excited.map(|by| new(plan, by)));
    }
    list
}

/// Whether the test bench can run this test: its drive, and what the model says that it would read.
pub(crate) fn within(rig: &Rig, plan: &Plan, values: &[f64]) -> bool {
    let read = |role: &str| {
        let own = plan.blocks.iter().filter(|b| b.role == role && b.kind == BlockKind::Loop);
        own.flat_map(|b| &values[b.range.clone()]).fold(0.0f64, |m, v| m.max(v.abs()))
    };
    let read_well = read("force") <= rig.force_max && read("displacement") <= rig.displacement_max;
    let (least, most) = rig.frequency;
    let driven = plan.cycle_drive().is_none_or(|d| {
        let (w, reach) = (std::f64::consts::TAU * d.frequency, d.mean.abs() + d.amplitude);
        let moved = match d.unit.dimension {
            Dimension::LENGTH => {
                reach <= rig.displacement_max && w * d.amplitude <= rig.velocity_max && w * w * d.amplitude <= rig.acceleration_max
            }
            Dimension::FORCE => reach <= rig.force_max,
            _ => true,
        };
        moved && least <= d.frequency && d.frequency <= most
    });
    let mut lines = plan.blocks.iter().filter(|b| b.kind == BlockKind::Frf).flat_map(|b| &b.abscissa);
    let excited = plan.excitation().is_none_or(|f| f <= rig.force_max);
    read_well && driven && excited && lines.all(|f| least <= *f && *f <= most)
}

/// What a model says of a new test.
struct Seen {
    values: DVector<f64>,
    columns: DMatrix<f64>,
}

impl Tied<'_> {
    /// The plan of a proposal with the response of the best model; none where it cannot be computed.
    fn planned(&self, p: &Proposal) -> Option<(Plan, Vec<f64>)> {
        let mut plan = p.base.varied(&p.by)?;
        let values = plan.evaluate(&self.best.system, &[], false).ok()?.values;
        plan.with_noise_of(p.base, &values);
        plan.measured.clone_from(&values);
        plan = plan.with_instruments(&values);
        (values.iter().all(|v| v.is_finite()) && within(&self.case.search.rig, &plan, &values)).then_some((plan, values))
    }

    /// Moves proposals to those weighed, the nearest of the most promising first, until enough of them separate well; whether the time was
    /// over before.
    fn weigh<'b>(&self, left: &mut Vec<Proposal<'b>>, weighed: &mut Vec<Proposal<'b>>, clock: &Clock) -> bool {
        let s = &self.case.search.settings.next;
        parallel::for_each(left, |p| {
            if !clock.over(s.weighing) {
                p.bound = self.unadjusted(p).unwrap_or(0.0);
            }
        });
        let cut = clock.over(s.weighing);
        left.retain(|p| p.bound > 0.0);
        order(left, s, |p| p.bound);
        while !left.is_empty() && !enough(weighed, s) {
            // At least one batch, so that there is something to tell.
            if clock.over(if weighed.is_empty() { 1.0 } else { s.weighing }) {
                return true;
            }
            let mut batch: Vec<Proposal> = left.drain(..s.batch.min(left.len())).collect();
            parallel::for_each(&mut batch, |p| p.separation = self.separation(p).unwrap_or(-1.0));
            weighed.extend(batch);
        }
        cut
    }

    /// The least distance of a rival's response from the best one's, as they stand: what [`Tied::separation`] cannot exceed.
    fn unadjusted(&self, p: &Proposal) -> Option<f64> {
        let (plan, values) = self.planned(p)?;
        let own = plan.whitened(&values);
        let apart = |rival: &Fitted| Some((plan.whitened(&plan.evaluate(&rival.system, &[], false).ok()?.values) - &own).norm());
        let least = self.rivals.iter().map(|(_, rival)| apart(rival)).try_fold(f64::INFINITY, |least, d| Some(least.min(d?)))?;
        least.is_finite().then_some(least)
    }

    /// The least separation from a rival, whichever is true, after the other has adjusted itself.
    fn separation(&self, p: &Proposal) -> Option<f64> {
        let (plan, _) = self.planned(p)?;
        let see = |fitted: &Fitted| -> Option<Seen> {
            let c = plan.evaluate(&fitted.system, &fitted.free, true).ok()?;
            let n = fitted.free.len();
            let mut columns = DMatrix::from_fn(plan.len(), n, |i, k| c.slopes[i * n + k]);
            plan.whiten(columns.as_view_mut());
            Some(Seen { values: plan.whitened(&c.values), columns })
        };
        let best = see(self.best)?;
        let mut least = f64::INFINITY;
        for (_, rival) in self.rivals {
            let other = see(rival)?;
            let apart = &other.values - &best.values;
            let adjusted =
                |seen: &Seen, fitted: &Fitted| left(&apart, &seen.columns, &fitted.outcome.jacobian, &self.case.search.settings.scoring);
            least = least.min(adjusted(&best, self.best)?).min(adjusted(&other, rival)?);
        }
        least.is_finite().then_some(least)
    }

    /// Simulates the test with either of each pair as the truth, refits both to all tests, and says by how many sigma the true one then
    /// fits better, at least.
    fn simulated(&self, p: &Proposal, monitor: &Monitor) -> Option<f64> {
        let (plan, values) = self.planned(p)?;
        let others: Vec<Vec<f64>> =
            self.rivals.iter().map(|(_, r)| Some(plan.evaluate(&r.system, &[], false).ok()?.values)).collect::<Option<_>>()?;
        let pairs: Vec<(usize, bool)> = (0..self.rivals.len()).flat_map(|k| [(k, true), (k, false)]).collect();
        let gained = |&(k, best_is_true): &(usize, bool)| -> Option<f64> {
            let rival = &self.rivals[k].1;
            let (truth, own, wrong) = if best_is_true { (&values, self.best, rival) } else { (&others[k], rival, self.best) };
            let simulated = plan.clone().measuring(truth, noise(self.case.seed, k, plan.len()).into_iter());
            let cost = |fitted: &Fitted| -> Option<f64> {
                let mut plans = self.case.plans_of(SplitName::Fit);
                plans.push(&simulated);
                let max_iterations = self.case.max_iterations.min(self.case.search.settings.next.iterations);
                let single = Case { starts: 1, f_tol: Some(self.case.search.settings.fitting.coarse), max_iterations, ..self.case.clone() };
                let outcome = single.fit_system(&fitted.system, plans, &monitor.quiet()).ok()?.outcome;
                // A refit that was stopped says nothing.
                (outcome.termination != Termination::Interrupted).then_some(outcome.cost)
            };
            let costs = parallel::map(&[wrong, own], |fitted| cost(fitted));
            // Before the new test the two may differ by a little already; what it adds is what separates.
            let gained = costs[0]? - costs[1]? + (own.outcome.cost - wrong.outcome.cost);
            Some(gained.signum() * (2.0 * gained.abs()).sqrt())
        };
        let each: Vec<f64> = parallel::map(&pairs, gained).into_iter().collect::<Option<_>>()?;
        let least = each.into_iter().fold(f64::INFINITY, f64::min);
        least.is_finite().then_some(least)
    }
}

/// sqrt of the least `||d + J s||^2 + ||Jo s||^2`.
fn left(d: &DVector<f64>, new: &DMatrix<f64>, measured: &DMatrix<f64>, scoring: &Scoring) -> Option<f64> {
    let n = new.ncols();
    if n == 0 || measured.ncols() != n {
        return Some(d.norm());
    }
    let r = measured.clone().qr().r();
    let mut stacked = DMatrix::zeros(new.nrows() + r.nrows(), n);
    stacked.rows_mut(0, new.nrows()).copy_from(new);
    stacked.rows_mut(new.nrows(), r.nrows()).copy_from(&r);
    for mut c in stacked.column_iter_mut() {
        let size = c.norm();
        if size > 0.0 {
            c /= size;
        }
    }
    let d = d.clone().resize_vertically(stacked.nrows(), 0.0);
    let q = super::score::basis(&stacked, scoring);
    let rest = &d - &q * q.tr_mul(&d);
    rest.iter().all(|v| v.is_finite()).then(|| rest.norm())
}

fn noise(seed: u64, stream: usize, n: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream as u64);
    let Ok(normal) = Normal::new(0.0, 1.0) else { return vec![0.0; n] };
    (0..n).map(|_| normal.inverse_cdf(rng.random_range(f64::EPSILON..1.0 - f64::EPSILON))).collect()
}

fn told(p: &Proposal, s: &Settings, separation: f64, how: &str) -> NextTest {
    let breaks = separation > 0.0 && 0.5 * separation * separation > s.decisive;
    let apart = if breaks { format!("{separation:.1} sigma apart") } else { format!("only {separation:.1} sigma apart") };
    let verdict = format!("{how}, they stand {apart}");
    let cut_short = false;
    let set = p.by.condition.and_then(|(at, level)| levels::printed(p.base, at, level));
    let at_level = set.as_ref().map_or(String::new(), |(name, printed, _)| format!(" with {name} = {printed}"));
    let conditions: BTreeMap<String, f64> = set.into_iter().map(|(name, _, level)| (name, level)).collect();
    if let Some(own) = p.base.cycle_drive() {
        let (frequency, amplitude) = (own.frequency * p.by.frequency, own.amplitude * p.by.amplitude);
        let mean = own.mean + p.by.mean * amplitude;
        let about = if p.by.mean == 0.0 { String::new() } else { format!(" about a mean of {}", own.unit.print_difference(mean)) };
        let describe = format!(
            "the drive of test {} at {frequency:.4} Hz with an amplitude of {}{about}{at_level}: {verdict}",
            p.base.id,
            own.unit.print_difference(amplitude)
        );
        let unit = own.unit.dimension.si_unit();
        return NextTest {
            describe,
            test: p.base.id.clone(),
            kind: "cycle".into(),
            frequency,
            amplitude,
            mean,
            unit,
            conditions,
            separation,
            breaks,
            cut_short,
        };
    }
    // Of a modal table the abscissa counts modes.
    let modal = p.base.kind == TestKind::Modal;
    let lines = p.base.blocks.first().filter(|_| !modal).map_or(&[][..], |b| &b.abscissa);
    let (low, high) = lines.iter().fold((f64::INFINITY, 0.0f64), |(l, h), f| (l.min(*f), h.max(*f)));
    let (low, high) = (low * p.by.frequency, high * p.by.frequency);
    let force = p.by.excitation.or(p.base.excitation());
    let with = force.map_or(String::new(), |f| format!(" under an excitation of {f:.3e} N (N m about an axis) at its peak"));
    let what = if modal {
        format!("the modes of test {}{at_level}", p.base.id)
    } else {
        format!("the frequency response of test {} from {low:.4} to {high:.4} Hz{with}{at_level}", p.base.id)
    };
    NextTest {
        describe: format!("{what}: {verdict}"),
        test: p.base.id.clone(),
        kind: p.base.kind.word().into(),
        frequency: high,
        amplitude: force.unwrap_or(0.0),
        mean: 0.0,
        unit: "N".into(),
        conditions,
        separation,
        breaks,
        cut_short,
    }
}
