//! A page from results made up for the purpose, with hostile names, held against what it must show and must not load.

use std::f64::consts::TAU;
use std::path::Path;

use crate::diagnose::results::*;
use crate::diagnose::{Missed, Reason, Settings, Unexplained};
use crate::response::BlockKind;
use crate::study::Study;

use super::page::PLOTLY;
use super::{ReportError, ReportInput, html, write};

mod undecided;

const HOSTILE: &str = "loop <script>alert(1)</script> & \"x\"";

const STUDY: &str = r#"schema = 1
title = "Rod & clamp <b>"
dataset = "data"
assumptions = ["The clamp is rigid <i>"]
split = { select = ["loop-2Hz"], held_out = ["loop-5Hz"] }
[[body]]
name = "ground"
fixed = true
[[body]]
name = "end"
free = ["x"]
[[connector]]
name = "c1"
from = "ground"
to = "end"
[[effect]]
effect = "linear_stiffness"
at = "c1.x"
k = { start = "20 N/mm", min = "0 N/mm" }
"#;

fn study(folder: &Path) -> Study {
    let data = folder.join("data");
    std::fs::create_dir_all(&data).unwrap();
    let mut toml =
        "schema = 1\ntitle = \"Rod on the rig\"\nsource = \"bench 4\"\nlicence = \"CC-BY-4.0\"\nassumptions = [\"Room temperature\"]\n"
            .to_string();
    for hz in [1.0, 2.0, 5.0] {
        toml += &format!(
            "[[test]]\nid = \"loop-{hz}Hz\"\nkind = \"cycle\"\nfile = \"loop-{hz}.csv\"\ncontrol = \"displacement\"\nconditions = {{ frequency = \"{hz} Hz\" }}\n\
             channels = [\n {{ role=\"time\", column=\"t\", unit=\"s\" }},\n {{ role=\"displacement\", at=\"c1.x\", column=\"x\", unit=\"mm\" }},\n \
             {{ role=\"force\", at=\"c1.x\", column=\"F\", unit=\"N\", sigma=\"0.1 N\" }}]\n"
        );
        let row = |i: usize| {
            let p = TAU * i as f64 / 100.0;
            format!("{:.6},{:.8},{:.8}\n", i as f64 * 0.01 / hz, 0.4 * p.sin(), 8.0 * p.sin())
        };
        std::fs::write(data.join(format!("loop-{hz}.csv")), "t,x,F\n".to_string() + &(0..400).map(row).collect::<String>()).unwrap();
    }
    std::fs::write(data.join("dataset.toml"), toml).unwrap();
    std::fs::write(folder.join("study.toml"), STUDY).unwrap();
    Study::load(folder, None).unwrap()
}

/// Noise without a generator: the fractional part of a steep sine.
fn noise(i: usize, seed: f64) -> f64 {
    let part = |a: f64, b: f64, c: f64| ((i as f64 * a + seed * b).sin() * c).fract().abs();
    (-2.0 * part(12.9898, 78.233, 43758.5453).max(1e-9).ln()).sqrt() * (TAU * part(39.3468, 11.135, 24634.6345)).cos()
}

/// A loop of stiffness and friction, computed with the friction `known`.
fn loop_curve(n: usize, friction: f64, known: f64, seed: f64) -> Curve {
    let phase: Vec<f64> = (0..n).map(|i| TAU * i as f64 / n as f64).collect();
    let x: Vec<f64> = phase.iter().map(|p| 4e-4 * p.sin()).collect();
    let v: Vec<f64> = phase.iter().map(|p| TAU * 4e-4 * p.cos()).collect();
    let force = |f: f64| -> Vec<f64> { x.iter().zip(&v).map(|(x, v)| 2e4 * x + f * (v / 2e-4).tanh()).collect() };
    let measured = force(friction).iter().enumerate().map(|(i, f)| f + 0.1 * noise(i, seed)).collect();
    Curve {
        label: "force at c1.x".into(),
        unit: "N".into(),
        kind: BlockKind::Loop,
        abscissa: phase,
        measured,
        computed: force(known),
        sigma: vec![0.1; n],
        x,
        v,
    }
}

