//! What the tensioner's study asks beyond a plain chain: devices attached under load, rows left out, shifts, tolerance cases; and what is
//! refused of it.

use crate::explain::Explain;
use crate::response::Plan;

use super::space::SPACE;
use super::*;

const MODAL: &str = r#"
[[test]]
id = "modal-80N"
kind = "modal"
conditions = { load = "80 N", i = "0.3 mm" }
rows = [
 { mode = 1, frequency = "300 Hz", damping = "5 %", family = "xy bending" },
 { mode = 2, frequency = "900 Hz", damping = "5 %", family = "torsion" }]
[[test]]
id = "modal-20N"
kind = "modal"
conditions = { load = "20 N", i = "0.3 mm" }
rows = [
 { mode = 1, frequency = "297 Hz", damping = "5 %", family = "xy bending" },
 { mode = 2, frequency = "903 Hz", damping = "5 %", family = "torsion" }]
[[test]]
id = "energy-a"
kind = "energy"
at = "P.x"
control = "force"
force_min = "-60 N"
force_max = "-10 N"
conditions = { i = "0.3 mm" }
rows = [{ frequency = "1 Hz", W_D = "1 mJ", W_s = "20 mJ" }]
"#;

const CASES: &str = r#"schema = 1
[[test]]
id = "cases"
kind = "energy"
at = "P.x"
control = "force"
rows = [
 { case = "1", W_D = "196 mJ", conditions = { t = "0.1 mm", u = "0.1 mm", A_lo = "7.1 mm2", i_hi = "0.38 mm" } },
 { case = "2", W_D = "245 mJ", conditions = { t = "0.1 mm", u = "0.7 mm", A_lo = "6.7 mm2", i_hi = "0.41 mm" } }]
"#;

const TOLERANCE: &str = r#"
[tolerance]
dataset = "data/cases.toml"
test = "cases"
reference = "1"
interference = [{ name = "i_hi", area = "A_lo", resolution = ["0.01 mm", "0.1 mm2"] }]
conditions = { i = ["i_hi"] }
range = { i = ["0.03 mm", "1.3 mm"] }
strengths = ["STRENGTH"]
scale = 2.5
libraries = [{ name = "all", quantities = ["i_hi", "t"] }, { name = "cubic", quantities = ["t", "u"], degree = 3, terms = 3 }]
surface = ["t", "u"]
[tolerance.housing]
leaf_modulus = "210000 N/mm2"
leaf_length = "84 mm"
leaf_width = "18 mm"
deflection = "5 mm"
housing_modulus = "4000 N/mm2"
thickness = "8 mm"
[tolerance.cycle]
at = "P.x"
control = "force"
force_min = "21.6 N"
force_max = "138.3 N"
frequency = "5 Hz"
"#;

/// The chain of [`SPACE`] without what its other tests need.
fn chain() -> String {
    SPACE.replace("absent = [\"loop-*\"]", "attached = \"loaded\"\nabsent = [\"energy-*\"]")
}

fn frequencies(study: &Study, test: &str) -> Result<Vec<f64>, String> {
    let plan = Plan::new(study.dataset.test(test).unwrap(), &study.system.model).map_err(|e| e.to_string())?;
    let computed = plan.evaluate(&study.system, &[], false).map_err(|e| format!("{e} ({})", e.accepted()))?;
    Ok(computed.values[..2].iter().map(|v| v.exp()).collect())
}

/// A device that is attached under load leaves the equilibrium to the chain: with a load on a stiff device from the start the parts hardly
/// move, and the frequencies with them.
#[test]
fn a_device_attached_under_load_carries_none_of_it() {
    let load = |text: &str| {
        let text = text.replace("via = [\"-138.3 N\"]\n", "").replace("400 N/mm", "4000 N/mm");
        frequencies(&Folder::new(&text, MODAL).load().unwrap(), "modal-80N").unwrap()
    };
    let unloaded = |text: &str| load(&text.replace("condition = \"load\"\nfactor = -1", "force = \"-0.001 N\""));
    let shift = |text: &str| load(text)[0] / unloaded(text)[0] - 1.0;
    let (attached, from_start) = (shift(&chain()), shift(&chain().replace("attached = \"loaded\"", "attached = \"unloaded\"")));
    // At no load there is no difference between the two.
    let (a, b) = (unloaded(&chain()), unloaded(&chain().replace("attached = \"loaded\"", "attached = \"unloaded\"")));
    assert!((a[0] / b[0] - 1.0).abs() < 1e-5, "{a:?} {b:?}");
    assert!(attached.abs() > 4.0 * from_start.abs(), "{attached} {from_start}");
    // A march has no time at which it would be attached.
    let energy = |text: &str| {
        let study = Folder::new(text, MODAL).load().unwrap();
        Plan::new(study.dataset.test("energy-a").unwrap(), &study.system.model).unwrap().evaluate(&study.system, &[], false).unwrap().values
    };
    let (without, with) = (energy(&chain()), energy(&chain().replace("absent = [\"energy-*\"]\n", "")));
    assert!(without.iter().zip(&with).all(|(a, b)| (a - b).abs() < 1e-9), "{without:?} {with:?}");
}

