//! Modes from responses whose excitation was not measured (output-only, or operational, modal analysis).
//!
//! Where the excitation is broad, its spectrum flat over each resonance, the correlations of the responses at lags from 0 on are sums of the free decays of
//! the modes, and their transforms (half spectra) have the poles of frequency responses (Peeters and Van der Auweraer, "PolyMAX: a revolution in operational
//! modal analysis", IOMAC 2005). They go through the fit of [`modal_fit`]; shapes come without a scale, masses not at all.
//!
//! ```text
//! R_ij(k) = mean over n of x_i(n + k) x_j(n),        S_ij(w_l) = R(0) / 2 + sum of exp(-b k) R_ij(k) exp(-i w_l k dt),  0 < k < L,  w_l = 2 pi l / (L dt)
//! ```
//!
//! A decay exp(s k dt) makes of it, at these lines exactly, `c / (i W - S) + constant` with `W = 2 / dt tan(w dt / 2)` and `S = 2 / dt tanh((s - b / dt) dt / 2)`: what is
//! fitted are poles over W, so that neither the end of the correlations at lag L nor the sampling moves a pole.
//!
//! The deviations of frequency and damping are those of the jackknife over 16 parts of the record: lines of a half spectrum are not independent, and their
//! scatter alone would promise too much.

mod correlation;

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::channel::Role;
use super::dataset::{Source, only};
use super::modal_fit::{self, FrfSet, ModalFitError, Settings};
use super::tables::{ModalTable, ModeRow, TableValue};
use super::toml_strict::{TableView, TomlError, ValueView};
use super::{Content, DataError};
use crate::units::{Dimension, Unit};

use correlation::{HalfSpectra, PARTS};

/// Channels that others are correlated with, at most: more add columns and little that is new.
const REFERENCES: usize = 4;
/// Lags at most, where the band does not ask for more.
const LAGS: usize = 4096;
/// Lags at least.
const LEAST: usize = 64;
/// Periods of the lower end of the band that the lags are to hold.
const PERIODS: f64 = 30.0;
/// Last line, as a part of the sampling frequency: beyond it filters against aliasing act.
const LAST: f64 = 0.45;
/// Standard deviations that a damping has to lie above zero. A line of the excitation, of a motor or the mains, is a pole without damping.
const ABOVE: f64 = 2.0;

/// A mode with one standard deviation beside frequency and damping.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Found {
    /// Undamped natural frequency, Hz.
    frequency: f64,
    frequency_sigma: f64,
    damping: f64,
    damping_sigma: f64,
}

/// What responses say.
#[derive(Debug, Clone, PartialEq)]
struct Identified {
    /// Ascending in frequency.
    modes: Vec<Found>,
    /// Poles that are none, in words.
    left_out: Vec<String>,
    /// Longest lag, s.
    longest: f64,
}

/// Why they say nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum OutputOnlyError {
    #[error("{samples} samples")]
    Short { samples: usize },
    #[error("a band up to {asked:.4} Hz, where the samples tell frequencies up to {told:.4} Hz")]
    Band { asked: f64, told: f64 },
    #[error("no mode stands in the half spectra{}", left_out.iter().map(|l| format!("; {l}")).collect::<String>())]
    NoMode { left_out: Vec<String> },
    #[error(transparent)]
    Fit(#[from] ModalFitError),
}

impl OutputOnlyError {
    fn accepted(&self) -> String {
        match self {
            Self::Short { .. } => {
                format!("at least {} samples; some thousand periods of the lowest mode tell its damping", LEAST * (PARTS + 1))
            }
            Self::Band { told, .. } => format!("a band that ends at {told:.4} Hz or below"),
            Self::NoMode { .. } => "a longer record, or a band around the resonances".into(),
            Self::Fit(e) => e.accepted().into(),
        }
    }
}