/// Two resonances; the computed ones with other damping.
fn frf_curve(n: usize, damping: f64) -> Curve {
    let f: Vec<f64> = (0..n).map(|i| 20.0 + 180.0 * i as f64 / n as f64).collect();
    let h = |f: f64, d: f64| {
        let mode = |f0: f64| {
            let (r, i) = (f0 * f0 - f * f, 2.0 * d * f0 * f);
            let s = 1e-2 / (r * r + i * i);
            [r * s, -i * s]
        };
        let (a, b) = (mode(60.0), mode(130.0));
        [a[0] - b[0], a[1] - b[1]]
    };
    let measured = f.iter().enumerate().flat_map(|(i, w)| h(*w, 0.03).map(|v| v + 5e-8 * noise(2 * i, v))).collect();
    let computed = f.iter().flat_map(|w| h(*w, damping)).collect();
    Curve {
        label: "receptance m8.x/m1.x".into(),
        unit: "m/N".into(),
        kind: BlockKind::Frf,
        abscissa: f,
        x: vec![],
        v: vec![],
        measured,
        computed,
        sigma: vec![5e-8; 2 * n],
    }
}

fn table_curve() -> Curve {
    Curve {
        label: "dissipated energy per cycle at c1.x".into(),
        unit: "J".into(),
        kind: BlockKind::Table,
        abscissa: vec![0.01, 0.1, 1.0],
        x: vec![],
        v: vec![],
        measured: vec![1e-3, 2e-3, 3e-3],
        computed: vec![1.1e-3, 1.9e-3, 3.2e-3],
        sigma: vec![5e-5; 3],
    }
}

fn factor(channel: &str) -> Factor {
    let strength = OneStrength { parameter: "c1.x.viscous.c".into(), value: 500.0, best: 2.297, weak: 2.655 };
    Factor { channel: channel.into(), largest: 2.458, strength: Some(strength) }
}

fn result(id: &str, kind: &str, split: SplitName, curve: Curve) -> TestResult {
    let square = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>();
    let mean = if curve.kind == BlockKind::Frf { 0.0 } else { curve.measured.iter().sum::<f64>() / curve.measured.len() as f64 };
    let scale = square(&mut curve.measured.iter().map(|m| m - mean)).sqrt();
    let difference = |i: usize| curve.measured[i] - curve.computed[i];
    let n = curve.measured.len();
    let far = (0..n).max_by(|a, b| difference(*a).abs().total_cmp(&difference(*b).abs())).unwrap();
    TestResult {
        id: id.into(),
        kind: kind.into(),
        split,
        error: square(&mut (0..n).map(difference)).sqrt() / scale,
        floor: square(&mut curve.sigma.iter().copied()).sqrt() / scale,
        whitened_rms: (square(&mut (0..n).map(|i| difference(i) / curve.sigma[i])) / n as f64).sqrt(),
        worst: Worst {
            place: format!("{} at point {far}", curve.label),
            measured: curve.measured[far],
            computed: curve.computed[far],
            unit: crate::units::parse_unit_any(&curve.unit).unwrap(),
        },
        n,
        largest_difference: vec![LargestDifference { channel: curve.label.clone(), over: "range", fraction: curve.largest_difference() }],
        factors: if curve.kind == BlockKind::Table { vec![factor(&curve.label)] } else { vec![] },
        constant_damping: None,
        modes: vec![],
        curves: vec![curve],
    }
}

