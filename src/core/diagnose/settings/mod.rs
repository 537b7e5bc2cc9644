//! Constants of the search: meaning, unit, why. Those of the likelihood stand in [`crate::evidence::Settings`].

mod method;
mod proposals;
mod race;

use serde::Serialize;

use crate::evidence;

pub use method::{Fitting, Scoring, Telling};
pub use proposals::Proposals;
pub use race::Race;

/// How missing physics is searched for, and when it is believed.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Settings {
    /// Effects added at most.
    pub max_added: usize,
    /// Candidates refitted for their scores: what is not refitted is not found.
    pub refits: usize,
    /// Refitted candidates that are weighed with variances of their own.
    pub weighed: usize,
    /// Factor on the gain that a score or a refit under the base's variances promises, below which a candidate is not looked at further: once
    /// it is there, the error it leaves has a smaller variance.
    pub promise: f64,
    /// Factor on the nats that one step of a refit under variances of its own promises, for what its fit may gain at most: more steps follow, and the variances
    /// fall with what they leave (2 to 11 times that step on one chain).
    pub reach: f64,
    /// The same as [`Settings::promise`] of an effect in series, whose score at opening zero says little.
    pub promise_series: f64,
    /// The most that a pair may gain over what its two gained each by itself, before their price: each hides part of what the other does.
    pub promise_pair: f64,
    /// Fits and estimates of variances in turn; estimates of the counts and of the widths of slack by what is then left; and fits of tests computed about where a
    /// model stands, before one in full.
    pub rounds: usize,
    /// Estimates of variances and counts in turn at the plain fit of the study's own model, from which that is weighed.
    pub estimates: usize,
    /// Iterations of each of these fits.
    pub iterations: u64,
    /// Parts of the way to where such a fit ends that are tried, in turn, where the likelihood is less there.
    pub parts_of_a_fit: [f64; 3],
    /// Times that these are gone through again, at most, for a model that others are held against and that has not come to its end.
    pub finish: usize,
    /// Nats that going through them once more must have gained for another time: a fifth of a tie.
    pub finish_least: f64,
    /// Nats that a fit which decides between models may leave unfound: far below a tie.
    pub settled: f64,
    /// Candidates that stood best alone and are tried in pairs where none alone gains.
    pub pair_of: usize,
    /// Part of the strength that each had alone with which the two begin.
    pub pair_part: f64,
    /// Model error, in parts of the least, from which a model is seen to err: pairs and slack are tried, and what is missing has the odds of a model that is
    /// searched, whatever was added to it.
    pub errs_from: f64,
    /// Nats within which two laws cannot be told apart, and within which nothing is decided by a gain alone; what stands is taken out only below minus
    /// this.
    pub tie: f64,
    /// Effects that slack may have been taken for, which are looked for once nothing gains beside it: two, of which the first alone gained less. More are no
    /// smaller statement than that parts differ, as they do in every structure.
    pub for_slack: usize,
    /// Parts at most into which the fitted tests are cut, each left out in its turn, where a gain lies within a tie of nothing: half a dozen refits of
    /// two models say what a dozen would.
    pub turns: usize,
    /// Nats by which an alternative must be better to take the place of what stands.
    pub swap: f64,
    /// Nats by which the density of the held-out tests must rise for an effect to be proven.
    pub held_out_nats: f64,
    /// Part by which their error must fall beside that.
    pub held_out_fall: f64,
    /// Nats that fitted and held-out tests together must give for what is not proven, or it is withdrawn: odds of twenty.
    pub unproven: f64,
    /// Nats that stand by themselves (e^8 in odds): a test that separates two laws by so much breaks their tie; effects that are to take the place of slack are
    /// exchanged while they are within so much of it.
    pub decisive: f64,
    /// Pieces into which the held-out tests are cut at least, for the standard error of the fall of their error: fewer give no spread.
    pub held_out_pieces: usize,
    /// Part of the first model error left on the held-out tests above which the verdict stays `unexplained`...
    pub remainder: f64,
    /// ...where it is more than this many times the noise...
    pub visible: f64,
    /// ...and this many times the least model error.
    pub visible_least: f64,
    /// Width of the prior of the deviations of springs that a study ties or fixes, at most: what a workshop calls the same part...
    pub slack_spring: f64,
    /// ...of nominal masses...
    pub slack_mass: f64,
    /// ...of dampers, alike joints; wider, it takes a relaxing branch for a damper...
    pub slack_damper: f64,
    /// ...of the part of the mass that lies between the nodes (half in a chain of twice as many bodies; half of that is what its end may lack), at most...
    pub slack_between: f64,
    /// ...and at least...
    pub slack_between_least: f64,
    /// ...and of the others at least.
    pub slack_least: f64,
    /// Deviations that are given without being asked for, at most: each costs a column in every evaluation.
    pub slack_members: usize,
    /// Part of a value by which it may deviate at most: beyond it, it is not that part.
    pub slack_reach: f64,
    /// Widths of a spring's slack, the widest, within which a compliance in series with it is that spring, softer than its group, and no effect.
    pub slack_softer: f64,
    /// Relative deviation from which one is told as a correction: a per cent is within what is nominal.
    pub correction_least: f64,
    /// The same in standard deviations.
    pub correction_sure: f64,
    /// Odds, before any test is read, that a model lacks anything: of studies that are searched nine in ten miss something, or they would not be. They stand
    /// against the first thing that is found, and against what is found next where the model with it still errs. Beside one that errs no more there are even
    /// odds.
    pub missing_odds: f64,
    /// Odds, before any test is read, that what a model lacks is physics and no fault of an instrument: of studies that miss something one in twenty has an
    /// instrument at fault. Where few tests speak, physics and the gain of one test are worth the same within a nat.
    pub fault_odds: f64,
    /// Part of a channel's rms that a gain of one test must move, or a drift over a record: less is scatter between tests.
    pub fault_gain: f64,
    /// The same of other faults of a channel.
    pub fault_least: f64,
    /// Times the model's own error in a test that a fault must move it: physics first.
    pub fault_over: f64,
    /// Error that a test may have once its fault is taken out, over the median of the others.
    pub like_others: f64,
    /// Tests from which a fault of one of them can be told from physics.
    pub fault_tests: usize,
    /// How fits are begun and ended.
    pub fitting: Fitting,
    /// How candidates are scored.
    pub scoring: Scoring,
    /// Which candidates are refitted, from where, for how long.
    pub race: Race,
    /// What is told of a model beside the verdict.
    pub telling: Telling,
    /// Which test separates what is tied.
    pub next: Proposals,
    /// Sine of the loss angle below which a loop gives energy beyond any delay of a channel: its force is turned round...
    pub turned_gives: f64,
    /// ...where the correlation of force and displacement is below this: a late channel turns the loss and leaves the stiffness.
    pub turned_stands: f64,
    /// Mean cosine of the angle between the lines of an FRF and those of a model below minus which its response is turned round; modes that are displaced by
    /// a tenth leave 0.8.
    pub turned_phase: f64,
    /// What the likelihood assumes.
    #[serde(flatten)]
    pub evidence: evidence::Settings,
}

