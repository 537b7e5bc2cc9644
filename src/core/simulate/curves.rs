//! Loops, records and frequency responses: a CSV file each, and the lines of dataset.toml that say how to read it.

use std::fmt::Write;

use crate::data::{Control, DataError, Frf, TimeRecord};
use crate::model::Axis;
use crate::units::{Dimension, Unit};

use super::noise::Noise;
use super::quoted;

/// Averages behind the coherence that is written.
const AVERAGES: u32 = 20;

/// What holds the drive, where the record says so.
fn control(toml: &mut String, control: Option<Control>) {
    if let Some(c) = control {
        let _ = writeln!(toml, "control = \"{}\"", c.role().word());
    }
}

/// Channel lines of a history: the driven one first, as recorded, then those that are compared.
fn channels(toml: &mut String, file: &str, record: &TimeRecord, shown: &[(usize, Option<f64>)]) {
    let _ = writeln!(toml, "file = {}\nchannels = [\n  {{ role = \"time\", column = \"t\", unit = \"s\" }},", quoted(file));
    for (k, sigma) in shown {
        let c = &record.channels[*k];
        let input = if c.input { ", input = true" } else { "" };
        let sigma = sigma.map_or(String::new(), |s| format!(", sigma = \"{:e} {}\"", c.unit.difference_from_si(s), c.unit.symbol));
        let (role, at, unit) = (c.role.word(), &c.at, &c.unit.symbol);
        let _ = writeln!(toml, "  {{ role = \"{role}\", at = \"{at}\", column = \"y{k}\", unit = \"{unit}\"{input}{sigma} }},");
    }
    toml.push_str("]\n");
}

/// Which channels of a record the blocks of its plan are, in order.
fn compared(record: &TimeRecord) -> Vec<usize> {
    (0..record.channels.len()).filter(|k| record.answers(&record.channels[*k])).collect()
}

/// A table with a header, every number with all its digits.
fn csv(header: &[String], rows: impl Iterator<Item = Vec<f64>>) -> String {
    let mut text = header.join(",") + "\n";
    for row in rows {
        let cells: Vec<String> = row.iter().map(|v| format!("{v:e}")).collect();
        text += &cells.join(",");
        text.push('\n');
    }
    text
}

/// The settled cycle, `cycles` times, each with noise of its own: the scatter between cycles is the noise.
pub(super) fn cycle(
    toml: &mut String,
    record: &TimeRecord,
    blocks: &[&[f64]],
    cycles: usize,
    noise: &mut Noise,
) -> Result<String, DataError> {
    let settled = record.settled()?;
    let outputs = compared(record);
    let driven = record.channels.iter().position(|c| c.input).unwrap_or(0);
    control(toml, record.control);
    let shown: Vec<(usize, Option<f64>)> = std::iter::once(driven).chain(outputs.iter().copied()).map(|k| (k, None)).collect();
    channels(toml, &format!("{}.csv", record.test), record, &shown);
    let header: Vec<String> = std::iter::once("t".to_string()).chain(shown.iter().map(|(k, _)| format!("y{k}"))).collect();
    let sigma: Vec<f64> = blocks.iter().map(|b| noise.of_range(b)).collect();
    // One sample beyond the last cycle closes it.
    let n = settled.n;
    let dt = 1.0 / (settled.frequency * n as f64);
    let mut rows = Vec::with_capacity(cycles * n + 1);
    for k in 0..=cycles * n {
        let j = k % n;
        let mut row = vec![k as f64 * dt, record.channels[driven].unit.from_si(settled.input.at_phase(settled.phase[j]).0)];
        for ((block, sigma), c) in blocks.iter().zip(&sigma).zip(&outputs) {
            row.push(record.channels[*c].unit.from_si(block[j] + sigma * noise.normal()));
        }
        rows.push(row);
    }
    Ok(csv(&header, rows.into_iter()))
}

