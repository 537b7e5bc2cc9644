//! Whole records, with velocity and acceleration derived from a sampled displacement.

use super::{Channel, Note, Role};
use realfft::RealFftPlanner;
use std::f64::consts::PI;

/// Power beyond the cutoff in units of the noise floor over the whole band: noise is seldom white, so twice its rms.
const SURPLUS: f64 = 4.0;

/// A whole record, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// s, strictly increasing.
    pub time: Vec<f64>,
    pub channels: Vec<Channel>,
}

/// Bands that the recorded velocity is held against the displacement in.
const BANDS: usize = 12;
/// A band speaks where the displacement has this much more power than its noise floor.
const CLEAR: f64 = 10.0;
/// A recorded velocity has been low-passed where it holds less than this part of what the displacement says it must.
const PASSED: f64 = 0.5;

/// Displacement, velocity and acceleration at the times of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Displacement: as recorded where the velocity is, else smoothed alongside its derivatives.
    pub displacement: Vec<f64>,
    pub velocity: Vec<f64>,
    pub acceleration: Vec<f64>,
    /// Frequency from which the low-pass rolls off, Hz; none when nothing was derived.
    pub cutoff: Option<f64>,
    pub notes: Vec<Note>,
}

/// Why no motion can be derived.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HistoryError {
    #[error("no displacement channel at {at}")]
    NoDisplacement { at: String },
    #[error("velocity and acceleration cannot be derived from {samples} samples")]
    Short { samples: usize },
    #[error("velocity and acceleration cannot be derived from a record that is not sampled uniformly (step {step} s after {time} s)")]
    NotUniform { time: f64, step: f64 },
}

impl HistoryError {
    pub fn accepted(&self) -> String {
        match self {
            Self::NoDisplacement { at } => format!("a channel of role displacement at {at}"),
            Self::Short { .. } => "at least 16 samples".into(),
            Self::NotUniform { .. } => "uniform sampling, or channels of role velocity and acceleration".into(),
        }
    }
}

impl History {
    /// The channel of that role at that place.
    pub fn channel(&self, role: Role, at: &str) -> Option<&Channel> {
        self.channels.iter().find(|c| c.role == role && c.at == at)
    }

    /// Displacement, velocity and acceleration at `at`. Recorded channels win; what is missing is derived from the nearest recorded one:
    /// acceleration from velocity, velocity from displacement.
    pub fn motion(&self, at: &str) -> Result<Motion, HistoryError> {
        let missing = || HistoryError::NoDisplacement { at: at.to_string() };
        let displacement = &self.channel(Role::Displacement, at).ok_or_else(missing)?.values;
        let velocity = self.channel(Role::Velocity, at).map(|c| c.values.clone());
        let acceleration = self.channel(Role::Acceleration, at).map(|c| c.values.clone());
        let mut notes = Vec::new();
        let derived =
            |what: &str, from: &str, cutoff: f64| Note::new(at, format!("{what} derived from the {from}, low-pass at {cutoff:.4} Hz"));
        let (x, v, a, cutoff) = match (velocity, acceleration) {
            (Some(v), Some(a)) => (displacement.clone(), v, a, None),
            (Some(v), None) => {
                if let Some(edge) = self.low_passed(&v, displacement) {
                    let d = self.derivatives(displacement)?;
                    let text = format!(
                        "the recorded velocity has been low-passed below {edge:.4} Hz, where the displacement still moves: not used"
                    );
                    notes.push(Note::new(at, text));
                    notes.push(derived("velocity and acceleration", "displacement", d.cutoff));
                    return Ok(Motion { displacement: d.value, velocity: d.first, acceleration: d.second, cutoff: Some(d.cutoff), notes });
                }
                let d = self.derivatives(&v)?;
                notes.push(derived("acceleration", "velocity", d.cutoff));
                (displacement.clone(), v, d.first, Some(d.cutoff))
            }
            (None, a) => {
                let d = self.derivatives(displacement)?;
                let what = if a.is_some() { "velocity" } else { "velocity and acceleration" };
                notes.push(derived(what, "displacement", d.cutoff));
                (d.value, d.first, a.unwrap_or(d.second), Some(d.cutoff))
            }
        };
        Ok(Motion { displacement: x, velocity: v, acceleration: a, cutoff, notes })
    }

