//! A parameter as a fit leaves it.

use serde::Serialize;

/// One parameter.
#[derive(Clone, Debug, Serialize, schemars::JsonSchema)]
pub struct ParameterResult {
    /// `at.effect.parameter`.
    pub name: String,
    /// Value [SI].
    pub value: f64,
    /// SI unit.
    pub unit: String,
    /// Standard deviation [SI]; none where it is not identified.
    pub std: Option<f64>,
    /// 95 % interval [SI], open ends none.
    pub interval: (Option<f64>, Option<f64>),
    /// Whether the data determine it.
    pub identifiable: bool,
    /// Whether it lies at a bound.
    pub at_bound: bool,
    /// Value as the engineer writes it, `20.3 N/mm`.
    pub printed: String,
    /// Interval in the same unit, `19.9 to 20.7 N/mm`.
    pub printed_interval: String,
    /// Why it is not identified.
    pub note: Option<String>,
}

impl ParameterResult {
    /// What the data say of it, in words: `yes`, `no`, `at its bound`, or that its 95 % interval holds zero, where the data give a value and do not say
    /// whether there is anything.
    pub fn known(&self) -> &'static str {
        match (self.at_bound, self.identifiable, self.interval) {
            (true, ..) => "at its bound",
            (_, false, _) => "no",
            (_, _, (Some(low), Some(high))) if low <= 0.0 && high >= 0.0 => "not told from zero",
            _ => "yes",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A value whose interval holds zero is one, and says nothing of whether there is anything.
    #[test]
    fn what_is_not_told_from_zero_is_not_told_to_be_identified() {
        let known = |interval: (f64, f64), identifiable: bool, at_bound: bool| {
            let p = ParameterResult {
                name: "c1.x.linear_law.b".into(),
                value: 0.047,
                unit: "1/m".into(),
                std: Some(0.038),
                interval: (Some(interval.0), Some(interval.1)),
                identifiable,
                at_bound,
                printed: "0.047000 +- 0.074".into(),
                printed_interval: String::new(),
                note: None,
            };
            p.known()
        };
        assert_eq!(known((-0.027, 0.121), true, false), "not told from zero");
        assert_eq!(known((0.009, 0.085), true, false), "yes");
        assert_eq!(known((-0.027, 0.121), false, false), "no");
        assert_eq!(known((0.0, 0.121), true, true), "at its bound");
    }
}
