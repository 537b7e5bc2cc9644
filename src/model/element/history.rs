//! What elements do without motion, and what they keep of the last two steps where the length of the step changes.

use super::{Element, ForcePiece};

impl Element {
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
