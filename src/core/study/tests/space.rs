//! Parts along arcs, from the file to every kind of response.

use crate::diagnose::Case;
use crate::diagnose::testing::{Scene, candidates};
use crate::response::Plan;

use super::*;

/// Eight parts along two arcs on a pin and a shelf, loaded at P by a device.
pub const SPACE: &str = r#"schema = 1
dataset = "data"
[[arc]]
radius = "150 mm"
angle = "12 deg"
[[arc]]
radius = "60 mm"
angle = "35 deg"
start = ["-3.27786 mm", "31.18675 mm"]
heading = "102 deg"
[[part]]
name = "b"
count = 8
section = { width = "20 mm", thickness = "9 mm", density = "3200 kg/m3" }
[[joint]]
part = "b1"
free = ["psi"]
at = "start"
[[joint]]
part = "b8"
free = ["x", "y", "psi"]
at = "end"
[[point]]
name = "P"
at = ["2 mm", "33 mm"]
[[point]]
name = "tip"
part = "b8"
at = "end"
[[connector]]
name = "GF"
chain = "b"
[[connector]]
name = "shelf"
from = "ground"
to = "tip"
[[connector]]
name = "device"
from = "ground"
to = "P"
absent = ["loop-*"]
[[load]]
at = "P.x"
condition = "load"
factor = -1
via = ["-138.3 N"]
steps = 5
[[effect]]
effect = "linear_stiffness"
at = "GF1-7.x"
k = { start = "30e3 N/mm", fixed = true }
[[effect]]
effect = "linear_stiffness"
at = "GF1-7.y"
k = { start = "40e3 N/mm", fixed = true }
[[effect]]
effect = "linear_stiffness"
at = "GF1-7.z"
k = { start = "90e3 N/mm", fixed = true }
[[effect]]
effect = "linear_stiffness"
at = "GF1-7.theta"
k = { start = "1e6 N mm/deg", fixed = true }
[[effect]]
effect = "linear_stiffness"
at = "GF1-7.phi"
k = "900 N mm/deg"
[[effect]]
effect = "linear_stiffness"
at = "GF1-3.psi"
k = "1490 N mm/deg"
[[effect]]
effect = "linear_stiffness"
at = "GF4-7.psi"
k = "1960 N mm/deg"
[[effect]]
effect = "viscous"
at = "GF1-7.psi"
c = "0.2 N mm s/deg"
[[effect]]
effect = "viscous"
at = "GF1-7.phi"
c = "0.1 N mm s/deg"
[[effect]]
effect = "elastic_slip"
at = "GF1-2.psi"
f = { start = "300 N mm", min = "0 N mm" }
d = "0.01 rad"
[[effect]]
effect = "linear_stiffness"
at = "shelf.x"
k = { start = "5000 N/mm", fixed = true }
[[effect]]
effect = "linear_stiffness"
at = "device.x"
k = "400 N/mm"
"#;

const TESTS: &str = r#"
[[test]]
id = "loop-a"
kind = "cycle"
file = "loop-1.csv"
control = "force"
conditions = { frequency = "1 Hz" }
channels = [
 { role="time", column="t", unit="s" },
 { role="force", at="P.x", column="F", unit="N" },
 { role="displacement", at="P.x", column="x", unit="mm", sigma="0.01 mm" },
 { role="displacement", at="tip.y", column="x", unit="mm", sigma="0.01 mm" }]
[[test]]
id = "frf-80N"
kind = "frf"
file = "frf.csv"
excite = "P.x"
respond = "tip.y"
quantity = "accelerance"
conditions = { load = "80 N" }
channels = [
 { role="frequency", column="f", unit="Hz" },
 { role="real", column="re", unit="m/s2/N" },
 { role="imag", column="im", unit="m/s2/N" },
 { role="coherence", column="coh", averages=20 }]
[[test]]
id = "modal-80N"
kind = "modal"
conditions = { load = "80 N" }
rows = [
 { mode = 1, frequency = "300 Hz", damping = "5 %", family = "xy bending" },
 { mode = 2, frequency = "600 Hz", damping = "5 %", family = "xy bending" },
 { mode = 3, frequency = "900 Hz", damping = "5 %", family = "torsion" },
 { mode = 4, frequency = "1900 Hz", family = "leaf springs" }]
