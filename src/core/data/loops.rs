//! From a recorded history to the settled loop.
//!
//! The drive frequency is fitted (and held against the declared one), the first cycles are dropped, the complete cycles that remain are put
//! on equal phases and averaged. sigma of a sample is declared, or the pooled scatter between cycles; sigma of the mean is that over the
//! root of the number of cycles. Nothing is taken from a misfit.

mod area;
mod drift;
mod energy;
mod findings;
mod settling;
mod spectrum;

pub use area::RecordedArea;
pub use energy::{Estimate, LoopEnergy};

use super::frequency;
use super::{Channel, FourierInput, Role, TimeRecord};
use crate::units::{Dimension, Quantity, Unit};
use std::f64::consts::TAU;
use std::ops::Range;

pub use settling::Unsettled;
pub use spectrum::{HARMONICS, harmonic_of, harmonics};

/// Points per cycle at most.
const MAX_POINTS: usize = 400;
/// Points per cycle at least: fewer do not show a loop.
const MIN_POINTS: usize = 8;
/// Samples per cycle at least, for cycles to be counted at all (Nyquist).
const MIN_CYCLE_SAMPLES: f64 = 2.0;
/// Declared and measured drive frequency may differ by this much.
const FREQUENCY_TOLERANCE: f64 = 0.02;
/// Cycles at the beginning and the end of a record whose amplitude is below this part of the greatest are its run-up and its run-down.
const RUN_DOWN: f64 = 0.9;
/// Scatter below this part of a channel's range is taken for noise-free data, and floored.
const SCATTER_FLOOR: f64 = 1e-6;

/// A settled cycle: n equidistant phases, averaged over the cycles.
#[derive(Debug, Clone, PartialEq)]
pub struct SettledLoop {
    /// Drive frequency used, Hz.
    pub frequency: f64,
    /// Points per cycle.
    pub n: usize,
    /// Cycles averaged.
    pub cycles: usize,
    /// rad, ascending from [0, 2 pi / n). Phase 0 is where the fundamental of the controlled channel rises through its mean: fundamental = A sin(phase).
    pub phase: Vec<f64>,
    /// Index of the point with which the cycles begin in the record.
    pub first: usize,
    /// Cycles of the record before those that are kept: discarded, and of the run-up.
    pub left_out: usize,
    pub channels: Vec<LoopChannel>,
    /// Index in `channels` of the controlled one.
    pub controlled: usize,
    /// The controlled channel, free of noise.
    pub input: FourierInput,
    /// Areas of the recorded cycles, one for each place with displacement and force that do not drift.
    pub recorded: Vec<RecordedArea>,
    /// Channels whose cycles still change.
    pub unsettled: Vec<Unsettled>,
    pub notes: Vec<Note>,
}

/// A channel of a settled loop, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopChannel {
    pub role: Role,
    /// `name.axis`.
    pub at: String,
    pub unit: Unit,
    /// Mean over the cycles at each phase.
    pub mean: Vec<f64>,
    /// Standard deviation of one sample.
    pub sigma_sample: f64,
    /// Standard deviation of the mean over the cycles.
    pub sigma_mean: f64,
    /// Correlation of the scatter between points 0, 1, 2, ... apart in phase, up to where it is lost in chance; [1] for white noise.
    pub correlation: Vec<f64>,
    /// Variance of a coefficient of the mean cycle ([`harmonics`]), harmonic by harmonic; empty with fewer than three cycles.
    pub scatter: Vec<f64>,
    /// The same above the harmonics that are compared, from the first of these on.
    pub above: Vec<f64>,
    /// Change of its mean per cycle, which was taken out; 0 where none is seen.
    pub drift: f64,
}

impl LoopChannel {
    /// Standard deviation of a point of the mean cycle by what its noise has at harmonic k: that over all harmonics, or more where the scatter between cycles has
    /// more there.
    pub fn sigma_at(&self, k: usize) -> f64 {
        let all = || self.scatter.iter().chain(&self.above);
        let seen = all().nth(k).or(all().last()).map_or(0.0, |v| v.sqrt());
        seen.max(self.sigma_mean)
    }
}

/// Something done to the data, or found in them, that the reader should know.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// Channel, or what it is about.
    pub about: String,
    pub text: String,
}

impl Note {
    pub(super) fn new(about: impl Into<String>, text: impl Into<String>) -> Self {
        Self { about: about.into(), text: text.into() }
    }
}

