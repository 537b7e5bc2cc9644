use super::*;

const FORMULA: &str = r#"[[effect]]
effect = "formula"
at = "c1.x"
expression = "k*x + f*z"
states = { z = "(v - abs(v)*z)/d" }
k = { start = "20 N/mm", min = "0 N/mm", max = "100 N/mm" }
f = { start = "5 N", min = "0 N", max = "50 N" }
d = { start = "0.1 mm", fixed = true }
"#;

fn with(text: &str) -> String {
    format!("{ONE}{text}")
}

#[test]
fn a_formula_is_read_and_written_back() {
    let folder = Folder::one(&with(FORMULA));
    let study = folder.load().unwrap();
    let instance = &study.system.instances[2];
    assert_eq!(instance.name(), "formula");
    let values: Vec<(f64, bool, f64)> = instance.params.iter().map(|p| (p.value, p.free, p.max)).collect();
    assert_eq!(values, [(20e3, true, 1e5), (5.0, true, 50.0), (1e-4, false, f64::INFINITY)]);
    let names: Vec<String> = study.system.free().into_iter().map(|f| f.name).collect();
    assert!(names.contains(&"c1.x.formula.k".to_string()), "{names:?}");
    let again = read(&study.with_values(&study.system, std::path::Path::new(".")), &folder.dataset()).unwrap();
    assert_eq!(essence(&again), essence(&study));
    // The same law, not only the same numbers: a second reading finds what the first compiled.
    assert!(std::ptr::eq(again.system.instances[2].effect, instance.effect));
}

#[test]
fn two_formulas_are_two_laws() {
    let second = FORMULA.replace("k*x + f*z", "k*x - f*z*0 + f*z");
    let folder = Folder::one(&with(&format!("{FORMULA}{second}")));
    let study = folder.load().unwrap();
    assert!(!std::ptr::eq(study.system.instances[2].effect, study.system.instances[3].effect));
    assert!(study.system.free().iter().any(|f| f.name == "c1.x.formula#2.k"));
}

#[test]
fn what_is_wrong_with_a_formula_is_named_with_its_place() {
    let dataset = Folder::one(ONE).dataset();
    let case = |from: &str, to: &str, message: &str, key: &str| {
        assert!(FORMULA.contains(from), "{from}");
        refused(read(&with(&FORMULA.replacen(from, to, 1)), &dataset), message, &format!("key effect[2]{key}"));
    };
    case("expression = \"k*x + f*z\"\n", "", "required key `expression` is missing", "");
    case("k*x + f*z", "k*x + * f*z", "`k*x + * f*z`, character 7: `*` where a value is expected", ".expression");
    case("k*x + f*z", "k*x + f*q", "character 9: `q` is not known", ".expression");
    case("k*x + f*z", "k*x + f*z*x", "the sum of a force and a moment", ".expression");
    case("k*x + f*z", "f*x*z + k*x*x", "the result is a moment", ".expression");
    case("(v - abs(v)*z)/d", "(v - abs(v)*z/d", "a bracket that is not closed", ".states.z");
    case("(v - abs(v)*z)/d", "v - abs(v)*z/d*f", "the difference of a velocity", ".states.z");
    case("{ start = \"5 N\", min = \"0 N\", max = \"50 N\" }", "\"5 N\"", "the parameter `f` of the formula has no bounds", ".f");
    case(", min = \"0 N\", max = \"50 N\"", "", "the parameter `f` of the formula has no bounds", ".f");
    case("\"5 N\"", "5", "the parameter `f` of the formula has no unit", ".f.start");
    case("\"5 N\"", "\"5\"", "the parameter `f` of the formula has no unit", ".f.start");
    case("min = \"0 N\"", "min = \"0 mm\"", "where a force is expected", ".f.min");
    case("\"5 N\"", "\"60 N\"", "start 60 N is above max 50 N", ".f");
    case("d = {", "e = { start = \"1 N\", fixed = true }\nd = {", "`e` is declared and not used", ".e");
    case("d = {", "x = { start = \"1 N\", fixed = true }\nd = {", "`x` has a meaning already", ".x");
    case("states = {", "states = { y = 3,", "where a string is expected", ".states.y");
    // A program cannot make one up.
    let e = Folder::one(ONE).load().unwrap().instance("formula", "c1.x", &[], None).unwrap_err();
    assert!(e.to_string().contains("stands in study.toml"), "{e}");
}

#[test]
fn bounds_of_a_law_hold_in_the_study() {
    let dataset = Folder::one(ONE).dataset();
    let spring = |alpha: &str| with(&format!("[[effect]]\neffect = \"springpot\"\nat = \"c1.x\"\nk = \"1 N/mm\"\nalpha = {alpha}\n"));
    let study = read(&spring("0.5"), &dataset).unwrap();
    let alpha = &study.system.instances[2].params[1];
    assert_eq!((alpha.min, alpha.max, alpha.free), (0.01, 0.99, true));
    refused(read(&spring("1.5"), &dataset), "`alpha` is 1.5", "key effect[2].alpha");
    refused(read(&spring("{ start = 0.5, max = 2 }"), &dataset), "max 2 lets `alpha` exceed 0.99", "key effect[2].alpha.max");
    refused(read(&spring("{ start = 0.5, min = 0 }"), &dataset), "min 0 lets `alpha` fall below 0.01", "key effect[2].alpha.min");
    let again = read(&study.with_values(&study.system, std::path::Path::new(".")), &dataset).unwrap();
    assert_eq!(essence(&again), essence(&study));
}
