//! The score map as it is told: every candidate with what it is expected to explain, and what `add` is to be given for it.

use serde::Serialize;

use crate::diagnose::Mark;
use crate::effect::{Kind, Param};
use crate::model::System;
use crate::study::{Study, unit_of};

/// A candidate under the score test, which refits nothing.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Scored {
    /// Name in the library.
    pub effect: String,
    /// Place or channel.
    pub at: String,
    /// Of a coefficient, what it acts on and over which condition.
    pub of: Option<String>,
    /// Fraction of the cost that is expected to fall.
    pub predicted_drop: f64,
    /// Probability that the best of all candidates scores as high where nothing is missing.
    pub p_value: f64,
    /// Nats that it may gain at most.
    pub nats: f64,
    /// Nats that its parameters and the search cost.
    pub price: f64,
    /// Whether it may gain more than it costs.
    pub promises: bool,
    /// Where its shapes score best: `--set` of `add`, by name.
    pub set: Vec<(String, String)>,
    /// Of a coefficient, the other options of `add`.
    pub target: Option<ScoredTarget>,
    /// Candidates that the score cannot tell from it.
    pub tied_with: Vec<String>,
}

/// What a coefficient is added with.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ScoredTarget {
    /// The parameter it scales, `--of`.
    pub of: String,
    /// `--condition`.
    pub condition: String,
    /// `--reference`, with unit.
    pub reference: String,
}

/// The marks of a map of `system`, in their order.
pub fn scored(study: &Study, system: &System, marks: &[Mark]) -> Vec<Scored> {
    let label = |j: &usize| format!("{} at {}", marks[*j].instance.name(), marks[*j].instance.at);
    let one = |m: &Mark| {
        let (i, info) = (&m.instance, m.instance.effect.info());
        let start = |(k, p): (usize, &Param)| {
            let searched = p.kind == Kind::Shape && i.params[k].value != p.default;
            let unit = unit_of(system, &study.dataset, i, k);
            // It is where a fit begins: three digits are enough, and are read.
            let start = format!("{:.2e}", unit.from_si(i.params[k].value)).parse::<f64>().unwrap_or(i.params[k].value);
            searched.then(|| (p.name.to_string(), format!("{start} {}", unit.symbol).trim_end().to_string()))
        };
        let target = |t: &crate::model::Target| ScoredTarget {
            of: m.of.as_ref().and_then(|o| o.split(" over ").next()).unwrap_or_default().to_string(),
            condition: t.condition.clone(),
            reference: t.unit.print(t.reference),
        };
        Scored {
            effect: info.name.to_string(),
            at: i.at.clone(),
            of: m.of.clone(),
            predicted_drop: m.drop,
            p_value: m.p_value,
            nats: m.bound,
            price: m.price,
            promises: m.bound >= m.price,
            set: info.params.iter().enumerate().filter_map(start).collect(),
            target: i.target.as_ref().map(target),
            tied_with: m.tied_with.iter().map(label).collect(),
        }
    };
    marks.iter().map(one).collect()
}
