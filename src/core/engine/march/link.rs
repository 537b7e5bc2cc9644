//! Where an element acts.

use super::{BlockTri, March};
use crate::model::Fading;

/// An element between two degrees of freedom.
pub(super) struct Link {
    pub to: Option<usize>,
    pub from: Option<usize>,
    /// Where its states begin, and those of its followers.
    pub s0: usize,
    pub fs0: usize,
    /// Slots of (to,to), (from,from), (to,from), (from,to) where both are free.
    pub slots: [Option<usize>; 4],
}

impl Link {
    /// Both ends, each with the sign with which it strains the element.
    #[inline(always)]
    pub fn both(&self) -> [(Option<usize>, f64); 2] {
        [(self.to, 1.0), (self.from, -1.0)]
    }

    /// Degrees of freedom at its ends with the sign with which they strain it.
    pub fn ends(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        self.both().into_iter().filter_map(|(d, sign)| Some((d?, sign)))
    }
}

impl March<'_> {
    /// States that only fade, by element: its place, the first of its states among all, and they ([`crate::model::Element::fading`]).
    pub(in crate::engine) fn fading(&self) -> Vec<(usize, usize, Vec<Fading>)> {
        let of = self.bound.elements.iter().zip(&self.links).map(|(e, link)| (e.place, link.s0, e.fading(self.dt)));
        of.filter(|(.., states)| !states.is_empty()).collect()
    }
}

/// Adds a stiffness between two degrees of freedom, at the slots that are free: (to, to), (from, from), (to, from), (from, to).
#[inline]
pub(super) fn add_link(matrix: &mut BlockTri<f64>, slots: &[Option<usize>; 4], k: f64) {
    let signed = [k, k, -k, -k];
    for at in 0..signed.len() {
        if let Some(slot) = slots[at] {
            matrix.add_at(slot, signed[at]);
        }
    }
}
