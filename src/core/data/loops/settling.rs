//! Whether the kept cycles repeat: what their means, their amplitudes and the distances between neighbours do from the first to the last,
//! beyond their scatter. The distances see a transient at any frequency, the others what creeps.
//!
//! Each is held against decays of several lengths, from a first cycle apart from the rest (a transient that is soon gone) to a trend, by
//! regression and with Student's t. A decay that fits none of them would count as scatter and hide itself. What is found is claimed when it
//! matters as well: when it exceeds the deviation of the mean loop.

use statrs::distribution::{ContinuousCDF, StudentsT};
use std::f64::consts::TAU;

/// Probability by chance below which a change is claimed, over all tests of a channel.
const SIGNIFICANCE: f64 = 1e-3;
/// What a transient keeps of itself from cycle to cycle: nothing, parts between which any other is found from eight cycles on, and all of it
/// (a trend).
const KEPT: [f64; 6] = [0.0, 0.3, 0.5, 0.7, 0.85, 1.0];
/// Tests of a channel: mean, amplitude and distance against each decay.
const TESTS: f64 = 3.0 * KEPT.len() as f64;
/// Cycles needed: with fewer there is no scatter to hold a change against.
const FEWEST: usize = 4;

/// A channel whose kept cycles still change.
#[derive(Debug, Clone, PartialEq)]
pub struct Unsettled {
    /// `force at c1.x`.
    pub channel: String,
    /// What changes and by how much, in words.
    pub claim: String,
    /// Student's t of the change.
    pub t: f64,
    /// t beyond which it is claimed.
    pub threshold: f64,
}

/// What changes from cycle to cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Mean,
    /// Of the first harmonic.
    Amplitude,
    /// Distance of a cycle from the next, which falls to `last` (rms, SI).
    Distance {
        last: f64,
    },
}

/// A change over the cycles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change {
    pub kind: Kind,
    /// From the first to the last of the cycles, SI; of a distance the first.
    pub size: f64,
    pub t: f64,
    pub threshold: f64,
}

/// Significant changes over `folded`, cycles x n values: of mean and amplitude, the clearest first, then of the distance between
/// neighbours. `floor` is the least deviation a sample is said to have.
pub(super) fn changes(folded: &[f64], n: usize, floor: f64) -> Vec<Change> {
    let cycles = folded.len() / n;
    let Some(limit) = threshold(cycles) else { return vec![] };
    let wave = |c: &[f64], shift: f64| {
        c.iter().enumerate().map(|(j, v)| v * (TAU * j as f64 / n as f64 + shift).cos()).sum::<f64>() * 2.0 / n as f64
    };
    let all: Vec<&[f64]> = folded.chunks(n).collect();
    let means: Vec<f64> = all.iter().map(|c| c.iter().sum::<f64>() / n as f64).collect();
    let amplitudes: Vec<f64> = all.iter().map(|c| wave(c, 0.0).hypot(wave(c, 0.25 * TAU))).collect();
    let apart = |w: &[&[f64]]| (w[0].iter().zip(w[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / n as f64).sqrt();
    let distances: Vec<f64> = all.windows(2).map(apart).collect();
    let mut found = Vec::new();
    for (kind, x) in [(Kind::Mean, &means), (Kind::Amplitude, &amplitudes)] {
        let least = floor / (n as f64).sqrt();
        found.extend(KEPT.map(|kept| decay(x, kept, least)).map(|(size, t)| Change { kind, size, t, threshold: limit }));
    }
    found.sort_by(|a, b| b.t.abs().total_cmp(&a.t.abs()));
    if let Some(limit) = threshold(distances.len()) {
        // As logarithms, whose deviation is that of a standard deviation from n samples at least. Neighbouring distances have a cycle in
        // common, which correlates their squares by a quarter. A transient makes them fall.
        let logarithms: Vec<f64> = distances.iter().map(|d| d.max(floor).ln()).collect();
        let (threshold, least) = (limit * 1.5f64.sqrt(), (0.5 / n as f64).sqrt());
        let (first, last) = (distances[0], distances[distances.len() - 1]);
        let kind = Kind::Distance { last };
        let falls = KEPT.map(|kept| decay(&logarithms, kept, least)).into_iter().filter(|(size, _)| *size < 0.0);
        found.extend(falls.map(|(_, t)| Change { kind, size: (first * first - last * last).max(0.0).sqrt(), t, threshold }));
    }
    found.retain(|c| c.t.abs() > c.threshold);
    found
}

/// Student's t beyond which a change in `count` numbers is claimed; none where they are too few.
fn threshold(count: usize) -> Option<f64> {
    if count < FEWEST {
        return None;
    }
    let two_sided = SIGNIFICANCE / TESTS;
    Some(-StudentsT::new(0.0, 1.0, (count - 2) as f64).ok()?.inverse_cdf(0.5 * two_sided))
}

/// Change from the first to the last value of a decay that keeps this part from one to the next, by regression, and its t.
fn decay(x: &[f64], kept: f64, least: f64) -> (f64, f64) {
    let n = x.len() as f64;
    let shape: Vec<f64> = (0..x.len()).map(|c| if kept < 1.0 { -kept.powi(c as i32) } else { c as f64 }).collect();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (middle, level) = (mean(&shape), mean(x));
    let sxx: f64 = shape.iter().map(|s| (s - middle).powi(2)).sum();
    let slope = shape.iter().zip(x).map(|(s, v)| (s - middle) * v).sum::<f64>() / sxx;
    let rest: f64 = shape.iter().zip(x).map(|(s, v)| (v - level - slope * (s - middle)).powi(2)).sum();
    let deviation = (rest / (n - 2.0)).sqrt().max(least);
    (slope * (shape[x.len() - 1] - shape[0]), slope * sxx.sqrt() / deviation)
}
