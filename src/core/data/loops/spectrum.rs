//! The noise of a mean cycle, harmonic by harmonic.
//!
//! A cycle of `n` points is turned into the orthonormal Fourier coefficients 0 to [`HARMONICS`]: mean, cosines, sines. White noise of variance
//! `s^2` at every point has the variance `s^2` in every coefficient; noise that is correlated along the cycle, and a force that changes its
//! strength from cycle to cycle, have more at low harmonics.

use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, OnceLock};

use nalgebra::DMatrix;
use realfft::RealFftPlanner;

/// Highest harmonic that is compared.
pub const HARMONICS: usize = 40;
/// Part of a harmonic's number over which the scatter of its neighbours is averaged with its own.
const NEIGHBOURS: f64 = 0.3;

/// Harmonics of a cycle of `n` points that are kept.
fn kept(n: usize) -> usize {
    HARMONICS.min(n.saturating_sub(1) / 2)
}

/// Rows 0, cos 1, ..., cos H, sin 1, ..., sin H of an orthonormal basis of cycles of `n` points.
pub fn harmonics(n: usize) -> Arc<DMatrix<f64>> {
    type Bases = Mutex<std::collections::BTreeMap<usize, Arc<DMatrix<f64>>>>;
    static BASES: OnceLock<Bases> = OnceLock::new();
    let make = || {
        let top = kept(n);
        let size = (2.0 / n as f64).sqrt();
        let entry = |row: usize, point: usize| match row {
            0 => 1.0 / (n as f64).sqrt(),
            row if row <= top => size * (TAU * (row * point % n) as f64 / n as f64).cos(),
            row => size * (TAU * ((row - top) * point % n) as f64 / n as f64).sin(),
        };
        Arc::new(DMatrix::from_fn(2 * top + 1, n, entry))
    };
    let bases = BASES.get_or_init(Default::default);
    bases.lock().map_or_else(|_| make(), |mut b| b.entry(n).or_insert_with(make).clone())
}

/// Harmonic of each coefficient of [`harmonics`].
pub fn harmonic_of(n: usize) -> Vec<usize> {
    (0..=kept(n)).chain(1..=kept(n)).collect()
}

/// Variance of a coefficient of the mean cycle, harmonic by harmonic, from the scatter between cycles (`deviations` from the mean, cycles x n),
/// averaged over neighbouring harmonics; empty with fewer than three cycles.
pub fn scatter(deviations: &[f64], n: usize) -> Vec<f64> {
    let cycles = deviations.len() / n.max(1);
    if cycles < 3 {
        return vec![];
    }
    let turned = &*harmonics(n) * DMatrix::from_column_slice(n, cycles, &deviations[..n * cycles]);
    let variance = |row: usize| turned.row(row).norm_squared() / ((cycles - 1) * cycles) as f64;
    let top = kept(n);
    let raw: Vec<f64> = (0..=top).map(|h| if h == 0 { variance(0) } else { 0.5 * (variance(h) + variance(top + h)) }).collect();
    let smooth = |h: usize| {
        let reach = if h < 2 { 0 } else { ((NEIGHBOURS * h as f64) as usize).max(1) };
        let near = &raw[(h - reach.min(h)).max(h.min(1))..=(h + reach).min(top)];
        near.iter().sum::<f64>() / near.len() as f64
    };
    (0..=top).map(smooth).collect()
}

/// The same of the harmonics above [`HARMONICS`], each averaged with its two neighbours: a line of the mains, or of a sensor, stands in two or three harmonics
/// of the cycle, and the mean of few cycles keeps much of it.
pub fn above(deviations: &[f64], n: usize) -> Vec<f64> {
    let cycles = deviations.len() / n.max(1);
    if cycles < 3 || kept(n) < HARMONICS {
        return vec![];
    }
    let forward = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let (mut cycle, mut lines) = (forward.make_input_vec(), forward.make_output_vec());
    let mut raw = vec![0.0; n.saturating_sub(1) / 2 + 1];
    for own in deviations.chunks_exact(n) {
        cycle.copy_from_slice(own);
        // The buffers have the lengths that the transform asks for.
        if forward.process(&mut cycle, &mut lines).is_err() {
            return vec![];
        }
        raw.iter_mut().zip(&lines).for_each(|(sum, line)| *sum += line.norm_sqr());
    }
    let size = 1.0 / (n * cycles * (cycles - 1)) as f64;
    let near = |h: usize| {
        let near = &raw[h - 1..=(h + 1).min(raw.len() - 1)];
        size * near.iter().sum::<f64>() / near.len() as f64
    };
    (HARMONICS + 1..raw.len()).map(near).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_basis_is_orthonormal() {
        for n in [8, 9, 200] {
            let b = harmonics(n);
            let inner = &*b * b.transpose();
            assert!((inner - DMatrix::identity(b.nrows(), b.nrows())).amax() < 1e-12, "{n}");
            assert_eq!(harmonic_of(n).len(), b.nrows());
        }
    }

    #[test]
    fn a_line_above_the_harmonics_that_are_compared_has_its_variance_there() {
        // Amplitudes 1, 0, -1 at harmonic 60 of 400 points: half of 400 / 3 in each of its coefficients, a third of that in it and in its neighbours.
        let n = 400;
        let wave = |c: f64| (0..n).map(move |k| c * (TAU * 60.0 * k as f64 / n as f64).sin());
        let deviations: Vec<f64> = [1.0, 0.0, -1.0].into_iter().flat_map(wave).collect();
        let s = above(&deviations, n);
        assert_eq!(s.len(), 199 - HARMONICS);
        let of = |h: usize| s[h - HARMONICS - 1];
        for h in [59, 60, 61] {
            approx::assert_relative_eq!(of(h), 0.5 * (n as f64 / 2.0) / 3.0 / 3.0, max_relative = 1e-9);
        }
        assert!(of(58) < 1e-18 && of(62) < 1e-18);
        assert!(above(&deviations[..2 * n], n).is_empty());
    }

    #[test]
    fn scatter_of_the_strength_lies_in_its_harmonic() {
        // A sine whose amplitude differs by 1, 0, -1 from cycle to cycle: variance of the mean of its coefficient.
        let n = 64;
        let wave = |c: f64| (0..n).map(move |k| c * (TAU * k as f64 / n as f64).sin());
        let deviations: Vec<f64> = [1.0, 0.0, -1.0].into_iter().flat_map(wave).collect();
        let s = scatter(&deviations, n);
        approx::assert_relative_eq!(s[1], 0.5 * (n as f64 / 2.0) / 3.0, max_relative = 1e-12);
        assert!(s[0] < 1e-20 && s[5..].iter().all(|v| *v < 1e-20));
        assert!(scatter(&deviations[..2 * n], n).is_empty());
    }
}
