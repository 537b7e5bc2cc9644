//! The linear mode that a nonlinear one begins from.

use std::f64::consts::TAU;

use nalgebra::Vector2;

use crate::model::{Bound, Element, Model};

use super::super::super::EngineError;
use super::super::super::modal::{Mode, Modes, Range};

/// Which mode a backbone is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Which {
    /// By its number among the modes that swing at small amplitude, from 1.
    Number(usize),
    /// The one nearest to a frequency [Hz], of those that move the place.
    Nearest(f64),
}

/// Displacement at the place, in parts of the largest of the mode, below which the place is a node.
const NODE: f64 = 1e-6;

/// `ln w` (w in rad/s) and damping ratio of the linear mode at small amplitude, friction stuck. Where a law has no small-signal limit (Coulomb's friction), or damps the
/// mode beyond its critical damping there, the mode is that of the structure without nonlinear laws that read a velocity.
///
/// # Errors
/// [`EngineError::NoNonlinearMode`] where the model has no such mode, or the place is a node of it; those of the modes.
pub(super) fn linear(model: &Model, bound: &Bound, row: &[(usize, f64)], which: Which) -> Result<Vector2<f64>, EngineError> {
    match chosen(model, bound, row, which) {
        Err(EngineError::Effect(_) | EngineError::NoNonlinearMode { .. } | EngineError::NoMode { .. }) => {
            let still = |e: &Element| e.is_linear_at_every_amplitude() || !e.reads_rates().0;
            chosen(model, &only(bound, still), row, which)
        }
        found => found,
    }
}

/// The same of the structure without nonlinear laws that read a velocity or remember.
///
/// # Errors
/// As [`linear`].
pub(super) fn without_friction(model: &Model, bound: &Bound, row: &[(usize, f64)], which: Which) -> Result<Vector2<f64>, EngineError> {
    let free = |e: &Element| e.is_linear_at_every_amplitude() || !(e.reads_rates().0 || e.n_states() > 0);
    chosen(model, &only(bound, free), row, which)
}

/// The elements that are wanted, of those taken apart. Candidates of the score test are left out: one in series would keep all that is at its place together.
fn only(bound: &Bound, wanted: impl Fn(&Element) -> bool) -> Bound {
    let mut some = bound.without_followers().0.apart();
    some.elements.retain(wanted);
    some
}

fn chosen(model: &Model, bound: &Bound, row: &[(usize, f64)], which: Which) -> Result<Vector2<f64>, EngineError> {
    let refuse = |why: String| EngineError::NoNonlinearMode { why };
    let most = model.dofs.len();
    let mut count = if let Which::Number(number) = which { number } else { 1 }.min(most);
    let mut modes = Modes::new(model, bound, Range::Lowest(count), false)?;
    let swings = loop {
        let found = modes.lowest(count)?;
        let swings: Vec<Mode> = found.iter().filter(|m| m.oscillates()).cloned().collect();
        let enough = match which {
            Which::Number(number) => swings.len() >= number,
            // The highest of them lies farther from the frequency than the nearest below it may.
            Which::Nearest(frequency) => swings.iter().any(|m| m.frequency_hz > 2.0 * frequency && moves(m, row)),
        };
        if enough || count >= most || found.len() < count {
            break swings;
        }
        count = (2 * count).min(most);
    };
    let mode = match which {
        Which::Number(number) => {
            let mode = swings.get(number.saturating_sub(1));
            mode.ok_or_else(|| {
                refuse(format!("mode {number} was asked for, and the model has {} that swing at small amplitude", swings.len()))
            })?
        }
        Which::Nearest(frequency) => {
            let off = |m: &&Mode| (m.frequency_hz / frequency).ln().abs();
            let moving = swings.iter().filter(|m| moves(m, row));
            let nearest = moving.min_by(|a, b| off(a).total_cmp(&off(b)));
            nearest.ok_or_else(|| refuse("no mode of the model that swings at small amplitude moves the place".into()))?
        }
    };
    if !moves(mode, row) {
        return Err(refuse(format!("the place is a node of the mode at {:.6} Hz: it stands still", mode.frequency_hz)));
    }
    Ok(Vector2::new((mode.frequency_hz * TAU).ln(), mode.damping))
}

/// Whether a mode moves the place.
fn moves(mode: &Mode, row: &[(usize, f64)]) -> bool {
    let there = row.iter().map(|(d, b)| mode.shape[*d] * *b).sum::<num_complex::Complex64>().norm();
    there > NODE * mode.shape.iter().map(|x| x.norm()).fold(0.0, f64::max)
}
