//! Frequency response at a declared excitation amplitude: harmonic balance over the elements' own laws.
//!
//! Under the force `f(t) = Re(F e^{iwt})` the steady displacement across every place is sought as
//! `x(t) = x_0 + sum_k Re(X_k e^{ikwt})`, `k = 1..H`. Linear elements enter by their complex stiffness at every harmonic; the Fourier
//! coefficients of a nonlinear element's force come from marching its law over a sampled cycle (alternating frequency/time method:
//! Cameron and Griffin, J. Appl. Mech. 56, 1989; Krack and Gross, Harmonic Balance for Nonlinear Vibration Problems, 2019). With the
//! linear structure condensed by block-tridiagonal solves only the displacements across the nonlinear places are unknown:
//!
//! `x_k = x_lin,k - G_k (f_k(x) - z_k x_k)`, `G_k = B' Z(ikw)^-1 B`,
//!
//! where a stand-in stiffness `z_k` is put into `Z` and taken out of the force again, so that a structure that only a nonlinear
//! element holds can be condensed too. Newton's method takes the exact derivatives of the sampled law; each line starts where the two
//! before lead, so a response with several branches is followed in the order of the lines. Where Newton's method fails, the frequency is
//! raised in steps, then the force, at last along the curve of solutions past its folds. Where it ends on a
//! kink of a sampled law, as a play has that closes within a sample, a residual of 1e-4 of the displacements is taken (`balance::ON_A_KINK`). Sensitivities follow from the implicit function theorem at the solution.
//!
//! The mean `x_0` is part of the solution (asymmetric laws). Stuck friction remembers: the loading path goes from rest to the first
//! sample of the cycle, as in [`super::periodic`]. The accuracy is that of the series and of the sampled law; see [`Settings`].

mod aft;
mod backbone;
mod balance;
mod basis;
mod continuation;
mod cycle;
mod expanded;
mod fixed_point;
mod sensitivity;
mod shelf;
mod structure;

pub use backbone::{Backbone, NonlinearMode, Which};
pub use cycle::balanced;
pub use expanded::{Expanded, Standing};

#[cfg(test)]
mod tests;

use crate::model::{Bound, Model};

use super::EngineError;
use super::blocktri::BlockTriError;
use super::frf::Receptance;
use balance::Balance;
use structure::Drive;

/// Resolution of the harmonic balance.
///
/// Against a long march of a three-body chain (`tests::the_response_equals_the_marched_steady_cycle`) the default is off by 1e-7 to
/// 1e-4. With seven harmonics it would be 4e-3 where those of stick-slip beyond the seventh fall near a resonance of the chain.
/// What a law differentiates over samples (film contact, velocity inside a play) is of second order in their distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Highest harmonic of the displacement, at least 1.
    pub harmonics: usize,
    /// Samples of the cycle on which the laws are marched: a power of two, at least 64 and eight per harmonic.
    pub samples: usize,
    /// Change of the displacements, against the largest of their element, at which the balance holds.
    pub tolerance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings { harmonics: 15, samples: 256, tolerance: 1e-12 }
    }
}

/// Computes `H = X_out / F` at the fundamental for the circular frequencies `omega` [rad/s] under a force of `amplitude` (peak) [N or
/// N m] at the degree of freedom `input`; with one input, laid out as [`Receptance`] says.
///
/// # Errors
/// [`EngineError::Request`] for amplitudes, frequencies, degrees of freedom or settings without meaning;
/// [`EngineError::NoHarmonicBalance`] where no steady response is found; [`EngineError::Linear`] where the linear part is singular.
#[allow(clippy::too_many_arguments)]
pub fn at_amplitude(
    model: &Model,
    bound: &Bound,
    omega: &[f64],
    input: usize,
    amplitude: f64,
    outputs: &[usize],
    sensitivities: bool,
    settings: Settings,
) -> Result<Receptance, EngineError> {
    under_forces(model, bound, omega, input, &vec![amplitude; omega.len()], outputs, sensitivities, settings)
}

/// The same under a force of its own at every frequency: a test that was held at one response, or whose drive was recorded.
///
/// # Errors
/// As [`at_amplitude`].
#[allow(clippy::too_many_arguments)]
pub fn under_forces(
    model: &Model,
    bound: &Bound,
    omega: &[f64],
    input: usize,
    forces: &[f64],
    outputs: &[usize],
    sensitivities: bool,
    settings: Settings,
) -> Result<Receptance, EngineError> {
    check(model, omega, input, forces, outputs, settings)?;
    if model.space.is_some() || !bound.loads.is_empty() {
        return Err(EngineError::Request {
            what: "the excitation amplitude of parts that turn far, or under loads that stay,",
            value: forces.first().map_or(String::new(), f64::to_string),
            accepted: "a small signal (no `excitation`), or a cycle or transient test".into(),
        });
    }
    let bound = &bound.apart();
    let mut balance = Balance::new(model, bound, Drive::force(input, forces.first().copied().unwrap_or(1.0)), outputs, settings)?;
    let mut h = Vec::with_capacity(omega.len() * outputs.len());
    let mut dh = Vec::with_capacity(if sensitivities { omega.len() * outputs.len() * bound.n_free } else { 0 });
    for (w, force) in omega.iter().zip(forces) {
        // The motion of the line before is where the next one begins, whatever its force: it changes little from line to line.
        balance.drive = Drive::force(input, *force);
        balance.line(*w)?;
        balance.response(&mut h);
        if sensitivities {
            balance.sensitivities(&mut dh)?;
        }
    }
    Ok(Receptance { h, dh })
}

fn check(model: &Model, omega: &[f64], input: usize, forces: &[f64], outputs: &[usize], settings: Settings) -> Result<(), EngineError> {
    let request = |what, value: String, accepted: &str| Err(EngineError::Request { what, value, accepted: accepted.into() });
    if let Some(force) = forces.iter().find(|f| !(f.is_finite() && **f > 0.0)) {
        return request("the excitation amplitude", force.to_string(), "a finite force above 0 (peak); omit it for a small signal");
    }
    if let Some(w) = omega.iter().find(|w| !(w.is_finite() && **w > 0.0)) {
        return request(
            "a frequency line at a declared amplitude",
            format!("{} Hz", w / std::f64::consts::TAU),
            "finite frequencies above 0",
        );
    }
    let n = model.dofs.len();
    if let Some(&dof) = outputs.iter().chain([&input]).find(|d| **d >= n) {
        return Err(BlockTriError::NoSuchDof { dof, n }.into());
    }
    if settings.harmonics < 1 {
        return request("the highest harmonic", "0".into(), "1 or more");
    }
    if !settings.samples.is_power_of_two() || settings.samples < 64.max(8 * settings.harmonics) {
        let accepted = format!("a power of two, at least {}", 64.max((8 * settings.harmonics).next_power_of_two()));
        return request("the number of samples per cycle", settings.samples.to_string(), &accepted);
    }
    Ok(())
}
