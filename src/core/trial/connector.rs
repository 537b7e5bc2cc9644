//! One massless connector under a sine of displacement: the force is a function of the prescribed motion.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::bench::{Bench, Hidden, Planted, Record};
use super::law::{Memory, Motion};

/// Steps between two samples.
const FINE: usize = 32;

/// Force at every sample under a sine of this frequency, amplitude and mean, which grows over the run-up of the record; there what has a
/// closed form is taken as growing with it. `u` is the place of the test condition in its span.
pub fn march(
    b: &Bench,
    params: &[f64],
    planted: &[Planted],
    drive: (f64, f64, f64),
    (cycles, record): (usize, Record),
    u: f64,
) -> Vec<f64> {
    let (frequency, amplitude, mean) = drive;
    let w = TAU * frequency;
    let (mut k, c) = (params[0], params.get(1).copied().unwrap_or(0.0));
    let (mut gap, mut soft) = (0.0, 0.0);
    // Sine and cosine parts of what is linear.
    let mut closed = Complex64::new(0.0, 0.0);
    let mut marched = Vec::new();
    for p in planted {
        match &p.hidden {
            Hidden::Exponent => k *= (p.size * u).exp(),
            Hidden::Slope => k *= 1.0 + p.size * u,
            Hidden::Gap => gap += p.size * b.travel,
            Hidden::Compliance => soft += p.size / b.params[0],
            Hidden::Force(law) => match law.linear(w) {
                Some(z) => closed += b.force * p.size * z,
                None => marched.push((law, b.force * p.size, Memory::default())),
            },
        }
    }
    let own = k + Complex64::i() * w * c + closed;
    let z = amplitude * own / (1.0 + soft * own);
    // What has a closed form carries nothing at rest but the spring.
    let still = mean * k / (1.0 + soft * k);
    let turn = record.samples * FINE;
    let dt = 1.0 / (frequency * turn as f64);
    let mut slack = Slack { y: 0.0, k, c, half: 0.5 * gap };
    let mut out = Vec::with_capacity(cycles * record.samples);
    for j in 0..cycles * turn {
        let (sin, cos) = (TAU * (j % turn) as f64 / turn as f64).sin_cos();
        let (grown, rate) = grown(j as f64 / turn as f64, record.run_up as f64, frequency);
        let x = mean + grown * amplitude * sin;
        let v = amplitude * (grown * w * cos + rate * sin);
        let motion = Motion { x, v, a: amplitude * (2.0 * rate * w * cos - grown * w * w * sin) };
        let linear = if gap > 0.0 { slack.step(motion.x, dt) } else { still + grown * (z.re * sin + z.im * cos) };
        let hidden: f64 = marched.iter_mut().map(|(law, size, memory)| *size * law.force(motion, dt, memory)).sum();
        if j % FINE == 0 {
            out.push(linear + hidden);
        }
    }
    out
}

/// Part of the amplitude after so many cycles of a run-up of `over` cycles, in proportion to time, and its rate [1/s].
pub fn grown(cycles: f64, over: f64, frequency: f64) -> (f64, f64) {
    if cycles < over { (cycles / over, frequency / over) } else { (1.0, 0.0) }
}

/// Spring and damper behind hard stops with free play of twice `half`.
struct Slack {
    y: f64,
    k: f64,
    c: f64,
    half: f64,
}

impl Slack {
    /// Implicit Euler: on one stop, on the other, or between them without force.
    fn step(&mut self, x: f64, dt: f64) -> f64 {
        for side in [1.0, -1.0] {
            let y = x - side * self.half;
            let force = self.k * y + self.c * (y - self.y) / dt;
            if force * side >= 0.0 {
                self.y = y;
                return force;
            }
        }
        self.y *= self.c / (self.c + self.k * dt);
        0.0
    }
}
