//! What a fit from a distant start goes by until its resonances lie near the measured ones.
//!
//! The difference of two complex FRFs whose peaks do not overlap falls as a peak is flattened, not as it is moved: from a stiffness that is
//! off by a factor, least squares ends in a damper that holds everything still. The logarithm of the magnitude carries the lines between
//! the peaks, compliance below and mass above, and leads there from far (Arruda and Santos, Mech. Syst. Signal Process. 7(6), 1993, take it
//! for the same reason).
//!
//! A line of an FRF becomes `ln(|H computed| / |H measured|)` in units of [`FRF_FACTOR`] or of its own noise, whichever is larger; any
//! other point its difference in units of [`PART`] of its channel's rms about its mean, or of its sigma. Every channel counts alike, by its mean
//! square: here it is not the number of lines that says which measurement leads.

use nalgebra::{DMatrix, DVector};

use crate::identify::{EvalError, LeastSquares};
use crate::response::{Block, BlockKind, Plan};

use super::Problem;

/// Natural logarithm of the factor by which a line of an FRF may be off for one unit.
const FRF_FACTOR: f64 = 0.3;
/// Part of a channel's root mean square about its mean by which a point may be off for one unit; of a table, whose values are logarithms, the logarithm.
const PART: f64 = 0.1;
/// Least magnitude against the measured one: a line on which nothing moves says no more than that.
const STILL: f64 = 1e-6;

/// The tests of a problem, compared from afar.
pub struct Approach<'a, 'p> {
    problem: &'a Problem<'p>,
    rows: usize,
}

impl<'a, 'p> Approach<'a, 'p> {
    /// The same tests and parameters as those of `problem`.
    pub fn new(problem: &'a Problem<'p>) -> Self {
        let rows = problem.plans.iter().flat_map(|p| &p.blocks).map(points).sum();
        Approach { problem, rows }
    }

    fn filled(&self, p: &[f64], mut slopes: Option<&mut DMatrix<f64>>) -> Result<DVector<f64>, EvalError> {
        let computed = self.problem.compute(p, slopes.is_some()).map_err(|e| super::failed(&e))?;
        let n = self.problem.free.len();
        let mut r = DVector::zeros(self.rows);
        let mut row = 0;
        for (plan, c) in self.problem.plans.iter().zip(&computed) {
            for block in &plan.blocks {
                let scale = part_of(block, plan);
                let share = (points(block).max(1) as f64).sqrt();
                for k in 0..points(block) {
                    if block.kind == BlockKind::Frf {
                        let (re, im) = (block.range.start + 2 * k, block.range.start + 2 * k + 1);
                        let measured = plan.measured[re].hypot(plan.measured[im]).max(plan.sigma[re]);
                        let size = c.values[re].hypot(c.values[im]);
                        let unit = share * FRF_FACTOR.max(plan.sigma[re] / measured);
                        r[row] = (size.max(STILL * measured) / measured).ln() / unit;
                        if let Some(j) = slopes.as_deref_mut().filter(|_| size > STILL * measured) {
                            for q in 0..n {
                                let along = c.values[re] * c.slopes[re * n + q] + c.values[im] * c.slopes[im * n + q];
                                j[(row, q)] = along / (size * size * unit);
                            }
                        }
                    } else {
                        let at = block.range.start + k;
                        let unit = share * scale.max(plan.sigma[at]);
                        r[row] = (c.values[at] - plan.measured[at]) / unit;
                        if let Some(j) = slopes.as_deref_mut() {
                            (0..n).for_each(|q| j[(row, q)] = c.slopes[at * n + q] / unit);
                        }
                    }
                    row += 1;
                }
            }
        }
        Ok(r)
    }
}

impl LeastSquares for Approach<'_, '_> {
    fn n_params(&self) -> usize {
        self.problem.n_params()
    }
    fn n_residuals(&self) -> usize {
        self.rows
    }
    fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        self.filled(p, None)
    }
    fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> {
        let mut j = DMatrix::zeros(self.rows, self.problem.free.len());
        let r = self.filled(p, Some(&mut j))?;
        Ok((r, j))
    }
}

fn points(block: &Block) -> usize {
    if block.kind == BlockKind::Frf { block.abscissa.len() } else { block.range.len() }
}

fn part_of(block: &Block, plan: &Plan) -> f64 {
    if block.kind == BlockKind::Table {
        return PART;
    }
    let values = &plan.measured[block.range.clone()];
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    PART * (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}
