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