fn tests(n: usize, friction: f64, damping: f64, held_out: bool) -> Vec<TestResult> {
    let mut tests = vec![
        result("loop-1Hz", "cycle", SplitName::Fit, loop_curve(n, 2.0, friction, 1.0)),
        result(HOSTILE, "cycle", SplitName::Fit, loop_curve(n, 2.1, friction, 2.0)),
        result("frf-a", "frf", SplitName::Fit, frf_curve(n, damping)),
        result("table-3", "energy", SplitName::Fit, table_curve()),
        result("loop-2Hz", "cycle", SplitName::Select, loop_curve(n, 2.0, friction, 3.0)),
    ];
    if held_out {
        tests.push(result("loop-5Hz", "cycle", SplitName::HeldOut, loop_curve(n, 2.0, friction, 4.0)));
    }
    tests
}

fn at(effect: &str, at: &str) -> EffectAt {
    EffectAt { effect: effect.into(), at: at.into(), of: None }
}

fn parameters() -> Vec<ParameterResult> {
    let one = |name: &str, value: f64, unit: &str, printed: &str| ParameterResult {
        name: name.into(),
        value,
        unit: unit.into(),
        std: Some(0.01 * value),
        interval: (Some(0.98 * value), Some(1.02 * value)),
        identifiable: true,
        at_bound: false,
        printed: printed.into(),
        printed_interval: format!("{printed} interval"),
        note: None,
    };
    let lost = ParameterResult {
        std: None,
        printed_interval: "3.000e5 to inf N/mm".into(),
        interval: (Some(3e8), None),
        identifiable: false,
        at_bound: true,
        note: Some("rigid on this scale <u>".into()),
        ..one("c2.x.linear_stiffness.k", 3e9, "N/m", "3e6 N/mm (not identified)")
    };
    vec![one("c1.x.linear_stiffness.k", 2e4, "N/m", "20.0 N/mm +- 0.40"), one("c1.x.coulomb.fc", 2.0, "N", "2.00 N +- 0.04"), lost]
}

fn candidate(effect: &str, place: &str, drop: f64, accepted: bool) -> Candidate {
    Candidate {
        selected: None,
        effect: effect.into(),
        at: place.into(),
        of: None,
        predicted_drop: drop,
        error_before: 0.31,
        error_after: accepted.then_some(0.012),
        accepted,
        tied_with: if accepted { vec!["elastic_slip at c1.x".into()] } else { vec![] },
        p_value: if accepted { 2e-5 } else { 0.34 },
        nats: Some(if accepted { 21.0 } else { -3.0 }),
        reason: if accepted { Reason::Gains { nats: 21.0 } } else { Reason::TooLittle { nats: -3.0 } },
        remark: if accepted { String::new() } else { "no better on the select tests".into() },
    }
}

fn fit(tests: Vec<TestResult>) -> FitResult {
    FitResult {
        study: "rod".into(),
        termination: "converged".into(),
        cost: 8123.4,
        n_residuals: 1200,
        n_free: 2,
        wall_s: 0.123,
        iterations: 7,
        tests,
        parameters: parameters(),
        unidentifiable: vec!["c2.x.linear_stiffness.k <rigid>".into()],
        effects: vec![at("linear_stiffness", "c1.x")],
        model_error: vec![],
        readings: vec![],
        scatter: vec![],
        noise: 1.0,
        notes: vec!["loop-1Hz: scatter of 4 cycles".into()],
    }
}

