//! Damping of modes that were not fitted, held against one constant ratio: a model is worth its parameters where it says more than that.

use crate::data::TestKind;
use crate::response::{Block, Computed, Plan};

use super::accept::STANDARD_ERRORS;
use super::case::Case;
use super::results::{ConstantDamping, SplitName};

/// The block of a modal test that holds its damping ratios, by their logarithms.
const BLOCK: &str = "modal_damping";

/// Rows of the damping ratios that are compared.
fn rows(plan: &Plan) -> impl Iterator<Item = usize> {
    let of = |b: &Block| b.range.clone().filter(|row| !plan.left_out.contains(row)).collect::<Vec<usize>>();
    plan.blocks.iter().filter(|b| plan.kind == TestKind::Modal && b.role == BLOCK).flat_map(of).collect::<Vec<_>>().into_iter()
}

/// Mean of the damping ratios measured of the modes that are fitted; none where there are none.
pub fn fitted_ratio(case: &Case) -> Option<f64> {
    let ratios: Vec<f64> = case.plans_of(SplitName::Fit).iter().flat_map(|p| rows(p).map(|k| p.measured[k].exp())).collect();
    (!ratios.is_empty()).then(|| ratios.iter().sum::<f64>() / ratios.len() as f64)
}

/// What the constant `ratio` does on the modes of a test that is not fitted, beside the model; none where fewer than two are compared.
pub fn constant_damping(plan: &Plan, split: SplitName, computed: &Computed, ratio: Option<f64>) -> Option<ConstantDamping> {
    let (ratio, rows) = (ratio.filter(|_| split != SplitName::Fit)?, rows(plan).collect::<Vec<_>>());
    let n = rows.len() as f64;
    if rows.len() < 2 {
        return None;
    }
    let mean = |of: &dyn Fn(usize) -> f64| rows.iter().map(|k| of(*k)).sum::<f64>() / n;
    let model = |k: usize| (computed.values[k] - plan.measured[k]).exp_m1();
    let constant = |k: usize| ratio / plan.measured[k].exp() - 1.0;
    let gain_of = |k: usize| constant(k).powi(2) - model(k).powi(2);
    let gain = mean(&gain_of);
    let standard_error = (rows.iter().map(|k| (gain_of(*k) - gain).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    let verdict = match gain {
        g if g > STANDARD_ERRORS * standard_error => "better",
        g if g < -STANDARD_ERRORS * standard_error => "worse",
        _ => "tied",
    };
    let rms = |of: &dyn Fn(usize) -> f64| mean(&|k| of(k).powi(2)).sqrt();
    Some(ConstantDamping { ratio, modes: rows.len(), model: rms(&model), constant: rms(&constant), gain, standard_error, verdict })
}
