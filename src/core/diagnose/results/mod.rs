//! What the verbs give: the JSON of contract.md, with the curves a report draws beside it.

use serde::Serialize;

mod candidate;
mod energy;
mod errors;
mod parameter;
mod reason;
mod unexplained;

pub use candidate::{Candidate, NextTest, SecondOpinion, Share};
pub use energy::{EnergyShare, ModeEnergy, words};
pub use errors::{BETWEEN, Correction, END, Instrument, OwnError, Reading, ScatterOf};
pub use parameter::ParameterResult;
pub use reason::{Fault, Reason};
pub use unexplained::{Missed, Unexplained};

use crate::diagnose::settings::Settings;
use crate::model::{Instance, System};
use crate::units::Unit;

/// Which use a test serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SplitName {
    /// Parameters are identified on it.
    Fit,
    /// Effects are accepted on it.
    Select,
    /// Read once, at the end.
    HeldOut,
}

impl SplitName {
    /// Every split.
    pub const ALL: [SplitName; 3] = [SplitName::Fit, SplitName::Select, SplitName::HeldOut];
}

/// The point of a test that lies farthest from the model in units of sigma.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Worst {
    /// Channel and abscissa, in words.
    #[serde(rename = "where")]
    pub place: String,
    /// Measured value [SI].
    pub measured: f64,
    /// Computed value [SI].
    pub computed: f64,
    /// Unit that the file states the channel in; the words about the point use it.
    #[serde(skip)]
    pub unit: Unit,
}

impl Worst {
    /// `force at c1.x at 90 deg of the cycle: measured 3.1 N, computed 2.2 N`
    pub fn words(&self) -> String {
        let value = |si: f64| self.unit.print_difference(si);
        format!("{}: measured {}, computed {}", self.place, value(self.measured), value(self.computed))
    }
}

/// One channel of a test, for plots and Parquet.
#[derive(Clone, Debug)]
pub struct Curve {
    /// `force at c1.x`.
    pub label: String,
    /// SI unit.
    pub unit: String,
    /// What the points are.
    pub kind: crate::response::BlockKind,
    /// Phase [rad], frequency [Hz], time [s], amplitude [m or rad], row.
    pub abscissa: Vec<f64>,
    /// Driven displacement and velocity at the points; empty where not driven.
    pub x: Vec<f64>,
    /// Driven velocity.
    pub v: Vec<f64>,
    /// Measured (FRF: real and imaginary parts in turn).
    pub measured: Vec<f64>,
    /// Computed.
    pub computed: Vec<f64>,
    /// Standard deviation.
    pub sigma: Vec<f64>,
}

impl Curve {
    /// Largest difference of measured and computed over the range of the measured, as the tensioner's paper states errors (Figs. 15, 19,
    /// 20); of an FRF that of its magnitude, of a table the largest relative deviation of a row (Fig. 14).
    pub fn largest_difference(&self) -> f64 {
        use crate::response::{BlockKind, is_compared};
        let largest = |d: &mut dyn Iterator<Item = f64>| d.fold(0.0f64, |m, d| m.max(d.abs()));
        let magnitude = |v: &[f64]| v.chunks_exact(2).map(|p| p[0].hypot(p[1])).collect::<Vec<f64>>();
        let seen = |(i, _): &(usize, &f64)| self.sigma.get(*i).is_none_or(|s| is_compared(*s, self.measured[*i]));
        let over_range = |m: &[f64], c: &[f64]| {
            let (low, high) = m.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            let range = high - low;
            if range > 0.0 { largest(&mut m.iter().zip(c).map(|(m, c)| m - c)) / range } else { f64::NAN }
        };
        match self.kind {
            BlockKind::Frf => over_range(&magnitude(&self.measured), &magnitude(&self.computed)),
            BlockKind::Table => largest(
                &mut self.measured.iter().enumerate().filter(seen).map(|(i, m)| self.computed.get(i).map_or(f64::NAN, |c| c / m - 1.0)),
            ),
            BlockKind::Loop | BlockKind::Record => over_range(&self.measured, &self.computed),
        }
    }
}

