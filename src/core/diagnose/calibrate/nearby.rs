//! Tests computed about where a model stands ([`Case::expanded`]), kept for a while: a model is weighed, its counts are set, it is weighed on and then
//! searched from, and each of these begins where the last one ended. A march of a chain of parts for every loop costs as much as the fit that follows it. So
//! are the responses of the models that were looked at last: a model that is weighed once more begins where it ended.

use std::sync::Arc;

use crate::evidence::Seen;
use crate::model::{FreeParam, System};
use crate::parallel;
use crate::residual::Recent;
use crate::response::{Computed, Plan};

use super::case::Case;
use crate::diagnose::results::SplitName;

type Plans = Arc<Vec<(Plan, SplitName)>>;

/// Tests about the models that were asked for last.
#[derive(Default)]
pub struct Nearby {
    /// The tests as they are, and about the model; none where none of them is cheaper so. To hold them as they are keeps their address from being given
    /// to others.
    kept: Recent<(Plans, Option<Plans>)>,
    /// What models leave in the fit tests as they are, with what was computed for it.
    seen: Recent<(Plans, Vec<FreeParam>, Looked)>,
}

/// A model in the fit tests.
#[derive(Clone)]
pub(super) struct Looked {
    /// Responses, with sensitivities.
    pub computed: Arc<Vec<Computed>>,
    /// What they leave.
    pub seen: Arc<Vec<Seen>>,
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

    /// What a system leaves in the fit tests of a case, computed unless it is known.
    pub(super) fn look(
        &self,
        (plans, system, free): (&Plans, &System, &[FreeParam]),
        compute: impl FnOnce() -> Result<Looked, String>,
    ) -> Result<Looked, String> {
        if let Some((.., known)) = self.seen.find(system, |(of, params, _)| Arc::ptr_eq(of, plans) && params == free) {
            return Ok(known);
        }
        let looked = compute()?;
        self.seen.keep(system, (plans.clone(), free.to_vec(), looked.clone()));
        Ok(looked)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::model::{Axis, Body, Model};

    /// What a model leaves in the tests is computed once; of another value, other tests or other free parameters it is another.
    #[test]
    fn what_a_model_leaves_is_computed_once() {
        let model = Model::joined(vec![Body::fixed("ground"), Body::new("m", 1.0, &[Axis::X])], &[("c1", "ground", "m")]);
        let system = System::new(model.unwrap()).and("linear_stiffness", "c1.x", &[("k", 2e4)]).unwrap();
        let mut stiffer = system.clone();
        stiffer.instances[0].params[0].value *= 1.0 + 1e-9;
        let (plans, others): (Plans, Plans) = (Arc::new(vec![]), Arc::new(vec![]));
        let (nearby, computed) = (Nearby::default(), Cell::new(0));
        let looked = |plans: &Plans, system: &System, free: &[FreeParam]| {
            let compute = || {
                computed.set(computed.get() + 1);
                Ok(Looked { computed: Arc::default(), seen: Arc::default() })
            };
            nearby.look((plans, system, free), compute).unwrap();
            computed.get()
        };
        let free = system.free();
        assert_eq!([looked(&plans, &system, &free), looked(&plans, &system, &free)], [1, 1]);
        assert_eq!([looked(&plans, &stiffer, &free), looked(&others, &system, &free), looked(&plans, &system, &[])], [2, 3, 4]);
        assert_eq!(looked(&plans, &system, &free), 4, "it is kept beside the others");
        assert!(nearby.look((&plans, &system, &free), || Err("not asked".into())).is_ok());
    }
}
