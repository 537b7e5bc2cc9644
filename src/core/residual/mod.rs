//! Residuals: computed minus measured over sigma, block after block, and the error of a test.
//!
//! **error** = rms(measured - computed) / rms(measured - mean), a complex FRF without the mean; channels of a test are pooled as root
//! mean square. **floor** = the same with sigma in place of the difference. Energies, which run over decades: root mean square of
//! `|ln(computed / measured)|`, and sigma/measured for the floor (design.md section 4).

mod approach;
mod common;
mod memo;

use std::sync::Arc;

use crate::explain::Explain;
use crate::parallel;
use nalgebra::{DMatrix, DMatrixViewMut, DVector};

use crate::identify::{EvalError, LeastSquares};
use crate::model::{FreeParam, System};
use crate::response::{BlockKind, Computed, Plan, ResponseError};

pub use approach::Approach;
pub use common::Common;
pub use memo::{Memo, Recent};

/// The least-squares problem of a set of tests in the free parameters of a system.
///
/// Variables are the parameters, or their logarithms where [`FreeParam::log`].
#[derive(Clone)]
pub struct Problem<'a> {
    /// Tests.
    pub plans: Vec<&'a Plan>,
    /// The system; its values serve where a parameter is not free.
    pub system: System,
    /// Free parameters.
    pub free: Vec<FreeParam>,
    /// What was computed of these tests a moment ago.
    pub memo: Option<Arc<Memo>>,
    /// Errors that tests have in common, beside those that each has by itself.
    pub common: Option<Arc<Common>>,
}

impl<'a> Problem<'a> {
    /// A problem over the given tests.
    pub fn new(plans: Vec<&'a Plan>, system: System) -> Self {
        let free = system.free();
        Problem { plans, system, free, memo: None, common: None }
    }

    /// Variables at the system's present values.
    pub fn variables(&self) -> Vec<f64> {
        self.free.iter().map(|f| f.variable(self.system.instances[f.instance].params[f.param].value)).collect()
    }

    /// The system at the given variables.
    pub fn system_at(&self, p: &[f64]) -> System {
        self.system.at_variables(&self.free, p)
    }

    /// Computed responses of every test at the given variables, tests in parallel.
    pub fn compute(&self, p: &[f64], sensitivities: bool) -> Result<Vec<Computed>, ResponseError> {
        let system = self.system_at(p);
        parallel::map(&self.plans, |plan| plan.evaluate(&system, &self.free, sensitivities)).into_iter().collect()
    }

    /// Responses with sensitivities, computed unless they are known.
    fn sensed(&self, p: &[f64]) -> Result<Arc<Vec<Computed>>, ResponseError> {
        let Some(memo) = &self.memo else { return self.compute(p, true).map(Arc::new) };
        let system = self.system_at(p);
        if let Some(known) = memo.find(&system, &self.free) {
            return Ok(known);
        }
        let computed = Arc::new(self.compute(p, true)?);
        memo.keep(&system, &self.free, computed.clone());
        Ok(computed)
    }

    fn whitened(&self, computed: &[Computed]) -> Result<DVector<f64>, EvalError> {
        let mut r = DVector::zeros(self.n_residuals());
        let mut row = 0;
        for (plan, c) in self.plans.iter().zip(computed) {
            let of_test = plan.whitened(&c.values);
            if !of_test.norm_squared().is_finite() {
                let reason = format!("test `{}`: the sum of the squares of (computed - measured) / sigma is no number", plan.id);
                return Err(EvalError::at(&plan.id, reason, "a sigma that is no smaller than the instruments' noise"));
            }
            r.rows_mut(row, plan.len()).copy_from(&of_test);
            row += plan.len();
        }
        if let Some(common) = &self.common {
            common.whiten(DMatrixViewMut::from_slice(r.as_mut_slice(), self.n_residuals(), 1));
        }
        Ok(r)
    }
}

/// A test that cannot be computed, as the fit sees it.
fn failed(e: &ResponseError) -> EvalError {
    EvalError::at(e.place(), e.to_string(), e.accepted())
}

