//! What the best of many candidates scores by chance, and as how many choices they count.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::parallel;

use crate::diagnose::settings::Scoring;

/// A trial as its score is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Whether its strength may have either sign.
    pub two_sided: bool,
    /// Its candidate.
    pub candidate: usize,
    /// Whether that is one of the model's physics.
    pub physics: bool,
}

/// What trials score where nothing is missing.
#[derive(Clone, Debug)]
pub struct Chance {
    /// Sorted draws of the largest score of all.
    pub best: Vec<f64>,
    /// Number of independent candidates whose best is as much of a chance as the best of these. Laws of one kind say much the same: where one of them
    /// scores by chance the others do, and a choice between them is hardly one. With `p_k` the probability that candidate k passes a level by the best
    /// of its shapes, and `p` that any does: `ln(1 - p) / mean_k ln(1 - p_k)` (Sidak, J. Am. Stat. Assoc. 62, 1967, solved for the number).
    pub independent: f64,
    /// The same of those of the model's physics.
    pub independent_physics: f64,
}

/// How often a level was passed.
#[derive(Clone, Default)]
struct Passed {
    best: Vec<f64>,
    of_candidate: Vec<u64>,
    any: u64,
    any_physics: u64,
}

/// Draws `z ~ N(0, correlation of the columns)`. `columns`: of unit length.
pub fn chance(columns: &[DVector<f64>], trials: &[Drawn], seed: u64, s: &Scoring) -> Chance {
    let m = columns.len();
    let none = || Chance { best: vec![], independent: 1.0, independent_physics: 1.0 };
    let Ok(normal) = Normal::new(0.0, 1.0) else { return none() };
    if m == 0 {
        return none();
    }
    let root = root(columns, s);
    let directions = root.ncols();
    let candidates = trials.iter().map(|t| t.candidate + 1).max().unwrap_or(0);
    let mut physics = vec![false; candidates];
    trials.iter().for_each(|t| physics[t.candidate] = t.physics);
    // What `passing` independent trials would pass in a draw.
    let level = normal.inverse_cdf(1.0 - 0.5 * s.passing / m as f64);
    // Draws that are made at once: the size of a product of matrices, no setting.
    let block = s.draws.clamp(1, 200);
    let drawn = |stream: usize| {
        if parallel::given_up() {
            return Passed { of_candidate: vec![0; candidates], ..Passed::default() };
        }
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream as u64);
        let z = &root * DMatrix::from_fn(directions, block, |_, _| normal.inverse_cdf(rng.random_range(f64::EPSILON..1.0 - f64::EPSILON)));
        let mut passed = Passed { of_candidate: vec![0; candidates], ..Passed::default() };
        let mut of = vec![0.0f64; candidates];
        for draw in z.column_iter() {
            of.fill(0.0);
            for (z, t) in draw.iter().zip(trials) {
                of[t.candidate] = of[t.candidate].max(if t.two_sided { z.abs() } else { *z });
            }
            let passes = |k: &usize| of[*k] > level;
            (0..candidates).filter(passes).for_each(|k| passed.of_candidate[k] += 1);
            passed.any += u64::from((0..candidates).any(|k| passes(&k)));
            passed.any_physics += u64::from((0..candidates).any(|k| physics[k] && passes(&k)));
            passed.best.push(of.iter().fold(0.0, |m: f64, v| m.max(*v)));
        }
        passed
    };
    let all = parallel::over(s.draws / block, drawn).into_iter().reduce(|mut a, b| {
        a.best.extend(b.best);
        a.of_candidate.iter_mut().zip(b.of_candidate).for_each(|(a, b)| *a += b);
        (a.any, a.any_physics) = (a.any + b.any, a.any_physics + b.any_physics);
        a
    });
    let Some(Passed { mut best, of_candidate, any, any_physics }) = all else { return none() };
    // The time ended before a draw was made.
    if best.is_empty() {
        return none();
    }
    best.sort_by(f64::total_cmp);
    let count = |any: u64, which: &dyn Fn(usize) -> bool| {
        let counted = |k: &usize| which(*k) && trials.iter().any(|t| t.candidate == *k);
        let passed: Vec<u64> = (0..candidates).filter(counted).map(|k| of_candidate[k]).collect();
        as_independent(any, &passed, best.len() as f64)
    };
    let (independent, independent_physics) = (count(any, &|_| true), count(any_physics, &|k| physics[k]));
    Chance { best, independent, independent_physics }
}

/// As how many independent candidates these are, of which any passed a level in so many draws and each in so many of them. Half a draw at least passes and half a
/// draw does not: what was not seen in so many draws is not impossible.
fn as_independent(any: u64, each: &[u64], draws: f64) -> f64 {
    let never = |passed: u64| (-(passed as f64).clamp(0.5, draws - 0.5) / draws).ln_1p();
    let count = each.len() as f64;
    if each.is_empty() { 1.0 } else { (never(any) * count / each.iter().map(|passed| never(*passed)).sum::<f64>()).clamp(1.0, count) }
}

/// A matrix whose product with independent normal numbers has the correlation of the columns.
fn root(columns: &[DVector<f64>], s: &Scoring) -> DMatrix<f64> {
    let m = columns.len();
    let g = DMatrix::from_columns(columns);
    if m > s.condensed {
        return condensed(&g, s);
    }
    // A product, not `tr_mul`: that goes column by column.
    let mut correlation = g.transpose() * &g;
    for k in 0..m {
        correlation[(k, k)] += f64::EPSILON.sqrt();
    }
    let mut jitter = f64::EPSILON.sqrt();
    loop {
        if let Some(c) = correlation.clone().cholesky() {
            return c.l();
        }
        jitter *= 10.0;
        (0..m).for_each(|k| correlation[(k, k)] += jitter);
        if jitter > 1.0 {
            return DMatrix::identity(m, m);
        }
    }
}

