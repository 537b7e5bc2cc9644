//! A candidate effect, what all candidates say together, and the test that would separate the tied.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::reason::Reason;

/// A candidate effect.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Candidate {
    /// Name of the effect.
    pub effect: String,
    /// Place.
    pub at: String,
    /// For a coefficient: the parameter it acts on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// Fraction of the cost that the score test expects to fall.
    pub predicted_drop: f64,
    /// Pooled error before.
    pub error_before: f64,
    /// The same after the refit; none where it was not refitted.
    pub error_after: Option<f64>,
    /// Whether it earned its place.
    pub accepted: bool,
    /// Candidates the data cannot tell from it, `effect at place`.
    pub tied_with: Vec<String>,
    /// p-value of the best of all candidates under nothing missing, for this candidate's score.
    pub p_value: f64,
    /// The second opinion: the part it has in a sparse nonnegative combination of all candidates' columns; none where it is not in it.
    pub selected: Option<f64>,
    /// Nats that it gains beyond its price; none where it was not weighed.
    pub nats: Option<f64>,
    /// What was decided of it.
    pub reason: Reason,
    /// The same in words.
    pub remark: String,
}

/// What a sparse nonnegative combination of all candidates' columns says beside the scores of single ones.
#[derive(Clone, Debug, Default, Serialize, schemars::JsonSchema)]
pub struct SecondOpinion {
    /// What it needs, the largest part first; empty where nothing scores beyond chance.
    pub needs: Vec<Share>,
    /// Whether its first is what was accepted or, without that, the best score, or is tied with it.
    pub agrees: bool,
    /// A word where the two disagree.
    pub remark: Option<String>,
}

/// A candidate's part of what a combination explains.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Share {
    /// Effect.
    pub effect: String,
    /// Place.
    pub at: String,
    /// Part, of 1.
    pub part: f64,
}

/// A test that would separate tied candidates.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema, Deserialize)]
pub struct NextTest {
    /// In words.
    pub describe: String,
    /// The test that it varies.
    pub test: String,
    /// cycle, frf or modal.
    pub kind: String,
    /// Drive frequency; of an FRF its highest line, of a modal test 0 [Hz].
    pub frequency: f64,
    /// Half range of the drive; of an FRF the peak of its force, 0 for a small signal [SI].
    pub amplitude: f64,
    /// Mean of the drive [SI].
    pub mean: f64,
    /// SI unit of the amplitude.
    pub unit: String,
    /// Conditions with another value [SI] than the test that it varies.
    pub conditions: BTreeMap<String, f64>,
    /// By how many sigma the true one fits better in the simulation, whichever is true: the root of twice the difference of the costs.
    pub separation: f64,
    /// Whether the tie broke there.
    pub breaks: bool,
    /// Whether the search for it ended for want of time; what was not simulated is then an estimate.
    pub cut_short: bool,
}
