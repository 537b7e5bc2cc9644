//! Conditions that are known to a deviation (`i = "0.4 mm +- 0.02 mm"`): what that is worth in the residuals.

use nalgebra::DMatrix;

use crate::model::{Level, System};
use crate::parallel;
use crate::response::Plan;

/// Whitened change of the residuals of these tests, one after the other, per standard deviation of every condition that states one and that the model
/// depends on: a column for each value of a condition, since tests at one value have it from the same shim. Central differences over one standard deviation to
/// either side.
///
/// A condition that cannot be moved so far (a chain that buckles) has no column.
pub(in crate::diagnose) fn columns(plans: &[&Plan], system: &System) -> DMatrix<f64> {
    let mut values: Vec<(&str, f64, f64)> = plans
        .iter()
        .flat_map(|p| p.condition_sigmas.iter().filter_map(|(name, sigma)| Some((name.as_str(), *p.conditions.get(name)?, *sigma))))
        .filter(|(name, _, _)| depends(system, name))
        .collect();
    values.sort_by(|a, b| a.0.cmp(b.0).then(a.1.total_cmp(&b.1)));
    values.dedup_by(|a, b| a.0 == b.0 && a.1 == b.1);
    let rows: usize = plans.iter().map(|p| p.len()).sum();
    let column = |(name, value, sigma): &(&str, f64, f64)| -> Option<Vec<f64>> {
        let mut all = Vec::with_capacity(rows);
        for plan in plans {
            if plan.conditions.get(*name) != Some(value) {
                all.extend(std::iter::repeat_n(0.0, plan.len()));
                continue;
            }
            let at = |by: f64| Some(plan.whitened(&plan.beside(name, by).evaluate(system, &[], false).ok()?.values));
            all.extend(((at(*sigma)? - at(-*sigma)?) * 0.5).iter());
        }
        Some(all)
    };
    let found: Vec<f64> = parallel::map(&values, column).into_iter().flatten().flatten().collect();
    DMatrix::from_vec(rows, found.len().checked_div(rows).unwrap_or(0), found)
}

/// Whether a law or a load of the model follows a condition.
fn depends(system: &System, name: &str) -> bool {
    let law = system.instances.iter().any(|i| i.target.as_ref().is_some_and(|t| t.condition == name));
    law || system.model.loads.iter().flat_map(|l| &l.path).any(|l| matches!(l, Level::Condition(c, _) if c == name))
}
