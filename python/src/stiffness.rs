//! Small motion of a law that is known by its update alone: its dynamic stiffness from the tangent at rest.

use std::f64::consts::TAU;

use misfit::effect::dispatch::Wanted;
use misfit::effect::{ForceLaw, Inputs, Tangent};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

/// Part of a period that a step takes: the update is seen as continuous to this relative error times 2 pi.
const STEP: f64 = 1e-6;
/// Relative step of the differences by which the stiffness is differentiated.
const DIFFERENCE: f64 = 1e-4;
/// Circular frequency that stands for none [rad/s].
const SLOWEST: f64 = 1e-3;

/// `F/x` of a harmonic motion with complex frequency `s`: displacement, velocity, acceleration and increment of a step are multiples of `x`, states are
/// what one step of the update takes into itself turned by one step.
pub fn stiffness(law: &dyn ForceLaw, s: Complex64, p: &[f64]) -> Complex64 {
    let s = if s.norm() < SLOWEST { Complex64::new(0.0, SLOWEST) } else { s };
    let n = law.info().states;
    let dt = STEP * TAU / s.norm();
    let (mut states, mut t) = (vec![0.0; n], Tangent::default());
    law.tangent(&Inputs::default(), dt, &mut states, p, Wanted::States, &mut t);
    let back = (-s * dt).exp();
    let motion = [Complex64::ONE, s, s * s, Complex64::ONE - back];
    let drive = |row: usize| t.inputs(row).iter().zip(motion).map(|(d, m)| m * *d).sum::<Complex64>();
    if n == 0 {
        return drive(0);
    }
    let matrix = DMatrix::from_fn(n, n, |i, j| Complex64::from(f64::from(i == j)) - back * t.states(1 + i)[j]);
    let right = DVector::from_fn(n, |i, _| drive(1 + i));
    match matrix.lu().solve(&right) {
        Some(now) => drive(0) + (0..n).map(|k| now[k] * back * t.states(0)[k]).sum::<Complex64>(),
        None => Complex64::new(f64::NAN, f64::NAN),
    }
}

/// The stiffness, its derivative with respect to `s`, and those with respect to the parameters, by central differences.
pub fn with_slopes(law: &dyn ForceLaw, s: Complex64, p: &[f64], dp: &mut [Complex64]) -> (Complex64, Complex64) {
    for (k, out) in dp.iter_mut().enumerate() {
        let h = DIFFERENCE * if p[k] == 0.0 { 1.0 } else { p[k].abs() };
        let at = |value: f64| {
            let mut moved = p.to_vec();
            moved[k] = value;
            stiffness(law, s, &moved)
        };
        *out = (at(p[k] + h) - at(p[k] - h)) / (2.0 * h);
    }
    let h = DIFFERENCE * s.norm().max(SLOWEST);
    let ds = (stiffness(law, s + h, p) - stiffness(law, s - h, p)) / (2.0 * h);
    (stiffness(law, s, p), ds)
}
