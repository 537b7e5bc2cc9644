//! Tolerances of parts where everything has a closed form: `W_D = K exp(a i)`, `i = i0 exp(t s)` with a tolerance t [mm] and a deviation s over it.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// Widths of the cases [mm], interference without deviation [m], exponent [1/m].
const WIDTHS: [f64; 3] = [0.1, 0.2, 0.4];
const I0: f64 = 0.2e-3;
const A: f64 = 4e3;

/// W_D [J] at the deviation `s` over the width `t` [mm].
fn energy(t: f64, s: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let i = I0 * (t * s).exp();
    PI * 300.0 * (A * (i - 0.2e-3)).exp() * TAU * 3.0 * 0.3e-3 * 0.3e-3
}

fn folder(parts: &str) -> tempfile::TempDir {
    let dir = super::tolerance::folder(&[0.1, 0.2, 0.3], &[0.2]);
    let row = |(k, t): (usize, &f64)| {
        let end = |s: f64| 1e3 * I0 * (t * s).exp();
        format!(
            "{{ case = \"{}\", W_D = \"{:.6} mJ\", conditions = {{ t = \"{t} mm\", i_min = \"{:.9} mm\", i_max = \"{:.9} mm\" }} }}",
            k + 1,
            1e3 * energy(*t, 0.0),
            end(-0.5),
            end(0.5)
        )
    };
    let rows: Vec<String> = WIDTHS.iter().enumerate().map(row).collect();
    let table = format!(
        "schema = 1\n[[test]]\nid = \"cases\"\nkind = \"energy\"\nat = \"c1.x\"\ncontrol = \"displacement\"\nrows = [{}]\n",
        rows.join(",\n")
    );
    std::fs::write(dir.path().join("data/cases.toml"), table).unwrap();
    let study = dir.path().join("study.toml");
    std::fs::write(&study, std::fs::read_to_string(&study).unwrap() + parts).unwrap();
    dir
}

fn run(study: &Path) -> (Option<i32>, Value) {
    let run = Command::new(env!("CARGO_BIN_EXE_misfit")).args(["tolerance", "--json", "--draws", "20000"]).arg(study).output().unwrap();
    let value = serde_json::from_slice(&run.stdout).unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&run.stderr)));
    (run.status.code(), value)
}

const PART: &str = "[[tolerance.parts]]\nname = \"t\"\ndistribution = \"normal\"\n";

