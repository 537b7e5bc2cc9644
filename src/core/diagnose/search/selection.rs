//! A second opinion on what is missing: a sparse combination of all candidates' columns at once, where the score test looks at one at a time.
//!
//! With the projected residual `r~` and the projected columns of unit length `g`: minimise `1/2 ||r~ + sum b g||^2 + lambda sum b` over
//! `b >= 0` by Clarabel (a nonnegative lasso; a strength of either sign stands twice). The price `lambda` is what the best column of chance
//! would reach, or a tenth of the best where the misfit dwarfs the noise; what enters is fitted again without it (the relaxed lasso of
//! Meinshausen, Comput. Stat. Data Anal. 52, 2007). Grid points of one effect at one place are counted together.

use nalgebra::{DMatrix, DVector};

use crate::identify::Program;

use crate::diagnose::settings::Scoring;

/// A column that may be selected.
pub struct Column<'a> {
    /// Unit vector, projected.
    pub g: &'a DVector<f64>,
    /// Whether its weight may have either sign.
    pub two_sided: bool,
    /// Its candidate.
    pub candidate: usize,
}

/// Candidates with the part of the explained cost that each carries, the largest first. `level`: what the best score reaches by chance.
pub fn select(r: &DVector<f64>, columns: &[Column], level: f64, s: &Scoring) -> Vec<(usize, f64)> {
    // Correlation with what is to be explained; a weight grows against the residual.
    let mut signed: Vec<(usize, f64, f64)> = columns
        .iter()
        .enumerate()
        .map(|(k, c)| (k, -c.g.dot(r), c.two_sided))
        .filter(|(_, z, both)| *z > 0.0 || *both)
        .map(|(k, z, _)| (k, z.signum(), z.abs()))
        .collect();
    signed.sort_by(|a, b| b.2.total_cmp(&a.2));
    signed.truncate(s.columns);
    let Some(best) = signed.first().map(|c| c.2) else { return vec![] };
    if best <= level {
        return vec![];
    }
    let g = DMatrix::from_columns(&signed.iter().map(|(k, sign, _)| columns[*k].g * *sign).collect::<Vec<_>>());
    let z = DVector::from_iterator(signed.len(), signed.iter().map(|c| c.2));
    let inner = g.transpose() * &g;
    let Some(sparse) = nonnegative(&inner, &z, level.max(s.price * best)) else { return vec![] };
    let largest = sparse.iter().copied().fold(0.0, f64::max);
    let entered: Vec<usize> = (0..sparse.len()).filter(|k| sparse[*k] > s.entered * largest).collect();
    let relaxed = nonnegative(&inner.select_rows(&entered).select_columns(&entered), &z.select_rows(&entered), 0.0);
    let Some(relaxed) = relaxed else { return vec![] };
    let mut shares: Vec<(usize, f64)> = Vec::new();
    for (k, b) in entered.iter().zip(&relaxed) {
        let candidate = columns[signed[*k].0].candidate;
        let part = b * z[*k];
        match shares.iter_mut().find(|c| c.0 == candidate) {
            Some(c) => c.1 += part,
            None => shares.push((candidate, part)),
        }
    }
    let whole: f64 = shares.iter().map(|c| c.1).sum();
    shares.iter_mut().for_each(|c| c.1 /= whole.max(f64::MIN_POSITIVE));
    shares.retain(|part| part.1 > s.word);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}

/// argmin 1/2 b'Gb - z'b + price sum b over b >= 0.
fn nonnegative(inner: &DMatrix<f64>, z: &DVector<f64>, price: f64) -> Option<Vec<f64>> {
    let n = z.len();
    // In units of the largest correlation, where everything is of order one.
    let size = z.amax();
    if n == 0 || size <= 0.0 {
        return None;
    }
    let mut program = Program::new(n);
    for j in 0..n {
        for i in 0..=j {
            // Columns that are nearly one share their weight instead of leaving it open.
            program.quadratic.push((i, j, inner[(i, j)] + if i == j { f64::EPSILON.sqrt() } else { 0.0 }));
        }
        program.linear[j] = (price - z[j]) / size;
        program.at_most(vec![(j, -1.0)], 0.0);
    }
    let found = program.solve()?;
    Some(found.x.iter().map(|b| b.max(0.0) * size).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(values: &[f64]) -> DVector<f64> {
        DVector::from_column_slice(values).normalize()
    }

    /// A column that correlates most with a sum of two is not one of the two: one at a time it wins, all at once the two do.
    #[test]
    fn a_sum_of_two_is_not_taken_for_what_lies_between() {
        let (a, b) = (unit(&[1.0, 0.0, 0.0, 0.0]), unit(&[0.0, 1.0, 0.0, 0.0]));
        let between = unit(&[1.0, 1.0, 0.9, 0.0]);
        let columns: Vec<Column> =
            [&between, &a, &b].into_iter().enumerate().map(|(candidate, g)| Column { g, two_sided: false, candidate }).collect();
        let r = -100.0 * (&a + &b);
        assert!(between.dot(&r) < a.dot(&r));
        let found = select(&r, &columns, 3.0, &Scoring::default());
        let names: Vec<usize> = found.iter().map(|f| f.0).collect();
        assert!(names.contains(&1) && names.contains(&2) && !names.contains(&0), "{found:?}");
        approx::assert_relative_eq!(found.iter().map(|f| f.1).sum::<f64>(), 1.0, max_relative = 1e-6);
    }

    #[test]
    fn a_strength_keeps_its_sign_and_chance_is_not_selected() {
        let g = unit(&[1.0, 2.0, 3.0]);
        let column = |two_sided| [Column { g: &g, two_sided, candidate: 4 }];
        assert!(select(&(50.0 * &g), &column(false), 3.0, &Scoring::default()).is_empty());
        assert_eq!(select(&(50.0 * &g), &column(true), 3.0, &Scoring::default()), vec![(4, 1.0)]);
        assert_eq!(select(&(-50.0 * &g), &column(false), 3.0, &Scoring::default()), vec![(4, 1.0)]);
        assert!(select(&(-2.0 * &g), &column(false), 3.0, &Scoring::default()).is_empty());
    }
}
