//! Bounds, monotone orders and linear rows on the parameters.

use super::{IdentifyError, feasibility};
use serde::{Deserialize, Serialize};

/// The order p[below] + gap <= p[above].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Order {
    pub below: usize,
    pub above: usize,
    pub gap: f64,
}

/// The linear row sum_j a_j p_j <= limit, as (index, a_j) pairs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinearRow {
    pub coefficients: Vec<(usize, f64)>,
    pub limit: f64,
}

/// The feasible set of a fit: lower <= p <= upper, orders, linear rows. Infinite bounds mean none.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Constraints {
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub orders: Vec<Order>,
    pub rows: Vec<LinearRow>,
}

/// Where one inequality a'p <= b comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Source {
    Lower(usize),
    Upper(usize),
    Order(usize),
    Row(usize),
}

/// One inequality a'p <= b.
#[derive(Debug, Clone)]
pub(crate) struct Inequality {
    pub a: Vec<(usize, f64)>,
    pub b: f64,
    pub source: Source,
}

impl Inequality {
    /// b - a'p, negative when violated.
    pub fn slack(&self, p: &[f64]) -> f64 {
        self.b - self.a.iter().map(|&(j, a)| a * p[j]).sum::<f64>()
    }

    /// Size of the terms, against which rounding of the slack is judged.
    pub fn magnitude(&self, p: &[f64]) -> f64 {
        self.b.abs() + self.a.iter().map(|&(j, a)| (a * p[j]).abs()).sum::<f64>()
    }
}

/// A row of several parameters counts as satisfied when violated by no more than this times its terms: rounding, nothing else.
pub(crate) const ROUNDING: f64 = 1e-13;

impl Constraints {
    /// No constraint on `n` parameters.
    pub fn none(n: usize) -> Self {
        Self { lower: vec![f64::NEG_INFINITY; n], upper: vec![f64::INFINITY; n], orders: vec![], rows: vec![] }
    }

    /// Bounds alone.
    pub fn bounds(lower: Vec<f64>, upper: Vec<f64>) -> Self {
        Self { lower, upper, orders: vec![], rows: vec![] }
    }

    #[must_use]
    pub fn order(mut self, below: usize, above: usize, gap: f64) -> Self {
        self.orders.push(Order { below, above, gap });
        self
    }

    #[must_use]
    pub fn row(mut self, coefficients: Vec<(usize, f64)>, limit: f64) -> Self {
        self.rows.push(LinearRow { coefficients, limit });
        self
    }

    pub fn n_params(&self) -> usize {
        self.lower.len()
    }

    /// Checks sizes, numbers, crossed bounds, circular orders, and that at least one point satisfies everything.
    pub fn validate(&self, names: &[String]) -> Result<(), IdentifyError> {
        let sorted = self.validate_form(names)?;
        feasibility::check(self, &sorted, names)
    }

    /// All of [`Self::validate`] but the search for a feasible point; returns the parameters in the sense of the orders.
    pub(crate) fn validate_form(&self, names: &[String]) -> Result<Vec<usize>, IdentifyError> {
        let n = names.len();
        for (what, got) in [("lower bounds", self.lower.len()), ("upper bounds", self.upper.len())] {
            if got != n {
                return Err(IdentifyError::Dimension { what: what.into(), got, expected: n });
            }
        }
        for (j, name) in names.iter().enumerate() {
            let (lower, upper) = (self.lower[j], self.upper[j]);
            if lower.is_nan() || lower == f64::INFINITY {
                return Err(IdentifyError::NotFinite { what: "lower bound", name: name.clone(), value: lower });
            }
            if upper.is_nan() || upper == f64::NEG_INFINITY {
                return Err(IdentifyError::NotFinite { what: "upper bound", name: name.clone(), value: upper });
            }
            if lower > upper {
                return Err(IdentifyError::BoundsCrossed { name: name.clone(), lower, upper });
            }
        }
        for order in &self.orders {
            if let Some(&index) = [order.below, order.above].iter().find(|&&j| j >= n) {
                return Err(IdentifyError::Dimension { what: format!("order on parameter number {index}"), got: index + 1, expected: n });
            }
            if !order.gap.is_finite() {
                return Err(IdentifyError::NotFinite { what: "gap of the order", name: names[order.below].clone(), value: order.gap });
            }
        }
        for row in &self.rows {
            if let Some(&(index, _)) = row.coefficients.iter().find(|c| c.0 >= n) {
                return Err(IdentifyError::Dimension {
                    what: format!("linear row on parameter number {index}"),
                    got: index + 1,
                    expected: n,
                });
            }
            if let Some(&(index, value)) = row.coefficients.iter().find(|c| !c.1.is_finite()) {
                return Err(IdentifyError::NotFinite { what: "coefficient", name: names[index].clone(), value });
            }
            if !row.limit.is_finite() {
                return Err(IdentifyError::NotFinite { what: "limit", name: self.row_label(row, names), value: row.limit });
            }
        }
        let circle = |indices: Vec<usize>| IdentifyError::OrderCycle { names: indices.into_iter().map(|j| names[j].clone()).collect() };
        self.topological().map_err(circle)
    }

