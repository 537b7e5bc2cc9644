//! The virtual bench of a trial: one driven connector or a chain, loops and frequency responses, and what its instruments do to them.

use num_complex::Complex64;

use super::law::Law;
use super::{chain, connector};

/// What the instruments of the bench may err by, standard deviations: gain of a loop or a record, of an FRF's sensors, offset in parts of half the
/// range, delay in parts of the period.
const GAIN: f64 = 1e-3;
const CALIBRATION: f64 = 0.005;
const OFFSET: f64 = 0.005;
const DELAY: f64 = 3e-4;

/// Samples per cycle of a loop of the clean kind.
pub const SAMPLES: usize = 128;
/// Cycles that are kept of one.
pub const KEPT: usize = 4;

/// How a loop is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Samples per cycle.
    pub samples: usize,
    /// Cycles kept.
    pub kept: usize,
    /// Cycles over which the drive of a connector grows, in the record and not declared.
    pub run_up: usize,
}

impl Default for Record {
    fn default() -> Self {
        Record { samples: SAMPLES, kept: KEPT, run_up: 0 }
    }
}

/// A spring, a damper and a mass of a chain over those of their groups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Factor on the stiffness.
    pub stiffness: f64,
    /// Factor on the damping.
    pub damping: f64,
    /// Factor on the mass.
    pub mass: f64,
}

/// What is hidden.
#[derive(Clone, Debug)]
pub enum Hidden {
    /// A force in parallel; size in parts of the spring's largest force.
    Force(Law),
    /// Free play in series; size in parts of the largest displacement.
    Gap,
    /// A spring in series; size in parts of the connector's own compliance.
    Compliance,
    /// `k exp(size u)`, `u` the condition from -1/2 to 1/2 of its span.
    Exponent,
    /// `k (1 + size u)`.
    Slope,
}

/// A hidden effect at a place.
#[derive(Clone, Debug)]
pub struct Planted {
    /// Name in the library; `outside: ...` where it has none.
    pub effect: String,
    /// The law.
    pub hidden: Hidden,
    /// Its size without unit.
    pub size: f64,
    /// 0: the base, or the one connector; j: c_j of a chain.
    pub place: usize,
}

/// The structure.
#[derive(Clone, Debug)]
pub struct Bench {
    /// Bodies; 0: one massless connector under displacement control.
    pub bodies: usize,
    /// Mass of each [kg].
    pub mass: f64,
    /// Free parameters: k and c of the connector, or k_base, c_base, k, c of the chain [N/m, N s/m]. c may be left out of the first.
    pub params: Vec<f64>,
    /// Largest force of a spring [N].
    pub force: f64,
    /// Largest displacement of a connector [m].
    pub travel: f64,
    /// The parts of a chain over their groups, from the ground; empty: all alike.
    pub parts: Vec<Part>,
}

/// A test of the bench.
#[derive(Clone, Debug)]
pub struct Test {
    /// Its id.
    pub id: String,
    /// What is driven.
    pub drive: Drive,
    /// Noise in parts of the signal.
    pub noise: f64,
    /// `fit`, `select` or `held_out`.
    pub split: &'static str,
    /// Test condition: its value as written and its place in its span, from -1/2 to 1/2.
    pub condition: Option<(String, f64)>,
    /// How it is recorded.
    pub record: Record,
}

impl Test {
    /// Channels that are read.
    pub fn channels(&self) -> usize {
        match &self.drive {
            Drive::Loop { bodies, .. } | Drive::Hit { bodies, .. } => bodies.len().max(1),
            Drive::Frf { .. } => 1,
        }
    }

    /// Samples of a loop, from the start of its record.
    pub fn length(&self) -> usize {
        match &self.drive {
            Drive::Loop { discard, .. } => (discard + self.record.kept) * self.record.samples,
            Drive::Hit { samples, .. } => *samples,
            Drive::Frf { lines, .. } => lines.len(),
        }
    }
}

impl Planted {
    /// Whether its law has a response about a mean: those in closed form over frequency alone have none at rest.
    pub fn has_mean(&self) -> bool {
        !matches!(&self.hidden, Hidden::Force(Law::Hysteretic { .. } | Law::Fractional { .. }))
    }
}

/// The drive.
#[derive(Clone, Debug)]
pub enum Drive {
    /// Sine of displacement (connector, m) or of force on the last body (chain, N) about a mean.
    Loop { frequency: f64, amplitude: f64, mean: f64, discard: usize, bodies: Vec<usize> },
    /// A half sine of force on the last body at rest, then its ringing: length [s], peak [N], time between samples [s], their number.
    Hit { length: f64, force: f64, dt: f64, samples: usize, bodies: Vec<usize> },
    /// Small force on the last body, acceleration of body `respond` over it at these frequencies [Hz].
    Frf { respond: usize, lines: Vec<f64> },
}

/// An error of an instrument.
#[derive(Clone, Debug)]
pub struct Flaw {
    /// gain, delay, offset, drift, moving_mass.
    pub effect: &'static str,
    /// Id of the test, or `*`.
    pub test: String,
    /// Role of the channel: force, displacement, response.
    pub role: &'static str,
    /// gain - 1; delay over the period (of the highest drive, or of the highest line); offset and drift over a record in parts of the
    /// amplitude; mass in parts of k/w^2 at the highest drive.
    pub size: f64,
}