/// A modal test with `output_only = true`.
pub(super) fn modal(table: &TableView<'_>, id: &str, source: &Source<'_>) -> Result<ModalTable, DataError> {
    only(table, &["file", "channels", "output_only", "band", "modes"])?;
    let band = table.optional("band", band)?;
    let numbers = table.optional("modes", numbers)?;
    let record = super::record::unmeasured(table, id, source)?;
    let refuse = |message: String, accepted: String| -> DataError {
        Content { file: record.file.clone(), row: None, test: id.into(), channel: None, message, accepted }.into()
    };
    let (mut responses, mut names) = (Vec::new(), Vec::new());
    for channel in &record.channels {
        let spread = super::record::spread(&channel.values);
        if spread.is_nan() || spread <= 0.0 {
            return Err(refuse(format!("the {} does not vary", channel.label()), "responses that move".into()));
        }
        let mean = channel.values.iter().sum::<f64>() / channel.values.len() as f64;
        responses.push(channel.values.iter().map(|v| (v - mean) / spread).collect::<Vec<f64>>());
        names.push(channel.label());
    }
    let n = record.time.len();
    let step = (record.time[n - 1] - record.time[0]) / (n - 1) as f64;
    let found = identify(&responses, step, band).map_err(|e| refuse(e.to_string(), e.accepted()))?;
    let listed = || found.modes.iter().map(|m| format!("{:.4}", m.frequency)).collect::<Vec<_>>().join(", ");
    let count = found.modes.len();
    let numbers = numbers.unwrap_or_else(|| (1..=count as u32).collect());
    if numbers.len() != count {
        let message = format!("`modes` numbers {}, and {count} were identified: {} Hz", numbers.len(), listed());
        return Err(refuse(
            message,
            "a number for each, in the order of their frequencies; or a band that holds those that are meant".into(),
        ));
    }
    let mut notes = vec![format!(
        "{count} mode(s) at {} Hz, identified from {} without the excitation, which is taken to be flat over each resonance: correlations over {:.4} s, deviations \
         from {PARTS} parts of {:.4} s",
        listed(),
        names.join(", "),
        found.longest,
        step * (n as f64) / PARTS as f64
    )];
    notes.extend(found.left_out);
    notes.extend(record.notes.iter().map(|note| format!("{}: {}", note.about, note.text)));
    let value = |value, sigma, dimension| TableValue { value, unit: Unit::si(dimension), sigma: Some(sigma), rounding: 0.0 };
    let row = |(m, mode): (&Found, u32)| ModeRow {
        mode,
        frequency: value(m.frequency, m.frequency_sigma, Dimension::FREQUENCY),
        damping: Some(value(m.damping, m.damping_sigma, Dimension::DIMENSIONLESS)),
        family: None,
        description: None,
        place: format!("{}, identified mode {mode}", record.file.display()),
    };
    Ok(ModalTable { rows: found.modes.iter().zip(numbers).map(row).collect(), notes })
}

/// Roles of the channels.
pub(super) const ROLES: [Role; 4] = [Role::Time, Role::Displacement, Role::Velocity, Role::Acceleration];

fn band(value: ValueView<'_>) -> Result<(f64, f64), TomlError> {
    let ends = value.list()?.iter().map(|v| v.quantity(Dimension::FREQUENCY).map(|q| q.value)).collect::<Result<Vec<_>, _>>()?;
    match ends[..] {
        [low, high] if low > 0.0 && high > low => Ok((low, high)),
        _ => Err(value.refuse("no band", "its lower and its upper end, such as [\"5 Hz\", \"200 Hz\"]")),
    }
}

fn numbers(value: ValueView<'_>) -> Result<Vec<u32>, TomlError> {
    let list = value.list()?.iter().map(|v| v.integer(1, 1_000_000).map(|n| n as u32)).collect::<Result<Vec<_>, _>>()?;
    if list.is_empty() || list.windows(2).any(|w| w[1] <= w[0]) {
        return Err(value.refuse("numbers of modes that do not rise", "the number of each mode found, such as [1, 2, 4]"));
    }
    Ok(list)
}