/// Why a record gives no loop.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LoopError {
    #[error("no channel is controlled")]
    NoControl,
    #[error("the controlled channel does not move")]
    Still { channel: String },
    #[error("{samples} samples are too few for a loop")]
    Short { samples: usize },
    #[error("the controlled channel moves at {measured:.6} Hz, and {} is declared", Quantity::si(*declared, Dimension::FREQUENCY))]
    Frequency { channel: String, declared: f64, measured: f64 },
    #[error("{cycles} complete cycles after {discarded} discarded ({seconds:.4} s at {frequency:.6} Hz)")]
    Cycles { cycles: usize, discarded: u32, seconds: f64, frequency: f64 },
    #[error("cycles up to {last} are asked for, and the record holds {cycles}")]
    Beyond { last: u32, cycles: usize },
    #[error("{samples:.1} samples per cycle")]
    Coarse { samples: f64 },
}

impl LoopError {
    pub fn channel(&self) -> Option<&str> {
        match self {
            Self::Still { channel } | Self::Frequency { channel, .. } => Some(channel),
            _ => None,
        }
    }

    pub fn accepted(&self) -> String {
        match self {
            Self::NoControl => "control = \"displacement\" or \"force\", and a channel of that role".into(),
            Self::Still { .. } => "a controlled channel that moves periodically".into(),
            Self::Short { .. } | Self::Cycles { .. } => "at least two complete cycles after discard_cycles".into(),
            Self::Frequency { .. } => {
                format!("conditions.frequency within {} % of the recorded one, or left out", FREQUENCY_TOLERANCE * 100.0)
            }
            Self::Beyond { cycles, .. } => format!("a last cycle of {cycles} at most"),
            Self::Coarse { .. } => format!("at least {MIN_POINTS} samples per cycle"),
        }
    }
}

/// How the record is cut into cycles.
struct Grid {
    /// Cycles of the record before those kept.
    before: usize,
    frequency: f64,
    n: usize,
    cycles: usize,
    /// Where sample i of n in cycle c lies: an index, when samples coincide with phases, or a time.
    points: Points,
}

enum Points {
    Samples { first: usize, per_cycle: usize, step: usize },
    Times { start: f64 },
}

/// What shows that channels are clipped; see `findings`.
pub(super) fn clipped(record: &TimeRecord, settled: &SettledLoop) -> Vec<(Role, String, String)> {
    findings::clipped(record, settled)
}

/// What a record shows of the rig beside its loop: gaps, clipping, control, signs, delays.
pub(super) fn findings(record: &TimeRecord, settled: &SettledLoop) -> Vec<Note> {
    findings::findings(record, settled)
}

/// The control recognised at a place; none where neither channel is clearly nearer to a sine.
pub fn recognised_control(settled: &SettledLoop, at: &str) -> Option<super::Control> {
    findings::recognised(settled, at)
}

pub(super) fn settle(record: &TimeRecord) -> Result<SettledLoop, LoopError> {
    let controlled = record.channels.iter().position(|c| c.input).ok_or(LoopError::NoControl)?;
    let mut notes = Vec::new();
    let grid = grid(record, &record.channels[controlled], &mut notes)?;
    let theta: Vec<f64> = (0..grid.n).map(|j| TAU * j as f64 / grid.n as f64).collect();
    let mut unsettled = Vec::new();
    let mut drifting = Vec::new();
    let mut channels: Vec<LoopChannel> =
        record.channels.iter().map(|c| average(&record.time, c, &grid, &mut drifting, &mut unsettled, &mut notes)).collect();
    let at = |role: Role| record.channels.iter().filter(move |c| c.role == role);
    let recorded = at(Role::Displacement)
        .filter_map(|x| at(Role::Force).find(|f| f.at == x.at).map(|f| (x, f)))
        .filter(|(x, f)| ![x.label(), f.label()].iter().any(|l| drifting.contains(l)))
        .map(|(x, f)| area::recorded(&record.time, x, f, &grid))
        .collect();

    // Phase zero: the fundamental of the controlled channel is A sin(theta + shift).
    let drive = &channels[controlled].mean;
    let (a, b) = theta.iter().zip(drive).fold((0.0, 0.0), |(a, b), (t, x)| (a + x * t.cos(), b + x * t.sin()));
    let shift = a.atan2(b).rem_euclid(TAU);
    let turn = theta.partition_point(|t| t + shift < TAU) % grid.n.max(1);
    let phase = (0..grid.n).map(|j| (theta[(j + turn) % grid.n] + shift).rem_euclid(TAU)).collect::<Vec<_>>();
    channels.iter_mut().for_each(|c| c.mean.rotate_left(turn));

    let input = FourierInput::fit(&phase, &channels[controlled].mean, |k| channels[controlled].sigma_at(k), TAU * grid.frequency);
    let first = (grid.n - turn) % grid.n.max(1);
    let (frequency, n, cycles, left_out) = (grid.frequency, grid.n, grid.cycles, grid.before);
    Ok(SettledLoop { frequency, n, cycles, phase, first, left_out, channels, controlled, input, recorded, unsettled, notes })
}

