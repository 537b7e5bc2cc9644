//! The studies end in numbers: truth recovered, nothing claimed where nothing is missing, intervals that cover.

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use misfit::diagnose::results::Verdict;
use misfit::diagnose::{Case, diagnose, fit};
use misfit::identify::Monitor;
use misfit::study::Study;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use statrs::distribution::{ContinuousCDF, Normal};

fn study(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(name)
}

fn json(verb: &str, study: &Path) -> Value {
    json_into(verb, study, &tempfile::tempdir().unwrap().path().join("run"))
}

/// The same, with the folder of the run left to be looked into.
fn json_into(verb: &str, study: &Path, out: &Path) -> Value {
    let run = Command::new(env!("CARGO_BIN_EXE_misfit")).args([verb, "--json", "--out"]).arg(out).arg(study).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

fn parameter<'a>(list: &'a Value, name: &str) -> &'a Value {
    list.as_array().unwrap().iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name} in {list}"))
}

#[test]
fn the_hidden_friction_of_study_01_is_found_with_its_strength() {
    let out = tempfile::tempdir().unwrap();
    let ladder = json_into("ladder", &study("01-hidden-effect"), &out.path().join("run"));
    assert_eq!(ladder["verdict"], "missing");
    assert_eq!(ladder["missing"][0]["effect"], "elastic_slip");
    assert_eq!(ladder["missing"][0]["at"], "c5.x");
    assert_eq!(ladder["missing"].as_array().unwrap().len(), 1);
    // truth.toml: F_c = 26 N at c5.
    let rungs = ladder["rungs"].as_array().unwrap();
    let f = parameter(&rungs[rungs.len() - 1]["parameters"], "c5.x.elastic_slip.f");
    let (low, high) = (f["interval"][0].as_f64().unwrap(), f["interval"][1].as_f64().unwrap());
    assert!(low <= 26.0 && 26.0 <= high, "{f}");
    let held = &ladder["held_out"];
    let ratio = held["after"].as_f64().unwrap() / held["floor"].as_f64().unwrap();
    assert!(ratio <= 1.2, "held-out error over floor {ratio}");
    assert!(held["before"].as_f64().unwrap() > 10.0 * held["after"].as_f64().unwrap());
    // What the study leaves without a bound has none in the study that is written; while it climbs, the search keeps some of its own.
    let bounds = |folder: &Path| -> Vec<(f64, f64)> {
        let own = Study::load(folder, None).unwrap().system.instances;
        own.iter().take(4).flat_map(|i| i.params.iter().map(|p| (p.min, p.max))).collect()
    };
    assert_eq!(bounds(&out.path().join("run")), bounds(&study("01-hidden-effect")));
}

#[test]
fn the_cyclic_table_of_study_02_wants_a_damping_that_grows_by_less_than_the_speed() {
    let ladder = json("ladder", &study("02-cyclic-table/study.toml"));
    let missing = ladder["missing"].as_array().unwrap();
    // Energies at four frequencies tell that the damping grows by less than the speed, not which of the laws of it.
    let shear_thinning = |m: &serde_json::Value| ["film", "digressive_damping", "smooth_coulomb"].iter().any(|law| m["effect"] == *law);
    assert!(missing.iter().any(|m| shear_thinning(m) && m["at"] == "c1.x"), "{missing:?}");
    let last = ladder["rungs"].as_array().unwrap().last().unwrap();
    // Two parameters are the study's own, at most three are added: a power law whose exponent runs to its bound gives way to a simpler one.
    assert!(last["parameters"].as_array().unwrap().len() <= 5, "{last}");
    let factors = last["tests"][0]["factors"].as_array().unwrap();
    for (channel, allowed) in [("W_D", 1.04), ("W_s", 1.008)] {
        let f = factors.iter().find(|f| f["channel"].as_str().unwrap().starts_with(channel)).unwrap();
        assert!(f["largest"].as_f64().unwrap() < allowed, "{f}");
    }
}

