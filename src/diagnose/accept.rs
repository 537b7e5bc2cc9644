//! When an effect has earned its place, and when two cannot be told apart.

use super::refit::{Proof, Whitened, cost};

/// Points per chunk at least: neighbouring residuals are not independent, their chunk means nearly are.
const CHUNKS: usize = 12;
/// Standard errors by which the improvement must exceed zero.
pub const STANDARD_ERRORS: f64 = 2.0;

/// The same where the model without an effect is at the noise, if neighbours did not depend on each other, and the standard errors over
/// chunks that are asked for beside it.
const SURE: f64 = 3.0;
const AT_LEAST: f64 = 1.0;

/// Root mean square of whitened residuals up to which a model is at the floor, where chance does not already reach beyond it: so many
/// standard deviations of a sum of squares.
const AT_FLOOR: f64 = 1.1;
const CHANCE: f64 = 3.1;
/// Root mean square of whitened residuals from which a model is far from the noise.
const FAR: f64 = 3.0;

/// Whether this root mean square of so many whitened residuals is noise.
pub fn at_floor((rms, n): (f64, usize)) -> bool {
    rms * rms < (AT_FLOOR * AT_FLOOR).max(1.0 + CHANCE * (2.0 / n.max(1) as f64).sqrt())
}

/// Root mean square of whitened residuals and their number.
pub fn rms(w: &Whitened) -> (f64, usize) {
    let n: usize = w.iter().map(Vec::len).sum();
    ((2.0 * cost(w) / n.max(1) as f64).sqrt(), n)
}

/// Whether a root mean square of whitened residuals is far from the noise.
pub fn far(rms: f64) -> bool {
    rms > FAR
}

/// Mean improvement of the squared whitened residual and its standard error, paired over chunks of every test.
pub fn improvement(before: &Whitened, after: &Whitened) -> (f64, f64) {
    paired(before, after, |b, a| b - a)
}

/// The improvement on the tests that decide: the select tests, the fit tests where there are none.
pub fn improved(before: &Proof, after: &Proof) -> (f64, f64) {
    match after.select.is_empty() {
        true => improvement(&before.fit, &after.fit),
        false => improvement(&before.select, &after.select),
    }
}

/// Whether these tests cannot decide: they neither object to an effect, nor does it move their responses by so much that, were it true, their
/// improvement would exceed two standard errors. (A true effect improves the mean square by the mean square of what it moves.)
pub fn undecided(before: &Whitened, after: &Whitened) -> bool {
    let (mean, error) = improvement(before, after);
    mean >= -STANDARD_ERRORS * error && moved(before, after) < STANDARD_ERRORS * error * rms(before).1.max(1) as f64
}

/// Sum of squares of what an effect moves.
fn moved(before: &Whitened, after: &Whitened) -> f64 {
    before.iter().flatten().zip(after.iter().flatten()).map(|(b, a)| (b - a).powi(2)).sum()
}

/// By how many standard deviations the sum of squares falls by more than it would for an effect that is not there. What moves a model at the
/// noise by `M`, as a sum of squares, then raises it by `M +- 2 sqrt(M)`, and lowers it by as much where the effect is there. `None`
/// where the model is not at the noise: what else it misses has no such scatter.
fn against_the_noise(before: &Whitened, after: &Whitened) -> Option<f64> {
    let moved = moved(before, after);
    let known = at_floor(rms(before)) && moved > 0.0;
    known.then(|| (2.0 * (cost(before) - cost(after)) + moved) / (2.0 * moved.sqrt()))
}