[[test]]
id = "transient-a"
kind = "transient"
file = "loop-5.csv"
control = "force"
conditions = { load = "20 N" }
channels = [
 { role="time", column="t", unit="s" },
 { role="force", at="P.x", column="F", unit="N" },
 { role="displacement", at="P.x", column="x", unit="mm", sigma="0.01 mm" }]
[[test]]
id = "energy-a"
kind = "energy"
at = "P.x"
control = "force"
force_min = "-60 N"
force_max = "-10 N"
rows = [{ frequency = "1 Hz", W_D = "1 mJ", W_s = "20 mJ" }]
"#;

#[test]
fn a_chain_along_arcs_is_read_and_written() {
    let folder = Folder::new(SPACE, TESTS);
    let study = folder.load().unwrap();
    let model = &study.system.model;
    assert_eq!((model.bodies.len(), model.dofs.len(), model.declared), (9, 6 * 6 + 1 + 3, 9));
    assert!(model.dof("P.psi").is_some() && model.dof("tip.y").is_some() && model.dof("b8.y").is_none());
    assert_eq!(model.places_at("GF1-3.psi").unwrap().len(), 3);
    let again = read(&study.with_values(&study.system, std::path::Path::new(".")), &study.dataset).unwrap();
    assert_eq!(again.system.model, study.system.model);
    assert_eq!(again.graph.tables, study.graph.tables);
}

/// A part is a place: a mass there is a heavier part, and one that nobody drew is looked for at each of them.
#[test]
fn a_mass_at_a_part_is_a_heavier_part() {
    let study = Folder::new(SPACE, TESTS).load().unwrap();
    let at = "b5.x,b5.y,b5.z";
    let part = study.system.model.bodies.iter().position(|b| b.name == "b5").unwrap();
    let added = read(
        &SPACE.replacen("[[load]]", "[[effect]]\neffect = \"added_mass\"\nat = [\"b5.x\", \"b5.y\", \"b5.z\"]\nm = \"2 g\"\n[[load]]", 1),
        &study.dataset,
    )
    .unwrap();
    let mut heavier = study.system.clone();
    let space = heavier.model.space.as_mut().unwrap();
    assert_eq!(space.parts[part].centre, [0.0; 3]);
    space.parts[part].mass += 2e-3;
    for dof in heavier.model.dofs.iter_mut().filter(|d| d.body == part && !d.axis.rotational()) {
        dof.mass += 2e-3;
    }
    for test in &study.dataset.tests {
        let values = |system: &crate::model::System| Plan::new(test, &system.model).unwrap().evaluate(system, &[], false).unwrap().values;
        let (there, want, without) = (values(&added.system), values(&heavier), values(&study.system));
        let size = want.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        assert!(there.iter().zip(&want).all(|(a, b)| (a - b).abs() < 1e-6 * size), "{}", test.id);
        let seen = want.iter().zip(&without).any(|(a, b)| (a - b).abs() > 1e-4 * size);
        assert!(seen || !test.id.starts_with("frf"), "{}", test.id);
    }
    let case = Case::from_study(&study, 1).unwrap();
    let plans: Vec<&Plan> = case.plans.iter().map(|(p, _)| p).collect();
    let (names, _) = candidates(&case, &study.system, &plans, &Scene::new(&plans, &study.system));
    assert!(
        names.iter().any(|n| n.effect == "added_mass" && n.at == at) && !names.iter().any(|n| n.effect == "coulomb" && n.at.contains("b5"))
    );
}

