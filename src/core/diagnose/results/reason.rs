//! Why a candidate is taken or left, and what that says in words.

use serde::Serialize;

/// What was decided of a candidate.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Reason {
    /// It gains more than its parameters and the search cost.
    Gains {
        /// Nats above nothing.
        nats: f64,
    },
    /// It gains less.
    TooLittle {
        /// Nats; below zero.
        nats: f64,
    },
    /// Its gain is within a tie of nothing, and the fitted tests, each left out in its turn, had a say.
    InTurn {
        /// Nats beyond its price.
        nats: f64,
        /// Nats by which the tests that were left out are foretold better with it, beyond what the search for it cost.
        turns: f64,
    },
    /// What it may gain at most is below the price, by its score or by its refit under the variances of the model without it.
    Hopeless {
        /// That bound, and the price [nats].
        bound: f64,
        /// Price.
        price: f64,
    },
    /// A fault of an instrument that the record does not show.
    NotInRecord {
        /// What contradicts it.
        fault: Fault,
    },
    /// It gains only together with another.
    InPair {
        /// Nats of both.
        nats: f64,
    },
    /// Its refit stands behind the best by more than its own variances could make up for.
    Behind {
        /// Nats, under the variances of the model without either.
        nats: f64,
    },
    /// It could not be fitted.
    Failed {
        /// Why.
        why: String,
    },
    /// Others stood before it.
    NotTried,
    /// The run was stopped before this was known.
    Interrupted,
}

/// Why the record speaks against a fault of an instrument.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// It moves no test by more than tests scatter.
    Small,
    /// It moves no test by more than the model errs there.
    BelowModelError,
    /// The test is unlike the others without it, too.
    UnlikeOthers,
    /// Too few tests to tell it from physics.
    FewTests,
}

impl Reason {
    /// In words.
    pub fn describe(&self) -> String {
        match self {
            Reason::Gains { nats } => format!("gains {nats:.1} nats beyond its price"),
            Reason::TooLittle { nats } => format!("falls {:.1} nats short of its price", -nats),
            Reason::InTurn { nats, turns } => {
                format!(
                    "{nats:+.1} nats beyond its price, which does not decide; tests left out in turn are foretold better by {turns:+.1} nats beyond what the search cost"
                )
            }
            Reason::Hopeless { bound, price } => format!("can gain {bound:.1} nats at most, and its price is {price:.1}"),
            Reason::NotInRecord { fault } => format!("not seen in the record: {}", fault.describe()),
            Reason::InPair { nats } => format!("gains {nats:.1} nats beyond its price with the other of its pair"),
            Reason::Behind { nats } => format!("its refit stands {nats:.1} nats behind the best"),
            Reason::Failed { why } => format!("the refit failed: {why}"),
            Reason::NotTried => "not refitted: others promise more".into(),
            Reason::Interrupted => "the run was stopped before it was weighed".into(),
        }
    }
}

impl Fault {
    /// In words.
    pub fn describe(self) -> &'static str {
        match self {
            Fault::Small => "it moves no test by more than tests scatter",
            Fault::BelowModelError => "it moves no test by more than the model errs there",
            Fault::UnlikeOthers => "its test stays unlike the others",
            Fault::FewTests => "too few tests contradict that one",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_has_its_words_and_its_kind() {
        let faults = [Fault::Small, Fault::BelowModelError, Fault::UnlikeOthers, Fault::FewTests];
        let all = [
            Reason::Gains { nats: 3.0 },
            Reason::TooLittle { nats: -2.0 },
            Reason::Hopeless { bound: 1.0, price: 5.0 },
            Reason::InTurn { nats: -0.4, turns: 3.0 },
            Reason::InPair { nats: 2.0 },
            Reason::Failed { why: "no steady cycle".into() },
            Reason::NotTried,
        ];
        let of_faults = faults.map(|fault| Reason::NotInRecord { fault });
        let words: std::collections::BTreeSet<String> = all.iter().chain(&of_faults).map(Reason::describe).collect();
        assert_eq!(words.len(), all.len() + faults.len());
        assert_eq!(Reason::TooLittle { nats: -2.0 }.describe(), "falls 2.0 nats short of its price");
        assert_eq!(serde_json::to_value(&all[2]).unwrap()["kind"], "hopeless");
    }
}
