//! What a race has left: weighed with variances of its own.

use std::ops::Deref;

use super::candidates::Name;
use super::refit::Refit;
use super::step::{Against, Price, Stood, promised};
use crate::diagnose::calibrate::weigh::{Promised, Weighed};
use crate::diagnose::results::Reason;
use crate::diagnose::trace;
use crate::evidence::Variances;
use crate::model::System;
use crate::parallel;

/// What refits are held against.
pub(in crate::diagnose) struct Held<'a> {
    pub against: &'a Against<'a>,
    pub names: &'a [Name],
    pub price: &'a Price<'a>,
    /// Cost of the model without any of them.
    pub cost: f64,
    /// Variances of that where strengths do not scatter.
    pub from: &'a Variances,
}

impl Held<'_> {
    /// Whether a refit gains less, by a tie, than something else does here that is no candidate.
    pub fn beaten(&self, refit: &Refit) -> bool {
        let Against { scale, base, rival, monitor, .. } = self.against;
        let Some((rival, proof)) = rival.zip(refit.result.as_ref().ok()) else { return false };
        let weighed = scale.weigh(&proof.fitted.system, self.from, monitor);
        weighed.is_ok_and(|w| scale.gain(&w, base, self.price.tried(refit.candidate)) + scale.settings.tie < rival)
    }
}

/// Refits that are held against it.
pub(in crate::diagnose) struct Survivors<'a> {
    pub held: &'a Held<'a>,
    pub refits: &'a [Refit],
}

impl<'a> Deref for Survivors<'a> {
    type Target = Held<'a>;

    fn deref(&self) -> &Held<'a> {
        self.held
    }
}

/// A refit that is weighed.
struct Weighing {
    refit: usize,
    /// As it stands, then as it was fitted.
    model: Result<Weighed, String>,
    /// Nats that it may gain at most.
    most: f64,
}