/// A constant that a study may state under `[search]`: its key, what is accepted, and where it stands.
pub struct Stated {
    /// Key.
    pub key: &'static str,
    /// Least and largest value.
    pub range: (f64, f64),
    /// The field.
    pub field: fn(&mut Settings) -> &mut f64,
}

/// Every constant that a study may state.
pub const STATED: [Stated; 20] = [
    Stated { key: "model_error_least", range: (1e-6, 0.5), field: |s| &mut s.evidence.model_error_least },
    Stated { key: "frf_error_least", range: (1e-6, 0.5), field: |s| &mut s.evidence.frf_error_least },
    Stated { key: "model_error_spread", range: (1e-3, 5.0), field: |s| &mut s.evidence.model_error_spread },
    Stated { key: "scatter_prior", range: (1e-6, 0.5), field: |s| &mut s.evidence.scatter_prior },
    Stated { key: "scatter_most", range: (1e-6, 0.5), field: |s| &mut s.evidence.scatter_most },
    Stated { key: "instruments_common", range: (0.0, 0.99), field: |s| &mut s.evidence.instruments_common },
    Stated { key: "noise_spread", range: (1e-3, 5.0), field: |s| &mut s.evidence.noise_spread },
    Stated { key: "noise_most", range: (1.0, 1e4), field: |s| &mut s.evidence.noise_most },
    Stated { key: "facts_loop", range: (1.0, 81.0), field: |s| &mut s.evidence.facts_loop },
    Stated { key: "facts_most", range: (1.0, 1e6), field: |s| &mut s.evidence.facts_most },
    Stated { key: "facts_mode", range: (1.0, 1e3), field: |s| &mut s.evidence.facts_mode },
    Stated { key: "facts_record", range: (1.0, 1e6), field: |s| &mut s.evidence.facts_record },
    Stated { key: "tie", range: (0.0, 50.0), field: |s| &mut s.tie },
    Stated { key: "held_out_nats", range: (0.0, 50.0), field: |s| &mut s.held_out_nats },
    Stated { key: "held_out_fall", range: (0.0, 0.9), field: |s| &mut s.held_out_fall },
    Stated { key: "remainder", range: (0.0, 1.0), field: |s| &mut s.remainder },
    Stated { key: "missing_odds", range: (1e-3, 1e6), field: |s| &mut s.missing_odds },
    Stated { key: "fault_odds", range: (1.0, 1e6), field: |s| &mut s.fault_odds },
    Stated { key: "fault_gain", range: (0.0, 1.0), field: |s| &mut s.fault_gain },
    Stated { key: "fault_least", range: (0.0, 1.0), field: |s| &mut s.fault_least },
];