/// Sensitivities through an equilibrium that the device takes no part in.
#[test]
fn slopes_about_that_equilibrium_are_the_differences() {
    let study = Folder::new(&chain(), MODAL).load().unwrap();
    let free = study.system.free();
    let plan = Plan::new(study.dataset.test("modal-80N").unwrap(), &study.system.model).unwrap();
    let base = plan.evaluate(&study.system, &free, true).unwrap();
    for (k, f) in free.iter().enumerate() {
        let value = study.system.instances[f.instance].params[f.param].value;
        let at = |h: f64| {
            let mut moved = study.system.clone();
            moved.instances[f.instance].params[f.param].value += h;
            plan.evaluate(&moved, &free, false).unwrap().values
        };
        let h = 1e-4 * value;
        let (up, down, scale) = (at(h), at(-h), if f.log { value } else { 1.0 });
        let numeric: Vec<f64> = up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * h) * scale).collect();
        let size = numeric.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        for (i, n) in numeric.iter().enumerate() {
            let exact = base.slopes[i * free.len() + k];
            assert!((exact - n).abs() < 2e-4 * size + 1e-7 / h * scale, "{} at {i}: {exact} {n}", f.name);
        }
    }
}

#[test]
fn no_equilibrium_is_said() {
    let modal = |text: &str| frequencies(&Folder::new(text, MODAL).load().unwrap(), "modal-80N").unwrap_err();
    let plain = chain().replace("via = [\"-138.3 N\"]\n", "");
    // Far beyond the load at which the arch snaps or the chain folds.
    let said = modal(&plain.replace("factor = -1", "factor = -5000"));
    assert!(said.contains("equilibrium") && said.contains("load"), "{said}");
}

#[test]
fn modes_that_cannot_be_paired_are_said() {
    let flat = chain().replace("density = \"3200 kg/m3\" }", "density = \"3200 kg/m3\" }\nfree = [\"x\", \"y\", \"psi\"]");
    let flat = flat.replace("GF1-7.phi", "GF1-7.x").replace("900 N mm/deg", "900 N/mm").replace("0.1 N mm s/deg", "0.1 N s/mm");
    let said = frequencies(&Folder::new(&flat, MODAL).load().unwrap(), "modal-80N").unwrap_err();
    assert!(said.contains("modes cannot be paired: the model has 0 torsion modes"), "{said}");
}

