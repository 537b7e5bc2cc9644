use super::*;
use crate::diagnose::Case;
use crate::effect::Sign;
use crate::identify::Loss;
use crate::model::{ChannelSite, Site};
use crate::response::Plan;
use crate::study::{CycleQuantity, Predicted, dimension_of, unit_of};
use crate::units::Dimension;

#[test]
fn the_contracts_first_example() {
    let study = Folder::one(ONE).load().unwrap();
    assert_eq!(study.system.model.dofs.len(), 1);
    let free: Vec<String> = study.system.free().into_iter().map(|f| f.name).collect();
    assert_eq!(free, ["c1.x.linear_stiffness.k", "c1.x.viscous.c"]);
    let k = &study.system.instances[0].params[0];
    assert_eq!((k.value, k.min, k.max, k.free), (20e3, 0.0, f64::INFINITY, true));
    assert_eq!(k.unit, ("N/mm".to_string(), 1e3));
    assert_eq!(study.dataset.tests.iter().map(|t| study.split.word(&t.id)).collect::<Vec<_>>(), ["fit", "select", "held_out"]);
}

#[test]
fn the_contracts_chain() {
    let study = Folder::chain(CHAIN).load().unwrap();
    let model = &study.system.model;
    assert_eq!((model.bodies.len(), model.dofs.len(), model.places.len()), (9, 8, 16));
    assert_eq!((0..8).map(|p| model.place_name(p)).collect::<Vec<_>>(), ["base.x", "c1.x", "c2.x", "c3.x", "c4.x", "c5.x", "c6.x", "c7.x"]);
    // After the connectors the bodies, held against the ground.
    assert!((0..16).all(|p| model.on_connector(p) == (p < 8)));
    let p = model.places[model.places_at("m3.x").unwrap()[0]];
    assert_eq!((p.from, p.to), (None, model.dof("m3.x")));
    let ground = &model.bodies[model.connectors[0].from];
    assert!(ground.name == "ground" && ground.free.is_empty());
    for j in 1..8 {
        let c = &model.connectors[j];
        assert_eq!(
            (model.bodies[c.from].name.as_str(), model.bodies[c.to].name.as_str()),
            (format!("m{j}").as_str(), format!("m{}", j + 1).as_str())
        );
    }
    assert!(model.dofs.iter().all(|d| d.mass == 0.1));
    assert_eq!(study.system.instances[1].site, Site::Places((1..8).collect()));
}

#[test]
fn a_setting_is_fitted_where_it_has_bounds() {
    let free = |sigma: &str| {
        let more = format!("[[effect]]\neffect = \"bouc_wen\"\nat = \"c1.x\"\nf = \"1 N\"\nd = \"0.1 mm\"\nn = 1.5\nsigma = {sigma}\n");
        Folder::one(&format!("{ONE}{more}")).load().unwrap().system.free().iter().any(|f| f.name.ends_with("sigma"))
    };
    assert!(free("{ start = 0.6, min = 0.5, max = 1 }") && free("{ start = 0.6, fixed = false }") && free("{ start = 0.6, free = true }"));
    assert!(!free("0.6") && !free("{ start = 0.6, min = 0.5, fixed = true }"));
}

