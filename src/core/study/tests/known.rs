//! What a fit was computed with a moment ago is not computed again.

use std::sync::Arc;

use super::{Folder, ONE};
use crate::diagnose::Case;
use crate::diagnose::results::SplitName;
use crate::identify::LeastSquares;
use crate::residual::{Memo, Problem};

#[test]
fn residuals_at_values_that_are_known_are_those_that_were_kept() {
    let case = Case::from_study(&Folder::one(ONE).load().unwrap(), 1).unwrap();
    let memo = Arc::new(Memo::default());
    let problem = Problem { memo: Some(memo.clone()), ..Problem::new(case.plans_of(SplitName::Fit), case.system.clone()) };
    let p = problem.variables();
    let computed = problem.residuals(&p).unwrap();
    // Kept values that no computation gives, so that it shows where they come from.
    let mut kept = problem.compute(&p, true).unwrap();
    let sigma = problem.plans[0].sigma[0];
    kept[0].values[0] += 5.0 * sigma;
    memo.keep(&case.system, &problem.free, Arc::new(kept));
    let known = problem.residuals(&p).unwrap();
    assert!(((known - &computed).norm() - 5.0).abs() < 1e-6);
    // Other values are computed.
    let beside: Vec<f64> = p.iter().map(|v| v * (1.0 + 1e-9)).collect();
    assert!((problem.residuals(&beside).unwrap() - &computed).norm() < 1e-3);
}