/// Every sample of the record: the channels that drive as they were, the others computed, each with its standard deviation.
pub(super) fn transient(toml: &mut String, record: &TimeRecord, blocks: &[&[f64]], noise: &mut Noise) -> String {
    let outputs = compared(record);
    let sigma: Vec<f64> = blocks.iter().map(|b| noise.of_range(b)).collect();
    control(toml, record.control);
    let inputs: Vec<usize> = (0..record.channels.len()).filter(|k| record.channels[*k].input).collect();
    let mut shown: Vec<(usize, Option<f64>)> = inputs.iter().map(|k| (*k, None)).collect();
    shown.extend(outputs.iter().zip(&sigma).map(|(k, s)| (*k, (*s > 0.0).then_some(*s))));
    channels(toml, &format!("{}.csv", record.test), record, &shown);
    let header: Vec<String> = std::iter::once("t".to_string()).chain(shown.iter().map(|(k, _)| format!("y{k}"))).collect();
    let mut rows = Vec::with_capacity(record.time.len());
    for (i, t) in record.time.iter().enumerate() {
        let mut row = vec![*t];
        row.extend(inputs.iter().map(|k| record.channels[*k].unit.from_si(record.channels[*k].values[i])));
        for ((block, sigma), c) in blocks.iter().zip(&sigma).zip(&outputs) {
            row.push(record.channels[*c].unit.from_si(block[i] + sigma * noise.normal()));
        }
        rows.push(row);
    }
    csv(&header, rows.into_iter())
}

/// Each part of each line gets noise of `e |H|`, and the coherence says so: `sigma = |H| sqrt((1 - g2) / (2 n g2))` gives
/// `g2 = 1 / (1 + 2 n e^2)`.
pub(super) fn frf(toml: &mut String, frf: &Frf, computed: &[f64], noise: &mut Noise) -> String {
    let (excite, respond) = (quoted(&frf.excite), quoted(&frf.respond));
    let _ = writeln!(
        toml,
        "file = {}\nexcite = {excite}\nrespond = {respond}\nquantity = \"{}\"",
        quoted(&format!("{}.csv", frf.test)),
        frf.quantity.word()
    );
    let rotational = frf.excite.rsplit_once('.').and_then(|(_, a)| Axis::parse(a).ok()).is_some_and(|a| a.rotational());
    let of_force = Unit::si(if rotational { Dimension::MOMENT } else { Dimension::FORCE });
    if let Some(f) = frf.excitation.filter(|_| frf.parts.is_empty()) {
        let _ = writeln!(toml, "excitation = \"{}\"", of_force.print(f));
    }
    let unit = quoted(&frf.unit.symbol);
    let _ = writeln!(
        toml,
        "channels = [\n  {{ role = \"frequency\", column = \"f\", unit = \"Hz\" }},\n  {{ role = \"real\", column = \"re\", unit = {unit} }},\n  \
         {{ role = \"imag\", column = \"im\", unit = {unit} }},\n  {{ role = \"coherence\", column = \"coh\", averages = {AVERAGES} }},\n"
    );
    if !frf.parts.is_empty() {
        let _ = writeln!(toml, "  {{ role = \"excitation\", column = \"force\", unit = {} }},", quoted(&of_force.symbol));
    }
    toml.push_str("]\n");
    let e = noise.fraction();
    let coherence = 1.0 / (1.0 + 2.0 * f64::from(AVERAGES) * e * e);
    let mut header = ["f", "re", "im", "coh"].map(str::to_string).to_vec();
    header.extend((!frf.parts.is_empty()).then(|| "force".to_string()));
    let mut rows = Vec::with_capacity(frf.frequency.len());
    for (line, (f, h)) in frf.frequency.iter().zip(computed.chunks_exact(2)).enumerate() {
        let sigma = e * h[0].hypot(h[1]);
        let (re, im) = (h[0] + sigma * noise.normal(), h[1] + sigma * noise.normal());
        let mut row = vec![*f, frf.unit.from_si(re), frf.unit.from_si(im), coherence];
        row.extend(frf.parts.get(line).map(|part| part * frf.excitation.unwrap_or(1.0)));
        rows.push(row);
    }
    csv(&header, rows.into_iter())
}
