//! What is exported names every part, marker, joint and force, and nothing that is not there.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

use super::*;
use crate::data::Dataset;
use crate::data::toml_strict::TomlFile;
use crate::study::Study;

/// Eight parts along two arcs on a pin and a shelf that may open, loaded at P by a device, with laws of every kind.
const SPACE: &str = r#"schema = 1
dataset = "data"
[[arc]]
radius = "150 mm"
angle = "12 deg"
[[arc]]
radius = "60 mm"
angle = "35 deg"
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
[[connector]]
name = "GF"
chain = "b"
[[connector]]
name = "shelf"
from = "ground"
to = "b8"
[[connector]]
name = "device"
from = "ground"
to = "P"
[[load]]
at = "P.x"
condition = "load"
via = ["138.3 N"]
"#;

const EFFECTS: [(&str, &str, &str); 14] = [
    ("linear_stiffness", "GF1-7.x", "k = \"30e3 N/mm\""),
    ("linear_stiffness", "GF1-7.y", "k = \"40e3 N/mm\""),
    ("linear_stiffness", "GF1-7.z", "k = \"90e3 N/mm\""),
    ("linear_stiffness", "GF1-7.theta", "k = \"1e6 N mm/deg\""),
    ("linear_stiffness", "GF1-7.phi", "k = \"900 N mm/deg\""),
    ("linear_stiffness", "GF1-3.psi", "k = \"1490 N mm/deg\""),
    ("linear_stiffness", "GF4-7.psi", "k = \"1960 N mm/deg\""),
    ("viscous", "GF1-7.psi", "c = \"0.2 N mm s/deg\""),
    ("structural_damping", "GF1-7.psi", "h = \"100 N mm/deg\""),
    ("elastic_slip", "GF1-2.psi", "f = \"300 N mm\"\nd = \"0.01 rad\""),
    ("contact", "shelf.x", "k = \"5000 N/mm\"\ng = \"-0.1 mm\"\nside = -1\nn = 1"),
    ("linear_stiffness", "device.x", "k = \"400 N/mm\""),
    ("added_mass", "device.x", "m = \"105 g\""),
    ("support_compliance", "device.x", "s = \"1e-5 mm/N\""),
];

const TESTS: &str = "schema = 1\n[[test]]\nid = \"modal\"\nkind = \"modal\"\nconditions = { load = \"80 N\" }\n\
    rows = [{ mode = 1, frequency = \"300 Hz\", family = \"xy bending\" }]\n";

fn study(effects: &[(&str, &str, &str)], graph: &str, tests: &str) -> Study {
    let text: String = effects.iter().map(|(name, at, p)| format!("[[effect]]\neffect = \"{name}\"\nat = \"{at}\"\n{p}\n")).collect();
    let data = TomlFile::parse(Path::new("dataset.toml"), tests.into(), "data").unwrap();
    let toml = TomlFile::parse(Path::new("study.toml"), format!("{graph}{text}"), "study").unwrap();
    Study::from_toml(&toml, Dataset::from_toml(&data, None).unwrap()).unwrap_or_else(|e| panic!("{e}"))
}

fn exported(study: &Study, name: &str) -> (String, Vec<String>) {
    let set = CalibratedSet {
        schema: 1,
        study: "a \"study\"\nof tests".into(),
        study_hash: "fnv1a64:0".into(),
        termination: "converged".into(),
        cost: 0.0,
        parameters: vec![],
        fixed: vec![],
        covariance: vec![],
        unidentifiable: vec![],
        effects: vec![],
        tests: vec![],
    };
    let conditions: BTreeMap<String, f64> = study.dataset.tests[0].conditions.iter().map(|(k, c)| (k.clone(), c.value)).collect();
    let of =
        Source { set: &set, system: &study.system, test: &study.dataset.tests[0].id, conditions: &conditions, described: "load = 80 N" };
    let exporter = EXPORTERS.iter().find(|e| e.name() == name).unwrap();
    let mut out = exporter.files(&of).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(out.files.len(), 1);
    (String::from_utf8(out.files.remove(0).1).unwrap(), out.notes)
}