/// [`Curve::largest_difference`] of one channel, as a fraction.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct LargestDifference {
    /// `displacement at P.x`.
    pub channel: String,
    /// What it is over: `range`, `range of magnitude` or `value`.
    pub over: &'static str,
    /// The difference as a fraction of that.
    pub fraction: f64,
}

/// How far off the energies of one channel of a table are, as factors: energies run over decades.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Factor {
    /// `W_D per cycle at c1.x`.
    pub channel: String,
    /// Largest of computed / measured and its inverse, exp(max |ln(computed / measured)|).
    pub largest: f64,
    /// Where one strength carries the whole loss: what it can reach at best.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub strength: Option<OneStrength>,
}

/// What the one strength that carries the whole loss of a table can reach: the least largest factor (minimax) over its values.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct OneStrength {
    /// The strength.
    pub parameter: String,
    /// Its value there [SI]; all other parameters stay as they are.
    pub value: f64,
    /// The least largest factor.
    pub best: f64,
    /// The same where the strength is weak (a thousandth of its value), the losses are proportional to it and the motion is that of the
    /// model without: exp of half the range of ln(computed / measured).
    pub weak: f64,
}

/// Damping of the modes of a test that is not fitted: the model beside one constant ratio.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ConstantDamping {
    /// The constant: mean of the damping ratios measured of the fitted modes.
    pub ratio: f64,
    /// Modes compared.
    pub modes: usize,
    /// Root mean square over the modes of computed / measured - 1.
    pub model: f64,
    /// The same of the constant.
    pub constant: f64,
    /// Mean over the modes of the difference of these squares, constant less model.
    pub gain: f64,
    /// Its standard error, paired by modes.
    pub standard_error: f64,
    /// What that says.
    pub verdict: Against,
}

/// A model beside a constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// Better by more than two standard errors.
    Better,
    /// Worse by more than two standard errors.
    Worse,
    /// Neither.
    Tied,
}

impl ConstantDamping {
    /// In one clause.
    pub fn words(&self) -> String {
        let percent = |v: f64| format!("{:.2}", 100.0 * v);
        format!(
            "damping of {} modes that were not fitted: the model is off by {} % (root mean square), one constant ratio of {} % by {} %: the model is {}",
            self.modes,
            percent(self.model),
            percent(self.ratio),
            percent(self.constant),
            match self.verdict {
                Against::Better => "better, beyond two standard errors",
                Against::Worse => "worse, beyond two standard errors",
                Against::Tied => "tied with it",
            }
        )
    }
}

/// One test against the model.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct TestResult {
    /// Id of the test.
    pub id: String,
    /// cycle, frf, transient, energy, modal, backbone.
    pub kind: String,
    /// Its split.
    pub split: SplitName,
    /// rms(measured - computed) / rms(measured - mean).
    pub error: f64,
    /// The same with sigma in place of the difference.
    pub floor: f64,
    /// Root mean square of the whitened residuals.
    pub whitened_rms: f64,
    /// Farthest point.
    pub worst: Worst,
    /// Number of measured values.
    pub n: usize,
    /// Largest difference over the range of the measured, channel by channel: the measure of the tensioner's paper.
    pub largest_difference: Vec<LargestDifference>,
    /// Of a table of energies, how far each channel is off.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub factors: Vec<Factor>,
    /// Of a table of modes that is not fitted, what a constant damping ratio does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant_damping: Option<ConstantDamping>,
    /// Of a table of modes, where the energy of each is.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<ModeEnergy>,
    /// Its channels.
    #[serde(skip)]
    pub curves: Vec<Curve>,
}

/// Measured values that the free parameters are fitted to.
pub fn compared(tests: &[TestResult]) -> usize {
    tests.iter().filter(|t| t.split == SplitName::Fit).map(|t| t.n).sum()
}

/// An effect and its place.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, schemars::JsonSchema)]
pub struct EffectAt {
    /// Name of the effect.
    pub effect: String,
    /// Place.
    pub at: String,
    /// Of a coefficient, the parameter that it acts on and the condition: `viscous.c over i`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
}

impl EffectAt {
    /// What an instance of `system` is.
    pub fn of(system: &System, instance: &Instance) -> EffectAt {
        let of = instance.target.as_ref().and_then(|t| t.acts_on(system));
        EffectAt { effect: instance.name().into(), at: instance.at.clone(), of }
    }
}

