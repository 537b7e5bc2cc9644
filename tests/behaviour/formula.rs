//! The effect `formula` on the command line, and what `effects NAME` shows.

use crate::rig::{Rig, misfit};

fn formula(rig: Rig, expression: &str, more: &str) -> Rig {
    let study = rig.read("study.toml");
    rig.write("study.toml", &format!("{study}\n[[effect]]\neffect = \"formula\"\nat = \"c1.x\"\nexpression = \"{expression}\"\n{more}"));
    rig
}

const F: &str = "f = { start = \"1 N\", min = \"0 N\", max = \"20 N\" }\n";

#[test]
fn a_formula_finds_the_strength_of_what_is_hidden() {
    let rig = formula(Rig::hiding(|_, v| 1.5 * v.tanh()), "f*tanh(v/v0)", &format!("{F}v0 = {{ start = \"1 mm/s\", fixed = true }}\n"));
    let fit = rig.json("fit", &[]);
    let f = fit["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "c1.x.formula.f").unwrap()["value"].as_f64().unwrap();
    assert!((f - 1.5).abs() < 0.03, "{f}");
    assert_eq!(rig.json("check", &[])["ok"], true);
}

#[test]
fn formulas_that_cannot_be_are_refused_before_the_fit() {
    for (expression, message) in [
        ("-f*tanh(v/0.001)", "gives energy back"),
        ("f*0.001/x", "division by zero"),
        ("f*log(x/0.001)", "logarithm"),
        ("f*x + * v", "character 7"),
    ] {
        let rig = formula(Rig::new(), expression, F);
        let [_, place, told, accepted] = rig.run("fit", &["--json"]).error();
        assert!(told.contains(message) && told.contains(expression) && !accepted.is_empty() && !place.is_empty(), "{told}");
        let check = rig.run("check", &["--json"]);
        assert_eq!((check.code, check.json()["ok"].as_bool()), (1, Some(false)));
        assert!(check.json()["problems"][0]["message"].as_str().unwrap().contains(message));
    }
}

#[test]
fn every_effect_shows_its_loop_and_its_response() {
    let all = misfit(&["effects", "--json"]).json();
    let names: Vec<&str> = all["effects"].as_array().unwrap().iter().map(|e| e["effect"].as_str().unwrap()).collect();
    assert_eq!(names.len(), 51);
    for name in names {
        let text = misfit(&["effects", name]);
        assert_eq!(text.code, 0, "{name}: {}", text.stderr);
        assert!(text.stdout.contains("source:"));
        let json = &misfit(&["effects", name, "--json"]).json()["effects"][0];
        if json["role"] == "geometry" {
            assert!(text.stdout.contains(&format!("effect = \"{name}\"")) && !text.stdout.contains("F is the force"), "{}", text.stdout);
            continue;
        }
        if name == "formula" {
            assert!(text.stdout.contains("expression ="));
            continue;
        }
        assert!(text.stdout.contains("Loop at 1 rad/s") && text.stdout.contains("phase [deg]"), "{name}: {}", text.stdout);
        let numbers = |v: &serde_json::Value| v.as_array().unwrap().iter().filter(|x| x.is_number() || x.is_array()).count();
        assert_eq!(numbers(&json["loop"]["x"]), numbers(&json["loop"]["with"]), "{name}");
        assert_eq!(numbers(&json["frf"]["omega"]), numbers(&json["frf"]["with"]), "{name}");
    }
}