    /// Frequency above which a recorded velocity lacks what the displacement, clear of its own noise, says it must hold. Such a
    /// velocity would hide the inertia of what rings.
    fn low_passed(&self, velocity: &[f64], displacement: &[f64]) -> Option<f64> {
        let n = self.time.len();
        if n < 16 || displacement.len() != n || velocity.len() != n {
            return None;
        }
        let df = (n - 1) as f64 / n as f64 / (self.time[n - 1] - self.time[0]);
        let (x, v) = (windowed_power(displacement)?, windowed_power(velocity)?);
        let (floor, cut) = (floor(&x), cutoff(&x));
        let width = (cut / BANDS).max(1);
        // The window smears the mean and the drift over the first lines.
        (4..cut).step_by(width).find_map(|low| {
            let band = low..(low + width).min(cut);
            let lines = band.len() as f64;
            let clear = x[band.clone()].iter().sum::<f64>() > CLEAR * floor * lines;
            let expected: f64 = band.clone().map(|k| x[k] * (2.0 * PI * k as f64 * df).powi(2)).sum();
            let held: f64 = v[band].iter().sum();
            (clear && held < PASSED * PASSED * expected).then_some(low as f64 * df)
        })
    }

    fn derivatives(&self, values: &[f64]) -> Result<Derivatives, HistoryError> {
        let n = self.time.len();
        if n < 16 {
            return Err(HistoryError::Short { samples: n });
        }
        let dt = (self.time[n - 1] - self.time[0]) / (n - 1) as f64;
        let off = self.time.iter().enumerate().find(|(i, t)| (**t - self.time[0] - *i as f64 * dt).abs() > 0.05 * dt);
        if let Some((i, t)) = off {
            return Err(HistoryError::NotUniform { time: *t, step: self.time[i] - self.time[i.saturating_sub(1)] });
        }
        derivatives(values, dt).ok_or(HistoryError::Short { samples: n })
    }
}

/// A smoothed signal and its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Derivatives {
    pub value: Vec<f64>,
    pub first: Vec<f64>,
    pub second: Vec<f64>,
    /// Frequency from which the low-pass rolls off, Hz.
    pub cutoff: f64,
}

/// Smooths uniformly sampled values and differentiates them.
///
/// The line through the end points is taken off and the rest reflected oddly about both, so that the periodic extension of length
/// 2 (n - 1) is continuous with its slope. Its sine spectrum is cut where no more than noise is left (level: the upper quarter of the
/// band) with a raised-cosine roll-off up to 1.5 times the cutoff. None below 16 samples.
pub fn derivatives(values: &[f64], dt: f64) -> Option<Derivatives> {
    let n = values.len();
    if n < 16 {
        return None;
    }
    let length = 2 * (n - 1);
    let slope = (values[n - 1] - values[0]) / (n - 1) as f64;
    let line = |i: usize| values[0] + slope * i as f64;
    let mut planner = RealFftPlanner::<f64>::new();
    let spectrum = sine_spectrum(values, &mut planner)?;
    let inverse = planner.plan_fft_inverse(length);

    let power: Vec<f64> = spectrum.iter().map(|c| c.norm_sqr()).collect();
    let cut = cutoff(&power);
    let end = ((cut as f64 * 1.5) as usize).min(power.len() - 1).max(cut + 1);
    let weight = |k: usize| match k {
        k if k <= cut => 1.0,
        k if k >= end => 0.0,
        k => 0.5 + 0.5 * (PI * (k - cut) as f64 / (end - cut) as f64).cos(),
    };
    let omega = |k: usize| 2.0 * PI * k as f64 / (length as f64 * dt);
    let back = |order: u32| {
        let mut s: Vec<_> = spectrum.clone();
        for (k, c) in s.iter_mut().enumerate() {
            let w = weight(k) / length as f64;
            *c = match order {
                0 => *c * w,
                1 => num_complex::Complex64::new(-c.im, c.re) * (w * omega(k)),
                _ => *c * (-w * omega(k) * omega(k)),
            };
        }
        // A real signal has real values at both ends of its spectrum; the sine series has none there.
        if let Some(first) = s.first_mut() {
            first.im = 0.0;
        }
        if let Some(last) = s.last_mut() {
            last.im = 0.0;
        }
        let mut out = vec![0.0; length];
        inverse.process(&mut s, &mut out).ok()?;
        out.truncate(n);
        Some(out)
    };
    let (mut value, mut first, second) = (back(0)?, back(1)?, back(2)?);
    value.iter_mut().enumerate().for_each(|(i, v)| *v += line(i));
    first.iter_mut().for_each(|v| *v += slope / dt);
    Some(Derivatives { value, first, second, cutoff: cut as f64 / (length as f64 * dt) })
}

