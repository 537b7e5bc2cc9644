//! Whether a refitted candidate has earned its place.

use std::sync::OnceLock;

use crate::identify::Monitor;
use crate::model::Site;

use super::Case;
use super::accept::{STANDARD_ERRORS, at_floor, earns_its_place, far, improved, improvement, rms, seen_in_noise, undecided};
use super::folds::cross_validated;
use super::refit::{Proof, Whitened, cost};
use super::results::SplitName;

/// Fall of the cost per free parameter that chance buys on the tests that are fitted, where other tests decide.
const BY_CHANCE: f64 = 2.0;
/// Fall of the cost beyond Schwarz's that is asked for where the fitted tests alone decide.
const BEYOND: f64 = 2.0;
/// Part of the cost that an effect must take away where the one test that is fitted decides.
const WORTH_ALONE: f64 = 0.1;
/// Part of the cost that an effect must take away where the model is far from the noise: what is missing is not in the third digit of the
/// misfit.
const WORTH_FAR: f64 = 0.01;
/// Part of what a test shows beyond the noise that an error of its own instrument must explain.
const OWN_PART: f64 = 0.5;
/// Part of what it gains on the fitted tests that it may cost on the select tests.
const LITTLE: f64 = 0.1;

/// What candidates are judged against.
pub struct Judge<'a> {
    case: &'a Case,
    before: &'a Proof,
    /// The model without a candidate on parts of the fit tests that it was not fitted to, once they are asked for.
    folds: OnceLock<Option<Whitened>>,
    monitor: &'a Monitor<'a>,
}

impl<'a> Judge<'a> {
    /// `before`: the model without a candidate.
    pub fn new(case: &'a Case, before: &'a Proof, monitor: &'a Monitor<'a>) -> Judge<'a> {
        Judge { case, before, folds: OnceLock::new(), monitor }
    }

    /// Whether the candidate that `proof` added last has earned its place, and what was weighed beside the improvement.
    ///
    /// The cost on the fit tests must fall by more than its parameters buy by chance; on select the pairs decide. Where the select tests
    /// hardly show the effect they cannot, and then it must bring the fit tests from beyond the noise down to it, or hold in parts of the
    /// fit tests that it was not fitted to. So it must where there are no select tests; with one test alone the fall must be worth the
    /// name. Where the fitted tests are at the noise with it, and the select tests were without, it need only be seen beyond their noise
    /// ([`seen_in_noise`]). An error of the instrument of one fitted test shows nowhere else: there the cost must fall by more than Schwarz's price and
    /// the select tests must not object, or by a small part of that fall.
    pub fn earned(&self, proof: &Proof) -> (bool, String) {
        let gain = cost(&self.before.fit) - cost(&proof.fit);
        let added = (proof.fitted.free.len() - self.before.fitted.free.len()) as f64;
        let n: usize = self.before.fit.iter().map(Vec::len).sum();
        let priced = 0.5 * added * (n.max(1) as f64).ln() + BEYOND;
        if let Some(test) = self.own_test(proof) {
            return self.earned_on(test, gain > priced, proof);
        }
        if far(rms(&self.before.fit).0) && gain < WORTH_FAR * cost(&self.before.fit) {
            return (false, "; next to nothing of a misfit that is far from the noise".into());
        }
        if !self.before.select.is_empty() {
            if gain > BY_CHANCE * added && earns_its_place(&self.before.select, &proof.select) {
                return (true, String::new());
            }
            if gain > priced && at_floor(rms(&proof.fit)) && seen_in_noise(&self.before.select, &proof.select) {
                return (true, "; the fitted tests are at the noise with it, and the select tests show it beyond theirs".into());
            }
            if gain <= priced || !undecided(&self.before.select, &proof.select) {
                return (false, String::new());
            }
            if !at_floor(rms(&self.before.fit)) && at_floor(rms(&proof.fit)) {
                return (true, "; brings the fitted tests to the noise, and the select tests hardly show it".into());
            }
            let (holds, text) = self.elsewhere(proof).unwrap_or_default();
            return (holds, format!("; the select tests hardly show it{text}"));
        }
        if gain <= priced {
            return (false, "; less than its parameters gain by chance".into());
        }
        self.elsewhere(proof).unwrap_or_else(|| (gain > WORTH_ALONE * cost(&self.before.fit), String::new()))
    }

    /// Mean improvement of the squared residual on the tests that decide; none of an error of one test's instrument, which no other test
    /// shows.
    pub fn gain(&self, proof: &Proof) -> Option<f64> {
        self.own_test(proof).is_none().then(|| improved(self.before, proof).0)
    }

    /// Whether it holds in parts of the fit tests that it was not fitted to; none where there is but one.
    fn elsewhere(&self, proof: &Proof) -> Option<(bool, String)> {
        let folds = || cross_validated(self.case, &self.before.fitted.system, self.monitor).ok();
        let before = (self.before.fit.len() > 1).then(|| self.folds.get_or_init(folds).as_ref()).flatten()?;
        Some(match cross_validated(self.case, &proof.fitted.system, self.monitor) {
            Ok(after) => {
                let (mean, error) = improvement(before, &after);
                (earns_its_place(before, &after), format!("; on parts it was not fitted to by {mean:.3} +- {error:.3}"))
            }
            Err(reason) => (false, format!("; it could not be cross-validated: {reason}")),
        })
    }

    /// The fit test whose channel the candidate is about, if it is about one alone.
    fn own_test(&self, proof: &Proof) -> Option<usize> {
        let Site::Channel(site) = &proof.fitted.system.instances.last()?.site else { return None };
        self.case.plans_of(SplitName::Fit).iter().position(|p| p.id == site.test)
    }

    fn earned_on(&self, test: usize, worth: bool, proof: &Proof) -> (bool, String) {
        let square = |w: &[f64]| w.iter().map(|r| r * r).sum::<f64>() / w.len().max(1) as f64;
        let (before, after) = (square(&self.before.fit[test]), square(&proof.fit[test]));
        // What is left may be more than one by chance.
        let explained = before - after > OWN_PART * (before - 1.0) || at_floor((after.sqrt(), self.before.fit[test].len()));
        let (mean, error) = improvement(&self.before.select, &proof.select);
        let loss = cost(&proof.select) - cost(&self.before.select);
        let gain = cost(&self.before.fit) - cost(&proof.fit);
        let borne = proof.select.is_empty() || mean >= -STANDARD_ERRORS * error || loss < LITTLE * gain;
        (worth && explained && borne, format!("; its own test from {before:.3} to {after:.3}"))
    }
}
