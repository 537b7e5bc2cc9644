//! Tables: natural frequencies with damping (modal), energies per cycle (energy); inline rows or a file.

use super::channel::{ChannelSpec, Role, Sigma, channels, place};
use super::condition::{Conditions, conditions};
use super::dataset::{Source, columns, no_channel, only};
use super::readers::{Column, Columns};
use super::record::{Control, content, to_si};
use super::toml_strict::{TableView, TomlError, ValueView};
use super::{Content, DataError, channel};
use crate::limits::MAGNITUDE;
use crate::units::{Dimension, Unit};
use std::path::{Path, PathBuf};

/// A value of a table, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct TableValue {
    pub value: f64,
    pub unit: Unit,
    /// Stated standard deviation.
    pub sigma: Option<f64>,
    /// Standard deviation of rounding to the finest digit printed in the column: one unit of it over sqrt 12.
    pub rounding: f64,
}

/// Natural frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct ModalTable {
    pub rows: Vec<ModeRow>,
    /// How the modes were identified, where they were.
    pub notes: Vec<String>,
}

/// One mode.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeRow {
    /// Number of the mode, from 1.
    pub mode: u32,
    /// Hz
    pub frequency: TableValue,
    /// Modal damping ratio.
    pub damping: Option<TableValue>,
    /// Family of shapes it belongs to (`bending`, `torsion`), for pairing.
    pub family: Option<String>,
    pub description: Option<String>,
    /// Line of dataset.toml, or line or row of the file.
    pub place: String,
}

/// Energies per cycle.
#[derive(Debug, Clone, PartialEq)]
pub struct EnergyTable {
    /// `name.axis` where the cycle is driven.
    pub at: String,
    pub control: Control,
    /// Least and greatest force (force control) or displacement (displacement control) of the cycle, SI. None: not known.
    pub limits: Option<(f64, f64)>,
    /// What W_s was evaluated as, if the source says.
    pub stored: Option<StoredEnergy>,
    pub rows: Vec<EnergyRow>,
}

/// Readings of the equivalent elastic energy W_s.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredEnergy {
    /// W_s = dF^2 / (2 k_s): k_s the slope of the branch-mean force over the middle 60 % of travel.
    Slope,
    /// W_s = 1/2 dF dx.
    Product,
}

/// One cycle. At least one of the energies stands there.
#[derive(Debug, Clone, PartialEq)]
pub struct EnergyRow {
    /// Name of the row, for reports.
    pub case: Option<String>,
    /// Conditions of the test with those of the row over them; `frequency` is in `frequency`.
    pub conditions: Conditions,
    /// Hz
    pub frequency: Option<f64>,
    /// Dissipated energy per cycle W_D, J.
    pub dissipated: Option<TableValue>,
    /// Equivalent elastic energy W_s, J.
    pub stored: Option<TableValue>,
    /// D = W_D / W_s as printed; no third datum where both energies stand there.
    pub ratio: Option<TableValue>,
    /// Line of dataset.toml, or line or row of the file.
    pub place: String,
}

const MODAL_ROLES: [Role; 5] = [Role::Mode, Role::Frequency, Role::Damping, Role::Family, Role::Description];
const ENERGY_ROLES: [Role; 5] = [Role::Case, Role::Frequency, Role::DissipatedEnergy, Role::StoredEnergy, Role::LossRatio];

/// A row before it is given its meaning.
#[derive(Default)]
pub(super) struct Row {
    pub place: String,
    texts: Vec<(Role, String)>,
    numbers: Vec<(Role, TableValue)>,
    conditions: Option<Conditions>,
}

impl Row {
    fn text(&self, role: Role) -> Option<String> {
        self.texts.iter().find(|t| t.0 == role).map(|t| t.1.clone()).filter(|t| !t.is_empty())
    }

    pub fn number(&self, role: Role) -> Option<TableValue> {
        self.numbers.iter().find(|n| n.0 == role).map(|n| n.1.clone())
    }
}