/// The modes in responses of unit rms, sampled at equal steps [s], in a band [Hz].
fn identify(responses: &[Vec<f64>], step: f64, band: Option<(f64, f64)>) -> Result<Identified, OutputOnlyError> {
    let samples = responses.first().map_or(0, Vec::len);
    let wanted = band.map_or(LAGS, |(low, _)| LAGS.max((PERIODS / (low * step)).min(samples as f64) as usize));
    let lags = (samples / (PARTS + 1)).min(wanted) & !1;
    if lags < LEAST {
        return Err(OutputOnlyError::Short { samples });
    }
    let told = LAST / step;
    if let Some((_, asked)) = band.filter(|b| b.1 > told) {
        return Err(OutputOnlyError::Band { asked, told });
    }
    let spectra = HalfSpectra::of(responses, responses.len().min(REFERENCES), lags);
    let warped = |f: f64| (0.5 * TAU * f * step).tan() / (0.5 * TAU * step);
    let lines = 1..((LAST * lags as f64) as usize).max(2);
    let frequency: Vec<f64> = lines.clone().map(|l| warped(l as f64 / (lags as f64 * step))).collect();
    let set = |h: Vec<Vec<Complex64>>, sigma: &[Vec<f64>]| FrfSet {
        frequency: frequency.clone(),
        outputs: spectra.outputs,
        inputs: spectra.references,
        h: h.into_iter().map(|h| h[lines.clone()].to_vec()).collect(),
        sigma: sigma.iter().map(|s| s[lines.clone()].to_vec()).collect(),
    };
    let sigma = spectra.sigma();
    let all = set(spectra.mean(), &sigma);
    let without: Vec<FrfSet> = (0..PARTS).map(|p| set(spectra.without(p), &sigma)).collect();
    let settings = Settings { band: band.map(|(low, high)| (warped(low), warped(high))), ..Settings::default() };
    let (fit, parts) = modal_fit::fit_with_parts(&all, &without, &settings)?;
    let decay = spectra.decay / step;
    // The pole of the structure for one over the warped frequency.
    let pole = |(frequency, damping): (f64, f64)| {
        let warped = TAU * frequency * Complex64::new(-damping, (1.0 - damping * damping).max(0.0).sqrt());
        let s = (warped * (0.5 * step)).atanh() * (2.0 / step) + decay;
        (s.norm() / TAU, -s.re / s.norm())
    };
    let mut identified = Identified { modes: vec![], left_out: vec![], longest: lags as f64 * step };
    for (k, mode) in fit.modes.iter().enumerate() {
        let (frequency, damping) = pole((mode.frequency, mode.damping));
        let left: Vec<(f64, f64)> = parts.iter().map(|p| pole(p[k])).collect();
        let found = Found {
            frequency,
            damping,
            frequency_sigma: jackknife(left.iter().map(|p| p.0)),
            damping_sigma: jackknife(left.iter().map(|p| p.1)),
        };
        if found.damping > ABOVE * found.damping_sigma && found.frequency_sigma > 0.0 {
            identified.modes.push(found);
        } else {
            identified.left_out.push(format!(
                "a pole at {frequency:.4} Hz with a damping ratio of {:.3} +- {:.3} % is left out: not told from a line of the excitation",
                100.0 * damping,
                100.0 * found.damping_sigma
            ));
        }
    }
    if identified.modes.is_empty() { Err(OutputOnlyError::NoMode { left_out: identified.left_out }) } else { Ok(identified) }
}

/// Standard deviation of what was computed with each part left out in turn (Efron and Tibshirani, An Introduction to the Bootstrap, eq. 11.5).
fn jackknife(left: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = left.clone().count() as f64;
    let mean = left.clone().sum::<f64>() / n;
    ((n - 1.0) / n * left.map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt()
}

#[cfg(test)]
mod tests;
