use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn rms(v: impl Iterator<Item = f64>) -> f64 {
    let v: Vec<f64> = v.collect();
    (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64).sqrt()
}

#[test]
fn derivatives_of_a_noisy_sine_with_trend() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (dt, w) = (1e-3, 2.0 * PI * 1.3);
    let t: Vec<f64> = (0..6000).map(|i| i as f64 * dt).collect();
    let x: Vec<f64> = t.iter().map(|t| (w * t + 0.4).sin() + 0.2 * (3.0 * w * t).cos() + 0.5 * t).collect();
    let v = |t: f64| w * (w * t + 0.4).cos() - 0.6 * w * (3.0 * w * t).sin() + 0.5;
    let a = |t: f64| -w * w * (w * t + 0.4).sin() - 1.8 * w * w * (3.0 * w * t).cos();
    let inner = 300..5700;
    // Without noise the velocity is good to the ends; the reflection gives the acceleration a jump there.
    let d = derivatives(&x, dt).unwrap();
    assert!(rms(inner.clone().map(|i| d.first[i] - v(t[i]))) < 1e-3 * w, "{}", rms(inner.clone().map(|i| d.first[i] - v(t[i]))));
    let noisy: Vec<f64> = x.iter().map(|x| x + 1e-3 * (rng.random::<f64>() - 0.5) * 12f64.sqrt()).collect();
    let d = derivatives(&noisy, dt).unwrap();
    let ev = rms(inner.clone().map(|i| d.first[i] - v(t[i]))) / w;
    let ea = rms(inner.clone().map(|i| d.second[i] - a(t[i]))) / (w * w);
    let raw = rms(inner.clone().map(|i| (noisy[i + 1] - noisy[i - 1]) / (2.0 * dt) - v(t[i]))) / w;
    assert!(ev < 0.01 && ea < 0.25 && ev < 0.2 * raw, "{ev} {ea} {raw} {}", d.cutoff);
    assert!(d.cutoff > 3.9 && d.cutoff < 40.0, "{}", d.cutoff);
    assert!(derivatives(&x[..15], dt).is_none());
    // Degenerate signals pass through.
    let flat = derivatives(&[2.0; 40], dt).unwrap();
    assert!(flat.value.iter().all(|v| (v - 2.0).abs() < 1e-12) && flat.first.iter().all(|v| v.abs() < 1e-9));
}

#[test]
fn a_velocity_that_was_low_passed_is_not_used() {
    // Drive of 1 Hz with a ring of 60 Hz; the recorded velocity lacks the ring.
    let (n, dt) = (4096, 1.0 / 1024.0);
    let t: Vec<f64> = (0..n).map(|k| k as f64 * dt).collect();
    let (slow, fast) = (2.0 * PI, 120.0 * PI);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let x: Vec<f64> = t.iter().map(|t| 1e-2 * (slow * t).sin() + 1e-4 * (fast * t).sin() + 1e-6 * (rng.random::<f64>() - 0.5)).collect();
    let unit = |text: &str| crate::units::parse_unit_any(text).unwrap();
    let channel = |role, values: &[f64]| {
        let unit = unit(if role == Role::Velocity { "m/s" } else { "m" });
        Channel { role, at: "c1.x".into(), unit, sigma: None, input: false, values: values.to_vec() }
    };
    let record = |v: Vec<f64>| History { time: t.clone(), channels: vec![channel(Role::Displacement, &x), channel(Role::Velocity, &v)] };
    let ring = |t: f64| 1e-4 * fast * (fast * t).cos();
    let whole: Vec<f64> = t.iter().map(|t| 1e-2 * slow * (slow * t).cos() + ring(*t)).collect();
    let passed: Vec<f64> = t.iter().map(|t| 1e-2 * slow * (slow * t).cos()).collect();
    let kept = record(whole.clone()).motion("c1.x").unwrap();
    assert!(kept.velocity == whole, "{:?}", kept.notes);
    let derived = record(passed).motion("c1.x").unwrap();
    assert!(derived.notes.iter().any(|n| n.text.contains("low-passed")), "{:?}", derived.notes);
    let expected: Vec<f64> = t.iter().map(|t| -1e-4 * fast * fast * (fast * t).sin()).collect();
    let middle = n / 4..3 * n / 4;
    let error = rms(middle.clone().map(|k| derived.acceleration[k] - expected[k])) / rms(middle.map(|k| expected[k]));
    assert!(error < 0.15, "{error}");
}

/// White noise on a sine of seven samples a period, where third differences are the sine's: the quietest band knows it. A low-pass against aliasing at the top of
/// the band, where it has taken the noise away, is not taken for quiet.
#[test]
fn the_quietest_band_knows_the_noise_of_a_coarse_record() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let sigma = 0.01;
    let values: Vec<f64> = (0..4000).map(|k| (f64::from(k) * 0.9).sin() + sigma * 12f64.sqrt() * (rng.random::<f64>() - 0.5)).collect();
    let seen = quietest(&values, 0.3).unwrap();
    assert!((0.85..1.05).contains(&(seen / sigma)), "{seen}");
    let smoothed: Vec<f64> = values.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    assert!(quietest(&smoothed, 0.3).unwrap() > 0.3 * sigma);
    assert_eq!(quietest(&values[..200], 0.3), None);
    // Of white noise alone one band in sixteen is the quietest, and says nothing.
    for n in [300, 1000, 4000] {
        let white: Vec<f64> = (0..n).map(|_| sigma * 12f64.sqrt() * (rng.random::<f64>() - 0.5)).collect();
        assert_eq!(quietest(&white, sigma), None, "{n}");
    }
}
