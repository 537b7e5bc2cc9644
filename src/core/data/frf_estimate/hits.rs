//! Hammer blows: finding them, and leaving out the overloaded and the double ones.

use super::{EstimateError, Request};
use std::fmt;

/// A block that was left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejected {
    /// First sample.
    pub start: usize,
    pub reason: &'static str,
}

impl fmt::Display for Rejected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "block at sample {}: {}", self.start + 1, self.reason)
    }
}

/// A blow begins where the force passes this part of the greatest of the record.
const TRIGGER: f64 = 0.15;
/// A pulse ends where the force is below this part of its peak.
const PULSE: f64 = 0.02;
/// A second peak of this part of the first makes a double hit.
const DOUBLE: f64 = 0.05;
/// Part of a block before the blow.
const PRETRIGGER: f64 = 0.02;
/// So many equal samples at the extreme of a channel are no peak.
const FLAT: usize = 3;

/// The levels at which a channel clips.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clip {
    level: Option<f64>,
    range: (f64, f64),
}

impl Clip {
    pub fn of(values: &[f64], level: Option<f64>) -> Self {
        let range = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        Self { level, range }
    }

    fn hit(&self, values: &[f64]) -> bool {
        match self.level {
            Some(level) => values.iter().any(|v| v.abs() >= level),
            None => flat(values, self.range),
        }
    }
}

fn flat(values: &[f64], (low, high): (f64, f64)) -> bool {
    low < high && values.windows(FLAT).any(|w| (w[0] == high || w[0] == low) && w.iter().all(|v| *v == w[0]))
}

/// Whether a channel stands still at its extreme: clipped by the amplifier or the converter.
pub fn clipped(values: &[f64]) -> bool {
    let clip = Clip::of(values, None);
    clip.hit(values)
}

pub(super) fn overloaded(force: &[f64], response: &[f64], clip: &(Clip, Clip)) -> Option<&'static str> {
    if clip.0.hit(force) {
        Some("the force is overloaded")
    } else if clip.1.hit(response) {
        Some("the response is overloaded")
    } else {
        None
    }
}

/// What a channel reads at rest: the mean before the blow.
pub(super) fn rest(block: &[f64]) -> f64 {
    let n = ((PRETRIGGER * block.len() as f64) as usize / 2).max(1).min(block.len());
    super::mean(&block[..n])
}

/// Where the pulse of a block has died.
pub(super) fn pulse_end(force: &[f64]) -> usize {
    let base = rest(force);
    let (peak, size) = peak(force, base);
    // Room for the ringing of the gauge: twice the time from the peak to the threshold.
    let after = force[peak..].iter().position(|f| (f - base).abs() < PULSE * size).unwrap_or(force.len() - peak);
    (peak + 2 * after + 4).min(force.len())
}

fn peak(force: &[f64], base: f64) -> (usize, f64) {
    force.iter().enumerate().map(|(k, f)| (k, (f - base).abs())).fold((0, 0.0), |best, k| if k.1 > best.1 { k } else { best })
}

/// Starts of the blocks of single blows.
pub(super) fn hits(force: &[f64], response: &[f64], request: &Request, rejected: &mut Vec<Rejected>) -> Result<Vec<usize>, EstimateError> {
    let n = request.block;
    let mut sorted: Vec<f64> = force.to_vec();
    let middle = sorted.len() / 2;
    let (_, median, _) = sorted.select_nth_unstable_by(middle, f64::total_cmp);
    let base = *median;
    let mut deviations: Vec<f64> = force.iter().map(|f| (f - base).abs()).collect();
    let (_, noise, _) = deviations.select_nth_unstable_by(middle, f64::total_cmp);
    let noise = 1.4826 * *noise;
    let greatest = peak(force, base).1;
    if greatest.is_nan() || greatest <= 12.0 * noise || greatest == 0.0 {
        return Err(EstimateError::NoHits);
    }
    let level = (TRIGGER * greatest).max(8.0 * noise);
    let before = (PRETRIGGER * n as f64) as usize;
    let clip = (Clip::of(force, request.overload.0), Clip::of(response, request.overload.1));
    let (mut starts, mut at) = (Vec::new(), 0);
    while let Some(rise) = force.get(at..).and_then(|rest| rest.iter().position(|f| (f - base).abs() > level)).map(|k| at + k) {
        let start = rise.saturating_sub(before);
        if start + n > force.len() {
            rejected.push(Rejected { start, reason: "the record ends before the block" });
            break;
        }
        let block = &force[start..start + n];
        let reason = overloaded(block, &response[start..start + n], &clip).or_else(|| double(block, base, noise).then_some("a double hit"));
        match reason {
            Some(reason) => rejected.push(Rejected { start, reason }),
            None => starts.push(start),
        }
        at = start + n;
    }
    Ok(starts)
}

/// Whether a second pulse stands in the block.
fn double(force: &[f64], base: f64, noise: f64) -> bool {
    let end = pulse_end(force);
    let (first, size) = peak(&force[..end], base);
    let limit = (DOUBLE * size).max(8.0 * noise);
    if force[end..].iter().any(|f| (f - base).abs() > limit) {
        return true;
    }
    // Two peaks that touch: a deep valley between the first and a later one.
    let sign = (force[first] - base).signum();
    let mut lowest = f64::INFINITY;
    force[first..end].iter().any(|f| {
        let v = sign * (f - base);
        lowest = lowest.min(v);
        v > lowest.max(0.0) + 0.25 * size && v > limit
    })
}
