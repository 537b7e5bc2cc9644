//! The test that would separate tied candidates.
//!
//! Proposed: cycles at other frequencies, amplitudes and means, FRFs over another band or at another excitation. Each is weighed by how far
//! the tied responses stay apart after the one that is wrong has adjusted its parameters as far as the measured tests let it: with `d` the
//! difference of the responses, `J` the columns of the wrong one on the new test and `R'R` its information from the measured ones, all
//! whitened, the least `||d + J s||^2 + ||R s||^2` over `s`. The best proposals are then simulated: noise is added, both are refitted to
//! all tests, and the tie must break, whichever of the two is true.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::identify::Monitor;
use crate::response::{Correlated, CycleDrive, Plan, Variation};

use super::Case;
use super::accept::DECISIVE;
use super::candidates::Name;
use super::case::Fitted;
use super::results::{NextTest, SplitName};

/// Frequencies, amplitudes (half ranges) and means that are tried, from a third of the least to three times the largest tested; means in
/// parts of the half range.
const FREQUENCIES: usize = 4;
const AMPLITUDES: usize = 4;
const REACH: f64 = 3.0;
const MEANS: [f64; 2] = [-0.6, 0.6];
/// Factors on the lines of an FRF, on its excitation, and parts of the largest force of a cycle where it has none.
const BANDS: [f64; 4] = [0.1, 0.3, 3.0, 10.0];
const EXCITATIONS: [f64; 4] = [0.1, 0.3, 3.0, 10.0];
const OF_FORCE: [f64; 3] = [0.03, 0.3, 1.0];
/// Separation that is aimed at, in units of noise: among proposals beyond it the one nearest to what was tested is taken.
const ENOUGH: f64 = 10.0;
/// Proposals that are simulated.
const SIMULATED: usize = 2;

/// A proposal: the plan, how far it lies from what was tested, and what it is.
struct Proposal<'a> {
    base: &'a Plan,
    by: Variation,
    separation: f64,
}

/// The tied models.
struct Tied<'a> {
    case: &'a Case,
    best: &'a Fitted,
    rivals: &'a [(Name, Fitted)],
}

/// The test that separates `best` from every rival.
pub fn separating(case: &Case, best: &Fitted, rivals: &[(Name, Fitted)], monitor: &Monitor) -> Option<NextTest> {
    let tied = Tied { case, best, rivals };
    let plans = [SplitName::Fit, SplitName::Select].map(|s| case.plans_of(s)).concat();
    let mut proposals: Vec<Proposal> = variations(&plans);
    weigh(&tied, &mut proposals);
    // Means are tried about the best cycle alone.
    let means: Vec<Proposal> = proposals
        .iter()
        .filter(|p| p.base.cycle_drive().is_some() && p.separation > 0.0)
        .take(2)
        .flat_map(|p| MEANS.map(|mean| Proposal { base: p.base, by: Variation { mean, ..p.by }, separation: 0.0 }))
        .collect();
    proposals.extend(means);
    weigh(&tied, &mut proposals);
    proposals.retain(|p| p.separation > 0.0);
    // Of those that separate well enough, the one nearest to a test that was run.
    let distance = |p: &Proposal| p.by.frequency.ln().abs() + p.by.amplitude.ln().abs() + p.by.mean.abs();
    proposals.sort_by(|a, b| {
        let key = |p: &Proposal| p.separation.min(ENOUGH);
        key(b).total_cmp(&key(a)).then(distance(a).total_cmp(&distance(b)))
    });
    let mut found: Option<NextTest> = None;
    for proposal in proposals.iter().take(SIMULATED) {
        if monitor.stops() {
            break;
        }
        let Some(apart) = tied.simulated(proposal, monitor) else { continue };
        if found.as_ref().is_none_or(|f| apart > f.separation) {
            found = Some(told(proposal, apart));
        }
        if found.as_ref().is_some_and(|f| f.breaks) {
            break;
        }
    }
    // What the simulation does not tell apart at all is no proposal.
    found.filter(|f| f.separation > 0.0)
}

/// Every drive that is tried. Tests of one drive and one set of channels are varied from the one of the largest amplitude.
fn variations<'a>(plans: &[&'a Plan]) -> Vec<Proposal<'a>> {
    let mut list = Vec::new();
    let new = |base: &'a Plan, by: Variation| Proposal { base, by, separation: 0.0 };
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
            let (low, high) = (low / REACH, high * REACH);
            (0..n).map(|k| low * (high / low).powf(k as f64 / (n - 1) as f64)).collect()
        };
        for f in spread(&|d| d.frequency, FREQUENCIES) {
            for a in spread(&|d| d.amplitude, AMPLITUDES) {
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
        list.extend(BANDS.map(|frequency| new(plan, Variation { frequency, ..Variation::default() })));
        let forces = plan.excitation().map_or(OF_FORCE.map(|p| p * force).to_vec(), |own| EXCITATIONS.map(|p| p * own).to_vec());
        let excited = forces.into_iter().filter(|f| *f > 0.0).map(|f| Variation { excitation: Some(f), ..Variation::default() });
        list.extend(excited.map(|by| new(plan, by)));
    }
    list
}

