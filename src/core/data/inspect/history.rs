//! Histories: sampling, drive, cycles, start-up.

use super::{At, FoundColumn};
use crate::data::record::spread;
use crate::data::sampling::{Sampling, sampling};
use crate::data::{Channel, Control, Note, Role, SettledLoop, TimeRecord, estimate_frequency, recognised_control};
use crate::units::{Dimension, Unit, parse_unit};
use std::path::PathBuf;

/// A cycle is of full size within this part.
const SETTLED: f64 = 0.01;
/// An answer is of full size within so many deviations of its late cycles.
const SCATTER: f64 = 4.0;
/// Part of its size in the first quarter of a record that a motion falls below where it decays. Of one that is kept up the quarters are alike.
const DECAYED: f64 = 0.5;
/// Part of the power the fundamental has in the controlled motion of a cyclic test (a triangle has 0.986).
const CYCLIC: f64 = 0.8;

/// A history.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundHistory {
    pub columns: Vec<FoundColumn>,
    pub samples: usize,
    /// Hz, and s
    pub rate: f64,
    pub seconds: f64,
    pub cyclic: Option<Cyclic>,
    /// Whether every motion is smaller in the last quarter than in the first by half: nothing keeps it up.
    pub decays: bool,
    pub findings: Vec<Note>,
}

impl FoundHistory {
    /// Whether the file gives the units of displacement and force, so that energies are joules.
    pub fn has_units(&self) -> bool {
        let of = |role: Role| self.columns.iter().find(|c| c.role == Some(role)).is_none_or(|c| c.unit.is_some());
        of(Role::Displacement) && of(Role::Force)
    }
}

/// A cyclic test in a history.
#[derive(Debug, Clone, PartialEq)]
pub struct Cyclic {
    /// Hz
    pub frequency: f64,
    /// Whole cycles in the record, and those of its start-up.
    pub cycles: usize,
    pub start_up: u32,
    pub control: Control,
    /// Whether the control was clear from the channels.
    pub recognised: bool,
    pub settled: SettledLoop,
}

/// What an engineer has said of a history after looking at it; what is not said is found in the record.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Corrected {
    /// Cycles of the start-up.
    pub start_up: Option<u32>,
    /// The controlled channel.
    pub control: Option<Control>,
}

const ROLES: [Role; 4] = [Role::Displacement, Role::Velocity, Role::Acceleration, Role::Force];

/// A column as a channel; a unit that is not given is taken as SI for the look only.
fn channel(c: &FoundColumn) -> Option<Channel> {
    let role = c.role.filter(|r| ROLES.contains(r))?;
    let unit = c.unit.as_deref().and_then(|u| role.dimensions().iter().find_map(|d| parse_unit(u, *d).ok()));
    let unit = unit.unwrap_or_else(|| Unit::si(role.dimensions().first().copied().unwrap_or(Dimension::DIMENSIONLESS)));
    let values = c.values.iter().map(|v| unit.to_si(*v)).collect();
    Some(Channel { role, at: "c1.x".into(), unit, sigma: None, input: false, values })
}

