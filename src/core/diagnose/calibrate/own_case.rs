//! A case that a program makes of its own model and tests, without files.

use std::sync::Arc;

use crate::data::{Test, frf_doubts};
use crate::identify::{Loss, Tolerances};
use crate::model::{System, held};
use crate::response::Plan;

use crate::diagnose::DiagnoseError;
use crate::diagnose::results::SplitName;

use super::case::{Case, Search};
use super::slack::Slack;

impl Case {
    /// A case with the settings that a study has where it states none.
    pub fn new(name: impl Into<String>, system: System, plans: Vec<(Plan, SplitName)>, seed: u64) -> Case {
        Case {
            name: name.into(),
            plans: Arc::new(plans),
            system,
            of_data: vec![],
            refused: vec![],
            orders: vec![],
            loss: Loss::Squares,
            max_iterations: Tolerances::default().max_iterations,
            starts: 1,
            seed,
            search: Search::default(),
            f_tol: None,
            worth: None,
            memo: None,
            common: None,
            deviations: Slack::default(),
        }
    }

    /// A case of a model and tests that a program holds in memory, each test with the split it serves in.
    ///
    /// # Errors
    /// Values out of their bounds, a body that no force holds, a test that the model cannot compute or that measures where there is no place.
    pub fn of(name: impl Into<String>, system: System, tests: &[(Test, SplitName)], seed: u64) -> Result<Case, DiagnoseError> {
        system.check()?;
        held(&system.model, &system.instances).map_err(|(_, e)| e)?;
        let plan = |(test, split): &(Test, SplitName)| Ok((Plan::new(test, &system.model)?, *split));
        let plans = tests.iter().map(plan).collect::<Result<Vec<_>, DiagnoseError>>()?;
        let refused = frf_doubts(tests.iter().map(|t| &t.0)).into_iter().filter(|d| d.refused).collect();
        Ok(Case { refused, ..Case::new(name, system, plans, seed) })
    }
}
