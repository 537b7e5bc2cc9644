//! Candidates of the score test at an element, one by one.

use crate::effect::Inputs;

use super::{Element, ElementScratch, ForcePiece, SeriesPiece};

impl Element {
    /// Number of candidates.
    pub fn n_followers(&self) -> usize {
        self.followers.len() + self.opening_followers().count()
    }

    /// Whether something opens here.
    pub fn has_openings(&self) -> bool {
        !self.series.is_empty()
    }

    fn opening_followers(&self) -> impl Iterator<Item = &SeriesPiece> {
        self.series.iter().filter(|s| s.follower.is_some())
    }

    fn follower(&self, k: usize) -> Option<&ForcePiece> {
        self.followers.get(k)
    }

    /// Column of the `k`-th candidate's strength among the free parameters, and the derivative of the strength with respect to it.
    pub fn follower_column(&self, k: usize) -> Option<(usize, f64)> {
        let series = || self.opening_followers().nth(k.checked_sub(self.followers.len())?).map(|s| s.p.start);
        let at = self.follower(k).map(|f| f.p.start).or_else(series)?;
        self.chains[at].first().copied()
    }

    /// Openings per unit strength of the `k`-th candidate under these forces; `None` where it is a force itself.
    pub fn follower_opens(&self, k: usize, forces: &[f64]) -> Option<Vec<f64>> {
        let piece = self.opening_followers().nth(k.checked_sub(self.followers.len())?)?;
        let n = piece.p.len();
        let (mut value, mut slopes) = (vec![0.0; n], vec![0.0; n]);
        let mut open = |f: &f64| {
            piece.law.opening_params(*f, &self.p[piece.p.clone()], &mut value, &mut slopes);
            value[0]
        };
        Some(forces.iter().map(&mut open).collect())
    }

    /// States of the `k`-th candidate at rest.
    pub fn follower_states(&self, k: usize) -> Vec<f64> {
        vec![0.0; self.follower(k).map_or(0, |f| f.s.len())]
    }

    /// Force of the `k`-th candidate per unit strength at the end of a step; `s` leaves with its new states. 0 for one that opens.
    pub fn follower_force(&self, k: usize, u: &Inputs<f64>, dt: f64, s: &mut [f64], scratch: &mut ElementScratch) -> f64 {
        self.follower(k).map_or(0.0, |piece| self.advance(self.forces.len() + k, piece, u, dt, s, scratch))
    }

    /// The element without its candidates, whose parameters are left with no part in anything.
    pub fn without_followers(&self) -> Element {
        let mut plain = self.clone();
        let own = self.followers.iter().map(|f| f.p.clone()).chain(self.opening_followers().map(|s| s.p.clone()));
        for p in own.flatten() {
            (plain.chains[p], plain.active[p]) = (vec![], false);
        }
        plain.followers.clear();
        plain.series.retain(|s| s.follower.is_none());
        plain.n_follower_states = 0;
        plain
    }
}