/// The channels that answer, each with the standard deviation of a sample; an FRF as real and imaginary parts in two channels.
pub struct Response {
    /// Values by channel [SI].
    pub channels: Vec<Vec<f64>>,
    /// Standard deviations by channel.
    pub sigma: Vec<Vec<f64>>,
}

impl Bench {
    /// Stiffness and damping of connector `i` of a chain, counted from the base [N/m, N s/m].
    pub fn link(&self, params: &[f64], i: usize) -> (f64, f64) {
        let j = if i == 0 { 0 } else { 2 };
        let (stiffness, damping) = self.parts.get(i).map_or((1.0, 1.0), |p| (p.stiffness, p.damping));
        (params[j] * stiffness, params[j + 1] * damping)
    }

    /// Mass of body `i` of a chain, counted from 0 [kg].
    pub fn mass_of(&self, i: usize) -> f64 {
        self.mass * self.parts.get(i).map_or(1.0, |p| p.mass)
    }

    /// Highest drive of these tests [Hz].
    fn highest(tests: &[Test]) -> f64 {
        let top = |t: &Test| match &t.drive {
            Drive::Loop { frequency, .. } => *frequency,
            Drive::Hit { length, .. } => 0.5 / length,
            Drive::Frf { lines, .. } => lines.last().copied().unwrap_or(0.0),
        };
        tests.iter().map(top).fold(0.0, f64::max)
    }

    /// What the instruments read, without noise; of a loop every cycle from the start.
    pub fn read(&self, params: &[f64], planted: &[Planted], flaws: &[Flaw], tests: &[Test], test: &Test) -> Response {
        let highest = Self::highest(tests);
        let here = |f: &&Flaw, role: &str| (f.test == "*" || f.test == test.id) && f.role == role;
        match &test.drive {
            Drive::Loop { frequency, amplitude, mean, discard, bodies } => {
                let (cycles, n) = (discard + test.record.kept, test.record.samples);
                let u = test.condition.as_ref().map_or(0.0, |c| c.1);
                let (mut channels, role) = if self.bodies == 0 {
                    (vec![connector::march(self, params, planted, (*frequency, *amplitude, *mean), (cycles, test.record), u)], "force")
                } else {
                    (chain::march(self, params, planted, (*frequency, *amplitude, *mean), (cycles, n), bodies), "displacement")
                };
                let sigma = channels.iter().map(|c| vec![test.noise * rms(&c[c.len() - n..]); c.len()]).collect();
                for flaw in flaws.iter().filter(|f| here(f, role)) {
                    // A mass of the load cell: its share of the spring's force at the highest drive.
                    let inertia = -flaw.size * self.params[0] * amplitude * (frequency / highest).powi(2);
                    channels.iter_mut().for_each(|c| spoil(c, flaw, n, frequency / highest, inertia));
                }
                Response { channels, sigma }
            }
            Drive::Hit { length, force, dt, samples, bodies } => {
                let hit = |t: f64| if t < *length { force * (std::f64::consts::PI * t / length).sin() } else { 0.0 };
                let mut channels = chain::ring(self, params, planted, &hit, *dt, *samples, bodies);
                let sigma = channels.iter().map(|c| vec![test.noise * rms(c); c.len()]).collect();
                for flaw in flaws.iter().filter(|f| here(f, "displacement")) {
                    channels.iter_mut().for_each(|c| spoil(c, flaw, SAMPLES, 0.0, 0.0));
                }
                Response { channels, sigma }
            }
            Drive::Frf { respond, lines } => {
                let mut h: Vec<Complex64> = lines.iter().map(|f| chain::accelerance(self, params, planted, *respond, *f)).collect();
                let level = (h.iter().map(|h| h.norm_sqr()).sum::<f64>() / h.len().max(1) as f64).sqrt();
                let sigma: Vec<f64> = h.iter().map(|h| test.noise * (h.norm() + 0.2 * level)).collect();
                for flaw in flaws.iter().filter(|f| here(f, "response")) {
                    for (h, f) in h.iter_mut().zip(lines) {
                        *h *= match flaw.effect {
                            "gain" => Complex64::new(1.0 + flaw.size, 0.0),
                            "delay" => Complex64::from_polar(1.0, -std::f64::consts::TAU * flaw.size * f / highest),
                            _ => Complex64::new(1.0, 0.0),
                        };
                    }
                }
                let channels = vec![h.iter().map(|h| h.re).collect(), h.iter().map(|h| h.im).collect()];
                Response { channels, sigma: vec![sigma.clone(), sigma] }
            }
        }
    }

