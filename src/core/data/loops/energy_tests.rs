use super::tests::{noise, record};
use super::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// An elastic slider beside a spring: closed loop with W_D = 4 S (A - S / k).
fn slider(x: f64, state: &mut f64, k: f64, limit: f64) -> f64 {
    // state: where the slider sits.
    let f = k * (x - *state);
    let held = f.clamp(-limit, limit);
    *state = x - held / k;
    held
}

/// Samples a loop of that slider finely and keeps every 20th sample.
fn sliding(cycles: f64) -> (TimeRecord, f64) {
    let (amplitude, k, limit, spring) = (2e-3, 5e4, 20.0, 1e4);
    let mut state = 0.0;
    let n = (cycles * 4000.0) as usize;
    // One cycle before the record takes the state to its loop.
    let force: Vec<f64> = (0..n + 4000)
        .map(|i| {
            let x = amplitude * (TAU * i as f64 / 4000.0).sin();
            slider(x, &mut state, k, limit) + spring * x
        })
        .collect();
    let mut r = record(200.0, cycles, Some(1.0), |t| amplitude * (TAU * t).sin(), |_| 0.0);
    r.channels[1].values = (0..r.time.len()).map(|i| force[4000 + 20 * i]).collect();
    (r, 4.0 * limit * (amplitude - limit / k))
}

#[test]
fn dissipated_energy_with_an_interval_that_covers() {
    let (clean, truth) = sliding(10.0);
    let e = settle(&clean).unwrap().energy(None).unwrap();
    assert!((e.dissipated.value / truth - 1.0).abs() < 5e-4, "{} against {truth}", e.dissipated.value);
    // Sampled at 200 points; what is left of the corners is a ten-thousandth.
    let truth = e.dissipated.value;
    let (stored, ratio) = (e.stored_slope.unwrap().value, e.loss_ratio.value);
    let (mut inside, mut worst) = ([0; 3], 0.0f64);
    for seed in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut r = clean.clone();
        // 1 % of half the range of each channel.
        for (c, size) in r.channels.iter_mut().zip([2e-3, 40.0]) {
            c.values.iter_mut().for_each(|v| *v += 0.01 * size * noise(&mut rng));
        }
        let e = settle(&r).unwrap().energy(None).unwrap();
        let covers = |e: Estimate, truth: f64| usize::from((e.value - truth).abs() < 1.96 * e.sigma);
        inside[0] += covers(e.dissipated, truth);
        inside[1] += covers(e.stored_slope.unwrap(), stored);
        inside[2] += covers(e.loss_ratio, ratio);
        worst = worst.max((e.dissipated.value / truth - 1.0).abs());
    }
    println!("W_D within {:.3} %; intervals cover W_D {}, W_s {}, D {} of 200", 100.0 * worst, inside[0], inside[1], inside[2]);
    assert!(worst < 5e-3, "{worst}");
    assert!((180..=196).contains(&inside[0]), "{inside:?}");
}

#[test]
fn control_is_recognised() {
    let (mut r, _) = sliding(6.0);
    let l = settle(&r).unwrap();
    assert_eq!(recognised_control(&l, "c1.x"), Some(super::super::Control::Displacement));
    assert!(findings(&r, &l).is_empty(), "{:?}", findings(&r, &l));
    r.control = Some(super::super::Control::Force);
    assert!(findings(&r, &l).iter().any(|n| n.about == "control"));
}

#[test]
fn gaps_clipping_signs_and_delays_are_found() {
    let text = |r: &TimeRecord| findings(r, &settle(r).unwrap()).iter().map(|n| format!("{}: {}\n", n.about, n.text)).collect::<String>();
    let viscous = || record(200.0, 8.0, Some(1.0), |t| 1e-3 * (TAU * t).sin(), |t| 5.0 * (TAU * t + 0.2).sin());
    assert_eq!(text(&viscous()), "");
    let mut gap = viscous();
    for channel in &mut gap.channels {
        channel.values.drain(500..510);
    }
    gap.time.drain(500..510);
    assert!(text(&gap).contains("1 gaps, about 10 samples missing; the first after sample 500"), "{}", text(&gap));
    let mut clipped = viscous();
    clipped.channels[1].values.iter_mut().for_each(|v| *v = v.min(4.0));
    assert!(text(&clipped).contains("clipped: it stands at 4 N"), "{}", text(&clipped));
    // A coarse converter makes flat peaks of its own: they are none.
    let mut coarse = viscous();
    coarse.channels[1].values.iter_mut().for_each(|v| *v = (*v / 0.05).round() * 0.05);
    assert!(!text(&coarse).contains("clipped"), "{}", text(&coarse));
    let mut swapped = viscous();
    swapped.channels[1].values.iter_mut().for_each(|v| *v = -*v);
    // Of the opposite sign the loop of a spring with damping runs the other way round and falls.
    assert!(text(&swapped).contains("the sign of force or displacement is swapped (scale = -1"), "{}", text(&swapped));
    let mut raised = viscous();
    raised.channels[0].values.iter_mut().for_each(|v| *v += 1.02e-3);
    assert!(text(&raised).contains("to one side of 0, 0.02 mm to 2.02 mm") && text(&raised).contains("centre = true"), "{}", text(&raised));
    raised.channels[0].values.iter_mut().for_each(|v| *v -= 0.04e-3);
    assert_eq!(text(&raised), "");
    let late = record(200.0, 8.0, Some(1.0), |t| 1e-3 * (TAU * t).sin(), |t| 5.0 * (TAU * t - 0.1).sin());
    assert!(text(&late).contains("the force channel is late"), "{}", text(&late));
    let mut velocity = viscous();
    let mut channel = velocity.channels[0].clone();
    channel.role = Role::Velocity;
    channel.input = false;
    channel.values = velocity.time.iter().map(|t| 1e-3 * TAU * (TAU * (t - 0.004)).cos()).collect();
    velocity.channels.push(channel);
    assert!(text(&velocity).contains("the velocity is 4.000 ms"), "{}", text(&velocity));
}

#[test]
fn the_frequency_of_a_long_record() {
    for (n, fs, f) in [(300_000usize, 1000.0, 7.123_456), (1_000_000, 1024.0, 0.037), (400_000, 1000.0, 180.01)] {
        let t: Vec<f64> = (0..n).map(|i| i as f64 / fs).collect();
        let x: Vec<f64> = t.iter().map(|t| (TAU * f * t + 0.3).sin() + 0.2 * (3.0 * TAU * f * t).sin() + 0.5).collect();
        let fit = crate::data::estimate_frequency(&t, &x).unwrap();
        // A thousandth of a cycle over the record.
        assert!((fit.frequency - f).abs() * t[n - 1] < 2e-3, "{} against {f}", fit.frequency);
        assert!((fit.amplitude - 1.0).abs() < 0.02, "{}", fit.amplitude);
    }
}
