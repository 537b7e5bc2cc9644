use super::*;
use nalgebra::{DMatrix, SymmetricEigen};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(in crate::data) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random::<f64>().max(1e-300), rng.random());
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

/// Modes in closed form: frequency (Hz), damping ratio, shape at the outputs, participation at the inputs.
struct Truth {
    modes: Vec<(f64, f64, Vec<f64>, Vec<f64>)>,
}

impl Truth {
    /// Receptances over `lines`, with noise of `noise` of the rms of each FRF (absolute) or of each value.
    fn measure(&self, lines: &[f64], noise: f64, relative: bool, rng: &mut ChaCha8Rng) -> FrfSet {
        let (outputs, inputs) = (self.modes[0].2.len(), self.modes[0].3.len());
        let (mut h, mut sigma) = (Vec::new(), Vec::new());
        for o in 0..outputs {
            for i in 0..inputs {
                let at = |f: &f64| {
                    let w = TAU * f;
                    let one = |m: &(f64, f64, Vec<f64>, Vec<f64>)| {
                        let w0 = TAU * m.0;
                        Complex64::from(m.2[o] * m.3[i]) / Complex64::new(w0 * w0 - w * w, 2.0 * m.1 * w0 * w)
                    };
                    self.modes.iter().map(one).sum::<Complex64>()
                };
                let clean: Vec<Complex64> = lines.iter().map(at).collect();
                let rms = (clean.iter().map(|h| h.norm_sqr()).sum::<f64>() / lines.len() as f64).sqrt();
                let s: Vec<f64> = clean.iter().map(|h| noise * if relative { h.norm() } else { rms } / 2f64.sqrt()).collect();
                h.push(clean.iter().zip(&s).map(|(h, s)| h + Complex64::new(normal(rng), normal(rng)) * *s).collect());
                sigma.push(s);
            }
        }
        FrfSet { frequency: lines.to_vec(), outputs, inputs, h, sigma }
    }

    fn inside(&self, lines: &[f64]) -> Vec<&(f64, f64, Vec<f64>, Vec<f64>)> {
        let mut all: Vec<_> = self.modes.iter().filter(|m| m.0 > lines[0] && m.0 < lines[lines.len() - 1]).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all
    }
}

/// A chain of 22 parts held at one end, modal damping flat at 5.5 %: 1 input, 8 outputs. Five modes below 1300 Hz, the sixth not far above.
fn chain() -> Truth {
    let (n, m, k) = (22, 0.01, 3.0e7);
    let spring = |a: usize| k * (1.0 + 0.1 * (a as f64 * 1.3).sin()) / m;
    let stiffness = DMatrix::from_fn(n, n, |a, b| match a.abs_diff(b) {
        0 => spring(a) + if a + 1 == n { 0.0 } else { spring(a + 1) },
        1 => -spring(a.max(b)),
        _ => 0.0,
    });
    let eigen = SymmetricEigen::new(stiffness);
    let outputs = [1usize, 4, 7, 10, 13, 16, 19, 21];
    let modes = (0..n)
        .map(|r| {
            let v = eigen.eigenvectors.column(r);
            let shape = outputs.iter().map(|o| v[*o] / m.sqrt()).collect();
            (eigen.eigenvalues[r].max(0.0).sqrt() / TAU, 0.055, shape, vec![v[21] / m.sqrt()])
        })
        .collect();
    Truth { modes }
}

fn table(fit: &ModalFit) -> String {
    let row = |m: &Mode| {
        format!(
            "  {:9.3} +- {:.3} Hz, {:.4} +- {:.4}, complexity {:.4}, {} orders\n",
            m.frequency, m.frequency_sigma, m.damping, m.damping_sigma, m.complexity, m.orders
        )
    };
    format!("chi2 {:.3}, error {:.4}\n{}", fit.chi_squared, fit.error, fit.modes.iter().map(row).collect::<String>())
}