/// Commands of Adams View with their arguments.
fn commands(text: &str) -> Vec<(String, HashMap<String, String>)> {
    let mut logical: Vec<String> = vec![];
    let mut going_on = false;
    for line in text.lines().filter(|l| !l.trim_start().starts_with('!')) {
        let (line, more) = line.strip_suffix('&').map_or((line, false), |l| (l, true));
        if going_on {
            logical.last_mut().unwrap().push_str(line)
        } else {
            logical.push(line.to_string())
        }
        going_on = more;
    }
    assert!(!going_on, "the file ends within a command");
    let mut all = vec![];
    for text in logical.iter().filter(|l| !l.trim().is_empty()) {
        // key = value; a value ends before the next ` key =` outside of quotes.
        let mut words: Vec<String> = vec![String::new()];
        let mut quoted = false;
        for c in text.chars() {
            quoted ^= c == '"';
            if c.is_whitespace() && !quoted { words.push(String::new()) } else { words.last_mut().unwrap().push(c) }
        }
        assert!(!quoted, "{text}");
        words.retain(|w| !w.is_empty());
        let first = words.iter().position(|w| w == "=").map_or(words.len(), |k| k - 1);
        let (command, mut arguments) = (words[..first].join(" "), HashMap::new());
        let mut at = first;
        while at < words.len() {
            assert_eq!(words[at + 1], "=", "{text}");
            let end = (at + 2..words.len()).find(|k| words.get(k + 1).is_some_and(|w| w == "=")).unwrap_or(words.len());
            // Strings of a line each are one.
            arguments.insert(words[at].clone(), words[at + 2..end].join(" ").replace("\", \"", ""));
            at = end;
        }
        all.push((command, arguments));
    }
    all
}

/// Names that begin with the model's.
fn names(expression: &str) -> Vec<&str> {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    expression.split(|c: char| !part(c)).filter(|w| w.starts_with(".misfit.")).collect()
}

