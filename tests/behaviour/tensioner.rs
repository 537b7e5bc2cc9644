//! The tensioner's studies: what the tables say by themselves, and that the studies are read as declared. Numbers by oddities.py of the
//! dataset and by hand.

use std::path::Path;

use misfit::diagnose::results::{Against, SplitName};
use misfit::diagnose::{Case, compare};
use misfit::study::Study;
use misfit::tolerance::{Constant, Link, Verdict, search};

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
    let study = study("05-tensioner-tables/reconciled");
    let spec = study.tolerance.as_ref().unwrap();
    let constant = Constant::of(&spec.tables[0].cases, &spec.pairs).unwrap();
    let off = |name: &str| constant.largest.iter().find(|l| l.0 == name).unwrap().1 * 1e3;
    assert!((constant.value * 1e9 - 2.7596).abs() < 1e-3, "{}", constant.value);
    assert!(off("i_max") < 0.010 && off("i_min") < 0.015, "{:?}", constant.largest);
    assert!(!constant.holds());
}

/// Left out with the search inside the folds, without a model: what the law through the model is held against.
#[test]
fn a_law_of_the_energies_predicts_the_case_left_out() {
    let study = study("05-tensioner-tables/reconciled");
    let spec = study.tolerance.as_ref().unwrap();
    let (cases, link) = (&spec.tables[0].cases, Link::identity());
    let logs: Vec<f64> = cases.energies().iter().map(|w| w.ln()).collect();
    let none = search::without_law(&logs).iter().map(|e| e.exp_m1().powi(2)).sum::<f64>();
    assert!((f64::sqrt(none / 9.0) - 0.382).abs() < 1e-3);
    let problem = search::Problem { cases, logs, link: &link, permutations: 99, seed: 1 };
    let searcher = search::Searcher::new(&problem, &spec.libraries).unwrap();
    let two = searcher.search(&[0]).unwrap();
    println!("two terms: {:.3}, p {:.3}, {}", two.relative, two.p_value, two.words);
    // 16.6 % by an independent program (numpy).
    assert!((two.relative - 0.166).abs() < 2e-3 && two.p_value < 0.05, "{two:?}");
    // Nine numbers tell that there is a law, and not which.
    assert_eq!(two.verdict, Verdict::SomeLaw);
}

/// The last rung of study 05 on the paper's tables: the law acts on the strengths that carry the loss of the calibrated model. (The rungs before it answer nothing that
/// is asked here; that rungs are climbed and told is a matter of study 11 below.)
#[test]
fn the_calibrated_model_predicts_the_ratios_left_out() {
    let result = predict("05-tensioner-tables/shifts");
    let laws = &result["tolerance"]["laws"];
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    assert!(number(&laws["left_out_rms"]) < 0.08, "{laws}");
    assert!(number(&laws["no_law_rms"]) > 0.35 && number(&laws["own_laws_rms"]) > 0.3 && number(&laws["p_value"]) < 0.05, "{laws}");
    let ratios: Vec<&serde_json::Value> =
        result["predictions"].as_array().unwrap().iter().filter(|p| p["quantity"] == "W_D_ratio").collect();
    assert_eq!(ratios.len(), 9);
    let inside = ratios.iter().filter(|p| {
        let r = number(&p["reference"]);
        number(&p["interval"][0]) <= r && r <= number(&p["interval"][1])
    });
    assert!(inside.count() >= 7);
    // `left_out` is the ratio predicted without the case.
    let rms = ratios.iter().map(|p| (number(&p["left_out"]) / number(&p["reference"]) - 1.0).powi(2)).sum::<f64>() / 9.0;
    assert!((rms.sqrt() - number(&laws["left_out_rms"])).abs() < 1e-6);
    // Tables 2 and 3 with the laws in.
    let tests = result["fit"]["tests"].as_array().unwrap();
    let of = |id: &str| number(&tests.iter().find(|t| t["id"] == id).unwrap()["error"]);
    assert!(of("table-3") < 0.02 && of("modal-mean") < 0.03);
    // The shifts of frequency with the load over no shift: modes 1 to 3, all four, and the maximum load, which was not fitted; the free configuration.
    let shifts = result["shifts"].as_array().unwrap();
    let over_none = |wanted: &dyn Fn(&str, u64) -> bool| {
        let picked = shifts.iter().filter(|s| wanted(s["test"].as_str().unwrap(), s["mode"].as_u64().unwrap()));
        let (off, sum) = picked.fold((0.0, 0.0), |(off, sum), s| {
            let (c, m) = (number(&s["computed"]), number(&s["measured"]));
            (off + (c - m).powi(2), sum + m * m)
        });
        f64::sqrt(off / sum)
    };
    let (bending, all) = (over_none(&|_, mode| mode < 4), over_none(&|_, _| true));
    let foretold = over_none(&|test, mode| test == "modal-maximum" && mode < 4);
    println!("shifts over no shift: modes 1 to 3 {bending:.3}, all {all:.3}, modes 1 to 3 at maximum load {foretold:.3}");
    assert!(bending < 0.25 && all < 0.35 && foretold < 0.3, "{bending} {all} {foretold}");
    assert!(of("modal-free") < 0.01, "{}", of("modal-free"));
    let claims: Vec<&str> = result["tolerance"]["findings"].as_array().unwrap().iter().filter_map(|f| f["claim"].as_str()).collect();
    assert!(claims.iter().any(|c| c.contains("case 9") && c.contains("exceeds any loop")), "{claims:?}");
}