fn ladder(n: usize) -> LadderResult {
    let rung = |added: Option<EffectAt>, tests: Vec<TestResult>, cost: f64, candidates: Vec<Candidate>| Rung {
        added,
        nats: None,
        removed: vec![],
        tests,
        parameters: parameters(),
        effects: vec![at("linear_stiffness", "c1.x"), at("viscous", "c1.x")],
        candidates,
        second_opinion: SecondOpinion::default(),
        effort: Effort::default(),
        termination: "converged".into(),
        cost,
        readings: vec![],
    };
    let law = |k: usize| ["coulomb", "film", "maxwell", "backlash"][k % 4];
    let weighed = |k: usize| candidate(law(k), if k == 0 { "c3<.x" } else { "c1.x" }, 0.9 / (k + 1) as f64, k == 0);
    let mut second = rung(Some(at("coulomb", "c3<.x")), tests(n, 1.7, 0.06, false), 900.0, (0..20).map(weighed).collect());
    second.removed.push(at("viscous", "c1.x"));
    let third = rung(Some(at("film", "c2.x")), tests(n, 2.0, 0.0301, true), 610.0, vec![candidate("film", "c2.x", 0.4, true)]);
    LadderResult {
        unexplained_remainder: false,
        unexplained: None,
        whitened_rms: Some(1.0),
        would_have_been_seen: vec![],
        study: "rod".into(),
        began_with: vec![],
        rungs: vec![rung(None, tests(n, 0.0, 0.1, true), 81234.0, vec![]), second, third],
        verdict: Verdict::Missing,
        missing: vec![Missing {
            effect: "coulomb".into(),
            at: "c3<.x".into(),
            of: None,
            tied_with: vec!["elastic_slip at c3<.x".into()],
            proven: Some(true),
        }],
        proven: true,
        why: "the error of the held-out tests fell".into(),
        instruments: vec![],
        corrections: vec![],
        remainder: 0.003,
        model_error: vec![],
        scatter: vec![],
        noise: 1.0,
        settings: Settings::default(),
        held_out: HeldOut { before: Some(0.31), after: Some(0.0183), floor: Some(0.017) },
        findings: vec![finding()],
        next_test: Some(NextTest {
            describe: "drive c1.x at 0.2 Hz, 0.1 mm".into(),
            test: "loop-1".into(),
            kind: "cycle".into(),
            frequency: 0.2,
            amplitude: 1e-4,
            mean: 0.0,
            unit: "m".into(),
            conditions: Default::default(),
            separation: 7.3,
            breaks: true,
            cut_short: false,
        }),
        no_next_test: None,
        ended: "nothing earns its place".into(),
        interrupted: false,
        wall_s: 12.3,
        result_study: Some("runs/1/study".into()),
    }
}

fn finding() -> Finding {
    Finding { test: HOSTILE.into(), claim: "residual jumps at reversal".into(), number: 41.0, threshold: 3.2, power: 0.99 }
}

fn diagnosis(verdict: Verdict) -> Diagnosis {
    let missing = if verdict == Verdict::Missing { vec![at("coulomb", "c3<.x")] } else { vec![] };
    Diagnosis {
        findings: vec![finding()],
        candidates: vec![candidate("coulomb", "c3<.x", 0.9, verdict == Verdict::Missing)],
        second_opinion: SecondOpinion {
            remark: Some("all candidates at once give <b> the largest part".into()),
            ..SecondOpinion::default()
        },
        verdict,
        missing,
        next_test: None,
        no_next_test: (verdict == Verdict::Missing).then(|| "coulomb at c3<.x is in a tie".into()),
        unexplained: (verdict == Verdict::Unexplained).then(missed),
        would_have_been_seen: if verdict == Verdict::NothingMissing { vec!["coulomb at c1.x: 0.02 N".into()] } else { vec![] },
    }
}

fn missed() -> Unexplained {
    let phase: Vec<f64> = (0..40).map(|k| TAU * f64::from(k) / 40.0).collect();
    let of = |f: &dyn Fn(f64) -> f64| phase.iter().map(|p| f(*p)).collect::<Vec<f64>>();
    Unexplained {
        at: "c3<.x".into(),
        expression: "f1*((x/X)^2)".into(),
        formula: "[[effect]]\nat = \"c3<.x\"\n".into(),
        explains: 0.8,
        error_before: 0.1,
        error_after: 0.02,
        picture: vec![Missed {
            test: HOSTILE.into(),
            x: of(&f64::sin),
            v: of(&f64::cos),
            force: of(&|p| p.sin().powi(2) + 0.1),
            formula: of(&|p| p.sin().powi(2)),
            phase: phase.clone(),
        }],
    }
}

