//! One damped mode.

use std::f64::consts::TAU;

use num_complex::Complex64;

/// One damped mode.
#[derive(Clone, Debug)]
pub struct Mode {
    /// `|s| / 2 pi` [Hz].
    pub frequency_hz: f64,
    /// Damping ratio `-Re(s) / |s|`; 0 for a rigid-body mode.
    pub damping: f64,
    /// Eigenvalue s [1/s], `Im(s) >= 0`.
    pub lambda: Complex64,
    /// Displacements of all degrees of freedom, scaled to `phi' Z'(s) phi = 2 s` (undamped: `phi' M phi = 1`), rigid-body modes to
    /// `phi' M phi = 1`.
    pub shape: Vec<Complex64>,
    /// Derivative of the eigenvalue with respect to each free parameter; empty unless asked for. Of a repeated eigenvalue it is the
    /// one along the shape found.
    pub dlambda: Vec<Complex64>,
}

/// Damping ratio above which a pole is real to rounding.
const REAL: f64 = 1.0 - 1e-9;

impl Mode {
    /// Whether it swings: neither a rigid-body mode nor a real pole, which no modal test shows as a mode.
    pub fn oscillates(&self) -> bool {
        self.frequency_hz > 0.0 && self.damping < REAL
    }

    /// Whether it is a real pole of a motion beyond its critical damping.
    pub fn creeps(&self) -> bool {
        self.frequency_hz > 0.0 && self.damping >= REAL
    }

    /// Derivative of [`Mode::frequency_hz`] with respect to a free parameter.
    pub fn frequency_slope(&self, k: usize) -> f64 {
        self.size_slope(k) / TAU
    }
    /// Derivative of [`Mode::damping`] with respect to a free parameter.
    pub fn damping_slope(&self, k: usize) -> f64 {
        let size = self.lambda.norm();
        if size == 0.0 { 0.0 } else { (self.lambda.re / size * self.size_slope(k) - self.dlambda[k].re) / size }
    }
    fn size_slope(&self, k: usize) -> f64 {
        let size = self.lambda.norm();
        if size == 0.0 { 0.0 } else { (self.lambda.conj() * self.dlambda[k]).re / size }
    }
}
