//! Modal parameters from FRFs.
//!
//! 1. Poly-reference least-squares complex frequency (pLSCF): a right matrix-fraction model in the z domain, for a rising order; its poles make the
//!    stabilisation diagram (Peeters, Van der Auweraer, Guillaume, Leuridan, "The PolyMAX frequency-domain method", Shock and Vibration 11, 2004).
//! 2. Poles that stay over many orders are picked by themselves.
//! 3. The picked poles are refined to the least squares of the FRFs weighted with their sigma, residues and residual terms eliminated in every step
//!    (variable projection; Golub and Pereyra, 1973). Poles the data do not need are dropped. The covariance of that fit gives the intervals.
//!
//! H_j(w) = sum_m r_mj / (i w - s_m) + conj(r_mj) / (i w - conj(s_m)) + u_j - l_j / w^2, receptance; s = -zeta w0 + i w0 sqrt(1 - zeta^2).

mod lscf;
mod pick;
mod refine;
mod shape;

pub use lscf::StablePole;
pub use shape::{mac, phase_collinearity};

use crate::data::Frf;
use num_complex::Complex64;
use std::f64::consts::TAU;

/// FRFs of one structure at the same frequencies, as receptances.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfSet {
    /// Hz, ascending, above 0.
    pub frequency: Vec<f64>,
    pub outputs: usize,
    pub inputs: usize,
    /// `h[o * inputs + i][k]`: response o over force i at line k.
    pub h: Vec<Vec<Complex64>>,
    /// Standard deviation of the real part, and of the imaginary part, of each value.
    pub sigma: Vec<Vec<f64>>,
}

/// How the fit is done.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Hz; none: all lines.
    pub band: Option<(f64, f64)>,
    /// Highest order of the z polynomial.
    pub max_order: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { band: None, max_order: 36 }
    }
}

/// A mode, one standard deviation beside frequency and damping.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency |s| / 2 pi, Hz.
    pub frequency: f64,
    pub frequency_sigma: f64,
    /// Damping ratio -Re s / |s|.
    pub damping: f64,
    pub damping_sigma: f64,
    /// Complex shape at the outputs, its greatest component 1.
    pub shape: Vec<Complex64>,
    /// Participation of the inputs: residue matrix = shape * participation'.
    pub participation: Vec<Complex64>,
    /// 1 - modal phase collinearity: 0 for a shape whose points move in phase, which is taken where the data do not object to it.
    pub complexity: f64,
    /// Orders of the stabilisation diagram in which its pole stands.
    pub orders: usize,
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalFit {
    /// Ascending in frequency.
    pub modes: Vec<Mode>,
    /// Every pole of the stabilisation diagram.
    pub diagram: Vec<StablePole>,
    /// Weighted sum of squares over degrees of freedom: 1 where the model leaves only the noise.
    pub chi_squared: f64,
    /// Rms of the difference over rms of the FRFs.
    pub error: f64,
}

/// Why there is no fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModalFitError {
    #[error("no FRFs")]
    Empty,
    #[error("FRFs of unlike length or number: {0}")]
    Shape(String),
    #[error("{lines} lines in the band, and a fit needs at least {needed}")]
    Lines { lines: usize, needed: usize },
    #[error("line {line} of FRF {frf} is not finite, or its sigma is not above 0")]
    Value { frf: usize, line: usize },
    #[error("frequencies that do not ascend from above 0")]
    Frequencies,
}

impl ModalFitError {
    pub fn accepted(&self) -> &'static str {
        match self {
            Self::Empty => "at least one FRF",
            Self::Shape(_) => "FRFs over the same frequencies, one for every pair of output and input",
            Self::Lines { .. } => "a wider band or a finer resolution",
            Self::Value { .. } => "finite values with a sigma above 0",
            Self::Frequencies => "frequencies above 0 Hz that ascend",
        }
    }
}

impl FrfSet {
    /// The FRFs of tests, all over the same lines; one for every pair of places.
    pub fn from_frfs(frfs: &[&Frf]) -> Result<Self, ModalFitError> {
        let first = frfs.first().ok_or(ModalFitError::Empty)?;
        let places = |pick: fn(&Frf) -> &str| {
            let mut all: Vec<&str> = Vec::new();
            frfs.iter().for_each(|f| {
                if !all.contains(&pick(f)) {
                    all.push(pick(f));
                }
            });
            all
        };
        let (responds, excites) = (places(|f| &f.respond), places(|f| &f.excite));
        let from = first.frequency.iter().take_while(|f| **f <= 0.0).count();
        let (mut h, mut sigma) = (Vec::new(), Vec::new());
        for respond in &responds {
            for excite in &excites {
                let mut found = frfs.iter().filter(|f| f.respond == *respond && f.excite == *excite);
                let f = match (found.next(), found.next()) {
                    (Some(f), None) => f,
                    (Some(_), Some(_)) => return Err(ModalFitError::Shape(format!("{respond} over {excite} is there twice"))),
                    (None, _) => return Err(ModalFitError::Shape(format!("{respond} over {excite} is missing"))),
                };
                if f.frequency != first.frequency {
                    return Err(ModalFitError::Shape(format!("{} and {} stand over different lines", first.test, f.test)));
                }
                h.push(f.receptance[from..].to_vec());
                sigma.push(f.receptance_sigma[from..].to_vec());
            }
        }
        Ok(Self { frequency: first.frequency[from..].to_vec(), outputs: responds.len(), inputs: excites.len(), h, sigma })
    }

