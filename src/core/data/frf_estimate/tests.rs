use super::*;
use crate::data::modal_fit::tests::normal;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A resonator as an exact discrete filter (impulse-invariant), and its frequency response.
struct Resonator {
    dt: f64,
    pole: Complex64,
}

impl Resonator {
    fn new(f: f64, zeta: f64, dt: f64) -> Self {
        let w = TAU * f;
        Self { dt, pole: Complex64::new(-zeta * w, w * (1.0 - zeta * zeta).sqrt()) }
    }

    /// x_k = sum_j Im(exp(s (k - j) dt)) f_j dt.
    fn respond(&self, force: &[f64]) -> Vec<f64> {
        let step = (self.pole * self.dt).exp();
        let mut state = Complex64::default();
        force
            .iter()
            .map(|f| {
                state = state * step + f * self.dt;
                state.im
            })
            .collect()
    }

    fn frf(&self, f: f64) -> Complex64 {
        let z = Complex64::from_polar(1.0, -TAU * f * self.dt);
        let one = |s: Complex64| self.dt / (1.0 - (s * self.dt).exp() * z);
        (one(self.pole) - one(self.pole.conj())) / Complex64::new(0.0, 2.0)
    }
}

fn request(estimator: Estimator, excitation: Excitation, block: usize) -> Request {
    Request { estimator, excitation, block, overload: (None, None) }
}

fn random(seed: u64, noise: (f64, f64)) -> (Resonator, Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let r = Resonator::new(50.0, 0.05, 1e-3);
    let force: Vec<f64> = (0..65_536).map(|_| normal(&mut rng)).collect();
    let clean = r.respond(&force);
    let rms = (clean.iter().map(|x| x * x).sum::<f64>() / clean.len() as f64).sqrt();
    let response = clean.iter().map(|x| x + noise.1 * rms * normal(&mut rng)).collect();
    let force = force.iter().map(|f| f + noise.0 * normal(&mut rng)).collect();
    (r, force, response)
}

#[test]
fn shaker_estimates_with_a_sigma_that_covers() {
    let (mut inside, mut all) = (0, 0);
    for seed in 0..6 {
        let (r, force, response) = random(seed, (0.0, 0.1));
        let e = estimate(1e-3, &force, &response, &request(Estimator::H1, Excitation::Random { overlap: 0.5 }, 2048)).unwrap();
        assert_eq!(e.blocks, 63);
        assert!(e.independent > 0.85 * 63.0 && e.independent < 63.0, "{}", e.independent);
        for k in (20..400).step_by(4) {
            let (truth, d) = (r.frf(e.frequency[k]), e.sigma[k]);
            inside += usize::from((e.h[k] - truth).re.abs() < 1.96 * d) + usize::from((e.h[k] - truth).im.abs() < 1.96 * d);
            all += 2;
        }
    }
    let share = inside as f64 / f64::from(all);
    println!("sigma of H1 covers {share:.3} of {all}");
    assert!((0.90..0.98).contains(&share), "{share}");
}

#[test]
fn each_estimator_is_right_where_its_noise_is() {
    let bias = |noise, estimator| {
        let (r, force, response) = random(9, noise);
        let e = estimate(1e-3, &force, &response, &request(estimator, Excitation::Random { overlap: 0.5 }, 1024)).unwrap();
        let ratio: f64 = (30..80).map(|k| (e.h[k] / r.frf(e.frequency[k])).re).sum::<f64>() / 50.0;
        ratio - 1.0
    };
    // Noise on the force of half its size lowers H1 by 1 / 1.25; noise on the response leaves it.
    assert!((bias((0.5, 0.0), Estimator::H1) + 0.2).abs() < 0.03, "{}", bias((0.5, 0.0), Estimator::H1));
    assert!(bias((0.5, 0.0), Estimator::H2).abs() < 0.03);
    assert!(bias((0.0, 0.3), Estimator::H1).abs() < 0.03);
    let v = bias((0.5, 0.0), Estimator::Hv);
    assert!(v > -0.2 && v < 0.0 && (v + 0.1056).abs() < 0.03, "{v}");
}