#[test]
fn mean_spread_yield_and_synthesis_are_those_of_the_closed_form() {
    // 90 % lie below the band's upper end at t = 0.25 mm: s = 1.2816 / 6.
    let most = 1e3 * energy(0.25, 1.281_55 / 6.0);
    let parts = format!(
        "{PART}cost = 1.0\n[[tolerance.bands]]\nquantity = \"W_D\"\nmax = \"{most:.6} mJ\"\n[tolerance.synthesis]\ncase = \"3\"\nyield = \"90 %\"\n"
    );
    let dir = folder(&parts);
    let (code, result) = run(dir.path());
    assert_eq!(code, Some(0), "{result}");
    let schema: Value = {
        let run = Command::new(env!("CARGO_BIN_EXE_misfit")).args(["schema", "tolerance", "--json"]).output().unwrap();
        serde_json::from_slice(&run.stdout).unwrap()
    };
    let wrong = super::schema::against(&schema, &schema, &result, "");
    assert!(wrong.is_empty(), "{wrong:#?}");
    for (k, t) in WIDTHS.iter().enumerate() {
        let name = (k + 1).to_string();
        let case = result["cases"].as_array().unwrap().iter().find(|c| c["case"] == name.as_str() && c["quantity"] == "W_D").unwrap();
        let (mean, std) = mean_and_deviation(&|s| energy(*t, s));
        let number = |key: &str| case[key].as_f64().unwrap();
        assert!((number("mean") / mean - 1.0).abs() < 5e-3, "case {}: {} for {mean}", k + 1, number("mean"));
        assert!((number("std") / std - 1.0).abs() < 0.02, "case {}: {} for {std}", k + 1, number("std"));
        let worst = case["worst_case"][1].as_f64().unwrap();
        assert!((worst / energy(*t, 0.5) - 1.0).abs() < 5e-3, "{worst}");
        assert_eq!(case["inside"], true);
        // The band at this width: z = 1.2816 * 0.25 / t.
        let z = 1.281_55 * 0.25 / t;
        let expected = 0.5 * (1.0 + statrs_erf(z / 2f64.sqrt()));
        assert!((number("yield") - expected).abs() < 0.02, "case {}: {} for {expected}", k + 1, number("yield"));
        let interval = case["yield_interval"].as_array().unwrap();
        assert!(interval[0].as_f64().unwrap() <= expected && expected <= interval[1].as_f64().unwrap(), "{interval:?} {expected}");
    }
    let page = std::fs::read_to_string(Path::new(result["run"].as_str().unwrap()).join("report.html")).unwrap();
    assert!(
        page.contains("Tolerances for a yield of 90.00 % exist") && page.matches("newPlot(\"chart-").count() >= 2 && page.contains("band")
    );
    let share = &result["contributions"][0];
    assert!(share["tolerance"] == "t" && (share["first"].as_f64().unwrap() - 1.0).abs() < 0.01, "{share}");
    assert!(result["surrogate"]["error"].as_f64().unwrap() < 1e-3, "{}", result["surrogate"]);
    let found = &result["synthesis"];
    assert_eq!(found["feasible"], true, "{found}");
    let width = found["tolerances"][0]["width"].as_f64().unwrap();
    assert!((width / 0.25e-3 - 1.0).abs() < 0.04, "{width}");
    assert!((found["yield"].as_f64().unwrap() - 0.9).abs() < 5e-3, "{found}");
    // A yield costs more than a lower one; that of 90 % is the one above, 1 / 0.25 mm.
    let curve: Vec<(f64, f64)> =
        found["curve"].as_array().unwrap().iter().map(|p| (p["asked"].as_f64().unwrap(), p["cost"].as_f64().unwrap())).collect();
    assert!(curve.len() >= 3 && curve.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 <= w[1].1), "{curve:?}");
    let same = curve.iter().find(|p| p.0 == 0.9).unwrap();
    assert!((same.1 / 4e3 - 1.0).abs() < 0.06, "{curve:?}");
    assert!(page.contains("Cost against yield"));
}

/// Mean and standard deviation of a quantity of a normal deviation of standard deviation 1/6: Simpson's rule over +-8 of it.
fn mean_and_deviation(of: &dyn Fn(f64) -> f64) -> (f64, f64) {
    let moment = |f: &dyn Fn(f64) -> f64| {
        let n = 400;
        let step = 16.0 / f64::from(n);
        let at = |j: i32| {
            let z = -8.0 + step * f64::from(j);
            let weight = if j == 0 || j == n {
                1.0
            } else if j % 2 == 1 {
                4.0
            } else {
                2.0
            };
            weight * f(of(z / 6.0)) * (-0.5 * z * z).exp()
        };
        (0..=n).map(at).sum::<f64>() * step / 3.0 / std::f64::consts::TAU.sqrt()
    };
    let mean = moment(&|w| w);
    (mean, moment(&|w| (w - mean).powi(2)).sqrt())
}