pub(super) fn modal(table: &TableView<'_>, id: &str, source: &Source<'_>) -> Result<ModalTable, DataError> {
    if table.optional("output_only", |v| v.bool())?.unwrap_or(false) {
        return super::output_only::modal(table, id, source);
    }
    only(table, &["file", "channels", "rows", "noise", "output_only"])?;
    let rows = rows(table, id, source, &MODAL_ROLES, &[], false)?;
    let (mut modes, mut seen) = (Vec::new(), Vec::new());
    for row in rows {
        let fail = |message: String, accepted: &str| at_row(source, id, &row.place, message, accepted);
        let mode = row.number(Role::Mode).ok_or_else(|| fail("no number of the mode".into(), "mode = 1, 2, ..."))?.value;
        if mode.fract() != 0.0 || !(1.0..=1e6).contains(&mode) {
            return Err(fail(format!("{mode} is not the number of a mode"), "mode = 1, 2, ..."));
        }
        if seen.contains(&(mode as u32)) {
            return Err(fail(format!("mode {mode} stands twice"), "each mode once"));
        }
        seen.push(mode as u32);
        let frequency = row.number(Role::Frequency).ok_or_else(|| fail("no frequency".into(), "frequency = \"290 Hz\""))?;
        if frequency.value <= 0.0 {
            return Err(fail(format!("a natural frequency of {}", frequency.unit.print(frequency.value)), "a frequency above 0 Hz"));
        }
        let damping = row.number(Role::Damping);
        if let Some(d) = damping.as_ref().filter(|d| d.value < 0.0) {
            return Err(fail(format!("a damping ratio of {}", d.unit.print(d.value)), "a damping ratio of 0 or above, such as \"5.3 %\""));
        }
        modes.push(ModeRow {
            mode: mode as u32,
            frequency,
            damping,
            family: row.text(Role::Family),
            description: row.text(Role::Description),
            place: row.place.clone(),
        });
    }
    Ok(ModalTable { rows: modes, notes: vec![] })
}

pub(super) fn energy(table: &TableView<'_>, id: &str, common: &Conditions, source: &Source<'_>) -> Result<EnergyTable, DataError> {
    let limits = ["force_min", "force_max", "displacement_min", "displacement_max", "amplitude", "mean"];
    only(table, &[&["file", "channels", "rows", "noise", "at", "control", "W_s_reading"][..], &limits].concat())?;
    let at = place(&table.require("at", "the place that is driven, such as \"c1.x\"")?)?;
    let control = table.require("control", "\"force\" or \"displacement\"")?.word("control", &Control::WORDS)?;
    let limits = self::limits(table, control, &at)?;
    let readings = [("slope", StoredEnergy::Slope), ("product", StoredEnergy::Product)];
    let stored = table.optional("W_s_reading", |v| v.word("reading of W_s", &readings))?;
    let mut cycles = Vec::new();
    for row in rows(table, id, source, &ENERGY_ROLES, &[], true)? {
        let fail = |message: String, accepted: &str| at_row(source, id, &row.place, message, accepted);
        let mut conditions = common.clone();
        conditions.extend(row.conditions.clone().unwrap_or_default());
        let frequency = row.number(Role::Frequency).map(|v| v.value).or(conditions.get("frequency").map(|c| c.value));
        if frequency.is_some_and(|f| f <= 0.0) {
            return Err(fail("a frequency that is not above 0".into(), "a frequency above 0 Hz"));
        }
        let (dissipated, stored, ratio) = (row.number(Role::DissipatedEnergy), row.number(Role::StoredEnergy), row.number(Role::LossRatio));
        if dissipated.is_none() && stored.is_none() && ratio.is_none() {
            return Err(fail("none of W_D, W_s, D".into(), "W_D = \"1.04 mJ\", W_s = \"249 mJ\" or D = 0.004"));
        }
        // Energies are compared as logarithms: zero and below have none.
        if let Some(v) = [&dissipated, &stored, &ratio].into_iter().flatten().find(|v| v.value <= 0.0) {
            return Err(fail(format!("an energy or ratio of {}", v.unit.print(v.value)), "energies above 0"));
        }
        cycles.push(EnergyRow { case: row.text(Role::Case), conditions, frequency, dissipated, stored, ratio, place: row.place.clone() });
    }
    Ok(EnergyTable { at, control, limits, stored, rows: cycles })
}

/// Limits of the controlled quantity: least and greatest, or mean and amplitude (peak).
fn limits(table: &TableView<'_>, control: Control, at: &str) -> Result<Option<(f64, f64)>, TomlError> {
    let (dimensions, min, max, other) = match control {
        Control::Force => ([Dimension::FORCE, Dimension::MOMENT], "force_min", "force_max", ["displacement_min", "displacement_max"]),
        Control::Displacement => {
            ([Dimension::LENGTH, Dimension::ANGLE], "displacement_min", "displacement_max", ["force_min", "force_max"])
        }
    };
    let dimensions = channel::along_axis(&dimensions, Some(at));
    if let Some(v) = other.iter().find_map(|k| table.get(k)) {
        return Err(
            v.refuse(format!("not a limit under {} control", control.role().word()), format!("{min} and {max}, or amplitude and mean"))
        );
    }
    let read = |key: &str| table.optional(key, |v| v.quantity_of(&dimensions).map(|q| q.value));
    let (low, high, amplitude, mean) = (read(min)?, read(max)?, read("amplitude")?, read("mean")?);
    let refuse =
        |message: &str| table.refuse(message.to_string(), format!("{min} and {max} with {min} below {max}, or amplitude above 0 and mean"));
    match (low, high, amplitude, mean) {
        (Some(low), Some(high), None, None) if low < high => Ok(Some((low, high))),
        (None, None, Some(a), m) if a > 0.0 => Ok(Some((m.unwrap_or(0.0) - a, m.unwrap_or(0.0) + a))),
        (None, None, None, None) => Ok(None),
        (Some(_), Some(_), None, None) => Err(refuse("the limits cross")),
        (None, None, Some(_), _) => Err(refuse("an amplitude that is not above 0")),
        _ => Err(refuse("the limits of the cycle are not complete, or given twice")),
    }
}