/// Ten blows of a half sine of 4 ms.
fn hammer(seed: u64, double: bool, clip: bool) -> (Resonator, Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let r = Resonator::new(80.0, 0.01, 5e-4);
    let mut force = vec![0.0; 42_000];
    for hit in 0..10 {
        let at = 300 + 4100 * hit;
        let size = 100.0 * (1.0 + 0.2 * rng.random::<f64>());
        for k in 0..8 {
            force[at + k] += size * (PI * k as f64 / 8.0).sin();
        }
        if double && hit == 3 {
            for k in 0..8 {
                force[at + 60 + k] += 0.3 * size * (PI * k as f64 / 8.0).sin();
            }
        }
    }
    let mut response: Vec<f64> = r.respond(&force).iter().map(|x| x + 2e-5 * normal(&mut rng)).collect();
    if clip {
        let top = 0.7 * response[4100 * 5..4100 * 6].iter().fold(0.0f64, |m, x| m.max(*x));
        response[4100 * 5..4100 * 6].iter_mut().for_each(|x| *x = x.clamp(-top * 2.0, top));
        let most = response.iter().fold(0.0f64, |m, x| m.max(*x));
        // The converter's limit is the greatest value of the record.
        response.iter_mut().for_each(|x| *x = if *x > top { top } else { *x });
        assert!(most >= top);
    }
    let force = force.iter().map(|f| f + 0.02 * normal(&mut rng)).collect();
    (r, force, response)
}

#[test]
fn hammer_blows_with_an_exponential_window() {
    let (r, force, response) = hammer(1, false, false);
    let decay = decay_to(0.01, 2.0);
    let e = estimate(5e-4, &force, &response, &request(Estimator::H1, Excitation::Hammer { decay }, 4000)).unwrap();
    assert_eq!((e.blocks, e.rejected.len()), (10, 0));
    // The window moves every pole by its decay, exactly.
    let shifted = Resonator { dt: r.dt, pole: r.pole - decay };
    for k in (100..220).step_by(7) {
        let truth = shifted.frf(e.frequency[k]);
        assert!((e.h[k] - truth).norm() < 0.01 * truth.norm() + 5.0 * e.sigma[k], "{} Hz: {} against {truth}", e.frequency[k], e.h[k]);
    }
    let set = crate::data::modal_fit::FrfSet {
        frequency: e.frequency[60..400].to_vec(),
        outputs: 1,
        inputs: 1,
        h: vec![e.h[60..400].to_vec()],
        sigma: vec![e.sigma[60..400].iter().map(|s| s.max(1e-9)).collect()],
    };
    let fit = crate::data::modal_fit::fit(&set, &Default::default()).unwrap();
    let m = fit.modes.iter().min_by(|a, b| (a.frequency - 80.0).abs().total_cmp(&(b.frequency - 80.0).abs())).unwrap();
    let (f, z) = without_window(m.frequency, m.damping, decay);
    println!("with the window {:.5}, without {z:.5}, {f:.4} Hz", m.damping);
    assert!(m.damping > 0.014 && (z - 0.01).abs() < 3e-4 && (f - 80.0).abs() < 0.05, "{z} {f}");
}

#[test]
fn double_hits_and_overloads_are_left_out() {
    let (_, force, response) = hammer(2, true, false);
    let r = request(Estimator::H1, Excitation::Hammer { decay: 2.0 }, 4000);
    let e = estimate(5e-4, &force, &response, &r).unwrap();
    assert_eq!(e.rejected.iter().map(|r| r.reason).collect::<Vec<_>>(), ["a double hit"]);
    assert!(e.notes[0].text.contains("1 of 10"));
    let (_, force, response) = hammer(3, false, true);
    let e = estimate(5e-4, &force, &response, &r);
    let reasons = match &e {
        Ok(e) => e.rejected.iter().map(|r| r.reason).collect::<Vec<_>>(),
        Err(EstimateError::Blocks { rejected, .. }) => {
            vec![if rejected.contains("overloaded") { "the response is overloaded" } else { "" }]
        }
        Err(e) => panic!("{e}"),
    };
    assert!(reasons.contains(&"the response is overloaded"), "{reasons:?}");
    let quiet = vec![0.0; 10_000];
    assert_eq!(estimate(5e-4, &quiet, &quiet, &r).unwrap_err(), EstimateError::NoHits);
    assert!(matches!(estimate(5e-4, &quiet, &quiet[..10], &r), Err(EstimateError::Length { .. })));
    assert!(matches!(estimate(5e-4, &quiet[..100], &quiet[..100], &r), Err(EstimateError::Block { .. })));
}

#[test]
fn a_driven_mass_is_taken_off() {
    // A mass of 2 kg on a spring, 0.3 kg of load cell before it: A = -w^2 / (k - w^2 m).
    let w = TAU * 30.0;
    let a = |m: f64| Complex64::from(-w * w / (1e5 - w * w * m));
    let h = without_driven_mass(&[a(2.3)], &[a(2.3)], 0.3);
    assert!((h[0] - a(2.0)).norm() < 1e-12 * a(2.0).norm());
}