#[test]
fn the_adams_file_holds_every_part_marker_joint_and_force() {
    let study = study(&EFFECTS, SPACE, TESTS);
    let (text, notes) = exported(&study, "adams");
    let all = commands(&text);
    let of = |command: &'static str| all.iter().filter(move |c| c.0 == command).map(|c| &c.1);
    // Parts: eight, and the device's mass.
    let parts: HashSet<&str> = of("part create rigid_body name_and_position").map(|a| a["part_name"].as_str()).collect();
    assert_eq!(parts.len(), 8 + 1);
    assert_eq!(of("part create rigid_body mass_properties").count(), 9);
    let mass: f64 = of("part create rigid_body mass_properties").map(|a| a["mass"].parse::<f64>().unwrap()).sum();
    let length = 0.15 * 12f64.to_radians() + 0.06 * 35f64.to_radians();
    assert!((mass - 0.105 - 3200.0 * 0.02 * 0.009 * length).abs() < 1e-9, "{mass}");
    // Whatever is referred to exists.
    let markers: HashSet<&str> = of("marker create").map(|a| a["marker_name"].as_str()).collect();
    let variables: HashMap<&str, f64> =
        of("variable create").map(|a| (a["variable_name"].as_str(), a["real_value"].parse().unwrap())).collect();
    let states: HashSet<&str> =
        of("part create equation differential_equation").map(|a| a["differential_equation_name"].as_str()).collect();
    assert_eq!(of("marker create").count(), markers.len());
    for m in &markers {
        let (owner, _) = m.rsplit_once('.').unwrap();
        assert!(parts.contains(owner) || owner == ".misfit.ground", "{m}");
    }
    let mut functions = 0;
    for (command, arguments) in &all {
        for (key, value) in arguments {
            if key.ends_with("marker_name") || key == "center_of_mass_marker" {
                assert!(markers.contains(value.as_str()), "{command}: {value}");
            }
            if key.contains("function") {
                functions += 1;
                let depth = value.chars().try_fold(0i32, |d, c| {
                    let d = d + i32::from(c == '(') - i32::from(c == ')');
                    (d >= 0).then_some(d)
                });
                assert_eq!(depth, Some(0), "{value}");
                for name in names(value) {
                    assert!(markers.contains(name) || variables.contains_key(name) || states.contains(name), "{name} in {value}");
                }
            }
        }
    }
    let forces: HashMap<&str, &HashMap<String, String>> =
        of("force create direct general_force").map(|a| (a["general_force_name"].as_str(), a)).collect();
    assert_eq!(forces.len(), 7 + 2, "GF1 to GF7, shelf, device");
    assert!(functions >= 6 * 9);
    let gf1 = forces[".misfit.GF1"];
    assert_eq!(gf1["j_part_name"], ".misfit.b1");
    assert_eq!(gf1["i_marker_name"], ".misfit.b2.GF1_i");
    assert!(
        gf1["z_torque_function"].starts_with("\"-(") && gf1["z_torque_function"].contains("RTOD*AZ(.misfit.b2.GF1_i, .misfit.b1.GF1_j)")
    );
    assert!(gf1["x_force_function"].contains("DX(.misfit.b2.GF1_i, .misfit.b1.GF1_j, .misfit.b1.GF1_j)"));
    // Units: as the study has them.
    let value = |name: &str| variables.iter().find(|v| v.0.contains(name)).unwrap_or_else(|| panic!("{name} in {variables:?}")).1;
    for (name, expected) in [
        ("GF1_3_psi_linear_stiffness_k", 1490.0),
        ("GF1_7_psi_viscous_c", 0.2),
        ("device_x_linear_stiffness_k", 400.0),
        ("elastic_slip_f", 300.0),
        ("elastic_slip_d", 0.01f64.to_degrees()),
        ("contact_g", -0.1),
    ] {
        assert!((value(name) / expected - 1.0).abs() < 1e-12, "{name}: {} {expected}", value(name));
    }
    // Structural damping has twelve branches at seven places, two sliders one state each.
    assert_eq!(states.len(), 7 * 12 + 2);
    // The pin, the plane of part 8, the slide and the carrier of the device's mass, the load along its path.
    assert_eq!(of("constraint create joint revolute").count(), 1);
    assert_eq!(of("constraint create primitive_joint parallel_axis").count(), 1);
    assert_eq!(of("constraint create primitive_joint inplane").count(), 1 + 1);
    assert_eq!(of("constraint create joint translational").count(), 1);
    let loads: Vec<_> = of("force create direct single_component_force").collect();
    assert_eq!(loads.len(), 1);
    assert_eq!(loads[0]["function"], "\"STEP(TIME, 0, 0, 1, 138.3) + STEP(TIME, 1, 0, 2, -58.30000000000001)\"");
    // What is not there is named, in the file and beside it.
    assert!(notes.iter().any(|n| n.contains("support_compliance at device.x")), "{notes:?}");
    for n in &notes {
        assert!(text.contains(n.as_str()), "{n}");
    }
    assert!(!text.contains('@'));
    if let Some(long) = text.lines().find(|l| l.len() > 240 && !l.starts_with('!')) {
        panic!("a line of {} characters: {long}", long.len());
    }
}

#[test]
fn angles_turn_a_marker_as_its_axes_lie() {
    use crate::model::space::rotation::{UNIT, exponential, product};
    for turn in [[0.0, 0.0, 0.7], [0.3, -0.8, 0.5], [std::f64::consts::FRAC_PI_2, 0.0, 0.0], [0.0, 0.4, 0.0], [3.0, 0.0, 0.2]] {
        let less_unit = exponential(turn).0;
        let axes = std::array::from_fn(|i| std::array::from_fn(|j| less_unit[i][j] + UNIT[i][j]));
        let [psi, theta, phi] = adams::angles(&axes).map(f64::to_radians);
        let about = |k: usize, a: f64| -> [[f64; 3]; 3] {
            let mut t = [0.0; 3];
            t[k] = a;
            let m = exponential(t).0;
            std::array::from_fn(|i| std::array::from_fn(|j| m[i][j] + UNIT[i][j]))
        };
        let back = product(&product(&about(2, psi), &about(0, theta)), &about(2, phi));
        for i in 0..3 {
            for j in 0..3 {
                assert!((back[i][j] - axes[i][j]).abs() < 1e-9, "{turn:?}: {back:?} {axes:?}");
            }
        }
    }
}

