//! Histories: sampling, drive, cycles, start-up.

use super::FoundColumn;
use crate::data::record::spread;
use crate::data::{Channel, Control, Note, Role, SettledLoop, TimeRecord, estimate_frequency, recognised_control};
use crate::units::{Dimension, Unit, parse_unit};
use std::path::PathBuf;

/// A cycle is settled when its size is within this part of the last ones.
const SETTLED: f64 = 0.005;
/// Part of the power the fundamental and its next two harmonics have in a cyclic test.
const CYCLIC: f64 = 0.9;

/// A history.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundHistory {
    /// Function of a universal file, where it is one.
    pub record: Option<String>,
    pub columns: Vec<FoundColumn>,
    pub samples: usize,
    /// Hz, and s
    pub rate: f64,
    pub seconds: f64,
    pub cyclic: Option<Cyclic>,
    pub findings: Vec<Note>,
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

const ROLES: [Role; 4] = [Role::Displacement, Role::Velocity, Role::Acceleration, Role::Force];

/// A column as a channel; a unit that is not given is taken as SI for the look only.
fn channel(c: &FoundColumn) -> Option<Channel> {
    let role = c.role.filter(|r| ROLES.contains(r))?;
    let unit = c.unit.as_deref().and_then(|u| role.dimensions().iter().find_map(|d| parse_unit(u, *d).ok()));
    let unit = unit.unwrap_or_else(|| Unit::si(role.dimensions().first().copied().unwrap_or(Dimension::DIMENSIONLESS)));
    let values = c.values.iter().map(|v| unit.to_si(*v)).collect();
    Some(Channel { role, at: "c1.x".into(), unit, sigma: None, input: false, values })
}

pub(super) fn found(mut columns: Vec<FoundColumn>, record: Option<String>) -> FoundHistory {
    let position = columns.iter().position(|c| c.role == Some(Role::Time)).unwrap_or(0);
    let unit = columns.get(position).and_then(|c| c.unit.as_deref()).and_then(|u| parse_unit(u, Dimension::TIME).ok());
    let scale = unit.map_or(1.0, |u| u.factor);
    let time: Vec<f64> = columns.get(position).map_or(Vec::new(), |c| c.values.iter().map(|t| t * scale).collect());
    let samples = time.len();
    let seconds = time.last().zip(time.first()).map_or(0.0, |(b, a)| b - a);
    let mut findings = Vec::new();
    // A second column of one role is of another place; which, only the engineer knows.
    let mut seen: Vec<Role> = Vec::new();
    for c in columns.iter_mut().filter(|c| c.role.is_some()) {
        if let Some(role) = c.role {
            if seen.contains(&role) {
                findings.push(Note::new(&c.column, format!("another {}: give it a place of its own", role.word())));
                c.role = None;
            }
            seen.push(role);
        }
    }
    if let Some(k) = time.windows(2).position(|w| w[1] <= w[0]) {
        findings.push(Note::new("time", format!("does not increase after sample {}", k + 1)));
        return FoundHistory { record, columns, samples, rate: 0.0, seconds, cyclic: None, findings };
    }
    let rate = if seconds > 0.0 { (samples.max(1) - 1) as f64 / seconds } else { 0.0 };
    let channels: Vec<Channel> = columns.iter().filter_map(channel).collect();
    let cyclic = cyclic(&time, &channels, &mut findings);
    FoundHistory { record, columns, samples, rate, seconds, cyclic, findings }
}

fn cyclic(time: &[f64], channels: &[Channel], findings: &mut Vec<Note>) -> Option<Cyclic> {
    let of = |role: Role| channels.iter().position(|c| c.role == role);
    let (x, f) = (of(Role::Displacement)?, of(Role::Force)?);
    let drive = &channels[x].values;
    let fit = estimate_frequency(time, drive)?;
    let seconds = time[time.len() - 1] - time[0];
    let cycles = ((seconds * fit.frequency + 0.02) as usize).max(1);
    // The middle of the record is settled: what is not the fundamental there is no cycle.
    let middle = time.len() / 4..3 * time.len() / 4;
    let size = spread(&drive[middle.clone()]);
    let inner = estimate_frequency(&time[middle.clone()], &drive[middle])?;
    if cycles < 2 || inner.amplitude * inner.amplitude / 2.0 < CYCLIC * size * size * 0.9 {
        return None;
    }
    let start_up = start_up(time, channels, fit.frequency, cycles);
    let record = |control: Control| {
        let mut channels = channels.to_vec();
        channels[if control == Control::Displacement { x } else { f }].input = true;
        let mut r = TimeRecord::new("", PathBuf::new(), control, None, time.to_vec(), channels);
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
    let found = recognised_control(&settled, "c1.x");
    let control = found.unwrap_or(Control::Displacement);
    let record = record(control);
    let settled = if control == Control::Force { record.settled().ok()? } else { settled };
    findings.extend(settled.notes.iter().cloned());
    findings.extend(record.findings().unwrap_or_default());
    let frequency = settled.frequency;
    Some(Cyclic { frequency, cycles, start_up, control, recognised: found.is_some(), settled })
}

/// Cycles before the size of every channel stays within half a percent of its median over the last half of the record (or what it varies by there).
fn start_up(time: &[f64], channels: &[Channel], frequency: f64, cycles: usize) -> u32 {
    let start = |c: usize| time.partition_point(|t| (t - time[0]) * frequency < c as f64 - 1e-6);
    let mut most = 0;
    for c in channels.iter().filter(|c| matches!(c.role, Role::Displacement | Role::Force)) {
        let sizes: Vec<f64> = (0..cycles).map(|k| spread(&c.values[start(k)..start(k + 1)])).collect();
        let mut late = sizes[cycles / 2..].to_vec();
        late.sort_by(f64::total_cmp);
        let median = late[late.len() / 2];
        let mut off: Vec<f64> = late.iter().map(|s| (s - median).abs()).collect();
        off.sort_by(f64::total_cmp);
        let usual = (5.0 * off[off.len() / 2]).max(SETTLED * median);
        most = most.max(sizes[..cycles / 2].iter().rposition(|s| (s - median).abs() > usual).map_or(0, |k| k + 1));
    }
    most as u32
}