impl std::fmt::Display for EffectAt {
    /// A law over a condition is told with the parameter and the condition: several may act at one place.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} at {}", self.effect, self.at)?;
        self.of.as_ref().map_or(Ok(()), |of| write!(f, " ({of})"))
    }
}

/// Result of `fit`.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct FitResult {
    /// Name of the study.
    pub study: String,
    /// converged, stalled, max_iterations, interrupted, failed.
    pub termination: String,
    /// 1/2 ||r||^2 over the fitted tests and priors.
    pub cost: f64,
    /// Rows.
    pub n_residuals: usize,
    /// Free parameters.
    pub n_free: usize,
    /// Wall time [s].
    pub wall_s: f64,
    /// Iterations.
    pub iterations: u64,
    /// Every test of the study.
    pub tests: Vec<TestResult>,
    /// Free parameters.
    pub parameters: Vec<ParameterResult>,
    /// Combinations the data do not determine, in words.
    pub unidentifiable: Vec<String>,
    /// Effects of the model.
    pub effects: Vec<EffectAt>,
    /// The model's own error, channel by channel, on the fitted tests.
    pub model_error: Vec<OwnError>,
    /// What instruments read wrong by this model, beyond what they may err by.
    pub readings: Vec<Reading>,
    /// How much strengths differ from test to test.
    pub scatter: Vec<ScatterOf>,
    /// True noise over that seen between cycles or stated; 1 where it is not estimated. Below 1 it is no finding: where the model errs in some harmonics
    /// more than in others, the estimate takes it from the noise.
    pub noise: f64,
    /// Notes on data and fit.
    pub notes: Vec<String>,
}

/// Something seen in the residuals.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Finding {
    /// Test.
    pub test: String,
    /// What is claimed, in words.
    pub claim: String,
    /// Statistic.
    pub number: f64,
    /// Value beyond which it is claimed.
    pub threshold: f64,
    /// Probability of seeing an effect of 10 % of the signal.
    pub power: f64,
}

/// What a diagnosis says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// An effect is missing.
    Missing,
    /// Nothing is.
    NothingMissing,
    /// Something is, but no candidate explains it.
    Unexplained,
    /// The search was stopped before it had found anything: unexplained so far, with `interrupted` beside it.
    #[serde(rename = "unexplained")]
    Interrupted,
}

/// Result of `diagnose`.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Diagnosis {
    /// Findings.
    pub findings: Vec<Finding>,
    /// Candidates, best first.
    pub candidates: Vec<Candidate>,
    /// What all candidates at once say.
    pub second_opinion: SecondOpinion,
    /// Verdict.
    pub verdict: Verdict,
    /// Best accepted, with its place.
    pub missing: Vec<EffectAt>,
    /// Test that separates the tied.
    pub next_test: Option<NextTest>,
    /// Where candidates are tied and no test within reach separates them: so much in words.
    pub no_next_test: Option<String>,
    /// Where something is unexplained: the force that would explain it, and a formula fitted to it.
    pub unexplained: Option<Unexplained>,
    /// Strength of each candidate that would have been seen, where nothing is missing: name and value with unit.
    pub would_have_been_seen: Vec<String>,
}

/// What a step of the search took.
#[derive(Clone, Copy, Debug, Default, Serialize, schemars::JsonSchema)]
pub struct Effort {
    /// Effects at places with their shapes that the score test weighed.
    pub trials: usize,
    /// Time of the score test [s].
    pub score_s: f64,
    /// Candidates refitted.
    pub refits: usize,
    /// Time of the refits [s].
    pub refits_s: f64,
}

/// One rung of a ladder.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Rung {
    /// Effect added; none on the first rung.
    pub added: Option<EffectAt>,
    /// Nats that it gained on the rung before beyond its price; none where it came in exchange for another.
    pub nats: Option<f64>,
    /// Effects pruned.
    pub removed: Vec<EffectAt>,
    /// Tests after the refit; held-out tests stand only on the first and last rung.
    pub tests: Vec<TestResult>,
    /// Parameters after the refit.
    pub parameters: Vec<ParameterResult>,
    /// Effects of the model.
    pub effects: Vec<EffectAt>,
    /// Candidates weighed on top of this rung.
    pub candidates: Vec<Candidate>,
    /// What all of them at once say.
    pub second_opinion: SecondOpinion,
    /// What weighing them took.
    pub effort: Effort,
    /// Termination of the refit.
    pub termination: String,
    /// Cost after the refit, under the variances of this rung's own model: that of another rung counts in other units.
    pub cost: f64,
    /// What instruments read wrong by this model, beyond what they may err by.
    pub readings: Vec<Reading>,
}