/// Every kind of test computes on the chain, and its slopes are the differences.
#[test]
fn every_response_of_a_chain_has_exact_slopes() {
    let study = Folder::new(SPACE, TESTS).load().unwrap();
    let free = study.system.free();
    for test in &study.dataset.tests {
        let plan = Plan::new(test, &study.system.model).unwrap();
        if test.id == "modal-80N" {
            assert!(plan.notes.iter().any(|n| n.contains("leaf springs")), "{:?}", plan.notes);
        }
        let base = plan.evaluate(&study.system, &free, true).unwrap_or_else(|e| panic!("{}: {e} ({})", test.id, e.accepted()));
        println!("{}: {:?}", test.id, &base.values[..base.values.len().min(8)]);
        assert!(base.values.iter().all(|v| v.is_finite()) && base.values.len() == plan.len());
        for (k, f) in free.iter().enumerate() {
            let value = study.system.instances[f.instance].params[f.param].value;
            let h = 1e-4 * value;
            let at = |h: f64| {
                let mut moved = study.system.clone();
                moved.instances[f.instance].params[f.param].value += h;
                plan.evaluate(&moved, &free, false).unwrap().values
            };
            let (up, down) = (at(h), at(-h));
            let scale = if f.log { value } else { 1.0 };
            let numeric: Vec<f64> = up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * h) * scale).collect();
            let size = numeric.iter().fold(0.0f64, |m, d| m.max(d.abs()));
            let noise = base.values.iter().fold(0.0f64, |m, v| m.max(v.abs())) * 1e-8 / h * scale;
            for (i, n) in numeric.iter().enumerate() {
                let exact = base.slopes[i * free.len() + k];
                assert!((exact - n).abs() < 2e-4 * size + noise, "{} {} at {i}: {exact} {n} of {size}", test.id, f.name);
            }
        }
    }
}

#[test]
fn what_is_wrong_with_a_chain_is_said_where_it_is() {
    let dataset = Folder::new(SPACE, TESTS).dataset();
    let case = |from: &str, to: &str, message: &str, place: &str| {
        assert!(SPACE.contains(from), "{from}");
        refused(read(&SPACE.replacen(from, to, 1), &dataset), message, place);
    };
    case("start = [\"-3.27786 mm\"", "start = [\"-2.27786 mm\"", "arcs 1 and 2 do not meet: 1.0000 mm", "line 6, key arc[1]");
    case("heading = \"102 deg\"", "heading = \"98 deg\"", "do not meet: 0.0000 mm and 4.0000 deg", "line 6, key arc[1]");
    case("radius = \"60 mm\"", "radius = \"60 N\"", "where a length is expected", "key arc[1].radius");
    case("angle = \"35 deg\"\n", "", "the arc is not complete", "key arc[1]");
    case("count = 8", "count = 1", "1", "key part[0].count");
    case("count = 8", "count = \"modal basis\"", "required key `modulus` is missing", "key part[0]");
    case("section = {", "mass = \"1 g\"\nsection = {", "a section gives mass", "key part[0].mass");
    case("density = \"3200 kg/m3\"", "density = \"3200 kg\"", "is expected", "density");
    case(
        "section = { width = \"20 mm\", thickness = \"9 mm\", density = \"3200 kg/m3\" }\n",
        "",
        "part `b1` has no inertia along `b1.psi`, and test `frf-80N` needs it",
        "",
    );
    case("part = \"b1\"", "part = \"b11\"", "unknown part `b11`, nearest is `b1`", "key joint[0].part");
    case("free = [\"psi\"]", "free = [\"psy\"]", "unknown axis `psy`", "key joint[0].free[0]");
    case("at = \"start\"", "at = \"strt\"", "unknown place `strt`", "key joint[0].at");
    case("chain = \"b\"", "chain = \"c\"", "unknown part with a count `c`", "key connector[0].chain");
    case("to = \"P\"", "to = \"Q\"", "unknown part `Q`", "key connector[2].to");
    case("absent = [\"loop-*\"]", "absent = [\"lop-*\"]", "there is no test `lop-*`", "");
    case("at = \"P.x\"\ncondition", "at = \"P.w\"\ncondition", "there is no degree of freedom `P.w`", "key load[0].at");
    case("factor = -1\nvia", "factor = -1\nforce = \"3 N\"\nvia", "not there, or given twice", "key load[0]");
    case("at = \"GF1-3.psi\"", "at = \"GF1-9.psi\"", "no place `GF8.psi`", "key effect[5].at");
    case("angle = \"35 deg\"", "angle = \"355 deg\"", "turn by 367.0 deg in all", "key arc[1]");
    case(
        "part = \"b1\"\nfree = [\"psi\"]\nat = \"start\"",
        "part = \"b1\"\nfree = [\"psi\"]\nat = \"end\"",
        "the hinge line lies",
        "key joint[0].at",
    );
    let bent = |effect: &str| format!("{SPACE}[[effect]]\n{effect}\n");
    let wrong = |effect: &str, message: &str, place: &str| refused(read(&bent(effect), &dataset), message, place);
    wrong("effect = \"curvature\"\nat = \"c\"\nc = 0", "no chain of parts `c`", "key effect[12].at");
    wrong("effect = \"curvature\"\nat = \"b\"\nc = 9", "turn by 470.0 deg in all: the chain meets itself", "");
    wrong("effect = \"point_offset\"\nat = \"P.psi\"\nd = \"1 mm\"", "a point does not lie along `psi`", "key effect[12].at");
    wrong("effect = \"point_offset\"\nat = \"P.x\"\nd = \"1 N\"", "where a length is expected", "key effect[12].d");
    wrong(
        "effect = \"point_offset\"\nat = [\"P.x\", \"P.y\"]\nd = \"1 mm\"",
        "moves one chain or point, and 2 are named",
        "key effect[12].at[1]",
    );
    // A gap in the chain: nothing acts at GF4.
    let gap = SPACE.replace("GF1-7", "GF5-7").replace("at = \"GF4-7.psi\"", "at = \"GF5-7.psi\"");
    let free = gap
        .replace("free = [\"x\", \"y\", \"psi\"]\nat = \"end\"", "free = [\"x\", \"y\", \"z\", \"theta\", \"phi\", \"psi\"]\nat = \"end\"");
    let free = free.replace("at = \"shelf.x\"", "at = \"device.y\"");
    refused(read(&free, &dataset), "the chain is not connected", "");
}

