//! Whether a ladder said what was true of a realistic case: the effects one by one, and whether its claims hold on the held-out tests.

use serde::{Deserialize, Serialize};

use crate::diagnose::results::{Curve, LadderResult, SplitName, Verdict};

use super::generate::Generated;
use super::life::{self, Imperfection};

/// Pieces of a held-out channel whose mean squares count as independent: longer than the noise is correlated (5 % of a cycle).
const PIECES: usize = 8;

/// What is judged of a realistic case beside what is judged of any.
#[derive(Clone, Debug, Default, PartialEq, Serialize, schemars::JsonSchema, Deserialize)]
pub struct Lived {
    /// The imperfection it has alone; none: all.
    pub only: Option<Imperfection>,
    /// Nonlinearity of the base, `effect at place`: right where it is named, and not asked for.
    pub quirks: Vec<String>,
    /// Strength of the weakest hidden effect [standard deviations].
    pub strength: f64,
    /// A hidden effect with its place comes first among the physics (of an instrument at fault: among the instruments).
    pub first_strict: bool,
    /// The same, declared ties counted.
    pub first_with_ties: bool,
    /// Hidden effects that are named, declared ties counted.
    pub found: usize,
    /// Physics named that is neither hidden nor a quirk, ties counted; of a law outside the library one name at its place is not wrong.
    pub wrong: Vec<String>,
    /// Instruments named that are not at fault beyond their tolerance.
    pub wrong_instruments: Vec<String>,
    /// Something is claimed: verdict `missing`, or `proven`.
    pub claimed: bool,
    /// Fall of the mean square of the held-out error relative to the response, first rung to last, and its standard error.
    pub fall: Option<(f64, f64)>,
    /// Error on the held-out tests of the true law, fitted, with the base as the study has it.
    pub truth_error: Option<f64>,
    /// Error on the held-out tests after the ladder over that.
    pub held_out_over_truth: Option<f64>,
    /// Corrections of the base that are named.
    pub corrections: Vec<String>,
    /// Model error left, relative to the response, and true noise over that seen or stated, as the ladder says.
    pub remainder: f64,
    /// See [`Lived::remainder`].
    pub noise: f64,
}

impl Lived {
    /// Something is claimed, and the held-out error did not fall by its standard error.
    pub fn unfounded(&self) -> bool {
        self.claimed && self.fall.is_some_and(|(fall, error)| fall <= error)
    }

    /// Judges what a ladder says. `truth`: `effect at place` of what is hidden.
    pub fn judge(made: &Generated, only: Option<Imperfection>, truth: &[String], ladder: &LadderResult) -> Lived {
        let quirks: Vec<String> = quirks(made);
        let name = |effect: &str, at: &str| format!("{effect} at {at}");
        let physics: Vec<(String, &[String])> = ladder.missing.iter().map(|m| (name(&m.effect, &m.at), m.tied_with.as_slice())).collect();
        let instruments: Vec<(String, &[String])> =
            ladder.instruments.iter().map(|m| (name(&m.effect, &m.at), m.tied_with.as_slice())).collect();
        let is = |said: &(String, &[String]), t: &String| said.0 == *t || said.1.contains(t);
        let among = if made.instrument.is_some() { &instruments } else { &physics };
        // A nonlinearity that the base has may stand before what was asked for.
        let hidden = |said: &&(String, &[String])| truth.iter().any(|t| is(said, t));
        let first = among.iter().find(|f| hidden(f) || !quirks.iter().any(|q| is(f, q)));
        let mut stand_ins: Vec<&str> = truth.iter().filter(|t| t.starts_with("outside:")).filter_map(|t| t.rsplit(" at ").next()).collect();
        let mut wrong = Vec::new();
        for said in &physics {
            let known = truth.iter().chain(&quirks).any(|t| is(said, t));
            let place = said.0.rsplit(" at ").next().unwrap_or_default();
            if let Some(at) = stand_ins.iter().position(|p| !known && *p == place) {
                stand_ins.remove(at);
            } else if !known {
                wrong.push(said.0.clone());
            }
        }
        let truth_error = life::floor(made);
        Lived {
            only,
            strength: made.noncentrality.sqrt(),
            first_strict: first.is_some_and(|f| truth.contains(&f.0)),
            first_with_ties: first.is_some_and(|f| truth.iter().any(|t| is(f, t))),
            found: truth.iter().filter(|t| physics.iter().chain(&instruments).any(|s| is(s, t))).count(),
            wrong_instruments: instruments.iter().filter(|i| !truth.iter().any(|t| is(i, t))).map(|i| i.0.clone()).collect(),
            wrong,
            quirks,
            claimed: !(physics.is_empty() && instruments.is_empty()) && (ladder.verdict == Verdict::Missing || ladder.proven),
            fall: fall(ladder),
            truth_error,
            held_out_over_truth: ladder.held_out.after.zip(truth_error).map(|(after, truth)| after / truth),
            corrections: ladder.corrections.iter().map(|c| format!("{} {:+.3} ({:.3})", c.parameter, c.relative, c.std)).collect(),
            remainder: ladder.remainder,
            noise: ladder.noise,
        }
    }
}

