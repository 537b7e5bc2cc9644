//! The bench against closed forms, and the judge on made-up ladders.

use approx::assert_relative_eq;
use num_complex::Complex64;
use std::f64::consts::{PI, TAU};

use super::bench::{Bench, Hidden, Planted, Record, SAMPLES};
use super::law::{Law, Memory, Motion};
use super::*;

fn planted(law: Law, size: f64) -> Planted {
    Planted { effect: String::new(), hidden: Hidden::Force(law), size, place: 0 }
}

fn one() -> Bench {
    Bench { bodies: 0, mass: 0.0, params: vec![2e4, 30.0], force: 20.0, travel: 1e-3, parts: vec![] }
}

/// Work of the last cycle of a record of force over a sine of displacement.
fn work(force: &[f64], amplitude: f64) -> f64 {
    let last = &force[force.len() - SAMPLES..];
    let turn = TAU / SAMPLES as f64;
    last.iter().enumerate().map(|(j, f)| f * amplitude * (turn * j as f64).cos() * turn).sum()
}

#[test]
fn losses_per_cycle_are_those_of_the_closed_forms() {
    let b = one();
    let (f, a) = (2.0, 1e-3);
    let own = PI * 30.0 * TAU * f * a * a;
    let loss = |law: Law| work(&connector::march(&b, &b.params, &[planted(law, 0.3)], (f, a, 0.0), (4, Record::default()), 0.0), a) - own;
    let size: f64 = 6.0;
    // Coulomb: 4 F X. A slider behind a spring: 4 F (X - d). Sliders of uniform density, all slipping: 4 F (X - 2d/3).
    assert_relative_eq!(loss(Law::Dry), 4.0 * size * a, max_relative = 0.01);
    assert_relative_eq!(loss(Law::Slider { d: 2e-4 }), 4.0 * size * (a - 2e-4), max_relative = 0.01);
    assert_relative_eq!(loss(Law::Sliders { d: 8e-4 }), 4.0 * size * (a - 2.0 * 8e-4 / 3.0), max_relative = 0.01);
    // Yield with n = 1: elastic over d, then an exponential, which leave 5/2 d F of each half of the rectangle: 4 F (X - 5/4 d).
    assert_relative_eq!(loss(Law::Yielding { d: 5e-5, n: 1.0 }), 4.0 * size * (a - 1.25 * 5e-5), max_relative = 0.01);
    // Maxwell: pi X^2 Im Z.
    let maxwell = Law::Relaxing { tau: 0.05, x1: a };
    let z = maxwell.linear(TAU * f).unwrap();
    assert_relative_eq!(loss(maxwell), PI * a * a * size * z.im, max_relative = 1e-6);
    // Hard free play of a plain spring: k (X - g/2) at the top, no loss.
    let stiff = Bench { params: vec![2e4], ..one() };
    let gap = Planted { effect: String::new(), hidden: Hidden::Gap, size: 0.4, place: 0 };
    let force = connector::march(&stiff, &stiff.params, &[gap], (f, a, 0.0), (4, Record::default()), 0.0);
    let top = force.iter().fold(0.0, |t: f64, f| t.max(*f));
    assert_relative_eq!(top, 2e4 * (a - 2e-4), max_relative = 1e-6);
    assert!(work(&force, a).abs() < 1e-3 * 2e4 * a * a);
}

#[test]
fn a_marched_relaxation_is_its_closed_form() {
    let law = Law::Relaxing { tau: 0.03, x1: 1.0 };
    let (w, n) = (TAU * 3.0, 4096);
    let (mut memory, mut force) = (Memory::default(), vec![]);
    for j in 0..10 * n {
        let (sin, cos) = (TAU * j as f64 / n as f64).sin_cos();
        force.push(law.force(Motion { x: sin, v: w * cos, a: 0.0 }, TAU / w / n as f64, &mut memory));
    }
    let z = law.linear(w).unwrap();
    for (j, f) in force[9 * n..].iter().enumerate().step_by(97) {
        let (sin, cos) = (TAU * j as f64 / n as f64).sin_cos();
        assert!((f - z.re * sin - z.im * cos).abs() < 1e-4, "{j}: {f}");
    }
}

#[test]
fn the_chain_marches_to_its_frequency_response() {
    let b = Bench { bodies: 5, mass: 0.1, params: vec![2e5, 60.0, 1.5e5, 40.0], force: 50.0, travel: 4e-4, parts: vec![] };
    let slack = planted(Law::Relaxing { tau: 3e-3, x1: b.travel }, 0.5);
    let slack = Planted { place: 2, ..slack };
    let (f, a) = (20.0, 50.0);
    let x = &chain::march(&b, &b.params, std::slice::from_ref(&slack), (f, a, 0.0), (30, SAMPLES), &[3])[0];
    let last = &x[x.len() - SAMPLES..];
    let h: Complex64 = chain::accelerance(&b, &b.params, std::slice::from_ref(&slack), 3, f) / -(TAU * f).powi(2);
    let got: Complex64 = last
        .iter()
        .enumerate()
        .map(|(j, x)| x * Complex64::from_polar(2.0 / SAMPLES as f64, -TAU * j as f64 / SAMPLES as f64))
        .sum::<Complex64>()
        * Complex64::i();
    assert!((got / a - h).norm() < 2e-3 * h.norm(), "{} {h}", got / a);
}