#[test]
fn shifts_rows_left_out_and_tolerance_cases_are_read_and_written() {
    let more = r#"
[[leave_out]]
test = "modal-80N"
quantity = "natural_frequency"
mode = 2
why = "it is another mode"
[[prediction]]
case = "less load"
quantity = "frequency_shift"
test = "modal-20N"
against = "modal-80N"
modes = [1, 2]
"#;
    let strength = Folder::new(&chain(), MODAL).load().unwrap().system.free()[0].name.clone();
    let tolerance = TOLERANCE.replace("STRENGTH", &strength);
    let text = chain() + more + &tolerance;
    let folder = Folder::new(&text, MODAL);
    std::fs::write(folder.path().join("data/cases.toml"), CASES).unwrap();
    let study = folder.load().unwrap();
    assert_eq!(study.predictions.len(), 2);
    assert!((study.predictions[1].reference.as_ref().unwrap().value - (903.0 / 900.0 - 1.0)).abs() < 1e-12);
    let spec = study.tolerance.as_ref().unwrap();
    let cases = |study: &Study| study.tolerance.as_ref().unwrap().tables[0].cases.clone();
    assert_eq!((cases(&study).cases.len(), spec.reference.as_str(), spec.scale), (2, "1", 2.5));
    assert_eq!((spec.libraries[0].most, spec.libraries[1].forms), (2, crate::tolerance::Forms::Polynomial(3)));
    assert!((cases(&study).cases[1].values["A_lo"] - 6.7e-6).abs() < 1e-12);
    assert!((spec.housing.as_ref().unwrap().leaf_length - 0.084).abs() < 1e-15);
    let range = spec.conditions[0].range.unwrap();
    assert!((range.0 - 3e-5).abs() < 1e-15 && (range.1 - 1.3e-3).abs() < 1e-15);
    // Written and read again it is the same.
    let whole = study.with_values(&study.system, folder.path());
    let file = folder.path().join("again.toml");
    std::fs::write(&file, whole).unwrap();
    let again = Study::load(&file, None).unwrap();
    assert_eq!(again.leave_out, study.leave_out);
    assert_eq!(
        again.predictions.iter().map(|p| &p.quantity).collect::<Vec<_>>(),
        study.predictions.iter().map(|p| &p.quantity).collect::<Vec<_>>()
    );
    assert_eq!(cases(&again), cases(&study));

    let case = |from: &str, to: &str, message: &str| {
        assert!(text.contains(from), "{from}");
        std::fs::write(&file, text.replacen(from, to, 1)).unwrap();
        let e = Study::load(&file, None).map(|_| ()).unwrap_err();
        assert!(e.to_string().contains(message), "{from} -> {to}: {e}");
        assert!(!e.accepted().is_empty() && e.place().contains("again.toml"), "{}", e.place());
    };
    case("mode = 2\nwhy", "mode = 7\nwhy", "has no natural_frequency of mode 7");
    case("test = \"modal-80N\"\nquantity", "test = \"energy-a\"\nquantity", "unknown modal test `energy-a`");
    case("against = \"modal-80N\"", "against = \"modal-70N\"", "unknown modal test `modal-70N`, nearest is `modal-");
    case("modes = [1, 2]", "modes = [3]", "mode 3 does not stand in both");
    case("modes = [1, 2]", "modes = []", "no mode");
    case("data/cases.toml", "data/case.toml", "no dataset at");
    case("test = \"cases\"", "test = \"case\"", "there is no energy test `case`");
    case("reference = \"1\"", "reference = \"3\"", "unknown case `3`");
    case("quantities = [\"i_hi\", \"t\"]", "quantities = [\"i_hi\", \"s\"]", "no condition `s`");
    case("degree = 3", "degree = 30", "30");
    case("scale = 2.5", "scale = 0", "a scale of 0");
    case(&format!("strengths = [\"{strength}\"]"), "strengths = [\"nothing\"]", "unknown free parameter `nothing`");
    case(&format!("strengths = [\"{strength}\"]\n"), "", "needs both the strengths");
    case("surface = [\"t\", \"u\"]", "surface = [\"t\"]", "a surface over 1 tolerances");
    case("range = { i = [\"0.03 mm\", \"1.3 mm\"] }", "range = { i = [\"1.3 mm\", \"0.03 mm\"] }", "the range is empty");
    case("conditions = { i = [\"i_hi\"] }\nrange", "conditions = { j = [\"i_hi\"] }\nrange", "unknown condition `j`");
    case("conditions = { i = [\"i_hi\"] }\nrange", "conditions = { i = [] }\nrange", "no quantity");
    case("leaf_length = \"84 mm\"", "leaf_length = \"84 N\"", "where a length is expected");
    case("frequency = \"5 Hz\"", "frequency = \"0 Hz\"", "is not above 0");
    case(
        "force_min = \"21.6 N\"\nforce_max = \"138.3 N\"\nfrequency",
        "force_min = \"150 N\"\nforce_max = \"138.3 N\"\nfrequency",
        "the limits of the cycle",
    );
    // Table 5 prints the areas in mm.
    let wrong = |from: &str, to: &str, message: &str| {
        std::fs::write(folder.path().join("data/cases.toml"), CASES.replacen(from, to, 1)).unwrap();
        let e = folder.load().map(|_| ()).unwrap_err();
        assert!(e.to_string().contains(message) && e.to_string().contains("cases.toml, line"), "{e}");
    };
    wrong("A_lo = \"6.7 mm2\"", "A_lo = \"6.7 mm\"", "case 2: `A_lo` is 6.7 mm, where");
    wrong("A_lo = \"6.7 mm2\"", "A_lo = \"0 mm2\"", "case 2: `A_lo` is 0 mm2");
    wrong(", i_hi = \"0.41 mm\"", "", "case 2: no condition `i_hi`");
    // The same conditions, another energy: no law and no model can have both.
    let second = "u = \"0.7 mm\", A_lo = \"6.7 mm2\", i_hi = \"0.41 mm\"";
    wrong(second, "u = \"0.1 mm\", A_lo = \"7.1 mm2\", i_hi = \"0.38 mm\"", "case 2: it has the conditions of case 1 and another energy");
    std::fs::write(folder.path().join("data/cases.toml"), CASES.replacen("W_D = \"245 mJ\"", "W_D = \"245 N\"", 1)).unwrap();
    let e = folder.load().map(|_| ()).unwrap_err();
    assert!(e.to_string().contains("`245 N` is a force") && e.place().contains("cases.toml"), "{e} {}", e.place());
    // A law of the model over a condition that no case sets.
    std::fs::write(folder.path().join("data/cases.toml"), CASES).unwrap();
    let law = "[[effect]]\neffect = \"interference_law\"\nat = \"GF1-7.phi\"\nof = \"linear_stiffness.k\"\ncondition = \"i\"\nreference = \"0.3 mm\"\na = \"0.2 1/mm\"\n";
    let head = text.find("[tolerance]").unwrap();
    let with_law = format!(
        "{}{law}{}",
        &text[..head],
        text[head..].replace("conditions = { i = [\"i_hi\"] }\nrange = { i = [\"0.03 mm\", \"1.3 mm\"] }", "conditions = {}")
    );
    std::fs::write(&file, with_law).unwrap();
    let e = Study::load(&file, None).map(|_| ()).unwrap_err();
    assert!(e.to_string().contains("the cases do not set `i`") && e.place().contains("again.toml"), "{e} {}", e.place());
}
