use super::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn oscillator(f: f64) -> Complex64 {
    let (w, w0, zeta) = (TAU * f, TAU * 80.0, 0.05);
    1.0 / Complex64::new(w0 * w0 - w * w, 2.0 * zeta * w0 * w)
}

#[test]
fn coherence_gives_the_deviation_of_each_part() {
    // n averages of input u (no noise) and output v = H u + noise: H^ = sum u* v / sum |u|^2; the scatter of H^ over many trials against the formula.
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut normal =
        || Complex64::new((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0, (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
    let (h, n, trials) = (Complex64::new(0.6, -0.8), 40, 4000);
    let noise = 0.5;
    let g2 = 1.0 / (1.0 + noise * noise);
    let mut errors = Vec::new();
    for _ in 0..trials {
        let (mut uv, mut uu) = (Complex64::default(), 0.0);
        for _ in 0..n {
            let u = normal();
            uv += u.conj() * (h * u + normal() * noise);
            uu += u.norm_sqr();
        }
        errors.push(uv / uu - h);
    }
    let deviation = |part: fn(&Complex64) -> f64| (errors.iter().map(|e| part(e).powi(2)).sum::<f64>() / trials as f64).sqrt();
    let formula = from_coherence(&[h], &[g2], n)[0];
    for measured in [deviation(|e| e.re), deviation(|e| e.im)] {
        assert!((measured / formula - 1.0).abs() < 0.06, "{measured} {formula}");
    }
}

#[test]
fn scatter_between_lines_gives_the_noise() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut f = 20.0;
    let frequency: Vec<f64> = (0..400)
        .map(|_| {
            f += 0.3 + 0.3 * rng.random::<f64>();
            f
        })
        .collect();
    let s = 0.002 * oscillator(80.0).norm();
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    let h: Vec<Complex64> = frequency.iter().map(|f| oscillator(*f) + Complex64::new(normal(), normal()) * s).collect();
    let sigma = from_scatter(&frequency, &h).unwrap();
    let mean = (sigma.iter().map(|x| x * x).sum::<f64>() / sigma.len() as f64).sqrt();
    assert!((mean / s - 1.0).abs() < 0.12, "{}", mean / s);
    assert!(from_scatter(&frequency[..6], &h).is_none());
    // A floor, and it is said.
    let (mut zero, mut notes) = (vec![0.0; 400], Vec::new());
    floor(&h, &mut zero, &mut notes);
    assert!(zero.iter().all(|s| *s > 0.0) && notes.len() == 1);
}