/// A second body on a spring whose stiffness follows the interference: `f = sqrt(k/m)/(2 pi)`, `k = k0 exp(b (i - 0.2 mm))`.
#[test]
fn natural_frequencies_are_those_of_the_closed_form() {
    const SECOND: &str = "[[body]]\nname = \"m\"\nmass = \"20 kg\"\nfree = [\"x\"]\n[[connector]]\nname = \"c2\"\nfrom = \"ground\"\nto = \"m\"\n\
        [[effect]]\neffect = \"linear_stiffness\"\nat = \"c2.x\"\nk = { start = \"50 N/mm\", fixed = true }\n\
        [[effect]]\neffect = \"interference_law\"\nat = \"c2.x\"\nof = \"linear_stiffness.k\"\ncondition = \"i\"\nreference = \"0.2 mm\"\n\
        a = { start = \"3 1/mm\", fixed = true }\n";
    let over = |i: f64| (50e3 * (3e3 * (i - 0.2e-3)).exp() / 20.0).sqrt() / std::f64::consts::TAU;
    let frequency = |t: f64, s: f64| over(I0 * (t * s).exp());
    let band = format!(
        "cost = 1.0\n[[tolerance.bands]]\nquantity = \"natural_frequency\"\nmode = 1\nmax = \"{:.6} Hz\"\n\
         [tolerance.synthesis]\ncase = \"3\"\nyield = \"90 %\"\n",
        frequency(0.25, 1.281_55 / 6.0)
    );
    let dir = folder(&format!("{PART}{band}{SECOND}"));
    let (code, result) = run(dir.path());
    assert_eq!(code, Some(0), "{result}");
    for (k, t) in WIDTHS.iter().enumerate() {
        let name = (k + 1).to_string();
        let all = result["cases"].as_array().unwrap();
        let case = all.iter().find(|c| c["case"] == name.as_str() && c["quantity"] == "natural_frequency").unwrap();
        let (mean, std) = mean_and_deviation(&|s| frequency(*t, s));
        let number = |key: &str| case[key].as_f64().unwrap();
        assert!(case["mode"] == 1 && case["unit"] == "Hz", "{case}");
        assert!((number("mean") / mean - 1.0).abs() < 1e-4, "case {name}: {case} for {mean}");
        assert!((number("std") / std - 1.0).abs() < 0.02, "case {name}: {case} for {std}");
        // At the mean of the least and the greatest interference.
        assert!((number("at_mean") / over(I0 * (0.5 * t).cosh()) - 1.0).abs() < 1e-6, "{case}");
        let worst = case["worst_case"][1].as_f64().unwrap();
        assert!((worst / frequency(*t, 0.5) - 1.0).abs() < 1e-4, "{worst}");
    }
    assert!(result["surrogate"]["error_frequency"].as_f64().unwrap() < 1e-4, "{}", result["surrogate"]);
    let width = result["synthesis"]["tolerances"][0]["width"].as_f64().unwrap();
    assert!((width / 0.25e-3 - 1.0).abs() < 0.04, "{width}");
    let shares = result["contributions"].as_array().unwrap();
    assert!(
        shares.iter().any(|s| s["quantity"] == "natural_frequency" && s["mode"] == 1 && s["first"].as_f64().unwrap() > 0.99),
        "{shares:?}"
    );
    // Without a band, `modes` asks for it.
    let dir = folder(&format!("{PART}{SECOND}"));
    let study = dir.path().join("study.toml");
    let text = std::fs::read_to_string(&study).unwrap();
    std::fs::write(&study, text.replacen("[tolerance]\n", "[tolerance]\nmodes = [1]\n", 1)).unwrap();
    let schema = Command::new(env!("CARGO_BIN_EXE_misfit")).args(["schema", "study", "--json"]).output().unwrap().stdout;
    let schema: Value = serde_json::from_slice(&schema).unwrap();
    for dir in [&folder(&format!("{PART}{band}{SECOND}")), &dir] {
        let written = super::schema::json(&std::fs::read_to_string(dir.path().join("study.toml")).unwrap());
        let wrong = super::schema::against(&schema, &schema, &written, "");
        assert!(wrong.is_empty(), "{wrong:#?}");
    }
    let (_, result) = run(dir.path());
    assert!(result["cases"].as_array().unwrap().iter().any(|c| c["quantity"] == "natural_frequency" && c["yield"].is_null()), "{result}");
    let ask = |more: &str| run(folder(&format!("{PART}{more}{SECOND}")).path());
    let wrong = [
        ("[[tolerance.bands]]\nquantity = \"natural_frequency\"\nmax = \"9 Hz\"\n", "without its mode", "mode = 1"),
        ("[[tolerance.bands]]\nquantity = \"W_D\"\nmode = 1\nmax = \"9 mJ\"\n", "W_D has no mode", "natural_frequency"),
        (
            "[[tolerance.bands]]\nquantity = \"natural_frequency\"\nmode = 7\nmax = \"9 Hz\"\n",
            "the model has 1 flexible modes",
            "at least 7",
        ),
    ];
    for (more, message, accepted) in wrong {
        let (code, result) = ask(more);
        let text = |key: &str| result["error"][key].as_str().unwrap_or_default().to_string();
        assert!(code == Some(1) && text("message").contains(message) && text("accepted").contains(accepted), "{more}: {result}");
    }
}

