//! Tests computed about where a model stands ([`Case::expanded`]), kept for a while: a model is weighed, its counts are set, it is weighed on and then
//! searched from, and each of these begins where the last one ended. A march of a chain of parts for every loop costs as much as the fit that follows it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use crate::model::{Instance, System};
use crate::residual::alike;
use crate::response::Plan;

use super::case::Case;
use super::results::SplitName;

/// Models that are kept, the last ones.
const KEPT: usize = 6;

type Plans = Arc<Vec<(Plan, SplitName)>>;

struct Kept {
    /// The tests as they are. To hold them keeps their address from being given to others.
    plans: Plans,
    instances: Vec<Instance>,
    /// About this model; none where none of them is cheaper so.
    about: Option<Plans>,
}

/// Tests about the models that were asked for last.
#[derive(Default)]
pub struct Nearby {
    kept: Mutex<VecDeque<Kept>>,
}

impl Nearby {
    /// The case with its fit tests computed about this system, as [`Case::expanded`] makes it.
    pub fn about(&self, case: &Case, system: &System) -> Option<Case> {
        let about = self.find(case, system).unwrap_or_else(|| {
            let about = case.expanded(system).map(|c| c.plans);
            if let Ok(mut kept) = self.kept.lock() {
                kept.truncate(KEPT - 1);
                kept.push_front(Kept { plans: case.plans.clone(), instances: system.instances.clone(), about: about.clone() });
            }
            about
        });
        Some(Case { plans: about?, memo: None, ..case.clone() })
    }

    /// What is known of this system.
    fn find(&self, case: &Case, system: &System) -> Option<Option<Plans>> {
        let kept = self.kept.lock().ok()?;
        let same = |k: &&Kept| Arc::ptr_eq(&k.plans, &case.plans) && alike(&k.instances, &system.instances);
        kept.iter().find(same).map(|k| k.about.clone())
    }
}
