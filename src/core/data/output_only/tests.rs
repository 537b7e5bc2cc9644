//! Responses of chains to white forces, stepped exactly, against the poles of the state space.

use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::data::dataset::tests::{Folder, error};
use crate::data::modal_fit::tests::normal;
use crate::explain::Explain;

const STEP: f64 = 1e-3;

/// Three masses of 1 kg on springs of 20 kN/m with dampers between them.
fn state() -> DMatrix<f64> {
    let (k, c) = (2e4, [4.0, 9.0, 2.0]);
    let mut a = DMatrix::zeros(6, 6);
    for i in 0..3 {
        a[(i, 3 + i)] = 1.0;
        a[(3 + i, i)] -= k;
        a[(3 + i, 3 + i)] -= c[i];
        if i > 0 {
            for (row, column) in [(i, i - 1), (i - 1, i)] {
                a[(3 + row, column)] += k;
                a[(3 + row, 3 + column)] += c[i];
            }
            a[(3 + i - 1, i - 1)] -= k;
            a[(3 + i - 1, 3 + i - 1)] -= c[i];
        }
    }
    a
}

/// Frequency (Hz) and damping ratio of its modes.
fn exact() -> Vec<(f64, f64)> {
    let mut modes: Vec<(f64, f64)> =
        state().complex_eigenvalues().iter().filter(|s| s.im > 0.0).map(|s| (s.norm() / TAU, -s.re / s.norm())).collect();
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    modes
}

/// Displacement of the first mass, velocity of the third, acceleration of the second, of unit rms, with 2 % of noise; white forces on all masses, and `tone` at 50 Hz.
fn responses(samples: usize, tone: f64, seed: u64) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let a = state();
    let step = (&a * STEP).exp();
    let mut draw = || normal(&mut random);
    let mut x = DVector::zeros(6);
    let mut out = vec![Vec::new(); 3];
    for n in 0..samples + 2000 {
        let hum = tone * (TAU * 50.0 * n as f64 * STEP).sin();
        for i in 3..6 {
            x[i] += draw() + hum;
        }
        x = &step * x;
        if n >= 2000 {
            let rates = &a * &x;
            [x[0], x[5], rates[4]].iter().zip(&mut out).for_each(|(v, o)| o.push(*v));
        }
    }
    for channel in &mut out {
        let rms = crate::data::record::spread(channel);
        channel.iter_mut().for_each(|v| *v = *v / rms + 0.02 * draw());
    }
    out
}

#[test]
fn the_modes_of_a_chain_are_found_within_their_deviations() {
    let exact = exact();
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..8 {
        let found = identify(&responses(120_000, 0.0, seed), STEP, Some((2.0, 80.0))).unwrap();
        assert_eq!(found.modes.len(), 3, "{seed}: {found:?}");
        for (mode, (frequency, damping)) in found.modes.iter().zip(&exact) {
            assert!((mode.frequency / frequency - 1.0).abs() < 0.01, "{seed}: {mode:?} {frequency}");
            assert!((mode.damping / damping - 1.0).abs() < 0.4, "{seed}: {mode:?} {damping}");
            for z in [(mode.frequency - frequency) / mode.frequency_sigma, (mode.damping - damping) / mode.damping_sigma] {
                assert!(z.abs() < 5.0, "{seed}: {mode:?} {frequency} {damping}");
                (squares, count) = (squares + z * z, count + 1.0);
            }
        }
    }
    let rms = f64::sqrt(squares / count);
    assert!((0.6..1.5).contains(&rms), "{rms}");
}

/// A motor at 50 Hz is a pole without damping: it is said, and is no mode.
#[test]
fn a_line_of_the_excitation_is_no_mode() {
    let found = identify(&responses(120_000, 0.5, 3), STEP, Some((2.0, 80.0))).unwrap();
    assert_eq!(found.modes.len(), 3, "{found:?}");
    assert!(found.left_out.iter().any(|l| l.contains("at 50.0")), "{found:?}");
}

/// Beyond half of the sampling frequency the warped frequency is negative, and a band there would have been read as all lines.
#[test]
fn a_band_beyond_what_the_samples_tell_is_refused() {
    for band in [(2.0, 500.0), (600.0, 900.0)] {
        let error = identify(&responses(2000, 0.0, 1), STEP, Some(band)).unwrap_err();
        assert_eq!(error, OutputOnlyError::Band { asked: band.1, told: 450.0 });
        assert!(error.accepted().contains("450.0000 Hz or below"), "{}", error.accepted());
    }
}