/// Viscous alone under force control: W_D = pi c w F^2 / (k^2 + w^2 c^2) with k = dF^2 / (2 W_s), from Table 3 of the paper; the best
/// factor by trying c. Where the loss is weak, W_D / f is one number and Table 3 has four: the root of the largest over the least.
#[test]
fn the_best_factor_of_a_viscous_law_on_table_3_is_said() {
    let rows = [(0.01, 1.04e-3), (0.33, 16.43e-3), (1.0, 38.77e-3), (5.0, 73.77e-3)];
    let range: f64 = 138.3 - 21.6;
    let k = range * range / (2.0 * 248.745e-3);
    let largest = |c: f64| {
        let wd = |f: f64| {
            let w = std::f64::consts::TAU * f;
            std::f64::consts::PI * c * w * (0.5 * range).powi(2) / (k * k + (w * c).powi(2))
        };
        rows.iter().map(|(f, measured)| (wd(*f) / measured).ln().abs()).fold(0.0, f64::max)
    };
    let best = (0..20_000).map(|j| largest(100.0 * (1.0 + 1e-3 * j as f64))).fold(f64::INFINITY, f64::min).exp();
    let (low, high) = rows.iter().map(|(f, w)| w / f).fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
    let weak = (high / low).sqrt();
    assert!((best - 2.30).abs() < 0.01 && (weak - 2.65).abs() < 0.01, "{best} {weak}");
    for verb in ["fit", "compare"] {
        let factors = &json(verb, &study("02-cyclic-table/study.toml"))["tests"][0]["factors"];
        assert!(factors[0]["channel"].as_str().unwrap().starts_with("W_D"));
        let one = &factors[0]["strength"];
        assert_eq!(one["parameter"], "c1.x.viscous.c");
        // `compare` stands at k = 25 N/mm of study.toml, which moves the best factor a little.
        let tolerance = if verb == "fit" { 2e-3 } else { 0.1 };
        assert!((one["best"].as_f64().unwrap() / best - 1.0).abs() < tolerance, "{verb}: {one} {best}");
        assert!((one["weak"].as_f64().unwrap() / weak - 1.0).abs() < 2e-3, "{verb}: {one} {weak}");
        assert!(factors[0]["largest"].as_f64().unwrap() >= one["best"].as_f64().unwrap());
        assert!(factors[1]["strength"].is_null());
    }
}

#[test]
fn the_exponents_of_study_04_are_identified_within_five_percent() {
    let result = json("fit", &study("04-interference"));
    for (of, truth) in [("linear_stiffness.k", 276.0), ("viscous.c", 561.0)] {
        let a = parameter(&result["parameters"], &format!("c1.x.interference_law({of}).a"))["value"].as_f64().unwrap();
        assert!((a / truth - 1.0).abs() < 0.05, "{of}: {a} 1/m against {truth}");
    }
}

#[test]
fn values_per_interference_lie_on_the_law_nobody_assumed() {
    let result = json("fit", &study("04-interference/per-level.toml"));
    for (of, at_i0, exponent) in [("linear_stiffness", 40e3, 276.0), ("viscous", 190.0, 561.0)] {
        for (i, level) in [0.1, 0.3, 0.5, 0.6].into_iter().enumerate() {
            let name = format!("c1.x.{of}[i={level} mm].{}", if of == "viscous" { "c" } else { "k" });
            let value = parameter(&result["parameters"], &name)["value"].as_f64().unwrap();
            let truth = at_i0 * f64::exp(exponent * 1e-3 * (level - 0.3));
            assert!((value / truth - 1.0).abs() < 0.02, "{i} {name}: {value} against {truth}");
        }
    }
}

/// Study 04 with its measurements replaced by the model's own response and fresh noise.
struct Rig {
    case: Case,
    clean: Vec<Vec<f64>>,
}

impl Rig {
    fn new() -> Rig {
        let study = Study::load(&study("04-interference"), None).unwrap();
        let case = Case::from_study(&study, 1).unwrap();
        let (case, fitted, _) = fit(&case, &[], &Monitor::default()).unwrap();
        let clean = case.plans.iter().map(|(p, _)| p.evaluate(&fitted.system, &[], false).unwrap().values).collect();
        Rig { case: Case { system: fitted.system, ..case }, clean }
    }

    fn draw(&self, seed: u64) -> Case {
        let normal = Normal::new(0.0, 1.0).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut plans = (*self.case.plans).clone();
        for ((plan, _), clean) in plans.iter_mut().zip(&self.clean) {
            for (k, m) in plan.measured.iter_mut().enumerate() {
                *m = clean[k] + plan.sigma[k] * normal.inverse_cdf(rng.random_range(1e-12..1.0 - 1e-12));
            }
        }
        Case { plans: Arc::new(plans), seed, ..self.case.clone() }
    }
}

#[test]
fn intervals_cover_the_truth_in_200_draws_of_noise() {
    let rig = Rig::new();
    let free = rig.case.system.free();
    let truth: Vec<f64> = free.iter().map(|f| rig.case.system.instances[f.instance].params[f.param].value).collect();
    let (mut inside, mut all) = (0, 0);
    for seed in 0..200 {
        let (_, _, result) = fit(&rig.draw(seed), &[], &Monitor::default()).unwrap();
        for (p, t) in result.parameters.iter().zip(&truth) {
            let (low, high) = (p.interval.0.unwrap(), p.interval.1.unwrap());
            inside += usize::from(low <= *t && *t <= high);
            all += 1;
        }
    }
    let coverage = inside as f64 / all as f64;
    println!("coverage of the 95 % intervals: {:.1} % of {all}", 100.0 * coverage);
    assert!((0.88..=0.99).contains(&coverage), "{coverage}");
}

#[test]
fn nothing_is_claimed_where_nothing_is_missing() {
    let rig = Rig::new();
    let alarms: Vec<u64> = (1000..1020)
        .filter(|seed| {
            let (_, d) = diagnose(&rig.draw(*seed), &Monitor::default(), &|_| {}).unwrap();
            d.verdict != Verdict::NothingMissing
        })
        .collect();
    println!("false alarms: {} of 20", alarms.len());
    assert!(alarms.len() <= 1, "{alarms:?}");
}
