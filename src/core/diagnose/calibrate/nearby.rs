//! Tests computed about where a model stands ([`Case::expanded`]), kept for a while: a model is weighed, its counts are set, it is weighed on and then
//! searched from, and each of these begins where the last one ended. A march of a chain of parts for every loop costs as much as the fit that follows it.

use std::sync::Arc;

use crate::model::System;
use crate::parallel;
use crate::residual::Recent;
use crate::response::Plan;

use super::case::Case;
use crate::diagnose::results::SplitName;

type Plans = Arc<Vec<(Plan, SplitName)>>;

/// Tests about the models that were asked for last.
#[derive(Default)]
pub struct Nearby {
    /// The tests as they are, and about the model; none where none of them is cheaper so. To hold them as they are keeps their address from being given
    /// to others.
    kept: Recent<(Plans, Option<Plans>)>,
}

impl Nearby {
    /// The case with its fit tests computed about this system, as [`Case::expanded`] makes it. What was given up on the way is not kept: some tests are
    /// still as they were.
    pub fn about(&self, case: &Case, system: &System) -> Option<Case> {
        let known = self.kept.find(system, |(plans, _)| Arc::ptr_eq(plans, &case.plans));
        let about = known.map(|(_, about)| about).unwrap_or_else(|| {
            let about = case.expanded(system).map(|c| c.plans);
            if !parallel::given_up() {
                self.kept.keep(system, (case.plans.clone(), about.clone()));
            }
            about
        });
        Some(Case { plans: about?, memo: None, ..case.clone() })
    }
}