#[test]
fn every_role_with_its_units() {
    let more = r#"
[[effect]]
effect = "coulomb"
at = "c1.x"
f = { start = "2 N", max = "9 N", prior = { mean = "3 N", sigma = "10 %" } }
vr = { start = "0.01 mm/s", free = true }
[[effect]]
effect = "maxwell"
at = "c1.x"
k = { start = "5 N/mm", fixed = true }
tau = "0.1 s"
[[effect]]
effect = "backlash"
at = "c1.x"
g = "10 um"
f_close = "0.2 N"
[[effect]]
effect = "interference_law"
at = "c1.x"
of = "viscous.c"
condition = "i"
reference = "0.3 mm"
a = { start = "0.2 1/mm", min = "0 1/mm" }
[[effect]]
effect = "offset"
at = "loop-1Hz.force"
b = "0.3 N"
[[effect]]
effect = "gain"
at = "*.displacement"
g = 1.02
[[effect]]
effect = "moving_mass"
at = "*.force"
m = "20 g"
"#;
    let study = Folder::one(&format!("{ONE}{more}")).load().unwrap();
    let of = |name: &str| study.system.instances.iter().find(|i| i.name() == name).unwrap();
    let coulomb = &of("coulomb").params;
    assert_eq!((coulomb[0].max, coulomb[0].prior, coulomb[1].value, coulomb[1].free), (9.0, Some((3.0, 0.30000000000000004)), 1e-5, true));
    let maxwell = &of("maxwell").params;
    assert_eq!((maxwell[0].free, maxwell[1].free, maxwell[1].value), (false, true, 0.1));
    assert_eq!(of("backlash").params[0].value, 1e-5);
    let law = of("interference_law");
    let target = law.target.as_ref().unwrap();
    assert_eq!((target.instances.as_slice(), target.param, target.condition.as_str(), target.reference), ([1].as_slice(), 0, "i", 0.3e-3));
    assert_eq!((law.params[0].value, law.params[0].min), (200.0, 0.0));
    assert_eq!(dimension_of(&study.system, &study.dataset, law, 0), Dimension::DIMENSIONLESS.over(Dimension::LENGTH));
    assert_eq!(of("offset").site, Site::Channel(ChannelSite { test: "loop-1Hz".into(), role: "force".into() }));
    assert_eq!(dimension_of(&study.system, &study.dataset, of("offset"), 0), Dimension::FORCE);
    assert_eq!((of("gain").params[0].value, of("moving_mass").params[0].value), (1.02, 0.02));
    // Settings that are not named stay at their default and are not fitted.
    let free: Vec<String> = study.system.free().into_iter().map(|f| f.name).collect();
    assert!(free.contains(&"c1.x.interference_law(viscous.c).a".to_string()), "{free:?}");
    assert!(free.contains(&"c1.x.coulomb.vr".to_string()) && !free.iter().any(|f| f.contains("maxwell.k")));
    let constraints = study.constraints(&study.system, &study.system.free()).unwrap();
    let tau = free.iter().position(|f| f.ends_with("maxwell.tau")).unwrap();
    assert_eq!(constraints.lower[tau], f64::NEG_INFINITY, "fitted by its logarithm");
    let f = free.iter().position(|f| f.ends_with("coulomb.f")).unwrap();
    assert_eq!((constraints.lower[f], constraints.upper[f]), (0.0, 9.0));
    assert_eq!(study.priors(&study.system, &study.system.free())[0].index, f);
}

#[test]
fn a_coefficient_without_of_takes_the_only_strength_there() {
    let law = "[[effect]]\neffect = \"interference_law\"\nat = \"c1.x\"\ncondition = \"i\"\nreference = \"0.3 mm\"\na = \"0.2 1/mm\"\n";
    let alone = ONE.split("[[effect]]\neffect = \"viscous\"").next().unwrap();
    let first = alone.replacen("[[effect]]", &format!("{law}[[effect]]"), 1);
    let study = Folder::one(&first).load().unwrap();
    // Declared before its target: the order of the effects in the file does not matter.
    let target = study.system.instances[0].target.as_ref().unwrap();
    assert_eq!((target.instances.as_slice(), target.param), ([1].as_slice(), 0));
}

#[test]
fn rotations_take_moments_and_angles() {
    let text = ONE.replace("c1.x", "c1.psi").replace("free = [\"x\"]", "free = [\"psi\"]").replace("20 N/mm", "1490 N mm/deg");
    let text = text.replace("min = \"0 N/mm\"", "min = \"0 N m/rad\"").replace("N s/mm", "N m s/rad");
    let folder = Folder::one(&text);
    let dataset = std::fs::read_to_string(folder.path().join("data/dataset.toml")).unwrap();
    let dataset = dataset
        .replace("c1.x", "c1.psi")
        .replace("unit=\"mm\"", "unit=\"deg\"")
        .replace("unit=\"N\"", "unit=\"N m\"")
        .replace("0.5 N\"", "0.5 N m\"");
    std::fs::write(folder.path().join("data/dataset.toml"), dataset).unwrap();
    let study = folder.load().unwrap();
    assert!((study.system.instances[0].params[0].value - 1.49f64.to_degrees()).abs() < 1e-9);
    refused(read(&text.replace("1490 N mm/deg", "20 N/mm"), &study.dataset), "`20 N/mm` is a stiffness", "key effect[0].k.start");
}

