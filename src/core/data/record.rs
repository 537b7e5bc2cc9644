//! Recorded histories: cycle and transient tests.

use super::channel::{ChannelSpec, Role, Sigma, channels};
use super::condition::Conditions;
use super::dataset::{Source, columns, no_channel, only};
use super::readers::{Column, Columns};
use super::sampling::{Sampling, sampling};
use super::toml_strict::{TableView, TomlError, ValueView};
use super::{Content, DataError, History, LoopError, Note, SettledLoop};
use crate::limits::MAGNITUDE;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What the machine controls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    Displacement,
    Force,
}

impl Control {
    pub const WORDS: [(&'static str, Control); 2] = [("displacement", Control::Displacement), ("force", Control::Force)];

    /// The words of a transient test: what was released and left to itself has no control.
    pub const OF_RECORDS: [(&'static str, Option<Control>); 3] =
        [("displacement", Some(Control::Displacement)), ("force", Some(Control::Force)), ("free", None)];

    pub fn role(self) -> Role {
        match self {
            Self::Displacement => Role::Displacement,
            Self::Force => Role::Force,
        }
    }
}

/// A sampled channel, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    pub role: Role,
    /// `name.axis`.
    pub at: String,
    /// Unit of the file, for printing.
    pub unit: crate::units::Unit,
    /// Declared standard deviation of one sample, SI.
    pub sigma: Option<f64>,
    /// Drives the test.
    pub input: bool,
    pub values: Vec<f64>,
}

impl Channel {
    /// `force at c1.x`.
    pub fn label(&self) -> String {
        format!("{} at {}", self.role.word(), self.at)
    }
}

/// A recorded history: time strictly increasing, all channels as long as it.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeRecord {
    pub test: String,
    pub file: PathBuf,
    /// None for a transient test whose inputs are marked `input = true`.
    pub control: Option<Control>,
    pub discard_cycles: u32,
    /// Last cycle of the record that is used, counted from 1 (`cycles = "3-8"`).
    pub last_cycle: Option<u32>,
    /// Declared drive frequency, Hz (cycle tests).
    pub frequency: Option<f64>,
    /// s
    pub time: Vec<f64>,
    pub channels: Vec<Channel>,
    /// What was done to the channels when they were read.
    pub notes: Vec<Note>,
}

impl TimeRecord {
    /// A record that is already in memory (simulated, or in tests): time strictly increasing, channels as long as it, one of them `input`.
    pub fn new(test: &str, file: PathBuf, control: Control, frequency: Option<f64>, time: Vec<f64>, channels: Vec<Channel>) -> Self {
        Self {
            test: test.to_string(),
            file,
            control: Some(control),
            discard_cycles: 0,
            last_cycle: None,
            frequency,
            time,
            channels,
            notes: vec![],
        }
    }

    /// The controlled channel: of the controlled role, and marked `input = true` where there are several.
    pub fn controlled(&self) -> Option<&Channel> {
        self.channels.iter().find(|c| c.input)
    }

    /// Takes a mean off each of these channels, and says so.
    fn centre(&mut self, channels: &[usize], mean: impl Fn(usize) -> f64) {
        for k in channels {
            let (mean, channel) = (mean(*k), &mut self.channels[*k]);
            channel.values.iter_mut().for_each(|v| *v -= mean);
            self.notes
                .push(Note::new(channel.label(), format!("centred: its mean of {} was taken off", channel.unit.print_difference(mean))));
        }
    }

    /// Takes the mean of the whole record off each of these channels.
    fn centre_whole(&mut self, channels: &[usize]) {
        let means: Vec<f64> = self.channels.iter().map(|c| c.values.iter().sum::<f64>() / c.values.len().max(1) as f64).collect();
        self.centre(channels, |k| means[k]);
    }

    /// Whether a channel is one that the test answers with. Velocity and acceleration of a driven displacement are the drive itself.
    pub fn answers(&self, channel: &Channel) -> bool {
        let of_the_drive = |d: &Channel| {
            let motion = [Role::Displacement, Role::Velocity, Role::Acceleration];
            d.at == channel.at && d.role == Role::Displacement && motion.contains(&channel.role)
        };
        !channel.input && channel.role.has_place() && !self.controlled().is_some_and(of_the_drive)
    }

    /// The settled loop of a cycle test; see `data::loops`.
    pub fn settled(&self) -> Result<SettledLoop, DataError> {
        super::loops::settle(self).map_err(|e| self.explain(e))
    }

    /// What the record shows of the rig: gaps, clipping, control, swapped signs, delays. Nothing is repaired.
    pub fn findings(&self) -> Result<Vec<Note>, DataError> {
        Ok(self.findings_of(&self.settled()?))
    }

    /// The same where the settled loop is at hand.
    pub fn findings_of(&self, settled: &SettledLoop) -> Vec<Note> {
        super::loops::findings(self, settled)
    }

    /// Role and place of every channel that is clipped, and what shows it.
    pub fn clipped(&self, settled: &SettledLoop) -> Vec<(Role, String, String)> {
        super::loops::clipped(self, settled)
    }

    /// The whole record, for time integration; see [`History`].
    pub fn history(&self) -> History {
        History { time: self.time.clone(), channels: self.channels.clone() }
    }

    fn explain(&self, e: LoopError) -> DataError {
        Content {
            file: self.file.clone(),
            row: None,
            test: self.test.clone(),
            channel: e.channel().map(str::to_string),
            accepted: e.accepted(),
            message: e.to_string(),
        }
        .into()
    }
}

const ROLES: [Role; 5] = [Role::Time, Role::Displacement, Role::Velocity, Role::Acceleration, Role::Force];

pub(super) fn cycle(table: &TableView<'_>, id: &str, conditions: &Conditions, source: &Source<'_>) -> Result<TimeRecord, DataError> {
    only(table, &["file", "control", "discard_cycles", "cycles", "noise", "channels"])?;
    let control = table.require("control", "\"displacement\" or \"force\"")?.word("control", &Control::WORDS)?;
    let discard = table.optional("discard_cycles", |v| v.integer(0, 1_000_000))?.unwrap_or(0) as u32;
    let cycles = table.optional("cycles", |v| cycles(&v))?;
    if let (Some(_), Some(v)) = (cycles, table.get("discard_cycles")) {
        return Err(v
            .refuse("cycles and discard_cycles both stand there", "one of them: cycles = \"3-8\" leaves out what lies before and after")
            .into());
    }
    let (mut record, centred) = record(table, id, Drive::Controlled(control), source)?;
    (record.discard_cycles, record.last_cycle) = cycles.map_or((discard, None), |(first, last)| (first - 1, Some(last)));
    record.frequency = conditions.get("frequency").map(|c| c.value);
    if !record.channels.iter().any(|c| !c.input) {
        return Err(no_channel(table, "that answers: a force under displacement control, a displacement under force control").into());
    }
    // The loop is checked when the dataset is read, so that an unusable record is known before any run.
    let settled = record.settled()?;
    record.centre(&centred, |k| {
        let mean = &settled.channels[k].mean;
        mean.iter().sum::<f64>() / mean.len().max(1) as f64
    });
    Ok(record)
}

/// First and last cycle, counted from 1: `"3-8"`.
fn cycles(value: &ValueView<'_>) -> Result<(u32, u32), TomlError> {
    let text = value.string()?;
    let ends = text.split_once('-').and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
    match ends {
        Some((first, last)) if first >= 1 && last > first && last <= 1_000_000 => Ok((first, last)),
        _ => Err(value.refuse(format!("`{text}` is no range of cycles"), "first and last cycle, counted from 1, such as \"3-8\"")),
    }
}

pub(super) fn transient(table: &TableView<'_>, id: &str, source: &Source<'_>) -> Result<TimeRecord, DataError> {
    only(table, &["file", "control", "noise", "channels"])?;
    let drive = match table.optional("control", |v| v.word("control", &Control::OF_RECORDS))? {
        Some(Some(control)) => Drive::Controlled(control),
        Some(None) => Drive::Free,
        None => Drive::Marked,
    };
    let (mut record, centred) = record(table, id, drive, source)?;
    record.centre_whole(&centred);
    if record.channels.iter().all(|c| c.input) {
        return Err(no_channel(table, "that answers (without input = true)").into());
    }
    if drive == Drive::Free {
        released(table, &mut record)?;
    }
    Ok(record)
}

/// What drives a recorded test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Drive {
    /// The channel of the controlled role.
    Controlled(Control),
    /// The channels that are marked `input = true`.
    Marked,
    /// Nothing: the structure was released before its first sample.
    Free,
    /// Something that was not measured.
    Unmeasured,
}

/// Responses to an excitation that was not measured.
pub(super) fn unmeasured(table: &TableView<'_>, id: &str, source: &Source<'_>) -> Result<TimeRecord, DataError> {
    let (mut record, centred) = record(table, id, Drive::Unmeasured, source)?;
    if record.channels.is_empty() {
        return Err(no_channel(table, "of a motion: a displacement, velocity or acceleration").into());
    }
    record.centre_whole(&centred);
    Ok(record)
}

/// A record that nothing drives is one under a force of zero, where its first motion is measured.
fn released(table: &TableView<'_>, record: &mut TimeRecord) -> Result<(), DataError> {
    let Some(at) = record.channels.iter().find(|c| c.role != Role::Force).map(|c| c.at.clone()) else {
        return Err(no_channel(table, "of a motion: of what was released a displacement, velocity or acceleration").into());
    };
    let along = super::channel::along_axis(Role::Force.dimensions(), Some(&at))[0];
    let values = vec![0.0; record.time.len()];
    record.channels.push(Channel { role: Role::Force, at, unit: crate::units::Unit::si(along), sigma: None, input: true, values });
    record.control = Some(Control::Force);
    record.notes.push(Note::new("control", "nothing drives the record: the structure was released before it begins"));
    Ok(())
}

/// The record, and which of its channels are to be centred.
fn record(table: &TableView<'_>, id: &str, drive: Drive, source: &Source<'_>) -> Result<(TimeRecord, Vec<usize>), DataError> {
    let roles = if drive == Drive::Unmeasured { &super::output_only::ROLES[..] } else { &ROLES };
    let mut specs = channels(table, roles, &[])?;
    let control = if let Drive::Controlled(control) = drive { Some(control) } else { None };
    mark_inputs(table, drive, &mut specs)?;
    let noise = table.optional("noise", |v| super::channel::sigma(&v, &crate::units::Unit::si(crate::units::Dimension::DIMENSIONLESS)))?;
    let noise = noise.map(|s| match s {
        Sigma::Absolute(f) | Sigma::Relative(f) => Sigma::Relative(f),
    });
    if !specs.iter().any(|s| s.role == Role::Time) {
        return Err(no_channel(table, "role = \"time\"").into());
    }
    let file = source.file(table, id)?;
    let recorded: Vec<ChannelSpec> = specs.iter().filter(|s| s.reading.rate.is_none()).cloned().collect();
    let mut rows = columns(table, id, &file, &recorded)?;
    let n = rows.len();
    let mut read: Vec<(&ChannelSpec, Vec<f64>)> = Vec::with_capacity(specs.len());
    for (spec, column) in recorded.iter().zip(std::mem::take(&mut rows.columns)) {
        let Column::Numbers(mut values) = column else { continue };
        to_si(&file, &rows, id, spec, &mut values)?;
        read.push((spec, values));
    }
    read.extend(specs.iter().filter_map(|s| Some((s, s.reading.clock(n)?))));
    let mut notes: Vec<Note> = specs.iter().filter_map(|s| s.reading.note(&s.label(), &s.unit)).collect();
    let place = read.iter().position(|(s, _)| s.role == Role::Time);
    let mut time = Vec::new();
    if let Some((spec, stamps)) = place.map(|k| read.remove(k)) {
        increasing(&file, &rows, id, spec, &stamps)?;
        let kept = window(&file, id, spec, &stamps, &mut notes)?;
        read.iter_mut().for_each(|(_, values)| *values = values[kept.clone()].to_vec());
        let even = control.is_some() && table.string("kind")? == "cycle";
        time = evened(&file, &rows, id, spec, (stamps, kept), even, &mut notes)?;
    }
    let (mut all, mut centred) = (Vec::new(), Vec::new());
    for (spec, values) in read {
        let Some(at) = &spec.at else { continue };
        let sigma = spec.sigma.or(noise).map(|s| match s {
            Sigma::Absolute(s) => s,
            Sigma::Relative(f) => f * spread(&values),
        });
        if sigma.is_some_and(|s| s.is_nan() || s <= 0.0) {
            return Err(content(&file, None, id, spec, "a relative sigma of a channel that does not vary", "a sigma with a unit"));
        }
        if spec.reading.centre {
            centred.push(all.len());
        }
        all.push(Channel { role: spec.role, at: at.clone(), unit: spec.unit.clone(), sigma, input: spec.input, values });
    }
    let record = TimeRecord {
        test: id.to_string(),
        file,
        control,
        discard_cycles: 0,
        last_cycle: None,
        frequency: None,
        time,
        channels: all,
        notes,
    };
    Ok((record, centred))
}

/// The samples that the window of the time channel keeps.
pub(super) fn window(file: &Path, id: &str, spec: &ChannelSpec, time: &[f64], notes: &mut Vec<Note>) -> Result<Range<usize>, DataError> {
    let Some(kept) = spec.reading.kept(time) else {
        let held =
            time.first().zip(time.last()).map_or(String::new(), |(a, b)| format!("{} to {}", spec.unit.print(*a), spec.unit.print(*b)));
        let message = "fewer than two samples lie between from and to";
        return Err(content(file, None, id, spec, message, &format!("a window inside the record: {held}")));
    };
    if kept.len() < time.len() {
        notes.push(Note::new("time", format!("from and to keep {} of {} samples", kept.len(), time.len())));
    }
    Ok(kept)
}

/// The times of the samples kept: those that rounded stamps stand for. Samples at unlike times are refused, unless they may be `uneven`, as
/// those of a cycle, which are put on equal phases.
fn evened(
    file: &Path,
    rows: &Columns,
    id: &str,
    spec: &ChannelSpec,
    (stamps, kept): (Vec<f64>, Range<usize>),
    uneven: bool,
    notes: &mut Vec<Note>,
) -> Result<Vec<f64>, DataError> {
    let time = &stamps[kept.clone()];
    let found = sampling(time);
    if uneven && matches!(found, Sampling::Jittered { .. } | Sampling::Uneven { .. }) {
        return Ok(time.to_vec());
    }
    if let Some((at, message)) = found.uneven() {
        let row = rows.place(kept.start + at);
        let accepted = "a record sampled uniformly, whose time may be rounded; or from and to around the gap";
        return Err(content(file, Some(row), id, spec, &message, accepted));
    }
    let (time, said) = found.placed(time);
    notes.extend(said.map(|text| Note::new("time", text)));
    Ok(time)
}

/// Settles which channels drive: those marked, or the one of the controlled role.
fn mark_inputs(table: &TableView<'_>, drive: Drive, specs: &mut [ChannelSpec]) -> Result<(), DataError> {
    let marked = specs.iter().filter(|s| s.input).count();
    let control = match drive {
        Drive::Controlled(control) => control,
        Drive::Marked if marked > 0 => return Ok(()),
        Drive::Marked => {
            let accepted =
                "control = \"displacement\" or \"force\", input = true in the channels that drive it, or control = \"free\" for a decay";
            return Err(table.refuse("nothing drives this test: it has no key `control`, and no channel is marked", accepted).into());
        }
        Drive::Free | Drive::Unmeasured => {
            if let Some(driven) = specs.iter().find(|s| s.input) {
                let drive = if drive == Drive::Free { "control is free" } else { "output_only is true" };
                let message = format!("the {} is marked as input, and {drive}", driven.label());
                return Err(table.refuse(message, "no input = true in a record that nothing measured drives").into());
            }
            return Ok(());
        }
    };
    let role = control.role();
    if let Some(other) = specs.iter().find(|s| s.input && s.role != role) {
        let message = format!("the {} is marked as input, and control is {}", other.label(), role.word());
        return Err(table.refuse(message, format!("input = true on a channel of role {}", role.word())).into());
    }
    if marked == 0 {
        let mut controlled = specs.iter_mut().filter(|s| s.role == role);
        let (first, second) = (controlled.next(), controlled.next());
        match (first, second) {
            (Some(first), None) => first.input = true,
            (None, _) => return Err(no_channel(table, &format!("role = \"{}\", which is controlled", role.word())).into()),
            _ => {
                let message = format!("several channels of role {}, and none is marked as the controlled one", role.word());
                return Err(table.refuse(message, "input = true on one of them").into());
            }
        }
    }
    Ok(())
}

/// Time must increase from row to row.
pub(super) fn increasing(file: &Path, rows: &Columns, id: &str, spec: &ChannelSpec, time: &[f64]) -> Result<(), DataError> {
    match time.windows(2).position(|w| w[1] <= w[0]) {
        None => Ok(()),
        Some(i) => {
            let what = if time[i + 1] == time[i] { "is repeated" } else { "goes back" };
            let message = format!("time {what}: {} after {}", spec.unit.print(time[i + 1]), spec.unit.print(time[i]));
            Err(content(file, Some(rows.place(i + 1)), id, spec, &message, "time that increases from row to row"))
        }
    }
}

pub(super) fn content(file: &Path, row: Option<String>, test: &str, spec: &ChannelSpec, message: &str, accepted: &str) -> DataError {
    Content {
        file: file.to_path_buf(),
        row,
        test: test.to_string(),
        channel: Some(spec.label()),
        message: message.to_string(),
        accepted: accepted.to_string(),
    }
    .into()
}

/// Takes a column to SI. A value that is finite in the file may be beyond [`MAGNITUDE`] in SI, or after its scale and offset.
pub(super) fn to_si(file: &Path, rows: &Columns, id: &str, spec: &ChannelSpec, values: &mut [f64]) -> Result<(), DataError> {
    for (i, v) in values.iter_mut().enumerate() {
        let si = spec.reading.of(spec.unit.to_si(*v));
        if si.is_nan() || si.abs() > MAGNITUDE {
            let message = format!("{} is beyond any number that is reckoned with", spec.unit.written(*v));
            return Err(content(file, Some(rows.place(i)), id, spec, &message, &format!("a number of at most {MAGNITUDE:e} in SI")));
        }
        *v = si;
    }
    Ok(())
}

/// rms about the mean.
pub(super) fn spread(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}