    fn band(&self, band: Option<(f64, f64)>) -> Result<Self, ModalFitError> {
        let columns = self.outputs * self.inputs;
        if columns == 0 || self.frequency.is_empty() {
            return Err(ModalFitError::Empty);
        }
        if self.h.len() != columns || self.sigma.len() != columns {
            return Err(ModalFitError::Shape(format!("{} columns for {} outputs and {} inputs", self.h.len(), self.outputs, self.inputs)));
        }
        if self.frequency[0] <= 0.0 || self.frequency.windows(2).any(|w| w[1].is_nan() || w[1] <= w[0]) {
            return Err(ModalFitError::Frequencies);
        }
        let n = self.frequency.len();
        for (j, (h, s)) in self.h.iter().zip(&self.sigma).enumerate() {
            if h.len() != n || s.len() != n {
                return Err(ModalFitError::Shape(format!("FRF {} has {} lines of {n}", j + 1, h.len())));
            }
            if let Some(line) = (0..n).find(|k| !(h[*k].is_finite() && s[*k] > 0.0 && s[*k].is_finite())) {
                return Err(ModalFitError::Value { frf: j + 1, line: line + 1 });
            }
        }
        let (low, high) = band.unwrap_or((0.0, f64::INFINITY));
        let from = self.frequency.partition_point(|f| *f < low);
        let to = self.frequency.partition_point(|f| *f <= high);
        if to.saturating_sub(from) < NEEDED {
            return Err(ModalFitError::Lines { lines: to.saturating_sub(from), needed: NEEDED });
        }
        let cut = |v: &Vec<Complex64>| v[from..to].to_vec();
        Ok(Self {
            frequency: self.frequency[from..to].to_vec(),
            outputs: self.outputs,
            inputs: self.inputs,
            h: self.h.iter().map(cut).collect(),
            sigma: self.sigma.iter().map(|s| s[from..to].to_vec()).collect(),
        })
    }
}

/// Lines at least.
const NEEDED: usize = 24;

/// Fits the modes of a set of FRFs.
pub fn fit(set: &FrfSet, settings: &Settings) -> Result<ModalFit, ModalFitError> {
    fit_with_parts(set, &[], settings).map(|(fit, _)| fit)
}

/// Frequency (Hz) and damping ratio of each mode of a fit, refined anew on a part of its data.
pub(super) type InPart = Vec<(f64, f64)>;

/// The fit, and frequency (Hz) and damping ratio of each of its modes refined anew on each of `parts`, sets over the same lines.
pub(super) fn fit_with_parts(set: &FrfSet, parts: &[FrfSet], settings: &Settings) -> Result<(ModalFit, Vec<InPart>), ModalFitError> {
    let set = set.band(settings.band)?;
    let order = settings.max_order.min(set.frequency.len() / 3).max(4);
    let mut diagram = lscf::diagram(&set, order);
    let candidates = pick::pick(&mut diagram, order);
    let refined = refine::refine(&set, &candidates);
    let mut reported: Vec<usize> = (0..refined.poles.len()).filter(|k| refined.poles[*k].reported).collect();
    reported.sort_by(|a, b| refined.poles[*a].pole.norm().total_cmp(&refined.poles[*b].pole.norm()));
    let modes: Vec<Mode> = reported.iter().map(|k| shape::mode(&set, &refined.poles[*k])).collect();
    let mut again = Vec::with_capacity(parts.len());
    for part in parts {
        let poles = refine::again(&part.band(settings.band)?, &refined.poles);
        again.push(reported.iter().map(|k| of_pole(poles[*k])).collect());
    }
    Ok((ModalFit { modes, diagram, chi_squared: refined.chi_squared, error: refined.error }, again))
}

/// Undamped frequency (Hz) and damping ratio of a pole.
pub(super) fn of_pole(s: Complex64) -> (f64, f64) {
    let w = s.norm();
    (w / TAU, if w > 0.0 { -s.re / w } else { 0.0 })
}

#[cfg(test)]
pub(super) mod tests;