#[test]
fn too_short_a_record_says_so() {
    let error = identify(&responses(900, 0.0, 1), STEP, None).unwrap_err();
    assert_eq!(error, OutputOnlyError::Short { samples: 900 });
    assert!(error.accepted().contains("at least 1088 samples"), "{}", error.accepted());
}

const TEST: &str = r#"schema = 1
[[test]]
id = "road"
kind = "modal"
output_only = true
file = "road.csv"
band = ["2 Hz", "80 Hz"]
channels = [
 { role = "time", column = "t", unit = "s" },
 { role = "displacement", at = "m1.x", column = "x1", unit = "mm" },
 { role = "velocity", at = "m3.x", column = "v3", unit = "mm/s" },
 { role = "acceleration", at = "m2.x", column = "a2", unit = "m/s2" },
]
"#;

/// The record of a chain as a file.
fn file(samples: usize) -> String {
    let responses = responses(samples, 0.0, 5);
    let row = |n: usize| format!("{:.3},{:.6},{:.6},{:.6}\n", n as f64 * STEP, responses[0][n], responses[1][n], responses[2][n]);
    format!("t,x1,v3,a2\n{}", (0..samples).map(row).collect::<String>())
}

#[test]
fn a_record_without_its_excitation_is_a_modal_table() {
    let record = file(120_000);
    let dataset = Folder::new(TEST).with("road.csv", &record).load().unwrap();
    let crate::data::Record::Modal(table) = &dataset.tests[0].record else { panic!("{:?}", dataset.tests[0].record) };
    assert_eq!(table.rows.iter().map(|r| r.mode).collect::<Vec<_>>(), [1, 2, 3]);
    assert!(
        table.notes[0].contains("3 mode(s) at") && table.notes[0].contains("displacement at m1.x, velocity at m3.x, acceleration at m2.x"),
        "{:?}",
        table.notes
    );
    for (row, (frequency, _)) in table.rows.iter().zip(exact()) {
        assert!((row.frequency.value - frequency).abs() < 5.0 * row.frequency.sigma.unwrap(), "{row:?} {frequency}");
    }
    let numbered = TEST.replace("band =", "modes = [2, 3, 7]\nband =");
    let dataset = Folder::new(&numbered).with("road.csv", &record).load().unwrap();
    let crate::data::Record::Modal(table) = &dataset.tests[0].record else { panic!() };
    assert_eq!(table.rows.iter().map(|r| r.mode).collect::<Vec<_>>(), [2, 3, 7]);
    let miscounted = Folder::new(&TEST.replace("band =", "modes = [1, 2]\nband =")).with("road.csv", &record).load().unwrap_err();
    assert!(miscounted.to_string().contains("numbers 2, and 3 were identified"), "{miscounted}");
}

#[test]
fn what_cannot_be_identified_is_refused_where_it_stands() {
    let short = Folder::new(TEST).with("road.csv", &file(900)).load().unwrap_err();
    assert!(short.to_string().contains("900 samples") && short.place().contains("road.csv"), "{short}: {}", short.place());
    let still = file(2000)
        .lines()
        .map(|l| format!("{},0,0,0\n", l.split(',').next().unwrap()))
        .collect::<String>()
        .replace("t,0,0,0", "t,x1,v3,a2");
    let still = Folder::new(TEST).with("road.csv", &still).load().unwrap_err();
    assert!(still.to_string().contains("displacement at m1.x does not vary"), "{still}");
    error(&TEST.replace("[\"2 Hz\", \"80 Hz\"]", "[\"80 Hz\", \"2 Hz\"]"), &[("road.csv", "")], "no band", 7);
    error(&TEST.replace("band =", "modes = [2, 1]\nband ="), &[("road.csv", "")], "numbers of modes that do not rise", 7);
    error(&TEST.replace("velocity\", at = \"m3.x", "force\", at = \"m3.x"), &[("road.csv", "")], "force", 11);
    error(&TEST.replace("band =", "rows = []\nband ="), &[("road.csv", "")], "rows", 7);
}
