//! The channels of a test within the vector of its points.

use crate::units::Unit;

/// What the points of a block are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockKind {
    /// One settled cycle against phase.
    Loop,
    /// Complex lines, real and imaginary part in turn.
    Frf,
    /// A record against time.
    Record,
    /// Rows of a table, as natural logarithms of energies in J.
    Table,
}

/// One channel of a test within the test's vector of points.
#[derive(Clone, Debug)]
pub struct Block {
    /// `force at c1.x`.
    pub label: String,
    /// Role of the channel in one word, as in `test.role`.
    pub role: String,
    /// SI unit.
    pub unit: String,
    /// Unit that the file states the values in; texts about single values use it.
    pub stated: Unit,
    /// Unit that the file states an amplitude in, where the abscissa is one.
    pub amplitude_unit: Option<Unit>,
    /// Kind of points.
    pub kind: BlockKind,
    /// Rows of the test's vector.
    pub range: std::ops::Range<usize>,
    /// Phase [rad], frequency [Hz], time [s], amplitude [m or rad] or row number; one per point (FRF: one per line).
    pub abscissa: Vec<f64>,
    /// Driven displacement at the points of a displacement-controlled test [m or rad], for loop plots; else empty.
    pub x: Vec<f64>,
    /// Driven velocity at the same.
    pub v: Vec<f64>,
}
