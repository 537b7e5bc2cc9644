//! Secants of the map from the start of a cycle to its end, and the start of the next cycle by them.
//!
//! A cycle maps its start `x` to its end `P(x)`. Two cycles give a secant: the difference `u` of their starts and the difference `v = M u`
//! of their ends, with the monodromy matrix `M`. With `f = P(x) - x` the weights `g` make `|f - sum g_i (v_i - u_i)|` least, and the next
//! start is `P(x) - sum g_i v_i` (multisecant Anderson acceleration: Fang and Saad, Numer. Linear Algebra Appl. 16 (2009) 197). What
//! never decays, a slider that stays stuck, has no part in the differences and keeps what the loading path left.

use nalgebra::DVector;

/// Part of `u` below which `v - u` is what earlier secants, or rounding, leave of it.
const LEAST: f64 = 1e-6;

/// Secants with orthonormal `v - u`: that, `v`, and the difference of the readings over the cycle.
pub(super) struct Secants {
    all: Vec<[DVector<f64>; 3]>,
    largest: f64,
}

/// A cycle: start, end, readings.
#[derive(Clone)]
pub(super) struct Pass {
    pub start: DVector<f64>,
    pub end: DVector<f64>,
    pub readings: DVector<f64>,
}

impl Pass {
    /// What it changes.
    pub fn change(&self) -> DVector<f64> {
        &self.end - &self.start
    }
}

impl Secants {
    /// None yet. Those whose `|v|` is beyond `largest` per length of `v - u` are left out: with a decay by less than one part in `largest` per
    /// cycle they say more of rounding, or of what is not linear, than of decay.
    pub fn within(largest: f64) -> Self {
        Secants { all: vec![], largest }
    }

    /// Number of secants.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// The secant of two cycles, as far as it is none of those at hand.
    pub fn add(&mut self, before: &Pass, after: &Pass) {
        let u = &after.start - &before.start;
        let size = u.norm();
        if size == 0.0 || !size.is_finite() {
            return;
        }
        let v = &after.end - &before.end;
        let mut new = [(&v - &u) / size, v / size, (&after.readings - &before.readings) / size];
        // Twice: once leaves what rounding makes of nearly parallel secants.
        for _ in 0..2 {
            for old in &self.all {
                let share = old[0].dot(&new[0]);
                new.iter_mut().zip(old).for_each(|(new, old)| new.axpy(-share, old, 1.0));
            }
        }
        let rest = new[0].norm();
        if rest > LEAST && new[1].norm() <= self.largest * rest {
            self.all.push(new.map(|x| x / rest));
        }
    }

    /// The cycle that the secants make of this one: its change is the least, its end the next start.
    pub fn combined(&self, pass: &Pass) -> Pass {
        let change = pass.change();
        let (mut rest, mut end, mut readings) = (change.clone(), pass.end.clone(), pass.readings.clone());
        for [d, v, y] in &self.all {
            let weight = d.dot(&change);
            rest.axpy(-weight, d, 1.0);
            end.axpy(-weight, v, 1.0);
            readings.axpy(-weight, y, 1.0);
        }
        Pass { start: &end - rest, end, readings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An affine map with the rates 0.97, -0.4, 0.2 and 0, and a component that keeps what it was: the limit of `(1, 2, -1, 7, .)`.
    fn pass(start: &DVector<f64>) -> Pass {
        let x = start;
        let limit = [1.0, 2.0, -1.0, 0.5];
        let y: Vec<f64> = (0..4).map(|k| x[k] - limit[k]).collect();
        let moved = [0.97 * y[0] + 0.1 * y[1], -0.4 * y[1], 0.2 * y[2] + 0.3 * y[0], 0.0];
        let end = DVector::from_iterator(5, (0..5).map(|k| if k < 4 { limit[k] + moved[k] } else { x[k] }));
        let readings = DVector::from_vec(vec![x[0] + 2.0 * x[1] - x[2], x[3] + 3.0]);
        Pass { start: x.clone(), end, readings }
    }

    #[test]
    fn as_many_secants_as_rates_give_the_limit_and_its_readings_and_keep_what_does_not_decay() {
        // Two columns: each serves the other.
        let mut at = [DVector::from_vec(vec![4.0, -1.0, 0.0, 3.0, 7.0]), DVector::from_vec(vec![0.0, 0.0, 3.0, 1.0, -2.0])];
        let mut secants = Secants::within(1000.0);
        let mut last: Vec<Pass> = vec![];
        let mut cycles = 0;
        let found = loop {
            let now: Vec<Pass> = at.iter().map(pass).collect();
            last.iter().zip(&now).for_each(|(a, b)| secants.add(a, b));
            let combined: Vec<Pass> = now.iter().map(|p| secants.combined(p)).collect();
            cycles += 1;
            if combined.iter().all(|p| p.change().amax() < 1e-10) || cycles == 20 {
                break combined;
            }
            at = [combined[0].end.clone(), combined[1].end.clone()];
            last = now;
        };
        assert_eq!(cycles, 3);
        for (p, kept) in found.iter().zip([7.0, -2.0]) {
            let limit = DVector::from_vec(vec![1.0, 2.0, -1.0, 0.5, kept]);
            assert!((&p.end - &limit).amax() < 1e-8, "{}", p.end);
            assert!((&p.readings - DVector::from_vec(vec![6.0, 3.5])).amax() < 1e-8, "{}", p.readings);
        }
    }

    #[test]
    fn what_does_not_move_grows_or_is_no_number_gives_no_secant() {
        let of = |start: f64, end: f64| Pass {
            start: DVector::from_element(2, start),
            end: DVector::from_element(2, end),
            readings: DVector::zeros(0),
        };
        let mut secants = Secants::within(30.0);
        secants.add(&of(1.0, 2.0), &of(1.0, 3.0));
        // Equal steps without end, a decay of a hundredth, no number.
        secants.add(&of(0.0, 1.0), &of(1.0, 2.0));
        secants.add(&of(0.0, 1.0), &of(1.0, 1.99));
        secants.add(&of(0.0, 1.0), &of(f64::NAN, 1.0));
        assert_eq!(secants.len(), 0);
        secants.add(&of(0.0, 1.0), &of(1.0, 1.9));
        assert!((secants.combined(&of(1.0, 1.9)).end[0] - 10.0).abs() < 1e-9);
    }
}
