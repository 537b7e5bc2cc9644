//! The programs of `examples/` do what they say.

use misfit::prelude::*;

#[allow(dead_code)]
#[path = "../../examples/fit.rs"]
mod fitting;
#[allow(dead_code)]
#[path = "../../examples/ladder.rs"]
mod climbing;
#[allow(dead_code)]
#[path = "../../examples/own_effect.rs"]
mod own_effect;
#[allow(dead_code)]
#[path = "../../examples/own_model.rs"]
mod own_model;
#[allow(dead_code)]
#[path = "../../examples/predict.rs"]
mod predicting;

#[test]
fn fit() {
    let text = fitting::run("studies/04-interference").unwrap();
    assert!(text.starts_with("Exponential laws in the interference: converged"), "{text}");
    assert!(text.contains("c1.x.linear_stiffness.k = ") && text.contains("loop-i0.5-3Hz (HeldOut): error"), "{text}");
}

/// The study that the program climbs where none is named, with fewer points and laws; the behaviour test of the verb climbs it whole.
#[cfg(unix)]
#[test]
fn ladder() {
    let steps = std::sync::Mutex::new(0);
    let bench = super::resumed::Bench::new();
    let (found, text) = climbing::run(bench.study().to_str().unwrap(), &|_| *steps.lock().unwrap() += 1).unwrap();
    assert!(found.verdict == Verdict::Missing && found.proven, "{text}");
    assert!(text.contains("missing: bouc_wen at c1.x, proven") && *steps.lock().unwrap() > 3, "{text}");
    let written = text.lines().last().and_then(|l| l.strip_prefix("written to ")).unwrap();
    let study = Study::load(written.as_ref(), None).unwrap();
    assert!(study.system.instances.iter().any(|i| i.name() == "bouc_wen"));
    std::fs::remove_dir_all(&study.folder).unwrap();
}

/// Of a damper c under x = X sin wt the energy of a cycle is pi c w X^2.
#[test]
fn predict() {
    let rig = super::rig::Rig::new();
    let asked = "[[prediction]]\ncase = \"wide\"\nquantity = \"W_D\"\nat = \"c1.x\"\ncontrol = \"displacement\"\ndisplacement_min = \"-2 mm\"\n\
                 displacement_max = \"2 mm\"\nconditions = { frequency = \"3 Hz\" }\nreference = \"1 J\"\n";
    rig.write("study.toml", &(rig.read("study.toml") + asked));
    let text = predicting::run(rig.folder().to_str().unwrap()).unwrap();
    let study = Study::load(rig.folder(), None).unwrap();
    let (_, fitted, _) = misfit::diagnose::fit(&Case::from_study(&study, 1).unwrap(), &[SplitName::Fit], &Monitor::default()).unwrap();
    let c = fitted.system.instances.iter().find(|i| i.name() == "viscous").unwrap().params[0].value;
    let value: f64 = text.split(" = ").nth(1).and_then(|t| t.split(' ').next()).unwrap().parse().unwrap();
    let exact = std::f64::consts::PI * c * std::f64::consts::TAU * 3.0 * 4e-6;
    assert!((value / exact - 1.0).abs() < 2e-3 && text.contains("+- ") && text.contains("reference 1 J"), "{text} {exact}");
}

/// In a process of its own: a law that is registered stays, and the ladder of another test would look for it too.
#[test]
fn own_effect() {
    let words = ["--exact", "examples::own_effect_by_itself", "--ignored"];
    let run = std::process::Command::new(std::env::current_exe().unwrap()).args(words).output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success() && said.contains("1 passed"), "{said} {}", String::from_utf8_lossy(&run.stderr));
}

#[test]
#[ignore = "it registers a law for the whole process: own_effect runs it"]
fn own_effect_by_itself() {
    let (before, after) = own_effect::run("studies/08-two-effects").unwrap();
    assert!(after < 0.5 * before, "{before} {after}");
    assert!(find("dahl").is_ok());
}

#[test]
fn own_model() {
    let result = own_model::run().unwrap();
    assert_eq!(result.termination, "converged");
    for (name, value) in own_model::TRUTH {
        let p = result.parameters.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("{name}"));
        assert!((p.value / value - 1.0).abs() < 5e-3, "{name}: {} for {value}", p.value);
    }
}

/// What is wrong with a model of a program is said before anything is computed.
#[test]
fn a_model_that_cannot_be() {
    let body = || vec![Body::fixed("ground"), Body::new("m", 1.0, &[Axis::X])];
    let e = Model::joined(body(), &[("c", "ground", "n")]).unwrap_err();
    assert!(e.to_string().contains("no body `n`") && e.accepted().contains("ground, m"), "{e}");
    let system = || System::new(Model::joined(body(), &[("c", "ground", "m")]).unwrap());
    let e = system().and("linear_stifness", "c.x", &[]).unwrap_err();
    assert!(e.to_string().contains("linear_stiffness"), "{e}");
    let e = system().and("linear_stiffness", "c.x", &[("c", 1.0)]).unwrap_err();
    assert!(e.to_string().contains("no parameter `c`"), "{e}");
    let e = system().and("backlash", "c.x", &[("g", 1e-3)]).unwrap_err();
    assert!(e.to_string().contains("in series with nothing"), "{e}");
    let e = system().and("gain", "c.x", &[]).unwrap_err();
    assert!(e.accepted().contains("study.toml"), "{e}");
    let e = Case::of("free", system(), &[], 1).err().unwrap();
    assert!(e.to_string().contains("no force holds `m.x`"), "{e}");
    let slip = system().and("elastic_slip", "c.x", &[("f", 1.0)]).unwrap();
    let e = Case::of("no shape", slip, &[], 1).err().unwrap();
    assert!(e.to_string().contains("elastic_slip.d"), "{e}");
}