/// Nonlinearities of the base, `effect at place`.
pub fn quirks(made: &Generated) -> Vec<String> {
    made.life.iter().flat_map(|l| &l.quirks).map(|q| format!("{} at {}", q.effect, made.place(q))).collect()
}

/// How far the mean square of the held-out residuals, relative to the response, falls from the first rung to the last, and the standard
/// error of that, from the differences of the pieces.
fn fall(ladder: &LadderResult) -> Option<(f64, f64)> {
    let of = |rung: &crate::diagnose::results::Rung| -> Vec<Curve> {
        rung.tests.iter().filter(|t| t.split == SplitName::HeldOut).flat_map(|t| t.curves.clone()).collect()
    };
    let (first, last) = (of(ladder.rungs.first()?), of(ladder.rungs.last()?));
    fallen(&first, &last)
}

fn fallen(first: &[Curve], last: &[Curve]) -> Option<(f64, f64)> {
    let mut falls: Vec<f64> = Vec::new();
    for (a, b) in first.iter().zip(last).filter(|(a, b)| a.measured.len() == b.measured.len() && !a.measured.is_empty()) {
        let n = a.measured.len() as f64;
        let mean = a.measured.iter().sum::<f64>() / n;
        let power = a.measured.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / n;
        let square = |c: &Curve, j: usize| (c.measured[j] - c.computed[j]).powi(2) / power;
        let all: Vec<f64> = (0..a.measured.len()).map(|j| square(a, j) - square(b, j)).collect();
        falls.extend(all.chunks(all.len().div_ceil(PIECES)).map(|c| c.iter().sum::<f64>() / c.len() as f64));
    }
    let n = falls.len() as f64;
    let mean = falls.iter().sum::<f64>() / n;
    let error = (falls.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    (n > 1.0 && mean.is_finite() && error.is_finite()).then_some((mean, error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::response::BlockKind;

    fn curve(off: impl Fn(usize) -> f64) -> Curve {
        let measured: Vec<f64> = (0..64).map(|j| f64::from(j).sin()).collect();
        let computed = measured.iter().enumerate().map(|(j, m)| m + off(j)).collect();
        let empty = Vec::new;
        let (label, unit) = (String::new(), String::new());
        Curve { label, unit, kind: BlockKind::Loop, abscissa: empty(), x: empty(), v: empty(), measured, computed, sigma: empty() }
    }

    #[test]
    fn a_fall_is_held_against_its_pieces() {
        let (fall, error) = fallen(&[curve(|_| 0.5)], &[curve(|_| 0.1)]).unwrap();
        assert!(fall > 0.4 && error < 1e-9, "{fall} {error}");
        // What falls in one piece of eight and stays in the others falls by no more than its standard error.
        let (fall, error) = fallen(&[curve(|j| if j < 8 { 0.5 } else { 0.1 })], &[curve(|_| 0.1)]).unwrap();
        assert!(fall > 0.0 && fall <= 1.001 * error, "{fall} {error}");
        let lived = Lived { claimed: true, fall: Some((0.1, 0.1)), ..Lived::default() };
        assert!(lived.unfounded() && !Lived { claimed: false, ..lived }.unfounded());
        assert!(fallen(&[], &[]).is_none());
    }
}
