//! What a test bench can do keeps the tests that are proposed for it within its limits; what its instruments may err by is in every covariance.

use crate::data::Rig;
use crate::diagnose::Case;
use crate::diagnose::results::SplitName;
use crate::diagnose::testing::{Scale, Settings, at_other_levels, level, within};
use crate::response::{Misreading, Plan, Tolerances, Variation};

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

/// A load cell has one range for all tests: its zero is off by as many newtons in a small test as in a large one, which is ten times as much of what it reads there.
#[test]
fn the_zero_of_a_sensor_is_as_good_as_its_range() {
    let folder = Folder::one(ONE);
    for (hz, amplitude) in [(1.0, 0.4), (2.0, 0.04), (5.0, 0.4)] {
        let row = |i: usize| {
            let part = f64::from(i as u32) * 0.01;
            let x = amplitude * (std::f64::consts::TAU * part).sin();
            format!("{:.6},{x:.8},{:.8}\n", part / hz, 20.0 * x)
        };
        let csv = "t,x,F\n".to_string() + &(0..400).map(row).collect::<String>();
        std::fs::write(folder.path().join(format!("data/loop-{hz}.csv")), csv).unwrap();
    }
    let case = Case::from_study(&folder.load().unwrap(), 1).unwrap();
    let scale = Scale::new(&case, &case.system, &Settings::default());
    let plans = scale.case.plans_of(SplitName::Fit);
    let zero = |t: usize| {
        let (plan, instruments) = (plans[t], &scale.evidence.records[t].instruments);
        let force = plan.blocks.iter().position(|b| b.role == "force").unwrap();
        let k = instruments.of.iter().position(|(b, what, _)| (*b, *what) == (force, Misreading::Offset)).unwrap();
        (plan.id.clone(), instruments.columns.column(k).norm(), instruments.of[k].2)
    };
    let [one, two] = [0, 1].map(zero);
    assert_eq!([&one.0, &two.0], ["loop-1Hz", "loop-2Hz"]);
    approx::assert_relative_eq!(one.1, two.1, max_relative = 1e-2);
    // In parts of the amplitude of the test; the damper of the study, which moved none of this, adds a little to what is computed.
    approx::assert_relative_eq!(one.2, 0.002, max_relative = 0.05);
    approx::assert_relative_eq!(two.2, 0.02, max_relative = 0.05);
}

/// The loops run at 0.1, 0.3 and 0.5 mm of interference; the stiffness follows it.
#[test]
fn a_test_at_another_condition_is_proposed_where_a_law_depends_on_it() {
    let law = |a: &str| {
        format!(
            "{ONE}[[effect]]\neffect = \"interference_law\"\nat = \"c1.x\"\nof = \"linear_stiffness.k\"\ncondition = \"i\"\nreference = \"0.3 mm\"\na = {{ start = \"{a}\" }}\n"
        )
    };
    let study = Folder::one(&law("1.5 1/mm")).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let plans: Vec<_> = case.plans.iter().map(|(p, _)| p).collect();
    let settings = Settings::default().next;
    let proposed = at_other_levels(&plans, &[&study.system], &settings);
    let of = |(plan, by): &(&Plan, Variation)| {
        let varied = plan.varied(by).unwrap();
        let force = varied.evaluate(&study.system, &[], false).unwrap().values;
        (1e3 * varied.conditions["i"], force.iter().fold(0.0f64, |m, f| m.max(f.abs())))
    };
    let found: Vec<(f64, f64)> = proposed.iter().map(of).collect();
    // One test of the three, whose drives are alike: half of the range beyond either end (no less than a third of the least), and not its own value.
    assert!(!found.is_empty() && found.iter().all(|(i, _)| [0.1 / 3.0, 0.3, 0.7].iter().any(|want| (i - want).abs() < 1e-12)), "{found:?}");
    let (i, force) = found[found.len() - 1];
    assert!((i - 0.7).abs() < 1e-12);
    // 20 N/mm exp(1.5 x 0.4) over 0.4 mm, and the damper beside it.
    let omega = std::f64::consts::TAU * plans.iter().find(|p| p.id == proposed[0].0.id).unwrap().cycle_drive().unwrap().frequency;
    let want = 0.4 * (20.0 * (1.5f64 * 0.4).exp()).hypot(0.1 * omega);
    assert!((force / want - 1.0).abs() < 2e-3, "{force} {want}");
    assert_eq!(level(proposed[0].0, 1, 0.7e-3).map(|p| (p.0, p.1)), Some(("i".into(), "0.7 mm".into())));
    // A model on which no condition acts has no other tests of this kind.
    let plain = Folder::one(ONE).load().unwrap();
    assert!(at_other_levels(&plans, &[&plain.system], &settings).is_empty());
}