/// The whole way where the truth is known: nothing is fitted to the energies of the cases.
#[test]
fn the_energies_of_the_tolerance_cases_follow_from_frfs_and_loops() {
    let result = predict("11-tolerance-cases");
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    let rungs = result["tolerance"]["rungs"].as_array().unwrap();
    assert_eq!(rungs.len(), 2);
    let rms = |rung: usize, cycle: usize, quantity: &str| {
        let all = rungs[rung]["cycles"][cycle]["predictions"].as_array().unwrap();
        let errors: Vec<f64> = all.iter().filter(|p| p["quantity"] == quantity).map(|p| number(&p["relative_error"])).collect();
        assert_eq!(errors.len(), 9);
        (errors.iter().map(|e| e * e).sum::<f64>() / 9.0).sqrt()
    };
    for (cycle, most) in [(0, 0.05), (1, 0.08)] {
        let (before, after) = (rms(0, cycle, "W_D_ratio"), rms(1, cycle, "W_D_ratio"));
        println!(
            "cycle {cycle}: ratios {before:.3} -> {after:.3}, W_D {:.3} -> {:.3}, W_s {:.3}",
            rms(0, cycle, "W_D"),
            rms(1, cycle, "W_D"),
            rms(1, cycle, "W_s")
        );
        assert!(after < most && after < 0.3 * before, "{before} {after}");
        assert!(rms(1, cycle, "W_D") < 0.08 && rms(1, cycle, "W_s") < 0.08);
    }
    let energies = result["predictions"].as_array().unwrap().iter().filter(|p| p["quantity"] == "W_D" || p["quantity"] == "W_s");
    let (mut inside, mut widest) = (0, 0.0f64);
    for p in energies {
        let (low, high, r) = (number(&p["interval"][0]), number(&p["interval"][1]), number(&p["reference"]));
        inside += usize::from(low <= r && r <= high);
        widest = widest.max((high - low) / r);
    }
    println!("{inside} of 36 inside, widest {widest:.3}");
    assert!(inside >= 31 && widest < 0.15, "{inside} {widest}");
    // Exponents per metre of interference, put in: 320, 660 (datasets/tolerance-cases/truth.json).
    let parameters = result["fit"]["parameters"].as_array().unwrap();
    let value = |part: &str| number(&parameters.iter().find(|p| p["name"].as_str().unwrap().contains(part)).unwrap()["value"]);
    for (part, put_in) in [("interference_law(linear_stiffness.k)", 320.0), ("interference_law(structural_damping.h)", 660.0)] {
        assert!((value(part) / put_in - 1.0).abs() < 0.05, "{part}: {}", value(part));
    }
}