    /// The start must be finite and feasible; nothing is moved silently.
    pub fn check_start(&self, p: &[f64], names: &[String]) -> Result<(), IdentifyError> {
        for (what, got) in [("start values", p.len()), ("upper bounds", self.upper.len()), ("parameter names", names.len())] {
            if got != self.n_params() {
                return Err(IdentifyError::Dimension { what: what.into(), got, expected: self.n_params() });
            }
        }
        for (j, (&value, name)) in p.iter().zip(names).enumerate() {
            if !value.is_finite() {
                return Err(IdentifyError::NotFinite { what: "start", name: name.clone(), value });
            }
            let (lower, upper) = (self.lower[j], self.upper[j]);
            if value < lower || value > upper {
                return Err(IdentifyError::StartOutsideBounds { name: name.clone(), value, lower, upper });
            }
        }
        for inequality in self.inequalities() {
            let slack = inequality.slack(p);
            if slack < -ROUNDING * inequality.magnitude(p) {
                return Err(IdentifyError::StartViolates { constraint: self.label(inequality.source, names), by: -slack });
            }
        }
        Ok(())
    }

    /// Bounds hold to the bit, rows of several parameters to the rounding of their own terms.
    pub fn is_feasible(&self, p: &[f64]) -> bool {
        p.len() == self.lower.len()
            && p.len() == self.upper.len()
            && p.iter().zip(&self.lower).zip(&self.upper).all(|((p, l), u)| l <= p && p <= u)
            && self.inequalities().iter().all(|i| i.slack(p) >= -ROUNDING * i.magnitude(p))
    }

    /// Indices of parameters exactly at a bound: (index, at the lower one).
    pub fn at_bound(&self, p: &[f64]) -> Vec<(usize, bool)> {
        let side = |j: usize| match (p[j] <= self.lower[j], p[j] >= self.upper[j]) {
            (true, _) => Some((j, true)),
            (_, true) => Some((j, false)),
            _ => None,
        };
        (0..p.len()).filter_map(side).collect()
    }

    /// All inequalities as rows a'p <= b; infinite bounds and fixed parameters (lower == upper) leave none.
    pub(crate) fn inequalities(&self) -> Vec<Inequality> {
        let mut all = Vec::new();
        for j in 0..self.n_params() {
            if self.is_fixed(j) {
                continue;
            }
            if self.upper[j].is_finite() {
                all.push(Inequality { a: vec![(j, 1.0)], b: self.upper[j], source: Source::Upper(j) });
            }
            if self.lower[j].is_finite() {
                all.push(Inequality { a: vec![(j, -1.0)], b: -self.lower[j], source: Source::Lower(j) });
            }
        }
        for (k, o) in self.orders.iter().enumerate() {
            all.push(Inequality { a: vec![(o.below, 1.0), (o.above, -1.0)], b: -o.gap, source: Source::Order(k) });
        }
        for (k, row) in self.rows.iter().enumerate() {
            all.push(Inequality { a: row.coefficients.clone(), b: row.limit, source: Source::Row(k) });
        }
        all
    }

    pub(crate) fn is_fixed(&self, j: usize) -> bool {
        self.lower[j] == self.upper[j]
    }