/// The rows of a table of these roles. `amplitudes`: dimensions that a column of amplitudes may have; `own_conditions`: whether a row may state conditions.
pub(super) fn rows(
    table: &TableView<'_>,
    id: &str,
    source: &Source<'_>,
    roles: &[Role],
    amplitudes: &[Dimension],
    own_conditions: bool,
) -> Result<Vec<Row>, DataError> {
    let noise = table.optional("noise", |v| v.deviation(&Unit::si(Dimension::DIMENSIONLESS), 1.0))?;
    let mut rows = match (table.has("rows"), table.has("file")) {
        (true, false) => {
            if let Some(v) = table.get("channels") {
                return Err(v
                    .refuse("channels belong to a file, and the rows stand here", "rows without channels, or file and channels")
                    .into());
            }
            inline(table, roles, amplitudes, own_conditions)?
        }
        (false, true) => from_file(table, id, source, roles, amplitudes)?,
        _ => return Err(table.refuse("the table is not there, or twice", "rows = [{ ... }], or file and channels").into()),
    };
    if rows.is_empty() {
        return Err(table.refuse("the table has no rows", "at least one row").into());
    }
    if let Some(noise) = noise {
        let values = rows.iter_mut().flat_map(|r| &mut r.numbers);
        values
            .filter(|(role, _)| !matches!(role, Role::Mode | Role::Amplitude))
            .for_each(|(_, v)| v.sigma = v.sigma.or(Some(noise * v.value.abs())));
    }
    // One column is printed to one digit; a trailing zero may be left out in one row.
    for role in roles {
        let finest = rows.iter().filter_map(|r| r.number(*role)).map(|v| v.rounding).fold(f64::INFINITY, f64::min);
        rows.iter_mut().flat_map(|r| &mut r.numbers).filter(|n| n.0 == *role).for_each(|(_, v)| v.rounding = finest);
    }
    Ok(rows)
}

fn inline(table: &TableView<'_>, roles: &[Role], amplitudes: &[Dimension], own_conditions: bool) -> Result<Vec<Row>, TomlError> {
    let mut keys: Vec<String> = roles.iter().map(|r| r.word().to_string()).collect();
    let measured = |r: &&Role| !r.is_text() && !matches!(r, Role::Mode | Role::Amplitude);
    keys.extend(roles.iter().filter(measured).map(|r| format!("sigma_{}", r.word())));
    if own_conditions {
        keys.push("conditions".to_string());
    }
    let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
    let mut rows = Vec::new();
    for row in table.tables("rows")? {
        row.only(&keys)?;
        let mut out = Row { place: format!("line {}", row.line()), ..Row::default() };
        if own_conditions {
            out.conditions = Some(conditions(&row)?);
        }
        for role in roles {
            let word = role.word();
            let Some(value) = row.get(word) else {
                if let Some(sigma) = row.get(&format!("sigma_{word}")) {
                    return Err(sigma.refuse(format!("a sigma without {word}"), format!("{word} beside it")));
                }
                continue;
            };
            if role.is_text() {
                out.texts.push((*role, value.string()?.to_string()));
                continue;
            }
            let dimension = role.dimensions().first().or(amplitudes.first()).copied().unwrap_or(Dimension::DIMENSIONLESS);
            let mut number = self::number(&value, dimension)?;
            if let Some(sigma) = row.get(&format!("sigma_{word}")) {
                if number.sigma.is_some() {
                    return Err(sigma.refuse("the standard deviation is given twice", "sigma once"));
                }
                number.sigma = Some(sigma.deviation(&number.unit, number.value)?);
            }
            out.numbers.push((*role, number));
        }
        rows.push(out);
    }
    Ok(rows)
}