/// `misfit predict --json` on a study.
fn predict(name: &str) -> serde_json::Value {
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join("studies").join(name);
    let out = tempfile::tempdir().unwrap();
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_misfit"))
        .args(["predict", "--json", "--out"])
        .arg(out.path().join("run"))
        .arg(&study)
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

/// Tables 2 and 3 together, at the values of the study: 10 % of W_D, 1 % of W_s, 10 % of the damping of five modes asked; and a mode that was
/// left out as out of family comes out in it.
#[test]
fn a_film_at_the_shelf_and_a_loss_in_the_blade_reconcile_both_tables() {
    let study = study("05-tensioner-tables/reconciled");
    let base = self::study("05-tensioner-tables");
    // The device's damper is in both; five parameters more.
    assert_eq!(study.system.free().len(), base.system.free().len() + 5);
    let case = Case::from_study(&study, 1).unwrap();
    let mut worst = std::collections::BTreeMap::new();
    for (plan, _) in case.plans.iter().filter(|(p, _)| p.id == "table-3" || p.id == "modal-mean") {
        let plan = plan.refined(&study.system).unwrap_or_else(|| plan.clone());
        let computed = plan.evaluate(&study.system, &[], false).unwrap().values;
        for block in &plan.blocks {
            for row in block.range.clone().filter(|row| !plan.left_out.contains(row)) {
                let off = (computed[row] - plan.measured[row]).exp_m1().abs();
                let slot = worst.entry(block.role.clone()).or_insert(0.0f64);
                *slot = slot.max(off);
            }
            if let Some(row) = block.range.clone().find(|row| plan.left_out.contains(row)) {
                let frequency = computed[row].exp();
                assert!((1950.0..2050.0).contains(&frequency), "mode 5: {frequency} Hz");
            }
        }
    }
    println!("{worst:?}");
    assert!(worst["dissipated"] < 0.05 && worst["stored"] < 0.008 && worst["modal_damping"] < 0.05, "{worst:?}");
    assert!(worst["natural_frequency"] < 0.02, "{worst:?}");
    // The damping at the other loads, which was not fitted, against one constant ratio; its figures from Table 2 by hand.
    let held = compare(&case, &study.system, &[SplitName::HeldOut], &Default::default()).unwrap();
    let (mut model, mut constant) = (0.0, 0.0);
    for (id, by_hand) in [("modal-preload", 0.0891), ("modal-maximum", 0.0616)] {
        let c = held.iter().find(|t| t.id == id).unwrap().constant_damping.as_ref().unwrap();
        println!("{id}, {}", c.words());
        assert!(c.modes == 5 && (c.ratio - 0.05594).abs() < 1e-6 && (c.constant - by_hand).abs() < 1e-3, "{c:?}");
        assert_eq!(c.verdict, Against::Tied);
        (model, constant) = (model + 0.5 * c.model.powi(2), constant + 0.5 * c.constant.powi(2));
    }
    println!("together {:.4}, constant {:.4}", f64::sqrt(model), f64::sqrt(constant));
    assert!(f64::sqrt(model) < 0.082 && (f64::sqrt(constant) - 0.0765).abs() < 1e-3);
    // The free configuration is not met, and that is said.
    let free = held.iter().find(|t| t.id == "modal-free").unwrap().constant_damping.as_ref().unwrap();
    assert!(free.model > free.constant && free.verdict != Against::Better, "{free:?}");
}

/// What the ladder found of the virtual tensioner, at the values it wrote: the paper's metric of its loops (3.4 % there), those of an
/// interference that was held out as well.
#[test]
fn the_friction_that_the_ladder_found_brings_the_loops_to_the_hundredth() {
    let study = study("06-virtual-tensioner/found");
    let added: Vec<&str> = study.system.instances.iter().map(|i| i.name()).filter(|n| *n == "elastic_slip").collect();
    assert_eq!(added.len(), 1);
    let case = Case::from_study(&study, 1).unwrap();
    let mut worst = 0.0f64;
    for (plan, _) in case.plans.iter().filter(|(p, _)| p.id.starts_with("loop")) {
        let plan = plan.refined(&study.system).unwrap_or_else(|| plan.clone());
        let computed = plan.evaluate(&study.system, &[], false).unwrap().values;
        for block in &plan.blocks {
            let measured = &plan.measured[block.range.clone()];
            let range = measured.iter().copied().fold(f64::MIN, f64::max) - measured.iter().copied().fold(f64::MAX, f64::min);
            let off = measured.iter().zip(&computed[block.range.clone()]).map(|(m, c)| (m - c).abs()).fold(0.0, f64::max);
            worst = worst.max(off / range);
        }
    }
    println!("largest difference over range: {worst:.4}");
    assert!(worst < 0.013, "{worst}");
    // Per metre of interference, put in (datasets/virtual-tensioner/truth.json): the exponents 320, 660, 660, and a friction of 14 N at 0.3 mm that grows by 28 N per
    // millimetre.
    let laws = |name: &'static str| study.system.instances.iter().filter(move |i| i.name() == name).map(|i| i.params[0].value);
    let put_in = [(320.0, 0.01), (660.0, 0.07), (660.0, 0.07), (2000.0, 0.03)];
    let found: Vec<f64> = laws("interference_law").chain(laws("linear_law")).collect();
    assert_eq!(found.len(), put_in.len());
    for (found, (put_in, within)) in found.into_iter().zip(put_in) {
        assert!((found / put_in - 1.0f64).abs() < within, "{found}, put in {put_in}");
    }
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
