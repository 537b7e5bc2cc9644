use std::f64::consts::TAU;
use std::fmt::Write;

use super::*;

/// Files in a folder.
fn files(texts: &[(&str, &str)]) -> (tempfile::TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().unwrap();
    let write = |(name, text): &(&str, &str)| {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        path
    };
    let paths = texts.iter().map(write).collect();
    (folder, paths)
}

/// An accelerance with a mode at 50 Hz, from `first` Hz on.
fn frf(first: i32) -> String {
    let mut text = "frequency [Hz],real(H) [m/s2/N],imag(H) [m/s2/N]\n".to_string();
    for k in first..400 {
        let r = f64::from(k) / 2.0 / 50.0;
        // H = -r^2 / (1 - r^2 + 2 i zeta r)
        let (re, im) = (1.0 - r * r, 0.04 * r);
        let size = re * re + im * im;
        writeln!(text, "{},{:.9},{:.9}", f64::from(k) / 2.0, -r * r * re / size, r * r * im / size).unwrap();
    }
    text
}

#[test]
fn an_frf_from_0_hz_shows_its_mode_in_every_format() {
    let (folder, paths) = files(&[("a.csv", &frf(0))]);
    let looked = look(&paths, None, &[]).unwrap();
    let (problem, modes) = create(&folder.path().join("study"), &paths, looked.scaffold.as_ref().unwrap()).unwrap();
    assert!(problem.is_none(), "{:?}", problem.map(|p| p.message().to_string()));
    let modes = modes.unwrap().unwrap();
    assert!((modes.modes[0].frequency - 50.0).abs() < 0.1, "{:?}", modes.modes);
}

#[test]
fn why_there_are_no_modes_is_said() {
    let (folder, paths) = files(&[("a.csv", &frf(1)), ("b.csv", &frf(1))]);
    let looked = look(&paths, None, &[]).unwrap();
    let (_, modes) = create(&folder.path().join("study"), &paths, looked.scaffold.as_ref().unwrap()).unwrap();
    let why = modes.unwrap().unwrap_err();
    assert!(why.contains("n1.x over n1.x") && why.contains("twice"), "{why}");
}

#[test]
fn a_letter_is_a_guess_and_a_missing_unit_is_named() {
    let mut text = "t,D,F\n".to_string();
    for k in 0..1000 {
        let p = TAU * f64::from(k) / 100.0;
        writeln!(text, "{},{:.6},{:.6}", f64::from(k) / 100.0, 2.0 * p.sin(), 30.0 * (p + 0.2).sin()).unwrap();
    }
    let (folder, paths) = files(&[("a.csv", &text)]);
    let looked = look(&paths, None, &[]).unwrap();
    let scaffold = looked.scaffold.as_ref().unwrap();
    assert!(scaffold.dataset.contains("role = \"displacement\", at = \"c1.x\", column = \"D\""), "{}", scaffold.dataset);
    assert_eq!(scaffold.dataset.matches("by its letter alone").count(), 3, "{}", scaffold.dataset);
    assert!(scaffold.to_confirm.iter().any(|c| c.contains("`D` is the displacement")), "{:?}", scaffold.to_confirm);
    let value = item("a.csv", &looked.found[0].items[0]);
    assert!(value["channels"][1]["guessed"] == true && value["units_given"] == false, "{value}");
    let wrong = trouble(scaffold, folder.path()).unwrap();
    assert!(wrong.message().contains("the unit of the time is missing") && wrong.accepted().contains("ms"), "{}", wrong.message());
}

#[test]
fn the_rate_that_is_stated_is_the_time_of_the_test() {
    let mut text = "weg [mm],kraft [N]\n".to_string();
    for k in 0..1000 {
        let p = TAU * f64::from(k) / 100.0;
        writeln!(text, "{:.6},{:.6}", 2.0 * p.sin(), 30.0 * (p + 0.2).sin()).unwrap();
    }
    let (folder, paths) = files(&[("a.csv", &text)]);
    let looked = look(&paths, Some(610.35), &[]).unwrap();
    let scaffold = looked.scaffold.as_ref().unwrap();
    assert!(scaffold.dataset.contains("{ role = \"time\", rate = \"610.35 Hz\" }"), "{}", scaffold.dataset);
    assert!(trouble(scaffold, folder.path()).is_none(), "{}", scaffold.dataset);
    let (problem, _) = create(&folder.path().join("study"), &paths, scaffold).unwrap();
    assert!(problem.is_none());
}

#[test]
fn motions_that_nothing_drives_are_a_decay_or_responses_without_their_excitation() {
    // An oscillator of 20 Hz and 2 %, sampled at 500 Hz: pushed once, and pushed by noise throughout.
    let record = |push: &dyn Fn(usize) -> f64, n: usize| {
        let (omega, zeta, dt) = (TAU * 20.0, 0.02, 0.002);
        let (decay, swing) = ((-zeta * omega * dt).exp(), (omega * f64::sqrt(1.0 - zeta * zeta) * dt).cos());
        let (mut text, mut last, mut before) = ("time [s],acceleration [m/s2]\n".to_string(), 0.0, 0.0);
        for k in 0..n {
            let now = 2.0 * decay * swing * last - decay * decay * before + push(k);
            (before, last) = (last, now);
            writeln!(text, "{:.3},{now:.6}", dt * k as f64).unwrap();
        }
        text
    };
    let random = |k: usize| {
        f64::from((k as u32 + 1).wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(40_503) >> 8) / f64::from(1 << 24) - 0.5
    };
    let begun = |name: &str, text: String| {
        let (folder, paths) = files(&[(name, &text)]);
        let looked = look(&paths, None, &[]).unwrap();
        let scaffold = looked.scaffold.unwrap();
        let (problem, _) = create(&folder.path().join("study"), &paths, &scaffold).unwrap();
        assert!(problem.is_none(), "{:?} {}", problem.map(|p| p.message().to_string()), scaffold.dataset);
        scaffold
    };
    let decay = begun("decay.csv", record(&|k| f64::from(u8::from(k == 0)), 1000));
    assert!(
        decay.dataset.contains("kind = \"transient\"\ncontrol = \"free\"") && !decay.dataset.contains("output_only"),
        "{}",
        decay.dataset
    );
    let road = begun("road.csv", record(&random, 60_000));
    assert!(road.dataset.contains("kind = \"modal\"\noutput_only = true") && !road.dataset.contains("control"), "{}", road.dataset);
    let told = |what: &str| road.to_confirm.iter().any(|line| line.starts_with("road: ") && line.contains(what));
    assert!(told("its excitation") || told("the excitation"), "{:?}", road.to_confirm);
    assert!(told("measured at n1.x"), "{:?}", road.to_confirm);
    // A force alone is neither.
    let (_folder, paths) = files(&[("force.csv", "time [s],force [N]\n0,1\n0.1,2\n0.2,1.5\n0.3,0.7\n")]);
    assert!(look(&paths, None, &[]).unwrap().scaffold.is_none());
}