#[test]
fn settings_and_predictions() {
    let more = r#"
assumptions = ["the shelf is rigid"]
title = "one connector"
fit = { loss = "huber", width = 2, max_iterations = 40, starts = 4 }
search = { effects = ["coulomb", "backlash"], places = ["c1.x", "*.force"], max_added = 3 }
"#;
    let predictions = r#"
[[prediction]]
case = "design"
quantity = "W_D"
at = "c1.x"
control = "displacement"
amplitude = "0.4 mm"
conditions = { frequency = "1 Hz", i = "0.4 mm" }
reference = "74 mJ"
[[prediction]]
case = "stiffness under load"
quantity = "stiffness"
at = "c1.x"
control = "force"
force_min = "21.6 N"
force_max = "138.3 N"
conditions = { frequency = "5 Hz" }
[[prediction]]
case = "first mode"
quantity = "natural_frequency"
mode = 1
reference = "290 Hz"
[[prediction]]
case = "line"
quantity = "mobility"
excite = "end.x"
respond = "c1.x"
frequency = "120 Hz"
"#;
    let text = ONE.replacen("[[body]]", &format!("{more}[[body]]"), 1) + predictions;
    let study = Folder::one(&text).load().unwrap();
    assert_eq!((study.fit.loss, study.fit.max_iterations, study.fit.starts), (Loss::Huber(2.0), Some(40), 4));
    assert_eq!((study.search.effects.as_ref().unwrap().len(), study.search.max_added), (2, Some(3)));
    assert_eq!((study.title.as_str(), study.assumptions.len()), ("one connector", 1));
    let Predicted::Cycle { quantity: CycleQuantity::Dissipated, limits, frequency, .. } = study.predictions[0].quantity else { panic!() };
    assert_eq!((limits, frequency), ((-0.4e-3, 0.4e-3), 1.0));
    assert_eq!(study.predictions[0].reference.as_ref().unwrap().value, 0.074);
    assert_eq!(
        study.predictions.iter().map(|p| p.quantity.word()).collect::<Vec<_>>(),
        ["W_D", "stiffness", "natural_frequency", "mobility"]
    );
    let wrong = |from: &str, to: &str, message: &str, place: &str| {
        assert!(text.contains(from), "{from}");
        refused(read(&text.replace(from, to), &study.dataset), message, place);
    };
    wrong("\"W_D\"", "\"WD\"", "unknown quantity `WD`, nearest is `W_D`", "key prediction[0].quantity");
    wrong("74 mJ", "74 N", "where a moment or energy is expected", "key prediction[0].reference");
    wrong("frequency = \"1 Hz\", i = \"0.4 mm\"", "i = \"0.4 N\"", "where a length is expected", "key prediction[0].conditions.i");
    wrong("frequency = \"5 Hz\"", "i = \"0.4 mm\"", "required key `frequency` is missing", "key prediction[1]");
    wrong("force_max = \"138.3 N\"", "", "not complete", "key prediction[1]");
    wrong("force_max", "displacement_max", "not a limit under force control", "key prediction[1].displacement_max");
    wrong("mode = 1", "mode = 0", "0 is out of range", "key prediction[2].mode");
    wrong("excite = \"end.x\"", "excite = \"ende.x\"", "there is no place `ende.x`; the nearest is `end.x`", "key prediction[3].excite");
    wrong("loss = \"huber\"", "loss = \"hubr\"", "unknown loss `hubr`, nearest is `huber`", "line 7, key fit.loss");
    wrong("width = 2", "width = 0", "a width of 0", "key fit.width");
    wrong("starts = 4", "start = 4", "unknown key `start`, nearest is `starts`", "key fit.start");
    wrong("\"backlash\"]", "\"backlsh\"]", "unknown effect `backlsh`, nearest is `backlash`", "key search.effects[1]");
    wrong("[\"c1.x\", \"*.force\"]", "[\"c2.x\"]", "there is no place `c2.x`; the nearest is `c1.x`", "key search.places[0]");
    wrong("[\"c1.x\", \"*.force\"]", "[\"*.forse\"]", "the nearest is `*.force`", "key search.places[0]");
}

