//! A chain of bodies from the ground: loops by the leapfrog method, frequency responses by dense complex elimination.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::bench::{Bench, Hidden, Planted};
use super::law::{Memory, Motion};

/// Steps per radian of the fastest mode the chain can have.
const FINE: f64 = 12.0;
/// Cycles over which the drive grows.
const RAMP: f64 = 2.0;

/// Displacement of the given bodies (from 1) at every sample, under a sine of force on the last: frequency, amplitude, mean; so many cycles
/// with so many samples each. The drive grows over [`RAMP`] cycles.
pub fn march(
    b: &Bench,
    params: &[f64],
    planted: &[Planted],
    (frequency, amplitude, mean): (f64, f64, f64),
    (cycles, per_cycle): (usize, usize),
    bodies: &[usize],
) -> Vec<Vec<f64>> {
    let drive = |time: f64| {
        let t = time * frequency;
        let grown = if t < RAMP { 0.5 - 0.5 * (0.5 * TAU * t / RAMP).cos() } else { 1.0 };
        (mean + amplitude * (TAU * t).sin()) * grown
    };
    ring(b, params, planted, &drive, 1.0 / (frequency * per_cycle as f64), cycles * per_cycle, bodies)
}

/// The same under any force from rest, at `samples` samples `between` apart [s].
pub fn ring(
    b: &Bench,
    params: &[f64],
    planted: &[Planted],
    drive: &dyn Fn(f64) -> f64,
    between: f64,
    samples: usize,
    bodies: &[usize],
) -> Vec<Vec<f64>> {
    let n = b.bodies;
    let links: Vec<(f64, f64)> = (0..n).map(|i| b.link(params, i)).collect();
    let masses: Vec<f64> = (0..n).map(|i| b.mass_of(i)).collect();
    let mut laws: Vec<_> = planted
        .iter()
        .filter_map(|p| match &p.hidden {
            Hidden::Force(law) => Some((p.place, law, b.force * p.size, Memory::default())),
            _ => None,
        })
        .collect();
    // Friction that sticks stiffens its connector.
    let stiff =
        laws.iter().filter_map(|l| l.1.small(0.0)).map(|z| b.force * z.norm()).sum::<f64>() + links.iter().map(|l| l.0).fold(0.0, f64::max);
    let fastest = 2.0 * (stiff / masses.iter().copied().fold(f64::INFINITY, f64::min)).sqrt();
    let per_sample = (FINE * fastest * between).ceil().max(1.0) as usize;
    let dt = between / per_sample as f64;
    let (mut x, mut v, mut old) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut force = vec![0.0; n + 1];
    let mut motions = vec![Motion::default(); laws.len()];
    let mut out = vec![Vec::with_capacity(samples); bodies.len()];
    for j in 0..samples * per_sample {
        if j % per_sample == 0 {
            bodies.iter().zip(&mut out).for_each(|(b, out)| out.push(x[*b - 1]));
        }
        // Velocity at the whole step, from the two half steps before it.
        let at = |i: usize| (x[i], 1.5 * v[i] - 0.5 * old[i]);
        motions.fill(Motion::default());
        for i in 0..n {
            let (x1, v1) = at(i);
            let (x0, v0) = if i > 0 { at(i - 1) } else { (0.0, 0.0) };
            let m = Motion { x: x1 - x0, v: v1 - v0, a: 0.0 };
            let (k, c) = links[i];
            force[i] = k * m.x + c * m.v;
            for (slot, _) in motions.iter_mut().zip(&laws).filter(|(_, l)| l.0 == i) {
                *slot = m;
            }
        }
        for (m, (place, law, size, memory)) in motions.iter().zip(&mut laws) {
            force[*place] += *size * law.force(*m, dt, memory);
        }
        let force_now = drive(j as f64 * dt);
        old.copy_from_slice(&v);
        for i in 0..n {
            let load = if i + 1 == n { force_now } else { 0.0 };
            v[i] += dt * (load - force[i] + force[i + 1]) / masses[i];
        }
        x.iter_mut().zip(&v).for_each(|(x, v)| *x += dt * v);
    }
    out
}

/// Acceleration of body `respond` (from 1) over a small force on the last.
pub fn accelerance(b: &Bench, params: &[f64], planted: &[Planted], respond: usize, frequency: f64) -> Complex64 {
    let (n, w) = (b.bodies, TAU * frequency);
    let mut dynamic = DMatrix::<Complex64>::zeros(n, n);
    for i in 0..n {
        let j = if i == 0 { 0 } else { 2 };
        let (k, c) = b.link(params, i);
        let mut z = k + Complex64::i() * w * c;
        for p in planted.iter().filter(|p| p.place == i) {
            match &p.hidden {
                Hidden::Force(law) => z += b.force * p.size * law.small(w).unwrap_or_default(),
                Hidden::Compliance => z /= 1.0 + p.size / b.params[j] * z,
                _ => {}
            }
        }
        dynamic[(i, i)] += z - w * w * b.mass_of(i);
        if i > 0 {
            dynamic[(i - 1, i - 1)] += z;
            dynamic[(i, i - 1)] -= z;
            dynamic[(i - 1, i)] -= z;
        }
    }
    let mut unit = DVector::<Complex64>::zeros(n);
    unit[n - 1] = Complex64::new(1.0, 0.0);
    dynamic.lu().solve(&unit).map_or(Complex64::new(f64::NAN, 0.0), |x| -w * w * x[respond - 1])
}
