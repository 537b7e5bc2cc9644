//! Realistic cases: what they hide, what is wrong beside it, and what the true law reaches.

use super::super::generate::generate;
use super::super::{Data, Kind, Options, Structure, write_case};
use super::*;

fn options(structure: Structure, kinds: &[Kind], only: &[Imperfection]) -> Options {
    Options { seed: 17, kinds: kinds.to_vec(), structure, data: Data::Realistic, only: only.to_vec() }
}

fn measured(options: &Options, index: usize) -> Generated {
    let mut case = generate(options, index);
    case.measured = (0..case.tests.len()).map(|at| measure(&mut case, at)).collect();
    case
}

#[test]
fn a_realistic_case_follows_from_seed_and_index() {
    let options = options(Structure::Both, &[], &[]);
    let written = |index: usize| {
        let folder = tempfile::tempdir().unwrap();
        write_case(&options, index, None, folder.path()).unwrap();
        ["study.toml", "truth.toml", "data/dataset.toml"].map(|f| std::fs::read_to_string(folder.path().join(f)).unwrap())
    };
    let first = written(2);
    assert_eq!(first, written(2));
    assert_ne!(first, written(12));
    let truths: Vec<String> = (0..12).map(|index| written(index)[1].clone()).collect();
    for truth in &truths {
        assert!(toml::from_str::<toml::Table>(truth).unwrap()["noncentrality"].is_float(), "{truth}");
    }
    assert!(first[1].contains("[[quirk]]"), "{}", first[1]);
    let stated = truths.iter().filter(|t| t.contains("stated = ")).count();
    assert!(0 < stated && stated < truths.len(), "a sigma is stated in {stated} of {}", truths.len());
}

#[test]
fn what_is_hidden_is_as_strong_as_was_drawn() {
    for structure in [Structure::Connector, Structure::Chain] {
        let options = options(structure, &[Kind::One, Kind::Two, Kind::Instrument], &[]);
        for index in 0..3 {
            let case = generate(&options, index);
            let strength = case.noncentrality.sqrt();
            let (least, most) = SETTINGS.strength;
            assert!(strength > 0.9 * least && strength < 2.0 * most, "{index}: {strength} {:?}", case.planted);
            // One of each kind of test that the case has.
            let held_out: Vec<&str> = case.tests.iter().filter(|t| t.split == "held_out").filter_map(|t| t.id.split('-').next()).collect();
            let mut kinds: Vec<&str> = case.tests.iter().filter_map(|t| t.id.split('-').next()).collect();
            kinds.dedup();
            assert_eq!(held_out, kinds, "{index}");
        }
    }
}

/// Under white noise alone the true law, fitted, misses the held-out loop by the noise of its mean.
#[test]
fn the_true_law_reaches_the_noise_where_nothing_else_is_wrong_and_not_where_strengths_scatter() {
    let over_noise = |only: Imperfection, index: usize| {
        let case = measured(&options(Structure::Connector, &[Kind::One], &[only]), index);
        let held = case.tests.iter().find(|t| t.split == "held_out").unwrap();
        floor(&case).unwrap() / (held.noise / (held.record.kept as f64).sqrt())
    };
    for index in 0..5 {
        let (white, scattered) = (over_noise(Imperfection::White, index), over_noise(Imperfection::Scatter, index));
        // 128 points of the mean of four cycles: its rms is known to 6 %.
        assert!((0.8..1.3).contains(&white), "{index}: {white}");
        assert!(scattered > 0.8, "{index}: {scattered}");
    }
    let mean = |only| (0..8).map(|i| over_noise(only, i)).sum::<f64>() / 8.0;
    assert!(mean(Imperfection::Scatter) > 1.2 * mean(Imperfection::White));
}

#[test]
fn one_imperfection_alone_is_alone() {
    use Imperfection::*;
    let of = |only: Imperfection| {
        let life = generate(&options(Structure::Connector, &[Kind::None], &[only]), 1).life.unwrap();
        let test = &life.tests[0];
        [
            test.correlation > 0.0,
            test.slow > 0.0 && test.cycles > 0.0,
            test.params.iter().any(|p| *p != 1.0),
            life.sensors.iter().flatten().any(|s| *s != 0.0),
            test.stated.is_some(),
            test.gains.iter().any(|g| *g != 1.0),
            !life.quirks.is_empty(),
        ]
    };
    for (k, only) in [Noise, Cycles, Scatter, Sensor, Sigma, Gains, Base].into_iter().enumerate() {
        let there = of(only);
        assert!(there.iter().enumerate().all(|(j, t)| *t == (j == k)), "{only:?}: {there:?}");
    }
    assert!(of(White).iter().all(|t| !t));
}
