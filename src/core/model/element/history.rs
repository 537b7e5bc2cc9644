//! What elements do without motion, what of them fades whatever moves, and what they keep of the last two steps where the length of the step changes.

use super::{Element, ForcePiece};
use crate::model::recurrence::Recurrence;

/// A state that takes up the increments of the motion and fades: `s <- kept s + takes dx` in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fading {
    /// Index of the state.
    pub state: usize,
    /// Part that a step leaves of it.
    pub kept: f64,
    /// What it takes of an increment of the motion.
    pub takes: f64,
}

impl Element {
    /// States that do nothing but fade and take up increments of the motion, in steps of `dt` [s]: the branches of laws of linear viscoelasticity.
    pub fn fading(&self, dt: f64) -> Vec<Fading> {
        let of = |piece: &ForcePiece| {
            let r = Recurrence::new(piece.law, &self.p[piece.p.clone()], dt);
            let own = |row: usize| -> Option<Fading> {
                let mut entries = r.entries.iter().filter(|e| e.0 == row);
                let (Some(&(_, column, kept)), None, [x, v, a, takes]) = (entries.next(), entries.next(), r.input[row]) else {
                    return None;
                };
                let fades = column == row && kept > 0.0 && kept < 1.0 && [x, v, a] == [0.0; 3];
                fades.then_some(Fading { state: piece.s.start + row, kept, takes })
            };
            (0..piece.s.len()).filter_map(own).collect::<Vec<_>>()
        };
        self.forces.iter().filter(|f| f.recurs).flat_map(of).collect()
    }

    /// Whether a force acts here where nothing moves and nothing loads the structure.
    pub fn presses(&self) -> bool {
        self.forces.iter().any(|f| f.law.presses())
    }

    /// Takes what laws and openings keep of the last two steps to a step that is `ratio` times as long: the value before the last goes to
    /// where the line through both has it one such step ago, so that a rate that does not change stays what it is. `columns` numbers stand
    /// for each state in `s` and `fs`.
    pub fn uniform_history(&self, ratio: f64, columns: usize, s: &mut [f64], fs: &mut [f64]) {
        let of = |f: &ForcePiece| (0..f.law.looks_back()).map(|k| f.s.start + 2 * k).collect::<Vec<_>>();
        let own = self.opening.then_some(0).into_iter().chain(self.forces.iter().flat_map(of));
        move_back(own, ratio, columns, s);
        let followers = self.followers.iter().flat_map(of).chain(self.series.iter().filter_map(|p| p.follower));
        move_back(followers, ratio, columns, fs);
    }
}

/// Moves the second of each pair of states along the line through both; `pairs` are the indices of the first.
fn move_back(pairs: impl Iterator<Item = usize>, ratio: f64, columns: usize, s: &mut [f64]) {
    for at in pairs {
        for c in 0..columns {
            let (last, before) = (at * columns + c, (at + 1) * columns + c);
            if let (Some(a), Some(b)) = (s.get(last).copied(), s.get(before).copied()) {
                s[before] = a - ratio * (a - b);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use crate::model::{Axis, Body, Bound, Model, System};

    #[test]
    fn the_branches_of_a_viscoelastic_law_fade() {
        let body = |name: &str, free: Vec<Axis>| Body { name: name.into(), mass: 1.0, inertia: 0.0, free };
        let model = Model::joined(vec![body("ground", vec![]), body("m", vec![Axis::X])], &[("c", "ground", "m")]).unwrap();
        let system = System::new(model)
            .and("linear_stiffness", "c.x", &[("k", 500.0)])
            .and_then(|s| s.and("elastic_slip", "c.x", &[("f", 1.0), ("d", 1e-3)]))
            .and_then(|s| s.and("maxwell", "c.x", &[("k", 300.0), ("tau", 0.02)]))
            .unwrap();
        let bound = Bound::new(&system, &[], "t", &BTreeMap::new()).unwrap();
        let [only] = bound.elements[0].fading(1e-3)[..] else { panic!("one branch") };
        let kept = (-0.05f64).exp();
        assert!((only.kept - kept).abs() < 1e-14 && (only.takes - (1.0 - kept) / 0.05).abs() < 1e-12, "{only:?}");
    }
}