/// Weighs what has not been weighed; the largest separation first.
fn weigh(tied: &Tied, proposals: &mut [Proposal]) {
    proposals.par_iter_mut().filter(|p| p.separation == 0.0).for_each(|p| p.separation = tied.separation(p).unwrap_or(-1.0));
    proposals.sort_by(|a, b| b.separation.total_cmp(&a.separation));
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
        plan.correlated = Some(std::sync::Arc::new(Correlated::new(&plan, &values)));
        plan.measured.clone_from(&values);
        values.iter().all(|v| v.is_finite()).then_some((plan, values))
    }

    /// The least separation from a rival, whichever is true, after the other has adjusted itself.
    fn separation(&self, p: &Proposal) -> Option<f64> {
        let (plan, _) = self.planned(p)?;
        let see = |fitted: &Fitted| -> Option<Seen> {
            let c = plan.evaluate(&fitted.system, &fitted.free, true).ok()?;
            let n = fitted.free.len();
            let mut columns = DMatrix::from_fn(plan.len(), n, |i, k| c.slopes[i * n + k] / plan.sigma[i]);
            plan.whiten_shared(columns.as_view_mut());
            Some(Seen { values: plan.whitened(&c.values), columns })
        };
        let best = see(self.best)?;
        let mut least = f64::INFINITY;
        for (_, rival) in self.rivals {
            let other = see(rival)?;
            let apart = &other.values - &best.values;
            let adjusted = |seen: &Seen, fitted: &Fitted| left(&apart, &seen.columns, &fitted.outcome.jacobian);
            least = least.min(adjusted(&best, self.best)?).min(adjusted(&other, rival)?);
        }
        least.is_finite().then_some(least)
    }

    /// Simulates the test with either of each pair as the truth, refits both to all tests, and says by how many sigma the true one then
    /// fits better, at least.
    fn simulated(&self, p: &Proposal, monitor: &Monitor) -> Option<f64> {
        let (plan, values) = self.planned(p)?;
        let mut least = f64::INFINITY;
        for (k, (_, rival)) in self.rivals.iter().enumerate() {
            let other = plan.evaluate(&rival.system, &[], false).ok()?.values;
            for (truth, (own, wrong)) in [(&values, (self.best, rival)), (&other, (rival, self.best))] {
                let simulated = plan.clone().measuring(truth, noise(self.case.seed, k, plan.len()).into_iter());
                let cost = |fitted: &Fitted| -> Option<f64> {
                    let mut plans = self.case.plans_of(SplitName::Fit);
                    plans.push(&simulated);
                    let single = Case { starts: 1, coarse: true, ..self.case.clone() };
                    Some(single.fit_system(&fitted.system, plans, &monitor.quiet()).ok()?.outcome.cost)
                };
                // Before the new test the two may differ by a little already; what it adds is what separates.
                let before = own.outcome.cost - wrong.outcome.cost;
                let gained = cost(wrong)? - cost(own)? + before;
                least = least.min(gained.signum() * (2.0 * gained.abs()).sqrt());
            }
        }
        least.is_finite().then_some(least)
    }
}

/// sqrt of the least `||d + J s||^2 + ||Jo s||^2`.
fn left(d: &DVector<f64>, new: &DMatrix<f64>, measured: &DMatrix<f64>) -> Option<f64> {
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
    let q = super::score::basis(&stacked);
    let rest = &d - &q * q.tr_mul(&d);
    rest.iter().all(|v| v.is_finite()).then(|| rest.norm())
}

fn noise(seed: u64, stream: usize, n: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream as u64);
    let Ok(normal) = Normal::new(0.0, 1.0) else { return vec![0.0; n] };
    (0..n).map(|_| normal.inverse_cdf(rng.random_range(f64::EPSILON..1.0 - f64::EPSILON))).collect()
}

fn told(p: &Proposal, separation: f64) -> NextTest {
    let breaks = separation > 0.0 && 0.5 * separation * separation > DECISIVE;
    let apart = if breaks { format!("{separation:.1} sigma apart") } else { format!("only {separation:.1} sigma apart") };
    let verdict = format!("simulated with its noise and refitted, they stand {apart}");
    if let Some(own) = p.base.cycle_drive() {
        let (frequency, amplitude) = (own.frequency * p.by.frequency, own.amplitude * p.by.amplitude);
        let mean = own.mean + p.by.mean * amplitude;
        let about = if p.by.mean == 0.0 { String::new() } else { format!(" about a mean of {}", own.unit.print_difference(mean)) };
        let describe = format!(
            "the drive of test {} at {frequency:.4} Hz with an amplitude of {}{about}: {verdict}",
            p.base.id,
            own.unit.print_difference(amplitude)
        );
        let unit = own.unit.dimension.si_unit();
        return NextTest { describe, test: p.base.id.clone(), kind: "cycle".into(), frequency, amplitude, mean, unit, separation, breaks };
    }
    let lines = p.base.blocks.first().map_or(&[][..], |b| &b.abscissa);
    let (low, high) = lines.iter().fold((f64::INFINITY, 0.0f64), |(l, h), f| (l.min(*f), h.max(*f)));
    let (low, high) = (low * p.by.frequency, high * p.by.frequency);
    let force = p.by.excitation.or(p.base.excitation());
    let with = force.map_or(String::new(), |f| format!(" under an excitation of {f:.3e} N (N m about an axis) at its peak"));
    NextTest {
        describe: format!("the frequency response of test {} from {low:.4} to {high:.4} Hz{with}: {verdict}", p.base.id),
        test: p.base.id.clone(),
        kind: "frf".into(),
        frequency: high,
        amplitude: force.unwrap_or(0.0),
        mean: 0.0,
        unit: "N".into(),
        separation,
        breaks,
    }
}
