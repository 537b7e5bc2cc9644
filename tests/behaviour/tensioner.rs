//! The tensioner's studies: what the tables say by themselves, and that the studies are read as declared. Numbers by oddities.py of the
//! dataset and by hand.

use std::path::Path;

use misfit::diagnose::Case;
use misfit::study::Study;
use misfit::tolerance::{Constant, Verdict, search};

fn study(name: &str) -> Study {
    Study::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(name), None).unwrap()
}

#[test]
fn the_tables_find_mode_5_out_of_family_and_nothing_else() {
    let study = study("05-tensioner-tables");
    let case = Case::from_study(&study, 1).unwrap();
    assert_eq!(case.of_data.len(), 1, "{:?}", case.of_data);
    let odd = &case.of_data[0];
    assert_eq!(odd.test, "modal-mean");
    assert!(odd.claim.contains("mode 5: 2184.1 Hz") && odd.claim.contains("1976 Hz") && odd.claim.contains("1971.8 Hz"), "{}", odd.claim);
    // ln(2184.1 / sqrt(1976.0 1971.8)) = 0.101, 0.5 % assumed of a frequency.
    assert!(odd.number > 10.0 && odd.number < 20.0, "{}", odd.number);
    // It is shown and compared with nothing.
    let mean = case.plans.iter().find(|(p, _)| p.id == "modal-mean").unwrap();
    assert_eq!(mean.0.left_out.len(), 1);
}

#[test]
fn one_constant_reproduces_table_5_and_is_said_not_to_hold() {
    let study = study("05-tensioner-tables");
    let spec = study.tolerance.as_ref().unwrap();
    let constant = Constant::of(&spec.cases, &spec.pairs).unwrap();
    let off = |name: &str| constant.largest.iter().find(|l| l.0 == name).unwrap().1 * 1e3;
    assert!((constant.value * 1e9 - 2.7596).abs() < 1e-3, "{}", constant.value);
    assert!(off("i_max") < 0.010 && off("i_min") < 0.015, "{:?}", constant.largest);
    assert!(!constant.holds());
}

/// Left out with the search inside the folds: 25 % asked, 20 % aimed at; a permuted table does not do it.
#[test]
fn a_law_of_the_energies_predicts_the_case_left_out() {
    let study = study("05-tensioner-tables");
    let spec = study.tolerance.as_ref().unwrap();
    let (_, one) = search::search(&spec.cases, &spec.quantities, 1, 99, 1).unwrap();
    println!("one term: {:.3}, no law {:.3}, p {:.3}, {}", one.relative, one.no_law, one.p_value, one.words);
    assert!(one.relative < 0.20 && one.no_law > 0.35 && one.p_value < 0.05, "{one:?}");
    // Nine numbers tell that there is a law, and not which.
    assert_eq!(one.verdict, Verdict::SomeLaw);
}

#[test]
fn the_virtual_tensioner_has_twelve_free_parameters_and_hides_its_friction() {
    let study = study("06-virtual-tensioner");
    assert_eq!(study.system.free().len(), 12);
    assert!(study.system.instances.iter().all(|i| i.name() != "elastic_slip"));
    assert_eq!(study.system.model.dofs.len(), 1 + 21 * 3);
    // The device is in no march, and there in the FRFs.
    assert_eq!(study.system.model.attached.len(), 1);
}