/// Abramowitz and Stegun 7.1.26, to 1.5e-7.
fn statrs_erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let p = t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    x.signum() * (1.0 - p * (-x * x).exp())
}

#[test]
fn what_cannot_be_is_said_with_what_would_be_accepted() {
    let band = |text: &str| format!("{PART}[[tolerance.bands]]\nquantity = \"W_D\"\n{text}\n");
    let two = "[[tolerance.parts]]\nname = \"i_min\"\ndistribution = \"uniform\"\n[[tolerance.parts]]\nname = \"i_max\"\ndistribution = \"uniform\"\n";
    let tied = |a: &str, b: &str, r: f64| format!("[[tolerance.correlations]]\nbetween = [\"{a}\", \"{b}\"]\ncoefficient = {r}\n");
    let wrong = [
        (PART.replace("normal", "gauss"), "gauss", "normal"),
        (band("min = \"1 kJ\""), "nothing meets the band of W_D", "a band that reaches into"),
        (band("min = \"2 mJ\"\nmax = \"1 mJ\""), "the band is empty", "min below max"),
        (
            format!("{PART}{two}{}{}{}", tied("t", "i_min", 0.9), tied("i_min", "i_max", 0.9), tied("t", "i_max", -0.9)),
            "not positive definite",
            "nearer to 0",
        ),
        (format!("{PART}cp = 1.0\ncpk = 1.5\n"), "cpk = 1.5 with cp = 1", "at most cp"),
        (format!("{PART}min = \"-0.1 mm\"\n"), "a width of -0.1 mm", "above 0"),
        (format!("{PART}cost = 1.0\n[tolerance.synthesis]\ncase = \"1\"\nyield = \"90 %\"\n"), "without a band", "tolerance.bands"),
        (String::new(), "no tolerances of parts", "tolerance.parts"),
    ];
    for (parts, message, accepted) in wrong {
        let dir = folder(&parts);
        let (code, result) = run(dir.path());
        assert_eq!(code, Some(1), "{parts}: {result}");
        let text = |key: &str| result["error"][key].as_str().unwrap_or_default().to_string();
        assert!(text("message").contains(message), "{parts}: {result}");
        assert!(text("accepted").contains(accepted), "{parts}: {result}");
    }
    // A tolerance of the cases that is below zero.
    let dir = folder(PART);
    let cases = dir.path().join("data/cases.toml");
    std::fs::write(&cases, std::fs::read_to_string(&cases).unwrap().replacen("t = \"0.1 mm\"", "t = \"-0.1 mm\"", 1)).unwrap();
    let (code, result) = run(dir.path());
    assert!(code == Some(1) && result["error"]["message"].as_str().unwrap().contains("`t` is -0.1 mm"), "{result}");
    // A yield that nothing reaches names what stands in the way.
    let parts = format!(
        "{}cost = 1.0\n[tolerance.synthesis]\ncase = \"3\"\nyield = \"99 %\"\n",
        band(&format!("max = \"{:.6} mJ\"", 1e3 * energy(0.1, 0.05))).replace(PART, "")
    );
    let dir = folder(&(PART.to_string() + &parts.replace("cost = 1.0\n", "")).replacen("\"normal\"\n", "\"normal\"\ncost = 1.0\n", 1));
    let (code, result) = run(dir.path());
    assert_eq!(code, Some(0), "{result}");
    let found = &result["synthesis"];
    assert!(found["feasible"] == false && found["in_the_way"].as_str().unwrap().contains("`t`"), "{found}");
}