/// Spectrum of the values less the line through their ends, reflected oddly about both.
fn sine_spectrum(values: &[f64], planner: &mut RealFftPlanner<f64>) -> Option<Vec<num_complex::Complex64>> {
    let n = values.len();
    let length = 2 * (n - 1);
    let slope = (values[n - 1] - values[0]) / (n - 1) as f64;
    let mut extended = vec![0.0; length];
    for i in 1..n - 1 {
        let y = values[i] - (values[0] + slope * i as f64);
        extended[i] = y;
        extended[length - i] = -y;
    }
    let forward = planner.plan_fft_forward(length);
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut extended, &mut spectrum).ok()?;
    Some(spectrum)
}

/// Power spectrum of the values less the line through their ends, under a Hann window.
fn windowed_power(values: &[f64]) -> Option<Vec<f64>> {
    let n = values.len();
    let slope = (values[n - 1] - values[0]) / (n - 1) as f64;
    let window = |i: usize| 0.5 - 0.5 * (2.0 * PI * i as f64 / n as f64).cos();
    let mut signal: Vec<f64> = values.iter().enumerate().map(|(i, v)| window(i) * (v - values[0] - slope * i as f64)).collect();
    let forward = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let mut spectrum = forward.make_output_vec();
    forward.process(&mut signal, &mut spectrum).ok()?;
    Some(spectrum.iter().map(|c| c.norm_sqr()).collect())
}

/// Bands into which the spectrum of a record is cut to find the quietest...
const QUIET: usize = 16;
/// ...the lines that each of them holds at least...
const LINES: usize = 24;
/// ...and the part of the band above which the filter against aliasing has taken the noise away (a sampling rate of 2.56 times the highest frequency).
const PASSES: f64 = 2.0 / 2.56;

/// Standard deviations of a band's level by which the quietest is below what it would be of white noise...
const CLEARLY: f64 = 4.0;
/// ...and lines of a Hann window that are one independent line.
const ALIKE: f64 = 1.94;

/// Standard deviation of the noise of a sample, were it white and the quietest band of the record's spectrum nothing else: the median of that band's lines,
/// exponentially distributed, over what the Hann window leaves of a variance of 1, `3 n / 8`. None of records too short for bands, and where the quietest of so many bands
/// is no quieter than that of white noise of `smooth` may be by chance: the median of L independent lines is known to `1 / (ln 2 sqrt(L))` of itself.
pub fn quietest(values: &[f64], smooth: f64) -> Option<f64> {
    if values.len() < 2 * QUIET * LINES {
        return None;
    }
    let power = windowed_power(values)?;
    let passed = (PASSES * power.len() as f64) as usize;
    let lines = power.len() / QUIET;
    let least = power[1..passed].chunks_exact(lines).map(middle).fold(f64::INFINITY, f64::min) / (0.375 * values.len() as f64);
    let chance = (ALIKE / lines as f64).sqrt() / std::f64::consts::LN_2;
    (least * (1.0 + CLEARLY * chance) < smooth * smooth).then(|| least.sqrt())
}

/// Noise power of a line: that over the upper quarter of the band.
fn floor(power: &[f64]) -> f64 {
    middle(&power[power.len() - power.len() / 4..])
}

/// Mean power of lines of noise by their median, which single lines of a signal do not move: of an exponential distribution it is the mean times ln 2.
fn middle(lines: &[f64]) -> f64 {
    let mut lines = lines.to_vec();
    lines.sort_by(f64::total_cmp);
    lines.get(lines.len() / 2).copied().unwrap_or(0.0) / std::f64::consts::LN_2
}

/// The lowest line above which no more is left than noise would leave: the power beyond it is at most `SURPLUS` times what the noise floor
/// holds over the whole band. (A criterion line by line would let a single hum line carry the cutoff up with it.)
fn cutoff(power: &[f64]) -> usize {
    let lines = power.len();
    let floor = floor(power);
    let mut beyond = 0.0;
    let last = (1..lines).rposition(|k| {
        beyond += power[k];
        beyond > SURPLUS * floor * lines as f64
    });
    last.map_or(1, |i| i + 1).clamp(1, lines.saturating_sub(2).max(1))
}

#[cfg(test)]
mod tests;
