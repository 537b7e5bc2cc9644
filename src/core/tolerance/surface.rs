//! The energy over two tolerances (Fig. 23 of the paper): as printed, and as every model and law has it.
//!
//! The cases span a grid of the two tolerances. Between them what is known case by case is interpolated bilinearly, energies in their logarithms.

use super::{Cases, ToleranceError};

/// One energy over the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Name.
    pub name: String,
    /// W_D [J], row by row of the first tolerance.
    pub energy: Vec<f64>,
}

/// The surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// Names of the two tolerances.
    pub axes: [String; 2],
    /// The two tolerances of every point [m], row by row of the first.
    pub points: Vec<[f64; 2]>,
    /// Points along either tolerance.
    pub shape: [usize; 2],
    /// Energies: the first is the table's.
    pub layers: Vec<Layer>,
}

/// Where the cases stand on the grid.
struct Grid {
    /// Case of each node, row by row.
    nodes: Vec<usize>,
    rows: usize,
    columns: usize,
}

impl Grid {
    fn of(cases: &Cases, axes: [&str; 2]) -> Result<Grid, ToleranceError> {
        let levels = axes.map(|a| {
            let mut v = cases.of(a);
            v.sort_by(f64::total_cmp);
            v.dedup();
            v
        });
        let (x, y) = (cases.of(axes[0]), cases.of(axes[1]));
        let missing = || ToleranceError::TooFew {
            what: format!("a surface over {} and {}", axes[0], axes[1]),
            found: x.len(),
            needed: levels[0].len() * levels[1].len(),
        };
        let at = |a: &f64, b: &f64| (0..x.len()).find(|k| x[*k] == *a && y[*k] == *b).ok_or_else(missing);
        let nodes = levels[0].iter().flat_map(|a| levels[1].iter().map(move |b| (a, b))).map(|(a, b)| at(a, b));
        Ok(Grid { nodes: nodes.collect::<Result<_, _>>()?, rows: levels[0].len(), columns: levels[1].len() })
    }

    /// What is known case by case, at a part `s`, `t` of the way from node (i, j) to the next ones.
    fn mixed(&self, (i, s): (usize, f64), (j, t): (usize, f64), values: &[f64]) -> f64 {
        let corner = |di: usize, dj: usize| {
            let (i, j) = ((i + di).min(self.rows - 1), (j + dj).min(self.columns - 1));
            values[self.nodes[i * self.columns + j]]
        };
        (1.0 - s) * ((1.0 - t) * corner(0, 0) + t * corner(0, 1)) + s * ((1.0 - t) * corner(1, 0) + t * corner(1, 1))
    }
}

impl Surface {
    /// The surface with `finer` points from one case to the next, of energies known at the cases, by name.
    pub fn of(cases: &Cases, axes: [&str; 2], known: &[(String, Vec<f64>)], finer: usize) -> Result<Surface, ToleranceError> {
        let grid = Grid::of(cases, axes)?;
        let places = |n: usize| -> Vec<(usize, f64)> {
            let inner = (0..n.saturating_sub(1)).flat_map(|k| (0..finer).map(move |j| (k, j as f64 / finer as f64)));
            inner.chain([(n.saturating_sub(2), 1.0)]).collect()
        };
        let (rows, lines) = (places(grid.rows), places(grid.columns));
        let (x, y) = (cases.of(axes[0]), cases.of(axes[1]));
        let all: Vec<((usize, f64), (usize, f64))> = rows.iter().flat_map(|r| lines.iter().map(move |l| (*r, *l))).collect();
        let points = all.iter().map(|(r, l)| [grid.mixed(*r, *l, &x), grid.mixed(*r, *l, &y)]).collect();
        let mut layers: Vec<Layer> = Vec::new();
        for (name, energies) in known {
            let logs: Vec<f64> = energies.iter().map(|w| w.ln()).collect();
            layers.push(Layer { name: name.clone(), energy: all.iter().map(|(r, l)| grid.mixed(*r, *l, &logs).exp()).collect() });
        }
        Ok(Surface { axes: axes.map(String::from), points, shape: [rows.len(), lines.len()], layers })
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
            let values = [("a".to_string(), a), ("b".to_string(), b)].into();
            Case { name: (k + 1).to_string(), values, energy: 1.0 + a * b + 0.1 * k as f64, stored: None, place: String::new() }
        };
        let mut cases = Cases { cases: (0..9).map(case).collect(), units: Default::default(), energy_unit: Unit::si(Dimension::ENERGY) };
        let known = [("printed".to_string(), cases.energies())];
        let s = Surface::of(&cases, ["a", "b"], &known, 4).unwrap();
        assert_eq!((s.shape, s.points.len(), s.layers.len()), ([9, 9], 81, 1));
        for c in &cases.cases {
            let k = s.points.iter().position(|p| (p[0] - c.values["a"]).abs() < 1e-12 && (p[1] - c.values["b"]).abs() < 1e-12).unwrap();
            assert!((s.layers[0].energy[k] / c.energy - 1.0).abs() < 1e-12);
        }
        cases.cases.pop();
        assert!(Surface::of(&cases, ["a", "b"], &[], 4).is_err());
    }
}