/// What stands outside plotly's script: it must load nothing and hold no name unescaped.
fn own_part(page: &str) -> String {
    assert_eq!(page.matches(PLOTLY.as_str()).count(), 1, "plotly's script stands once");
    page.replace(PLOTLY.as_str(), "")
}

#[track_caller]
fn sound(page: &str) {
    for loads in ["src=\"http", "src='http", "src=http", "<link", "@import", "url(", "<iframe", "<img"] {
        assert!(!own_part(page).contains(loads), "the page loads something: {loads}");
    }
    assert!(!page.contains("src=\"http"));
    assert!(page.contains("Licensed under the MIT license") && !PLOTLY.contains("</script"));
    assert!(page.len() < 8_000_000, "{} bytes", page.len());
    let own = own_part(page);
    assert!(!own.contains("<script>alert") && !own.contains("<b>\"") && !own.contains("c3<.x"), "a name is not escaped");
    assert!(!own.contains("NaN"), "a number that is none is printed");
    for tag in ["section", "details", "table", "figure", "div", "dl", "ul", "tr", "span", "main", "script"] {
        let opened = own.matches(&format!("<{tag}>")).count() + own.matches(&format!("<{tag} ")).count();
        assert_eq!(opened, own.matches(&format!("</{tag}>")).count(), "{tag} is not closed");
    }
}

#[test]
fn a_ladder_is_told_from_its_first_screen_to_its_sources() {
    let dir = tempfile::tempdir().unwrap();
    let study = study(dir.path());
    let (fit, ladder) = (fit(tests(200, 0.0, 0.1, true)), ladder(200));
    let diagnosis = diagnosis(Verdict::Missing);
    let input = ReportInput { study: &study, system: None, fit: Some(&fit), diagnosis: Some(&diagnosis), ladder: Some(&ladder) };
    let file = dir.path().join("report.html");
    write(&input, &file).unwrap();
    // A copy to look at, where the environment says where to.
    if let Some(keep) = std::env::var_os("MISFIT_KEEP_REPORT") {
        std::fs::create_dir_all(&keep).unwrap();
        std::fs::copy(&file, Path::new(&keep).join("ladder.html")).unwrap();
        for (name, verdict) in [("missing", Verdict::Missing), ("nothing", Verdict::NothingMissing), ("unexplained", Verdict::Unexplained)]
        {
            let diagnosis = self::diagnosis(verdict);
            let input = ReportInput { diagnosis: Some(&diagnosis), ladder: None, ..input };
            write(&input, &Path::new(&keep).join(format!("{name}.html"))).unwrap();
        }
    }
    let page = std::fs::read_to_string(&file).unwrap();
    sound(&page);
    let escaped = "loop &lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;x&quot;";
    for id in ["loop-1Hz", escaped, "frf-a", "table-3", "loop-2Hz", "loop-5Hz"] {
        assert!(page.contains(&format!(">{id}</a>")) && page.contains(&format!("<summary>{id} ")), "test {id}");
    }
    for text in [
        "Rod &amp; clamp &lt;b&gt;",
        "The model misses coulomb at c3&lt;.x (these data cannot tell it from elastic slip at c3&lt;.x): held-out error fell from \
         31\u{a0}% to 1.8\u{a0}%, 1.08 × the noise floor.",
        "film at c2.x",
        "removed: viscous at c1.x",
        "No next test is proposed: coulomb at c3&lt;.x is in a tie.",
        "drive c1.x at 0.2 Hz, 0.1 mm",
        "residual jumps at reversal",
        "20.0 N/mm ± 0.40",
        "3.000e5 to ∞ N/mm",
        "at its bound",
        "c2.x.linear_stiffness.k &lt;rigid&gt;",
        "The clamp is rigid &lt;i&gt;",
        "Room temperature",
        "CC-BY-4.0",
        "scatter of 4 cycles",
        "no better on the select tests",
        "nothing earns its place",
        "8 more",
        "frequency 1 Hz",
    ] {
        assert!(page.contains(text), "`{text}` is not on the page");
    }
}

