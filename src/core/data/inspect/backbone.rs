//! Tables of a backbone: natural frequency and damping ratio over amplitude.

use super::{FoundColumn, Role};
use crate::units::{Dimension, parse_unit};

/// Rows of a table without a damping ratio, at least: an amplitude that only rises (or only falls) in fewer says little.
const ROWS: usize = 3;
/// A natural frequency without a damping ratio changes over its table by this factor at most; the lines of a spectrum span more.
const SPAN: f64 = 2.0;

/// A backbone.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundBackbone {
    /// Amplitude, frequency, damping ratio, as far as they are there.
    pub columns: Vec<BackboneColumn>,
    pub rows: usize,
    /// Whether the amplitude is an angle.
    pub turning: bool,
}

/// A column of a backbone.
#[derive(Debug, Clone, PartialEq)]
pub struct BackboneColumn {
    pub role: Role,
    /// As dataset.toml names it.
    pub column: String,
    /// The unit the file gives, or `%` where the values of a damping ratio say so.
    pub unit: Option<String>,
    /// What says what it is, where that is a guess: `its letter alone`.
    pub guess: Option<&'static str>,
    /// Least and largest value in the unit of the file.
    pub range: (f64, f64),
}

impl FoundBackbone {
    /// The backbone that a table without a time and without parts of an FRF is; none where it is something else. Columns of a damping ratio and an amplitude say
    /// so; without the damping ratio a natural frequency does that changes little while the amplitude rises or falls from row to row.
    pub(super) fn of(columns: &[FoundColumn]) -> Option<FoundBackbone> {
        let of = |role: Role| columns.iter().find(|c| c.role == Some(role));
        let damping = of(Role::Damping).filter(|d| ratio(d));
        // Beside a damping ratio, `f` is no force.
        let letter = || columns.iter().find(|c| c.role == Some(Role::Force) && c.guessed && damping.is_some());
        let frequency = of(Role::Frequency).or_else(letter);
        let moves = |c: &&FoundColumn| {
            matches!(c.role, Some(Role::Velocity | Role::Acceleration | Role::Force)) && frequency.is_none_or(|f| f.column != c.column)
        };
        let amplitude = of(Role::Amplitude).or_else(|| of(Role::Displacement)).filter(|a| a.at.is_none())?;
        if columns.iter().any(|c| moves(&c)) {
            return None;
        }
        let (rises, falls) = (amplitude.values.is_sorted_by(|a, b| a < b), amplitude.values.is_sorted_by(|a, b| a > b));
        let nearly = frequency.is_some_and(|f| {
            let (low, high) = range(&f.values);
            low > 0.0 && high <= SPAN * low && f.values.len() >= ROWS
        });
        let sure = damping.is_some() || nearly && (rises || falls);
        let parts: Vec<(Role, &FoundColumn)> = [(Role::Amplitude, Some(amplitude)), (Role::Frequency, frequency), (Role::Damping, damping)]
            .into_iter()
            .filter_map(|(role, c)| Some((role, c?)))
            .collect();
        let whole = parts.iter().all(|(_, c)| c.values.len() == amplitude.values.len() && c.values.iter().any(|v| *v > 0.0));
        if !sure || parts.len() < 2 || !whole {
            return None;
        }
        let turning = amplitude.unit.as_deref().is_some_and(|u| parse_unit(u, Dimension::ANGLE).is_ok());
        let columns = parts.into_iter().map(|(role, c)| BackboneColumn::of(role, c)).collect();
        Some(FoundBackbone { columns, rows: amplitude.values.len(), turning })
    }
}

impl BackboneColumn {
    fn of(role: Role, c: &FoundColumn) -> BackboneColumn {
        let range = range(&c.values);
        let bare = role == Role::Damping && c.unit.is_none();
        let (unit, guess) = match (bare, range.1 >= 1.0) {
            (true, true) => (Some("%".into()), Some("values of 1 and more, read as %")),
            (true, false) => (None, Some("values below 1, read as a ratio")),
            (false, _) => (c.unit.clone(), c.guessed.then_some("its letter alone")),
        };
        BackboneColumn { role, column: c.column.clone(), unit, guess, range }
    }
}

/// Whether the numbers of a column can be damping ratios, or per cent of them.
fn ratio(c: &FoundColumn) -> bool {
    c.values.iter().all(|v| (0.0..100.0).contains(v) || v.is_nan())
}

fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
}
