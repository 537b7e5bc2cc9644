//! Two candidates at once: what takes most of a sum of two for itself need be neither of them.

use super::accept::{DECISIVE, at_floor, rms, verdict_cost};
use super::refit::{Bench, Proof, Refit, WORTH_FREEING, proof};
use super::score::Score;
use super::trace;

/// Part of what the model misses, as an excess of squares over the noise, that the best candidate must leave for two to be tried at once.
const LEFT: f64 = 0.03;

impl Bench<'_> {
    /// Two candidates, the cheaper first, that together bring the fitted tests to the noise where the best of all leaves much of what the
    /// model misses; and what they prove together.
    pub fn pair(&self, before: &Proof, refits: &[Refit], pair: Option<[Score; 2]>) -> Option<([usize; 2], Proof)> {
        let [a, b] = pair.filter(|_| !trace::stopped(self.monitor))?;
        let best = refits.first()?.result.as_ref().ok()?;
        let square = |p: &Proof| rms(&p.fit).0.powi(2);
        if at_floor(rms(&best.fit)) || square(best) - 1.0 < LEFT * (square(before) - 1.0) {
            return None;
        }
        let at = |s: &Score| refits.iter().position(|r| r.candidate == self.trials[s.trial].candidate && r.result.is_ok());
        let found = [at(&a)?, at(&b)?];
        let both = self.both(&[a, b])?;
        let reaches = at_floor(rms(&both.fit)) && verdict_cost(&both) < verdict_cost(best) - DECISIVE;
        reaches.then(|| ([found[0].min(found[1]), found[0].max(found[1])], both))
    }

    /// Both fitted from their cheapest secant.
    fn both(&self, added: &[Score]) -> Option<Proof> {
        let mut fitted = [self.from(&self.together(added).ok()?.system)];
        let more_free = fitted[0].as_ref().ok().and_then(|f| self.freed(f));
        self.exchange(&mut fitted, vec![more_free.into_iter().collect()], WORTH_FREEING);
        let [fitted] = fitted;
        proof(self.case, fitted.ok()?).ok()
    }
}
