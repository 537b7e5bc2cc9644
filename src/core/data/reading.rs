//! What is done to a recorded channel before it is used: a factor, an offset, its mean taken off, a window in time.

use super::Note;
use super::channel::Role;
use super::toml_strict::{TableView, TomlError};
use crate::limits::MAGNITUDE;
use crate::units::{Dimension, Unit};

/// `value = scale * recorded + offset`, then the mean is taken off where `centre` says so. The window is the time channel's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Factor without unit; -1 turns the channel.
    pub scale: f64,
    /// SI.
    pub offset: f64,
    pub centre: bool,
    /// First and last time kept, s, as the file counts it (of date and time: from the first row).
    pub window: (Option<f64>, Option<f64>),
    /// Samples per second of a file without a column of time, Hz.
    pub rate: Option<f64>,
}

impl Default for Reading {
    fn default() -> Self {
        Self { scale: 1.0, offset: 0.0, centre: false, window: (None, None), rate: None }
    }
}

/// Keys of a channel of this role that say how it is read.
pub(super) fn keys(role: Role) -> &'static [&'static str] {
    match role {
        Role::Time => &["from", "to", "rate"],
        Role::Real | Role::Imag | Role::Amplitude => &["scale"],
        role if role.has_place() => &["scale", "offset", "centre"],
        _ => &[],
    }
}

/// Reads the keys; the table has none but those of its role.
pub(super) fn read(table: &TableView<'_>, unit: &Unit) -> Result<Reading, TomlError> {
    let scale = table.optional("scale", |v| match v.number()? {
        s if (1.0 / MAGNITUDE..=MAGNITUDE).contains(&s.abs()) => Ok(s),
        s => {
            let accepted = format!("a factor from {:e} to {MAGNITUDE:e}, or its negative; -1 turns the channel", 1.0 / MAGNITUDE);
            Err(v.refuse(format!("a scale of {}", plain(s)), accepted))
        }
    })?;
    let offset = table.optional("offset", |v| {
        let q = v.quantity(unit.dimension)?;
        Ok(q.unit.difference_to_si(q.unit.from_si(q.value)))
    })?;
    let centre = table.optional("centre", |v| v.bool())?.unwrap_or(false);
    if let (true, Some(_), Some(v)) = (centre, offset, table.get("offset")) {
        return Err(v.refuse("offset and centre both stand there", "one of them: centre takes the mean off, whatever the offset"));
    }
    let time = |key: &str| table.optional(key, |v| v.quantity(Dimension::TIME).map(|q| q.value));
    let window = (time("from")?, time("to")?);
    if let ((Some(from), Some(to)), Some(v)) = (window, table.get("to"))
        && from >= to
    {
        return Err(v.refuse(format!("a window from {from} s to {to} s"), "to after from"));
    }
    let rate = table.optional("rate", |v| match v.quantity(Dimension::FREQUENCY)? {
        q if q.value > 0.0 => Ok(q.value),
        q => Err(v.refuse(format!("a rate of {q}"), "a frequency above 0")),
    })?;
    Ok(Reading { rate, scale: scale.unwrap_or(1.0), offset: offset.unwrap_or(0.0), centre, window })
}

/// A number without unit in as many digits as it has.
fn plain(number: f64) -> String {
    Unit::si(Dimension::DIMENSIONLESS).written(number)
}

impl Reading {
    /// The value used for a recorded one, SI.
    pub fn of(&self, recorded: f64) -> f64 {
        self.scale * recorded + self.offset
    }

    /// The times of `n` samples of a channel that is given by its rate.
    pub(super) fn clock(&self, n: usize) -> Option<Vec<f64>> {
        self.rate.map(|rate| (0..n).map(|k| k as f64 / rate).collect())
    }

    /// What was done, if anything.
    pub(super) fn note(&self, about: &str, unit: &Unit) -> Option<Note> {
        let mut done = vec![];
        if self.scale == -1.0 {
            done.push("turned (scale = -1)".to_string());
        } else if self.scale != 1.0 {
            done.push(format!("multiplied by {}", plain(self.scale)));
        }
        if self.offset != 0.0 {
            done.push(format!("{} added", unit.print_difference(self.offset)));
        }
        (!done.is_empty()).then(|| Note::new(about, done.join(", ")))
    }

    /// The samples inside the window; none where fewer than two are.
    pub(super) fn kept(&self, time: &[f64]) -> Option<std::ops::Range<usize>> {
        let start = self.window.0.map_or(0, |from| time.partition_point(|t| *t < from));
        let end = self.window.1.map_or(time.len(), |to| time.partition_point(|t| *t <= to));
        (end >= start + 2).then_some(start..end)
    }
}
