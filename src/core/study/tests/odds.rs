//! What is believed before any test is read.

use super::{Folder, ONE};
use crate::diagnose::Case;
use crate::diagnose::testing::{Climb, begin};
use crate::identify::Monitor;

/// The same first effect gains more by the logarithm of the odds that the model lacks something. Beside it nothing does, since the model with it errs no more;
/// beside one that errs by 10 % it would.
#[test]
fn the_first_thing_that_is_missing_has_the_odds_of_a_model_that_is_searched() {
    let folder = Folder::one(ONE);
    for hz in [1.0, 2.0, 5.0] {
        let mut csv = "t,x,F\n".to_string();
        for i in 0..500 {
            let part = f64::from(i) * 0.01;
            let x = 0.4 * (std::f64::consts::TAU * part).sin();
            let noise = 0.05 * (12.9898 * f64::from(i) + 78.233 * hz).sin();
            csv += &format!("{:.6},{x:.8},{:.8}\n", part / hz, 20.0 * x + 4.0 * x.powi(3) + noise);
        }
        std::fs::write(folder.path().join(format!("data/loop-{hz}.csv")), csv).unwrap();
    }
    let case = Case::from_study(&folder.load().unwrap(), 1).unwrap();
    let (quiet, silent) = (Monitor::default(), |_: &str| {});
    let found = |odds: f64| {
        let mut case = case.clone();
        case.search.settings.missing_odds = odds;
        let began = begin(&case, &quiet).unwrap();
        let mut climb = Climb::new(&began.case, &began.fitted, &quiet, &silent).unwrap();
        let step = climb.step().unwrap();
        let taken = step.taken.unwrap();
        let mut errs = taken.weighed.clone();
        errs.v.tau = 0.1f64.ln();
        let odds = [(0, &climb.now), (1, &taken.weighed), (1, &errs)].map(|(added, of)| climb.scale.odds(added, of));
        (taken.names[0].effect, taken.gain, odds)
    };
    let ((effect, even, _), (again, nine, odds)) = (found(1.0), found(9.0));
    assert_eq!((effect, again), ("cubic_stiffness", "cubic_stiffness"));
    approx::assert_relative_eq!(nine - even, 9f64.ln(), max_relative = 1e-9);
    assert_eq!(odds, [9.0, 1.0, 9.0]);
}
