//! Damping of modes that were not fitted, held against one constant ratio: a model is worth its parameters where it says more than that.

use crate::data::TestKind;
use crate::response::{Computed, Plan};

use super::case::Case;
use crate::diagnose::results::{Against, ConstantDamping, SplitName};

/// The block of a modal test that holds its damping ratios, by their logarithms.
const BLOCK: &str = "modal_damping";

/// Rows of the damping ratios that are compared.
fn rows(plan: &Plan) -> Vec<usize> {
    let ratios = plan.blocks.iter().filter(|b| plan.kind == TestKind::Modal && b.role == BLOCK);
    ratios.flat_map(|b| b.range.clone()).filter(|row| !plan.left_out.contains(row)).collect()
}

/// Mean of the damping ratios measured of the modes that are fitted; none where there are none.
pub fn fitted_ratio(case: &Case) -> Option<f64> {
    let ratios: Vec<f64> = case.plans_of(SplitName::Fit).iter().flat_map(|p| rows(p).into_iter().map(|k| p.measured[k].exp())).collect();
    (!ratios.is_empty()).then(|| ratios.iter().sum::<f64>() / ratios.len() as f64)
}

/// What the constant `ratio` does on the modes of a test that is not fitted, beside the model; none where fewer than two are compared.
pub fn constant_damping(plan: &Plan, split: SplitName, computed: &Computed, ratio: Option<f64>, sure: f64) -> Option<ConstantDamping> {
    let (ratio, rows) = (ratio.filter(|_| split != SplitName::Fit)?, rows(plan));
    let measured: Vec<f64> = rows.iter().map(|k| plan.measured[*k].exp()).collect();
    let model: Vec<f64> = rows.iter().map(|k| computed.values[*k].exp()).collect();
    against_constant(&measured, &model, ratio, sure)
}

/// Damping ratios of a model beside a constant one, which differ by `sure` standard errors; none where fewer than two are compared.
fn against_constant(measured: &[f64], model: &[f64], ratio: f64, sure: f64) -> Option<ConstantDamping> {
    if measured.len() < 2 {
        return None;
    }
    let n = measured.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let square = |computed: f64, measured: f64| (computed / measured - 1.0).powi(2);
    let of_model: Vec<f64> = model.iter().zip(measured).map(|(c, m)| square(*c, *m)).collect();
    let of_constant: Vec<f64> = measured.iter().map(|m| square(ratio, *m)).collect();
    let gains: Vec<f64> = of_constant.iter().zip(&of_model).map(|(c, m)| c - m).collect();
    let gain = mean(&gains);
    let standard_error = (gains.iter().map(|g| (g - gain).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    let verdict = match gain {
        g if g > sure * standard_error => Against::Better,
        g if g < -sure * standard_error => Against::Worse,
        _ => Against::Tied,
    };
    let (model, constant) = (mean(&of_model).sqrt(), mean(&of_constant).sqrt());
    Some(ConstantDamping { ratio, modes: measured.len(), model, constant, gain, standard_error, verdict })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_better_worse_or_tied_with_one_constant_ratio() {
        let measured = [0.02, 0.03, 0.025, 0.022, 0.028];
        let off = |by: f64| measured.map(|m| m * (1.0 + by));
        let said = |model: &[f64], ratio: f64| against_constant(&measured, model, ratio, 2.0).unwrap();
        // Off by a hundredth, against a ratio twice as large as any.
        let better = said(&off(0.01), 0.05);
        assert_eq!(better.verdict, Against::Better);
        assert!((better.model - 0.01).abs() < 1e-12 && better.modes == 5);
        // 0.05/m - 1 = 1.5, 2/3, 1, 14/11, 11/14.
        let constant = ((2.25 + 4.0 / 9.0 + 1.0 + (14.0f64 / 11.0).powi(2) + (11.0f64 / 14.0).powi(2)) / 5.0).sqrt();
        assert!((better.constant - constant).abs() < 1e-12);
        assert_eq!(said(&off(1.0), 0.025).verdict, Against::Worse);
        // As far off as the constant, over as many modes.
        assert_eq!(said(&[0.025; 5].map(|c| c * 1.001), 0.025).verdict, Against::Tied);
        assert!(against_constant(&measured[..1], &measured[..1], 0.02, 2.0).is_none());
    }
}
