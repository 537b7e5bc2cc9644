//! Picking the poles that stay.

use super::StablePole;
use num_complex::Complex64;

/// A pole that stands in many orders.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    pub pole: Complex64,
    pub orders: usize,
}

/// Part of the orders a pole has to be stable in.
const SHARE: f64 = 0.25;

/// Groups the stable poles by their distance in the complex plane, measured in their own half bandwidth, and keeps the groups that stand in
/// a quarter of the orders. The densest group is taken first, so that of two close modes each keeps its own.
pub(super) fn pick(diagram: &mut [StablePole], highest: usize) -> Vec<Candidate> {
    let stable: Vec<&StablePole> = diagram.iter().filter(|p| p.stable).collect();
    let reach = |p: &StablePole| 0.25 * p.pole.re.abs() + 0.0015 * p.pole.norm();
    // A broad pole between two narrow ones must not gather both.
    let near = |p: &StablePole, q: &StablePole| (p.pole - q.pole).norm() < reach(p).min(reach(q));
    let mut free: Vec<bool> = vec![true; stable.len()];
    let mut found = Vec::new();
    let needed = ((SHARE * (highest - 1) as f64) as usize).max(3);
    loop {
        let members = |i: usize| -> Vec<usize> { (0..stable.len()).filter(|j| free[*j] && near(stable[i], stable[*j])).collect() };
        let best = (0..stable.len()).filter(|i| free[*i]).map(members).max_by_key(Vec::len);
        let Some(group) = best.filter(|g| !g.is_empty()) else { break };
        let mut orders: Vec<usize> = group.iter().map(|i| stable[*i].order).collect();
        orders.dedup();
        if orders.len() < needed {
            break;
        }
        let median = |part: fn(&Complex64) -> f64| {
            let mut v: Vec<f64> = group.iter().map(|i| part(&stable[*i].pole)).collect();
            v.sort_by(f64::total_cmp);
            v[v.len() / 2]
        };
        found.push(Candidate { pole: Complex64::new(median(|p| p.re), median(|p| p.im)), orders: orders.len() });
        group.iter().for_each(|i| free[*i] = false);
    }
    found
}