    /// What errors of instruments within tolerance add to what is seen, one column for one standard deviation of each: gain, offset and
    /// delay of every channel.
    pub fn tolerances(&self, tests: &[Test], read: &[Response]) -> Vec<Vec<f64>> {
        let total: usize = tests.iter().zip(read).map(|(t, r)| r.channels.iter().map(|c| shown(t, c).len()).sum::<usize>()).sum();
        let (mut columns, mut row) = (Vec::new(), 0);
        for (test, r) in tests.iter().zip(read) {
            let averaged = averaged(test);
            let mut add = |row: usize, changes: &[(&[f64], &[f64])]| {
                let mut column = vec![0.0; total];
                let rows = changes.iter().flat_map(|(c, s)| shown(test, c).iter().zip(shown(test, s)).map(|(c, s)| c * averaged / s));
                column[row..].iter_mut().zip(rows).for_each(|(a, b)| *a = b);
                columns.push(column);
            };
            match &test.drive {
                Drive::Loop { .. } | Drive::Hit { .. } => {
                    let errors = [("gain", GAIN), ("offset", OFFSET), ("delay", DELAY)];
                    // A record has no period that a delay would be a part of.
                    let errors = if matches!(test.drive, Drive::Hit { .. }) { &errors[..2] } else { &errors[..] };
                    for (c, s) in r.channels.iter().zip(&r.sigma) {
                        for &(effect, size) in errors {
                            let mut changed = c.clone();
                            // In parts of the test's own period.
                            spoil(&mut changed, &Flaw { effect, test: "*".into(), role: "", size }, test.record.samples, 1.0, 0.0);
                            changed.iter_mut().zip(c).for_each(|(a, b)| *a -= b);
                            add(row, &[(&changed, s)]);
                        }
                        row += shown(test, c).len();
                    }
                }
                Drive::Frf { lines, .. } => {
                    let [re, im] = r.channels.as_slice() else { continue };
                    let scaled = |c: &[f64], by: &dyn Fn(usize) -> f64| c.iter().enumerate().map(|(k, c)| c * by(k)).collect::<Vec<f64>>();
                    let turn = |k: usize| -std::f64::consts::TAU * DELAY * lines[k] / lines[lines.len() - 1];
                    add(row, &[(&scaled(re, &|_| CALIBRATION), &r.sigma[0]), (&scaled(im, &|_| CALIBRATION), &r.sigma[1])]);
                    add(row, &[(&scaled(im, &|k| -turn(k)), &r.sigma[0]), (&scaled(re, &turn), &r.sigma[1])]);
                    row += 2 * lines.len();
                }
            }
        }
        columns
    }

    /// The part of a response that the analysis sees, whitened: the last cycle of a loop at the noise of the mean of the cycles.
    pub fn seen(&self, params: &[f64], planted: &[Planted], flaws: &[Flaw], tests: &[Test], sigma: &[Response]) -> Vec<f64> {
        let mut all = Vec::new();
        for (test, reference) in tests.iter().zip(sigma) {
            let r = self.read(params, planted, flaws, tests, test);
            for (c, s) in r.channels.iter().zip(&reference.sigma) {
                all.extend(shown(test, c).iter().zip(shown(test, s)).map(|(c, s)| c * averaged(test) / s));
            }
        }
        all
    }
}

/// The last cycle of a loop; every line of a frequency response.
pub fn shown<'a>(test: &Test, c: &'a [f64]) -> &'a [f64] {
    if matches!(test.drive, Drive::Loop { .. }) { &c[c.len() - test.record.samples..] } else { c }
}

/// By how much the noise of what is seen is less than that of a sample.
pub fn averaged(test: &Test) -> f64 {
    if matches!(test.drive, Drive::Loop { .. }) { (test.record.kept as f64).sqrt() } else { 1.0 }
}

/// What a flaw does to a record from phase 0; `samples` make a cycle, `share` is the drive over the highest one.
fn spoil(c: &mut [f64], flaw: &Flaw, samples: usize, share: f64, inertia: f64) {
    let n = c.len();
    let last = &c[n.saturating_sub(samples)..];
    let amplitude = 0.5 * (last.iter().fold(f64::MIN, |a, b| a.max(*b)) - last.iter().fold(f64::MAX, |a, b| a.min(*b)));
    match flaw.effect {
        "gain" => c.iter_mut().for_each(|c| *c *= 1.0 + flaw.size),
        "offset" => c.iter_mut().for_each(|c| *c += flaw.size * amplitude),
        "drift" => c.iter_mut().enumerate().for_each(|(k, c)| *c += flaw.size * amplitude * (k as f64 / n as f64 - 0.5)),
        "moving_mass" => {
            c.iter_mut().enumerate().for_each(|(k, c)| *c += inertia * (std::f64::consts::TAU * k as f64 / samples as f64).sin());
        }
        _ => {
            // The record starts at rest and is periodic at its end: linear between samples, the first held, the last cycle repeated.
            let shift = flaw.size * share * samples as f64;
            let old = c.to_vec();
            let value = |j: usize| if j < n { old[j] } else { old[n - samples + (j - n) % samples] };
            for (k, c) in c.iter_mut().enumerate() {
                let at = (k as f64 - shift).max(0.0);
                let (low, part) = (at.floor() as usize, at.fract());
                *c = value(low) + part * (value(low + 1) - value(low));
            }
        }
    }
}

/// Root mean square about the mean.
pub fn rms(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}