#[test]
fn a_test_says_which_supports_it_has() {
    let with = |supports: &str| {
        let tests = TESTS.replacen("kind = \"modal\"\n", &format!("kind = \"modal\"\nsupports = {supports}\n"), 1);
        let dataset = Folder::new(SPACE, &tests).dataset();
        read(SPACE, &dataset)
    };
    let absent = |supports: &str| {
        let study = with(supports).unwrap();
        let model = study.system.model;
        (0..model.declared).filter(|c| !model.present(*c, "modal-80N")).map(|c| model.connectors[c].name.clone()).collect::<Vec<_>>()
    };
    assert_eq!(absent("[\"shelf\", \"device\"]"), Vec::<String>::new());
    assert_eq!(absent("[\"shelf\"]"), ["device"]);
    assert_eq!(absent("[]"), ["shelf", "device"]);
    refused(with("[\"shlf\"]"), "there is no support (connector to the ground) `shlf`", "");
    refused(with("[\"GF1\"]"), "there is no support (connector to the ground) `GF1`", "");
    // The study says that the device is not there.
    let dataset = Folder::new(SPACE, &TESTS.replacen("kind = \"cycle\"\n", "kind = \"cycle\"\nsupports = [\"device\"]\n", 1)).dataset();
    refused(read(SPACE, &dataset), "test `loop-a` has the support `device`, and the study says it is absent there", "");
}