/// A missing effect with what it cannot be told from.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct Missing {
    /// Name of the effect.
    pub effect: String,
    /// Place.
    pub at: String,
    /// Of a coefficient, the parameter that it acts on: `film.f`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// `effect at place` of the tied.
    pub tied_with: Vec<String>,
    /// Whether the held-out tests bear it out beside what else was added; none where there are none.
    pub proven: Option<bool>,
}

impl std::fmt::Display for Missing {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        EffectAt { effect: self.effect.clone(), at: self.at.clone(), of: self.of.clone() }.fmt(f)
    }
}

/// Pooled error of the held-out tests.
#[derive(Clone, Copy, Debug, Serialize, schemars::JsonSchema)]
pub struct HeldOut {
    /// On the first rung.
    pub before: Option<f64>,
    /// On the last.
    pub after: Option<f64>,
    /// Floor.
    pub floor: Option<f64>,
}

/// Result of `ladder`.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct LadderResult {
    /// Name of the study.
    pub study: String,
    /// Effects beyond the study with which the first rung began: those of the model that it was climbed from.
    pub began_with: Vec<EffectAt>,
    /// Rungs.
    pub rungs: Vec<Rung>,
    /// Verdict.
    pub verdict: Verdict,
    /// Whether the held-out tests bear out what was added: their density rises and their error falls.
    pub proven: bool,
    /// Why, in words.
    pub why: String,
    /// Physics added that stayed, what costs most to leave out first.
    pub missing: Vec<Missing>,
    /// Instruments at fault.
    pub instruments: Vec<Instrument>,
    /// What the study ties or fixes and the data do not.
    pub corrections: Vec<Correction>,
    /// Error of the last model on the held-out tests, relative to the response, beside noise and scatter; on the fitted tests where none is held out.
    pub remainder: f64,
    /// The model's own error, channel by channel.
    pub model_error: Vec<OwnError>,
    /// How much strengths differ from test to test.
    pub scatter: Vec<ScatterOf>,
    /// True noise over that seen between cycles or stated; below 1 no finding (see [`FitResult::noise`]).
    pub noise: f64,
    /// Constants of the search.
    pub settings: Settings,
    /// Whether a model error is left that is seen beside the noise.
    pub unexplained_remainder: bool,
    /// Where something is unexplained: the force that would explain it, and a formula fitted to it.
    pub unexplained: Option<Unexplained>,
    /// Root mean square of the whitened residuals on the fit and select tests at the end, under the noise alone; none where the search was stopped.
    pub whitened_rms: Option<f64>,
    /// Strength of each candidate that would have been seen, where nothing more is missing: name and value with unit.
    pub would_have_been_seen: Vec<String>,
    /// Held-out error, read once.
    pub held_out: HeldOut,
    /// Findings on the last rung.
    pub findings: Vec<Finding>,
    /// Test that separates the tied.
    pub next_test: Option<NextTest>,
    /// Where candidates are tied and no test within reach separates them: so much in words.
    pub no_next_test: Option<String>,
    /// Why the ladder ended, in words.
    pub ended: String,
    /// Whether it was stopped: what was not found says nothing then.
    pub interrupted: bool,
    /// Wall time [s].
    pub wall_s: f64,
    /// Folder of the resulting study.
    pub result_study: Option<String>,
}

impl LadderResult {
    /// Whether what was added takes away all of the misfit that is seen, and the held-out tests do not say that it is there: nothing is left that a law
    /// would be missing for.
    pub fn undecided(&self) -> bool {
        let explained = !self.unexplained_remainder && self.unexplained.is_none();
        self.verdict == Verdict::Unexplained && !self.proven && !self.missing.is_empty() && explained
    }
}
