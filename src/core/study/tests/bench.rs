//! What a test bench can do keeps the tests that are proposed for it within its limits; what its instruments may err by is in every covariance.

use crate::data::Rig;
use crate::diagnose::Case;
use crate::diagnose::testing::within;
use crate::response::{Tolerances, Variation};

use super::{Folder, ONE, cycle};

fn folder(more: &str) -> Folder {
    Folder::new(ONE, &format!("{more}{}{}{}", cycle(1.0, ""), cycle(2.0, ""), cycle(5.0, "")))
}

/// The loops run at +-0.4 mm; the study's spring and damper give 8 N there and more at twice the travel.
#[test]
fn a_test_beyond_the_bench_is_none() {
    let study = folder("").load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let plan = &case.plans.iter().find(|(p, _)| p.id == "loop-1Hz").unwrap().0;
    let runs = |rig: Rig, by: Variation| {
        let varied = plan.varied(&by).unwrap();
        within(&rig, &varied, &varied.evaluate(&study.system, &[], false).unwrap().values)
    };
    let none = Rig::default();
    let (same, twice, fast) =
        (Variation::default(), Variation { amplitude: 2.0, ..Variation::default() }, Variation { frequency: 10.0, ..Variation::default() });
    assert!(runs(none, same) && runs(none, twice) && runs(none, fast));
    let displacement = Rig { displacement_max: 0.5e-3, ..none };
    assert!(runs(displacement, same) && !runs(displacement, twice));
    // A mean counts as travel, too.
    assert!(!runs(displacement, Variation { mean: 0.6, ..same }));
    // 0.4 mm at 10 Hz: 25 mm/s, 1.6 m/s2.
    assert!(runs(Rig { velocity_max: 0.03, ..none }, fast) && !runs(Rig { velocity_max: 0.02, ..none }, fast));
    assert!(runs(Rig { acceleration_max: 1.7, ..none }, fast) && !runs(Rig { acceleration_max: 1.5, ..none }, fast));
    assert!(runs(Rig { frequency: (0.5, 20.0), ..none }, fast) && !runs(Rig { frequency: (0.5, 5.0), ..none }, fast));
    // What the load cell would read: 20 N/mm x 0.4 mm, and the damper.
    let cell = Rig { force_max: 10.0, ..none };
    assert!(runs(cell, same) && !runs(cell, twice));
}

#[test]
fn stated_tolerances_of_instruments_are_those_of_every_test() {
    let stated = folder("[instruments]\ngain = \"2 %\"\ndelay = \"0.1 ms\"\n").load().unwrap();
    let case = Case::from_study(&stated, 1).unwrap();
    let good = Tolerances::GOOD;
    let wanted = Tolerances { gain: 0.02, calibration: 0.02, delay_time: Some(1e-4), ..good };
    assert!(case.plans.iter().all(|(p, _)| p.tolerances == wanted));
    let unstated = Case::from_study(&folder("").load().unwrap(), 1).unwrap();
    assert!(unstated.plans.iter().all(|(p, _)| p.tolerances == good));
}