/// The geometry is a parameter like any other: a chain that was bent is told from one that was not.
#[test]
fn curvature_moves_the_modes_of_a_loaded_chain() {
    let folder = Folder::new(&format!("{SPACE}[[effect]]\neffect = \"curvature\"\nat = \"b\"\nc = \"0.1\"\n"), TESTS);
    let study = folder.load().unwrap();
    let free = study.system.free();
    let k = free.iter().position(|f| f.name == "b.curvature.c").unwrap();
    let plan = Plan::new(study.dataset.test("modal-80N").unwrap(), &study.system.model).unwrap();
    let at = |c: f64| {
        let mut system = study.system.clone();
        system.instances[free[k].instance].params[0].value = c;
        plan.evaluate(&system, &free, true).unwrap()
    };
    let here = at(0.1);
    let slope: Vec<f64> = (0..plan.len()).map(|i| here.slopes[i * free.len() + k]).collect();
    assert!(slope[0].abs() > 1e-3, "{slope:?}");
    // A step ten times as long agrees to its second order; other columns are those of the system that is bent.
    let (up, down) = (at(0.11).values, at(0.09).values);
    for (i, s) in slope.iter().enumerate() {
        assert!(((up[i] - down[i]) / 0.02 - s).abs() < 1e-2 * slope[0].abs(), "{i}: {s}");
    }
    let shaped = study.system.shaped();
    let mut others = free.clone();
    others.remove(k);
    let plain = plan.evaluate(&shaped, &others, true).unwrap();
    assert_eq!(plain.values, here.values);
    for i in 0..plan.len() {
        for (j, f) in others.iter().enumerate() {
            let with = free.iter().position(|g| g == f).unwrap();
            assert_eq!(plain.slopes[i * others.len() + j], here.slopes[i * free.len() + with]);
        }
    }
    let again = read(&study.with_values(&study.system, std::path::Path::new(".")), &study.dataset).unwrap();
    assert_eq!(essence(&again), essence(&study));
}

#[test]
fn a_table_is_compared_by_its_shifts_against_another() {
    let other = r#"[[test]]
id = "modal-20N"
kind = "modal"
conditions = { load = "20 N" }
rows = [
 { mode = 1, frequency = "290 Hz", family = "xy bending" },
 { mode = 2, frequency = "610 Hz", family = "xy bending" },
 { mode = 7, frequency = "900 Hz", family = "torsion" }]
"#;
    let shift = |test: &str, against: &str, sigma: &str| {
        let table = format!("[[shift]]\ntest = \"{test}\"\nagainst = \"{against}\"\nsigma = \"{sigma}\"\n[[arc]]");
        SPACE.replacen("[[arc]]", &table, 1)
    };
    let folder = Folder::new(&shift("modal-20N", "modal-80N", "0.1 %"), &format!("{TESTS}{other}"));
    let study = folder.load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let shifted = &case.plans.iter().find(|(p, _)| p.id == "modal-20N").unwrap().0;
    let plain = |id: &str| Plan::new(study.dataset.test(id).unwrap(), &study.system.model).unwrap();
    let (own, against) = (plain("modal-20N"), plain("modal-80N"));
    let (free, n) = (study.system.free(), study.system.free().len());
    let at = |p: &Plan| p.evaluate(&study.system, &free, true).unwrap();
    let (by_shift, by_own, there) = (at(shifted), at(&own), at(&against));
    for row in 0..2 {
        // The frequency it would have if the other test were met exactly.
        let wanted = by_own.values[row] - there.values[row] + against.measured[row];
        assert!((by_shift.values[row] - wanted).abs() < 1e-12 && (shifted.sigma[row] - 1e-3).abs() < 1e-15);
        for k in row * n..(row + 1) * n {
            assert!((by_shift.slopes[k] - (by_own.slopes[k] - there.slopes[k])).abs() < 1e-12);
        }
    }
    // A mode that the other table does not have is compared as it is.
    assert_eq!((by_shift.values[2], shifted.sigma[2]), (by_own.values[2], own.sigma[2]));
    let again = read(&study.with_values(&study.system, std::path::Path::new(".")), &study.dataset).unwrap();
    assert_eq!(again.shifts, study.shifts);
    let wrong = |study_toml: &str, message: &str, place: &str| refused(read(study_toml, &study.dataset), message, place);
    wrong(&shift("modal-20N", "modal-20N", "0.1 %"), "does not shift against itself", "key shift[0].against");
    wrong(&shift("modal-20N", "loop-a", "0.1 %"), "unknown modal test `loop-a`", "key shift[0].against");
    wrong(&shift("modal-20N", "modal-80N", "0 %"), "a deviation of 0", "key shift[0].sigma");
}

