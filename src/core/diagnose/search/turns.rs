//! Two models judged by the fitted tests in turn: each test is left out of the fit of both, and then says which of them foretold it better.
//!
//! The criterion is an expansion for many facts. Within a tie of nothing its own error decides, and with three tests of a device it is larger than that.
//! There the sum of the densities of what was left out (Geisser and Eddy, J. Am. Stat. Assoc. 74, 1979) is a fact of its own: it asks whether the
//! larger model carries over to a test that it has not seen, which is what an effect does and an accident does not.

use std::sync::Arc;

use crate::evidence::{Counts, Evidence, Variances};
use crate::identify::Monitor;
use crate::parallel;
use crate::response::Plan;

use super::held_out::HeldOutTests;
use crate::diagnose::calibrate::weigh::{Scale, Weighed};
use crate::diagnose::results::SplitName;
use crate::diagnose::trace;

/// Whether one model is better than another, and what decided it.
pub struct Better {
    /// Whether it is.
    pub yes: bool,
    /// Nats by which it foretells what was left out better, less what the search for it cost, where that was asked.
    pub turns: Option<f64>,
}

impl Scale {
    /// Whether a larger model is better than a smaller one: by its gain [nats] or, where that is within a tie of nothing, by that and by what the tests say
    /// in turn.
    pub fn better(&self, gain: f64, larger: &Weighed, smaller: &Weighed, monitor: &Monitor) -> Better {
        if gain.abs() > self.settings.tie {
            return Better { yes: gain > 0.0, turns: None };
        }
        self.in_turn(gain, larger, smaller, monitor)
    }

    /// The same by both, whatever the gain. What is the best of many was chosen by all tests, those that are left out in turn among them: what the search for it
    /// cost is in the gain, and is taken from what they say as well.
    pub fn in_turn(&self, gain: f64, larger: &Weighed, smaller: &Weighed, monitor: &Monitor) -> Better {
        let search = self.gain(larger, smaller, 1.0) - gain;
        let turns = self.turns(larger, smaller, monitor).as_deref().map(sum_and_variance).map(|(sum, variance)| (sum - search, variance));
        Better { yes: together(gain, turns, self.settings.tie) > 0.0, turns: turns.map(|t| t.0) }
    }

    /// Nats by which the larger model foretells each part of the fitted tests better that is left out in its turn; none where there is only one, or
    /// where a model cannot be fitted without one. A part less moves a model little: tests that are cheaper about where it stands are computed there.
    fn turns(&self, larger: &Weighed, smaller: &Weighed, monitor: &Monitor) -> Option<Vec<f64>> {
        let tests = self.evidence.records.len();
        let turns = tests.min(self.settings.turns);
        if turns < 2 {
            return None;
        }
        let about = |w: &Weighed| self.about(&w.fitted.system).unwrap_or_else(|| self.again());
        let (about_large, about_small) = (about(larger), about(smaller));
        let of = |turn: usize| -> Option<f64> {
            if trace::stopped(monitor) {
                return None;
            }
            let (kept, left): (Vec<usize>, Vec<usize>) = (0..tests).partition(|t| t % turns != turn);
            let own = |v: &Variances| Variances { own: kept.iter().map(|t| v.own[*t].clone()).collect(), ..v.clone() };
            let weigh = |about: &Scale, w: &Weighed| {
                let scale = about.of_tests(&kept);
                let weighed = scale.weigh_in_full(&w.fitted.system, &own(&w.v), monitor).ok()?;
                Some((scale.evidence, weighed))
            };
            let ((of_small, small), (of_large, large)) = (weigh(&about_small, smaller)?, weigh(&about_large, larger)?);
            // Noise is the tests', and no model is better for having another.
            let density = |about: &Scale, fitted: &Evidence, w: &Weighed| {
                HeldOutTests::left_out(&about.of_tests(&left), fitted, large.v.kappa).look(w).map(|l| l.density)
            };
            Some(density(&about_large, &of_large, &large)? - density(&about_small, &of_small, &small)?)
        };
        parallel::over(turns, of).into_iter().collect()
    }

    /// The same on some of its tests.
    fn of_tests(&self, kept: &[usize]) -> Scale {
        let plans = self.case.plans.iter().filter(|(_, s)| *s == SplitName::Fit);
        let plans: Vec<(Plan, SplitName)> = plans.enumerate().filter(|(t, _)| kept.contains(t)).map(|(_, p)| p.clone()).collect();
        let records = kept.iter().map(|t| self.evidence.records[*t].clone()).collect();
        let counts = Counts { z: kept.iter().map(|t| self.counts.z[*t].clone()).collect(), ..self.counts };
        Scale {
            case: crate::diagnose::calibrate::case::Case { plans: Arc::new(plans), memo: None, ..self.case.clone() },
            evidence: Evidence { records, settings: self.evidence.settings.clone() },
            counts,
            ..self.again()
        }
    }
}

/// Sum of independent draws, and its variance by their scatter.
fn sum_and_variance(draws: &[f64]) -> (f64, f64) {
    let n = draws.len() as f64;
    let mean = draws.iter().sum::<f64>() / n;
    let variance = draws.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (n * mean, n * variance)
}

/// A gain and a sum over tests with its variance as one: two estimates of one number, each off by about a tie and the second by what its tests disagree
/// as well, weighted by the inverse of their variances.
fn together(gain: f64, turns: Option<(f64, f64)>, tie: f64) -> f64 {
    let Some((sum, variance)) = turns else { return gain };
    let own = (tie * tie).max(f64::MIN_POSITIVE);
    (gain / own + sum / (own + variance)) / (1.0 / own + 1.0 / (own + variance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_that_agree_overrule_a_gain_that_says_little_and_tests_that_do_not_cannot() {
        let of = |gain: f64, draws: &[f64]| together(gain, Some(sum_and_variance(draws)), 1.5);
        assert!(of(-1.2, &[1.3, 1.3, 0.6]) > 0.0);
        assert!(of(1.2, &[-0.9, -1.1, -1.0]) < 0.0);
        assert!(of(1.2, &[0.8, -0.8, -3.0]) > 0.0, "one test far off says little");
        assert_eq!(together(0.3, None, 1.5), 0.3, "where no test can be left out the gain decides");
    }

    #[test]
    fn a_sum_of_draws_has_their_scatter() {
        let (sum, variance) = sum_and_variance(&[1.0, 2.0, 3.0]);
        approx::assert_relative_eq!(sum, 6.0);
        approx::assert_relative_eq!(variance, 3.0);
        assert_eq!(sum_and_variance(&[2.0]), (2.0, 0.0));
    }
}
