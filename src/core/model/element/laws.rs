//! Which laws an element has, and what that says of it.

use super::{Element, ForcePiece};

impl Element {
    /// What its linear laws sum up to per displacement, velocity and acceleration; nothing where they stand behind an opening.
    pub fn linear_part(&self) -> [f64; 3] {
        if self.opening { [0.0; 3] } else { self.linear_sum }
    }

    /// Whether a parameter is one of a linear law whose force is a part of [`Element::linear_part`].
    pub fn is_of_linear_part(&self, p: usize) -> bool {
        !self.opening && self.linear.iter().any(|piece| piece.p.contains(&p))
    }

    /// The element in a settled cycle of this frequency [Hz]: laws stand at it that say so ([`crate::effect::Force::AT_DRIVE`]).
    pub(in crate::model) fn driven_at(&mut self, frequency: f64) {
        let at = |piece: &ForcePiece| piece.law.at_drive().map(|k| piece.p.start + k);
        let of: Vec<usize> = self.forces.iter().chain(&self.followers).filter_map(at).collect();
        for k in of {
            if self.p[k] < 0.0 {
                (self.p[k], self.active[k]) = (frequency, false);
                self.chains[k].clear();
            }
        }
    }

    /// Whether anything acts here beyond [`Element::linear_part`].
    pub fn is_local(&self) -> bool {
        self.opening || !self.forces.is_empty()
    }

    /// Whether all that acts beyond it follows the motion by a fixed recurrence: force and new states are linear in the motion and in the old states.
    pub fn superposes(&self) -> bool {
        !self.opening && self.forces.iter().all(|f| f.recurs)
    }

    /// Whether both have the same laws with the same numbers and the same free parameters behind them.
    pub fn same_law(&self, other: &Element) -> bool {
        // Formulas share a name; their equations tell them apart.
        let names = |e: &Element| -> Vec<(&'static str, &'static str)> {
            let forces = e.linear.iter().chain(&e.forces).chain(&e.followers).map(|f| f.law.info());
            forces.chain(e.series.iter().map(|s| s.law.info())).map(|i| (i.name, i.equation)).collect()
        };
        self.p == other.p && self.chains == other.chains && names(self) == names(other)
    }

    /// Whether forces and openings are linear in the motion and its history, so that [`Element::stiffness`] says all at every amplitude.
    pub fn is_linear_at_every_amplitude(&self) -> bool {
        self.forces.iter().all(|f| f.law.superposes()) && self.series.iter().filter(|s| s.follower.is_none()).all(|s| s.law.linear())
    }

    /// The same of the candidates of the score test.
    pub fn followers_are_linear(&self) -> bool {
        self.followers.iter().all(|f| f.law.superposes()) && self.series.iter().filter(|s| s.follower.is_some()).all(|s| s.law.linear())
    }

    /// Where all but candidates is linear: of which parameters [`Element::stiffness`] says all at every amplitude, and elements for the others, whose own
    /// parameters alone have chains: candidates in parallel by themselves, and openings beside what bears them.
    pub fn candidates(&self) -> (Vec<bool>, Vec<Element>) {
        let mut said = vec![true; self.n_params()];
        let mut beside = Element::empty(self.place, self.from, self.to);
        for piece in self.followers.iter().filter(|f| !f.law.superposes()) {
            said[piece.p.clone()].fill(false);
            let p = beside.push_params(self.p[piece.p.clone()].to_vec(), self.chains[piece.p.clone()].to_vec());
            let s = beside.n_follower_states..beside.n_follower_states + piece.s.len();
            beside.n_follower_states = s.end;
            beside.followers.push(ForcePiece { p, s, ..piece.clone() });
        }
        let mut before = self.clone();
        before.followers.clear();
        before.n_follower_states = 0;
        before.series.retain(|s| s.follower.is_none() || !s.law.linear());
        let mut own = vec![false; self.n_params()];
        for piece in before.series.iter_mut().filter(|s| s.follower.is_some()) {
            piece.follower = Some(before.n_follower_states);
            before.n_follower_states += 2;
            own[piece.p.clone()].fill(true);
        }
        for (p, _) in own.iter().enumerate().filter(|(_, own)| !**own) {
            (before.chains[p], before.active[p]) = (vec![], false);
        }
        said.iter_mut().zip(&own).for_each(|(said, own)| *said &= !own);
        let both = [beside, before].into_iter().filter(|e| e.chains.iter().any(|c| !c.is_empty()));
        (said, both.collect())
    }

    /// The same law as two elements side by side, what is linear at every amplitude and the rest; `None` where one of them is empty, or an opening
    /// stands before both.
    pub fn apart(&self) -> Option<[Element; 2]> {
        if !self.series.is_empty() || self.is_linear_at_every_amplitude() {
            return None;
        }
        let superposes = |f: &&ForcePiece| f.law.superposes();
        let [mut linear, mut rest] = [(); 2].map(|()| Element::empty(self.place, self.from, self.to));
        linear.linear_sum = self.linear_sum;
        for piece in &self.linear {
            let p = linear.push_params(self.p[piece.p.clone()].to_vec(), self.chains[piece.p.clone()].to_vec());
            linear.linear.push(ForcePiece { p, ..piece.clone() });
        }
        for piece in &self.forces {
            let of = if superposes(&piece) { &mut linear } else { &mut rest };
            let p = of.push_params(self.p[piece.p.clone()].to_vec(), self.chains[piece.p.clone()].to_vec());
            let s = of.n_states..of.n_states + piece.s.len();
            of.n_states = s.end;
            of.forces.push(ForcePiece { p, s, ..piece.clone() });
        }
        for piece in &self.followers {
            let of = if superposes(&piece) { &mut linear } else { &mut rest };
            let p = of.push_params(self.p[piece.p.clone()].to_vec(), self.chains[piece.p.clone()].to_vec());
            let s = of.n_follower_states..of.n_follower_states + piece.s.len();
            of.n_follower_states = s.end;
            of.followers.push(ForcePiece { p, s, ..piece.clone() });
        }
        (linear.n_params() > 0 && rest.n_params() > 0).then_some([linear, rest])
    }
}