fn check(truth: &Truth, lines: &[f64], fit: &ModalFit, frequency: f64, damping: f64) {
    let inside = truth.inside(lines);
    assert_eq!(fit.modes.len(), inside.len(), "{}truth {:?}", table(fit), inside.iter().map(|m| m.0).collect::<Vec<_>>());
    for (m, t) in fit.modes.iter().zip(inside) {
        let shape: Vec<Complex64> = t.2.iter().map(|x| Complex64::from(*x)).collect();
        assert!((m.frequency / t.0 - 1.0).abs() < frequency, "{} against {}\n{}", m.frequency, t.0, table(fit));
        assert!((m.damping / t.1 - 1.0).abs() < damping, "{} against {}\n{}", m.damping, t.1, table(fit));
        assert!(mac(&m.shape, &shape) > 0.99, "MAC {} at {}", mac(&m.shape, &shape), t.0);
    }
}

#[test]
fn modes_of_a_chain_of_22_parts() {
    let truth = chain();
    let mut sorted: Vec<f64> = truth.modes.iter().map(|m| m.0).collect();
    sorted.sort_by(f64::total_cmp);
    let high = 0.5 * (sorted[4] + sorted[5]);
    let lines: Vec<f64> = (1..=800).map(|k| high * f64::from(k) / 800.0).collect();
    let mut covered = [0; 3];
    for (seed, relative) in [(1, false), (2, true)] {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let set = truth.measure(&lines, 0.01, relative, &mut rng);
        let clock = std::time::Instant::now();
        let fit = fit(&set, &Settings::default()).unwrap();
        println!("{} ms, relative {relative}\n{}", clock.elapsed().as_millis(), table(&fit));
        check(&truth, &lines, &fit, 5e-4, 0.03);
        for (m, t) in fit.modes.iter().zip(truth.inside(&lines)) {
            covered[0] += 1;
            covered[1] += usize::from((m.frequency - t.0).abs() < 1.96 * m.frequency_sigma);
            covered[2] += usize::from((m.damping - t.1).abs() < 1.96 * m.damping_sigma);
        }
    }
    println!("covered {covered:?}");
    // 10 intervals of each: fewer than 7 inside has a chance near 1e-3.
    assert!(covered[1] >= 7 && covered[2] >= 7, "{covered:?}");
}

/// Residues r / (i w - s) + conj: imaginary ones are those of a normal mode. One of the two is turned by 12 degrees at its second output.
#[test]
fn a_shape_that_turns_stays_complex_and_one_that_does_not_is_real() {
    let lines: Vec<f64> = (0..500).map(|k| 50.0 + f64::from(k) * 0.3).collect();
    let poles = [(90.0, 0.02, 0.0), (150.0, 0.015, 12f64.to_radians())];
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let sigma = 1e-8;
    let at = |f: f64, o: usize| -> Complex64 {
        let one = |(f0, zeta, turn): (f64, f64, f64)| {
            let s = TAU * f0 * Complex64::new(-zeta, (1.0 - zeta * zeta).sqrt());
            let size = [1.0, -0.7, 0.4][o] / (2.0 * s.im);
            let r = Complex64::new(0.0, -size) * Complex64::from_polar(1.0, if o == 1 { turn } else { 0.0 });
            let w = Complex64::new(0.0, TAU * f);
            r / (w - s) + r.conj() / (w - s.conj())
        };
        poles.into_iter().map(one).sum()
    };
    let noisy =
        |o: usize, rng: &mut ChaCha8Rng| lines.iter().map(|f| at(*f, o) + Complex64::new(normal(rng), normal(rng)) * sigma).collect();
    let h = (0..3).map(|o| noisy(o, &mut rng)).collect();
    let set = FrfSet { frequency: lines.clone(), outputs: 3, inputs: 1, h, sigma: vec![vec![sigma; lines.len()]; 3] };
    let found = fit(&set, &Settings::default()).unwrap();
    assert_eq!(found.modes.len(), 2, "{}", table(&found));
    let [straight, turned] = [&found.modes[0], &found.modes[1]];
    assert_eq!(straight.complexity, 0.0);
    let angle = (-turned.shape[1] / turned.shape[0]).arg().to_degrees();
    assert!((angle - 12.0).abs() < 1.0, "{angle} {}", table(&found));
    for (m, (f, z, _)) in found.modes.iter().zip(poles) {
        assert!((m.frequency - f).abs() < 3.0 * m.frequency_sigma && (m.damping - z).abs() < 3.0 * m.damping_sigma, "{}", table(&found));
    }
}

