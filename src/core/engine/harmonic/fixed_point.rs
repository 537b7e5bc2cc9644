//! Small linear systems `(I - M) d = b` of a periodic state, without allocation after the first call.

use super::aft::PERIODIC;

/// Working memory of the elimination.
#[derive(Default)]
pub(super) struct FixedPoint {
    a: Vec<f64>,
    pivot_of: Vec<Option<usize>>,
    row_used: Vec<bool>,
    solution: Vec<f64>,
}

/// Pivots of `I - M`, in scaled states, at or below this are directions that never decay.
const CUT: f64 = 1e-9;

impl FixedPoint {
    /// Solves in place for `columns` right-hand sides stored by rows; states carry their `scale`. Directions that never decay are left
    /// out (their part of the solution is 0).
    pub fn solve(&mut self, monodromy: &[f64], scale: &[f64], b: &mut [f64], columns: usize) {
        let n = scale.len();
        self.load(monodromy, scale);
        for (i, s) in scale.iter().enumerate() {
            b[i * columns..(i + 1) * columns].iter_mut().for_each(|v| *v /= s);
        }
        self.eliminate(n, b, columns);
        self.solution.clear();
        self.solution.resize(n * columns, 0.0);
        for (j, scale) in scale.iter().enumerate() {
            let Some(r) = self.pivot_of[j] else { continue };
            let weight = scale / self.a[r * n + j];
            for c in 0..columns {
                self.solution[j * columns + c] = b[r * columns + c] * weight;
            }
        }
        b.copy_from_slice(&self.solution);
    }

    /// Whether some direction returns unchanged after a cycle.
    pub fn never_decays(&mut self, monodromy: &[f64], scale: &[f64]) -> bool {
        !self.decays_by(monodromy, scale, 0.0)
    }

    /// Whether every direction loses this part of itself in a cycle.
    pub fn decays_by(&mut self, monodromy: &[f64], scale: &[f64], part: f64) -> bool {
        let n = scale.len();
        self.load(monodromy, scale);
        self.eliminate(n, &mut [], 0);
        self.pivot_of.iter().enumerate().all(|(c, row)| row.is_some_and(|r| self.a[r * n + c].abs() > part))
    }

    fn load(&mut self, monodromy: &[f64], scale: &[f64]) {
        let n = scale.len();
        self.a.clear();
        for (i, si) in scale.iter().enumerate() {
            self.a.extend(scale.iter().enumerate().map(|(j, sj)| f64::from(i == j) - monodromy[i * n + j] * sj / si));
        }
        self.pivot_of.clear();
        self.pivot_of.resize(n, None);
        self.row_used.clear();
        self.row_used.resize(n, false);
    }

    /// Gauss-Jordan elimination with complete pivoting, until no pivot is above the cut.
    fn eliminate(&mut self, n: usize, b: &mut [f64], columns: usize) {
        for _ in 0..n {
            let (mut best, mut at) = (CUT, None);
            for r in (0..n).filter(|&r| !self.row_used[r]) {
                for c in (0..n).filter(|&c| self.pivot_of[c].is_none()) {
                    if self.a[r * n + c].abs() > best {
                        (best, at) = (self.a[r * n + c].abs(), Some((r, c)));
                    }
                }
            }
            let Some((pr, pc)) = at else { return };
            self.row_used[pr] = true;
            self.pivot_of[pc] = Some(pr);
            for r in (0..n).filter(|&r| r != pr) {
                let factor = self.a[r * n + pc] / self.a[pr * n + pc];
                if factor == 0.0 {
                    continue;
                }
                (0..n).for_each(|c| self.a[r * n + c] -= factor * self.a[pr * n + c]);
                (0..columns).for_each(|c| b[r * columns + c] -= factor * b[pr * columns + c]);
            }
        }
    }
}

/// States after another cycle to the limit of a geometric approach.
pub(super) fn extrapolate(s: &mut [f64], first: &[f64], second: &[f64]) {
    for (s, (first, second)) in s.iter_mut().zip(first.iter().zip(second)) {
        let (before, last) = (second - first, *s - second);
        let ratio = last / before;
        if before != 0.0 && ratio.abs() < 1.0 && last.abs() > PERIODIC * s.abs() {
            *s += last * ratio / (1.0 - ratio);
        }
    }
}