impl LeastSquares for Problem<'_> {
    fn n_params(&self) -> usize {
        self.free.len()
    }
    fn n_residuals(&self) -> usize {
        self.plans.iter().map(|p| p.len()).sum()
    }
    fn residuals(&self, p: &[f64]) -> Result<DVector<f64>, EvalError> {
        let known = self.memo.as_ref().and_then(|memo| memo.find(&self.system_at(p), &self.free));
        match known {
            Some(computed) => self.whitened(&computed),
            None => self.whitened(&self.compute(p, false).map_err(|e| failed(&e))?),
        }
    }
    fn jacobian(&self, p: &[f64]) -> Result<(DVector<f64>, DMatrix<f64>), EvalError> {
        let computed = self.sensed(p).map_err(|e| failed(&e))?;
        let n = self.free.len();
        let mut j = DMatrix::zeros(self.n_residuals(), n);
        let mut row = 0;
        for (plan, c) in self.plans.iter().zip(computed.iter()) {
            for i in 0..plan.len() {
                for k in 0..n {
                    j[(row, k)] = c.slopes[i * n + k];
                }
                row += 1;
            }
            plan.whiten(j.rows_mut(row - plan.len(), plan.len()));
        }
        if let Some(common) = &self.common {
            common.whiten(j.as_view_mut());
        }
        Ok((self.whitened(&computed)?, j))
    }
}

/// How far computed values lie from a test.
#[derive(Clone, Debug, PartialEq)]
pub struct TestError {
    /// Relative error.
    pub error: f64,
    /// The same with sigma in place of the difference.
    pub floor: f64,
    /// Root mean square of the whitened residuals.
    pub whitened_rms: f64,
    /// Row of the largest whitened residual, and its block.
    pub worst: (usize, usize),
}

/// Error, floor and worst point of a test.
pub fn test_error(plan: &Plan, computed: &[f64]) -> TestError {
    let (mut error, mut floor, mut whitened, mut worst) = (0.0, 0.0, 0.0, (0, 0, -1.0));
    for (b, block) in plan.blocks.iter().enumerate() {
        let rows = || block.range.clone().filter(|row| !plan.left_out.contains(row));
        let of = |values: &[f64]| rows().map(|row| values[row]).collect::<Vec<f64>>();
        let (e, f) = block_error(block.kind, &of(&plan.measured), &of(computed), &of(&plan.sigma));
        error += e * e;
        floor += f * f;
        for i in rows() {
            let w = ((computed[i] - plan.measured[i]) / plan.sigma[i]).abs();
            whitened += w * w;
            if w > worst.2 {
                worst = (i, b, w);
            }
        }
    }
    let blocks = plan.blocks.len().max(1) as f64;
    TestError {
        error: (error / blocks).sqrt(),
        floor: (floor / blocks).sqrt(),
        whitened_rms: (whitened / plan.len().saturating_sub(plan.left_out.len()).max(1) as f64).sqrt(),
        worst: (worst.0, worst.1),
    }
}

fn block_error(kind: BlockKind, measured: &[f64], computed: &[f64], sigma: &[f64]) -> (f64, f64) {
    let n = measured.len().max(1) as f64;
    let rms = |it: &mut dyn Iterator<Item = f64>| (it.map(|v| v * v).sum::<f64>() / n).sqrt();
    let size = mean_square(kind, measured).sqrt();
    (rms(&mut measured.iter().zip(computed).map(|(m, c)| m - c)) / size, rms(&mut sigma.iter().copied()) / size)
}

/// Mean square of a channel's measured values, to which its error is relative: of an FRF as it stands, of a loop and a record about their mean
/// [squared SI unit of the channel], of a table of logarithms 1.
pub fn mean_square(kind: BlockKind, measured: &[f64]) -> f64 {
    let n = measured.len().max(1) as f64;
    let mean = if kind == BlockKind::Frf { 0.0 } else { measured.iter().sum::<f64>() / n };
    match kind {
        BlockKind::Table => 1.0,
        _ => (measured.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / n).max(f64::MIN_POSITIVE.sqrt()),
    }
}
