//! A model and its measurements made by a program, without a file: `cargo run --release --example own_model`.
//!
//! Two masses on springs and dampers. Measured: the frequency response of the second mass to a force on it, here computed by its closed form with
//! 1 % of noise.

use std::f64::consts::TAU;

use misfit::prelude::*;

/// What is to be found: stiffnesses [N/m] and damping [N s/m] of both connectors.
pub const TRUTH: [(&str, f64); 3] =
    [("base.x.linear_stiffness.k", 2e4), ("joint.x.linear_stiffness.k", 5e4), ("base.x,joint.x.viscous.c", 3.0)];
/// Mass of each body [kg].
const MASS: f64 = 0.5;
/// Noise of a line, as a part of its amount.
const NOISE: f64 = 0.01;

/// The program.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    for p in run()?.parameters {
        println!("{} = {}", p.name, p.printed);
    }
    Ok(())
}

/// The fit.
pub fn run() -> Result<FitResult, Box<dyn std::error::Error>> {
    let bodies = vec![Body::fixed("ground"), Body::new("m1", MASS, &[Axis::X]), Body::new("m2", MASS, &[Axis::X])];
    let model = Model::joined(bodies, &[("base", "ground", "m1"), ("joint", "m1", "m2")])?;
    // Starting values are far off; two places with a comma between share one damping coefficient.
    let system = System::new(model)
        .and("linear_stiffness", "base.x", &[("k", 1e4)])?
        .and("linear_stiffness", "joint.x", &[("k", 1e5)])?
        .and("viscous", "base.x, joint.x", &[("c", 1.0)])?;
    let case = Case::of("two masses", system, &[(measured()?, SplitName::Fit)], 1)?;
    let (_, _, result) = fit(&case, &[SplitName::Fit], &Monitor::default())?;
    Ok(result)
}

/// The test, from arrays.
fn measured() -> Result<Test, Box<dyn std::error::Error>> {
    let [k1, k2, c] = TRUTH.map(|t| t.1);
    let frequency: Vec<f64> = (1..=400).map(|k| 0.25 * f64::from(k)).collect();
    let receptance = |f: &f64| {
        let s = Complex64::new(0.0, TAU * f);
        let (base, joint) = (s * c + k1, s * c + k2);
        let (first, second) = (s * s * MASS + base + joint, s * s * MASS + joint);
        first / (first * second - joint * joint)
    };
    let exact: Vec<Complex64> = frequency.iter().map(receptance).collect();
    // A noise that repeats: a turning phase stands for chance.
    let noisy = exact.iter().enumerate().map(|(k, h)| h * (1.0 + Complex64::from_polar(NOISE, 2.4 * (k * k) as f64))).collect();
    let sigma = exact.iter().map(|h| h.norm() * NOISE / f64::sqrt(2.0)).collect();
    Ok(Test::frf("point frf", "m2.x", "m2.x", FrfQuantity::Receptance, frequency, noisy, sigma)?)
}