/// Sampling, cycles and start-up of these columns by their roles and units, but for what was said of them.
pub fn found(mut columns: Vec<FoundColumn>, said: &Corrected) -> FoundHistory {
    let position = columns.iter().position(|c| c.role == Some(Role::Time)).unwrap_or(0);
    let unit = columns.get(position).and_then(|c| c.unit.as_deref()).and_then(|u| parse_unit(u, Dimension::TIME).ok());
    let scale = unit.map_or(1.0, |u| u.factor);
    let time: Vec<f64> = columns.get(position).map_or(Vec::new(), |c| c.values.iter().map(|t| t * scale).collect());
    let samples = time.len();
    let seconds = time.last().zip(time.first()).map_or(0.0, |(b, a)| b - a);
    let mut findings = Vec::new();
    // A file of variables may hold some that are of no history, or of another.
    for c in columns.iter_mut().filter(|c| c.role.is_some() && c.values.len() != samples) {
        findings.push(Note::new(&c.column, format!("has {} values where the time has {samples}: it is of another record", c.values.len())));
        c.role = None;
    }
    // A second column of one role is of another place, which the file names or only the engineer knows.
    let mut seen: Vec<(Role, Option<At>)> = Vec::new();
    let (mut first, mut further) = (vec![false; columns.len()], vec![]);
    for (k, c) in columns.iter_mut().enumerate() {
        let Some(role) = c.role else { continue };
        let same = seen.iter().filter(|s| s.0 == role);
        first[k] = same.clone().next().is_none();
        if !first[k] {
            if c.at.is_none() || same.clone().any(|s| s.1.is_none() || s.1 == c.at) {
                findings.push(Note::new(&c.column, format!("another {}: give it a place of its own", role.word())));
                c.role = None;
                continue;
            }
            further.push(k);
        }
        seen.push((role, c.at));
    }
    if let Some(k) = time.windows(2).position(|w| w[1] <= w[0]) {
        findings.push(Note::new("time", format!("does not increase after sample {}", k + 1)));
        return FoundHistory { columns, samples, rate: 0.0, seconds, cyclic: None, decays: false, findings };
    }
    // The times that rounded stamps stand for, as they are taken when the test is read.
    let found = sampling(&time);
    let time = match found {
        Sampling::Rounded { .. } => {
            let (time, said) = found.placed(&time);
            findings.extend(said.map(|text| Note::new("time", text)));
            time
        }
        _ => time,
    };
    let seconds = time.last().zip(time.first()).map_or(0.0, |(b, a)| b - a);
    let rate = if seconds > 0.0 { (samples.max(1) - 1) as f64 / seconds } else { 0.0 };
    // Where it drives and is driven a loop has one channel of each role.
    let channels: Vec<Channel> = columns.iter().zip(&first).filter(|(_, first)| **first).filter_map(|(c, _)| channel(c)).collect();
    let cyclic = cyclic(&time, &channels, said, &mut findings);
    for k in further.into_iter().filter(|_| cyclic.is_some()) {
        let c = &mut columns[k];
        let (node, axis, _) = c.at.unwrap_or_default();
        findings.push(Note::new(&c.column, format!("another {} of the loop, at n{node}.{axis}", c.role.map_or("", |r| r.word()))));
        c.role = None;
    }
    let decays = decays(&columns);
    FoundHistory { columns, samples, rate, seconds, cyclic, decays, findings }
}

fn decays(columns: &[FoundColumn]) -> bool {
    let moves = |c: &&FoundColumn| c.role.is_some_and(|r| r != Role::Force && ROLES.contains(&r));
    let mut motions = columns.iter().filter(moves).peekable();
    let falls = |values: &[f64]| {
        let quarter = values.len() / 4;
        quarter > 1 && spread(&values[values.len() - quarter..]) < DECAYED * spread(&values[..quarter])
    };
    motions.peek().is_some() && motions.all(|c| falls(&c.values))
}