fn grid(record: &TimeRecord, drive: &Channel, notes: &mut Vec<Note>) -> Result<Grid, LoopError> {
    let time = &record.time;
    let samples = time.len();
    if samples < 2 * MIN_POINTS {
        return Err(LoopError::Short { samples });
    }
    let dt = (time[samples - 1] - time[0]) / (samples - 1) as f64;
    let label = drive.label();
    let still = || LoopError::Still { channel: label.clone() };
    let fitted = |from: usize, to: usize| {
        let (t, x) = (time.get(from..to).unwrap_or(&[]), drive.values.get(from..to).unwrap_or(&[]));
        frequency::estimate(t, x).map(|fit| fit.frequency).ok_or_else(still)
    };
    // A rough frequency serves to count cycles; the fit that is used sees neither the discarded cycles nor a run-down.
    let rough = record.frequency.map_or_else(|| fitted(0, samples), Ok)?;
    // What follows counts cycles: their number is bounded by that of the samples.
    if rough * dt > 1.0 / MIN_CYCLE_SAMPLES {
        return Err(match record.frequency {
            Some(declared) => LoopError::Frequency { channel: label.clone(), declared, measured: fitted(0, samples)? },
            None => LoopError::Coarse { samples: 1.0 / (rough * dt) },
        });
    }
    let from = time.partition_point(|t| *t < time[0] + f64::from(record.discard_cycles) / rough - 0.5 * dt);
    let seconds = time.get(from).map_or(0.0, |t| time[samples - 1] - t + dt);
    let few = |cycles| LoopError::Cycles { cycles, discarded: record.discard_cycles, seconds, frequency: rough };
    if seconds * rough < 2.0 - 1e-3 - rough * dt {
        return Err(few((seconds * rough).max(0.0) as usize));
    }
    let samples = match record.last_cycle {
        Some(last) if (time[samples - 1] - time[0] + dt) * rough < f64::from(last) - 0.02 => {
            return Err(LoopError::Beyond { last, cycles: ((time[samples - 1] - time[0] + dt) * rough + 0.02) as usize });
        }
        Some(last) => time.partition_point(|t| *t < time[0] + f64::from(last) / rough - 0.5 * dt),
        None => samples,
    };
    let full = full_cycles(&time[from..samples], &drive.values[from..samples], rough, &label, notes);
    let (from, samples) = (from + full.samples.start, from + full.samples.end);
    let before = record.discard_cycles as usize + full.run_up;
    let seconds = time[samples - 1] - time[from] + dt;
    let settled = fitted(from, samples)?;
    if let Some(declared) = record.frequency.filter(|f| (f - settled).abs() > FREQUENCY_TOLERANCE * f) {
        return Err(LoopError::Frequency { channel: label, declared, measured: settled });
    }
    let frequency = match record.frequency {
        // The declared frequency is exact when the record does not tell them apart: half a percent of a cycle over its whole length.
        Some(declared) if (declared - settled).abs() * seconds < 5e-3 => declared,
        Some(declared) => {
            let stated = Quantity::si(declared, Dimension::FREQUENCY);
            notes.push(Note::new(&label, format!("moves at {settled:.6} Hz, and {stated} is declared; the measured one is used")));
            settled
        }
        None => settled,
    };
    let per_cycle = 1.0 / (frequency * dt);
    if per_cycle < MIN_POINTS as f64 {
        return Err(LoopError::Coarse { samples: per_cycle });
    }
    let uniform = time[..samples].iter().enumerate().all(|(i, t)| (t - time[0] - i as f64 * dt).abs() < 0.02 * dt);
    let whole_samples = per_cycle.round();
    if uniform && (per_cycle - whole_samples).abs() * seconds * frequency < 0.02 {
        let m = whole_samples as usize;
        let n = if m <= MAX_POINTS { Some(m) } else { (MAX_POINTS / 2..=MAX_POINTS).rev().find(|n| m.is_multiple_of(*n)) };
        if let Some(n) = n {
            let cycles = (samples - from) / m;
            if cycles < 2 {
                return Err(few(cycles));
            }
            return Ok(Grid { before, frequency, n, cycles, points: Points::Samples { first: from, per_cycle: m, step: m / n } });
        }
    }
    let n = (per_cycle as usize).min(MAX_POINTS);
    let start = time.get(from).copied().unwrap_or(time[0]);
    // The last point of the last cycle is 1/n of a cycle before its end.
    let cycles = ((time[samples - 1] + 0.5 * dt - start) * frequency + 1.0 / n as f64).floor() as usize;
    if cycles < 2 {
        return Err(few(cycles));
    }
    if !uniform {
        notes.push(Note::new("time", "the record is not sampled uniformly; it was put on equal phases by interpolation"));
    }
    Ok(Grid { before, frequency, n, cycles, points: Points::Times { start } })
}