#[test]
fn raw_files_may_lie_elsewhere() {
    let folder = Folder::one(&ONE.replacen("split", "folder = \"raw\"\nsplit", 1));
    refused(folder.load(), "test `loop-1Hz`: the file", "study.toml, line 3, key folder");
    let raw = folder.path().join("raw");
    std::fs::create_dir(&raw).unwrap();
    for hz in [1, 2, 5] {
        std::fs::rename(folder.path().join(format!("data/loop-{hz}.csv")), raw.join(format!("loop-{hz}.csv"))).unwrap();
    }
    assert_eq!(folder.load().unwrap().data.unwrap(), folder.path().join("raw"));
    // The command line wins over the file.
    let e = Study::load(&folder.path().join("study.toml"), Some(folder.path())).unwrap_err();
    assert!(e.to_string().contains("given on the command line"), "{e}");
    assert!(Study::load(&folder.path().join("study.toml"), Some(&raw)).is_ok());
}

#[test]
fn programs_make_effects_by_name_and_place() {
    let study = Folder::one(ONE).load().unwrap();
    let coulomb = study.instance("coulomb", "c1.x", &[("f", 3.0)], None).unwrap();
    assert_eq!((coulomb.params[0].value, coulomb.params[0].free, coulomb.params[1].free), (3.0, true, false));
    assert_eq!(unit_of(&study.system, &study.dataset, &coulomb, 0).symbol, "N");
    assert_eq!(unit_of(&study.system, &study.dataset, &coulomb, 1).symbol, "mm/s");
    for (effect, at, message) in [
        ("coulom", "c1.x", "nearest is `coulomb`"),
        ("coulomb", "c9.x", "nearest is `c1.x`"),
        ("delay", "loop-3Hz.force", "there is no test `loop-3Hz`"),
        ("interference_law", "c1.x", "needs a condition"),
    ] {
        let e = study.instance(effect, at, &[], None).unwrap_err();
        assert!(e.to_string().contains(message), "{e}");
    }
    assert!(study.instance("coulomb", "c1.x", &[("k", 1.0)], None).unwrap_err().to_string().contains("no parameter `k`"));
}

#[test]
fn every_library_effect_has_a_unit_for_printing() {
    let (loops, responses) = (Folder::one(ONE).load().unwrap(), Folder::new(CHAIN, FRF).load().unwrap());
    for effect in crate::effect::LIBRARY.iter() {
        // A formula has the units that its study states; the geometry is that of parts in space (tests/space.rs).
        if matches!(effect, crate::effect::Effect::Formula(_) | crate::effect::Effect::Geometry(_)) {
            continue;
        }
        let info = effect.info();
        let (study, at) = match effect {
            crate::effect::Effect::Channel(law) if law.reads() == Some("response") => (&responses, "*.response"),
            crate::effect::Effect::Channel(_) => (&loops, "*.force"),
            _ => (&loops, "c1.x"),
        };
        let of = crate::study::CoefficientOf { of: Some("viscous.c".into()), condition: "i".into(), reference: 3e-4 };
        let values: Vec<(&str, f64)> =
            info.params.iter().filter(|p| p.sign == Sign::Positive && p.default == 0.0).map(|p| (p.name, 0.5)).collect();
        let instance = study.instance(info.name, at, &values, Some(&of)).unwrap();
        for p in 0..info.params.len() {
            let unit = unit_of(&study.system, &study.dataset, &instance, p);
            let dimension = dimension_of(&study.system, &study.dataset, &instance, p);
            assert!(dimension.accepts(unit.dimension), "{}.{}", info.name, info.params[p].name);
            let text = unit.print(0.00123);
            assert_eq!(crate::units::parse(&text, dimension).unwrap(), 0.00123, "{text}");
        }
    }
}