/// Mean and standard error of a comparison of the mean squares of every chunk.
fn paired(before: &Whitened, after: &Whitened, gain: impl Fn(f64, f64) -> f64) -> (f64, f64) {
    let mut gains = Vec::new();
    for (b, a) in before.iter().zip(after) {
        let size = b.len().div_ceil(CHUNKS).max(1);
        for (b, a) in b.chunks(size).zip(a.chunks(size)) {
            let mean = |w: &[f64]| w.iter().map(|r| r * r).sum::<f64>() / w.len() as f64;
            gains.push(gain(mean(b), mean(a)));
        }
    }
    let n = gains.len() as f64;
    if n < 2.0 {
        return (gains.first().copied().unwrap_or(0.0), f64::INFINITY);
    }
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Whether the improvement on the tests that decide exceeds two standard errors, as a difference or as a ratio: an effect that rules one
/// resonance and leaves the next alone improves its chunks by very unlike amounts, but none for the worse.
pub fn earns_its_place(before: &Whitened, after: &Whitened) -> bool {
    let (mean, error) = improvement(before, after);
    // A residual below the noise is as good as one at the noise.
    let (ratio, spread) = paired(before, after, |b, a| (b.max(1.0) / a.max(1.0)).ln());
    // A perfect improvement in every chunk has no scatter to measure it by.
    mean > 0.0 && (mean > STANDARD_ERRORS * error || ratio > STANDARD_ERRORS * spread)
}

/// Whether tests that a model without an effect fits to the noise show it all the same: its improvement exceeds one standard error over the
/// chunks, and is far beyond the scatter that noise has.
pub fn seen_in_noise(before: &Whitened, after: &Whitened) -> bool {
    let (mean, error) = improvement(before, after);
    mean > AT_LEAST * error && against_the_noise(before, after).is_some_and(|z| z > SURE)
}

/// What a candidate costs on all tests it may be judged on: half the sum of squares on fit and select, and for each free parameter half
/// the logarithm of the number of points (Schwarz, Ann. Statist. 6, 1978).
pub fn verdict_cost(proof: &Proof) -> f64 {
    let points: usize = proof.fit.iter().chain(&proof.select).map(Vec::len).sum();
    cost(&proof.fit) + cost(&proof.select) + 0.5 * (points.max(1) as f64).ln() * proof.fitted.free.len() as f64
}

/// Cost difference up to which responses that agree within the noise on every test are not told apart; beyond it the many points
/// together decide.
pub const DECISIVE: f64 = 8.0;

/// Whether the data cannot tell a candidate from the best: on every planned test their responses differ by less than the noise and the
/// costs by less than [`DECISIVE`]; or the costs differ by less than the noise in a cost difference explains, or by a hundredth where
/// neither fits.
pub fn tied(best: &Proof, other: &Proof) -> bool {
    let (a, b) = (verdict_cost(best), verdict_cost(other));
    let points: usize = best.fit.iter().chain(&best.select).map(Vec::len).sum();
    let above_noise = (2.0 * a / points.max(1) as f64 - 1.0).max(0.0);
    let apart = (b - a).abs();
    apart <= 3.0 + 0.01 * above_noise.min(1.0) * a
        || (apart <= DECISIVE && alike(&best.fit, &other.fit) && alike(&best.select, &other.select))
}

/// Whether two sets of responses differ by less than the noise on every test: the whitened residuals have the measurement in common.
fn alike(a: &Whitened, b: &Whitened) -> bool {
    a.iter().zip(b).all(|(a, b)| {
        let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        square < a.len() as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One test of 240 residuals: noise of no law, and a sine of amplitude `a` that an effect takes away or brings.
    fn test(a: f64) -> Whitened {
        let noise = |k: f64| (12.9898 * k).sin() * 1.2 + (78.233 * k * k).cos() * 0.9;
        vec![(0..240).map(|k| noise(f64::from(k)) + a * (0.1 * f64::from(k)).sin()).collect()]
    }

    #[test]
    fn tests_that_an_effect_hardly_moves_do_not_decide() {
        // Taken away: far below the noise, and beyond it.
        assert!(undecided(&test(0.02), &test(0.0)) && !earns_its_place(&test(0.0), &test(0.02)));
        assert!(!undecided(&test(2.0), &test(0.0)) && earns_its_place(&test(2.0), &test(0.0)));
        // Brought in: they object.
        assert!(!undecided(&test(0.0), &test(2.0)) && !earns_its_place(&test(0.0), &test(2.0)));
    }

    #[test]
    fn what_rules_a_sixth_of_the_points_is_seen_where_the_rest_is_noise() {
        let partly = |a: f64, rest: f64| -> Whitened {
            let (there, elsewhere) = (test(a), test(rest));
            vec![there[0][..40].iter().chain(&elsewhere[0][40..]).copied().collect()]
        };
        let (mean, error) = improvement(&partly(1.0, 0.0), &test(0.0));
        assert!(mean > error && mean < STANDARD_ERRORS * error, "{mean} +- {error}");
        assert!(seen_in_noise(&partly(1.0, 0.0), &test(0.0)) && !seen_in_noise(&test(0.0), &partly(1.0, 0.0)));
        // Beside what else the model misses it is not.
        assert!(!seen_in_noise(&partly(1.0, 4.0), &partly(0.0, 4.0)));
        // What moves nothing is nothing.
        assert!(against_the_noise(&test(0.0), &test(0.0)).is_none() && against_the_noise(&test(4.0), &test(0.0)).is_none());
    }
}