    pub(crate) fn label(&self, source: Source, names: &[String]) -> String {
        match source {
            Source::Lower(j) => format!("{} >= {}", names[j], self.lower[j]),
            Source::Upper(j) => format!("{} <= {}", names[j], self.upper[j]),
            Source::Order(k) => {
                let o = self.orders[k];
                let (below, above) = (&names[o.below], &names[o.above]);
                if o.gap == 0.0 { format!("{below} <= {above}") } else { format!("{below} + {} <= {above}", o.gap) }
            }
            Source::Row(k) => self.row_label(&self.rows[k], names),
        }
    }

    fn row_label(&self, row: &LinearRow, names: &[String]) -> String {
        let terms: Vec<_> = row.coefficients.iter().map(|&(j, a)| format!("{a} {}", names[j])).collect();
        format!("{} <= {}", terms.join(" + "), row.limit)
    }

    /// Parameters so that every order's lower end comes first, or a circle of orders.
    fn topological(&self) -> Result<Vec<usize>, Vec<usize>> {
        let n = self.n_params();
        let mut waiting = vec![0usize; n];
        self.orders.iter().for_each(|o| waiting[o.above] += 1);
        let mut sorted: Vec<usize> = (0..n).filter(|&j| waiting[j] == 0).collect();
        let mut next = 0;
        while next < sorted.len() {
            let j = sorted[next];
            next += 1;
            for o in self.orders.iter().filter(|o| o.below == j) {
                waiting[o.above] -= 1;
                if waiting[o.above] == 0 {
                    sorted.push(o.above);
                }
            }
        }
        if sorted.len() == n {
            return Ok(sorted);
        }
        // every parameter still waiting has a waiting one below it: walking down must come round
        let mut walk = vec![(0..n).find(|&j| waiting[j] > 0).unwrap_or(0)];
        loop {
            let here = walk[walk.len() - 1];
            let Some(o) = self.orders.iter().find(|o| o.above == here && waiting[o.below] > 0) else { return Err(walk) };
            if let Some(first) = walk.iter().position(|&j| j == o.below) {
                let mut circle = walk.split_off(first);
                circle.push(o.below);
                circle.reverse();
                return Err(circle);
            }
            walk.push(o.below);
        }
    }

    /// Puts active bounds and orders exactly, and removes what rounding violates of bounds and orders. `p` must be feasible but for that.
    pub(crate) fn snap(&self, p: &mut [f64], active: &[Source]) {
        for &source in active {
            match source {
                Source::Lower(j) => p[j] = self.lower[j],
                Source::Upper(j) => p[j] = self.upper[j],
                Source::Order(_) | Source::Row(_) => {}
            }
        }
        for (j, v) in p.iter_mut().enumerate() {
            *v = v.max(self.lower[j]).min(self.upper[j]);
        }
        if self.orders.is_empty() {
            return;
        }
        let Ok(sorted) = self.topological() else { return };
        // upwards: lift the upper end; downwards: lower the lower end where a bound stopped the lifting
        for &j in &sorted {
            for (k, o) in self.orders.iter().enumerate().filter(|(_, o)| o.below == j) {
                let slack = p[o.above] - p[j] - o.gap;
                // what rounding leaves is left alone: moving it would break rows that share the parameter
                let rounding = ROUNDING * (p[o.above].abs() + p[j].abs() + o.gap.abs());
                if slack < -rounding || (slack > rounding && active.contains(&Source::Order(k))) {
                    p[o.above] = self.floor_of(o.above, p).min(self.upper[o.above]);
                }
            }
        }
        for &j in sorted.iter().rev() {
            for o in self.orders.iter().filter(|o| o.above == j) {
                if p[o.below] + o.gap - p[j] > ROUNDING * (p[o.below].abs() + p[j].abs() + o.gap.abs()) {
                    p[o.below] = (p[j] - o.gap).max(self.lower[o.below]);
                }
            }
        }
    }

    /// The least value of parameter `j` its lower bound and the orders below it allow, the others standing.
    fn floor_of(&self, j: usize, p: &[f64]) -> f64 {
        self.orders.iter().filter(|o| o.above == j).map(|o| p[o.below] + o.gap).fold(self.lower[j], f64::max)
    }