/// The same of very many columns, which lie in few directions: an orthonormal basis Q of their span, found by random combinations of what is left of them
/// (Halko, Martinsson, Tropp, SIAM Rev. 53, 2011), and `(Q'G)'` with rows of unit length. What is left of every column is `s.apart` at most.
fn condensed(g: &DMatrix<f64>, s: &Scoring) -> DMatrix<f64> {
    let (rows, m) = g.shape();
    let most = rows.min(m);
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut q = DMatrix::<f64>::zeros(rows, 0);
    let mut by = DMatrix::<f64>::zeros(0, m);
    loop {
        let left = by.column_iter().map(|c| 1.0 - c.norm_squared()).fold(if by.nrows() == 0 { 1.0 } else { 0.0 }, f64::max);
        if left <= s.apart * s.apart || q.ncols() >= most {
            break;
        }
        let block = s.directions.min(most - q.ncols());
        let mixed = DMatrix::from_fn(m, block, |_, _| rng.random_range(-1.0..1.0));
        let mut new = g * &mixed - &q * (&by * &mixed);
        // Twice is enough: what the first pass leaves of the basis is rounding.
        for _ in 0..2 {
            new -= &q * q.tr_mul(&new);
        }
        let fresh = new.qr().q();
        let of_fresh = fresh.transpose() * g;
        q = DMatrix::from_columns(&q.column_iter().chain(fresh.column_iter()).collect::<Vec<_>>());
        by = DMatrix::from_fn(by.nrows() + block, m, |i, k| if i < by.nrows() { by[(i, k)] } else { of_fresh[(i - by.nrows(), k)] });
    }
    let mut root = by.transpose();
    root.row_iter_mut().for_each(|mut r| {
        let size = r.norm();
        r.unscale_mut(if size > 0.0 { size } else { 1.0 });
    });
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(columns: &[DVector<f64>], candidate: &[usize]) -> Chance {
        let drawn = |k: &usize| Drawn { two_sided: true, candidate: *k, physics: *k > 0 };
        chance(columns, &candidate.iter().map(drawn).collect::<Vec<_>>(), 7, &Scoring::default())
    }

    fn axis(k: usize) -> DVector<f64> {
        DVector::from_fn(12, |i, _| if i == k { 1.0 } else { 0.0 })
    }

    /// A search that is stopped before a draw was made has no chance to tell.
    #[test]
    fn what_is_stopped_draws_nothing() {
        let ended = parallel::Watch { cancel: Some(std::sync::Arc::new(true.into())), deadline: None };
        let c = parallel::watched(&ended, || counted(&(0..4).map(axis).collect::<Vec<_>>(), &[0, 1, 2, 3]));
        assert!(c.best.is_empty() && c.independent == 1.0, "{c:?}");
    }

    /// Many columns in few directions are drawn as they are one by one.
    #[test]
    fn what_lies_in_few_directions_is_drawn_in_them() {
        let column = |k: usize| {
            let (a, b) = ((0.37 * k as f64).sin(), (0.11 * k as f64).cos());
            (axis(0) * a + axis(1) * b + axis(2 + k % 3) * 0.5).normalize()
        };
        let columns: Vec<_> = (0..60).map(column).collect();
        let drawn = |k: usize| Drawn { two_sided: true, candidate: k / 3, physics: true };
        let trials: Vec<_> = (0..60).map(drawn).collect();
        let of = |condensed: usize| chance(&columns, &trials, 7, &Scoring { condensed, ..Scoring::default() });
        let (exact, few) = (of(1000), of(10));
        assert!((few.independent / exact.independent - 1.0).abs() < 0.05, "{} {}", few.independent, exact.independent);
        for q in [0.5, 0.9, 0.99] {
            let at = |c: &Chance| c.best[(q * c.best.len() as f64) as usize];
            assert!((at(&few) / at(&exact) - 1.0).abs() < 0.03, "{q}: {} {}", at(&few), at(&exact));
        }
    }

    #[test]
    fn candidates_count_by_what_they_say() {
        let different: Vec<_> = (0..10).map(axis).collect();
        let c = counted(&different, &(0..10).collect::<Vec<_>>());
        assert!((c.independent / 10.0 - 1.0).abs() < 0.05 && (c.independent_physics / 9.0 - 1.0).abs() < 0.05, "{c:?}");
        let same: Vec<_> = (0..10).map(|_| axis(0)).collect();
        let c = counted(&same, &(0..10).collect::<Vec<_>>());
        assert!((c.independent - 1.0).abs() < 1e-6, "{}", c.independent);
        // Five kinds of two laws that say the same.
        let pairs: Vec<_> = (0..10).map(|k| axis(k / 2)).collect();
        let c = counted(&pairs, &(0..10).collect::<Vec<_>>());
        assert!((c.independent / 5.0 - 1.0).abs() < 0.08, "{}", c.independent);
    }

    #[test]
    fn shapes_of_a_law_are_no_choice_of_a_law() {
        // Two laws of five unlike shapes each are two candidates, and their best is that of ten trials.
        let columns: Vec<_> = (0..10).map(axis).collect();
        let c = counted(&columns, &[0, 0, 0, 0, 0, 1, 1, 1, 1, 1]);
        assert!((c.independent - 2.0).abs() < 0.1, "{}", c.independent);
        let ten = counted(&columns, &(0..10).collect::<Vec<_>>());
        assert_eq!(c.best, ten.best);
    }
}
