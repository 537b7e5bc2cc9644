//! Shapes, their likeness and their complexity.

use super::refine::Pole;
use super::{FrfSet, Mode, of_pole};
use nalgebra::{DMatrix, Matrix2};
use num_complex::Complex64;

/// Modal assurance criterion |a* b|^2 / (a* a)(b* b); 0 where a shape is nothing.
pub fn mac(a: &[Complex64], b: &[Complex64]) -> f64 {
    let dot: Complex64 = a.iter().zip(b).map(|(a, b)| a.conj() * b).sum();
    let size = |v: &[Complex64]| v.iter().map(|x| x.norm_sqr()).sum::<f64>();
    let below = size(a) * size(b);
    if below > 0.0 { dot.norm_sqr() / below } else { 0.0 }
}

/// Modal phase collinearity: 1 where all points move in phase or against it, 0 where the phases fill the circle (Juang and Pappa, 1985): with the
/// eigenvalues l1 >= l2 of the scatter of (Re, Im), ((l1 - l2) / (l1 + l2))^2.
pub fn phase_collinearity(shape: &[Complex64]) -> f64 {
    let sum = |f: fn(&Complex64) -> f64| shape.iter().map(f).sum::<f64>();
    let (xx, yy, xy) = (sum(|c| c.re * c.re), sum(|c| c.im * c.im), sum(|c| c.re * c.im));
    let values = Matrix2::new(xx, xy, xy, yy).symmetric_eigenvalues();
    let total = values[0] + values[1];
    if total > 0.0 { ((values[0] - values[1]) / total).powi(2) } else { 1.0 }
}

/// Shape and participation from the residues of a pole: the nearest matrix of rank one.
pub(super) fn mode(set: &FrfSet, pole: &Pole) -> Mode {
    let (no, ni) = (set.outputs, set.inputs);
    let residues = DMatrix::from_fn(no, ni, |o, i| pole.residues[o * ni + i]);
    let (mut shape, mut participation): (Vec<Complex64>, Vec<Complex64>) = if ni == 1 {
        (residues.iter().copied().collect(), vec![Complex64::from(1.0)])
    } else {
        let svd = residues.svd(true, true);
        match (svd.u, svd.v_t) {
            (Some(u), Some(vt)) => {
                let s = svd.singular_values[0];
                (u.column(0).iter().map(|x| x * s).collect(), vt.row(0).iter().copied().collect())
            }
            _ => (vec![Complex64::default(); no], vec![Complex64::default(); ni]),
        }
    };
    let largest = shape.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default();
    if largest.norm() > 0.0 {
        shape.iter_mut().for_each(|x| *x /= largest);
        participation.iter_mut().for_each(|x| *x *= largest);
    }
    let (frequency, damping) = of_pole(pole.pole);
    Mode {
        frequency,
        frequency_sigma: pole.frequency_sigma,
        damping,
        damping_sigma: pole.damping_sigma,
        complexity: 1.0 - phase_collinearity(&shape),
        shape,
        participation,
        orders: pole.orders,
    }
}