#[test]
fn a_case_follows_from_seed_and_index() {
    let options = Options { seed: 7, kinds: vec![], structure: Structure::Both, ..Options::default() };
    let read = |folder: &Path| {
        let mut all: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder.join("data"))
            .unwrap()
            .map(|e| e.unwrap().path())
            .map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&p).unwrap()))
            .collect();
        all.sort();
        all
    };
    let (a, b, c) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    write_case(&options, 3, None, a.path()).unwrap();
    write_case(&options, 3, None, b.path()).unwrap();
    write_case(&options, 13, None, c.path()).unwrap();
    assert!(read(a.path()) == read(b.path()) && read(a.path()) != read(c.path()));
}

#[test]
fn what_is_hidden_can_be_seen() {
    for structure in [Structure::Connector, Structure::Sparse, Structure::Chain] {
        let options = Options { seed: 11, kinds: vec![], structure, ..Options::default() };
        for index in 0..10 {
            let made = generate(&options, index);
            let hidden = made.planted.len() + usize::from(made.instrument.is_some());
            assert!(hidden == 0 || made.noncentrality >= NONCENTRALITY, "{index}: {} {:?}", made.noncentrality, made.planted);
            let finite = made.tests.iter().all(|t| {
                made.bench.read(&made.bench.params, &made.planted, &[], &made.tests, t).channels.iter().flatten().all(|v| v.is_finite())
            });
            assert!(finite, "{index}: {:?}", made.planted);
        }
    }
}

#[test]
fn a_trial_cut_short_goes_on_and_a_bad_line_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options { seed: 5, kinds: vec![Kind::None], structure: Structure::Connector, ..Options::default() };
    let kept = Kept::create(folder.path(), &options).unwrap();
    let made = generate(&options, 0);
    let error = crate::model::ModelError::invalid("x", "made up", "nothing").into();
    kept.add(&judge::judge(Kind::None, 0, &made, Err(&error), 0.0)).unwrap();
    assert!(matches!(Kept::create(folder.path(), &options), Err(TrialError::Resume { .. })));
    let path = folder.path().join("cases.jsonl");
    let whole = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, format!("{whole}{{\"index\":1,")).unwrap();
    let (_, back, done) = Kept::resume(folder.path()).unwrap();
    assert!(back == options && done.len() == 1 && done[0].verdict == "failed");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), whole, "the half line is gone");
    std::fs::write(&path, format!("{whole}nonsense\n")).unwrap();
    assert!(matches!(Kept::resume(folder.path()), Err(TrialError::Resume { line: Some(3), .. })));
}

/// A hit of a chain of one body: the ringing of an oscillator, from the convolution in closed form.
#[test]
fn a_hit_rings_as_the_closed_form_says() {
    let (k, m) = (2e5, 0.1);
    let b = Bench { bodies: 1, mass: m, params: vec![k, 0.0, k, 0.0], force: 50.0, travel: 4e-4, parts: vec![] };
    let w = f64::sqrt(k / m);
    let (length, peak, dt) = (0.5 * TAU / w * 0.8, 30.0, TAU / w / 400.0);
    let hit = |t: f64| if t < length { peak * (PI * t / length).sin() } else { 0.0 };
    let x = &chain::ring(&b, &b.params, &[], &hit, dt, 1200, &[1])[0];
    // x = (P/m) / (W^2 - w^2) (W/w sin w t - sin W t) while it lasts, twice that shifted by its length after.
    let drive = PI / length;
    let during = |t: f64| peak / m / (drive * drive - w * w) * (drive / w * (w * t).sin() - (drive * t).sin());
    let after = |t: f64| peak / m / (drive * drive - w * w) * drive / w * ((w * t).sin() + (w * (t - length)).sin());
    let size = x.iter().fold(0.0f64, |s, x| s.max(x.abs()));
    for (j, x) in x.iter().enumerate().step_by(37) {
        let t = j as f64 * dt;
        let want = if t < length { during(t) } else { after(t) };
        assert!((x - want).abs() < 5e-3 * size, "{t}: {x} {want}");
    }
}

/// A relaxing branch at one place and an inertance at another, which a springpot takes for itself one at a time, and slack of dampers before
/// either is there; a compliance that stands as a relaxing branch one connector off until a loss at the base is there; a gain of one
/// channel, which costs the select tests next to nothing.
#[test]
fn two_at_once_a_neighbour_exchanged_and_a_gain_of_one_test_are_found() {
    let both = Options { seed: 424_243, kinds: vec![], structure: Structure::Both, ..Options::default() };
    let two = run_case(&both, 23, &Monitor::default()).unwrap().unwrap();
    assert!(two.truth.len() == 2 && two.strict && two.extra == 0, "{:?} {:?}", two.truth, two.said);
    let pairs = Options { seed: 5, kinds: vec![Kind::Two], structure: Structure::Chain, ..Options::default() };
    let exchanged = run_case(&pairs, 43, &Monitor::default()).unwrap().unwrap();
    assert!(exchanged.strict && exchanged.extra == 0, "{:?} {:?}", exchanged.truth, exchanged.said);
    let chains = Options { seed: 777, kinds: vec![], structure: Structure::Chain, ..Options::default() };
    let gain = run_case(&chains, 7, &Monitor::default()).unwrap().unwrap();
    assert!(gain.strict && gain.said == ["gain at frf-1.response"], "{:?} {:?}", gain.truth, gain.said);
}
