//! What errors of modes change in an FRF.
//!
//! A model that is not right in stiffness, mass or damping misses the frequencies, the dampings and the residues of modes, each by a little, and with them
//! every line beside a resonance by much: one fact, and no scatter of lines. Of every mode that the measured FRF has in its band
//! ([`crate::data::modal_fit`]; Ewins, Modal Testing, 2000, sec. 4.2),
//!
//! ```text
//! h = r/(i w - s) + r*/(i w - s*)     dh/dln f = r s/(i w - s)^2 + ...     dh/dln zeta = r (ds/dln zeta)/(i w - s)^2 + ...     dh/dr, two columns
//! ```
//!
//! and of the modes beyond the band a constant and a part in 1/w^2 of the receptance. Each column has the size of the FRF where it is largest, so
//! that an error of 1 % is a line beside the resonance 1 % off: a frequency 1 % of half the half-power width off, a damping 1 % of itself.

use nalgebra::DMatrix;
use num_complex::Complex64;
use std::f64::consts::TAU;

use crate::data::modal_fit::{FrfSet, Settings, fit};
use crate::response::{Block, Plan};

/// Modes at most: those of largest residue. What more there are is not told apart in one FRF.
const MODES: usize = 12;

/// One column for each error, in the rows of the block (real and imaginary part of each line); none where no mode is identified.
pub(super) fn columns(plan: &Plan, block: &Block) -> DMatrix<f64> {
    let none = DMatrix::zeros(block.range.len(), 0);
    let Some(quantity) = plan.frf_quantity() else { return none };
    let factors: Vec<Complex64> = block.abscissa.iter().map(|f| quantity.from_receptance(TAU * f)).collect();
    let lines = plan.measured[block.range.clone()].chunks_exact(2).zip(&factors);
    let h: Vec<Complex64> = lines.map(|(h, to)| Complex64::new(h[0], h[1]) / to).collect();
    let sigma = plan.noise()[block.range.clone()].chunks_exact(2).zip(&factors).map(|(s, to)| s[0] / to.norm()).collect();
    let set = FrfSet { frequency: block.abscissa.clone(), outputs: 1, inputs: 1, h: vec![h.clone()], sigma: vec![sigma] };
    let Ok(found) = fit(&set, &Settings::default()) else { return none };
    let mut poles: Vec<Pole> = found.modes.iter().map(|m| Pole::of(m.frequency, m.damping, m.shape[0] * m.participation[0])).collect();
    if poles.is_empty() {
        return none;
    }
    poles.sort_by(|a, b| b.height().total_cmp(&a.height()));
    poles.truncate(MODES);
    let iw: Vec<Complex64> = block.abscissa.iter().map(|f| Complex64::new(0.0, TAU * f)).collect();
    // Receptance of an error of one at every line, with the size of the FRF over its own that it is scaled by.
    let mut errors: Vec<(Vec<Complex64>, f64)> = Vec::new();
    for pole in &poles {
        let all: Vec<[Complex64; 4]> = iw.iter().map(|iw| pole.derivatives(*iw)).collect();
        for k in 0..4 {
            let error: Vec<Complex64> = all.iter().map(|d| d[k]).collect();
            let peak = (0..h.len()).max_by(|a, b| error[*a].norm().total_cmp(&error[*b].norm())).unwrap_or(0);
            let scale = h[peak].norm() / error[peak].norm();
            errors.push((error, scale));
        }
    }
    for beyond in [iw.iter().map(|_| Complex64::ONE).collect::<Vec<_>>(), iw.iter().map(|iw| (iw * iw).inv()).collect()] {
        let mut sizes: Vec<f64> = h.iter().zip(&beyond).map(|(h, e)| h.norm() / e.norm()).collect();
        sizes.sort_by(f64::total_cmp);
        let median = sizes[sizes.len() / 2];
        errors.push((beyond, median));
    }
    let mut columns = DMatrix::zeros(block.range.len(), errors.len());
    for (mut column, (error, scale)) in columns.column_iter_mut().zip(&errors) {
        for (k, (e, to)) in error.iter().zip(&factors).enumerate() {
            let e = e * to * *scale;
            (column[2 * k], column[2 * k + 1]) = (e.re, e.im);
        }
    }
    if columns.iter().all(|v| v.is_finite()) { columns } else { none }
}

/// A mode in one FRF.
struct Pole {
    /// -zeta w0 + i w0 sqrt(1 - zeta^2).
    s: Complex64,
    /// ds / d ln zeta.
    by_damping: Complex64,
    /// Residue.
    r: Complex64,
}

impl Pole {
    fn of(frequency: f64, damping: f64, r: Complex64) -> Pole {
        let w = TAU * frequency;
        let free = (1.0 - damping * damping).max(1e-6).sqrt();
        let by_damping = Complex64::new(-damping * w, -w * damping * damping / free);
        Pole { s: Complex64::new(-damping * w, w * free), by_damping, r }
    }

    /// Its part of the FRF at the resonance.
    fn height(&self) -> f64 {
        self.r.norm() / self.s.re.abs().max(f64::MIN_POSITIVE)
    }

    /// Receptance by ln f, ln zeta, Re r and Im r.
    fn derivatives(&self, iw: Complex64) -> [Complex64; 4] {
        let (p, q) = ((iw - self.s).inv(), (iw - self.s.conj()).inv());
        let moved = |by: Complex64| self.r * by * p * p + (self.r * by).conj() * q * q;
        [moved(self.s), moved(self.by_damping), p + q, Complex64::i() * (p - q)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The columns are what a small change of each number changes.
    #[test]
    fn derivatives_are_those_of_the_modal_model() {
        let (f, zeta, r) = (40.0, 0.03, Complex64::new(2e-3, -5e-2));
        let h = |f: f64, zeta: f64, r: Complex64, iw: Complex64| {
            let s = Pole::of(f, zeta, r).s;
            r / (iw - s) + r.conj() / (iw - s.conj())
        };
        let step = 1e-6;
        for line in [10.0, 38.0, 40.0, 41.5, 90.0] {
            let iw = Complex64::new(0.0, TAU * line);
            let base = h(f, zeta, r, iw);
            let numeric = [
                (h(f * (1.0 + step), zeta, r, iw) - base) / step,
                (h(f, zeta * (1.0 + step), r, iw) - base) / step,
                (h(f, zeta, r + step, iw) - base) / step,
                (h(f, zeta, r + Complex64::i() * step, iw) - base) / step,
            ];
            for (exact, numeric) in Pole::of(f, zeta, r).derivatives(iw).iter().zip(numeric) {
                assert!((exact - numeric).norm() < 1e-4 * exact.norm(), "{line} Hz: {exact} beside {numeric}");
            }
        }
    }
}