impl Survivors<'_> {
    /// Those that may gain, the most worth first, and what was decided of every refit. `cut`: the time for refits ended before they did.
    pub fn weighed(&self, cut: bool) -> (Vec<Stood>, Vec<Reason>) {
        let mut reasons = self.left_out(cut);
        let open: Vec<usize> = (0..self.refits.len()).filter(|k| reasons[*k].is_none()).collect();
        let mut list: Vec<Weighing> = parallel::map(&open, |k| self.standing(*k));
        list.sort_by(|a, b| b.most.total_cmp(&a.most));
        self.fit(&mut list);
        let mut stood = Vec::new();
        for w in list {
            let (at, (reason, found)) = (w.refit, self.judged(w));
            reasons[at] = Some(reason);
            stood.extend(found);
        }
        stood.sort_by(|a, b| self.against.scale.worth(&b.weighed).total_cmp(&self.against.scale.worth(&a.weighed)));
        (stood, reasons.into_iter().map(|r| r.unwrap_or(Reason::NotTried)).collect())
    }

    /// Whether one of them may gain under variances of its own. What could not be fitted says nothing.
    pub fn any_may_gain(&self) -> bool {
        let least = -self.against.scale.settings.tie;
        let gains = |k: &usize| self.standing(*k).most >= least;
        let open: Vec<usize> = (0..self.refits.len()).filter(|k| self.refits[*k].result.is_ok()).collect();
        // Where something is missing, what leads the race is it as a rule.
        open.split_first().is_some_and(|(first, others)| gains(first) || parallel::map(others, gains).contains(&true))
    }

    /// Part of the cost that a refit takes away.
    fn fall(&self, k: usize) -> f64 {
        self.refits[k].result.as_ref().map_or(0.0, |p| 1.0 - p.fitted.outcome.cost / self.cost.max(f64::MIN_POSITIVE))
    }

    /// Why refits are not weighed; none for those that are.
    fn left_out(&self, cut: bool) -> Vec<Option<Reason>> {
        let (a, price) = (self.against, self.price);
        let nats = |k: usize| promised(price.squares, self.fall(k));
        let best = (0..self.refits.len()).map(nats).fold(0.0, f64::max);
        let of = |k: usize| -> Option<Reason> {
            let (r, fall) = (&self.refits[k], self.fall(k));
            match &r.result {
                Err(_) if cut || trace::stopped(a.monitor) => Some(Reason::Interrupted),
                Err(why) => Some(Reason::Failed { why: why.clone() }),
                Ok(_) if !price.promises(r.candidate, fall) => Some(price.left_out(r.candidate, fall)),
                // Beside what already gains so much, with the variances of the model without either, it cannot come first.
                Ok(_) if price.bound(r.candidate, fall) < best - a.scale.settings.tie => Some(Reason::Behind { nats: best - nats(k) }),
                Ok(_) => None,
            }
        };
        let mut reasons: Vec<Option<Reason>> = (0..self.refits.len()).map(of).collect();
        let size = |k: usize| self.refits[k].result.as_ref().map_or(0, |p| p.fitted.free.len());
        let worth = |k: usize| reasons[k].is_none().then(|| nats(k) - 0.5 * size(k) as f64 * a.scale.counts.n.ln());
        let worth: Vec<Option<f64>> = (0..self.refits.len()).map(worth).collect();
        for k in behind(&worth, a.scale.settings.weighed, a.scale.settings.tie) {
            reasons[k] = Some(Reason::NotTried);
        }
        reasons
    }

    /// A refit as it stands under variances of its own, and what a fit under these may add; or the effect as it was refitted beside the model's own
    /// parameters as they are without it, where that is likelier: a race takes what strengths scatter between tests for error, and may lead them astray.
    fn standing(&self, k: usize) -> Weighing {
        let scale = self.against.scale;
        let failed = |why: &String| Weighing { refit: k, model: Err(why.clone()), most: f64::NEG_INFINITY };
        let promised = match &self.refits[k].result {
            Ok(proof) => proof.stands.get_or_init(|| {
                let at = |system: &System| scale.promised_about(system, &self.start(k), self.against.monitor);
                let (raced, beside) = (at(&proof.fitted.system), self.beside(k).map(|system| at(&system)));
                let likelier = |of: &Promised| raced.as_ref().is_ok_and(|raced| of.stands.likelihood > raced.stands.likelihood);
                match beside.and_then(Result::ok).filter(likelier) {
                    Some(beside) => Ok(beside),
                    None => raced,
                }
            }),
            Err(why) => return failed(why),
        };
        match promised {
            Ok(Promised { stands, step }) => {
                let most = self.gain(k, stands) + scale.settings.reach * step;
                Weighing { refit: k, model: Ok(stands.clone()), most }
            }
            Err(why) => failed(why),
        }
    }

    /// The model without a candidate, and this as it was refitted.
    fn beside(&self, k: usize) -> Option<System> {
        let (own, base) = (self.refits[k].result.as_ref().ok()?, &self.against.base.fitted.system);
        let instances = &own.fitted.system.instances;
        (instances.len() == base.instances.len() + 1).then(|| base.with(base.instances.len(), instances[base.instances.len()..].to_vec()))
    }

    /// Fits what may gain most, then the others that may come within a tie of it, but for the price of their parameters ([`crate::diagnose::calibrate::weigh::Tied::Larger`]);
    /// none that stays below nothing by a tie.
    fn fit(&self, list: &mut [Weighing]) {
        let tie = self.against.scale.settings.tie;
        let mut least = -tie;
        let first = list.len().min(1);
        let size = |w: &Weighing| w.model.as_ref().map_or(0, Weighed::size);
        let smallest = list.iter().filter(|w| w.model.is_ok()).map(size).min().unwrap_or(0);
        let price = |w: &Weighing| 0.5 * (size(w) - smallest) as f64 * self.against.scale.counts.n.ln();
        for part in [0..first, first..list.len()] {
            let near: Vec<usize> =
                part.filter(|n| list[*n].model.is_ok() && list[*n].most >= -tie && list[*n].most + price(&list[*n]) >= least).collect();
            let fitted = parallel::map(&near, |n| self.fitted(&list[*n]));
            for (n, model) in near.into_iter().zip(fitted) {
                least = model.as_ref().map_or(least, |w| least.max(self.gain(list[n].refit, w) - tie));
                list[n].model = model;
            }
        }
    }

    fn fitted(&self, w: &Weighing) -> Result<Weighed, String> {
        let stands = w.model.as_ref().map_err(Clone::clone)?;
        self.against.scale.weigh(&stands.fitted.system, &self.start(w.refit), self.against.monitor)
    }

    fn judged(&self, w: Weighing) -> (Reason, Option<Stood>) {
        let weighed = match w.model {
            Err(_) if trace::stopped(self.against.monitor) => return (Reason::Interrupted, None),
            Err(why) => return (Reason::Failed { why }, None),
            Ok(weighed) => weighed,
        };
        let (nats, fault) = (self.gain(w.refit, &weighed), self.against.scale.contradicted(&weighed));
        let name = self.names[self.refits[w.refit].candidate].clone();
        let reason = match fault {
            Some(fault) => Reason::NotInRecord { fault },
            None if nats > 0.0 => Reason::Gains { nats },
            None => Reason::TooLittle { nats },
        };
        (reason, Some(Stood { name, weighed, gain: nats, admissible: fault.is_none() }))
    }

    fn gain(&self, k: usize, w: &Weighed) -> f64 {
        self.against.scale.gain(w, self.against.base, self.price.tried(self.refits[k].candidate))
    }

    /// Variances from which a refit's own are estimated: those of the model without it, the error in proportion to what is left.
    fn start(&self, k: usize) -> Variances {
        let mut start = self.from.clone();
        start.tau += 0.5 * (1.0 - self.fall(k)).max(f64::EPSILON).ln();
        start
    }
}

/// Which of these, by what a race promises each of them, stand behind the first `most` and are worth less than the first by more than a tie: those within one
/// are as likely as the first, however many they are.
fn behind(worth: &[Option<f64>], most: usize, tie: f64) -> Vec<usize> {
    let mut order: Vec<(usize, f64)> = worth.iter().enumerate().filter_map(|(k, w)| Some((k, (*w)?))).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let first = order.first().map_or(0.0, |o| o.1);
    order.into_iter().skip(most).filter(|o| o.1 < first - tie).map(|o| o.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_is_tied_with_the_first_is_weighed() {
        let worth = [Some(3.0), None, Some(9.5), Some(10.0), Some(8.6), Some(8.4), Some(1.0)];
        assert_eq!(behind(&worth, 2, 1.5), [5, 0, 6]);
        assert_eq!(behind(&worth, 5, 1.5), [6], "no more than so many of the others");
        assert!(behind(&worth, 6, 1.5).is_empty() && behind(&[None, None], 0, 1.5).is_empty());
    }
}
