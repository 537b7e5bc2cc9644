//! Quasi-random points in the unit cube: the Sobol sequence with a random shift.
//!
//! Direction numbers: S. Joe and F. Y. Kuo, SIAM J. Sci. Comput. 30 (2008) 2635, file new-joe-kuo-6.21201 (BSD licence). The shift is a digital one (exclusive or
//! with random bits per dimension), which keeps the net and makes every estimate unbiased; the spread between shifts is the error of the estimate. No crate serves:
//! `sobol_burley` ends at 65536 points, `sobol` and `sobol-qmc` bring a decompressor and old versions of nalgebra and statrs along.

use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Greatest number of dimensions.
pub const DIMENSIONS: usize = 32;

/// Coefficients of the primitive polynomial and the initial numbers m_i, dimension 2 and up.
const NUMBERS: [(u32, &[u32]); DIMENSIONS - 1] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
    (11, &[1, 1, 5, 1, 1]),
    (13, &[1, 1, 1, 3, 11]),
    (14, &[1, 3, 5, 5, 31]),
    (1, &[1, 3, 3, 9, 7, 49]),
    (13, &[1, 1, 1, 15, 21, 21]),
    (16, &[1, 3, 1, 13, 27, 49]),
    (19, &[1, 1, 1, 15, 7, 5]),
    (22, &[1, 3, 1, 15, 13, 25]),
    (25, &[1, 1, 5, 5, 19, 61]),
    (1, &[1, 3, 7, 11, 23, 15, 103]),
    (4, &[1, 3, 7, 13, 13, 15, 69]),
    (7, &[1, 1, 3, 13, 7, 35, 63]),
    (8, &[1, 3, 5, 9, 1, 25, 53]),
    (14, &[1, 3, 1, 13, 9, 35, 107]),
    (19, &[1, 3, 1, 5, 27, 61, 31]),
    (21, &[1, 1, 5, 11, 19, 41, 61]),
    (28, &[1, 3, 5, 3, 3, 13, 69]),
    (31, &[1, 1, 7, 13, 1, 19, 1]),
    (32, &[1, 3, 7, 5, 13, 19, 59]),
    (37, &[1, 1, 3, 9, 25, 29, 41]),
    (41, &[1, 3, 5, 13, 23, 1, 55]),
    (42, &[1, 3, 7, 3, 13, 59, 17]),
];

/// Bits of a coordinate.
const BITS: usize = 32;

fn directions(dimension: usize) -> [u32; BITS] {
    let Some((a, m)) = dimension.checked_sub(1).map(|k| NUMBERS[k]) else { return std::array::from_fn(|k| 1 << (31 - k)) };
    let s = m.len();
    let mut v = [0u32; BITS];
    for k in 0..BITS {
        v[k] = if k < s {
            m[k] << (31 - k)
        } else {
            let mut next = v[k - s] ^ (v[k - s] >> s);
            for j in 1..s {
                next ^= if (a >> (s - 1 - j)) & 1 == 1 { v[k - j] } else { 0 };
            }
            next
        };
    }
    v
}

/// `n` points in `dimensions` (at most [`DIMENSIONS`], more are left out), one after the other; every coordinate lies strictly inside (0, 1).
pub fn points(n: usize, dimensions: usize, seed: u64) -> Vec<f64> {
    let d = dimensions.min(DIMENSIONS);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let shifts: Vec<u32> = (0..d).map(|_| rng.next_u32()).collect();
    let directions: Vec<[u32; BITS]> = (0..d).map(directions).collect();
    let mut x = vec![0u32; d];
    let mut all = Vec::with_capacity(n * d);
    for k in 0..n as u64 {
        all.extend(x.iter().zip(&shifts).map(|(x, s)| (f64::from(x ^ s) + 0.5) / 4_294_967_296.0));
        // Gray code: the next point differs in the direction of the lowest zero bit of k.
        let bit = (!k).trailing_zeros() as usize;
        x.iter_mut().zip(&directions).for_each(|(x, v)| *x ^= v[bit.min(BITS - 1)]);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every elementary interval of 2^k points in one dimension holds one point, in all dimensions, whatever the shift.
    #[test]
    fn each_dimension_is_stratified() {
        let all = points(256, DIMENSIONS, 7);
        for d in 0..DIMENSIONS {
            let mut cells: Vec<usize> = (0..256).map(|k| (all[k * DIMENSIONS + d] * 256.0) as usize).collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..256).collect::<Vec<_>>(), "dimension {d}");
        }
    }

    /// Pairs of dimensions are stratified together: an integral over 2^12 points is off by far less than random points would be.
    #[test]
    fn products_are_integrated_better_than_by_chance() {
        let n = 4096;
        let all = points(n, 12, 3);
        for a in 0..12 {
            for b in a + 1..12 {
                let mean = (0..n).map(|k| all[k * 12 + a] * all[k * 12 + b]).sum::<f64>() / n as f64;
                // Random points: standard deviation 0.22 / 64 = 3.4e-3.
                assert!((mean - 0.25).abs() < 1e-3, "{a} {b}: {mean}");
            }
        }
    }
}
