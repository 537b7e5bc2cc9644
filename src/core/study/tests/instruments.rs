//! What instruments do to what they read.

use super::{CHAIN, FRF, Folder};
use crate::diagnose::Case;
use crate::response::Plan;

/// An accelerometer that weighs 5 g is an added mass at the place of the response, at the driven end and elsewhere, small motion and under an excitation.
#[test]
fn an_accelerometer_loads_the_place_of_its_response() {
    let one = |id: &str, at: &str, more: &str| {
        let test = FRF.replace("frf-a", id).replace("respond = \"m8.x\"", &format!("respond = \"{at}\""));
        test.replace("quantity = \"accelerance\"\n", &format!("quantity = \"accelerance\"\n{more}"))
    };
    let excited = "excitation = \"1 N\"\n";
    let tests = [one("far", "m8.x", ""), one("own", "m1.x", ""), one("excited", "m4.x", excited)];
    let with = |effect: &str, id: &str| -> Vec<f64> {
        let study = Folder::new(&format!("{CHAIN}{effect}"), &tests.concat()).load().unwrap();
        let case = Case::from_study(&study, 1).unwrap();
        let plan: &Plan = case.plans.iter().map(|p| &p.0).find(|p| p.id == id).unwrap();
        plan.evaluate(&study.system, &[], false).unwrap().values
    };
    for (id, at) in [("far", "m8.x"), ("own", "m1.x"), ("excited", "m4.x")] {
        let loaded = with("[[effect]]\neffect = \"accelerometer_mass\"\nat = \"*.response\"\nm = \"5 g\"\n", id);
        let heavier = with(&format!("[[effect]]\neffect = \"added_mass\"\nat = \"{at}\"\nm = \"5 g\"\n"), id);
        let plain = with("", id);
        let size = heavier.iter().map(|h| h.abs()).fold(0.0, f64::max);
        let most = |a: &[f64]| a.iter().zip(&heavier).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / size;
        assert!(most(&loaded) < 1e-9, "{id}: {}", most(&loaded));
        assert!(most(&plain) > 1e-3, "{id}: the mass is seen");
    }
}