#[test]
fn two_close_modes_are_both_found() {
    let truth = Truth {
        modes: vec![
            (100.0, 0.02, vec![1.0, 0.6, -0.3], vec![1.0]),
            (101.5, 0.02, vec![0.8, -0.9, 0.5], vec![0.9]),
            (160.0, 0.01, vec![0.5, 0.7, 0.9], vec![0.6]),
        ],
    };
    let lines: Vec<f64> = (0..600).map(|k| 60.0 + f64::from(k) * 0.25).collect();
    for seed in 0..4 {
        let set = truth.measure(&lines, 0.01, seed % 2 == 0, &mut ChaCha8Rng::seed_from_u64(seed));
        let fit = fit(&set, &Settings::default()).unwrap();
        println!("{}", table(&fit));
        check(&truth, &lines, &fit, 2e-3, 0.1);
    }
}

#[test]
fn two_inputs_and_a_free_structure() {
    let truth = Truth {
        modes: vec![
            (0.01, 0.0, vec![1.0, 1.0, 1.0, 1.0], vec![1.0, 1.0]),
            (120.0, 0.01, vec![1.0, 0.3, -0.5, -1.0], vec![1.0, 0.2]),
            (120.9, 0.01, vec![0.4, -1.0, 0.9, -0.2], vec![-0.3, 1.0]),
            (210.0, 0.02, vec![1.0, -0.8, 0.6, 0.9], vec![0.7, 0.8]),
            (420.0, 0.02, vec![0.6, 0.8, -0.9, 1.0], vec![0.5, -0.9]),
        ],
    };
    let lines: Vec<f64> = (0..900).map(|k| 20.0 + f64::from(k) * 0.25).collect();
    let set = truth.measure(&lines, 0.01, true, &mut ChaCha8Rng::seed_from_u64(5));
    let fit = fit(&set, &Settings::default()).unwrap();
    println!("{}", table(&fit));
    check(&truth, &lines, &fit, 1e-3, 0.05);
    let m = &fit.modes[0];
    let ratio = m.participation[1] / m.participation[0];
    assert!((ratio - 0.2).norm() < 0.03, "{ratio}");
}

#[test]
fn noise_alone_has_no_modes() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let n = 400;
    let noise = (0..n).map(|_| Complex64::new(normal(&mut rng), normal(&mut rng))).collect();
    let set =
        FrfSet { frequency: (1..=n).map(f64::from).collect(), outputs: 1, inputs: 1, h: vec![noise], sigma: vec![vec![1.0; n as usize]] };
    assert!(fit(&set, &Settings::default()).unwrap().modes.is_empty());
}

#[test]
fn complexity_and_likeness() {
    let c = |v: &[(f64, f64)]| v.iter().map(|(a, b)| Complex64::new(*a, *b)).collect::<Vec<_>>();
    let (real, turning) = (c(&[(1.0, 1.0), (-2.0, -2.0)]), c(&[(1.0, 0.0), (0.0, 1.0)]));
    assert!((phase_collinearity(&real) - 1.0).abs() < 1e-12 && phase_collinearity(&turning) < 1e-12);
    assert!((mac(&real, &c(&[(1.0, 0.0), (-2.0, 0.0)])) - 1.0).abs() < 1e-12 && mac(&real, &c(&[(2.0, 0.0), (1.0, 0.0)])) < 1e-12);
}

#[test]
fn sets_that_cannot_be_fitted_are_refused() {
    let truth = chain();
    let lines: Vec<f64> = (1..=100).map(f64::from).collect();
    let set = truth.measure(&lines, 0.01, true, &mut ChaCha8Rng::seed_from_u64(1));
    assert!(matches!(
        fit(&set, &Settings { band: Some((10.0, 20.0)), ..Settings::default() }),
        Err(ModalFitError::Lines { lines: 11, .. })
    ));
    let mut bad = set.clone();
    bad.sigma[2][7] = 0.0;
    assert_eq!(fit(&bad, &Settings::default()).unwrap_err(), ModalFitError::Value { frf: 3, line: 8 });
    let mut bad = set.clone();
    bad.h[1].pop();
    assert!(matches!(fit(&bad, &Settings::default()), Err(ModalFitError::Shape(_))));
    let mut bad = set;
    bad.frequency[3] = bad.frequency[2];
    assert_eq!(fit(&bad, &Settings::default()).unwrap_err(), ModalFitError::Frequencies);
}