#[test]
fn one_law_serves_several_groups_of_one_effect() {
    let data = format!("{FRF}{}", cycle(1.0, ", i = \"0.3 mm\"")).replace("load = \"80 N\"", "load = \"80 N\", i = \"0.1 mm\"");
    let law = |at: &str| {
        format!(
            "[[effect]]\neffect = \"interference_law\"\nat = {at}\nof = \"linear_stiffness.k\"\ncondition = \"i\"\nreference = \"0.3 mm\"\na = \"2 1/mm\"\n"
        )
    };
    let one = Folder::new(&format!("{CHAIN}{}", law("[\"base.x\", \"c1-7.x\"]")), &data);
    let study = one.load().unwrap();
    let target = study.system.instances[2].target.as_ref().unwrap();
    assert_eq!((target.instances.as_slice(), target.param), ([0, 1].as_slice(), 0));
    assert_eq!(study.system.free().last().unwrap().name, "base.x,c1-7.x.interference_law(linear_stiffness.k).a");
    // Two laws of the same exponent say the same, and a step of the one exponent moves the response as steps of both do.
    let two = Folder::new(&format!("{CHAIN}{}{}", law("\"base.x\""), law("\"c1-7.x\"")), &data).load().unwrap();
    let computed = |study: &Study| {
        let plan = Plan::new(study.dataset.test("frf-a").unwrap(), &study.system.model).unwrap();
        plan.evaluate(&study.system, &study.system.free(), true).unwrap()
    };
    let (a, b) = (computed(&study), computed(&two));
    assert_eq!(a.values, b.values);
    let na = study.system.free().len();
    let column = |c: &crate::response::Computed, k: usize| -> Vec<f64> {
        c.slopes.chunks(c.slopes.len() / c.values.len()).map(|row| row[k]).collect()
    };
    let (shared, each) = (column(&a, na - 1), [column(&b, na - 1), column(&b, na)]);
    let size = shared.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    assert!(size > 0.0);
    for (i, s) in shared.iter().enumerate() {
        assert!((s - each[0][i] - each[1][i]).abs() < 1e-9 * size, "{i}: {s} {} {}", each[0][i], each[1][i]);
    }
    // Written and read again it is the same.
    assert_eq!(essence(&read(&study.with_values(&study.system, one.path()), &one.dataset()).unwrap()), essence(&study));
    // Part of a group cannot be scaled.
    let e = read(&format!("{CHAIN}{}", law("[\"base.x\", \"c1.x\"]")), &one.dataset()).unwrap_err();
    assert!(e.to_string().contains("no parameter `linear_stiffness.k`"), "{e}");
}

#[test]
fn what_a_model_may_be_off_by_in_an_frf_widens_its_sigma() {
    let dataset = Folder::new(CHAIN, FRF).dataset();
    let plans = |text: &str| Case::from_study(&read(text, &dataset).unwrap(), 1).unwrap().plans;
    let (plain, wide) = (plans(CHAIN), plans(&CHAIN.replacen("dataset", "fit = { frf_tolerance = 0.03 }\ndataset", 1)));
    let (a, b) = (&plain[0].0, &wide[0].0);
    for (line, (s, w)) in a.sigma.chunks(2).zip(b.sigma.chunks(2)).enumerate() {
        let h = a.measured[2 * line].hypot(a.measured[2 * line + 1]);
        for k in 0..2 {
            assert!((w[k].powi(2) - s[k].powi(2) - 0.5 * (0.03 * h).powi(2)).abs() < 1e-12 * w[k].powi(2));
        }
    }
    assert!(b.notes.iter().any(|n| n.contains("3.000 % of |H|")), "{:?}", b.notes);
    for bad in ["0", "1", "-0.1", "\"3 %\""] {
        let e = read(&CHAIN.replacen("dataset", &format!("fit = {{ frf_tolerance = {bad} }}\ndataset"), 1), &dataset).unwrap_err();
        let said = format!("{e} {}", crate::explain::Explain::place(&e));
        assert!(said.contains("frf_tolerance") || said.contains("a tolerance of"), "{bad}: {said}");
    }
}