    /// The feasible point nearest to `p`, distances measured in units of `scale` (positive, one per parameter).
    pub fn project(&self, p: &[f64], scale: &[f64]) -> Result<Vec<f64>, IdentifyError> {
        if self.is_feasible(p) { Ok(p.to_vec()) } else { feasibility::project(self, p, scale) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(n: usize) -> Vec<String> {
        (0..n).map(|j| format!("k{}", j + 1)).collect()
    }

    #[test]
    fn crossed_bounds_nan_and_sizes_are_errors() {
        let c = Constraints::bounds(vec![0.0, 2.0], vec![1.0, 1.0]);
        assert!(matches!(c.validate(&names(2)), Err(IdentifyError::BoundsCrossed { name, .. }) if name == "k2"));
        let c = Constraints::bounds(vec![f64::NAN], vec![1.0]);
        assert!(matches!(c.validate(&names(1)), Err(IdentifyError::NotFinite { .. })));
        assert!(matches!(Constraints::none(2).validate(&names(3)), Err(IdentifyError::Dimension { .. })));
        assert!(matches!(Constraints::none(2).order(0, 2, 0.0).validate(&names(2)), Err(IdentifyError::Dimension { .. })));
        assert!(matches!(
            Constraints::none(2).row(vec![(0, f64::INFINITY)], 0.0).validate(&names(2)),
            Err(IdentifyError::NotFinite { .. })
        ));
    }

    #[test]
    fn a_circular_order_is_named() {
        let c = Constraints::none(4).order(0, 1, 0.0).order(1, 2, 0.0).order(2, 0, 0.0).order(2, 3, 0.0);
        match c.validate(&names(4)) {
            Err(IdentifyError::OrderCycle { names }) => assert_eq!(names.len(), 4, "{names:?}"),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn an_order_no_point_satisfies_names_the_conflict_and_only_it() {
        // k1 >= 5, k1 + 1 <= k2, k2 <= 5.5; k3 has nothing to do with it
        let c = Constraints::bounds(vec![5.0, 0.0, 0.0], vec![9.0, 5.5, 1.0]).order(0, 1, 1.0);
        match c.validate(&names(3)) {
            Err(IdentifyError::Infeasible { constraints }) => {
                assert_eq!(constraints.len(), 3, "{constraints:?}");
                assert!(constraints.contains(&"k1 + 1 <= k2".to_string()), "{constraints:?}");
            }
            other => panic!("{other:?}"),
        }
        // feasible in a single point only
        Constraints::bounds(vec![5.0, 0.0], vec![9.0, 6.0]).order(0, 1, 1.0).validate(&names(2)).unwrap();
        // a linear row against bounds, in very unlike units
        let c = Constraints::bounds(vec![1e7, 1e-6], vec![2e7, 2e-6]).row(vec![(0, 1.0), (1, 1e13)], 1e7);
        assert!(matches!(c.validate(&names(2)), Err(IdentifyError::Infeasible { .. })));
    }

    #[test]
    fn starts_are_checked_not_moved() {
        let c = Constraints::bounds(vec![0.0, 0.0], vec![1.0, 1.0]).order(0, 1, 0.0);
        assert!(matches!(c.check_start(&[2.0, 0.5], &names(2)), Err(IdentifyError::StartOutsideBounds { .. })));
        assert!(matches!(c.check_start(&[0.7, 0.5], &names(2)), Err(IdentifyError::StartViolates { .. })));
        assert!(matches!(c.check_start(&[f64::NAN, 0.5], &names(2)), Err(IdentifyError::NotFinite { .. })));
        c.check_start(&[0.5, 0.5], &names(2)).unwrap();
    }

    #[test]
    fn projection_is_the_nearest_feasible_point() {
        let c = Constraints::none(3).order(0, 1, 0.0).order(1, 2, 0.0);
        let p = c.project(&[3.0, 1.0, 2.0], &[1.0; 3]).unwrap();
        approx::assert_relative_eq!(p.as_slice(), [2.0, 2.0, 2.0].as_slice(), epsilon = 1e-12); // isotonic regression
        assert!(c.is_feasible(&p));
    }
}
