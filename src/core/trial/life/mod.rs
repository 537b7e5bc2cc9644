//! A case as life is: what the model and the instruments do not know, beside what is hidden.

mod floor;
mod measure;
mod settings;
#[cfg(test)]
mod tests;
mod visible;

use serde::{Deserialize, Serialize};

use super::bench::{Drive, Hidden, Part, Planted, Record, Response, Test};
use super::draw::Draw;
use super::generate::{Generated, round};
use super::law::Law;

pub use floor::floor;
pub use measure::measure;
pub use settings::{SETTINGS, Settings};

use settings::{LINES, SAMPLINGS};

/// A kind of imperfection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, schemars::JsonSchema, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Imperfection {
    /// White noise alone: none of the others.
    White,
    /// Noise correlated within the cycle, along the record or along the lines.
    Noise,
    /// A slow part of the noise, and a force that differs from cycle to cycle.
    Cycles,
    /// Strengths that differ from test to test.
    Scatter,
    /// Sensors off linear.
    Sensor,
    /// A stated standard deviation that is wrong.
    Sigma,
    /// Gains that differ from test to test.
    Gains,
    /// A base that is wrong: springs, dampers and masses off their groups, a nonlinearity of its own.
    Base,
    /// Records of different lengths, cycles, sampling and means, some with run-up.
    Records,
}

impl Imperfection {
    /// Every kind by its word.
    pub const WORDS: [(&'static str, Imperfection); 9] = [
        ("white", Imperfection::White),
        ("noise", Imperfection::Noise),
        ("cycles", Imperfection::Cycles),
        ("scatter", Imperfection::Scatter),
        ("sensor", Imperfection::Sensor),
        ("sigma", Imperfection::Sigma),
        ("gains", Imperfection::Gains),
        ("base", Imperfection::Base),
        ("records", Imperfection::Records),
    ];

    /// Its word.
    pub fn word(self) -> &'static str {
        Self::WORDS.iter().find(|w| w.1 == self).map_or("", |w| w.0)
    }
}

/// What the model and the instruments of a case do not know.
#[derive(Clone, Debug, Default)]
pub struct Life {
    /// Nonlinearity of the base, as something planted that nobody asks for.
    pub quirks: Vec<Planted>,
    /// Parts of the base over their group; [`super::bench::Bench::parts`] of what is measured.
    pub parts: Vec<Part>,
    /// Quadratic and cubic error of the sensor of each channel at full scale, relative to full scale.
    pub sensors: Vec<[f64; 2]>,
    /// Full scale of each channel [SI].
    pub full: Vec<f64>,
    /// Test by test.
    pub tests: Vec<TestLife>,
}

/// The same of one test.
#[derive(Clone, Debug)]
pub struct TestLife {
    /// Factors on the free parameters.
    pub params: Vec<f64>,
    /// Factors on what is hidden, then on the quirks.
    pub effects: Vec<f64>,
    /// Gain of each channel.
    pub gains: Vec<f64>,
    /// Correlation of the noise of neighbouring samples or lines.
    pub correlation: f64,
    /// Standard deviation of the slow part of the noise over the whole.
    pub slow: f64,
    /// Standard deviation of the force from cycle to cycle, relative.
    pub cycles: f64,
    /// Stated over true standard deviation; none: not stated.
    pub stated: Option<f64>,
}

/// Whether an imperfection is there: all but [`Imperfection::White`] where none is chosen.
fn has(only: Option<Imperfection>, what: Imperfection) -> bool {
    only.is_none_or(|o| o == what)
}

/// Makes a drafted case one as life is, and brings what is hidden to its strength.
pub fn lived(case: &mut Generated, only: Option<Imperfection>) {
    unequal(case, only);
    let mut life = draw(case, only);
    life.full = full(case);
    let strength = visible::strengths(case, &life);
    case.noncentrality = strength * strength;
    case.life = Some(life);
}

/// Largest value of each channel of the records in time: what their sensors are ranged for.
fn full(case: &Generated) -> Vec<f64> {
    let read = |t: &Test| case.bench.read(&case.bench.params, &case.planted, &[], &case.tests, t);
    let timed = case.tests.iter().filter(|t| !matches!(t.drive, Drive::Frf { .. }));
    let all: Vec<Response> = timed.map(read).collect();
    let count = all.iter().map(|r| r.channels.len()).max().unwrap_or(0);
    let largest = |k: usize| all.iter().filter_map(|r| r.channels.get(k)).flatten().fold(f64::MIN_POSITIVE, |m, c| m.max(c.abs()));
    (0..count).map(largest).collect()
}