impl Settings {
    /// What of these constants contradicts itself, and what would not.
    pub fn contradiction(&self) -> Option<(String, String)> {
        let e = &self.evidence;
        (e.facts_loop > e.facts_most).then(|| {
            let said = format!("facts_loop = {} is more than facts_most = {}", e.facts_loop, e.facts_most);
            (said, "facts_loop of one loop up to facts_most of all".into())
        })
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            max_added: 4,
            refits: 8,
            weighed: 8,
            promise: 2.0,
            reach: 12.0,
            promise_series: 5.0,
            promise_pair: 5.0,
            rounds: 2,
            estimates: 4,
            iterations: 12,
            parts_of_a_fit: [0.5, 0.25, 0.1],
            finish: 10,
            finish_least: 0.3,
            settled: 0.02,
            pair_of: 4,
            pair_part: 0.5,
            errs_from: 2.0,
            tie: 1.5,
            for_slack: 2,
            turns: 6,
            swap: 0.5,
            held_out_nats: 1.0,
            held_out_fall: 0.03,
            unproven: 3.0,
            decisive: 8.0,
            held_out_pieces: 8,
            remainder: 1.0 / 3.0,
            visible: 2.0,
            visible_least: 3.0,
            slack_spring: 0.05,
            slack_mass: 0.03,
            slack_damper: 0.05,
            slack_between: 0.5,
            slack_between_least: 0.02,
            slack_least: 0.002,
            slack_members: 40,
            slack_reach: 0.9,
            slack_softer: 3.0,
            correction_least: 0.01,
            correction_sure: 2.5,
            missing_odds: 9.0,
            fault_odds: 20.0,
            fault_gain: 0.03,
            fault_least: 0.01,
            fault_over: 3.0,
            like_others: 2.5,
            fault_tests: 3,
            fitting: Fitting::default(),
            scoring: Scoring::default(),
            race: Race::default(),
            telling: Telling::default(),
            next: Proposals::default(),
            turned_gives: -0.02,
            turned_stands: 0.3,
            turned_phase: 0.5,
            evidence: evidence::Settings::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_default_is_accepted_and_every_key_has_a_field_of_its_own() {
        let mut all = Settings::default();
        assert!(all.contradiction().is_none());
        for (k, stated) in STATED.iter().enumerate() {
            let value = *(stated.field)(&mut all);
            assert!(stated.range.0 <= value && value <= stated.range.1, "{}: {value}", stated.key);
            *(stated.field)(&mut all) = 1000.0 + k as f64;
        }
        for (k, stated) in STATED.iter().enumerate() {
            assert_eq!(*(stated.field)(&mut all), 1000.0 + k as f64, "{}", stated.key);
        }
        let mut odd = Settings::default();
        odd.evidence.facts_loop = 20.0;
        assert!(odd.contradiction().unwrap().0.contains("facts_most"));
    }
}