#[test]
fn what_is_not_there_is_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let study = study(dir.path());
    let nothing = ReportInput { study: &study, system: None, fit: None, diagnosis: None, ladder: None };
    let page = html(&nothing).unwrap();
    sound(&page);
    assert!(page.contains("has not been held against its measurements yet") && page.contains("misfit fit"));
    for id in ["tests", "rungs", "candidates", "findings", "parameters", "curves"] {
        assert!(!page.contains(&format!("<section id=\"{id}\"")), "{id}");
    }
    let good = fit(tests(100, 2.0, 0.03, true).into_iter().filter(|t| t.id == "loop-1Hz" || t.id == "frf-a").collect());
    let page = html(&ReportInput { fit: Some(&good), ..nothing }).unwrap();
    sound(&page);
    assert!(page.contains("The model fits to the noise.") && page.contains("misfit diagnose") && !page.contains("id=\"rungs\""));
    let mut bad = fit(tests(100, 0.0, 0.1, true));
    bad.termination = "stalled".into();
    let page = html(&ReportInput { fit: Some(&bad), ..nothing }).unwrap();
    assert!(page.contains("The model does not fit") && page.contains("The last fit ended: stalled") && page.contains("misfit ladder"));
    let with = |verdict| {
        let diagnosis = diagnosis(verdict);
        let page = html(&ReportInput { fit: Some(&bad), diagnosis: Some(&diagnosis), ..nothing }).unwrap();
        sound(&page);
        page
    };
    let page = with(Verdict::Missing);
    assert!(
        page.contains("misses coulomb at c3&lt;.x")
            && page.contains("the error on the select tests falls from 31\u{a0}% to 1.2\u{a0}%")
            && page.contains("misfit add")
    );
    assert!(with(Verdict::Unexplained).contains("Something is missing that no candidate explains"));
    let page = with(Verdict::NothingMissing);
    assert!(!page.contains("use the model as it is"));
    assert!(page.contains("No missing effect was found, although") && page.contains("coulomb at c1.x: 0.02 N"));
}

#[test]
fn many_long_tests_stay_below_the_bound_of_the_page() {
    let dir = tempfile::tempdir().unwrap();
    let study = study(dir.path());
    let mut ladder = ladder(20);
    for rung in &mut ladder.rungs {
        let long = |k: usize| {
            let curve = if k.is_multiple_of(2) { loop_curve(3000, 2.0, 0.1 * k as f64, k as f64) } else { frf_curve(3000, 0.05) };
            result(&format!("test-{k}"), "cycle", SplitName::Fit, curve)
        };
        rung.tests = (0..160).map(long).collect();
    }
    let page = html(&ReportInput { study: &study, system: None, fit: None, diagnosis: None, ladder: Some(&ladder) }).unwrap();
    sound(&page);
    assert!(page.contains("tests that fit best are not drawn"));
}

#[test]
fn columns_that_do_not_belong_together_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let study = study(dir.path());
    let mut fit = fit(tests(50, 2.0, 0.03, false));
    fit.tests[0].curves[0].computed.pop();
    match html(&ReportInput { study: &study, system: None, fit: Some(&fit), diagnosis: None, ladder: None }) {
        Err(ReportError::Curve { test, column: "computed", found: 49, wanted: 50, .. }) => assert_eq!(test, "loop-1Hz"),
        other => panic!("{:?}", other.map(|p| p.len())),
    }
    let missing = dir.path().join("no such folder/report.html");
    fit.tests[0].curves[0].computed.push(0.0);
    let e = write(&ReportInput { study: &study, system: None, fit: Some(&fit), diagnosis: None, ladder: None }, &missing);
    assert!(matches!(e, Err(ReportError::Write { .. })));
}
