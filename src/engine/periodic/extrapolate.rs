//! The limit of cycles that approach it slowly, from a few of them.
//!
//! Cycles that repeat at the rates `lambda_j` differ from the steady one by `sum a_j lambda_j^k`. Weights that sum to one and make the
//! weighted differences of consecutive cycles least leave the slow rates out (reduced rank extrapolation: Eddy 1979; Smith, Ford and
//! Sidi, SIAM Review 29 (1987) 199). What never decays, a slider that stays stuck, has no part in the differences and keeps what the
//! loading path left.

use nalgebra::{DMatrix, DVector};

use super::super::march::State;
use super::shooting::Shooting;

/// Cycles that a limit is taken from.
pub(super) const SEEN: usize = 5;
/// Largest sum of the sizes of the weights, and the parts of the largest singular value at which small ones are held until it is kept: beyond
/// it they say more of rounding, and of what is not linear, than of rates.
const LARGEST: f64 = 50.0;
const HELD: [f64; 6] = [1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2];

/// The limit of states at the ends of consecutive cycles, that of the values where they are `open`, and of each sensitivity; with
/// weights of their own. `None` where no weights can be told.
pub(super) fn limit(seen: &[State], z: &Shooting, columns: usize, open: bool) -> Option<State> {
    let values = if open { weights(&seen.iter().map(|s| z.pack(s)).collect::<Vec<_>>()) } else { None };
    let packed: Vec<DMatrix<f64>> = seen.iter().map(|s| z.pack_columns(s, columns)).collect();
    let of_column = |c: usize| weights(&packed.iter().map(|p| p.column(c).into_owned()).collect::<Vec<_>>());
    let slopes: Vec<Option<Vec<f64>>> = (0..columns).map(of_column).collect();
    if values.is_none() && slopes.iter().all(Option::is_none) {
        return None;
    }
    State::combined(&seen[1..], values.as_deref(), &slopes)
}

/// Weights of the second and later vectors; `None` where their differences do not tell them.
fn weights(seen: &[DVector<f64>]) -> Option<Vec<f64>> {
    let differences: Vec<DVector<f64>> = seen.windows(2).map(|w| &w[1] - &w[0]).collect();
    let size = differences.first()?.amax();
    if size == 0.0 || differences.iter().flat_map(|d| d.iter()).any(|x| !x.is_finite()) {
        return None;
    }
    let u = DMatrix::from_columns(&differences) / size;
    let svd = u.svd(false, true);
    let (v_t, largest) = (svd.v_t?, svd.singular_values.max());
    let ones = &v_t * DVector::from_element(v_t.ncols(), 1.0);
    // (U'U)^-1 1 over its sum, with the small singular values held at a part of the largest.
    let held_at = |part: f64| -> Vec<f64> {
        let scaled = ones.iter().zip(&svd.singular_values).map(|(o, s)| o / s.max(part * largest).powi(2));
        let c = v_t.tr_mul(&DVector::from_iterator(ones.len(), scaled));
        c.iter().map(|w| w / c.sum()).collect()
    };
    // What is not finite is not less than anything.
    HELD.iter().map(|part| held_at(*part)).find(|w| w.iter().map(|w| w.abs()).sum::<f64>() <= LARGEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three rates, and a value that stays where it began.
    fn cycle(k: i32) -> DVector<f64> {
        let rate = |a: f64, lambda: f64| a * lambda.powi(k);
        DVector::from_vec(vec![1.0 + rate(0.3, 0.9), 2.0 + rate(0.1, 0.9) + rate(0.4, -0.3), -1.0 + rate(0.2, 0.3), 7.0])
    }

    #[test]
    fn the_limit_of_as_many_rates_as_differences_is_exact() {
        let seen: Vec<DVector<f64>> = (0..SEEN as i32).map(cycle).collect();
        let w = weights(&seen).unwrap();
        assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        let limit = w.iter().zip(&seen[1..]).fold(DVector::zeros(4), |sum, (w, x)| sum + x * *w);
        assert!((&limit - DVector::from_vec(vec![1.0, 2.0, -1.0, 7.0])).amax() < 1e-6, "{limit}");
        assert!((&seen[SEEN - 1] - limit).amax() > 0.1);
    }

    #[test]
    fn what_does_not_move_or_grows_without_end_has_no_limit() {
        let still = vec![DVector::from_element(3, 1.0); SEEN];
        assert!(weights(&still).is_none());
        // Equal steps: the weights would have to cancel them.
        let steady: Vec<DVector<f64>> = (0..SEEN).map(|k| DVector::from_element(3, k as f64)).collect();
        let limit = weights(&steady).map(|w| w.iter().zip(&steady[1..]).map(|(w, x)| w * x[0]).sum::<f64>());
        assert!(limit.is_none_or(|x| x.abs() < 10.0), "{limit:?}");
        let lost = vec![DVector::from_element(3, 0.0), DVector::from_element(3, f64::NAN), DVector::from_element(3, 1.0)];
        assert!(weights(&lost).is_none());
    }
}