/// The part of a record at full amplitude.
struct Full {
    samples: Range<usize>,
    /// Cycles before it.
    run_up: usize,
}

/// The cycles at full amplitude: machines run up at the beginning of a record and down at its end. Said, where a cycle is left out.
fn full_cycles(time: &[f64], drive: &[f64], frequency: f64, label: &str, notes: &mut Vec<Note>) -> Full {
    let start_of = |c: usize| time.partition_point(|t| (t - time[0]) * frequency < c as f64 - 1e-6);
    let cycles = (((time[time.len() - 1] - time[0]) * frequency) as usize).max(1);
    let amplitudes: Vec<f64> = (0..cycles).map(|c| super::record::spread(&drive[start_of(c)..start_of(c + 1)])).collect();
    let full = amplitudes.iter().copied().fold(0.0, f64::max);
    let is_full = |a: &f64| *a >= RUN_DOWN * full;
    let rising = amplitudes.iter().position(is_full).unwrap_or(0);
    let kept = amplitudes.iter().rposition(is_full).map_or(cycles, |last| last + 1);
    if kept < rising + 2 {
        return Full { samples: 0..time.len(), run_up: 0 };
    }
    let mut said = |what: &str, which: &str, count: usize| {
        let share = RUN_DOWN * 100.0;
        let text = format!("{what}: the {which} {count} of {cycles} cycles have less than {share} % of its amplitude and are left out");
        notes.push(Note::new(label, text));
    };
    if rising > 0 {
        said("runs up", "first", rising);
    }
    if kept < cycles {
        said("runs down", "last", cycles - kept);
    }
    let end = if kept < cycles { start_of(kept) } else { time.len() };
    Full { samples: start_of(rising)..end, run_up: rising }
}

