//! The energy over two tolerances (Fig. 23 of the paper): as printed, as the model has it, as a law has it.
//!
//! The cases span a grid of the two tolerances. Between them the quantities of the table are interpolated bilinearly, the energies in
//! their logarithms; a law is evaluated at the interpolated quantities.

use super::{Cases, Law, Laws, ToleranceError};

/// The surface, row by row of the first tolerance.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Names of the two tolerances.
    pub axes: [String; 2],
    /// Points: the two tolerances [m], W_D printed, of the model with the one scale, and of the law [J].
    pub points: Vec<[f64; 5]>,
    /// Points along either tolerance.
    pub shape: [usize; 2],
}

impl Surface {
    /// The surface with `finer` points from one case to the next. `model` holds the scaled energies of the cases.
    pub fn of(
        cases: &Cases,
        axes: [&str; 2],
        quantities: &[String],
        model: &[f64],
        laws: &Laws,
        law: &Law,
        finer: usize,
    ) -> Result<Surface, ToleranceError> {
        let levels = axes.map(|a| {
            let mut v = cases.of(a);
            v.sort_by(f64::total_cmp);
            v.dedup();
            v
        });
        let (x, y) = (cases.of(axes[0]), cases.of(axes[1]));
        let at = |a: f64, b: f64| (0..x.len()).find(|k| x[*k] == a && y[*k] == b);
        let mut grid = Vec::new();
        for a in &levels[0] {
            for b in &levels[1] {
                let missing = ToleranceError::TooFew {
                    what: format!("a surface over {} and {}", axes[0], axes[1]),
                    found: x.len(),
                    needed: levels[0].len() * levels[1].len(),
                };
                grid.push(at(*a, *b).ok_or(missing)?);
            }
        }
        let columns = levels[1].len();
        let places = |l: &[f64]| -> Vec<(usize, f64)> {
            let inner = (0..l.len().saturating_sub(1)).flat_map(|k| (0..finer).map(move |j| (k, j as f64 / finer as f64)));
            inner.chain([(l.len().saturating_sub(2), 1.0)]).collect()
        };
        let (rows, lines) = (places(&levels[0]), places(&levels[1]));
        let values: Vec<Vec<f64>> = quantities.iter().map(|q| cases.of(q)).collect();
        let energies = cases.energies();
        let mut points = Vec::with_capacity(rows.len() * lines.len());
        for (i, s) in &rows {
            for (j, t) in &lines {
                let corner = |di: usize, dj: usize| {
                    let (i, j) = ((i + di).min(levels[0].len() - 1), (j + dj).min(columns - 1));
                    grid[i * columns + j]
                };
                let mixed = |f: &dyn Fn(usize) -> f64| {
                    (1.0 - s) * ((1.0 - t) * f(corner(0, 0)) + t * f(corner(0, 1)))
                        + s * ((1.0 - t) * f(corner(1, 0)) + t * f(corner(1, 1)))
                };
                let here: Vec<f64> = values.iter().map(|v| mixed(&|k| v[k])).collect();
                points.push([
                    mixed(&|k| x[k]),
                    mixed(&|k| y[k]),
                    mixed(&|k| energies[k].ln()).exp(),
                    mixed(&|k| model.get(k).copied().unwrap_or(f64::NAN).ln()).exp(),
                    laws.energy(law, &here),
                ]);
            }
        }
        Ok(Surface { axes: axes.map(String::from), points, shape: [rows.len(), lines.len()] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tolerance::Case;
    use crate::units::{Dimension, Unit};

    #[test]
    fn the_surface_passes_through_the_cases() {
        let case = |k: usize| {
            let (a, b) = ([0.1, 0.7, 1.3][k / 3], [0.05, 0.7, 1.3][k % 3]);
            Case {
                name: (k + 1).to_string(),
                values: [("a".to_string(), a), ("b".to_string(), b)].into(),
                energy: 1.0 + a * b + 0.1 * k as f64,
            }
        };
        let mut cases = Cases { cases: (0..9).map(case).collect(), units: Default::default(), energy_unit: Unit::si(Dimension::ENERGY) };
        let names = ["a".to_string(), "b".to_string()];
        let laws = Laws::new(&cases, &names, 1);
        let law = laws.fitted(0, &[0.0; 9]).unwrap();
        let s = Surface::of(&cases, ["a", "b"], &names, &[2.0; 9], &laws, &law, 4).unwrap();
        assert_eq!((s.shape, s.points.len()), ([9, 9], 81));
        for c in &cases.cases {
            let p = s.points.iter().find(|p| (p[0] - c.values["a"]).abs() < 1e-12 && (p[1] - c.values["b"]).abs() < 1e-12).unwrap();
            assert!((p[2] / c.energy - 1.0).abs() < 1e-12 && (p[3] - 2.0).abs() < 1e-12 && (p[4] - 1.0).abs() < 1e-9);
        }
        cases.cases.pop();
        assert!(Surface::of(&cases, ["a", "b"], &names, &[2.0; 8], &laws, &law, 4).is_err());
    }
}