/// Every law of the library is written or named, in both formats; what is written has no placeholder and closes its parentheses.
#[test]
fn every_law_is_written_or_named() {
    let graph = "schema = 1\ndataset = \"data\"\n[[body]]\nname = \"m\"\ncount = 2\nmass = \"1 kg\"\nfree = [\"x\"]\n\
        [[connector]]\nname = \"base\"\nfrom = \"ground\"\nto = \"m1\"\n[[connector]]\nname = \"c\"\nchain = \"m\"\n\
        [[load]]\nat = \"m2.x\"\nforce = \"10 N\"\n";
    let springs = [("linear_stiffness", "base.x", "k = \"20 N/mm\""), ("linear_stiffness", "c1.x", "k = \"30 N/mm\"")];
    let plain = study(&springs, graph, TESTS);
    for law in crate::effect::LIBRARY.iter().filter(|l| matches!(l, crate::effect::Effect::Force(_) | crate::effect::Effect::Series(_))) {
        let name = law.info().name;
        let mut with = plain.clone();
        let values: Vec<(&str, f64)> =
            law.info().params.iter().map(|p| (p.name, if p.default == 0.0 { 1e-3 } else { p.default })).collect();
        with.system.instances.push(plain.instance(name, "base.x", &values, None).unwrap());
        for format in ["adams", "exudyn"] {
            let (text, notes) = exported(&with, format);
            let named = notes.iter().any(|n| n.contains(&format!("{name} at base.x")));
            let not_written = ["backlash", "support_compliance", "wedge_friction", "node_deviation"].contains(&name)
                || (format == "exudyn" && ["bouc_wen", "pinched_bouc_wen", "lugre", "absorber"].contains(&name));
            assert_eq!(named, not_written, "{format} {name}: {notes:?}");
            if format == "adams" {
                assert!(
                    named
                        || text.contains(&format!("base_x_{name}_"))
                        || ["added_mass", "mass_deviation", "inertia_deviation"].contains(&name),
                    "{name}"
                );
                commands(&text);
            }
        }
    }
    let (text, notes) = exported(&plain, "exudyn");
    assert!(notes.is_empty(), "{notes:?}");
    for piece in [
        "(\"m1.x\", 1.0)",
        "(\"base.x\", None, \"m1.x\", 20000.0, 0.0, [])",
        "(\"c1.x\", \"m1.x\", \"m2.x\", 30000.0, 0.0, [])",
        "(\"m2.x\", [10.0])",
    ] {
        assert!(text.contains(piece), "{piece}\n{text}");
    }
    // 10 N on 20 N/mm and 30 N/mm in series.
    assert!(text.contains("\"m2.x\": 0.000833333333333"), "{text}");
}

#[test]
fn the_exudyn_script_holds_every_part_and_connector() {
    let study = study(&EFFECTS[..12], SPACE, TESTS);
    let (text, notes) = exported(&study, "exudyn");
    assert!(notes.is_empty(), "{notes:?}");
    for name in study.system.model.bodies.iter().map(|b| &b.name).chain(study.system.model.connectors.iter().map(|c| &c.name)) {
        assert!(text.contains(&format!("    (\"{name}\", ")), "{name}");
    }
    assert!(text.contains("(\"slider\", 30.0, 0.3)") && text.contains("(\"branch\", "), "{text}");
    assert!(text.contains("lambda x, v: (-5000000.0*MAX((-x)-(-0.0001), 0))"), "{text}");
    let axis = &study.system.model.space.as_ref().unwrap().frames[0].axes;
    assert!(text.contains(&format!("[{:?}, {:?}, 0.0]", axis[0][0], axis[0][1])));
}
