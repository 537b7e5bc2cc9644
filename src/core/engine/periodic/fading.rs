//! Where the states that only fade stand in a cycle that repeats.
//!
//! The branches of a viscoelastic law take up the increments of the motion and fade: over a cycle of `N` steps a state goes from `s` to `A s + b` with
//! `A = a^N`. In a motion that repeats it stands at `b / (1 - A)`, which one cycle tells, however slowly it fades; marched there it takes as many cycles as
//! its time is longer than a period. What the motion has not come back by in this cycle, `d`, is taken for a steady drift, which a repeating motion does
//! not have: `d c / (N (1 - a))` with the part `c` that the state takes of an increment. Sensitivities are columns of the same map.

use crate::engine::march::{March, Probe, State};
use crate::model::Fading;

/// The states of one place that fade.
struct Place {
    place: usize,
    /// First state of its element among all.
    first: usize,
    states: Vec<Fading>,
}

/// All of them.
pub(super) struct Fades {
    places: Vec<Place>,
    steps: f64,
}

impl Fades {
    pub fn of(march: &March, steps: usize) -> Fades {
        let places = march.fading().into_iter().map(|(place, first, states)| Place { place, first, states });
        Fades { places: places.collect(), steps: steps as f64 }
    }

    /// The end of a cycle from `start`, its fading states and `columns` sensitivities of each where they stand once the cycle repeats.
    pub fn repeated(&self, march: &March, start: &State, end: &State, columns: usize) -> State {
        let mut repeated = end.clone();
        let (mut before, mut after) = (vec![0.0; columns], vec![0.0; columns]);
        for Place { place, first, states } in &self.places {
            let relative = Probe::Relative(*place);
            let drift = march.read(relative, end, &mut after) - march.read(relative, start, &mut before);
            for fading in states {
                let (k, rate) = (first + fading.state, fading.kept.ln());
                let lost = -(self.steps * rate).exp_m1();
                let drifts = fading.takes / (self.steps * -rate.exp_m1());
                let stands = |s: f64, e: f64, drift: f64| (e - (1.0 - lost) * s) / lost - drifts * drift;
                repeated.s[k] = stands(start.s[k], end.s[k], drift);
                for c in 0..columns {
                    let at = k * columns + c;
                    repeated.ds[at] = stands(start.ds[at], end.ds[at], after[c] - before[c]);
                }
            }
        }
        repeated
    }
}