fn number(value: &ValueView<'_>, dimension: Dimension) -> Result<TableValue, TomlError> {
    let spread = value.spread(Some(dimension))?;
    let (si, unit) = (spread.quantity.value, spread.quantity.unit);
    let shown = if value.is_string() { value.string()?.to_string() } else { format!("{}", unit.from_si(si)) };
    let rounding = rounding(&shown, &unit);
    Ok(TableValue { value: si, unit, sigma: spread.sigma, rounding })
}

/// Standard deviation of rounding to the last digit of a printed number, SI.
fn rounding(shown: &str, unit: &Unit) -> f64 {
    let mantissa = shown.trim_start().trim_start_matches(['+', '-', '−']);
    let digits = mantissa.find(|c: char| !(c.is_ascii_digit() || c == '.')).map_or(mantissa, |end| &mantissa[..end]);
    let decimals = digits.split_once('.').map_or(0, |(_, d)| d.len());
    let exponent = mantissa[digits.len()..].strip_prefix(['e', 'E']).map_or("", |e| e);
    let sign_and_digits = exponent.char_indices().take_while(|(i, c)| c.is_ascii_digit() || (*i == 0 && matches!(c, '+' | '-'))).count();
    let exponent: i32 = exponent[..sign_and_digits].parse().unwrap_or(0);
    unit.difference_to_si(10f64.powi(exponent.saturating_sub(decimals.min(300) as i32))) / 12f64.sqrt()
}

fn from_file(
    table: &TableView<'_>,
    id: &str,
    source: &Source<'_>,
    roles: &[Role],
    amplitudes: &[Dimension],
) -> Result<Vec<Row>, DataError> {
    let specs = channels(table, roles, amplitudes)?;
    let file = source.file(table, id)?;
    // Columns of sigma are read as further columns.
    let sigma_specs: Vec<(usize, ChannelSpec)> = specs
        .iter()
        .enumerate()
        .filter_map(|(i, s)| s.sigma_column.as_ref().map(|c| (i, ChannelSpec { column: c.clone(), ..s.clone() })))
        .collect();
    let all: Vec<ChannelSpec> = specs.iter().cloned().chain(sigma_specs.iter().map(|s| s.1.clone())).collect();
    if specs.is_empty() {
        return Err(no_channel(table, &format!("role = \"{}\"", roles[0].word())).into());
    }
    let read: Columns = columns(table, id, &file, &all)?;
    let mut rows: Vec<Row> =
        (0..read.len()).map(|i| Row { place: format!("{}, {}", file.display(), read.place(i)), ..Row::default() }).collect();
    for (k, (spec, column)) in specs.iter().zip(&read.columns).enumerate() {
        let sigmas = sigma_specs.iter().zip(&read.columns[specs.len()..]).find(|(s, _)| s.0 == k).map(|(_, c)| c);
        for (i, row) in rows.iter_mut().enumerate() {
            match column {
                Column::Text(cells) => row.texts.push((spec.role, cells[i].clone())),
                Column::Numbers(cells) => {
                    let mut value = [cells[i]];
                    to_si(&file, &read, id, spec, &mut value)?;
                    let [value] = value;
                    let sigma = match (sigmas, spec.sigma) {
                        (Some(Column::Numbers(s)), _) => Some(stated(&file, &read, i, id, spec, spec.unit.difference_to_si(s[i]))?),
                        (_, Some(Sigma::Absolute(s))) => Some(s),
                        (_, Some(Sigma::Relative(f))) => Some(f * value.abs()),
                        _ => None,
                    };
                    let rounding = rounding(&format!("{}", cells[i]), &spec.unit);
                    row.numbers.push((spec.role, TableValue { value, unit: spec.unit.clone(), sigma, rounding }));
                }
            }
        }
    }
    Ok(rows)
}

fn stated(file: &Path, rows: &Columns, i: usize, id: &str, spec: &ChannelSpec, sigma: f64) -> Result<f64, DataError> {
    if sigma > 0.0 && sigma <= MAGNITUDE {
        return Ok(sigma);
    }
    let message = format!("a standard deviation of {}", spec.unit.print_difference(sigma));
    let accepted = format!("a standard deviation above 0, and of at most {MAGNITUDE:e} in SI");
    Err(content(file, Some(rows.place(i)), id, spec, &message, &accepted))
}

pub(super) fn at_row(source: &Source<'_>, id: &str, place: &str, message: String, accepted: &str) -> DataError {
    let (file, row): (PathBuf, String) = match place.rsplit_once(", ") {
        Some((file, row)) => (PathBuf::from(file), row.to_string()),
        None => (source.toml().to_path_buf(), place.to_string()),
    };
    Content { file, row: Some(row), test: id.to_string(), channel: None, message, accepted: accepted.to_string() }.into()
}

#[cfg(test)]
mod tests;