fn cyclic(time: &[f64], channels: &[Channel], said: &Corrected, findings: &mut Vec<Note>) -> Option<Cyclic> {
    let of = |role: Role| channels.iter().position(|c| c.role == role);
    let (x, f) = (of(Role::Displacement)?, of(Role::Force)?);
    let drive = &channels[x].values;
    let whole = estimate_frequency(time, drive)?;
    let seconds = time[time.len() - 1] - time[0];
    // The middle of a record of several cycles is free of run-up and run-down.
    let several = seconds * whole.frequency >= 5.0;
    let middle = if several { time.len() / 4..3 * time.len() / 4 } else { 0..time.len() };
    let size = spread(&drive[middle.clone()]);
    let inner = estimate_frequency(&time[middle.clone()], &drive[middle])?;
    let cycles = (seconds * inner.frequency + 0.02) as usize;
    // What is not the fundamental and its like there is no cycle.
    if cycles < 2 || 0.5 * inner.amplitude * inner.amplitude < CYCLIC * size * size {
        return None;
    }
    let (driven, end) = steady(time, drive, inner.frequency, cycles);
    let answers = channels.iter().filter(|c| c.role == Role::Force).map(|c| settling(time, &c.values, inner.frequency, end));
    let start_up = answers.fold(driven, u32::max);
    // One cycle has to be left.
    let start_up = said.start_up.map_or(start_up, |s| s.min(cycles as u32 - 1));
    let end = end.max(start_up as usize + 1);
    let at = |c: usize| time.partition_point(|t| (t - time[0]) * inner.frequency < c as f64 - 1e-6);
    let (from, to) = (at(start_up as usize), at(end));
    let fitted = estimate_frequency(&time[from..to], &drive[from..to]).filter(|_| end >= start_up as usize + 2);
    let frequency = fitted.map_or(inner.frequency, |f| f.frequency);
    let cycles = ((seconds * frequency + 0.02) as usize).max(1);
    let record = |control: Control| {
        let mut channels = channels.to_vec();
        channels[if control == Control::Displacement { x } else { f }].input = true;
        let mut r = TimeRecord::new("", PathBuf::new(), control, Some(frequency), time.to_vec(), channels);
        r.discard_cycles = start_up;
        r
    };
    let first = record(Control::Displacement).settled();
    let settled = match first {
        Ok(l) => l,
        Err(e) => {
            findings.push(Note::new("cycles", e.to_string()));
            return None;
        }
    };
    let found = said.control.or_else(|| recognised_control(&settled, "c1.x"));
    let control = found.unwrap_or(Control::Displacement);
    let record = record(control);
    let settled = if control == Control::Force { record.settled().ok()? } else { settled };
    findings.extend(settled.notes.iter().cloned());
    findings.extend(record.findings().unwrap_or_default());
    let frequency = settled.frequency;
    Some(Cyclic { frequency, cycles, start_up, control, recognised: found.is_some(), settled })
}

/// The cycles of full size: those before them are the start-up, those after them the run-down. Full is what a quarter of the cycles reach.
fn steady(time: &[f64], drive: &[f64], frequency: f64, cycles: usize) -> (u32, usize) {
    let start = |c: usize| time.partition_point(|t| (t - time[0]) * frequency < c as f64 - 1e-6);
    let sizes: Vec<f64> = (0..cycles).map(|k| spread(&drive[start(k)..start(k + 1)])).collect();
    let mut sorted = sizes.clone();
    sorted.sort_by(f64::total_cmp);
    let full = sorted.get(cycles * 3 / 4).or(sorted.last()).copied().unwrap_or(0.0);
    let is_full = |s: &f64| (s - full).abs() <= SETTLED * full;
    let first = sizes.iter().position(is_full).unwrap_or(0);
    let last = sizes.iter().rposition(is_full).unwrap_or(cycles.saturating_sub(1));
    (first as u32, last + 1)
}

/// The cycles before which what answers has not settled, though its drive is of full size: the first from which on all cycles are as large as
/// those of the second half, within their scatter. At most half of the cycles are start-up; what changes on is said with the loop.
fn settling(time: &[f64], values: &[f64], frequency: f64, cycles: usize) -> u32 {
    let start = |c: usize| time.partition_point(|t| (t - time[0]) * frequency < c as f64 - 1e-6);
    let sizes: Vec<f64> = (0..cycles).map(|k| spread(&values[start(k)..start(k + 1)])).collect();
    let (half, late) = sizes.split_at(cycles / 2);
    let full = late.iter().sum::<f64>() / late.len().max(1) as f64;
    let allowed = (SETTLED * full).max(SCATTER * spread(late));
    half.iter().rposition(|s| (s - full).abs() > allowed).map_or(0, |last| last as u32 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_as_long_as_the_time_is_of_another_record() {
        let of = |column: &str, role: Role, n: usize| FoundColumn {
            column: column.into(),
            role: Some(role),
            unit: None,
            guessed: true,
            at: None,
            clock: None,
            values: (0..n).map(|k| (0.1 * k as f64).sin() + if role == Role::Time { k as f64 } else { 0.0 }).collect(),
        };
        let found = found(vec![of("t", Role::Time, 240), of("x", Role::Displacement, 240), of("F", Role::Force, 4)], &Corrected::default());
        assert!(found.cyclic.is_none() && found.columns[1].role.is_some() && found.columns[2].role.is_none());
        assert!(found.findings.iter().any(|f| f.text.contains("4 values") && f.about == "F"), "{:?}", found.findings);
    }
}
