//! The motion of a nonlinear mode: the first harmonic of the relative displacement at one place is kept, no force acts, and a damping proportional to the inertia feeds
//! what the laws dissipate.
//!
//! With `M q'' - 2 zeta w M q' + f(q, q') = 0` the inertia of harmonic `k` is multiplied by `1 + 2 i zeta / k`. At a mode the structure alone resonates, so that its
//! dynamic stiffness is singular there if it is linear. A spring at the place of the amplitude moves that singularity away, and the force of the spring is
//! taken out again: `Z + s b b'` is solved, and [`Structure::missing`] is the force `F` at the place without the spring. A mode is where `F = 0`.

use num_complex::Complex64;

use super::super::super::EngineError;
use super::{Flexibility, Structure};

/// The place, the amplitude and the damping of a motion that is sought as a nonlinear mode.
#[derive(Clone, Debug)]
pub(in super::super) struct Kept {
    /// Relative displacement at the place as a row of degrees of freedom.
    pub row: Vec<(usize, f64)>,
    /// Its first harmonic, real [m or rad].
    pub amplitude: f64,
    /// Damping ratio zeta, which may be below 0.
    pub damping: f64,
}

impl Kept {
    /// Relative displacement at the place in a column of all degrees of freedom.
    pub fn across(&self, u: &[Complex64]) -> Complex64 {
        self.row.iter().map(|(d, b)| u[*d] * *b).sum()
    }
}

impl Structure<'_> {
    /// Factor on the inertia at a harmonic, 1 of a driven motion.
    pub fn feed(&self, harmonic: usize) -> Complex64 {
        Complex64::new(1.0, if harmonic == 0 { 0.0 } else { 2.0 * self.damping / harmonic as f64 })
    }

    /// Stiffness of the spring at the place at the first harmonic: that of the structure at the place with all else held still. It changes no result.
    pub(super) fn spring_for(&self, s: Complex64) -> f64 {
        let on = |entries: &[(usize, f64)], slot: usize| entries.iter().filter(|e| e.0 == slot).map(|e| e.1.abs()).sum::<f64>();
        let ends = self.spring.iter().filter(|(slot, _)| self.diagonal.contains(slot));
        let stiffness = ends.map(|(slot, _)| {
            let elements: f64 = self.slots.iter().zip(&self.z).map(|(slots, z)| z.norm() * on(slots, *slot)).sum();
            elements + (s * s).norm() * on(&self.inertia, *slot) + on(&self.geometric, *slot)
        });
        stiffness.sum()
    }

    /// Stiffness of that spring at the last first harmonic.
    pub fn spring_stiffness(&self) -> f64 {
        self.spring_stiffness
    }

    /// Condenses the first harmonic to motions whose displacement at the place is the amplitude (`out.drive`) or zero (`out.places`).
    pub(super) fn keep(&mut self, kept: &Kept, out: &mut Flexibility) -> Result<(), EngineError> {
        out.place.clear();
        out.place.resize(self.n, Complex64::ZERO);
        kept.row.iter().for_each(|(d, b)| out.place[*d] += *b);
        self.matrix.solve(&mut out.place)?;
        let unit = kept.across(&out.place).inv();
        for column in out.places.chunks_mut(self.n) {
            let share = kept.across(column) * unit;
            column.iter_mut().zip(&out.place).for_each(|(u, place)| *u -= place * share);
        }
        out.drive.clear();
        out.drive.extend(out.place.iter().map(|u| u * unit * kept.amplitude));
        Ok(())
    }

    /// Force that the place needs for its first harmonic, `forces` those of elements beyond what stands for them in the structure at that harmonic.
    pub fn missing(&self, kept: &Kept, flexibility: &Flexibility, forces: impl Iterator<Item = (usize, Complex64)>) -> Complex64 {
        self.held_force(kept, flexibility, kept.amplitude, forces) - self.spring_stiffness * kept.amplitude
    }

    /// Force at the place, that of the spring with it, for the displacement `x` there.
    pub fn held_force(
        &self,
        kept: &Kept,
        flexibility: &Flexibility,
        x: f64,
        forces: impl Iterator<Item = (usize, Complex64)>,
    ) -> Complex64 {
        let by_forces: Complex64 = forces.map(|(element, f)| self.relative(element, &flexibility.place) * f).sum();
        (by_forces + x) / kept.across(&flexibility.place)
    }
}