#[test]
fn the_energies_of_a_mode_add_up_and_a_fixture_is_told() {
    let study = Folder::new(SPACE, TESTS).load().unwrap();
    let plan = Plan::new(study.dataset.test("modal-80N").unwrap(), &study.system.model).unwrap();
    let telling = crate::diagnose::Telling { energy: 0.0, fixture: 0.0, ..Default::default() };
    let modes = crate::diagnose::mode_energies(&plan, &study.system, &telling);
    assert_eq!(modes.iter().map(|m| m.mode).collect::<Vec<_>>(), [1, 2, 3]);
    for m in &modes {
        let sum = |list: &[crate::diagnose::results::EnergyShare]| list.iter().map(|s| s.share).sum::<f64>();
        assert!((sum(&m.strain) - 1.0).abs() < 1e-9 && (sum(&m.kinetic) - 1.0).abs() < 1e-9, "{m:?}");
    }
    // The device is absent in the loops, the shelf is there in every test: it is a part of the structure.
    let told = modes[0].finding.as_ref().unwrap();
    assert!(told.contains("device") && !told.contains("shelf"), "{told}");
    let never = crate::diagnose::Telling { fixture: 1.0, ..telling };
    assert!(crate::diagnose::mode_energies(&plan, &study.system, &never).iter().all(|m| m.finding.is_none()));
}

#[test]
fn the_modal_basis_gives_the_number_of_parts() {
    let dataset = Folder::new(SPACE, TESTS).dataset();
    let text = SPACE.replace("count = 8", "count = \"modal basis\"\nmodulus = \"28000 N/mm2\"\nhighest = \"2500 Hz\"");
    let text = text.replace("GF1-7", "GF1-13").replace("GF4-7", "GF4-13").replace("\"b8\"", "\"b14\"");
    let study = read(&text, &dataset).unwrap();
    assert_eq!(study.system.model.declared, 13 + 2);
}

#[test]
fn places_asked_for_are_searched_where_nothing_acts() {
    let asked = SPACE.replacen("[[arc]]", "[search]\nplaces = [\"shelf.y\", \"shelf.y,device.y\", \"GF1-3.psi\"]\n[[arc]]", 1);
    let study = Folder::new(&asked, &TESTS.replace("\"900 Hz\"", "\"2900 Hz\"")).load().unwrap();
    let case = Case::from_study(&study, 1).unwrap();
    let plans: Vec<&Plan> = case.plans.iter().map(|(p, _)| p).collect();
    let scene = Scene::new(&plans, &study.system);
    let (names, trials) = candidates(&case, &study.system, &plans, &scene);
    let at = |effect: &str| -> Vec<&str> { names.iter().filter(|n| n.effect == effect).map(|n| n.at.as_str()).collect() };
    assert_eq!(at("coulomb"), ["GF1-3.psi", "shelf.y", "shelf.y,device.y"]);
    // Nothing acts there for it to be in series with.
    assert_eq!(at("backlash"), ["GF1-3.psi"]);
    let places = |name: &str| {
        let trial = trials.iter().find(|t| names[t.candidate].at == name).unwrap();
        let crate::model::Site::Places(places) = &trial.instance.site else { panic!("places") };
        places.iter().map(|p| study.system.model.place_name(*p)).collect::<Vec<_>>()
    };
    assert_eq!(places("shelf.y,device.y"), ["shelf.y", "device.y"]);
    // Slow loops and fast modes: the band of a constant loss may begin at either end of what lies between, and the modes lend the law their
    // periods.
    let mut bands: Vec<f64> = trials
        .iter()
        .filter(|t| names[t.candidate].effect == "structural_damping" && names[t.candidate].at == "GF1-3.psi")
        .map(|t| t.instance.params[1].value)
        .collect();
    bands.dedup();
    assert!(bands.len() == 3 && bands[0] == 0.01, "{bands:?}");
    assert!((bands[1] / 2900f64.sqrt() - 1.0).abs() < 1e-9 && (bands[2] / 2900f64.powf(0.75) - 1.0).abs() < 1e-9, "{bands:?}");
}