/// Makes the records of a case unequal; `only` restricts the imperfections to one.
fn unequal(case: &mut Generated, only: Option<Imperfection>) {
    let s = SETTINGS;
    case.nuisances.clear();
    let noise = case.draw.log(s.noise.0, s.noise.1);
    case.tests.iter_mut().for_each(|t| t.noise = noise);
    if !has(only, Imperfection::Records) {
        return;
    }
    let draw = &mut case.draw;
    let within = |draw: &mut Draw, (least, most): (usize, usize)| least + draw.below(most + 1 - least);
    if case.bench.bodies == 0 {
        // Of the fitted and selecting loops some were never run; the held-out one stays, and so does that of the instrument.
        let count = within(draw, s.loops);
        let flawed = case.instrument.as_ref().map(|f| f.test.clone());
        while case.tests.len() > count {
            let spare = |at: &usize| {
                let test = &case.tests[*at];
                let alike = case.tests.iter().filter(|t| t.split == test.split).count();
                alike > if test.split == "fit" { 2 } else { 1 } && Some(&test.id) != flawed.as_ref()
            };
            let spare: Vec<usize> = (0..case.tests.len()).filter(spare).collect();
            let Some(at) = draw.pick(&spare) else { break };
            case.tests.remove(at);
        }
    }
    let about = case.bench.bodies == 0 && draw.chance(s.mean);
    let shift = if about { s.mean_size * case.bench.travel * draw.sign() } else { 0.0 };
    let shift = if case.planted.iter().all(Planted::has_mean) { shift } else { 0.0 };
    for test in &mut case.tests {
        test.noise *= draw.log(0.7, 1.4);
        match &mut test.drive {
            Drive::Loop { discard, mean, .. } => {
                let samples = draw.pick(&SAMPLINGS).unwrap_or(128);
                let mut record = Record { samples, kept: within(draw, s.kept), run_up: 0 };
                if case.bench.bodies == 0 && draw.chance(s.run_up) {
                    record.run_up = within(draw, s.run_up_cycles);
                    *discard = record.run_up;
                }
                *mean = shift;
                test.record = record;
            }
            Drive::Hit { samples, .. } => *samples = (*samples as f64 * draw.between(0.5, 1.0)) as usize,
            Drive::Frf { lines, .. } => {
                let (low, high) = (lines[0], lines[lines.len() - 1] * draw.between(0.7, 1.0));
                let count = draw.pick(&LINES).unwrap_or(200);
                *lines = (0..count).map(|j| round(low + (high - low) * j as f64 / (count - 1) as f64, 5)).collect();
            }
        }
    }
}

/// Draws what is not known of base, tests and instruments.
fn draw(case: &mut Generated, only: Option<Imperfection>) -> Life {
    let s = SETTINGS;
    let has = |what| has(only, what);
    let mut life = Life::default();
    if has(Imperfection::Base) {
        life.quirks.push(quirk(case));
        life.parts = parts(case);
    }
    let channels = case.tests.iter().map(Test::channels).max().unwrap_or(1);
    for _ in 0..channels {
        let draw = &mut case.draw;
        let sensor = [s.sensor * draw.sign(), s.sensor * draw.sign()];
        life.sensors.push(if has(Imperfection::Sensor) { sensor } else { [0.0; 2] });
    }
    let coloured = case.draw.log(s.correlation.0, s.correlation.1);
    let lines = case.draw.log(s.correlation_lines.0, s.correlation_lines.1);
    let stated = case.draw.log(s.stated.0, s.stated.1);
    // Where the wrong one is all that is wrong, it is stated.
    let unstated = case.draw.chance(s.unstated) && only.is_none();
    let effects = case.planted.len() + life.quirks.len();
    for test in &case.tests {
        let draw = &mut case.draw;
        let frf = matches!(test.drive, Drive::Frf { .. });
        let scatter = if frf { s.scatter_frf } else { s.scatter };
        let scatter = if has(Imperfection::Scatter) { scatter } else { 0.0 };
        // The parts of a structure warm and settle together.
        let together = 1.0 + scatter * draw.normal();
        let params = (0..case.bench.params.len()).map(|j| if j % 2 == 0 { together } else { 1.0 + scatter * draw.normal() });
        let params: Vec<f64> = params.collect();
        let effects: Vec<f64> = (0..effects).map(|_| 1.0 + scatter * draw.normal()).collect();
        let gain = if has(Imperfection::Gains) { s.gain } else { 0.0 };
        let gains = (0..test.channels()).map(|_| 1.0 + (gain * draw.normal()).clamp(-s.gain_most, s.gain_most)).collect();
        let length = match &test.drive {
            Drive::Loop { .. } => coloured * test.record.samples as f64,
            Drive::Hit { dt, length, .. } => coloured * 2.0 * length / dt,
            Drive::Frf { .. } => lines,
        };
        let correlation = if has(Imperfection::Noise) { (-1.0 / length).exp() } else { 0.0 };
        let cyclic = has(Imperfection::Cycles) && matches!(test.drive, Drive::Loop { .. });
        let (slow, cycles) = if cyclic { (s.slow_part, s.cycles) } else { (0.0, 0.0) };
        let stated = (has(Imperfection::Sigma) && !unstated).then_some(stated);
        life.tests.push(TestLife { params, effects, gains, correlation, slow, cycles, stated });
    }
    life
}

/// A nonlinearity that a part has which is called linear.
fn quirk(case: &mut Generated) -> Planted {
    let (draw, x1) = (&mut case.draw, case.bench.travel);
    let (effect, law) = match draw.below(2) {
        0 => ("cubic_stiffness", Law::Transverse { h: 24.0 * x1, x1 }),
        _ => ("quadratic_stiffness", Law::Exponential { h: 60.0 * x1, x1 }),
    };
    let size = draw.log(SETTINGS.nonlinearity.0, SETTINGS.nonlinearity.1) * draw.sign();
    Planted { effect: effect.into(), hidden: Hidden::Force(law), size, place: draw.below(case.bench.bodies) }
}

/// Springs, dampers and masses of a chain over those of their groups.
fn parts(case: &mut Generated) -> Vec<Part> {
    let (s, draw) = (SETTINGS, &mut case.draw);
    let one = |draw: &mut Draw, width: f64| (1.0 + width * draw.normal()).max(0.2);
    let mut parts: Vec<Part> = (0..case.bench.bodies)
        .map(|_| Part { stiffness: one(draw, s.stiffness), damping: one(draw, s.damping), mass: one(draw, s.mass) })
        .collect();
    if draw.chance(s.odd) && parts.len() > 1 {
        let at = 1 + draw.below(parts.len() - 1);
        parts[at].stiffness = 1.0 + s.odd_size * draw.sign();
    }
    parts
}