/// Mean over cycles and its scatter.
fn average(
    time: &[f64],
    channel: &Channel,
    grid: &Grid,
    drifting: &mut Vec<String>,
    unsettled: &mut Vec<Unsettled>,
    notes: &mut Vec<Note>,
) -> LoopChannel {
    let (n, cycles) = (grid.n, grid.cycles);
    let mut folded = fold(time, &channel.values, grid);
    let label = channel.label();
    let (low, high) = folded.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let floor = SCATTER_FLOOR * (high - low).max(f64::MIN_POSITIVE);

    let changes = settling::changes(&folded, n, floor);
    let drift = drift::drift(&folded, n, cycles, floor);
    if let Some(drift) = &drift {
        drifting.push(label.clone());
        let middle = (n * cycles - 1) as f64 / 2.0;
        folded.iter_mut().enumerate().for_each(|(i, v)| *v -= drift.slope * (i as f64 - middle) / n as f64);
        notes.push(Note::new(
            &label,
            format!(
                "drifts by {} per cycle over {cycles} cycles (t = {:.1}, p = {:.1e}); the drift was taken out",
                channel.unit.print_difference(drift.slope),
                drift.t,
                drift.p
            ),
        ));
    }
    let mean: Vec<f64> = (0..n).map(|j| (0..cycles).map(|c| folded[c * n + j]).sum::<f64>() / cycles as f64).collect();
    folded.iter_mut().enumerate().for_each(|(i, v)| *v -= mean[i % n]);
    let rest: f64 = folded.iter().map(|v| v * v).sum();
    let scatter = (rest / ((cycles - 1) * n) as f64).sqrt();
    let sigma_sample = match channel.sigma {
        Some(sigma) => {
            if scatter > 3.0 * sigma {
                let text = format!("scatters between cycles by {:.1} times its declared sigma", scatter / sigma);
                notes.push(Note::new(&label, text));
            }
            sigma
        }
        None if scatter < floor => {
            notes.push(Note::new(&label, format!("repeats without scatter; sigma is taken as {SCATTER_FLOOR:.0e} of its range")));
            floor
        }
        None => scatter,
    };
    let sigma_mean = sigma_sample / (cycles as f64).sqrt();
    if let Some(c) = changes.iter().find(|c| c.size.abs() > sigma_mean) {
        let by = channel.unit.print_difference(c.size);
        let what = match c.kind {
            settling::Kind::Mean => format!("the mean changes by {by}"),
            settling::Kind::Amplitude => format!("the amplitude changes by {by}"),
            settling::Kind::Distance { last } => {
                format!("neighbouring cycles differ by {by} (rms) more at first than at last ({})", channel.unit.print_difference(last))
            }
        };
        let claim = format!("not settled: {what} over the {cycles} cycles kept; a larger discard_cycles leaves such cycles out");
        notes.push(Note::new(&label, format!("{claim} (t = {:.1})", c.t)));
        unsettled.push(Unsettled { channel: label, claim, t: c.t, threshold: c.threshold });
    }
    LoopChannel {
        role: channel.role,
        at: channel.at.clone(),
        unit: channel.unit.clone(),
        mean,
        sigma_sample,
        sigma_mean,
        scatter: if scatter < floor { vec![] } else { spectrum::scatter(&folded, n) },
        above: if scatter < floor { vec![] } else { spectrum::above(&folded, n) },
        correlation: if scatter < floor { vec![1.0] } else { correlation(&folded, n, rest) },
        drift: drift.map_or(0.0, |d| d.slope),
    }
}

/// Autocorrelation of the deviations from the mean cycle (cycles x n), within cycles. It ends before the first lag inside the band of chance,
/// two standard deviations of the estimate for white noise.
fn correlation(deviations: &[f64], n: usize, sum_of_squares: f64) -> Vec<f64> {
    let chance = 2.0 / (deviations.len() as f64).sqrt();
    let at = |lag: usize| {
        let products: f64 = deviations.chunks(n).map(|c| c.iter().zip(&c[lag.min(c.len())..]).map(|(a, b)| a * b).sum::<f64>()).sum();
        products / sum_of_squares * n as f64 / (n - lag) as f64
    };
    std::iter::once(1.0).chain((1..n / 2).map(at).take_while(|r| *r > chance)).collect()
}

/// cycles x n values, cycle by cycle.
fn fold(time: &[f64], values: &[f64], grid: &Grid) -> Vec<f64> {
    let count = grid.n * grid.cycles;
    match grid.points {
        Points::Samples { first, per_cycle, step } => {
            let at = |i: usize| first + (i / grid.n) * per_cycle + (i % grid.n) * step;
            (0..count).map(|i| values[at(i)]).collect()
        }
        Points::Times { start } => {
            let period = 1.0 / grid.frequency;
            let mut j = 0;
            (0..count)
                .map(|i| {
                    let t = start + period * i as f64 / grid.n as f64;
                    while j + 2 < time.len() && time[j + 1] <= t {
                        j += 1;
                    }
                    cubic(time, values, j, t)
                })
                .collect()
        }
    }
}

/// Lagrange interpolation on the four samples around interval j (fewer at the ends).
fn cubic(time: &[f64], values: &[f64], j: usize, t: f64) -> f64 {
    let (from, to) = (j.saturating_sub(1), (j + 3).min(time.len()));
    let mut sum = 0.0;
    for i in from..to {
        let mut weight = 1.0;
        for k in (from..to).filter(|k| *k != i) {
            weight *= (t - time[k]) / (time[i] - time[k]);
        }
        sum += weight * values[i];
    }
    sum
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod energy_tests;
